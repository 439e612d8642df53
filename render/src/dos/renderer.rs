//! The slices on the graphics device.
//!
//! Lifetimes: pipelines are made once; a volume's buffers once per `Arc`; the picture's buffers (28
//! bytes a pixel, and 4 for each of the up to 7 sums of a wide footprint's rows) once a size; the uniforms of
//! the steps, about 1,100 bytes each, once a picture.

use std::sync::Arc;

use wgpu::util::DeviceExt;

use super::{
    folded::{DIRECT, ROWS},
    plan::{DosPlan, DosSettings, Variant},
    uniforms::{self, Footing, Group, MEMORY, MOST_TOGETHER, TILE},
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
    /// Up to so many steps, at most 8, in one pass, where their footprints together reach no farther than 8
    /// pixels: a tile and a halo about it stay in workgroup memory. Elsewhere as [`Form::OnePass`]. Saturated
    /// tiles don't stop.
    Tiles(usize),
    /// The paper's Algorithm 1: a pass for the eye buffer and one for the occlusion buffer, each
    /// sampling the volume. For the paper's variants; the mended one runs in one pass.
    TwoPasses {
        /// Whether footprints are folded, as they are in the other forms; the paper reads them point by point.
        folded: bool,
    },
}

impl Form {
    /// The fastest for a picture of `size` pixels on this adapter (docs/performance.md): workgroup memory pays
    /// where a graphics card spends more time between the slices than on them.
    pub fn fastest(gpu: &Gpu, size: [u32; 2]) -> Self {
        let few = u64::from(size[0]) * u64::from(size[1]) <= FEW_PIXELS;
        if few && !gpu.is_software() { Self::Tiles(4) } else { Self::OnePass }
    }
}

/// Between 256x256, where four slices together took 0.8 to 1 of the time on an H100, and 512x512, where they took 1.2.
const FEW_PIXELS: u64 = 300 * 300;

/// Groups of steps start at multiples of this in their buffer.
const STRIDE: usize = 256;
/// Bytes that are bound of it.
const BOUND: usize = MOST_TOGETHER * size_of::<uniforms::DosStep>();
/// Groups of one submission.
const GROUPS_AT_ONCE: usize = 512;

/// One dispatch, or two.
struct Dispatch {
    steps: Vec<uniforms::DosStep>,
    /// Numbers of its pipelines.
    passes: Vec<usize>,
    /// Pixels along the side of a workgroup's tile.
    tile: u32,
}

struct Picture {
    size: [u32; 2],
    occlusion: [wgpu::Buffer; 2],
    eye: wgpu::Buffer,
    states: wgpu::Buffer,
    /// Room for the rows of wide footprints: so many floats a pixel.
    rows: (u32, wgpu::Buffer),
}

impl Picture {
    fn new(gpu: &Gpu, size: [u32; 2], rows: u32) -> Result<Self, RenderError> {
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
            rows: (rows, buffer("Picture::rows", (4 * pixels * u64::from(rows)).max(4))),
        })
    }
}

/// A shader and its constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Wanted {
    shader: &'static str,
    variant: Variant,
    /// Empty bricks are left out.
    skipping: bool,
    /// Saturated tiles stop.
    stopping: bool,
    labels: bool,
    footing: Footing,
}

impl Wanted {
    /// The passes of a group of steps, in order: `self` says what they have in common.
    fn passes(self, form: Form, steps: usize) -> Vec<Self> {
        let mut passes = match form {
            // The eye's pass is the same whatever the footprint.
            Form::TwoPasses { .. } if self.variant != Variant::Mended => vec![
                Self {
                    shader: "dos_eye",
                    variant: Variant::PaperApproximate,
                    footing: Footing { reach: 0, rings: 1 },
                    ..self
                },
                Self { shader: "dos_occlusion", ..self },
            ],
            _ if steps > 1 => vec![Self { shader: "dos_tiles", ..self }],
            _ => vec![self],
        };
        if self.footing.reach == ROWS {
            passes.insert(0, Self { shader: "dos_rows", ..self });
        }
        passes
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
        let moving = Moving(BOUND as u64);
        let kinds = [Uniform, Read, Read, Read, Uniform, moving, Read, Write, Write, Write, Write];
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
        if self.uploaded.as_ref().is_none_or(|u| !Arc::ptr_eq(&u.volume, volume)) {
            self.uploaded = None;
            self.uploaded = Some(OnDevice::new(gpu, volume)?);
        }
        let Some(up) = &self.uploaded else {
            return Err(RenderError::Device("the volume was not uploaded".to_owned()));
        };
        let sight = Sight::new(camera, size);
        let plan = Self::plan_with(&up.occupied, volume, &sight, settings);
        let front_mm = plan.steps.first().map_or(0.0, |s| s.depth_mm);
        let folding = form != Form::TwoPasses { folded: false };
        let steps = plan.steps.iter().map(|step| {
            let (uniform, footing) = uniforms::step(&plan, step, front_mm, skipping, folding);
            let reach = match footing.reach {
                DIRECT => step.kernel.reach_px(),
                // Their rows are summed up before them.
                ROWS => u32::MAX,
                reach => reach,
            };
            (uniform, footing, reach)
        });
        let steps: Vec<_> = steps.collect();
        let rows = steps.iter().filter(|s| s.1.reach == ROWS).map(|s| s.1.rings).max().unwrap_or(0);
        if self.picture.as_ref().is_none_or(|p| p.size != size || p.rows.0 < rows) {
            self.picture = None;
            self.picture = Some(Picture::new(gpu, size, rows)?);
        }
        let Some(picture) = &self.picture else { return Err(RenderError::Device("no picture".to_owned())) };
        let together = if let Form::Tiles(most) = form { most.max(1) } else { 1 };
        let wanted = Wanted {
            shader: "dos_step",
            variant: plan.variant,
            skipping,
            stopping: skipping && together == 1,
            labels: volume.filter() == Filter::Nearest,
            footing: Footing { reach: DIRECT, rings: 1 },
        };
        let dispatches: Vec<Dispatch> = Group::all(steps, together)
            .into_iter()
            .enumerate()
            .map(|(number, group)| {
                let passes = Wanted { footing: group.footing, ..wanted }.passes(form, group.steps.len());
                let passes = passes.into_iter().map(|w| made(&mut self.pipelines, gpu, &self.layout, w));
                let passes = passes.collect::<Result<_, _>>()?;
                let tile = if group.steps.len() > 1 { MEMORY - 2 * group.halo() } else { TILE };
                let mut steps = group.steps;
                for step in &mut steps {
                    step.states = (number % 3) as u32;
                }
                Ok(Dispatch { steps, passes, tile })
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
        if !dispatches.is_empty() {
            self.submit(gpu, up, picture, &dispatches);
        }
        gpu.check().map_err(RenderError::Device)?;
        self.drawn = true;
        Ok(plan)
    }

    fn submit(&self, gpu: &Gpu, up: &OnDevice, picture: &Picture, dispatches: &[Dispatch]) {
        let mut bytes: Vec<u8> = Vec::new();
        let mut offsets = Vec::new();
        for dispatch in dispatches {
            offsets.push(bytes.len() as u32);
            bytes.extend_from_slice(bytemuck::cast_slice(&dispatch.steps));
            bytes.resize(bytes.len().next_multiple_of(STRIDE), 0);
        }
        // As many as can be bound are bound of each: more than there are.
        bytes.resize(bytes.len() + BOUND, 0);
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
                size: wgpu::BufferSize::new(BOUND as u64),
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
                picture.rows.1.as_entire_binding(),
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
        let numbered: Vec<(usize, &Dispatch)> = dispatches.iter().enumerate().collect();
        for part in numbered.chunks(GROUPS_AT_ONCE) {
            let mut encoder = gpu
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("DosRenderer") });
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("DosRenderer"),
                    timestamp_writes: None,
                });
                for &(number, dispatch) in part {
                    let Some(offset) = offsets.get(number) else { continue };
                    pass.set_bind_group(0, &groups[number % 2], &[*offset]);
                    let [x, y] = picture.size.map(|s| s.div_ceil(dispatch.tile));
                    for (_, pipeline) in dispatch.passes.iter().filter_map(|p| self.pipelines.get(*p)) {
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
        ("stopping", flag(wanted.stopping)),
    ];
    // Only the shader of one step knows how to stop; the eye's pass has no footprint.
    let known = match wanted.shader {
        "dos_step" => &constants[..],
        "dos_tiles" | "dos_occlusion" | "dos_rows" => &constants[..5],
        _ => &constants[..2],
    };
    let pipeline = pipeline(gpu, wanted.shader, layout, known)?;
    gpu.check().map_err(RenderError::Device)?;
    pipelines.push((wanted, pipeline));
    Ok(pipelines.len() - 1)
}
