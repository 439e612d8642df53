//! The slices on the graphics device.
//!
//! Lifetimes: pipelines are made once; a volume's buffers once per `Arc`; the picture's buffers (28
//! bytes a pixel) once a size; the uniforms of the steps, 1,280 bytes each, once a picture.

use std::sync::Arc;

use wgpu::util::DeviceExt;

use super::{
    plan::{DosPlan, DosSettings, Variant},
    uniforms::{self, Footing, TILE},
};
use crate::{
    camera::Camera,
    gpu::Gpu,
    occlusion::{
        Filter, OpticalVolume, Sight,
        upload::{Kind, OnDevice, check_size, layout, pipeline},
    },
    renderer::{RenderError, check_view},
};

/// How the device goes through the slices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Form {
    /// Eye and occlusion in one pass a step.
    OnePass,
    /// The paper's Algorithm 1: a pass for the eye buffer and one for the occlusion buffer, each
    /// sampling the volume. For the paper's variants; the mended one runs in one pass.
    TwoPasses,
}

/// Bytes from one step's uniform to the next: offsets are multiples of 256.
const STRIDE: u64 = (size_of::<uniforms::DosStep>() as u64).next_multiple_of(256);
/// Steps of one submission.
const STEPS_AT_ONCE: usize = 512;

struct Picture {
    size: [u32; 2],
    occlusion: [wgpu::Buffer; 2],
    eye: wgpu::Buffer,
    states: wgpu::Buffer,
}

impl Picture {
    fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, RenderError> {
        check_size(gpu, size)?;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let tiles: u64 = size.map(|s| u64::from(s.div_ceil(TILE))).iter().product();
        let buffer = |label, bytes: u64| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage: wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::COPY_SRC
                    | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        Ok(Self {
            size,
            occlusion: [
                buffer("Picture::occlusion 0", 4 * pixels),
                buffer("Picture::occlusion 1", 4 * pixels),
            ],
            eye: buffer("Picture::eye", 16 * pixels),
            states: buffer("Picture::states", 12 * tiles),
        })
    }
}

/// A shader and its constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Wanted {
    shader: &'static str,
    variant: Variant,
    /// Saturated tiles stop, empty bricks are left out.
    skipping: bool,
    labels: bool,
    footing: Footing,
}

impl Wanted {
    /// The passes of a step, in order.
    fn of(two: bool, variant: Variant, skipping: bool, labels: bool, footing: Footing) -> Vec<Self> {
        let one = Self { shader: "dos_step", variant, skipping, labels, footing };
        if !two {
            return vec![one];
        }
        // The eye's pass is the same whatever the footprint.
        let (variant, any) = (Variant::PaperApproximate, Footing { reach: 0, rings: 1 });
        vec![
            Self { shader: "dos_eye", variant, footing: any, ..one },
            Self { shader: "dos_occlusion", ..one },
        ]
    }
}

/// Draws directional occlusion by slices.
pub struct DosRenderer {
    layout: wgpu::BindGroupLayout,
    /// Made when first needed.
    pipelines: Vec<(Wanted, wgpu::ComputePipeline)>,
    optical: wgpu::Buffer,
    dos: wgpu::Buffer,
    uploaded: Option<OnDevice>,
    picture: Option<Picture>,
    drawn: bool,
}

impl DosRenderer {
    /// Without pipelines yet: they are compiled when a variant is first drawn.
    ///
    /// # Errors
    /// [`RenderError::Device`] when the driver refuses a shader.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        use Kind::{Moving, Read, Uniform, Write};
        let moving = Moving(2 * size_of::<uniforms::DosStep>() as u64);
        let kinds = [Uniform, Read, Read, Read, Uniform, moving, Read, Write, Write, Write];
        let layout = layout(gpu, "DosRenderer::layout", &kinds);
        let uniform = |label, size: usize| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let out = Self {
            pipelines: Vec::new(),
            layout,
            optical: uniform("DosRenderer::optical", size_of::<crate::occlusion::upload::Optical>()),
            dos: uniform("DosRenderer::dos", size_of::<uniforms::Dos>()),
            uploaded: None,
            picture: None,
            drawn: false,
        };
        gpu.check().map_err(RenderError::Device)?;
        Ok(out)
    }

    /// The plan for a volume: what [`DosRenderer::render`] runs.
    pub fn plan(volume: &OpticalVolume, camera: &Camera, size: [u32; 2], settings: &DosSettings) -> DosPlan {
        Self::plan_with(&crate::occlusion::Occupied::of(volume), volume, &Sight::new(camera, size), settings)
    }

    fn plan_with(
        occupied: &crate::occlusion::Occupied,
        volume: &OpticalVolume,
        sight: &Sight,
        settings: &DosSettings,
    ) -> DosPlan {
        let depths = sight.depths_mm(&volume.grid().corners_mm());
        DosPlan::new(settings, sight, depths, &occupied.depths_mm(sight))
    }

    /// Draws; returns when the work is submitted. `skipping` leaves empty slices, empty bricks and
    /// saturated tiles out.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is drawn then.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        volume: &Arc<OpticalVolume>,
        camera: &Camera,
        size: [u32; 2],
        settings: &DosSettings,
        form: Form,
        skipping: bool,
    ) -> Result<DosPlan, RenderError> {
        self.drawn = false;
        gpu.check().map_err(RenderError::Device)?;
        check_view(camera, None)?;
        if self.picture.as_ref().is_none_or(|p| p.size != size) {
            self.picture = None;
            self.picture = Some(Picture::new(gpu, size)?);
        }
        if self.uploaded.as_ref().is_none_or(|u| !Arc::ptr_eq(&u.volume, volume)) {
            self.uploaded = None;
            self.uploaded = Some(OnDevice::new(gpu, volume)?);
        }
        let two = form == Form::TwoPasses && settings.variant != Variant::Mended;
        let (Some(up), Some(picture)) = (&self.uploaded, &self.picture) else {
            return Err(RenderError::Device("the volume was not uploaded".to_owned()));
        };
        let sight = Sight::new(camera, size);
        let plan = Self::plan_with(&up.occupied, volume, &sight, settings);
        let front_mm = plan.steps.first().map_or(0.0, |s| s.depth_mm);
        let labels = volume.filter() == Filter::Nearest;
        let steps: Vec<(uniforms::DosStep, Vec<usize>)> = plan
            .steps
            .iter()
            .enumerate()
            .map(|(number, step)| {
                let (uniform, footing) = uniforms::step(&plan, step, number, front_mm, skipping);
                let passes = Wanted::of(two, plan.variant, skipping, labels, footing);
                let passes = passes.into_iter().map(|w| made(&mut self.pipelines, gpu, &self.layout, w));
                Ok((uniform, passes.collect::<Result<_, _>>()?))
            })
            .collect::<Result<_, RenderError>>()?;
        let optical = up.uniform(&sight, front_mm, skipping);
        gpu.queue.write_buffer(&self.optical, 0, bytemuck::bytes_of(&optical));
        gpu.queue.write_buffer(&self.dos, 0, bytemuck::bytes_of(&uniforms::dos(&plan, size)));
        let pixels = size[0] as usize * size[1] as usize;
        gpu.queue.write_buffer(&picture.occlusion[0], 0, bytemuck::cast_slice(&vec![1.0f32; pixels]));
        let fresh = vec![[0.0f32, 0.0, 0.0, 1.0]; pixels];
        gpu.queue.write_buffer(&picture.eye, 0, bytemuck::cast_slice(&fresh));
        // The third that is read first holds full transmittance, the others nothing.
        let tiles = picture.states.size() as usize / 12;
        let states: Vec<f32> = (0..3 * tiles).map(|i| if i < tiles { 1.0 } else { 0.0 }).collect();
        gpu.queue.write_buffer(&picture.states, 0, bytemuck::cast_slice(&states));
        if !plan.steps.is_empty() {
            self.submit(gpu, up, picture, &steps);
        }
        gpu.check().map_err(RenderError::Device)?;
        self.drawn = true;
        Ok(plan)
    }

    /// Each step's uniform and the numbers of its pipelines.
    fn submit(&self, gpu: &Gpu, up: &OnDevice, picture: &Picture, plan: &[(uniforms::DosStep, Vec<usize>)]) {
        // Two steps are bound at once: one more than there are.
        let mut bytes = vec![0u8; (plan.len() + 1) * STRIDE as usize];
        for ((step, _), place) in plan.iter().zip(bytes.chunks_exact_mut(STRIDE as usize)) {
            let step = bytemuck::bytes_of(step);
            place[..step.len()].copy_from_slice(step);
        }
        let steps = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("DosRenderer::steps"),
            contents: &bytes,
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let [a, b] = &picture.occlusion;
        let groups = [(a, b), (b, a)].map(|(before, after)| {
            let part = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &steps,
                offset: 0,
                size: wgpu::BufferSize::new(2 * size_of::<uniforms::DosStep>() as u64),
            });
            let resources = [
                self.optical.as_entire_binding(),
                up.values.as_entire_binding(),
                up.table.as_entire_binding(),
                up.bricks.as_entire_binding(),
                self.dos.as_entire_binding(),
                part,
                before.as_entire_binding(),
                after.as_entire_binding(),
                picture.eye.as_entire_binding(),
                picture.states.as_entire_binding(),
            ];
            let entries: Vec<wgpu::BindGroupEntry<'_>> = resources
                .into_iter()
                .zip(0u32..)
                .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("DosRenderer::group"),
                layout: &self.layout,
                entries: &entries,
            })
        });
        let [x, y] = picture.size.map(|s| s.div_ceil(TILE));
        let numbers: Vec<usize> = (0..plan.len()).collect();
        for part in numbers.chunks(STEPS_AT_ONCE) {
            let mut encoder = gpu
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("DosRenderer") });
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("DosRenderer"),
                    timestamp_writes: None,
                });
                for &number in part {
                    pass.set_bind_group(0, &groups[number % 2], &[(number as u64 * STRIDE) as u32]);
                    let passes = plan.get(number).map_or(&[][..], |(_, passes)| passes);
                    for (_, pipeline) in passes.iter().filter_map(|p| self.pipelines.get(*p)) {
                        pass.set_pipeline(pipeline);
                        pass.dispatch_workgroups(x, y, 1);
                    }
                }
            }
            gpu.queue.submit([encoder.finish()]);
        }
    }

    /// Linear radiance (before the background) and transmittance of each pixel of the last picture,
    /// rows from the top; empty when there is none. Waits for it.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<[f32; 4]>, RenderError> {
        let Some(picture) = self.picture.as_ref().filter(|_| self.drawn) else { return Ok(Vec::new()) };
        let parts = [(&picture.eye, 0, picture.eye.size())];
        let bytes = gpu.read_buffers(&parts).map_err(RenderError::Device)?;
        Ok(bytes.first().map(|b| bytemuck::pod_collect_to_vec(b)).unwrap_or_default())
    }
}

/// Where among `pipelines` the wanted one stands; it is made when it isn't there.
fn made(
    pipelines: &mut Vec<(Wanted, wgpu::ComputePipeline)>,
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    wanted: Wanted,
) -> Result<usize, RenderError> {
    if let Some(found) = pipelines.iter().position(|(w, _)| *w == wanted) {
        return Ok(found);
    }
    let variant = match wanted.variant {
        Variant::PaperExact => 0.0,
        Variant::PaperApproximate => 1.0,
        Variant::Mended => 2.0,
    };
    let flag = |on: bool| f64::from(u8::from(on));
    let constants = [
        ("filtering", flag(wanted.labels)),
        ("by_bricks", flag(wanted.skipping)),
        ("variant", variant),
        ("reach", f64::from(wanted.footing.reach)),
        ("rings", f64::from(wanted.footing.rings)),
        ("stopping", flag(wanted.skipping)),
    ];
    // Only the one-pass shader knows how to stop; the eye's pass has no footprint.
    let known = match wanted.shader {
        "dos_step" => &constants[..],
        "dos_occlusion" => &constants[..5],
        _ => &constants[..2],
    };
    let pipeline = pipeline(gpu, wanted.shader, layout, known)?;
    gpu.check().map_err(RenderError::Device)?;
    pipelines.push((wanted, pipeline));
    Ok(pipelines.len() - 1)
}
