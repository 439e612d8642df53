//! Light on opaque geometry: vicinity occlusion, times the light that slices transmit. Used by the modes slices and
//! cones.

#[cfg(test)]
pub(crate) mod twin;
#[cfg(test)]
mod twin_tests;
pub(crate) mod uniforms;

use glioscope_core::optics::{cone::clamped_aperture, poisson::poisson_disc};

use super::{
    layers::{LayerLight, no_lamp_shadow},
    lit::{LitScene, is_off, no_strength},
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        runner::{PassRunner, workgroups_of},
    },
    scene::{LightSettings, Quality, SliceVariant},
    solid::view::FAR,
};

/// Light that reaches opaque geometry: vicinity occlusion, times the light that slices transmit.
pub(crate) const VICINITY: PassName = PassName::new("vicinity");

/// Light past tubes and arrows, for modes that trace the masks.
pub(crate) const TUBE_SHADOWS: PassName = PassName::new("tube_shadows");

/// Why [`TUBE_SHADOWS`] is omitted where there are tubes or arrows.
pub(crate) fn no_tube_shadows(quality: &Quality, no_opaque: Option<&'static str>) -> Option<&'static str> {
    let light = &quality.lighting;
    let by_vicinity = light.mutual.opaque_on_opaque && !is_off(radius_mm(light));
    no_opaque
        .or(no_strength(quality))
        .or(no_lamp_shadow(light))
        .or((!by_vicinity).then_some("nothing darkens opaque surfaces"))
}

/// Why [`VICINITY`] is omitted, see [`super::omission_reason`].
pub(crate) fn omission_reason(
    quality: &Quality,
    no_opaque: Option<&'static str>,
    no_image: Option<&'static str>,
) -> Option<&'static str> {
    let light = &quality.lighting;
    let by_image = light.mutual.image_on_opaque && no_image.is_none();
    let by_vicinity = light.mutual.opaque_on_opaque && !is_off(radius_mm(light));
    no_opaque
        .or(no_strength(quality))
        .or((!by_vicinity && !by_image).then_some("nothing darkens opaque surfaces"))
}

/// Radius of vicinity occlusion, 0 to 1e6; 0 if not finite.
pub(crate) fn radius_mm(settings: &LightSettings) -> f64 {
    let (aperture, _) = clamped_aperture(settings.aperture_deg);
    let reach = settings.vicinity_mm * aperture.to_radians().tan();
    if reach.is_finite() { reach.clamp(0.0, 1e6) } else { 0.0 }
}

/// The uniform of the pass, and a placeholder for the slices' notes.
pub(crate) struct VicinityLight {
    uniform: wgpu::Buffer,
    no_notes: wgpu::Buffer,
    /// The number of samples, and as many points in the unit disc.
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

    /// Binds the pass; `notes` are the slices' notes if they ran, `layers` the layers and how far behind a surface
    /// their shadows begin, if they were computed.
    ///
    /// # Errors
    /// [`RenderError`] if the driver rejects the shader.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        notes: Option<&wgpu::Buffer>,
        (layers, lag_mm): (&LayerLight, Option<f64>),
    ) -> Result<(), RenderError> {
        self.write(gpu, &scene.quality.lighting, notes.is_some(), lag_mm);
        let entries = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (8, scene.blurred.as_entire_binding()),
            (35, notes.unwrap_or(&self.no_notes).as_entire_binding()),
            (36, self.uniform.as_entire_binding()),
        ];
        let entries = [&entries[..], &layers.entries()].concat();
        passes.bind(gpu, VICINITY, "vicinity/opaque", &entries, workgroups_of(scene.size))
    }

    /// Binds [`TUBE_SHADOWS`]; the light is written to `scene.occlusion`.
    ///
    /// # Errors
    /// [`RenderError`] if the driver rejects the shader.
    pub fn bind_tubes(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        (layers, lag_mm): (&LayerLight, Option<f64>),
    ) -> Result<(), RenderError> {
        self.write(gpu, &scene.quality.lighting, false, lag_mm);
        let entries = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (5, scene.surfaces.as_entire_binding()),
            (7, scene.occlusion.as_entire_binding()),
            (36, self.uniform.as_entire_binding()),
        ];
        let entries = [&entries[..], &layers.entries()].concat();
        passes.bind(gpu, TUBE_SHADOWS, "vicinity/tubes", &entries, workgroups_of(scene.size))
    }

    /// Writes the uniform; `sliced`: whether slices ran; `lag_mm`: from which distance on layers count.
    fn write(&mut self, gpu: &Gpu, settings: &LightSettings, sliced: bool, lag_mm: Option<f64>) {
        let deepest_mm = lag_mm.map_or(FAR, |mm| mm as f32);
        let data = uniforms::Vicinity { deepest_mm, ..self.data(settings, sliced) };
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
            deepest_mm: FAR,
            unused_a: 0,
            unused_b: 0,
            unused_c: 0,
            points,
        }
    }
}

/// How much nearer to the eye a neighbour must be to lie in the cone, in millimetres per millimetre of lateral
/// distance. 0 in the paper's form, where a plane seen at a slant occludes half of itself.
pub(crate) fn slope(settings: &LightSettings) -> f32 {
    let (aperture, _) = clamped_aperture(settings.aperture_deg);
    match settings.variant {
        SliceVariant::Mended => (1.0 / aperture.to_radians().tan()).min(1e6) as f32,
        _ => 0.0,
    }
}
