//! A drawn diagram, and what is under each pixel.

use glam::DVec3;

use crate::{
    ellipsoids::{DrawnEllipsoid, EllipsoidScene, bins::in_lens},
    frame::{drawn_pixel, read_rgba, world_at},
    gpu::Gpu,
    plan::{PassName, Plan},
    renderer::RenderError,
    targets::Targets,
    uniforms::FAR,
};

/// What is under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EllipsoidPick {
    /// The nearest ellipsoid's id.
    pub id: u32,
    /// The point on its surface, RAS+ millimetres.
    pub world_mm: DVec3,
    /// Whether that point is in the lens; always, when the lens is off.
    pub inside_lens: bool,
}

/// A finished diagram. Its textures are reused by the next one of the same size.
#[derive(Clone, Debug)]
pub struct EllipsoidFrame {
    /// rgba8unorm, gamma-encoded sRGB, opaque. Usable as an egui texture.
    pub color: wgpu::Texture,
    /// Pixels drawn: the size of `color`. At most `asked_px`, see `Quality::resolution_scale`.
    pub size_px: [u32; 2],
    /// Pixels asked for: what [`EllipsoidFrame::pick`] counts in.
    pub asked_px: [u32; 2],
    /// What ran, and what was left out.
    pub plan: Plan,
    pub(super) targets: Targets,
    pub(super) scene: EllipsoidScene,
    pub(super) drawn: Vec<DrawnEllipsoid>,
    pub(super) reference_mm: f64,
    #[cfg(test)]
    pub(super) nodes: wgpu::Buffer,
}

impl EllipsoidFrame {
    /// All pixels, row after row from the top, 4 bytes each: `size_px[0] * size_px[1] * 4` bytes.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn read_rgba(&self, gpu: &Gpu) -> Result<Vec<u8>, RenderError> {
        read_rgba(gpu, &self.color)
    }

    /// The nearest ellipsoid under pixel (`x`, `y`) of the asked size, counted from the top left.
    /// `None` over the background and past the edge; a slice hides nothing from it. Reads a few bytes
    /// back: call it as often as the mouse moves.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn pick(&self, gpu: &Gpu, x: u32, y: u32) -> Result<Option<EllipsoidPick>, RenderError> {
        let inside = x < self.asked_px[0] && y < self.asked_px[1];
        if !inside || !self.plan.has(PassName::EllipsoidLists) {
            return Ok(None);
        }
        let pixel = drawn_pixel([x, y], self.asked_px, self.size_px);
        let at = u64::from(pixel[1]) * u64::from(self.size_px[0]) + u64::from(pixel[0]);
        let read = gpu
            .read_buffers(&[(&self.targets.depths, at * 4, 4), (&self.targets.surfaces, at * 8, 4)])
            .map_err(RenderError::Device)?;
        let [depth, number] = read.as_slice() else { return Ok(None) };
        let depth: f32 = bytemuck::pod_read_unaligned(depth);
        let number: u32 = bytemuck::pod_read_unaligned(number);
        let Some(ellipsoid) = self.drawn.get(number as usize).filter(|_| depth < FAR) else {
            return Ok(None);
        };
        let world_mm = world_at(&self.scene.camera, self.reference_mm, self.size_px, pixel, depth);
        Ok(Some(EllipsoidPick { id: ellipsoid.id, world_mm, inside_lens: in_lens(&self.scene, world_mm) }))
    }
}
