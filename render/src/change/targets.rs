//! What the change view's own passes write: made once a size.

use crate::{gpu::Gpu, renderer::RenderError};

/// Buffers of one picture size, row after row.
#[derive(Clone, Debug)]
pub(super) struct ChangeTargets {
    /// Number of the first hit's voxel.
    pub cells: wgpu::Buffer,
    /// Length and sureness.
    pub heights: wgpu::Buffer,
    pub across: wgpu::Buffer,
    pub filtered: wgpu::Buffer,
    pub hull_depths: wgpu::Buffer,
    pub hull_surfaces: wgpu::Buffer,
    /// Number of the arrow in front, from 1, and its depth.
    pub tops: wgpu::Buffer,
}

impl ChangeTargets {
    /// Of a size that `Targets` took.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let buffer = |label, bytes_per_pixel| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: pixels * bytes_per_pixel,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        Self {
            cells: buffer("ChangeTargets::cells", 4),
            heights: buffer("ChangeTargets::heights", 8),
            across: buffer("ChangeTargets::across", 8),
            filtered: buffer("ChangeTargets::filtered", 8),
            hull_depths: buffer("ChangeTargets::hull_depths", 4),
            hull_surfaces: buffer("ChangeTargets::hull_surfaces", 8),
            tops: buffer("ChangeTargets::tops", 8),
        }
    }
}

/// What is solid with arrows among it, where passes of light ask for that.
#[derive(Clone, Debug)]
pub(super) struct SolidTargets {
    size: [u32; 2],
    /// Depths of all pixels, then those at which rays through the image end.
    pub depths: wgpu::Buffer,
    /// Region number and face, or which arrow.
    pub faces: wgpu::Buffer,
}

impl SolidTargets {
    /// Those held, when they are of `size` (`None`: not asked for), else new ones.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn keep(
        held: &mut Option<Self>,
        gpu: &Gpu,
        size: Option<[u32; 2]>,
    ) -> Result<Option<Self>, RenderError> {
        let kept = held.take();
        let Some(size) = size else { return Ok(None) };
        let made = match kept.filter(|h| h.size == size) {
            Some(targets) => targets,
            None => {
                let pixels = u64::from(size[0]) * u64::from(size[1]);
                let buffer = |label| {
                    gpu.device.create_buffer(&wgpu::BufferDescriptor {
                        label: Some(label),
                        size: 8 * pixels,
                        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                        mapped_at_creation: false,
                    })
                };
                let made = Self {
                    size,
                    depths: buffer("SolidTargets::depths"),
                    faces: buffer("SolidTargets::faces"),
                };
                gpu.check().map_err(RenderError::Device)?;
                made
            }
        };
        Ok(Some(held.insert(made).clone()))
    }
}
