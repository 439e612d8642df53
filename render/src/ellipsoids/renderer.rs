//! Runs a diagram's plan.
//!
//! Lifetimes: pipelines once an [`EllipsoidRenderer`]; targets once a size; the ellipsoids (64 bytes
//! each) and the tiles' lists once a frame. The nodes of the A-buffer grow and are kept: where the
//! boxes around the ellipsoids tell beforehand that all fragments will have room, nothing is read back.
//! Else they are counted first, the buffer grows, and the frame is drawn again. Past the largest buffer
//! the pixels left over find their fragments again in batches: slower, the same picture. None is dropped.

use crate::{
    compute::{PassRunner, TimeSource, workgroups_of},
    ellipsoids::{
        DrawnEllipsoid, EllipsoidFrame, EllipsoidScene,
        bins::{self, Bins, GpuEllipsoid},
        ellipsoid_plan,
    },
    gpu::Gpu,
    lighting::{Solid, VicinityLight},
    plan::{PassName, Plan},
    quality::Quality,
    renderer::{RenderError, check_view},
    slice_plane::PlaneBuffers,
    targets::Targets,
    uniforms::{self, HAS_OCCLUSION, HAS_SURFACE, NO_SKIPPING, View},
};

/// Bytes of a fragment: its depth, whose it is.
const NODE: u64 = 8;
/// Up to so many fragments room is made for what the boxes could hold, without counting (32 MiB).
const FEW_NODES: u64 = 1 << 22;
/// Bytes that the nodes may grow to, where the device allows it.
const MOST_BYTES: u64 = 1 << 29;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Slot {
    View = 0,
    Ellipsoids = 1,
    Tiles = 2,
    Colors = 3,
    Depths = 4,
    Surfaces = 5,
    Lists = 6,
    Occlusion = 7,
    Blurred = 8,
    Kernel = 9,
    Picture = 10,
    Nodes = 11,
    Counters = 12,
}

/// Shader file and bindings of a pass.
type Step = (PassName, &'static str, &'static [Slot]);

const SHADERS: [Step; 5] = {
    use Slot::*;
    [
        (
            PassName::EllipsoidLists,
            "ellipsoids_lists",
            &[View, Ellipsoids, Tiles, Depths, Surfaces, Lists, Nodes, Counters],
        ),
        (PassName::Occlusion, "closeup_occlusion", &[View, Colors, Depths, Surfaces, Occlusion, Kernel]),
        (PassName::OcclusionBlur, "closeup_occlusion_blur", &[View, Depths, Occlusion, Blurred]),
        (
            PassName::EllipsoidCompose,
            "ellipsoids_compose",
            &[View, Ellipsoids, Lists, Blurred, Picture, Nodes, Counters],
        ),
        (PassName::EllipsoidRest, "ellipsoids_rest", &[View, Ellipsoids, Tiles, Lists, Blurred, Picture]),
    ]
};

/// A buffer that is made anew when it is too small.
struct Growing {
    label: &'static str,
    buffer: wgpu::Buffer,
}

impl Growing {
    fn new(gpu: &Gpu, label: &'static str, bytes: u64) -> Self {
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Self { label, buffer }
    }

    /// Makes room for `bytes`, and a quarter more where the device has it.
    fn grow(&mut self, gpu: &Gpu, bytes: u64) -> Result<(), RenderError> {
        if bytes > self.buffer.size() {
            let limit = gpu.check_size(self.label, bytes)?;
            *self = Self::new(
                gpu,
                self.label,
                (bytes + bytes / 4).next_multiple_of(16).min(limit & !15).max(bytes),
            );
        }
        Ok(())
    }

    fn write(&mut self, gpu: &Gpu, bytes: &[u8]) -> Result<(), RenderError> {
        self.grow(gpu, bytes.len() as u64)?;
        gpu.queue.write_buffer(&self.buffer, 0, bytes);
        Ok(())
    }
}

/// Draws ellipsoid diagrams. Not bound to a window.
pub struct EllipsoidRenderer {
    passes: PassRunner,
    view: wgpu::Buffer,
    kernel: wgpu::Buffer,
    kernel_samples: u32,
    ellipsoids: Growing,
    colors: Growing,
    tiles: Growing,
    nodes: Growing,
    counters: wgpu::Buffer,
    plane: PlaneBuffers,
    vicinity: Option<VicinityLight>,
    frame: Option<EllipsoidFrame>,
    few_nodes: u64,
    /// How often fragments were counted and the nodes grew.
    #[cfg(test)]
    pub(super) grown: u32,
}

impl EllipsoidRenderer {
    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`RenderError::Device`] when the driver refuses a shader.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let passes = PassRunner::new(gpu, &SHADERS.map(|(pass, shader, _)| (pass, shader)))?;
        let buffer = |label, size: usize, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let made = Self {
            passes,
            view: buffer("EllipsoidRenderer::view", size_of::<View>(), wgpu::BufferUsages::UNIFORM),
            kernel: buffer(
                "EllipsoidRenderer::kernel",
                size_of::<[[f32; 4]; 32]>(),
                wgpu::BufferUsages::UNIFORM,
            ),
            kernel_samples: 0,
            ellipsoids: Growing::new(gpu, "the ellipsoids", size_of::<GpuEllipsoid>() as u64),
            colors: Growing::new(gpu, "the colours of ellipsoids", 16),
            tiles: Growing::new(gpu, "the ellipsoids of every tile", 16),
            nodes: Growing::new(gpu, "the fragments of ellipsoids", NODE * 2),
            counters: buffer(
                "EllipsoidRenderer::counters",
                16,
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            ),
            plane: PlaneBuffers::new(gpu),
            vicinity: None,
            frame: None,
            few_nodes: FEW_NODES,
            #[cfg(test)]
            grown: 0,
        };
        gpu.check().map_err(RenderError::Device)?;
        Ok(made)
    }

    /// Draws `scene` at `quality` for a place of `size_px` pixels. Returns when the work is submitted;
    /// reading the frame waits for it. Scenes of millions of fragments wait once, to count them.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is drawn then, and the frame before is gone.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        scene: &EllipsoidScene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<&EllipsoidFrame, RenderError> {
        self.render_planned(gpu, scene, quality, size_px, ellipsoid_plan(scene, quality), true)
    }

    /// The last frame, if drawing it went well.
    pub fn frame(&self) -> Option<&EllipsoidFrame> {
        self.frame.as_ref()
    }

    /// As [`EllipsoidRenderer::render`] with a given plan; what is behind an opaque fragment is left out
    /// of the lists when `skipping`.
    pub(super) fn render_planned(
        &mut self,
        gpu: &Gpu,
        scene: &EllipsoidScene,
        quality: &Quality,
        asked_px: [u32; 2],
        mut plan: Plan,
        skipping: bool,
    ) -> Result<&EllipsoidFrame, RenderError> {
        let before = self.frame.take();
        self.passes.clear();
        gpu.check().map_err(RenderError::Device)?;
        check_view(&scene.camera, scene.lens.as_ref())?;
        if !scene.opacity.is_finite() || scene.ellipsoids.iter().any(|e| !e.opacity.is_finite()) {
            return Err(RenderError::Scene("an opacity that is not a number".to_owned()));
        }
        let size = quality.drawn_px(asked_px);
        let targets = match before {
            Some(frame) if frame.targets.size == size => frame.targets,
            _ => Targets::new(gpu, size)?,
        };
        let reference_mm = uniforms::reference_to(&scene.camera, scene.middle_mm());
        let drawn = bins::in_order(scene);
        let packed = bins::packed(scene, &drawn, reference_mm)?;
        let mut view = Self::view_of(scene, quality, &plan, size, reference_mm);
        if !skipping {
            view.flags |= NO_SKIPPING;
        }
        self.plane.update(gpu, scene.plane.as_ref(), &scene.camera, reference_mm, &mut view)?;
        gpu.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
        if self.kernel_samples != view.occlusion_samples {
            self.kernel_samples = view.occlusion_samples;
            let kernel = uniforms::occlusion_kernel(view.occlusion_samples);
            gpu.queue.write_buffer(&self.kernel, 0, bytemuck::cast_slice(&kernel));
        }
        if plan.has(PassName::EllipsoidLists) {
            if self.upload(gpu, scene, &drawn, &packed, &targets)? {
                plan.omitted.push((PassName::EllipsoidRest, "every fragment has room"));
            } else {
                plan.passes.push(PassName::EllipsoidRest);
            }
        }
        gpu.queue.write_buffer(&self.counters, 0, &[0; 16]);
        for step in SHADERS.iter().filter(|(pass, ..)| plan.has(*pass)) {
            if step.0 == PassName::EllipsoidCompose && plan.has(PassName::Vicinity) {
                let vicinity = self.vicinity.get_or_insert_with(|| VicinityLight::new(gpu));
                let (view, depths, blurred) = (&self.view, &targets.depths, &targets.blurred);
                let solid = Solid { view, depths, blurred, size };
                vicinity.bind(gpu, &mut self.passes, solid, &quality.lighting, None)?;
            }
            self.bind(gpu, step, &targets);
        }
        self.passes.run(gpu);
        gpu.check().map_err(RenderError::Device)?;
        Ok(self.frame.insert(EllipsoidFrame {
            color: targets.color.clone(),
            size_px: size,
            asked_px,
            plan,
            targets,
            scene: scene.clone(),
            drawn,
            reference_mm,
            #[cfg(test)]
            nodes: self.nodes.buffer.clone(),
        }))
    }

    fn view_of(
        scene: &EllipsoidScene,
        quality: &Quality,
        plan: &Plan,
        size: [u32; 2],
        reference_mm: f64,
    ) -> View {
        let mut view = View {
            background: uniforms::rgba(scene.background),
            silhouette: uniforms::rgba(scene.silhouette),
            ..uniforms::camera_view(&scene.camera, reference_mm, scene.lens.as_ref(), quality, size)
        };
        for (pass, flag) in [
            (PassName::EllipsoidLists, HAS_SURFACE),
            (PassName::OcclusionBlur, HAS_OCCLUSION),
            (PassName::Vicinity, HAS_OCCLUSION),
        ] {
            if plan.has(pass) {
                view.flags |= flag;
            }
        }
        view
    }

    /// Ellipsoids, tiles, and room for every fragment; false where there may be too little.
    fn upload(
        &mut self,
        gpu: &Gpu,
        scene: &EllipsoidScene,
        drawn: &[DrawnEllipsoid],
        packed: &[GpuEllipsoid],
        targets: &Targets,
    ) -> Result<bool, RenderError> {
        let boxes: Vec<_> = drawn.iter().map(|e| bins::pixel_box(scene, e, targets.size)).collect();
        let bins = Bins::of(&boxes, targets.size, gpu.storage_limit())?;
        let colors: Vec<u32> = packed.iter().map(|e| e.color).collect();
        if !packed.is_empty() {
            self.ellipsoids.write(gpu, bytemuck::cast_slice(packed))?;
            self.colors.write(gpu, bytemuck::cast_slice(&colors))?;
        }
        self.tiles.write(gpu, bytemuck::cast_slice(&bins.tiles))?;
        let room = self.nodes.buffer.size() / NODE;
        if bins.most_fragments <= room {
            return Ok(true);
        }
        let most = gpu.storage_limit().min(MOST_BYTES) & !15;
        if bins.most_fragments <= self.few_nodes && bins.most_fragments * NODE <= most {
            self.nodes.grow(gpu, bins.most_fragments * NODE)?;
            return Ok(true);
        }
        if room * NODE >= most {
            return Ok(false);
        }
        let asked = self.count(gpu, targets)?;
        if asked > room {
            self.nodes.grow(gpu, asked.saturating_mul(NODE).min(most))?;
            #[cfg(test)]
            {
                self.grown += 1;
            }
        }
        Ok(asked <= self.nodes.buffer.size() / NODE)
    }

    /// How many nodes the frame asks for: its lists made once, with whatever room there is.
    fn count(&mut self, gpu: &Gpu, targets: &Targets) -> Result<u64, RenderError> {
        gpu.queue.write_buffer(&self.counters, 0, &[0; 16]);
        let [lists, ..] = &SHADERS;
        self.bind(gpu, lists, targets);
        self.passes.run(gpu);
        self.passes.clear();
        let read = gpu.read_buffers(&[(&self.counters, 0, 8)]).map_err(RenderError::Device)?;
        let counted: [u32; 2] = read.first().map_or([0; 2], |bytes| bytemuck::pod_read_unaligned(bytes));
        Ok(u64::from(counted[0]) | u64::from(counted[1]) << 32)
    }

    fn bind(&mut self, gpu: &Gpu, (pass, _, slots): &Step, targets: &Targets) {
        let picture = targets.color.create_view(&wgpu::TextureViewDescriptor::default());
        let mut entries: Vec<(u32, wgpu::BindingResource<'_>)> = slots
            .iter()
            .map(|&slot| {
                let resource = match slot {
                    Slot::View => self.view.as_entire_binding(),
                    Slot::Ellipsoids => self.ellipsoids.buffer.as_entire_binding(),
                    Slot::Tiles => self.tiles.buffer.as_entire_binding(),
                    Slot::Colors => self.colors.buffer.as_entire_binding(),
                    Slot::Depths => targets.depths.as_entire_binding(),
                    Slot::Surfaces => targets.surfaces.as_entire_binding(),
                    // 16 bytes a pixel, which the closeup fills with first hits outside the lens.
                    Slot::Lists => targets.outsides.as_entire_binding(),
                    Slot::Occlusion => targets.occlusion.as_entire_binding(),
                    Slot::Blurred => targets.blurred.as_entire_binding(),
                    Slot::Kernel => self.kernel.as_entire_binding(),
                    Slot::Picture => wgpu::BindingResource::TextureView(&picture),
                    Slot::Nodes => self.nodes.buffer.as_entire_binding(),
                    Slot::Counters => self.counters.as_entire_binding(),
                };
                (slot as u32, resource)
            })
            .collect();
        if matches!(pass, PassName::EllipsoidCompose | PassName::EllipsoidRest) {
            entries.extend(self.plane.entries());
        }
        self.passes.bind(gpu, *pass, &entries, workgroups_of(targets.size));
    }

    /// Counts fragments from so many on, instead of trusting the boxes.
    #[cfg(test)]
    pub(super) fn set_few_nodes(&mut self, nodes: u64) {
        self.few_nodes = nodes;
    }

    /// Where [`EllipsoidRenderer::pass_times`] come from on this device.
    pub fn time_source(&self) -> TimeSource {
        self.passes.time_source()
    }

    /// Milliseconds of each pass of the last frame, in order; empty before the first. Waits for it.
    /// Without timestamps on the device the passes are run again, one by one.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn pass_times(&self, gpu: &Gpu) -> Result<Vec<(PassName, f64)>, RenderError> {
        if self.frame.is_some() { self.passes.times(gpu) } else { Ok(Vec::new()) }
    }
}
