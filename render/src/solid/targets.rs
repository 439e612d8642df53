//! Render targets of a 3D view's passes: created once per size.

use crate::device::{Gpu, RenderError, buffers::WRITTEN};

/// Buffers of one frame size, row after row; and the colour texture.
#[derive(Clone, Debug)]
pub(crate) struct Targets {
    pub size: [u32; 2],
    pub depths: wgpu::Buffer,
    pub surfaces: wgpu::Buffer,
    /// See lib/normal.
    pub normals: wgpu::Buffer,
    pub outsides: wgpu::Buffer,
    pub occlusion: wgpu::Buffer,
    pub blurred: wgpu::Buffer,
    pub color: wgpu::Texture,
}

/// Bytes per pixel of the largest buffer.
const LARGEST: u64 = 16;

impl Targets {
    /// # Errors
    /// [`RenderError::Size`] for an empty frame, or one past the device's limits.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, RenderError> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let side = gpu.device.limits().max_texture_dimension_2d;
        let bytes = gpu.storage_limit();
        if pixels == 0 || size[0] > side || size[1] > side || pixels * LARGEST > bytes {
            return Err(RenderError::Size { found: size, side, pixels: bytes / LARGEST });
        }
        let buffer = |label, bytes_per_pixel| gpu.buffer(label, pixels * bytes_per_pixel, WRITTEN);
        Ok(Self {
            size,
            depths: buffer("Targets::depths", 4),
            surfaces: buffer("Targets::surfaces", 8),
            normals: buffer("Targets::normals", 4),
            outsides: buffer("Targets::outsides", LARGEST),
            occlusion: buffer("Targets::occlusion", 4),
            blurred: buffer("Targets::blurred", 4),
            color: gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("Targets::color"),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage: wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            }),
        })
    }
}
