//! Light on opaque geometry: vicinity occlusion, times what slices let through. A part of the lights that go by
//! slices and cones.

#[cfg(test)]
pub(crate) mod twin;
#[cfg(test)]
mod twin_tests;
pub(crate) mod uniforms;

use glioscope_core::optics::{cone::clamped_aperture, poisson::poisson_disc};

use super::lit::{LitScene, is_none, no_strength};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        runner::{PassRunner, workgroups_of},
    },
    scene::{LightSettings, Quality, SliceVariant},
};

/// Light that reaches opaque geometry, by vicinity occlusion and what slices let through.
pub(crate) const VICINITY: PassName = PassName::new("vicinity");

/// Why the pass is left out, see [`super::left_out`].
pub(crate) fn left_out(
    quality: &Quality,
    no_opaque: Option<&'static str>,
    no_image: Option<&'static str>,
) -> Option<&'static str> {
    let light = &quality.lighting;
    let lit = light.mutual.image_on_opaque && no_image.is_none();
    let none = !light.mutual.opaque_on_opaque || is_none(radius_mm(light));
    no_opaque.or(no_strength(quality)).or((none && !lit).then_some("nothing darkens what is solid"))
}

/// How far vicinity occlusion reaches.
pub(crate) fn radius_mm(settings: &LightSettings) -> f64 {
    let (aperture, _) = clamped_aperture(settings.aperture_deg);
    let reach = settings.vicinity_mm * aperture.to_radians().tan();
    if reach.is_finite() { reach.clamp(0.0, 1e6) } else { 0.0 }
}

/// Its uniform, and what is bound where no slices ran.
pub(crate) struct VicinityLight {
    uniform: wgpu::Buffer,
    no_notes: wgpu::Buffer,
    /// Points in the unit disc for a count.
    points: Option<(u32, Vec<[f64; 2]>)>,
}

impl VicinityLight {
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            uniform: gpu.uniform::<uniforms::Vicinity>("VicinityLight::uniform"),
            no_notes: gpu.buffer("VicinityLight::no_notes", 16, WRITTEN),
            points: None,
        }
    }

    /// Binds the pass; `through` are the slices' notes where they ran.
    ///
    /// # Errors
    /// [`RenderError`] when the driver refuses the shader.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        through: Option<&wgpu::Buffer>,
    ) -> Result<(), RenderError> {
        self.write(gpu, &scene.quality.lighting, through.is_some());
        let entries = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (8, scene.blurred.as_entire_binding()),
            (35, through.unwrap_or(&self.no_notes).as_entire_binding()),
            (36, self.uniform.as_entire_binding()),
        ];
        passes.bind(gpu, VICINITY, "vicinity/opaque", &entries, workgroups_of(scene.size))
    }

    /// Its uniform, for passes that find vicinity occlusion besides.
    pub fn uniform(&self) -> &wgpu::Buffer {
        &self.uniform
    }

    /// Writes the uniform; `sliced` where slices ran.
    pub fn write(&mut self, gpu: &Gpu, settings: &LightSettings, sliced: bool) {
        let data = self.data(settings, sliced);
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&data));
    }

    fn data(&mut self, settings: &LightSettings, sliced: bool) -> uniforms::Vicinity {
        let count = settings.vicinity_samples.clamp(1, LightSettings::MOST_VICINITY);
        if self.points.as_ref().is_none_or(|(n, _)| *n != count) {
            self.points = Some((count, poisson_disc(count)));
        }
        let mut points = [[0.0; 4]; LightSettings::MOST_VICINITY as usize];
        for (to, from) in points.iter_mut().zip(self.points.iter().flat_map(|(_, p)| p)) {
            *to = [from[0] as f32, from[1] as f32, 0.0, 0.0];
        }
        let mut flags = 0;
        if settings.mutual.opaque_on_opaque && radius_mm(settings) > 0.0 {
            flags |= uniforms::VICINITY;
        }
        if settings.mutual.image_on_opaque && sliced {
            flags |= uniforms::PARTIAL;
        }
        uniforms::Vicinity {
            radius_mm: radius_mm(settings) as f32,
            slope: slope(settings),
            count,
            flags,
            points,
        }
    }
}

/// Millimetres nearer to the eye a millimetre aside from which on a neighbour is in the cone. The
/// paper's own form has none: there a plane seen at a slant hides half of itself.
pub(crate) fn slope(settings: &LightSettings) -> f32 {
    let (aperture, _) = clamped_aperture(settings.aperture_deg);
    match settings.variant {
        SliceVariant::Mended => (1.0 / aperture.to_radians().tan()).min(1e6) as f32,
        _ => 0.0,
    }
}
