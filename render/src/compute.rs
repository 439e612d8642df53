//! Compute passes: their pipelines, what each is bound to this frame, and how long each took. Made
//! once a renderer; bindings live for one frame.

use std::time::Instant;

use crate::{gpu::Gpu, plan::PassName, renderer::RenderError};

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

struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
}

struct Bound {
    pass: PassName,
    group: wgpu::BindGroup,
    workgroups: [u32; 3],
}

/// Pipelines of a renderer's passes, and the passes bound for this frame in the order they run.
pub(crate) struct PassRunner {
    pipelines: Vec<(PassName, wgpu::ComputePipeline)>,
    bound: Vec<Bound>,
    timer: Option<Timer>,
}

/// Workgroups of 8x8 threads, one thread a pixel.
pub(crate) fn workgroups_of(size: [u32; 2]) -> [u32; 3] {
    [size[0].div_ceil(8), size[1].div_ceil(8), 1]
}

impl PassRunner {
    /// Compiles the entry point `main` of each pass's shader file.
    ///
    /// # Errors
    /// [`RenderError::Shader`] for a file that doesn't compose.
    pub fn new(gpu: &Gpu, shaders: &[(PassName, &str)]) -> Result<Self, RenderError> {
        let mut pipelines = Vec::new();
        for &(pass, name) in shaders {
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
        // Mesa's software Vulkan writes timestamps when commands are read, not when they are done.
        let timer = (gpu.has_timestamps() && !gpu.is_software()).then(|| {
            let count = 2 * shaders.len() as u32;
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
        Ok(Self { pipelines, bound: Vec::new(), timer })
    }

    /// Forgets the last frame's passes.
    pub fn clear(&mut self) {
        self.bound.clear();
    }

    /// Binds `entries` to `pass`, which runs after those bound before it. Does nothing for a pass
    /// that this runner has no pipeline of.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        pass: PassName,
        entries: &[(u32, wgpu::BindingResource<'_>)],
        workgroups: [u32; 3],
    ) {
        let Some((_, pipeline)) = self.pipelines.iter().find(|(name, _)| *name == pass) else { return };
        let entries: Vec<wgpu::BindGroupEntry<'_>> = entries
            .iter()
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
            .collect();
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(pass.name()),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        self.bound.push(Bound { pass, group, workgroups });
    }

    fn encode(&self, encoder: &mut wgpu::CommandEncoder, number: usize, timed: bool) {
        let Some(Bound { pass, group, workgroups }) = self.bound.get(number) else { return };
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
            let [x, y, z] = *workgroups;
            compute.dispatch_workgroups(x, y, z);
        }
        encoder.pop_debug_group();
    }

    /// Submits every bound pass, in order.
    pub fn run(&self, gpu: &Gpu) {
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("PassRunner::run") });
        for number in 0..self.bound.len() {
            self.encode(&mut encoder, number, true);
        }
        if let Some(timer) = &self.timer {
            let count = 2 * self.bound.len() as u32;
            encoder.resolve_query_set(&timer.queries, 0..count, &timer.resolved, 0);
            encoder.copy_buffer_to_buffer(&timer.resolved, 0, &timer.staging, 0, timer.staging.size());
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Where [`PassRunner::times`] come from on this device.
    pub fn time_source(&self) -> TimeSource {
        if self.timer.is_some() { TimeSource::Device } else { TimeSource::Host }
    }

    /// Milliseconds of each bound pass, in order. Waits for the frame. Without timestamps on the
    /// device the passes are run again, one by one.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn times(&self, gpu: &Gpu) -> Result<Vec<(PassName, f64)>, RenderError> {
        if let Some(timer) = &self.timer {
            let bytes = gpu.map(&timer.staging).map_err(RenderError::Device)?;
            let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&bytes);
            let ms_per_tick = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
            return Ok(self
                .bound
                .iter()
                .zip(ticks.chunks_exact(2))
                .map(|(bound, t)| (bound.pass, t[1].saturating_sub(t[0]) as f64 * ms_per_tick))
                .collect());
        }
        let mut times = Vec::new();
        for (number, bound) in self.bound.iter().enumerate() {
            gpu.wait().map_err(RenderError::Device)?;
            let start = Instant::now();
            let mut encoder = gpu
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("PassRunner::time") });
            self.encode(&mut encoder, number, false);
            gpu.queue.submit([encoder.finish()]);
            gpu.wait().map_err(RenderError::Device)?;
            times.push((bound.pass, start.elapsed().as_secs_f64() * 1e3));
        }
        Ok(times)
    }
}
