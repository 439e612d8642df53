//! The emission-absorption integral along a ray, by ray marching with a step that is halved until it converges.

use glam::DVec3;

use super::{
    camera::Ray,
    medium::{Medium, box_interval},
};

/// A ray's radiance, and how it was computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Converged {
    /// Linear radiance of the finest march.
    pub radiance: DVec3,
    /// Transmittance of the whole ray.
    pub transmittance: f64,
    /// Step of the finest march.
    pub step_mm: f64,
    /// Largest change of a channel at the last halving.
    pub change: f64,
}

/// Interval of the ray, from its origin on, inside the medium's bounding box; `None` if it misses it.
pub fn stretch_mm(medium: &dyn Medium, ray: &Ray) -> Option<(f64, f64)> {
    let corners = medium.corners_mm();
    let min = corners.iter().fold(DVec3::INFINITY, |m, c| m.min(*c));
    let max = corners.iter().fold(DVec3::NEG_INFINITY, |m, c| m.max(*c));
    let (near, far) = box_interval(ray.origin_mm - min, ray.direction, max - min)?;
    (far > 0.0).then_some((near.max(0.0), far))
}

/// Equation 8 of the directional occlusion paper with steps of at most `step_mm`, sampled at their
/// midpoints: radiance and transmittance. `light` is the light that reaches a point, 0 to 1.
pub fn march(
    medium: &dyn Medium,
    ray: &Ray,
    step_mm: f64,
    light: &dyn Fn(DVec3) -> f64,
    background: DVec3,
) -> (DVec3, f64) {
    let Some((near, far)) = stretch_mm(medium, ray) else { return (background, 1.0) };
    let steps = ((far - near) / step_mm).ceil().clamp(1.0, 1e7);
    let step = (far - near) / steps;
    let (mut radiance, mut transmittance) = (DVec3::ZERO, 1.0);
    for i in 0..steps as u64 {
        let at = ray.origin_mm + ray.direction * (near + (i as f64 + 0.5) * step);
        let optics = medium.optics(at);
        if optics.extinction_per_mm <= 0.0 {
            continue;
        }
        let alpha = -(-optics.extinction_per_mm * step).exp_m1();
        radiance += optics.color * (transmittance * alpha * light(at));
        transmittance *= 1.0 - alpha;
        if transmittance <= 0.0 {
            break;
        }
    }
    (radiance + background * transmittance, transmittance)
}

/// As [`march`], with the step halved from `first_step_mm` until no channel changes by more than
/// `tolerance`, at most 16 times.
pub fn converged(
    medium: &dyn Medium,
    ray: &Ray,
    first_step_mm: f64,
    tolerance: f64,
    light: &dyn Fn(DVec3) -> f64,
    background: DVec3,
) -> Converged {
    let mut step_mm = first_step_mm;
    let (radiance, transmittance) = march(medium, ray, step_mm, light, background);
    let mut out = Converged { radiance, transmittance, step_mm, change: f64::INFINITY };
    for _ in 0..16 {
        step_mm *= 0.5;
        let (radiance, transmittance) = march(medium, ray, step_mm, light, background);
        let change = (radiance - out.radiance).abs().max_element();
        out = Converged { radiance, transmittance, step_mm, change };
        if change <= tolerance {
            break;
        }
    }
    out
}
