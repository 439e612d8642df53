//! Cone-traced occlusion on the graphics device.
//!
//! Lifetimes: the pipeline is made once; a volume's buffers and its pyramid once per `Arc`; the
//! picture's buffer once a size; uniforms and axes once a picture.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use wgpu::util::DeviceExt;

use super::{
    pyramid::Pyramid,
    settings::{ConeSettings, ConesUsed, MOST_SUB_CONES, sub_cones},
};
use crate::{
    camera::Camera,
    gpu::Gpu,
    occlusion::{
        Filter, OpticalVolume, Sight,
        cone::Decay,
        upload::{Kind, OnDevice, Optical, check_size, layout, pipeline},
    },
    renderer::{RenderError, check_view},
};

/// Levels that the shader knows.
const LEVELS: usize = 16;

/// `Level` of cones_trace.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct LevelInfo {
    pub dims: [u32; 3],
    pub start: u32,
    pub scale: [f32; 3],
    pub pad: u32,
}

/// `Cones` of cones_trace.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Cones {
    pub tangent: f32,
    pub ray_step: f32,
    pub cone_step: f32,
    pub coarsest: f32,
    pub voxel_mm: f32,
    pub count: u32,
    pub dark: f32,
    pub pad: u32,
    pub levels: [LevelInfo; LEVELS],
    pub decay: [[f32; 4]; 257],
}

/// `Share` of cones_trace.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Share {
    pub begin: f32,
    pub end: f32,
    pub first_axis: u32,
    pub end_axis: u32,
    pub advances: u32,
    pub pad: [u32; 3],
}

/// Rounds of all loops of one invocation that a dispatch may take: Mesa's software driver silently ends
/// the loops of an invocation after 65535 (`LP_MAX_TGSI_LOOP_ITERATIONS`).
const ROUNDS: u32 = 40_000;
/// Bytes from one share's uniform to the next.
const STRIDE: u64 = 256;

/// The dispatches of a picture whose rays are `length_mm` long in the volume.
fn shares(
    s: &ConeSettings,
    volume: &OpticalVolume,
    coarsest: u32,
    voxel_mm: f64,
    length_mm: f64,
) -> Vec<Share> {
    let labels = volume.filter() == Filter::Nearest;
    let cells: usize = volume.grid().dims().iter().sum::<usize>() + 3;
    let samples =
        if labels && coarsest == 0 { cells as u32 } else { s.samples(length_mm, voxel_mm, coarsest) };
    let axes = (ROUNDS / samples).clamp(1, s.sub_cones);
    let pieces = (ROUNDS / (axes * samples + 8)).max(1);
    let pieces_per_mm = 1.0 / (s.ray_step * voxel_mm) + if labels { 3f64.sqrt() / voxel_mm } else { 0.0 };
    let stretch_mm = f64::from(pieces) / pieces_per_mm;
    let stretches = (length_mm / stretch_mm).ceil().max(1.0) as u32;
    let mut out = Vec::new();
    for i in 0..stretches {
        for first in (0..s.sub_cones).step_by(axes as usize) {
            let end_axis = (first + axes).min(s.sub_cones);
            out.push(Share {
                begin: if i == 0 { 0.0 } else { (f64::from(i) * stretch_mm) as f32 },
                end: if i + 1 == stretches { f32::MAX } else { (f64::from(i + 1) * stretch_mm) as f32 },
                first_axis: first,
                end_axis,
                advances: u32::from(end_axis == s.sub_cones),
                pad: [0; 3],
            });
        }
    }
    out
}

struct Uploaded {
    medium: OnDevice,
    cells: wgpu::Buffer,
    levels: [LevelInfo; LEVELS],
    count: usize,
    voxel_mm: f64,
}

impl Uploaded {
    fn new(gpu: &Gpu, volume: &Arc<OpticalVolume>) -> Result<Self, RenderError> {
        let medium = OnDevice::new(gpu, volume)?;
        let pyramid = Pyramid::of(volume);
        let mut levels = [LevelInfo::default(); LEVELS];
        let mut cells: Vec<f32> = Vec::new();
        // Level 0 is the volume itself. 2^15 voxels a side are past any buffer.
        let count = pyramid.levels.len().min(LEVELS);
        for (info, level) in levels.iter_mut().zip(&pyramid.levels).skip(1) {
            *info = LevelInfo {
                dims: level.dims.map(|d| d as u32),
                start: cells.len() as u32,
                scale: level.voxels.map(|v| 1.0 / v as f32),
                pad: 0,
            };
            cells.extend_from_slice(&level.extinction);
        }
        if cells.is_empty() {
            cells.push(0.0);
        }
        let cells = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("Uploaded::cells"),
            contents: bytemuck::cast_slice(&cells),
            usage: wgpu::BufferUsages::STORAGE,
        });
        gpu.check().map_err(RenderError::Device)?;
        let voxel_mm = volume.grid().spacing_mm().min_element();
        Ok(Self { medium, cells, levels, count, voxel_mm })
    }
}

/// Draws cone-traced occlusion.
pub struct ConeRenderer {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
    optical: wgpu::Buffer,
    cones: wgpu::Buffer,
    axes: wgpu::Buffer,
    uploaded: Option<Uploaded>,
    picture: Option<([u32; 2], wgpu::Buffer)>,
    drawn: bool,
}

impl ConeRenderer {
    /// Compiles the pipeline.
    ///
    /// # Errors
    /// [`RenderError::Device`] when the driver refuses the shader.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        use Kind::{Moving, Read, Uniform, Write};
        let kinds =
            [Uniform, Read, Read, Read, Uniform, Read, Read, Write, Moving(size_of::<Share>() as u64)];
        let layout = layout(gpu, "ConeRenderer::layout", &kinds);
        let buffer = |label, size: usize, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let uniform = wgpu::BufferUsages::UNIFORM;
        let out = Self {
            pipeline: pipeline(gpu, "cones_trace", &layout, &[])?,
            layout,
            optical: buffer("ConeRenderer::optical", size_of::<Optical>(), uniform),
            cones: buffer("ConeRenderer::cones", size_of::<Cones>(), uniform),
            axes: buffer("ConeRenderer::axes", 16 * MOST_SUB_CONES as usize, wgpu::BufferUsages::STORAGE),
            uploaded: None,
            picture: None,
            drawn: false,
        };
        gpu.check().map_err(RenderError::Device)?;
        Ok(out)
    }

    /// Draws; returns when the work is submitted.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is drawn then.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        volume: &Arc<OpticalVolume>,
        camera: &Camera,
        size: [u32; 2],
        settings: &ConeSettings,
        skipping: bool,
    ) -> Result<ConesUsed, RenderError> {
        self.drawn = false;
        gpu.check().map_err(RenderError::Device)?;
        check_view(camera, None)?;
        if self.picture.as_ref().is_none_or(|p| p.0 != size) {
            self.picture = None;
            check_size(gpu, size)?;
            let eye = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("ConeRenderer::eye"),
                size: 16 * u64::from(size[0]) * u64::from(size[1]),
                usage: wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::COPY_SRC
                    | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            self.picture = Some((size, eye));
        }
        if self.uploaded.as_ref().is_none_or(|u| !Arc::ptr_eq(&u.medium.volume, volume)) {
            self.uploaded = None;
            self.uploaded = Some(Uploaded::new(gpu, volume)?);
        }
        let (Some(up), Some((_, eye))) = (&self.uploaded, &self.picture) else {
            return Err(RenderError::Device("the volume was not uploaded".to_owned()));
        };
        let sight = Sight::new(camera, size);
        let used = settings.used();
        let s = used.settings;
        let front_mm = sight.depths_mm(&volume.grid().corners_mm()).map_or(0.0, |d| d.0);
        let coarsest = s.coarsest_level.min(up.count as u32 - 1);
        let cones = Cones {
            tangent: s.sub_tangent() as f32,
            ray_step: (s.ray_step * up.voxel_mm) as f32,
            cone_step: s.cone_step as f32,
            coarsest: coarsest as f32,
            voxel_mm: up.voxel_mm as f32,
            count: s.sub_cones,
            dark: (40.0 / up.voxel_mm) as f32,
            pad: 0,
            levels: up.levels,
            decay: Decay::of(s.aperture_deg).packed(),
        };
        let axes: Vec<[f32; 4]> =
            sub_cones(&s).iter().map(|a| [a[0] as f32, a[1] as f32, a[2] as f32, 0.0]).collect();
        let optical = up.medium.uniform(&sight, front_mm, skipping);
        gpu.queue.write_buffer(&self.optical, 0, bytemuck::bytes_of(&optical));
        gpu.queue.write_buffer(&self.cones, 0, bytemuck::bytes_of(&cones));
        gpu.queue.write_buffer(&self.axes, 0, bytemuck::cast_slice(&axes));
        let fresh = vec![[0.0f32, 0.0, 0.0, 1.0]; size[0] as usize * size[1] as usize];
        gpu.queue.write_buffer(eye, 0, bytemuck::cast_slice(&fresh));
        let corners = volume.grid().corners_mm();
        // From the plane of depth 0 to the farthest corner, slanted.
        let far = sight.depths_mm(&corners).map_or(0.0, |d| d.1 - d.0);
        let length_mm = (far * sight.slant([0, 0])).max(corners[0].distance(corners[7]));
        let shares = shares(&s, volume, coarsest, up.voxel_mm, length_mm);
        let mut bytes = vec![0u8; shares.len() * STRIDE as usize];
        for (share, place) in shares.iter().zip(bytes.chunks_exact_mut(STRIDE as usize)) {
            place[..size_of::<Share>()].copy_from_slice(bytemuck::bytes_of(share));
        }
        let moving = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("ConeRenderer::shares"),
            contents: &bytes,
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let buffers = [
            &self.optical,
            &up.medium.values,
            &up.medium.table,
            &up.medium.bricks,
            &self.cones,
            &up.cells,
            &self.axes,
            eye,
        ];
        let mut entries: Vec<wgpu::BindGroupEntry<'_>> = buffers
            .iter()
            .zip(0u32..)
            .map(|(buffer, binding)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        entries.push(wgpu::BindGroupEntry {
            binding: 8,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &moving,
                offset: 0,
                size: wgpu::BufferSize::new(size_of::<Share>() as u64),
            }),
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("ConeRenderer::group"),
            layout: &self.layout,
            entries: &entries,
        });
        let numbers: Vec<u32> = (0..shares.len() as u32).collect();
        for part in numbers.chunks(64) {
            let mut encoder = gpu
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("ConeRenderer") });
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("ConeRenderer"),
                    timestamp_writes: None,
                });
                pass.set_pipeline(&self.pipeline);
                for number in part {
                    pass.set_bind_group(0, &group, &[number * STRIDE as u32]);
                    pass.dispatch_workgroups(size[0].div_ceil(8), size[1].div_ceil(8), 1);
                }
            }
            gpu.queue.submit([encoder.finish()]);
        }
        gpu.check().map_err(RenderError::Device)?;
        self.drawn = true;
        Ok(used)
    }

    /// Linear radiance (before the background) and transmittance of each pixel of the last picture,
    /// rows from the top; empty when there is none. Waits for it.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<[f32; 4]>, RenderError> {
        let Some((_, eye)) = self.picture.as_ref().filter(|_| self.drawn) else { return Ok(Vec::new()) };
        let bytes = gpu.read_buffers(&[(eye, 0, eye.size())]).map_err(RenderError::Device)?;
        Ok(bytes.first().map(|b| bytemuck::pod_collect_to_vec(b)).unwrap_or_default())
    }
}
