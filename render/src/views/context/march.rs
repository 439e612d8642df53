//! The image of a view and its ray march: shared by the views that show anatomy.

use super::ContextScene;
use crate::{
    device::{Gpu, RenderError, runner::Shader},
    image::{CONTEXT, GRADIENT_OPACITY, ImageLook, buffers::ImageBuffers, uniforms},
    light::{self, LIGHTS, lit::LitImage},
    scene::Plan,
    views::view3d::Draw,
};

/// Whether the plan shows the image, whichever pass draws it.
pub(crate) fn shows_image(plan: &Plan) -> bool {
    plan.has(CONTEXT) || LIGHTS.iter().filter_map(|row| row.image_pass).any(|pass| plan.has(pass))
}

/// The image on the device and its uniform.
pub(crate) struct ImagePart {
    image: Option<ImageBuffers>,
    context: wgpu::Buffer,
}

impl ImagePart {
    /// Without an image.
    pub fn new(gpu: &Gpu) -> Self {
        Self { image: None, context: gpu.uniform::<uniforms::Context>("ImagePart::context") }
    }

    /// Uploads the scene's image if the plan shows it. Returns a warning if it is drawn at a lower resolution.
    ///
    /// # Errors
    /// [`RenderError::Volume`] for an image that doesn't fit at an eighth of its resolution.
    pub fn prepare(&mut self, draw: &Draw<'_>, scene: &ContextScene) -> Result<Option<String>, RenderError> {
        let Some(volume) = scene.volume.as_ref().filter(|_| shows_image(draw.plan)) else { return Ok(None) };
        let image = ImageBuffers::reuse(&mut self.image, draw.gpu, volume, &scene.transfer)?;
        let look = ImageLook {
            clip: &scene.clip,
            camera: &scene.camera,
            reference_mm: scene.reference_mm(),
            step_mm: draw.quality.context_step_mm,
            by_gradient: draw.plan.has(GRADIENT_OPACITY),
            jitter: draw.switches.jitter,
            shade: light::shade(draw.quality, &scene.camera),
        };
        draw.gpu.queue.write_buffer(&self.context, 0, bytemuck::bytes_of(&image.uniform(&look)));
        Ok(image.warning())
    }

    /// The image for the light passes, if the plan shows it.
    pub fn lit<'a>(&'a self, scene: &'a ContextScene, plan: &Plan) -> Option<LitImage<'a>> {
        let (buffers, volume) =
            self.image.as_ref().zip(scene.volume.as_ref()).filter(|_| shows_image(plan))?;
        Some(LitImage {
            buffers,
            volume,
            transfer: &scene.transfer,
            clip: &scene.clip,
            context: &self.context,
        })
    }
}

/// Binds the ray march through the image, lit by the light passes bound before, if the plan has it.
///
/// # Errors
/// [`RenderError::Shader`] for a shader file that doesn't compose.
pub(crate) fn bind_march(draw: &mut Draw<'_>, image: Option<&LitImage<'_>>) -> Result<(), RenderError> {
    let Some(image) = image.filter(|_| draw.plan.has(CONTEXT)) else { return Ok(()) };
    let entries = [
        (0, draw.view.as_entire_binding()),
        (4, draw.targets.depths.as_entire_binding()),
        (6, draw.targets.outsides.as_entire_binding()),
    ];
    let mut entries = [&entries[..], &image.entries()].concat();
    let constants = image.buffers.tables().dimensions.constants();
    let mut file = "context/march";
    if let Some(lit) = draw.lights.lit_march() {
        entries.extend(lit.entries);
        file = lit.shader;
    }
    let shader = Shader { file, constants: &constants };
    let workgroups = draw.workgroups();
    draw.passes.bind(draw.gpu, CONTEXT, shader, &entries, workgroups)
}
