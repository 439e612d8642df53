//! The context view (thesis 7.3.2): an image of the anatomy by ray casting, with the whole tumour
//! visible in it from every side.
//!
//! Lifetimes: an image's values once per `Arc` (4 bytes per voxel on the device); tables (40 KB, and a bit per brick)
//! once per transfer function; the tumour's bricks once per `Arc`; fibre tracts once per list of those shown (16 bytes
//! per point); with tracts 16 bytes per pixel more. Tracts coloured by values: 4 bytes per point and 8 per pixel more.

mod march;
mod projection;
#[cfg(test)]
mod projection_tests;
pub mod reference;
mod scene;
#[cfg(test)]
mod shape_tests;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::RegionVolume;

pub(crate) use march::{ImagePart, bind_march, shows_image};
pub use projection::ImageProjection;
#[cfg(test)]
pub(crate) use projection::LAYOUTS as PROJECTION_LAYOUTS;
pub use scene::{ContextScene, context_plan};
pub(crate) use scene::{around_light, no_image};

use projection::{PROJECTION, ProjectionPart};

use crate::{
    device::{Gpu, RenderError, pipelines::RasterShader, runner::Shader},
    image::uniforms::Marched,
    light::{
        self, LightSample,
        frame_error::FramePixels,
        lit::{LitScene, Opaque},
    },
    scene::{Plan, Quality},
    solid::{
        SURFACE,
        regions::RegionBuffers,
        tubes::{
            DrawnTubes, TUBES, TUBES_MERGE,
            buffers::{TubeBuffers, fiber_number},
            fiber_of,
        },
        view::{
            FAR, HAS_CONTEXT, HAS_PROJECTION, HAS_SURFACE, HAS_TUBES, LENS_ONLY_DRAWN, NO_SKIPPING,
            region_view, world_at,
        },
    },
    views::{
        Occlusion,
        view3d::{COMPOSE, Draw, Frame, Prepared, View3d},
    },
};

/// What is under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContextPick {
    /// The point that the pixel shows, RAS+ millimetres: on the voxel's face for the tumour; for the
    /// image where half of what lies behind is hidden, to within a step of the ray.
    pub world_mm: DVec3,
    /// Index bits of the tumour's region; `None` for anything else.
    pub bits: Option<u32>,
    /// The fibre of a tract; `None` for anything else. If both are `None`: tissue of the context image.
    pub fiber: Option<PickedFiber>,
}

/// A fibre of a tract.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PickedFiber {
    /// Which of the scene's sets of tubes.
    pub set: usize,
    /// Its number in that set's file, from 0.
    pub fiber: usize,
}

/// The context view, for [`crate::views::Renderer`].
pub struct Context {
    regions: Option<RegionBuffers>,
    image: ImagePart,
    projection: ProjectionPart,
    pub(crate) tubes: TubeBuffers,
}

/// Data that a frame's picks are looked up in.
#[doc(hidden)]
#[derive(Clone)]
pub struct FrameData {
    tumor: Option<Arc<RegionVolume>>,
    tubes: Vec<DrawnTubes>,
}

impl View3d for Context {
    type Scene = ContextScene;
    type Pick = ContextPick;
    type FrameData = FrameData;
    const IN_PARTS: bool = true;
    const SHADERS: &'static [&'static str] =
        &["closeup/surface", "tubes/merge", "context/march", "context/project", "context/compose"];

    fn plan(scene: &ContextScene, quality: &Quality) -> Plan {
        context_plan(scene, quality)
    }

    fn check(scene: &ContextScene) -> Result<(), RenderError> {
        scene.check()
    }

    fn start(gpu: &Gpu) -> Result<Self, RenderError> {
        Ok(Self {
            regions: None,
            image: ImagePart::new(gpu),
            projection: ProjectionPart::new(gpu),
            tubes: TubeBuffers::new(gpu),
        })
    }

    fn prepare(
        &mut self,
        draw: &mut Draw<'_>,
        scene: &ContextScene,
        _previous: Option<FrameData>,
    ) -> Result<Prepared<FrameData>, RenderError> {
        let (gpu, targets, size) = (draw.gpu, draw.targets, draw.size());
        let regions = RegionBuffers::reuse(&mut self.regions, gpu, scene.tumor.as_ref())?;
        let tumor = scene.tumor_scene();
        let reference_mm = scene.reference_mm();
        let mut flags = LENS_ONLY_DRAWN | light::flags(draw.quality.lighting.mode, draw.plan);
        for (pass, flag) in [
            (SURFACE, HAS_SURFACE),
            (crate::image::CONTEXT, HAS_CONTEXT),
            (TUBES_MERGE, HAS_TUBES),
            (PROJECTION, HAS_PROJECTION),
        ] {
            flags |= if draw.plan.has(pass) { flag } else { 0 };
        }
        flags |= if draw.switches.skipping { 0 } else { NO_SKIPPING };
        let mut view = region_view(&tumor, reference_mm, draw.quality, size, flags);
        regions.show(gpu, &tumor, &mut view);
        draw.write_view(&view);
        let tubes = draw.plan.has(TUBES_MERGE).then_some(scene.tubes.as_slice());
        self.tubes.prepare(gpu, tubes, &scene.camera, reference_mm, &view)?;
        let warning = self.image.prepare(draw, scene)?;

        let workgroups = draw.workgroups();
        if draw.plan.has(SURFACE) {
            let entries = [
                (0, draw.view.as_entire_binding()),
                (1, regions.table.as_entire_binding()),
                (2, regions.words.as_entire_binding()),
                (3, regions.regions.as_entire_binding()),
                (4, targets.depths.as_entire_binding()),
                (5, targets.surfaces.as_entire_binding()),
            ];
            draw.passes.bind(gpu, SURFACE, "closeup/surface", &entries, workgroups)?;
        }
        if draw.plan.has(TUBES_MERGE)
            && let (Some((drawing, entries)), Some(picture)) = (self.tubes.drawing(), self.tubes.picture())
        {
            let entries = [&entries[..], &[(0, draw.view.as_entire_binding())]].concat();
            let located = self.tubes.has_values();
            let shader = RasterShader { file: "tubes/draw", one_sided: false, located };
            draw.passes.bind_raster(gpu, TUBES, shader, &entries, drawing)?;
            let [values, scales] = self.tubes.values();
            let entries = [
                (0, draw.view.as_entire_binding()),
                (4, targets.depths.as_entire_binding()),
                (5, targets.surfaces.as_entire_binding()),
                (28, self.tubes.fibers().as_entire_binding()),
                (29, wgpu::BindingResource::TextureView(picture)),
                (30, self.tubes.shades().as_entire_binding()),
                (31, values.as_entire_binding()),
                (32, scales.as_entire_binding()),
            ];
            let constants: &[_] = if located { &[("located", 1.0)] } else { &[] };
            let shader = Shader { file: "tubes/merge", constants };
            draw.passes.bind(gpu, TUBES_MERGE, shader, &entries, workgroups)?;
        }
        let lit = LitScene {
            image: self.image.lit(scene, draw.plan),
            tumor: scene.tumor.as_ref(),
            selection: &scene.selection,
            camera: &scene.camera,
            reference_mm,
            size,
            quality: draw.quality,
            opaque: match (draw.plan.has(TUBES_MERGE), draw.plan.has(SURFACE)) {
                (true, _) => Opaque::Anywhere,
                (false, true) => Opaque::InMasks,
                (false, false) => Opaque::Nowhere,
            },
            solid_corners_mm: scene.solid_corners_mm(),
            ends_apart: false,
            view: draw.view,
            depths: &targets.depths,
            surfaces: &targets.surfaces,
            normals: &targets.normals,
            has_normals: false,
            // The buffer of the closeup's outer level, which has the same size per pixel.
            marched: &targets.outsides,
            occlusion: &targets.occlusion,
            blurred: &targets.blurred,
            bricks: Some([&regions.table, &regions.words]),
            shown: None,
            colors: &regions.regions,
        };
        let notes = draw.lights.bind(gpu, draw.passes, draw.plan, &lit)?;
        bind_march(draw, self.image.lit(scene, draw.plan).as_ref())?;
        let second = self.projection.bind(draw, scene.projection.as_ref(), &scene.camera, reference_mm)?;
        let picture = targets.color.create_view(&wgpu::TextureViewDescriptor::default());
        let entries = [
            (0, draw.view.as_entire_binding()),
            (3, regions.regions.as_entire_binding()),
            (4, targets.depths.as_entire_binding()),
            (5, targets.surfaces.as_entire_binding()),
            (6, targets.outsides.as_entire_binding()),
            (8, targets.blurred.as_entire_binding()),
            (10, wgpu::BindingResource::TextureView(&picture)),
            (28, self.tubes.fibers().as_entire_binding()),
            (30, self.tubes.shades().as_entire_binding()),
            (33, self.projection.projected().as_entire_binding()),
        ];
        let constants = light::composing_constants(draw.quality.lighting.mode, draw.plan);
        let shader = Shader { file: "context/compose", constants: &constants };
        draw.passes.bind(gpu, COMPOSE, shader, &entries, workgroups)?;
        let data = FrameData { tumor: scene.tumor.clone(), tubes: scene.tubes.clone() };
        Ok(Prepared {
            data,
            camera: scene.camera,
            reference_mm,
            warnings: warning.into_iter().chain(second).collect(),
            notes,
        })
    }

    fn has_light_reference(scene: &ContextScene, quality: &Quality) -> bool {
        scene.frame_scene().has_reference(quality)
    }

    fn light_sample(
        frame: &Frame<Self>,
        gpu: &Gpu,
        scene: &ContextScene,
        quality: &Quality,
    ) -> Result<Option<LightSample>, RenderError> {
        if !Self::has_light_reference(scene, quality) {
            return Ok(None);
        }
        let Occlusion { depths_mm, dark } = if frame.plan.has(SURFACE) || frame.plan.has(TUBES_MERGE) {
            frame.occlusion(gpu)?
        } else {
            let pixels = frame.size_px[0] as usize * frame.size_px[1] as usize;
            Occlusion { depths_mm: vec![f64::INFINITY; pixels], dark: vec![0.0; pixels] }
        };
        let is_tube = if frame.plan.has(TUBES_MERGE) { frame.is_tube(gpu)? } else { Vec::new() };
        let radiance = if shows_image(&frame.plan) { frame.image_rgba(gpu)? } else { Vec::new() };
        let pixels = FramePixels { depths_mm, dark, is_tube, radiance };
        Ok(LightSample::of(scene.frame_scene(), quality, frame.size_px, pixels))
    }

    fn pick(frame: &Frame<Self>, gpu: &Gpu, pixel: [u32; 2]) -> Result<Option<ContextPick>, RenderError> {
        let at = frame.linear(pixel);
        let has_geometry = frame.plan.has(SURFACE) || frame.plan.has(TUBES_MERGE);
        let mut parts = Vec::new();
        if has_geometry {
            parts.push((&frame.targets.depths, at * 4, 4));
            parts.push((&frame.targets.surfaces, at * 8, 8));
        }
        if shows_image(&frame.plan) {
            parts.push((&frame.targets.outsides, at * 16, 16));
        }
        if parts.is_empty() {
            return Ok(None);
        }
        let read = gpu.read_buffers(&parts)?;
        let mut read = read.iter();
        let found = |depth: f32, bits, fiber| {
            let world_mm = world_at(&frame.camera, frame.reference_mm, frame.size_px, pixel, depth);
            ContextPick { world_mm, bits, fiber }
        };
        let mut geometry = None;
        if has_geometry && let (Some(depth), Some(surface)) = (read.next(), read.next()) {
            let depth: f32 = bytemuck::pod_read_unaligned(depth);
            let surface: [u32; 2] = bytemuck::pod_read_unaligned(surface);
            geometry = (depth < FAR).then_some((depth, surface));
        }
        // The image is picked where it hides more than half of what is behind it. The march ends at
        // the tumour and at tubes.
        if let Some(marched) = read.next() {
            let marched: Marched = bytemuck::pod_read_unaligned(marched);
            if marched.depth < FAR {
                return Ok(Some(found(marched.depth, None, None)));
            }
        }
        let Some((depth, [number, face])) = geometry else { return Ok(None) };
        if let Some(fiber) = fiber_number(face) {
            let fiber = fiber_of(&frame.data.tubes, fiber).map(|(set, fiber)| PickedFiber { set, fiber });
            return Ok(fiber.map(|fiber| found(depth, None, Some(fiber))));
        }
        let bits = frame.data.tumor.as_ref().and_then(|t| t.bits_of_id().get(number as usize));
        Ok(bits.map(|&bits| found(depth, Some(bits), None)))
    }
}

impl Frame<Context> {
    /// Output of the ray march for each pixel drawn, rows from the top: premultiplied red, green, blue (encoded, 0 to
    /// 1) and opacity. For measurements: reads everything back.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn image_rgba(&self, gpu: &Gpu) -> Result<Vec<[f64; 4]>, RenderError> {
        let n = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        let read = gpu.read_buffers(&[(&self.targets.outsides, 0, n * 16)])?;
        let marched: Vec<Marched> =
            read.first().map(|bytes| bytemuck::pod_collect_to_vec(bytes)).unwrap_or_default();
        Ok(marched.iter().map(Marched::rgba).collect())
    }

    /// Whether each pixel drawn shows a fibre.
    fn is_tube(&self, gpu: &Gpu) -> Result<Vec<bool>, RenderError> {
        let n = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        let read = gpu.read_buffers(&[(&self.targets.surfaces, 0, n * 8)])?;
        let surfaces: Vec<[u32; 2]> =
            read.first().map(|bytes| bytemuck::pod_collect_to_vec(bytes)).unwrap_or_default();
        Ok(surfaces.iter().map(|[_, face]| fiber_number(*face).is_some()).collect())
    }
}

#[cfg(test)]
impl Context {
    /// Shaded colour and facing of the tube at each pixel of the last frame; empty without tubes.
    pub(crate) fn read_tube_shades(&self, gpu: &Gpu) -> Vec<[u8; 4]> {
        if self.tubes.picture().is_none() {
            return Vec::new();
        }
        let shades = self.tubes.shades();
        bytemuck::pod_collect_to_vec(&gpu.read_buffers(&[(shades, 0, shades.size())]).unwrap()[0])
    }
}
