//! The slices of a view on the graphics device.
//!
//! Lifetimes: pipelines are made when a variant is first drawn; buffers (40 bytes a pixel, with
//! something solid 48) once a size; the uniforms of the steps, 256 bytes for each of
//! their rectangles, once a frame.

use wgpu::util::DeviceExt;

use super::{
    LightWork, Lighting, LitImage, LitScene,
    reach::{Rect, Seen, SolidParts, StepReach, reach},
    uniforms,
};
use crate::{
    compute::{Dispatch, PassRunner, workgroups_of},
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
    /// See slices_begin.wgsl: what comes before the steps.
    begins: bool,
    variant: Variant,
    solid: bool,
    /// Whether two lights are kept, be there something solid or not.
    two_lights: bool,
    one_slice: bool,
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
            lights: buffer("SliceLight::lights", 8 * pixels * (lights_a_pixel + 1)),
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
    work: LightWork,
    /// For tests: every step is taken for the whole picture, as if solid surfaces were anywhere.
    everywhere: bool,
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
            work: LightWork::default(),
            everywhere: false,
        }
    }

    /// Of the last frame.
    pub fn work(&self) -> LightWork {
        self.work
    }

    #[cfg(test)]
    pub fn everywhere(&mut self) {
        self.everywhere = true;
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
        let mutual = &lighting.mutual;
        let solid_parts = match scene.tumor {
            _ if !solid => SolidParts::None,
            Some(tumor) if !apart && !frame_plan.has(PassName::TubesMerge) => {
                Seen::of(&sight, &tumor.grid().corners_mm()).map_or(SolidParts::None, SolidParts::Within)
            }
            _ => SolidParts::Anywhere,
        };
        let ways = (mutual.solid_on_image, mutual.image_on_image);
        let reached = if self.everywhere {
            vec![StepReach::everywhere(scene.size); plan.steps.len()]
        } else {
            reach(&plan, &sight, &image.buffers.seen(&sight), solid_parts, ways)
        };
        let mut work = Work::default();
        let begins = Wanted {
            begins: true,
            variant: lighting.variant,
            solid: false,
            two_lights: solid,
            one_slice: false,
            lets_through: false,
            apart: false,
            gradient: false,
            first: false,
            empty: false,
        };
        let whole = Rect::whole(scene.size).in_workgroups(scene.size);
        work.add(self.pipeline(gpu, begins)?, begins, uniforms::Part::default(), whole);
        let mended = lighting.variant == Variant::Mended;
        self.work = LightWork { slices: plan.slices(), ..LightWork::default() };
        for (number, (step, reached)) in plan.steps.iter().zip(&reached).enumerate() {
            let mut part = part(step, number, scene.reference_mm);
            part.is_last = u32::from(number + 1 == plan.steps.len());
            let among = reached.among_solid.iter().map(|rect| (rect, solid));
            for (rect, solid) in among.chain(reached.alike.iter().map(|rect| (rect, false))) {
                let wanted = Wanted {
                    begins: false,
                    solid,
                    one_slice: mended && step.slices == 1,
                    lets_through: solid && !mutual.solid_on_image,
                    apart: solid && apart,
                    gradient: image.buffers.tables().two_d,
                    first: !mended && number == 0,
                    empty: step.empty,
                    ..begins
                };
                work.add(self.pipeline(gpu, wanted)?, wanted, part, *rect);
                let range = if step.empty { 0 } else { 8 };
                let depths = 4 * u64::from(solid) + 4 * u64::from(wanted.apart);
                self.work.samples += rect.pixels() * u64::from(step.slices);
                self.work.bytes += rect.pixels() * (2 * 4 * lights_a_pixel + range + depths);
            }
        }
        let drawn: u64 =
            reached.iter().flat_map(|r| r.among_solid.iter().chain(&r.alike)).map(Rect::pixels).sum();
        let all = whole.pixels() * plan.steps.len() as u64;
        if drawn < all {
            let share = 100.0 * (1.0 - drawn as f64 / all as f64);
            plan.notes.push(format!(
                "{share:.0} % of the slices' pixels are left out: no light is lost there yet, or none asked for any more"
            ));
        }
        let Some(buffers) = &self.buffers else { return Ok(Vec::new()) };
        let flags = if mutual.image_on_image { uniforms::VOLUME_ON_VOLUME } else { 0 };
        let slices = uniforms::Slices {
            slice_mm: plan.slice_mm as f32,
            flags,
            strength: scene.strength,
            pad: 0,
            decay: plan.decay.as_deref().map_or([[0.0; 4]; 257], Decay::packed),
        };
        gpu.queue.write_buffer(&self.slices, 0, bytemuck::bytes_of(&slices));
        // The last one's binding reaches past it.
        let mut bytes = vec![0u8; (work.parts.len() + 1) * STRIDE as usize];
        for (part, place) in work.parts.iter().zip(bytes.chunks_exact_mut(STRIDE as usize)) {
            let part = bytemuck::bytes_of(part);
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
            (31, self.slices.as_entire_binding()),
            (32, part),
            (33, buffers.lights.as_entire_binding()),
            (34, buffers.eye.as_entire_binding()),
            (35, buffers.notes.as_entire_binding()),
        ];
        let entries = [&entries[..], &image.entries()].concat();
        let workgroups = workgroups_of(scene.size);
        let steps = (work.pipelines.into_iter().map(|(_, made)| made).collect(), work.steps);
        passes.bind_steps(gpu, PassName::Slices, &self.layout, &entries, steps);
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
            ("two_lights", flag(wanted.two_lights)),
            ("one_slice", flag(wanted.one_slice)),
            ("solid_lets_through", flag(wanted.lets_through)),
            ("ends_apart", flag(wanted.apart)),
            ("gradient_counts", flag(wanted.gradient)),
            ("is_first", flag(wanted.first)),
            ("is_empty", flag(wanted.empty)),
        ];
        let made = if wanted.begins {
            pipeline(gpu, "slices_begin", &self.layout, &[("two_lights", flag(wanted.two_lights))])?
        } else {
            pipeline(gpu, "context_slices", &self.layout, &constants)?
        };
        gpu.check().map_err(RenderError::Device)?;
        self.pipelines.push((wanted, made.clone()));
        Ok(made)
    }
}

/// Dispatches of a frame.
#[derive(Default)]
struct Work {
    pipelines: Vec<(Wanted, wgpu::ComputePipeline)>,
    parts: Vec<uniforms::Part>,
    steps: Vec<Dispatch>,
}

impl Work {
    fn add(&mut self, made: wgpu::ComputePipeline, wanted: Wanted, part: uniforms::Part, rect: Rect) {
        let known = self.pipelines.iter().position(|(w, _)| *w == wanted);
        let pipeline = known.unwrap_or_else(|| {
            self.pipelines.push((wanted, made));
            self.pipelines.len() - 1
        });
        let (origin, workgroups) = rect.dispatch();
        let offset = (self.parts.len() as u64 * STRIDE) as u32;
        self.parts.push(uniforms::Part { origin, ..part });
        self.steps.push(Dispatch { pipeline, offset, workgroups });
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
