//! Targets of the change view's own passes: created once per size.

use crate::device::{Gpu, RenderError, buffers::WRITTEN};

/// Buffers of one frame size, row-major.
#[derive(Clone, Debug)]
pub(super) struct ChangeTargets {
    /// Number of the first hit's voxel.
    pub cells: wgpu::Buffer,
    /// Length and confidence.
    pub heights: wgpu::Buffer,
    pub across: wgpu::Buffer,
    pub filtered: wgpu::Buffer,
    pub hull_depths: wgpu::Buffer,
    pub hull_surfaces: wgpu::Buffer,
    /// First hits of the earlier date, where its outline is drawn: depths, region numbers and faces.
    pub earlier: Option<[wgpu::Buffer; 2]>,
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
            earlier: None,
            tops: buffer("ChangeTargets::tops", 8),
        }
    }

    /// Creates the targets of the earlier date, or drops them.
    pub fn keep_earlier(&mut self, gpu: &Gpu, size: [u32; 2], is_drawn: bool) {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let buffer = |label, bytes_per_pixel| gpu.buffer(label, pixels * bytes_per_pixel, WRITTEN);
        let made =
            || [buffer("ChangeTargets::earlier_depths", 4), buffer("ChangeTargets::earlier_surfaces", 8)];
        self.earlier = is_drawn.then(|| self.earlier.take().unwrap_or_else(made));
    }
}

/// Opaque geometry with merged arrows, if light passes need it.
#[derive(Clone, Debug)]
pub(super) struct OpaqueTargets {
    size: [u32; 2],
    /// Depths of all pixels, then those at which rays through the image end.
    pub depths: wgpu::Buffer,
    /// Region number and face, or which arrow.
    pub faces: wgpu::Buffer,
}

impl OpaqueTargets {
    /// The cached targets if they have `size`, else new ones; none if `size` is `None`.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn reuse(
        cached: &mut Option<Self>,
        gpu: &Gpu,
        size: Option<[u32; 2]>,
    ) -> Result<Option<Self>, RenderError> {
        let reusable = cached.take();
        let Some(size) = size else { return Ok(None) };
        let made = match reusable.filter(|targets| targets.size == size) {
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
        Ok(Some(cached.insert(made).clone()))
    }
}
