//! The change view's passes on the device.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::change::SurfaceChange;

use super::{
    ARROWS, ARROWS_MERGE, ChangeScene, ChangeSurface, EARLIER, EARLIER_OUTLINE, HEIGHT_FILTER_ACROSS,
    HEIGHT_FILTER_DOWN, HEIGHTS,
    arrows::{self, ArrowBuffers},
    change_plan, surface,
    targets::{ChangeTargets, OpaqueTargets},
    uniforms,
};
use crate::{
    device::{
        Gpu, RenderError,
        pipelines::RasterShader,
        raster::RasterTargets,
        runner::{Drawing, Shader},
    },
    image::CONTEXT,
    light::{
        self,
        lit::{LitScene, Opaque},
    },
    scene::{Plan, Quality},
    solid::{
        OUTSIDE, SURFACE,
        regions::RegionBuffers,
        view::{FAR, HAS_CONTEXT, HAS_OUTSIDE, HAS_SURFACE, HAS_TUBES, View, region_view, world_at},
    },
    views::{
        context::{ImagePart, bind_march},
        view3d::{COMPOSE, Draw, Frame, Prepared, View3d},
    },
};

/// What is under a pixel: an arrow, or a voxel of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangePick {
    /// The voxel on the case grid: the surface's, or that which the arrow belongs to.
    pub voxel: [usize; 3],
    /// The point that the pixel shows, RAS+ millimetres: on the voxel's face, or on the arrow.
    pub world_mm: DVec3,
    /// Its change as computed, neither filtered nor rounded. `None` where the surface did not move, or
    /// has no partner.
    pub vector: Option<SurfaceChange>,
    /// For a component without a counterpart: whether it appeared, else it vanished. `None` for
    /// others.
    pub unpartnered: Option<bool>,
}

/// Lengths on the device.
struct LengthBuffers {
    surface: Arc<ChangeSurface>,
    table: wgpu::Buffer,
    log2_slots: u32,
}

impl LengthBuffers {
    fn new(gpu: &Gpu, surface: &Arc<ChangeSurface>) -> Result<Self, RenderError> {
        let Some((table, log2_slots)) = surface.lengths() else {
            let found = surface.volume().grid().voxel_count() as u64;
            return Err(RenderError::Volume { found, limit: u64::from(u32::MAX) - 1 });
        };
        let bytes: &[u8] = bytemuck::cast_slice(&table);
        gpu.check_size("the lengths of change", bytes.len() as u64)?;
        Ok(Self {
            surface: Arc::clone(surface),
            table: gpu.storage("LengthBuffers::table", bytes),
            log2_slots,
        })
    }
}

/// The change view, for [`crate::views::Renderer`].
pub struct Change {
    hull_view: wgpu::Buffer,
    earlier_view: wgpu::Buffer,
    change: wgpu::Buffer,
    triangles: wgpu::Buffer,
    triangle_corners: u32,
    regions: Option<RegionBuffers>,
    image: ImagePart,
    lengths: Option<LengthBuffers>,
    pub(super) arrows: Option<ArrowBuffers>,
    arrow_targets: Option<RasterTargets>,
    pub(super) opaque_targets: Option<OpaqueTargets>,
}

/// Data that a frame's picks are looked up in.
#[doc(hidden)]
#[derive(Clone)]
pub struct FrameData {
    pub(super) own: ChangeTargets,
    pub(super) surface: Option<Arc<ChangeSurface>>,
    /// Which of the change's vectors each arrow is.
    pub(super) vectors: Arc<Vec<u32>>,
}

/// The arrows of a frame, and their targets.
struct ArrowPart {
    vectors: Arc<Vec<u32>>,
    targets: RasterTargets,
    opaque: Option<OpaqueTargets>,
}

impl View3d for Change {
    type Scene = ChangeScene;
    type Pick = ChangePick;
    type FrameData = FrameData;
    const IN_PARTS: bool = true;
    const SHADERS: &'static [&'static str] = &[
        "change/surface",
        "closeup/surface",
        "change/arrows_merge",
        "context/march",
        "change/heights",
        "change/filter_across",
        "change/filter_down",
        "change/compose",
    ];

    fn plan(scene: &ChangeScene, quality: &Quality) -> Plan {
        change_plan(scene, quality)
    }

    fn check(scene: &ChangeScene) -> Result<(), RenderError> {
        scene.check()
    }

    fn start(gpu: &Gpu) -> Result<Self, RenderError> {
        let triangles = arrows::triangles();
        let corners = bytemuck::cast_slice(&triangles);
        Ok(Self {
            hull_view: gpu.uniform::<View>("Change::hull_view"),
            earlier_view: gpu.uniform::<View>("Change::earlier_view"),
            change: gpu.uniform::<uniforms::Change>("Change::change"),
            triangles: gpu.buffer_with("Change::triangles", corners, wgpu::BufferUsages::INDEX),
            triangle_corners: triangles.len() as u32,
            regions: None,
            image: ImagePart::new(gpu),
            lengths: None,
            arrows: None,
            arrow_targets: None,
            opaque_targets: None,
        })
    }

    fn prepare(
        &mut self,
        draw: &mut Draw<'_>,
        scene: &ChangeScene,
        previous: Option<FrameData>,
    ) -> Result<Prepared<FrameData>, RenderError> {
        let (gpu, targets, size) = (draw.gpu, draw.targets, draw.size());
        let mut own = previous.map_or_else(|| ChangeTargets::new(gpu, size), |data| data.own);
        own.keep_earlier(gpu, size, draw.plan.has(EARLIER));
        let context_scene = scene.context_scene();
        let reference_mm = context_scene.reference_mm();
        RegionBuffers::reuse(&mut self.regions, gpu, scene.surface.as_ref().map(|s| s.volume()))?;
        let tumor = context_scene.tumor_scene();
        let mut flags = light::flags(draw.quality.lighting.mode, draw.plan);
        for (pass, flag) in [
            (SURFACE, HAS_SURFACE),
            (OUTSIDE, HAS_OUTSIDE),
            (CONTEXT, HAS_CONTEXT),
            (ARROWS_MERGE, HAS_TUBES),
        ] {
            flags |= if draw.plan.has(pass) { flag } else { 0 };
        }
        let mut view = region_view(&tumor, reference_mm, draw.quality, size, flags);
        if let Some(regions) = &self.regions {
            regions.show(gpu, &tumor, &mut view);
        }
        draw.write_view(&view);
        // The whole union, and all of the earlier date, whichever part of them is shown.
        let bits = scene.surface.as_ref().map_or(&[][..], |s| s.volume().bits_of_id());
        let with = |wanted: u32| {
            let regions = bits.iter().enumerate().filter(|(_, bits)| *bits & wanted != 0);
            View { selected: regions.fold(0, |set, (n, _)| set | 1 << n), ..view }
        };
        for (buffer, view) in [(&self.hull_view, with(u32::MAX)), (&self.earlier_view, with(surface::BEFORE))]
        {
            gpu.queue.write_buffer(buffer, 0, bytemuck::bytes_of(&view));
        }
        let warning = self.image.prepare(draw, &context_scene)?;
        let log2_slots = self.prepare_lengths(draw, scene)?;
        let arrow_part = self.prepare_arrows(draw, scene)?;
        let mut change = uniforms::Change::default();
        if let Some(surface) = scene.surface.as_deref() {
            let samples = arrow_part.targets.samples;
            change = uniforms::change(scene, surface, draw.plan, &view, reference_mm, log2_slots, samples);
        }
        gpu.queue.write_buffer(&self.change, 0, bytemuck::bytes_of(&change));

        self.bind_surfaces(draw, &own)?;
        self.bind_arrows(draw, &arrow_part)?;
        let Some(regions) = &self.regions else { return Err(RenderError::Device("no regions".into())) };
        let opaque = arrow_part.opaque.as_ref();
        let image = self.image.lit(&context_scene, draw.plan);
        let lit = LitScene {
            image,
            tumor: context_scene.tumor.as_ref(),
            selection: &context_scene.selection,
            camera: &context_scene.camera,
            reference_mm,
            size,
            quality: draw.quality,
            opaque: match (opaque, draw.plan.has(SURFACE)) {
                (Some(_), _) => Opaque::Anywhere,
                (None, true) => Opaque::InMasks,
                (None, false) => Opaque::Nowhere,
            },
            solid_corners_mm: context_scene.solid_corners_mm(),
            ends_apart: opaque.is_some(),
            view: draw.view,
            depths: opaque.map_or(&targets.depths, |o| &o.depths),
            surfaces: opaque.map_or(&targets.surfaces, |o| &o.faces),
            normals: &targets.normals,
            has_normals: false,
            marched: &targets.outsides,
            occlusion: &targets.occlusion,
            blurred: &targets.blurred,
            bricks: Some([&regions.table, &regions.words]),
            shown: None,
            colors: &regions.regions,
        };
        let notes = draw.lights.bind(gpu, draw.passes, draw.plan, &lit)?;
        bind_march(draw, image.as_ref())?;
        self.bind_heights(draw, &own)?;
        self.bind_composing(draw, &own, &arrow_part)?;
        let data = FrameData { own, surface: scene.surface.clone(), vectors: arrow_part.vectors };
        let warnings = warning.into_iter().collect();
        Ok(Prepared { data, camera: scene.camera, reference_mm, warnings, notes })
    }

    /// The arrow in front (where it covers at least a quarter of the pixel), else the surface; the translucent hull is
    /// ignored.
    fn pick(frame: &Frame<Self>, gpu: &Gpu, pixel: [u32; 2]) -> Result<Option<ChangePick>, RenderError> {
        let FrameData { own, surface, vectors } = &frame.data;
        let Some(surface) = surface else { return Ok(None) };
        let at = frame.linear(pixel);
        let read = gpu.read_buffers(&[
            (&own.tops, at * 8, 8),
            (&frame.targets.depths, at * 4, 4),
            (&own.cells, at * 4, 4),
        ])?;
        let [top, depth, cell] = read.as_slice() else { return Ok(None) };
        let world = |depth| world_at(&frame.camera, frame.reference_mm, frame.size_px, pixel, depth);
        let [number, arrow_depth]: [u32; 2] = bytemuck::pod_read_unaligned(top);
        let vector = (number as usize).checked_sub(1).and_then(|i| vectors.get(i));
        if let Some(vector) = vector.and_then(|&i| surface.change().vectors.get(i as usize)) {
            return Ok(Some(ChangePick {
                voxel: vector.voxel,
                world_mm: world(f32::from_bits(arrow_depth)),
                vector: Some(*vector),
                unpartnered: None,
            }));
        }
        let depth: f32 = bytemuck::pod_read_unaligned(depth);
        // NaN is not a depth.
        if !frame.plan.has(SURFACE) || depth.is_nan() || depth >= FAR {
            return Ok(None);
        }
        let cell: u32 = bytemuck::pod_read_unaligned(cell);
        let voxel = surface.voxel(cell as usize);
        Ok(Some(ChangePick {
            voxel,
            world_mm: world(depth),
            vector: surface.vector(voxel).copied(),
            unpartnered: surface.unpartnered(voxel).map(|u| u.appeared),
        }))
    }
}

impl Frame<Change> {
    /// Number of arrows drawn; 0 for a height map.
    pub fn arrow_count(&self) -> usize {
        self.data.vectors.len()
    }
}

impl Change {
    /// Uploads the table of lengths if the plan uses it; returns the binary logarithm of its size.
    fn prepare_lengths(&mut self, draw: &Draw<'_>, scene: &ChangeScene) -> Result<u32, RenderError> {
        let Some(surface) = scene.surface.as_ref().filter(|_| draw.plan.has(HEIGHTS)) else { return Ok(1) };
        let made = match self.lengths.take().filter(|l| Arc::ptr_eq(&l.surface, surface)) {
            Some(lengths) => lengths,
            None => LengthBuffers::new(draw.gpu, surface)?,
        };
        Ok(self.lengths.insert(made).log2_slots)
    }

    fn prepare_arrows(&mut self, draw: &Draw<'_>, scene: &ChangeScene) -> Result<ArrowPart, RenderError> {
        let (gpu, size) = (draw.gpu, draw.size());
        let mut vectors = Arc::default();
        let mut drawn = None;
        match scene.surface.as_ref().filter(|_| draw.plan.has(ARROWS)) {
            Some(surface) => {
                let buffers = ArrowBuffers::reuse(&mut self.arrows, gpu, surface, scene.look.threshold_mm)?;
                vectors = Arc::clone(&buffers.vectors);
                drawn = Some(size);
            }
            None => self.arrows = None,
        }
        let merged = draw.plan.has(ARROWS_MERGE).then_some(size);
        Ok(ArrowPart {
            vectors,
            targets: RasterTargets::reuse(&mut self.arrow_targets, gpu, drawn, (2, false))?,
            opaque: OpaqueTargets::reuse(&mut self.opaque_targets, gpu, merged)?,
        })
    }

    /// First hits of the opaque part of the union, and of all of it.
    fn bind_surfaces(&self, draw: &mut Draw<'_>, own: &ChangeTargets) -> Result<(), RenderError> {
        let (gpu, targets, workgroups) = (draw.gpu, draw.targets, draw.workgroups());
        let Some(regions) = &self.regions else { return Ok(()) };
        let voxels = [
            (1, regions.table.as_entire_binding()),
            (2, regions.words.as_entire_binding()),
            (3, regions.regions.as_entire_binding()),
        ];
        if draw.plan.has(SURFACE) {
            let first = [
                (0, draw.view.as_entire_binding()),
                (4, targets.depths.as_entire_binding()),
                (5, targets.surfaces.as_entire_binding()),
                (17, own.cells.as_entire_binding()),
            ];
            let entries = [&voxels[..], &first].concat();
            draw.passes.bind(gpu, SURFACE, "change/surface", &entries, workgroups)?;
        }
        if draw.plan.has(OUTSIDE) {
            let hull = [
                (0, self.hull_view.as_entire_binding()),
                (4, own.hull_depths.as_entire_binding()),
                (5, own.hull_surfaces.as_entire_binding()),
            ];
            let entries = [&voxels[..], &hull].concat();
            draw.passes.bind(gpu, OUTSIDE, "closeup/surface", &entries, workgroups)?;
        }
        if let Some([depths, surfaces]) = &own.earlier {
            let earlier = [
                (0, self.earlier_view.as_entire_binding()),
                (4, depths.as_entire_binding()),
                (5, surfaces.as_entire_binding()),
            ];
            let entries = [&voxels[..], &earlier].concat();
            draw.passes.bind(gpu, EARLIER, "closeup/surface", &entries, workgroups)?;
        }
        Ok(())
    }

    /// Arrows in a texture of their own, and merged into the opaque geometry if light passes need that.
    fn bind_arrows(&self, draw: &mut Draw<'_>, part: &ArrowPart) -> Result<(), RenderError> {
        let (gpu, targets, workgroups) = (draw.gpu, draw.targets, draw.workgroups());
        if let Some(arrows) = self.arrows.as_ref().filter(|_| draw.plan.has(ARROWS)) {
            let entries = [
                (0, draw.view.as_entire_binding()),
                (16, self.change.as_entire_binding()),
                (24, arrows.instances.as_entire_binding()),
            ];
            let drawing = Drawing {
                picture: part.targets.picture.clone(),
                depths: part.targets.depths.clone(),
                indices: self.triangles.clone(),
                index_count: self.triangle_corners,
                instances: part.vectors.len() as u32,
            };
            let shader = RasterShader { file: "change/arrows", one_sided: true, located: false };
            draw.passes.bind_raster(gpu, ARROWS, shader, &entries, drawing)?;
        }
        if let Some(opaque) = part.opaque.as_ref().filter(|_| draw.plan.has(ARROWS_MERGE)) {
            let entries = [
                (0, draw.view.as_entire_binding()),
                (4, targets.depths.as_entire_binding()),
                (5, targets.surfaces.as_entire_binding()),
                (16, self.change.as_entire_binding()),
                (25, wgpu::BindingResource::TextureView(&part.targets.picture)),
                (39, opaque.depths.as_entire_binding()),
                (40, opaque.faces.as_entire_binding()),
            ];
            draw.passes.bind(gpu, ARROWS_MERGE, "change/arrows_merge", &entries, workgroups)?;
        }
        Ok(())
    }

    /// The height map and its filter.
    fn bind_heights(&self, draw: &mut Draw<'_>, own: &ChangeTargets) -> Result<(), RenderError> {
        let (gpu, targets, workgroups) = (draw.gpu, draw.targets, draw.workgroups());
        if let Some(lengths) = self.lengths.as_ref().filter(|_| draw.plan.has(HEIGHTS)) {
            let entries = [
                (0, draw.view.as_entire_binding()),
                (5, targets.surfaces.as_entire_binding()),
                (16, self.change.as_entire_binding()),
                (17, own.cells.as_entire_binding()),
                (18, lengths.table.as_entire_binding()),
                (19, own.heights.as_entire_binding()),
            ];
            draw.passes.bind(gpu, HEIGHTS, "change/heights", &entries, workgroups)?;
        }
        for (pass, shader, from, to) in [
            (HEIGHT_FILTER_ACROSS, "change/filter_across", &own.heights, &own.across),
            (HEIGHT_FILTER_DOWN, "change/filter_down", &own.across, &own.filtered),
        ] {
            if draw.plan.has(pass) {
                let entries = [
                    (0, draw.view.as_entire_binding()),
                    (4, targets.depths.as_entire_binding()),
                    (16, self.change.as_entire_binding()),
                    (19, from.as_entire_binding()),
                    (20, to.as_entire_binding()),
                ];
                draw.passes.bind(gpu, pass, shader, &entries, workgroups)?;
            }
        }
        Ok(())
    }

    fn bind_composing(
        &self,
        draw: &mut Draw<'_>,
        own: &ChangeTargets,
        part: &ArrowPart,
    ) -> Result<(), RenderError> {
        let (targets, workgroups) = (draw.targets, draw.workgroups());
        if let Some([depths, surfaces]) = &own.earlier {
            let entries = [
                (0, draw.view.as_entire_binding()),
                (4, depths.as_entire_binding()),
                (5, surfaces.as_entire_binding()),
                (23, own.tops.as_entire_binding()),
            ];
            draw.passes.bind(draw.gpu, EARLIER_OUTLINE, "change/outline", &entries, workgroups)?;
        }
        let heights = if draw.plan.has(HEIGHT_FILTER_DOWN) { &own.filtered } else { &own.heights };
        let picture = targets.color.create_view(&wgpu::TextureViewDescriptor::default());
        let entries = [
            (0, draw.view.as_entire_binding()),
            (4, targets.depths.as_entire_binding()),
            (5, targets.surfaces.as_entire_binding()),
            (6, targets.outsides.as_entire_binding()),
            (8, targets.blurred.as_entire_binding()),
            (10, wgpu::BindingResource::TextureView(&picture)),
            (16, self.change.as_entire_binding()),
            (19, heights.as_entire_binding()),
            (21, own.hull_depths.as_entire_binding()),
            (22, own.hull_surfaces.as_entire_binding()),
            (23, own.tops.as_entire_binding()),
            (25, wgpu::BindingResource::TextureView(&part.targets.picture)),
        ];
        let constants = light::composing_constants(draw.quality.lighting.mode, draw.plan);
        let shader = Shader { file: "change/compose", constants: &constants };
        draw.passes.bind(draw.gpu, COMPOSE, shader, &entries, workgroups)
    }
}
