//! `Step` and `Pixel` of lib/path_state.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use crate::scene::PathSettings;

/// `Step` of lib/path_state.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Step {
    pub first: u32,
    pub bounces: u32,
    pub sky: f32,
    pub anisotropy: f32,
    pub lamp: [f32; 3],
    pub lamp_cap: f32,
    pub lamp_light: f32,
    pub unused_a: u32,
    pub unused_b: u32,
    pub unused_c: u32,
}

/// `Pixel` of lib/path_state.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Pixel {
    pub even: [f32; 4],
    pub odd: [f32; 4],
    pub place: [u32; 4],
}

/// A value within a range; NaN becomes the least.
fn within(value: f64, low: f64, high: f64) -> f64 {
    if value.is_nan() { low } else { value.clamp(low, high) }
}

impl Step {
    /// The first dispatch; `lamp` is the direction towards the lamp in camera space, unit length.
    pub fn of(settings: &PathSettings, lamp: DVec3) -> Self {
        let lamp_light = within(settings.lamp_share, 0.0, 1.0);
        let radius = within(settings.lamp_radius_deg, 0.0, 60.0).to_radians();
        Self {
            bounces: settings.bounces.clamp(1, PathSettings::MOST_BOUNCES),
            sky: (1.0 - lamp_light) as f32,
            anisotropy: within(settings.anisotropy, -0.95, 0.95) as f32,
            lamp: lamp.as_vec3().to_array(),
            // 1 - cos, without cancellation.
            lamp_cap: (2.0 * (0.5 * radius).sin().powi(2)) as f32,
            lamp_light: lamp_light as f32,
            ..Self::default()
        }
    }
}

/// Paths of each half of a pixel.
pub(crate) fn paths_of_half(settings: &PathSettings) -> u32 {
    settings.most.clamp(2, PathSettings::MOST).div_ceil(2)
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(
        Step, "Step": first, bounces, sky, anisotropy, lamp, lamp_cap, lamp_light, unused_a, unused_b, unused_c
    ),
    crate::layouts::layout!(Pixel, "Pixel": even, odd, place),
];
