//! What the change view's own passes write: made once per size.

use crate::device::{Gpu, RenderError, buffers::WRITTEN};

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
    /// Of a size that `Targets` accepted.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let buffer = |label, bytes_per_pixel| gpu.buffer(label, pixels * bytes_per_pixel, WRITTEN);
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

/// Opaque geometry with arrows among it, where passes of light ask for that.
#[derive(Clone, Debug)]
pub(super) struct OpaqueTargets {
    size: [u32; 2],
    /// Depths of all pixels, then those at which rays through the image end.
    pub depths: wgpu::Buffer,
    /// Region number and face, or which arrow.
    pub faces: wgpu::Buffer,
}

impl OpaqueTargets {
    /// Those held, when they are of `size` (`None`: not asked for), else new ones.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn reuse(
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
                let buffer = |label| gpu.buffer(label, 8 * pixels, WRITTEN);
                let made = Self {
                    size,
                    depths: buffer("OpaqueTargets::depths"),
                    faces: buffer("OpaqueTargets::faces"),
                };
                gpu.check()?;
                made
            }
        };
        Ok(Some(held.insert(made).clone()))
    }
}
