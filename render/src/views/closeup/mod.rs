//! The tumour intersection closeup (thesis 7.3.3): the regions of all masks by exact voxel ray casting, through the
//! lens.
//!
//! Lifetimes: a region volume's bricks once per `Arc` (cut on all cores, then one upload); the uniform, about 200
//! bytes, and a small table of colours once per frame.

#[cfg(test)]
mod normals_tests;
#[cfg(test)]
mod stability_tests;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::RegionVolume;

use crate::{
    device::{Gpu, RenderError, runner::Shader},
    light::{
        self, LightSample, NO_IMAGE,
        frame_error::{FramePixels, FrameScene},
        lit::{LitKind, LitScene, Opaque},
        traced::RAYS,
    },
    scene::{Lens, Plan, Quality, RegionScene, lens::check_view},
    solid::{
        NORMALS, OUTSIDE, SMOOTH, SURFACE,
        plane::{HAS_PLANE, PlaneBuffers},
        regions::RegionBuffers,
        shown::ShownVoxels,
        view::{
            FAR, HAS_OUTSIDE, HAS_SURFACE, NO_SKIPPING, OutsideHit, SMOOTH_SURFACE, reference_mm,
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
pub struct Pick {
    /// The region's index bits: bit k set for mask k.
    pub bits: u32,
    /// The point on the voxel's face that the pixel shows, RAS+ millimetres.
    pub world_mm: DVec3,
    /// Whether the selection applies there: in the lens, or anywhere if it is off. Otherwise it is
    /// faint outer tissue.
    pub inside_lens: bool,
}

/// The closeup, for [`crate::views::Renderer`].
pub struct Closeup {
    regions: Option<RegionBuffers>,
    shown: Option<ShownVoxels>,
    plane: PlaneBuffers,
}

/// Data that a frame's picks are looked up in.
#[doc(hidden)]
#[derive(Clone)]
pub struct FrameData {
    tumor: Option<Arc<RegionVolume>>,
    lens: Option<Lens>,
}

/// Whether the lens contains every corner of the volume's box.
fn covers(lens: &Lens, corners_mm: &[DVec3; 8]) -> bool {
    corners_mm.iter().all(|c| c.distance(lens.center_mm) <= lens.radius_mm)
}

/// What a frame shows that its light's error depends on.
pub(crate) fn frame_scene(scene: &RegionScene, quality: &Quality) -> FrameScene {
    FrameScene {
        camera: scene.camera,
        tumor: scene.tumor.clone(),
        selection: scene.selection.clone(),
        cut: scene.lens,
        is_smooth: light::shows_smooth(quality),
        tubes: Vec::new(),
        image: None,
    }
}

/// The passes that `scene` needs at `quality`. Omitting the others changes no pixel.
pub fn closeup_plan(scene: &RegionScene, quality: &Quality) -> Plan {
    let tumor = scene.tumor.as_deref();
    let no_surface = scene.nothing_shown();
    let no_outside = match (tumor, &scene.lens) {
        (None, _) => no_surface,
        (_, None) => Some("lens is off"),
        (Some(t), Some(lens)) if covers(lens, &t.grid().corners_mm()) => {
            Some("lens covers everything: nothing lies outside")
        }
        _ => None,
    };
    let light = light::passes(quality.lighting.mode, LitKind::Masks);
    let order = [SURFACE, SMOOTH, NORMALS, OUTSIDE].into_iter().chain(light.iter().copied()).chain([COMPOSE]);
    Plan::of(order, |pass| match pass {
        SURFACE | NORMALS => no_surface,
        SMOOTH if quality.smooth && !light::shows_smooth(quality) => Some("cones of light read the voxels"),
        SMOOTH => no_surface.or((!quality.smooth).then_some("voxels are shown as they are")),
        OUTSIDE => no_outside,
        _ => light::omission_reason(pass, quality, no_surface, Some(NO_IMAGE)),
    })
}

impl View3d for Closeup {
    type Scene = RegionScene;
    type Pick = Pick;
    type FrameData = FrameData;
    const IN_PARTS: bool = true;
    const SHADERS: &'static [&'static str] =
        &["closeup/surface", "closeup/smooth", "closeup/normals", "closeup/outside", "closeup/compose"];

    fn plan(scene: &RegionScene, quality: &Quality) -> Plan {
        closeup_plan(scene, quality)
    }

    fn check(scene: &RegionScene) -> Result<(), RenderError> {
        check_view(&scene.camera, scene.lens.as_ref())
    }

    fn start(gpu: &Gpu) -> Result<Self, RenderError> {
        Ok(Self { regions: None, shown: None, plane: PlaneBuffers::new(gpu) })
    }

    fn prepare(
        &mut self,
        draw: &mut Draw<'_>,
        scene: &RegionScene,
        _previous: Option<FrameData>,
    ) -> Result<Prepared<FrameData>, RenderError> {
        let (gpu, targets, size) = (draw.gpu, draw.targets, draw.size());
        let regions = RegionBuffers::reuse(&mut self.regions, gpu, scene.tumor.as_ref())?;
        let reference_mm = reference_mm(scene);
        let mut flags = light::flags(draw.quality.lighting.mode, draw.plan);
        for (pass, flag) in [(SURFACE, HAS_SURFACE), (OUTSIDE, HAS_OUTSIDE), (SMOOTH, SMOOTH_SURFACE)] {
            flags |= if draw.plan.has(pass) { flag } else { 0 };
        }
        flags |= if draw.switches.skipping { 0 } else { NO_SKIPPING };
        let mut view = region_view(scene, reference_mm, draw.quality, size, flags);
        if draw.plan.has(RAYS) {
            view.occlusion_rays = draw.quality.occlusion_rays.clamp(1, Quality::MOST_RAYS) as f32;
        }
        self.plane.update(gpu, scene.plane.as_ref(), &scene.camera, reference_mm, &mut view)?;
        regions.show(gpu, scene, &mut view);
        draw.write_view(&view);

        let workgroups = draw.workgroups();
        let bricks = [
            (0, draw.view.as_entire_binding()),
            (1, regions.table.as_entire_binding()),
            (2, regions.words.as_entire_binding()),
            (4, targets.depths.as_entire_binding()),
        ];
        let voxels = [&bricks[..], &[(3, regions.regions.as_entire_binding())]].concat();
        if draw.plan.has(SURFACE) {
            let entries = [&voxels[..], &[(5, targets.surfaces.as_entire_binding())]].concat();
            draw.passes.bind(gpu, SURFACE, "closeup/surface", &entries, workgroups)?;
        }
        let shown = if draw.plan.has(NORMALS) {
            Some(ShownVoxels::reuse(&mut self.shown, gpu, scene.tumor.as_ref(), &scene.selection)?)
        } else {
            None
        };
        if let Some(shown) = shown.filter(|_| draw.plan.has(SMOOTH)) {
            let surface = [(5, targets.surfaces.as_entire_binding()), (41, shown.bits.as_entire_binding())];
            let entries = [&bricks[..], &surface].concat();
            draw.passes.bind(gpu, SMOOTH, "closeup/smooth", &entries, workgroups)?;
        }
        if let Some(shown) = shown {
            let entries = [
                (0, draw.view.as_entire_binding()),
                (4, targets.depths.as_entire_binding()),
                (5, targets.surfaces.as_entire_binding()),
                (40, targets.normals.as_entire_binding()),
                (41, shown.bits.as_entire_binding()),
            ];
            draw.passes.bind(gpu, NORMALS, "closeup/normals", &entries, workgroups)?;
        }
        if draw.plan.has(OUTSIDE) {
            let entries = [&voxels[..], &[(6, targets.outsides.as_entire_binding())]].concat();
            draw.passes.bind(gpu, OUTSIDE, "closeup/outside", &entries, workgroups)?;
        }
        let lit = LitScene {
            image: None,
            tumor: scene.tumor.as_ref(),
            selection: &scene.selection,
            camera: &scene.camera,
            reference_mm,
            size,
            quality: draw.quality,
            opaque: if draw.plan.has(SURFACE) { Opaque::InMasks } else { Opaque::Nowhere },
            solid_corners_mm: scene.tumor.iter().flat_map(|t| t.grid().corners_mm()).collect(),
            ends_apart: false,
            view: draw.view,
            depths: &targets.depths,
            surfaces: &targets.surfaces,
            normals: &targets.normals,
            has_normals: draw.plan.has(NORMALS),
            marched: &targets.outsides,
            occlusion: &targets.occlusion,
            blurred: &targets.blurred,
            bricks: Some([&regions.table, &regions.words]),
            shown: shown.map(|shown| &shown.bits),
            colors: &regions.regions,
        };
        let notes = draw.lights.bind(gpu, draw.passes, draw.plan, &lit)?;
        let picture = targets.color.create_view(&wgpu::TextureViewDescriptor::default());
        let entries = [
            (0, draw.view.as_entire_binding()),
            (3, regions.regions.as_entire_binding()),
            (4, targets.depths.as_entire_binding()),
            (5, targets.surfaces.as_entire_binding()),
            (6, targets.outsides.as_entire_binding()),
            (8, targets.blurred.as_entire_binding()),
            (10, wgpu::BindingResource::TextureView(&picture)),
            (40, targets.normals.as_entire_binding()),
        ];
        let entries = [&entries[..], &self.plane.entries()].concat();
        // Most frames have no slice, and those with the lens an outside: only other ones have a pipeline of their own.
        let outside = (!draw.plan.has(OUTSIDE)).then_some(("has_outside", 0.0));
        let slice = (view.flags & HAS_PLANE != 0).then_some(("has_slice", 1.0));
        let tint = light::composing_constants(draw.quality.lighting.mode, draw.plan);
        let constants: Vec<_> = outside.into_iter().chain(slice).chain(tint).collect();
        let shader = Shader { file: "closeup/compose", constants: &constants };
        draw.passes.bind(gpu, COMPOSE, shader, &entries, workgroups)?;
        let data = FrameData { tumor: scene.tumor.clone(), lens: scene.lens };
        Ok(Prepared { data, camera: scene.camera, reference_mm, warnings: Vec::new(), notes })
    }

    fn has_light_reference(scene: &RegionScene, quality: &Quality) -> bool {
        frame_scene(scene, quality).has_reference(quality)
    }

    fn light_sample(
        frame: &Frame<Self>,
        gpu: &Gpu,
        scene: &RegionScene,
        quality: &Quality,
    ) -> Result<Option<LightSample>, RenderError> {
        // Asked first: nothing is read back in vain.
        if !Self::has_light_reference(scene, quality) {
            return Ok(None);
        }
        let Occlusion { depths_mm, dark } = frame.occlusion(gpu)?;
        let pixels = FramePixels { depths_mm, dark, ..FramePixels::default() };
        Ok(LightSample::of(frame_scene(scene, quality), quality, frame.size_px, pixels))
    }

    fn pick(frame: &Frame<Self>, gpu: &Gpu, pixel: [u32; 2]) -> Result<Option<Pick>, RenderError> {
        let at = frame.linear(pixel);
        let mut parts = Vec::new();
        if frame.plan.has(SURFACE) {
            parts.push((&frame.targets.depths, at * 4, 4));
            parts.push((&frame.targets.surfaces, at * 8, 8));
        }
        if frame.plan.has(OUTSIDE) {
            parts.push((&frame.targets.outsides, at * 16, 16));
        }
        if parts.is_empty() {
            return Ok(None);
        }
        let found = |number: u32, depth: f32, inside_lens: bool| {
            let bits = *frame.data.tumor.as_ref()?.bits_of_id().get(number as usize)?;
            let world_mm = world_at(&frame.camera, frame.reference_mm, frame.size_px, pixel, depth);
            Some(Pick { bits, world_mm, inside_lens })
        };
        let read = gpu.read_buffers(&parts)?;
        let mut read = read.iter();
        if frame.plan.has(SURFACE)
            && let (Some(depth), Some(surface)) = (read.next(), read.next())
        {
            let depth: f32 = bytemuck::pod_read_unaligned(depth);
            let [number, _]: [u32; 2] = bytemuck::pod_read_unaligned(surface);
            if depth < FAR {
                return Ok(found(number, depth, true));
            }
        }
        if let Some(outside) = read.next() {
            let hit: OutsideHit = bytemuck::pod_read_unaligned(outside);
            if hit.depth < FAR {
                return Ok(found(hit.number, hit.depth, frame.data.lens.is_none()));
            }
        }
        Ok(None)
    }
}
