//! Runs a plan.
//!
//! Lifetimes: pipelines are made once a [`Renderer`]; a region volume's bricks once per `Arc` (cut
//! on all cores, then one upload); targets once a size (about 40 bytes a pixel); the uniform, about 200
//! bytes, and a small table of colours once a frame.

use std::{sync::Arc, time::Instant};

use glioscope_core::RegionVolume;
use wgpu::util::DeviceExt;

use crate::{
    bricks::Bricks,
    frame::Frame,
    gpu::Gpu,
    plan::{PassName, Plan, Quality, plan},
    scene::Scene,
    targets::Targets,
    uniforms::{self, MANY_REGIONS, NO_SKIPPING},
};

/// A picture that can't be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// Nothing to draw on, or too much.
    #[error(
        "found a picture of {}x{} pixels, expected sides of 1 to {side} pixels and at most {pixels} pixels",
        found[0], found[1]
    )]
    Size {
        /// The size asked for.
        found: [u32; 2],
        /// Longest side that the device takes.
        side: u32,
        /// Most pixels that the device takes.
        pixels: u64,
    },
    /// The regions don't fit on the card.
    #[error(
        "found regions that need {found} bytes in one buffer, expected at most {limit} on this graphics device"
    )]
    Volume {
        /// Bytes needed.
        found: u64,
        /// Bytes that the device takes.
        limit: u64,
    },
    /// Lens or camera is not a number, or has no size.
    #[error("found {0}, expected finite numbers and sizes above 0")]
    Scene(String),
    /// The device failed.
    #[error("the graphics device failed: {0}")]
    Device(String),
    /// A shader of ours does not compose.
    #[error(transparent)]
    Shader(#[from] glioscope_shaders::ComposeError),
}

/// Where pass times come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeSource {
    /// The device's own clock, around each pass of the frame.
    Device,
    /// The host's clock: each pass run again on its own, submit to done.
    Host,
}

impl TimeSource {
    /// In words, for the diagnostics panel.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Device => "timestamps of the graphics device",
            Self::Host => "host clock around each pass",
        }
    }
}

/// Numbers of the bindings, as the shaders write them.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slot {
    View = 0,
    Bricks = 1,
    Voxels = 2,
    Regions = 3,
    Depths = 4,
    Surfaces = 5,
    Outsides = 6,
    Occlusion = 7,
    Blurred = 8,
    Kernel = 9,
    Picture = 10,
}

fn shader_of(pass: PassName) -> (&'static str, &'static [Slot]) {
    use Slot::*;
    match pass {
        PassName::Surface => ("closeup_surface", &[View, Bricks, Voxels, Regions, Depths, Surfaces]),
        PassName::Outside => ("closeup_outside", &[View, Bricks, Voxels, Regions, Depths, Outsides]),
        PassName::Occlusion => ("closeup_occlusion", &[View, Regions, Depths, Surfaces, Occlusion, Kernel]),
        PassName::OcclusionBlur => ("closeup_occlusion_blur", &[View, Depths, Occlusion, Blurred]),
        PassName::Compose => {
            ("closeup_compose", &[View, Regions, Depths, Surfaces, Outsides, Blurred, Picture])
        }
    }
}

struct Uploaded {
    volume: Option<Arc<RegionVolume>>,
    dims: [u32; 3],
    brick_dims: [u32; 3],
    log2_ids_per_word: u32,
    table: wgpu::Buffer,
    words: wgpu::Buffer,
    regions: wgpu::Buffer,
}

struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
}

/// Draws closeups. Not bound to a window.
pub struct Renderer {
    pipelines: Vec<(PassName, wgpu::ComputePipeline)>,
    view: wgpu::Buffer,
    kernel: wgpu::Buffer,
    kernel_samples: u32,
    uploaded: Option<Uploaded>,
    frame: Option<Frame>,
    timer: Option<Timer>,
    bound: Vec<(PassName, wgpu::BindGroup)>,
}

fn check_scene(scene: &Scene) -> Result<(), RenderError> {
    let c = &scene.camera;
    let turn_is_unit = (c.world_from_camera.length() - 1.0).abs() < 1e-3;
    if !(c.focus_mm.is_finite() && turn_is_unit && c.height_mm.is_finite() && c.height_mm > 0.0) {
        return Err(RenderError::Scene(format!("camera {c:?}")));
    }
    match &scene.lens {
        Some(l) if !(l.center_mm.is_finite() && l.radius_mm.is_finite() && l.radius_mm > 0.0) => {
            Err(RenderError::Scene(format!("lens {l:?}")))
        }
        _ => Ok(()),
    }
}

fn byte_len(words: usize) -> u64 {
    words as u64 * 4
}

impl Renderer {
    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`RenderError::Device`] when the driver refuses a shader.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let mut pipelines = Vec::new();
        for pass in PassName::ALL {
            let name = shader_of(pass).0;
            let source = glioscope_shaders::compose(name)?;
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
            let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: None,
                module: &module,
                entry_point: Some("main"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    // No workgroup memory is used.
                    zero_initialize_workgroup_memory: false,
                    ..Default::default()
                },
                cache: None,
            });
            pipelines.push((pass, pipeline));
        }
        let uniform = |label, size: usize| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        // Mesa's software Vulkan writes timestamps when commands are read, not when they are done.
        let timer = (gpu.has_timestamps() && !gpu.is_software()).then(|| {
            let count = 2 * PassName::ALL.len() as u32;
            let buffer = |label, usage| {
                gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size: u64::from(count) * 8,
                    usage,
                    mapped_at_creation: false,
                })
            };
            Timer {
                queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("Timer::queries"),
                    ty: wgpu::QueryType::Timestamp,
                    count,
                }),
                resolved: buffer(
                    "Timer::resolved",
                    wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                ),
                staging: buffer(
                    "Timer::staging",
                    wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                ),
            }
        });
        gpu.check().map_err(RenderError::Device)?;
        Ok(Self {
            pipelines,
            view: uniform("Renderer::view", size_of::<uniforms::View>()),
            kernel: uniform("Renderer::kernel", size_of::<[[f32; 4]; 32]>()),
            kernel_samples: 0,
            uploaded: None,
            frame: None,
            timer,
            bound: Vec::new(),
        })
    }

    /// Draws `scene` at `quality` for a place of `size_px` pixels. Returns when the work is
    /// submitted; reading the frame waits for it.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is drawn then, and the frame before is gone.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<&Frame, RenderError> {
        self.render_planned(gpu, scene, quality, size_px, plan(scene, quality), true)
    }

    /// The last frame, if drawing it went well.
    pub fn frame(&self) -> Option<&Frame> {
        self.frame.as_ref()
    }

    /// As [`Renderer::render`] with a given plan; bricks are jumped over when `skipping`.
    pub(crate) fn render_planned(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        quality: &Quality,
        asked_px: [u32; 2],
        plan: Plan,
        skipping: bool,
    ) -> Result<&Frame, RenderError> {
        let before = self.frame.take();
        self.bound.clear();
        gpu.check().map_err(RenderError::Device)?;
        check_scene(scene)?;
        let scale = if quality.resolution_scale > 0.0 { quality.resolution_scale.min(1.0) } else { 1.0 };
        let size = asked_px.map(|p| if p == 0 { 0 } else { ((f64::from(p) * scale).ceil() as u32).max(1) });
        let targets = match before {
            Some(frame) if frame.targets.size == size => frame.targets,
            _ => Targets::new(gpu, size)?,
        };
        self.upload(gpu, scene.tumor.as_ref())?;
        let Some(up) = &self.uploaded else {
            return Err(RenderError::Device("the regions were not uploaded".to_owned()));
        };
        let mut view = uniforms::view(scene, quality, &plan, size);
        view.dims = up.dims;
        view.bricks = up.brick_dims;
        view.log2_ids_per_word = up.log2_ids_per_word;
        if !skipping {
            view.flags |= NO_SKIPPING;
        }
        let regions = region_table(scene, &mut view);
        gpu.queue.write_buffer(&up.regions, 0, bytemuck::cast_slice(&regions));
        gpu.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
        if self.kernel_samples != view.occlusion_samples {
            self.kernel_samples = view.occlusion_samples;
            let kernel = uniforms::occlusion_kernel(view.occlusion_samples);
            gpu.queue.write_buffer(&self.kernel, 0, bytemuck::cast_slice(&kernel));
        }
        self.bind(gpu, &plan, &targets);
        self.run(gpu, size);
        gpu.check().map_err(RenderError::Device)?;
        Ok(self.frame.insert(Frame {
            color: targets.color.clone(),
            size_px: size,
            asked_px,
            plan,
            targets,
            tumor: scene.tumor.clone(),
            camera: scene.camera,
            lens: scene.lens,
            reference_mm: uniforms::reference_mm(scene),
        }))
    }

    fn upload(&mut self, gpu: &Gpu, tumor: Option<&Arc<RegionVolume>>) -> Result<(), RenderError> {
        if let Some(up) = &self.uploaded {
            let same = match (&up.volume, tumor) {
                (Some(a), Some(b)) => Arc::ptr_eq(a, b),
                (None, None) => true,
                _ => false,
            };
            if same {
                return Ok(());
            }
        }
        // The one before may be large: let it go first.
        self.uploaded = None;
        let limits = gpu.device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let (dims, bricks, region_count) = match tumor {
            None => {
                let none = Bricks { dims: [0; 3], table: vec![[0; 2]], words: vec![0], log2_ids_per_word: 2 };
                ([0; 3], none, 1)
            }
            Some(volume) => {
                let dims = volume.grid().dims();
                // Counted before anything is allocated.
                let table: usize = dims.iter().map(|d| d.div_ceil(crate::bricks::SIDE)).product();
                let most = byte_len(2).saturating_mul(table as u64);
                if most > limit {
                    return Err(RenderError::Volume { found: most, limit });
                }
                (dims, Bricks::of(volume), volume.bits_of_id().len())
            }
        };
        let needed = byte_len(bricks.words.len()).max(byte_len(region_count));
        if needed > limit {
            return Err(RenderError::Volume { found: needed, limit });
        }
        let buffer = |label, contents: &[u8]| {
            gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            })
        };
        self.uploaded = Some(Uploaded {
            volume: tumor.cloned(),
            dims: dims.map(|d| d as u32),
            brick_dims: bricks.dims.map(|d| d as u32),
            log2_ids_per_word: bricks.log2_ids_per_word,
            table: buffer("Uploaded::table", bytemuck::cast_slice(&bricks.table)),
            words: buffer("Uploaded::words", bytemuck::cast_slice(&bricks.words)),
            regions: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("Uploaded::regions"),
                size: byte_len(region_count),
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
        });
        gpu.check().map_err(RenderError::Device)
    }

    fn bind(&mut self, gpu: &Gpu, plan: &Plan, targets: &Targets) {
        let Some(up) = &self.uploaded else { return };
        let picture = targets.color.create_view(&wgpu::TextureViewDescriptor::default());
        for (pass, pipeline) in self.pipelines.iter().filter(|(pass, _)| plan.has(*pass)) {
            let entries: Vec<wgpu::BindGroupEntry<'_>> = shader_of(*pass)
                .1
                .iter()
                .map(|&slot| wgpu::BindGroupEntry {
                    binding: slot as u32,
                    resource: match slot {
                        Slot::View => self.view.as_entire_binding(),
                        Slot::Bricks => up.table.as_entire_binding(),
                        Slot::Voxels => up.words.as_entire_binding(),
                        Slot::Regions => up.regions.as_entire_binding(),
                        Slot::Depths => targets.depths.as_entire_binding(),
                        Slot::Surfaces => targets.surfaces.as_entire_binding(),
                        Slot::Outsides => targets.outsides.as_entire_binding(),
                        Slot::Occlusion => targets.occlusion.as_entire_binding(),
                        Slot::Blurred => targets.blurred.as_entire_binding(),
                        Slot::Kernel => self.kernel.as_entire_binding(),
                        Slot::Picture => wgpu::BindingResource::TextureView(&picture),
                    },
                })
                .collect();
            let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(pass.name()),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            });
            self.bound.push((*pass, group));
        }
    }

    fn encode(&self, encoder: &mut wgpu::CommandEncoder, number: usize, size: [u32; 2], timed: bool) {
        let Some((pass, group)) = self.bound.get(number) else { return };
        let Some((_, pipeline)) = self.pipelines.iter().find(|(name, _)| name == pass) else { return };
        let timestamp_writes = match &self.timer {
            Some(timer) if timed => Some(wgpu::ComputePassTimestampWrites {
                query_set: &timer.queries,
                beginning_of_pass_write_index: Some(2 * number as u32),
                end_of_pass_write_index: Some(2 * number as u32 + 1),
            }),
            _ => None,
        };
        encoder.push_debug_group(pass.name());
        {
            let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(pass.name()),
                timestamp_writes,
            });
            compute.set_pipeline(pipeline);
            compute.set_bind_group(0, group, &[]);
            compute.dispatch_workgroups(size[0].div_ceil(8), size[1].div_ceil(8), 1);
        }
        encoder.pop_debug_group();
    }

    fn run(&self, gpu: &Gpu, size: [u32; 2]) {
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("Renderer::run") });
        for number in 0..self.bound.len() {
            self.encode(&mut encoder, number, size, true);
        }
        if let Some(timer) = &self.timer {
            let count = 2 * self.bound.len() as u32;
            encoder.resolve_query_set(&timer.queries, 0..count, &timer.resolved, 0);
            encoder.copy_buffer_to_buffer(&timer.resolved, 0, &timer.staging, 0, timer.staging.size());
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Where [`Renderer::pass_times`] come from on this device.
    pub fn time_source(&self) -> TimeSource {
        if self.timer.is_some() { TimeSource::Device } else { TimeSource::Host }
    }

    /// Milliseconds of each pass of the last frame, in order; empty before the first. Waits for it.
    /// Without timestamps on the device the passes are run again, one by one.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn pass_times(&self, gpu: &Gpu) -> Result<Vec<(PassName, f64)>, RenderError> {
        let Some(frame) = &self.frame else { return Ok(Vec::new()) };
        if let Some(timer) = &self.timer {
            let bytes = gpu.map(&timer.staging).map_err(RenderError::Device)?;
            let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&bytes);
            let ms_per_tick = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
            return Ok(self
                .bound
                .iter()
                .zip(ticks.chunks_exact(2))
                .map(|((pass, _), t)| (*pass, t[1].saturating_sub(t[0]) as f64 * ms_per_tick))
                .collect());
        }
        let mut times = Vec::new();
        for (number, (pass, _)) in self.bound.iter().enumerate() {
            gpu.wait().map_err(RenderError::Device)?;
            let start = Instant::now();
            let mut encoder = gpu
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("Renderer::time") });
            self.encode(&mut encoder, number, frame.size_px, false);
            gpu.queue.submit([encoder.finish()]);
            gpu.wait().map_err(RenderError::Device)?;
            times.push((*pass, start.elapsed().as_secs_f64() * 1e3));
        }
        Ok(times)
    }
}

/// Colour and visibility of every region number; sets the bit set of the shown ones in `view`.
fn region_table(scene: &Scene, view: &mut uniforms::View) -> Vec<u32> {
    const SHOWN: u32 = 0x8000_0000;
    let Some(tumor) = &scene.tumor else { return vec![0] };
    // Number 0 is empty; 1 to 32 have a bit of the set each.
    if tumor.bits_of_id().len() > 33 {
        view.flags |= MANY_REGIONS;
    }
    tumor
        .bits_of_id()
        .iter()
        .zip(0u32..)
        .map(|(&bits, number)| {
            if number == 0 {
                return 0;
            }
            let [r, g, b] = scene.colors.region(bits).map(u32::from);
            let rgb = r | g << 8 | b << 16;
            if scene.selection.shows(bits) {
                view.selected |= 1 << (number & 31);
                rgb | SHOWN
            } else {
                rgb
            }
        })
        .collect()
}
