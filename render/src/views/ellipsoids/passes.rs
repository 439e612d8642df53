//! The diagram's passes on the device.

use glam::DVec3;

use super::{
    COMPOSE, DrawnEllipsoid, EllipsoidScene, LISTS, REST,
    bins::{self, Bins, GpuEllipsoid, in_lens},
    ellipsoid_plan,
};
use crate::{
    device::{
        Gpu, RenderError,
        buffers::{GrowingBuffer, WRITTEN},
        runner::Shader,
    },
    light::{
        self,
        lit::{LitScene, Opaque},
    },
    scene::{Plan, Quality, lens::check_view},
    solid::{
        plane::PlaneBuffers,
        view::{FAR, HAS_SURFACE, NO_SKIPPING, View, camera_view, reference_to, rgba, world_at},
    },
    views::view3d::{Draw, Frame, Prepared, View3d},
};

/// Bytes of a fragment: its depth and its ellipsoid.
const NODE_BYTES: u64 = 8;
/// Up to this many fragments, the nodes are allocated for the boxes' upper bound, without counting (32 MiB).
const FEW_NODES: u64 = 1 << 22;
/// Maximum size of the nodes, if the device allows it.
const MOST_BYTES: u64 = 1 << 29;

/// What is under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EllipsoidPick {
    /// The nearest ellipsoid's id.
    pub id: u32,
    /// The point on its surface, RAS+ millimetres. Slices don't hide it.
    pub world_mm: DVec3,
    /// Whether that point is in the lens; always, when the lens is off.
    pub inside_lens: bool,
}

/// The ellipsoid diagram, for [`crate::views::Renderer`].
pub struct Ellipsoids {
    ellipsoids: GrowingBuffer,
    colors: GrowingBuffer,
    tiles: GrowingBuffer,
    pub(super) nodes: GrowingBuffer,
    counters: wgpu::Buffer,
    plane: PlaneBuffers,
    /// Above this upper bound, fragments are counted.
    pub(super) few_nodes: u64,
    /// How often fragments were counted and the nodes grew.
    #[cfg(test)]
    pub(super) grown: u32,
}

/// Data that a frame's picks are looked up in.
#[doc(hidden)]
#[derive(Clone)]
pub struct FrameData {
    scene: EllipsoidScene,
    pub(super) drawn: Vec<DrawnEllipsoid>,
}

impl View3d for Ellipsoids {
    type Scene = EllipsoidScene;
    type Pick = EllipsoidPick;
    type FrameData = FrameData;
    const IN_PARTS: bool = false;
    const SHADERS: &'static [&'static str] = &["ellipsoids/lists", "ellipsoids/compose", "ellipsoids/rest"];

    fn plan(scene: &EllipsoidScene, quality: &Quality) -> Plan {
        ellipsoid_plan(scene, quality)
    }

    fn check(scene: &EllipsoidScene) -> Result<(), RenderError> {
        check_view(&scene.camera, scene.lens.as_ref())?;
        if !scene.opacity.is_finite() || scene.ellipsoids.iter().any(|e| !e.opacity.is_finite()) {
            return Err(RenderError::Scene("an opacity that is not a number".to_owned()));
        }
        Ok(())
    }

    fn start(gpu: &Gpu) -> Result<Self, RenderError> {
        let counters = WRITTEN | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            ellipsoids: GrowingBuffer::new(gpu, "the ellipsoids", size_of::<GpuEllipsoid>() as u64),
            colors: GrowingBuffer::new(gpu, "the colours of ellipsoids", 16),
            tiles: GrowingBuffer::new(gpu, "the ellipsoids of every tile", 16),
            nodes: GrowingBuffer::new(gpu, "the fragments of ellipsoids", NODE_BYTES * 2),
            counters: gpu.buffer("Ellipsoids::counters", 16, counters),
            plane: PlaneBuffers::new(gpu),
            few_nodes: FEW_NODES,
            #[cfg(test)]
            grown: 0,
        })
    }

    /// Returns when the work is submitted; scenes of millions of fragments wait once, to count them.
    fn prepare(
        &mut self,
        draw: &mut Draw<'_>,
        scene: &EllipsoidScene,
        _previous: Option<FrameData>,
    ) -> Result<Prepared<FrameData>, RenderError> {
        let (gpu, targets, size) = (draw.gpu, draw.targets, draw.size());
        let reference_mm = reference_to(&scene.camera, scene.middle_mm());
        let drawn = bins::in_order(scene);
        let packed = bins::packed(scene, &drawn, reference_mm)?;
        let mut view = View {
            background: rgba(scene.background),
            silhouette: rgba(scene.silhouette),
            ..camera_view(&scene.camera, reference_mm, scene.lens.as_ref(), draw.quality, size)
        };
        view.flags |= light::flags(draw.quality.lighting.mode, draw.plan);
        view.flags |= if draw.plan.has(LISTS) { HAS_SURFACE } else { 0 };
        view.flags |= if draw.switches.skipping { 0 } else { NO_SKIPPING };
        self.plane.update(gpu, scene.plane.as_ref(), &scene.camera, reference_mm, &mut view)?;
        draw.write_view(&view);
        if draw.plan.has(LISTS) {
            if self.upload(draw, scene, &drawn, &packed)? {
                draw.plan.omitted.push((REST, "every fragment has room"));
            } else {
                draw.plan.passes.push(REST);
            }
        }
        gpu.queue.write_buffer(&self.counters, 0, &[0; 16]);
        if draw.plan.has(LISTS) {
            self.bind_lists(draw)?;
        }
        let lit = LitScene {
            image: None,
            tumor: None,
            selection: &glioscope_core::Selection::all(),
            camera: &scene.camera,
            reference_mm,
            size,
            quality: draw.quality,
            opaque: Opaque::Anywhere,
            solid_corners_mm: scene.bounds_mm().map_or(Vec::new(), |b| crate::solid::corners_mm(b).to_vec()),
            ends_apart: false,
            view: draw.view,
            depths: &targets.depths,
            surfaces: &targets.surfaces,
            normals: &targets.normals,
            has_normals: false,
            marched: &targets.outsides,
            occlusion: &targets.occlusion,
            blurred: &targets.blurred,
            bricks: None,
            shown: None,
            colors: self.colors.buffer(),
        };
        let notes = draw.lights.bind(gpu, draw.passes, draw.plan, &lit)?;
        self.bind_composing(draw)?;
        let data = FrameData { scene: scene.clone(), drawn };
        Ok(Prepared { data, camera: scene.camera, reference_mm, warnings: Vec::new(), notes })
    }

    fn pick(frame: &Frame<Self>, gpu: &Gpu, pixel: [u32; 2]) -> Result<Option<EllipsoidPick>, RenderError> {
        if !frame.plan.has(LISTS) {
            return Ok(None);
        }
        let at = frame.linear(pixel);
        let read =
            gpu.read_buffers(&[(&frame.targets.depths, at * 4, 4), (&frame.targets.surfaces, at * 8, 4)])?;
        let [depth, number] = read.as_slice() else { return Ok(None) };
        let depth: f32 = bytemuck::pod_read_unaligned(depth);
        let number: u32 = bytemuck::pod_read_unaligned(number);
        let FrameData { scene, drawn } = &frame.data;
        let Some(ellipsoid) = drawn.get(number as usize).filter(|_| depth < FAR) else { return Ok(None) };
        let world_mm = world_at(&scene.camera, frame.reference_mm, frame.size_px, pixel, depth);
        Ok(Some(EllipsoidPick { id: ellipsoid.id, world_mm, inside_lens: in_lens(scene, world_mm) }))
    }
}

impl Ellipsoids {
    /// Uploads ellipsoids and tiles, and allocates nodes; false if not all fragments may fit.
    fn upload(
        &mut self,
        draw: &mut Draw<'_>,
        scene: &EllipsoidScene,
        drawn: &[DrawnEllipsoid],
        packed: &[GpuEllipsoid],
    ) -> Result<bool, RenderError> {
        let (gpu, size) = (draw.gpu, draw.size());
        let boxes: Vec<_> = drawn.iter().map(|e| bins::pixel_box(scene, e, size)).collect();
        let bins = Bins::of(&boxes, size, gpu.storage_limit())?;
        let colors: Vec<u32> = packed.iter().map(|e| e.color).collect();
        if !packed.is_empty() {
            self.ellipsoids.write(gpu, bytemuck::cast_slice(packed))?;
            self.colors.write(gpu, bytemuck::cast_slice(&colors))?;
        }
        self.tiles.write(gpu, bytemuck::cast_slice(&bins.tiles))?;
        let capacity = self.nodes.buffer().size() / NODE_BYTES;
        if bins.most_fragments <= capacity {
            return Ok(true);
        }
        let most = gpu.storage_limit().min(MOST_BYTES) & !15;
        if bins.most_fragments <= self.few_nodes && bins.most_fragments * NODE_BYTES <= most {
            self.nodes.grow(gpu, bins.most_fragments * NODE_BYTES)?;
            return Ok(true);
        }
        if capacity * NODE_BYTES >= most {
            return Ok(false);
        }
        let needed = self.count(draw)?;
        if needed > capacity {
            self.nodes.grow(gpu, needed.saturating_mul(NODE_BYTES).min(most))?;
            #[cfg(test)]
            {
                self.grown += 1;
            }
        }
        Ok(needed <= self.nodes.buffer().size() / NODE_BYTES)
    }

    /// Number of nodes that the frame needs: makes its lists once, with the present buffer.
    fn count(&mut self, draw: &mut Draw<'_>) -> Result<u64, RenderError> {
        draw.gpu.queue.write_buffer(&self.counters, 0, &[0; 16]);
        self.bind_lists(draw)?;
        draw.passes.run(draw.gpu);
        draw.passes.clear();
        let read = draw.gpu.read_buffers(&[(&self.counters, 0, 8)])?;
        let counted: [u32; 2] = read.first().map_or([0; 2], |bytes| bytemuck::pod_read_unaligned(bytes));
        Ok(u64::from(counted[0]) | u64::from(counted[1]) << 32)
    }

    fn bind_lists(&self, draw: &mut Draw<'_>) -> Result<(), RenderError> {
        let targets = draw.targets;
        let entries = [
            (0, draw.view.as_entire_binding()),
            (1, self.ellipsoids.buffer().as_entire_binding()),
            (2, self.tiles.buffer().as_entire_binding()),
            (4, targets.depths.as_entire_binding()),
            (5, targets.surfaces.as_entire_binding()),
            // 16 bytes per pixel, which the closeup fills with first hits outside the lens.
            (6, targets.outsides.as_entire_binding()),
            (11, self.nodes.buffer().as_entire_binding()),
            (12, self.counters.as_entire_binding()),
        ];
        let workgroups = draw.workgroups();
        draw.passes.bind(draw.gpu, LISTS, "ellipsoids/lists", &entries, workgroups)
    }

    fn bind_composing(&self, draw: &mut Draw<'_>) -> Result<(), RenderError> {
        let (targets, workgroups) = (draw.targets, draw.workgroups());
        let picture = targets.color.create_view(&wgpu::TextureViewDescriptor::default());
        let shared = [
            (0, draw.view.as_entire_binding()),
            (1, self.ellipsoids.buffer().as_entire_binding()),
            (6, targets.outsides.as_entire_binding()),
            (8, targets.blurred.as_entire_binding()),
            (10, wgpu::BindingResource::TextureView(&picture)),
        ];
        let shared = [&shared[..], &self.plane.entries()].concat();
        let own = [(11, self.nodes.buffer().as_entire_binding()), (12, self.counters.as_entire_binding())];
        let entries = [&shared[..], &own].concat();
        let constants = light::composing_constants(draw.quality.lighting.mode, draw.plan);
        let shader = |file| Shader { file, constants: &constants };
        draw.passes.bind(draw.gpu, COMPOSE, shader("ellipsoids/compose"), &entries, workgroups)?;
        if draw.plan.has(REST) {
            let own = [(2, self.tiles.buffer().as_entire_binding())];
            let entries = [&shared[..], &own].concat();
            draw.passes.bind(draw.gpu, REST, shader("ellipsoids/rest"), &entries, workgroups)?;
        }
        Ok(())
    }
}
