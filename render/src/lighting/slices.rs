//! The slices of a view on the graphics device.
//!
//! Lifetimes: pipelines are made when a variant is first drawn; buffers (32 bytes a pixel, with
//! something solid 40) once a size; the uniforms of the steps, 256 bytes each, once a frame.

use wgpu::util::DeviceExt;

use super::{Lighting, LitImage, LitScene, uniforms};
use crate::{
    compute::{PassRunner, workgroups_of},
    dos::{DosPlan, Kernel, Step, Variant, disc_points},
    gpu::Gpu,
    occlusion::{
        Sight,
        cone::Decay,
        upload::{Kind, layout_of, pipeline},
    },
    plan::{PassName, Plan},
    renderer::RenderError,
};

/// Bytes from one step's uniform to the next.
const STRIDE: u64 = 256;

/// What a pipeline is made for.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Wanted {
    variant: Variant,
    solid: bool,
    /// Whether what is solid leaves the image its light.
    lets_through: bool,
    /// Whether the eye's rays end elsewhere than at what is solid.
    apart: bool,
    gradient: bool,
    first: bool,
    empty: bool,
}

struct Buffers {
    size: [u32; 2],
    lights_a_pixel: u64,
    lights: wgpu::Buffer,
    eye: wgpu::Buffer,
    notes: wgpu::Buffer,
}

impl Buffers {
    fn new(gpu: &Gpu, size: [u32; 2], lights_a_pixel: u64) -> Self {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let buffer = |label, bytes: u64| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        Self {
            size,
            lights_a_pixel,
            lights: buffer("SliceLight::lights", 8 * pixels * lights_a_pixel),
            eye: buffer("SliceLight::eye", 16 * pixels),
            notes: buffer("SliceLight::notes", 8 * pixels),
        }
    }
}

/// Draws the image by slices, and finds what it lets through to solid surfaces.
pub(crate) struct SliceLight {
    layout: wgpu::BindGroupLayout,
    pipelines: Vec<(Wanted, wgpu::ComputePipeline)>,
    slices: wgpu::Buffer,
    buffers: Option<Buffers>,
}

impl SliceLight {
    pub fn new(gpu: &Gpu) -> Self {
        use Kind::{Moving, Read, Uniform, Write};
        let part = Moving(2 * size_of::<uniforms::Part>() as u64);
        let kinds = [
            (0, Uniform),
            (4, Read),
            (11, Uniform),
            (12, Read),
            (13, Read),
            (14, Read),
            (15, Read),
            (31, Uniform),
            (32, part),
            (33, Write),
            (34, Write),
            (35, Write),
        ];
        Self {
            layout: layout_of(gpu, "SliceLight::layout", &kinds),
            pipelines: Vec::new(),
            slices: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("SliceLight::slices"),
                size: size_of::<uniforms::Slices>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            buffers: None,
        }
    }

    /// Light of the image on each pixel's solid surface, and more; see slices_finish.wgsl. `None` before
    /// the first frame.
    pub fn notes(&self) -> Option<&wgpu::Buffer> {
        self.buffers.as_ref().map(|b| &b.notes)
    }

    /// Light before and behind the last step.
    #[cfg(test)]
    pub fn carried(&self) -> Option<&wgpu::Buffer> {
        self.buffers.as_ref().map(|b| &b.lights)
    }

    /// Radiance and transmittance of each pixel, in linear light.
    #[cfg(test)]
    pub fn eye(&self) -> Option<&wgpu::Buffer> {
        self.buffers.as_ref().map(|b| &b.eye)
    }

    /// Binds the steps of a frame, and what hands them on. Returns what is other than asked for.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is bound then.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        frame_plan: &Plan,
        scene: &LitScene<'_>,
        image: &LitImage<'_>,
        lighting: &Lighting,
    ) -> Result<Vec<String>, RenderError> {
        let apart = frame_plan.has(PassName::ArrowsMerge);
        let solid = apart || frame_plan.has(PassName::Surface) || frame_plan.has(PassName::TubesMerge);
        let lights_a_pixel = if solid { 2 } else { 1 };
        if self.buffers.as_ref().is_none_or(|b| b.size != scene.size || b.lights_a_pixel != lights_a_pixel) {
            self.buffers = None;
            self.buffers = Some(Buffers::new(gpu, scene.size, lights_a_pixel));
            gpu.check().map_err(RenderError::Device)?;
        }
        let sight = Sight::new(scene.camera, scene.size);
        let occupied = image.buffers.depths_mm(&sight);
        let whole = occupied.first().zip(occupied.last()).map(|(first, last)| (first.0, last.1));
        let mut plan = DosPlan::new(&lighting.slice_settings(), &sight, whole, &occupied);
        if plan.steps.is_empty() {
            // One that finds nothing: what the passes after it read is then written all the same.
            let kernel = Kernel::Lattice { side: 1, stride_px: 1, center: 0.0 };
            plan.steps.push(Step { depth_mm: scene.reference_mm, slices: 1, kernel, empty: true });
        }
        let gradient = image.buffers.tables().two_d;
        let mut pipelines: Vec<(Wanted, wgpu::ComputePipeline)> = Vec::new();
        let mut steps = Vec::new();
        for (number, step) in (0u32..).zip(&plan.steps) {
            let (variant, first, empty) = (lighting.variant, number == 0, step.empty);
            let lets_through = !lighting.mutual.solid_on_image;
            let wanted = Wanted { variant, solid, lets_through, apart, gradient, first, empty };
            let at = match pipelines.iter().position(|(made, _)| *made == wanted) {
                Some(at) => at,
                None => {
                    pipelines.push((wanted, self.pipeline(gpu, wanted)?));
                    pipelines.len() - 1
                }
            };
            steps.push((at, number * STRIDE as u32));
        }
        let pipelines = pipelines.into_iter().map(|(_, pipeline)| pipeline).collect();
        let Some(buffers) = &self.buffers else { return Ok(Vec::new()) };
        let mutual = &lighting.mutual;
        let flags = if mutual.image_on_image { uniforms::VOLUME_ON_VOLUME } else { 0 };
        let slices = uniforms::Slices {
            slice_mm: plan.slice_mm as f32,
            flags,
            strength: scene.strength,
            pad: 0,
            decay: plan.decay.as_deref().map_or([[0.0; 4]; 257], Decay::packed),
        };
        gpu.queue.write_buffer(&self.slices, 0, bytemuck::bytes_of(&slices));
        let mut bytes = vec![0u8; plan.steps.len() * STRIDE as usize];
        for (number, (step, place)) in
            plan.steps.iter().zip(bytes.chunks_exact_mut(STRIDE as usize)).enumerate()
        {
            let part = part(step, number, scene.reference_mm);
            let part = bytemuck::bytes_of(&part);
            place[..part.len()].copy_from_slice(part);
        }
        let parts = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("SliceLight::parts"),
            contents: &bytes,
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let part = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &parts,
            offset: 0,
            size: wgpu::BufferSize::new(2 * size_of::<uniforms::Part>() as u64),
        });
        let entries = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (11, image.context.as_entire_binding()),
            (12, image.buffers.values().as_entire_binding()),
            (13, image.buffers.visible().as_entire_binding()),
            (14, image.buffers.table().as_entire_binding()),
            (15, image.buffers.factors().as_entire_binding()),
            (31, self.slices.as_entire_binding()),
            (32, part),
            (33, buffers.lights.as_entire_binding()),
            (34, buffers.eye.as_entire_binding()),
            (35, buffers.notes.as_entire_binding()),
        ];
        let workgroups = workgroups_of(scene.size);
        passes.bind_steps(gpu, PassName::Slices, &self.layout, &entries, (pipelines, steps), workgroups);
        let finish = [
            (0, scene.view.as_entire_binding()),
            (6, scene.marched.as_entire_binding()),
            (34, buffers.eye.as_entire_binding()),
            (35, buffers.notes.as_entire_binding()),
        ];
        passes.bind_shader(gpu, PassName::SlicesFinish, ("slices_finish", &[]), &finish, workgroups)?;
        Ok(plan.notes)
    }

    fn pipeline(&mut self, gpu: &Gpu, wanted: Wanted) -> Result<wgpu::ComputePipeline, RenderError> {
        if let Some((_, made)) = self.pipelines.iter().find(|(made, _)| *made == wanted) {
            return Ok(made.clone());
        }
        let variant = match wanted.variant {
            Variant::PaperExact => 0.0,
            Variant::PaperApproximate => 1.0,
            Variant::Mended => 2.0,
        };
        let flag = |on: bool| f64::from(u8::from(on));
        let constants = [
            ("variant", variant),
            ("with_solid", flag(wanted.solid)),
            ("solid_lets_through", flag(wanted.lets_through)),
            ("ends_apart", flag(wanted.apart)),
            ("gradient_counts", flag(wanted.gradient)),
            ("is_first", flag(wanted.first)),
            ("is_empty", flag(wanted.empty)),
        ];
        let made = pipeline(gpu, "context_slices", &self.layout, &constants)?;
        gpu.check().map_err(RenderError::Device)?;
        self.pipelines.push((wanted, made.clone()));
        Ok(made)
    }
}

fn part(step: &Step, number: usize, reference_mm: f64) -> uniforms::Part {
    let mut out = uniforms::Part {
        depth: (step.depth_mm - reference_mm) as f32,
        slices: step.slices,
        side: 1,
        stride: 1,
        share: 1.0,
        turn: (number % 2) as u32,
        ..uniforms::Part::default()
    };
    match step.kernel {
        Kernel::Disc { grid, radius_px, radius_mm } => {
            out.side = grid;
            out.radius = radius_px as f32;
            out.radius_mm = radius_mm as f32;
            out.share = 1.0 / disc_points(grid).len() as f32;
        }
        Kernel::Lattice { side, stride_px, center } => {
            out.side = side;
            out.stride = stride_px as i32;
            out.center = center as f32;
            out.share = 1.0 / (side * side) as f32;
        }
    }
    out
}
