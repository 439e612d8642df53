//! Runs passes: their pipelines, their bindings of this frame, and their times. Pipelines are compiled once per
//! renderer; bindings live for one frame.

use std::{ops::Range, time::Instant};

use super::{
    error::RenderError,
    gpu::Gpu,
    pass::PassName,
    pipelines::{RasterShader, compute_pipeline, raster_pipeline},
};

/// Where pass times come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeSource {
    /// The device's timestamps around each pass of the frame.
    Device,
    /// The host's clock: each pass run again on its own, from submission to completion.
    Host,
}

impl TimeSource {
    /// Description for the diagnostics panel.
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

/// What a raster pass draws, and its targets. These are cleared first: the picture to 0, the depths to 1.
#[derive(Clone, Debug)]
pub(crate) struct Drawing {
    pub picture: wgpu::TextureView,
    pub depths: wgpu::TextureView,
    /// Vertex indices of triangles, 16 bits each.
    pub indices: wgpu::Buffer,
    pub index_count: u32,
    pub instances: u32,
}

/// One step of a pass of many.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dispatch {
    /// Index into the pass's pipelines.
    pub pipeline: usize,
    /// Dynamic offset, bytes.
    pub offset: u32,
    pub workgroups: [u32; 3],
}

enum Work {
    Compute {
        pipeline: wgpu::ComputePipeline,
        workgroups: [u32; 3],
    },
    /// Dispatches one after the other.
    Steps {
        pipelines: Vec<wgpu::ComputePipeline>,
        steps: Vec<Dispatch>,
    },
    Raster {
        pipeline: wgpu::RenderPipeline,
        drawing: Box<Drawing>,
    },
}

struct Bound {
    pass: PassName,
    group: wgpu::BindGroup,
    work: Work,
}

/// A shader file and the constants that it is compiled with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shader<'a> {
    pub file: &'static str,
    pub constants: &'a [(&'static str, f64)],
}

impl From<&'static str> for Shader<'_> {
    fn from(file: &'static str) -> Self {
        Self { file, constants: &[] }
    }
}

struct Compiled {
    file: &'static str,
    constants: Vec<(&'static str, f64)>,
    pipeline: wgpu::ComputePipeline,
}

/// Pipelines of a renderer's passes, and the passes bound for this frame in the order they run.
pub(crate) struct PassRunner {
    compute: Vec<Compiled>,
    raster: Vec<(RasterShader, wgpu::RenderPipeline)>,
    bound: Vec<Bound>,
    timer: Option<Timer>,
    parts: Parts,
    /// Passes that the last frame ran to their end.
    completed: Vec<PassName>,
}

/// Progress of a frame that is run in parts.
#[derive(Default)]
struct Parts {
    /// Index of the next bound pass, and of its next step.
    next: (usize, usize),
    /// Steps per submission; 0 before the first frame in parts.
    chunk: usize,
    /// Milliseconds of each pass so far.
    elapsed_ms: Vec<(PassName, f64)>,
}

/// Workgroups of 8x8 threads, one thread per pixel.
pub(crate) fn workgroups_of(size: [u32; 2]) -> [u32; 3] {
    [size[0].div_ceil(8), size[1].div_ceil(8), 1]
}

fn group_of(
    gpu: &Gpu,
    pass: PassName,
    layout: &wgpu::BindGroupLayout,
    entries: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = entries
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(pass.name()),
        layout,
        entries: &entries,
    })
}

/// The most passes of a frame with timestamps.
const MOST_PASSES: u32 = 32;

impl PassRunner {
    /// Compiles these shader files; others are compiled when first bound to a pass.
    ///
    /// # Errors
    /// [`RenderError::Shader`] for a file that doesn't compose.
    pub fn new(gpu: &Gpu, shaders: impl IntoIterator<Item = &'static str>) -> Result<Self, RenderError> {
        // Mesa's software Vulkan writes timestamps when commands are read, not when they complete.
        let timer = (gpu.has_timestamps() && !gpu.is_software()).then(|| {
            let count = 2 * MOST_PASSES;
            let bytes = u64::from(count) * 8;
            Timer {
                queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("Timer::queries"),
                    ty: wgpu::QueryType::Timestamp,
                    count,
                }),
                resolved: gpu.buffer(
                    "Timer::resolved",
                    bytes,
                    wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                ),
                staging: gpu.buffer(
                    "Timer::staging",
                    bytes,
                    wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                ),
            }
        });
        let parts = Parts::default();
        let mut runner = Self {
            compute: Vec::new(),
            raster: Vec::new(),
            bound: Vec::new(),
            timer,
            parts,
            completed: Vec::new(),
        };
        for file in shaders {
            runner.pipeline(gpu, file.into())?;
        }
        Ok(runner)
    }

    /// Forgets the last frame's passes.
    pub fn clear(&mut self) {
        self.completed = self.bound.iter().take(self.parts.next.0).map(|bound| bound.pass).collect();
        self.bound.clear();
        self.parts = Parts { chunk: self.parts.chunk, ..Parts::default() };
    }

    /// Whether the last frame ran this pass to its end: frames in parts may be dropped before.
    pub fn completed(&self, pass: PassName) -> bool {
        self.completed.contains(&pass)
    }

    /// Binds `entries` to `pass`, which runs after the passes bound before it.
    ///
    /// # Errors
    /// [`RenderError::Shader`] for a file that doesn't compose.
    pub fn bind<'a>(
        &mut self,
        gpu: &Gpu,
        pass: PassName,
        shader: impl Into<Shader<'a>>,
        entries: &[(u32, wgpu::BindingResource<'_>)],
        workgroups: [u32; 3],
    ) -> Result<(), RenderError> {
        let pipeline = self.pipeline(gpu, shader.into())?;
        let group = group_of(gpu, pass, &pipeline.get_bind_group_layout(0), entries);
        self.bound.push(Bound { pass, group, work: Work::Compute { pipeline, workgroups } });
        Ok(())
    }

    fn pipeline(&mut self, gpu: &Gpu, shader: Shader<'_>) -> Result<wgpu::ComputePipeline, RenderError> {
        let Shader { file, constants } = shader;
        if let Some(compiled) = self.compute.iter().find(|c| c.file == file && c.constants == constants) {
            return Ok(compiled.pipeline.clone());
        }
        let pipeline = compute_pipeline(gpu, file, None, constants)?;
        self.compute.push(Compiled { file, constants: constants.to_vec(), pipeline: pipeline.clone() });
        Ok(pipeline)
    }

    /// As [`PassRunner::bind`] for a raster pass.
    ///
    /// # Errors
    /// [`RenderError::Shader`] for a file that doesn't compose.
    pub fn bind_raster(
        &mut self,
        gpu: &Gpu,
        pass: PassName,
        shader: RasterShader,
        entries: &[(u32, wgpu::BindingResource<'_>)],
        drawing: Drawing,
    ) -> Result<(), RenderError> {
        let compiled = self.raster.iter().find(|(compiled, _)| *compiled == shader);
        let pipeline = match compiled {
            Some((_, pipeline)) => pipeline.clone(),
            None => {
                let pipeline = raster_pipeline(gpu, shader)?;
                self.raster.push((shader, pipeline.clone()));
                pipeline
            }
        };
        let group = group_of(gpu, pass, &pipeline.get_bind_group_layout(0), entries);
        self.bound.push(Bound { pass, group, work: Work::Raster { pipeline, drawing: Box::new(drawing) } });
        Ok(())
    }

    /// As [`PassRunner::bind`] for a pass of many steps with the caller's pipelines; one binding of `layout` has a
    /// dynamic offset.
    pub fn bind_steps(
        &mut self,
        gpu: &Gpu,
        pass: PassName,
        layout: &wgpu::BindGroupLayout,
        entries: &[(u32, wgpu::BindingResource<'_>)],
        (pipelines, steps): (Vec<wgpu::ComputePipeline>, Vec<Dispatch>),
    ) {
        let group = group_of(gpu, pass, layout, entries);
        self.bound.push(Bound { pass, group, work: Work::Steps { pipelines, steps } });
    }

    /// Steps of a bound pass; 1 for a pass of one dispatch or drawing.
    fn steps_of(&self, number: usize) -> usize {
        match self.bound.get(number).map(|bound| &bound.work) {
            Some(Work::Steps { steps, .. }) => steps.len(),
            Some(_) => 1,
            None => 0,
        }
    }

    fn encode(&self, encoder: &mut wgpu::CommandEncoder, number: usize, range: Range<usize>, timed: bool) {
        let Some(Bound { pass, group, work }) = self.bound.get(number) else { return };
        let timer = self.timer.as_ref().filter(|_| timed);
        let (first, last) = (Some(2 * number as u32), Some(2 * number as u32 + 1));
        encoder.push_debug_group(pass.name());
        match work {
            Work::Compute { .. } | Work::Steps { .. } => {
                let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some(pass.name()),
                    timestamp_writes: timer.map(|timer| wgpu::ComputePassTimestampWrites {
                        query_set: &timer.queries,
                        beginning_of_pass_write_index: first,
                        end_of_pass_write_index: last,
                    }),
                });
                match work {
                    Work::Compute { pipeline, workgroups: [x, y, z] } => {
                        compute.set_pipeline(pipeline);
                        compute.set_bind_group(0, group, &[]);
                        compute.dispatch_workgroups(*x, *y, *z);
                    }
                    Work::Steps { pipelines, steps } => {
                        for step in steps.get(range).unwrap_or_default() {
                            let Some(pipeline) = pipelines.get(step.pipeline) else { continue };
                            let [x, y, z] = step.workgroups;
                            compute.set_pipeline(pipeline);
                            compute.set_bind_group(0, group, &[step.offset]);
                            compute.dispatch_workgroups(x, y, z);
                        }
                    }
                    Work::Raster { .. } => {}
                }
            }
            Work::Raster { pipeline, drawing } => {
                let mut raster = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some(pass.name()),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view: &drawing.picture,
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                            store: wgpu::StoreOp::Store,
                        },
                    })],
                    depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                        view: &drawing.depths,
                        depth_ops: Some(wgpu::Operations {
                            load: wgpu::LoadOp::Clear(1.0),
                            store: wgpu::StoreOp::Discard,
                        }),
                        stencil_ops: None,
                    }),
                    timestamp_writes: timer.map(|timer| wgpu::RenderPassTimestampWrites {
                        query_set: &timer.queries,
                        beginning_of_pass_write_index: first,
                        end_of_pass_write_index: last,
                    }),
                    occlusion_query_set: None,
                    multiview_mask: None,
                });
                raster.set_pipeline(pipeline);
                raster.set_bind_group(0, group, &[]);
                raster.set_index_buffer(drawing.indices.slice(..), wgpu::IndexFormat::Uint16);
                raster.draw_indexed(0..drawing.index_count, 0, 0..drawing.instances);
            }
        }
        encoder.pop_debug_group();
    }

    /// Submits every bound pass, in order.
    pub fn run(&mut self, gpu: &Gpu) {
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("PassRunner::run") });
        for number in 0..self.bound.len() {
            self.encode(&mut encoder, number, 0..self.steps_of(number), true);
        }
        if let Some(timer) = &self.timer {
            let count = 2 * self.bound.len() as u32;
            encoder.resolve_query_set(&timer.queries, 0..count, &timer.resolved, 0);
            encoder.copy_buffer_to_buffer(&timer.resolved, 0, &timer.staging, 0, timer.staging.size());
        }
        gpu.queue.submit([encoder.finish()]);
        self.parts.next = (self.bound.len(), 0);
    }

    /// Resumes the bound passes for about `milliseconds`, a pass or some of its steps at a time, and waits for them.
    /// Returns whether all passes are done.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn run_part(&mut self, gpu: &Gpu, milliseconds: f64) -> Result<bool, RenderError> {
        let part_start = Instant::now();
        loop {
            let (number, from) = self.parts.next;
            let Some(pass) = self.bound.get(number).map(|bound| bound.pass) else { return Ok(true) };
            let step_count = self.steps_of(number);
            let until = step_count.min(from + self.parts.chunk.max(1));
            let start = Instant::now();
            let mut encoder = gpu
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("PassRunner::part") });
            self.encode(&mut encoder, number, from..until, false);
            gpu.queue.submit([encoder.finish()]);
            gpu.wait()?;
            let elapsed_ms = start.elapsed().as_secs_f64() * 1e3;
            if self.parts.elapsed_ms.len() <= number {
                self.parts.elapsed_ms.push((pass, 0.0));
            }
            if let Some((_, pass_ms)) = self.parts.elapsed_ms.get_mut(number) {
                *pass_ms += elapsed_ms;
            }
            if step_count > 1 && elapsed_ms > milliseconds {
                self.parts.chunk = (self.parts.chunk / 2).max(1);
            } else if until - from == self.parts.chunk.max(1) && elapsed_ms < 0.2 * milliseconds {
                self.parts.chunk = 2 * self.parts.chunk.max(1);
            }
            self.parts.next = if until < step_count { (number, until) } else { (number + 1, 0) };
            if self.parts.next.0 >= self.bound.len() {
                return Ok(true);
            }
            if part_start.elapsed().as_secs_f64() * 1e3 >= milliseconds {
                return Ok(false);
            }
        }
    }

    /// Share of the bound passes' steps that [`PassRunner::run_part`] has done, 0 to 1.
    pub fn share_done(&self) -> f64 {
        let steps = |numbers: Range<usize>| numbers.map(|n| self.steps_of(n)).sum::<usize>();
        let (number, step) = self.parts.next;
        (steps(0..number) + step) as f64 / steps(0..self.bound.len()).max(1) as f64
    }

    /// Where [`PassRunner::times`] come from on this device.
    pub fn time_source(&self) -> TimeSource {
        if self.timer.is_some() && self.parts.elapsed_ms.is_empty() {
            TimeSource::Device
        } else {
            TimeSource::Host
        }
    }

    /// Milliseconds of each bound pass, in order. Waits for the frame. Without timestamps on the device, the passes
    /// are run again, one by one. The times of a frame in parts are the sums of its parts.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn times(&self, gpu: &Gpu) -> Result<Vec<(PassName, f64)>, RenderError> {
        if !self.parts.elapsed_ms.is_empty() {
            return Ok(self.parts.elapsed_ms.clone());
        }
        if let Some(timer) = &self.timer {
            let bytes = gpu.map(&timer.staging)?;
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
            gpu.wait()?;
            let start = Instant::now();
            let mut encoder = gpu
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("PassRunner::time") });
            self.encode(&mut encoder, number, 0..self.steps_of(number), false);
            gpu.queue.submit([encoder.finish()]);
            gpu.wait()?;
            times.push((bound.pass, start.elapsed().as_secs_f64() * 1e3));
        }
        Ok(times)
    }
}
