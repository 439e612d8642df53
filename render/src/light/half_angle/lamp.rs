//! Light of a lamp far away on opaque geometry: a ray for each pixel, past the masks' voxels and through the image. Shared by the
//! modes that have a lamp.

use glam::DVec3;

use super::uniforms::Lamp;
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        runner::{PassRunner, Shader, workgroups_of},
    },
    light::lit::LitScene,
    scene::Plan,
};

/// The lamp's light on opaque geometry, past the masks.
pub(crate) const LAMP: PassName = PassName::new("lamp");
/// What the context image transmits of it.
pub(crate) const LAMP_THROUGH_IMAGE: PassName = PassName::new("lamp_through_image");

/// Its passes on the device.
pub(crate) struct LampLight {
    uniform: wgpu::Buffer,
    /// For views without bricks.
    placeholder: wgpu::Buffer,
}

impl LampLight {
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            uniform: gpu.uniform::<Lamp>("LampLight::uniform"),
            placeholder: gpu.buffer("LampLight::placeholder", 16, WRITTEN),
        }
    }

    /// The uniform, as `Lamp` of half_angle/lamp.
    pub fn uniform(&self) -> &wgpu::Buffer {
        &self.uniform
    }

    /// Fills the uniform: direction that light travels in, camera space, and a step through the image. For this frame's passes,
    /// as [`LampLight::bind`] does.
    pub fn write(&self, gpu: &Gpu, light: DVec3, step_mm: f64) {
        let lamp = Lamp { light: light.as_vec3().to_array(), step_mm: step_mm as f32 };
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&lamp));
    }

    /// Binds the passes of opaque geometry that are in `plan`.
    ///
    /// # Errors
    /// [`RenderError::Shader`].
    pub fn bind(
        &self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
        (light, step_mm): (DVec3, f64),
    ) -> Result<(), RenderError> {
        if !plan.has(LAMP) {
            return Ok(());
        }
        self.write(gpu, light, step_mm);
        let flag = |on: bool| f64::from(u8::from(on));
        let [bricks, words] = scene.bricks.unwrap_or([&self.placeholder; 2]);
        let both = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (7, scene.occlusion.as_entire_binding()),
            (8, scene.blurred.as_entire_binding()),
            (36, self.uniform.as_entire_binding()),
        ];
        let of_masks = [
            (1, bricks.as_entire_binding()),
            (2, words.as_entire_binding()),
            (3, scene.colors.as_entire_binding()),
            (40, scene.normals.as_entire_binding()),
        ];
        let constants = [
            ("stored_normals", flag(scene.has_normals)),
            ("stepped", flag(scene.bricks.is_some())),
            ("past_masks", flag(scene.bricks.is_some())),
        ];
        let shader = Shader { file: "half_angle/lamp", constants: &constants };
        let workgroups = workgroups_of(scene.size);
        passes.bind(gpu, LAMP, shader, &[&both[..], &of_masks].concat(), workgroups)?;
        let Some(image) = scene.image.filter(|_| plan.has(LAMP_THROUGH_IMAGE)) else { return Ok(()) };
        let constants = image.buffers.tables().dimensions.constants();
        let shader = Shader { file: "half_angle/lamp_through_image", constants: &constants };
        passes.bind(gpu, LAMP_THROUGH_IMAGE, shader, &[&both[..], &image.entries()].concat(), workgroups)
    }
}
