//! A drawn context view, and what is under each pixel.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::RegionVolume;

use super::{renderer::shows_image, uniforms::Marched};
use crate::{
    camera::Camera,
    frame::{drawn_pixel, read_rgba, world_at},
    gpu::Gpu,
    plan::{PassName, Plan},
    renderer::RenderError,
    targets::Targets,
    tubes::{DrawnTubes, buffers::fiber_number, fiber_of},
    uniforms::FAR,
};

/// What is under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContextPick {
    /// The point that the pixel shows, RAS+ millimetres: on the voxel's face for the tumour; for the
    /// image where half of what lies behind is hidden, to a step of the ray.
    pub world_mm: DVec3,
    /// Index bits of the tumour's region; `None` for anything else.
    pub bits: Option<u32>,
    /// The fibre of a tract; `None` for anything else. Neither: tissue of the context image.
    pub fiber: Option<PickedFiber>,
}

/// A fibre of a tract.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PickedFiber {
    /// Which of the scene's sets of tubes.
    pub set: usize,
    /// Its number in that set's file, from 0.
    pub fiber: usize,
}

/// A finished picture. Its textures are reused by the next picture of the same size.
#[derive(Clone, Debug)]
pub struct ContextFrame {
    /// rgba8unorm, gamma-encoded sRGB, opaque. Usable as an egui texture.
    pub color: wgpu::Texture,
    /// Pixels drawn: the size of `color`. At most `asked_px`, see `Quality::resolution_scale`.
    pub size_px: [u32; 2],
    /// Pixels asked for: what [`ContextFrame::pick`] counts in.
    pub asked_px: [u32; 2],
    /// What ran, and what was left out.
    pub plan: Plan,
    /// What the picture shows less of than the scene has, in words for the user.
    pub warning: Option<String>,
    /// What of the light is other than asked for, in words.
    pub notes: Vec<String>,
    pub(super) targets: Targets,
    pub(super) tumor: Option<Arc<RegionVolume>>,
    pub(super) tubes: Vec<DrawnTubes>,
    pub(super) camera: Camera,
    pub(super) reference_mm: f64,
}

impl ContextFrame {
    /// All pixels, row after row from the top, 4 bytes each: `size_px[0] * size_px[1] * 4` bytes.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn read_rgba(&self, gpu: &Gpu) -> Result<Vec<u8>, RenderError> {
        read_rgba(gpu, &self.color)
    }

    /// What is under pixel (`x`, `y`) of the asked size, counted from the top left. `None` over the
    /// background, where the image hides less than half of it, and past the edge. Reads a few bytes
    /// back: call it as often as the mouse moves.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn pick(&self, gpu: &Gpu, x: u32, y: u32) -> Result<Option<ContextPick>, RenderError> {
        if x >= self.asked_px[0] || y >= self.asked_px[1] {
            return Ok(None);
        }
        let pixel = drawn_pixel([x, y], self.asked_px, self.size_px);
        let at = u64::from(pixel[1]) * u64::from(self.size_px[0]) + u64::from(pixel[0]);
        let has_geometry = self.plan.has(PassName::Surface) || self.plan.has(PassName::TubesMerge);
        let mut parts = Vec::new();
        if has_geometry {
            parts.push((&self.targets.depths, at * 4, 4));
            parts.push((&self.targets.surfaces, at * 8, 8));
        }
        if shows_image(&self.plan) {
            parts.push((&self.targets.outsides, at * 16, 16));
        }
        if parts.is_empty() {
            return Ok(None);
        }
        let read = gpu.read_buffers(&parts).map_err(RenderError::Device)?;
        let mut read = read.iter();
        let found = |depth: f32, bits, fiber| {
            let world_mm = world_at(&self.camera, self.reference_mm, self.size_px, pixel, depth);
            ContextPick { world_mm, bits, fiber }
        };
        let mut geometry = None;
        if has_geometry && let (Some(depth), Some(surface)) = (read.next(), read.next()) {
            let depth: f32 = bytemuck::pod_read_unaligned(depth);
            let surface: [u32; 2] = bytemuck::pod_read_unaligned(surface);
            geometry = (depth < FAR).then_some((depth, surface));
        }
        // What hides more than half of what is behind it is what is seen. The march ends at the
        // tumour and at tubes.
        if let Some(marched) = read.next() {
            let marched: Marched = bytemuck::pod_read_unaligned(marched);
            if marched.depth < FAR {
                return Ok(Some(found(marched.depth, None, None)));
            }
        }
        let Some((depth, [number, face])) = geometry else { return Ok(None) };
        if let Some(fiber) = fiber_number(face) {
            let fiber = fiber_of(&self.tubes, fiber).map(|(set, fiber)| PickedFiber { set, fiber });
            return Ok(fiber.map(|fiber| found(depth, None, Some(fiber))));
        }
        let bits = self.tumor.as_ref().and_then(|t| t.bits_of_id().get(number as usize));
        Ok(bits.map(|&bits| found(depth, Some(bits), None)))
    }

    #[cfg(test)]
    pub(crate) fn read_marched(&self, gpu: &Gpu) -> Vec<Marched> {
        self.marched(gpu).unwrap()
    }

    /// What the march left for each pixel: premultiplied colour, opacity, depth.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub(crate) fn marched(&self, gpu: &Gpu) -> Result<Vec<Marched>, RenderError> {
        let n = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        let read = gpu.read_buffers(&[(&self.targets.outsides, 0, n * 16)]).map_err(RenderError::Device)?;
        Ok(read.first().map(|bytes| bytemuck::pod_collect_to_vec(bytes)).unwrap_or_default())
    }

    #[cfg(test)]
    pub(crate) fn read_blurred(&self, gpu: &Gpu) -> Vec<u32> {
        let buffer = &self.targets.blurred;
        bytemuck::pod_collect_to_vec(&gpu.read_buffers(&[(buffer, 0, buffer.size())]).unwrap()[0])
    }

    /// What is seen first at each pixel: region number (0 for a tube) and face, or fibre.
    #[cfg(test)]
    pub(crate) fn read_surfaces(&self, gpu: &Gpu) -> Vec<[u32; 2]> {
        let n = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        bytemuck::pod_collect_to_vec(&gpu.read_buffers(&[(&self.targets.surfaces, 0, n * 8)]).unwrap()[0])
    }

    /// Depths of the tumour's surface and of tubes, [`FAR`] where there is none.
    #[cfg(test)]
    pub(crate) fn read_depths(&self, gpu: &Gpu) -> Vec<f32> {
        let n = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        bytemuck::pod_collect_to_vec(&gpu.read_buffers(&[(&self.targets.depths, 0, n * 4)]).unwrap()[0])
    }
}
