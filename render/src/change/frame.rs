//! A drawn change view, and what is under each pixel.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::change::SurfaceChange;

use super::{surface::ChangeSurface, targets::ChangeTargets};
use crate::{
    camera::Camera,
    frame::{drawn_pixel, read_rgba, world_at},
    gpu::Gpu,
    plan::{PassName, Plan},
    renderer::RenderError,
    targets::Targets,
    uniforms::FAR,
};

/// What is under a pixel: an arrow, or a voxel of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangePick {
    /// The voxel on the case grid: the surface's, or that which the arrow belongs to.
    pub voxel: [usize; 3],
    /// The point that the pixel shows, RAS+ millimetres: on the voxel's face, or on the arrow.
    pub world_mm: DVec3,
    /// Its change as it was found: no filter, no rounding. `None` where the surface did not move, or
    /// has no partner.
    pub vector: Option<SurfaceChange>,
    /// Whether the surface is that of a component without a counterpart, and if so whether it
    /// appeared; else it vanished.
    pub unpartnered: Option<bool>,
}

/// A finished picture. Its textures are reused by the next picture of the same size.
#[derive(Clone, Debug)]
pub struct ChangeFrame {
    /// rgba8unorm, gamma-encoded sRGB, opaque. Usable as an egui texture.
    pub color: wgpu::Texture,
    /// Pixels drawn: the size of `color`. At most `asked_px`, see `Quality::resolution_scale`.
    pub size_px: [u32; 2],
    /// Pixels asked for: what [`ChangeFrame::pick`] counts in.
    pub asked_px: [u32; 2],
    /// What ran, and what was left out.
    pub plan: Plan,
    /// What the picture shows less of than the scene has, in words for the user.
    pub warning: Option<String>,
    /// Arrows drawn; 0 as a height map.
    pub arrows: usize,
    pub(super) targets: Targets,
    pub(super) own: ChangeTargets,
    pub(super) surface: Option<Arc<ChangeSurface>>,
    /// Which vector each arrow is.
    pub(super) vectors: Arc<Vec<u32>>,
    pub(super) camera: Camera,
    pub(super) reference_mm: f64,
}

impl ChangeFrame {
    /// All pixels, row after row from the top, 4 bytes each: `size_px[0] * size_px[1] * 4` bytes.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn read_rgba(&self, gpu: &Gpu) -> Result<Vec<u8>, RenderError> {
        read_rgba(gpu, &self.color)
    }

    /// What is under pixel (`x`, `y`) of the asked size, counted from the top left: the arrow in front
    /// (where it covers at least a quarter of the pixel), else the solid surface; the veil is looked
    /// through. `None` over the background and the context image, and past the edge. Reads a few bytes
    /// back: call it as often as the mouse moves.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn pick(&self, gpu: &Gpu, x: u32, y: u32) -> Result<Option<ChangePick>, RenderError> {
        let inside = x < self.asked_px[0] && y < self.asked_px[1];
        let Some(surface) = self.surface.as_ref().filter(|_| inside) else { return Ok(None) };
        let pixel = drawn_pixel([x, y], self.asked_px, self.size_px);
        let at = u64::from(pixel[1]) * u64::from(self.size_px[0]) + u64::from(pixel[0]);
        let read = gpu
            .read_buffers(&[
                (&self.own.tops, at * 8, 8),
                (&self.targets.depths, at * 4, 4),
                (&self.own.cells, at * 4, 4),
            ])
            .map_err(RenderError::Device)?;
        let [top, depth, cell] = read.as_slice() else { return Ok(None) };
        let world = |depth: f32| world_at(&self.camera, self.reference_mm, self.size_px, pixel, depth);
        let [number, arrow_depth]: [u32; 2] = bytemuck::pod_read_unaligned(top);
        let vector = (number as usize).checked_sub(1).and_then(|i| self.vectors.get(i));
        if let Some(vector) = vector.and_then(|&i| surface.change().vectors.get(i as usize)) {
            return Ok(Some(ChangePick {
                voxel: vector.voxel,
                world_mm: world(f32::from_bits(arrow_depth)),
                vector: Some(*vector),
                unpartnered: None,
            }));
        }
        let depth: f32 = bytemuck::pod_read_unaligned(depth);
        // NaN is no depth.
        if !self.plan.has(PassName::Surface) || depth.is_nan() || depth >= FAR {
            return Ok(None);
        }
        let cell: u32 = bytemuck::pod_read_unaligned(cell);
        let voxel = surface.voxel(cell as usize);
        Ok(Some(ChangePick {
            voxel,
            world_mm: world(depth),
            vector: surface.vector(voxel).copied(),
            unpartnered: surface.unpartnered(voxel).map(|u| u.appeared),
        }))
    }
}
