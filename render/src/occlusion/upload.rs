//! A medium on the graphics device.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use wgpu::util::DeviceExt;

use super::{Filter, Occupied, OpticalVolume, Sight};
use crate::{gpu::Gpu, renderer::RenderError};

/// `Optical` of lib/optics.wgsl; see there.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Optical {
    pub corner: [f32; 3],
    pub pixel_mm: f32,
    pub right: [f32; 3],
    pub pixel_mm_per_mm: f32,
    pub up: [f32; 3],
    pub table_scale: f32,
    pub forward: [f32; 3],
    pub table_offset: f32,
    pub plane: [f32; 4],
    pub dims: [u32; 3],
    pub table_last: u32,
    pub bricks: [u32; 3],
    pub nearest: u32,
    pub size: [u32; 2],
    pub skipping: u32,
    pub pad: u32,
}

/// Values, table and occupied bricks in buffers.
pub(crate) struct OnDevice {
    pub volume: Arc<OpticalVolume>,
    pub occupied: Occupied,
    pub values: wgpu::Buffer,
    pub table: wgpu::Buffer,
    pub bricks: wgpu::Buffer,
}

impl OnDevice {
    /// # Errors
    /// [`RenderError::Volume`] when it doesn't fit.
    pub fn new(gpu: &Gpu, volume: &Arc<OpticalVolume>) -> Result<Self, RenderError> {
        let limits = gpu.device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let found = 4 * volume.values().len() as u64;
        if found > limit {
            return Err(RenderError::Volume { found, limit });
        }
        let occupied = Occupied::of(volume);
        let buffer = |label, contents: &[u8]| {
            gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: wgpu::BufferUsages::STORAGE,
            })
        };
        let out = Self {
            values: buffer("OnDevice::values", bytemuck::cast_slice(volume.values())),
            table: buffer("OnDevice::table", bytemuck::cast_slice(volume.table().entries())),
            bricks: buffer("OnDevice::bricks", bytemuck::cast_slice(&occupied.words())),
            occupied,
            volume: Arc::clone(volume),
        };
        gpu.check().map_err(RenderError::Device)?;
        Ok(out)
    }

    /// The uniform for depths counted from `front_mm` of view depth.
    pub fn uniform(&self, sight: &Sight, front_mm: f64, skipping: bool) -> Optical {
        let single = |v: DVec3| v.as_vec3().to_array();
        let voxel_from_mm = self.volume.voxel_from_mm();
        let (normal, offset) = self.volume.index_plane();
        let [table_scale, table_offset] = self.volume.table().scale_offset();
        Optical {
            corner: single(self.volume.index_of(sight.eye_mm + sight.forward * front_mm)),
            pixel_mm: sight.pixel_mm(front_mm) as f32,
            right: single(voxel_from_mm * sight.right),
            pixel_mm_per_mm: sight.growth() as f32,
            up: single(voxel_from_mm * sight.up),
            table_scale,
            forward: single(voxel_from_mm * sight.forward),
            table_offset,
            plane: normal.extend(offset).as_vec4().to_array(),
            dims: self.volume.grid().dims().map(|d| d as u32),
            table_last: self.volume.table().entries().len() as u32 - 1,
            bricks: self.occupied.dims.map(|d| d as u32),
            nearest: u32::from(self.volume.filter() == Filter::Nearest),
            size: sight.size,
            skipping: u32::from(skipping),
            pad: 0,
        }
    }
}

/// Refuses a picture without pixels or past the device's buffers at 16 bytes a pixel.
pub(crate) fn check_size(gpu: &Gpu, size: [u32; 2]) -> Result<(), RenderError> {
    let limits = gpu.device.limits();
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    let side = limits.max_texture_dimension_2d;
    let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    if pixels == 0 || size[0] > side || size[1] > side || pixels * 16 > bytes {
        return Err(RenderError::Size { found: size, side, pixels: bytes / 16 });
    }
    Ok(())
}

/// A compute pipeline of entry point `main` of a shader file, with one bind group of `entries`.
pub(crate) fn pipeline(
    gpu: &Gpu,
    name: &'static str,
    layout: &wgpu::BindGroupLayout,
    constants: &[(&str, f64)],
) -> Result<wgpu::ComputePipeline, RenderError> {
    let source = glioscope_shaders::compose(name)?;
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(name),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    Ok(gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(name),
        layout: Some(&layout),
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants,
            zero_initialize_workgroup_memory: false,
        },
        cache: None,
    }))
}

/// What a binding is, for [`layout`].
#[derive(Clone, Copy)]
pub(crate) enum Kind {
    Uniform,
    /// A uniform at an offset given with each dispatch, of so many bytes.
    Moving(u64),
    Read,
    Write,
}

/// Bindings 0, 1, … of these kinds.
pub(crate) fn layout(gpu: &Gpu, label: &'static str, kinds: &[Kind]) -> wgpu::BindGroupLayout {
    let numbered: Vec<(u32, Kind)> = (0u32..).zip(kinds.iter().copied()).collect();
    layout_of(gpu, label, &numbered)
}

/// Bindings of these numbers and kinds.
pub(crate) fn layout_of(gpu: &Gpu, label: &'static str, kinds: &[(u32, Kind)]) -> wgpu::BindGroupLayout {
    let entries: Vec<wgpu::BindGroupLayoutEntry> = kinds
        .iter()
        .map(|(binding, kind)| wgpu::BindGroupLayoutEntry {
            binding: *binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match kind {
                    Kind::Uniform | Kind::Moving(_) => wgpu::BufferBindingType::Uniform,
                    Kind::Read => wgpu::BufferBindingType::Storage { read_only: true },
                    Kind::Write => wgpu::BufferBindingType::Storage { read_only: false },
                },
                has_dynamic_offset: matches!(kind, Kind::Moving(_)),
                min_binding_size: match kind {
                    Kind::Moving(size) => wgpu::BufferSize::new(*size),
                    _ => None,
                },
            },
            count: None,
        })
        .collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}
