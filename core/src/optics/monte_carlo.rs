//! Equations 7 to 10 of the directional occlusion paper (Schott et al. 2009) by Monte Carlo: one
//! scattering, constant light from all around, a backward-peaked cone or an isotropic phase function.
//!
//! Collisions are drawn from the transmittance along the ray, light directions from the phase
//! function, and transmittance to the light comes from the medium itself. Pixels have a random
//! stream each, so that pictures don't depend on threads.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    camera::{Camera, Ray},
    medium::Medium,
    random::Random,
};

/// From where light comes to a place, and how often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// Directions in a cone about the way back to the eye, uniform in solid angle: equation 6.
    Cone {
        /// Half the opening angle, degrees, below 90.
        aperture_deg: f64,
    },
    /// The same cone, directions through the points of a disc uniform in area, as the paper's slices
    /// sample it.
    Disc {
        /// Half the opening angle, degrees, below 90.
        aperture_deg: f64,
    },
    /// All directions alike.
    Isotropic,
}

/// A mean and what is known of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Of linear radiance, or of visibility in every channel.
    pub mean: DVec3,
    /// Standard error of each channel.
    pub standard_error: DVec3,
}

/// Sum and sum of squares about a first value.
#[derive(Clone, Copy, Default)]
struct Sums {
    n: f64,
    mean: DVec3,
    m2: DVec3,
}

impl Sums {
    fn add(&mut self, x: DVec3) {
        self.n += 1.0;
        let off = x - self.mean;
        self.mean += off / self.n;
        self.m2 += off * (x - self.mean);
    }

    fn standard_error(&self) -> DVec3 {
        let v = self.m2 / ((self.n - 1.0).max(1.0) * self.n.max(1.0));
        DVec3::new(v.x.sqrt(), v.y.sqrt(), v.z.sqrt())
    }
}

/// Two directions at right angles to `axis` (unit) and to each other.
pub fn around(axis: DVec3) -> (DVec3, DVec3) {
    let helper = if axis.x.abs() < 0.5 { DVec3::X } else { DVec3::Y };
    let u = axis.cross(helper).normalize_or(DVec3::Z);
    (u, axis.cross(u))
}

/// A direction from the phase function about `axis` (unit, towards the eye).
pub fn direction(phase: Phase, axis: DVec3, random: &mut Random) -> DVec3 {
    let (a, b) = (random.unit(), random.unit());
    let (sin_turn, cos_turn) = (std::f64::consts::TAU * b).sin_cos();
    let cos = match phase {
        Phase::Cone { aperture_deg } => 1.0 - a * (1.0 - aperture_deg.to_radians().cos()),
        Phase::Disc { aperture_deg } => 1.0 / (1.0 + a * aperture_deg.to_radians().tan().powi(2)).sqrt(),
        Phase::Isotropic => 1.0 - 2.0 * a,
    };
    let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
    let (u, v) = around(axis);
    axis * cos + (u * cos_turn + v * sin_turn) * sin
}

/// Equation 10: the share of the light that reaches a place.
pub fn visibility(
    medium: &dyn Medium,
    at_mm: DVec3,
    axis: DVec3,
    phase: Phase,
    samples: u32,
    random: &mut Random,
) -> Estimate {
    let mut sums = Sums::default();
    for _ in 0..samples {
        let ray = Ray { origin_mm: at_mm, direction: direction(phase, axis, random) };
        sums.add(DVec3::splat((-medium.thickness(&ray, f64::INFINITY)).exp()));
    }
    Estimate { mean: sums.mean, standard_error: sums.standard_error() }
}

/// Equation 7 along one ray with ambient light 1. A surface of an opaque medium is lit by what
/// reaches the point just before it.
pub fn radiance(
    medium: &dyn Medium,
    ray: &Ray,
    phase: Phase,
    background: DVec3,
    samples: u32,
    random: &mut Random,
) -> Estimate {
    let total = medium.thickness(ray, f64::INFINITY);
    let hits = -(-total).exp_m1();
    if hits <= 0.0 {
        return Estimate { mean: background, standard_error: DVec3::ZERO };
    }
    let mut sums = Sums::default();
    for _ in 0..samples {
        let thickness = -(-random.unit() * hits).ln_1p();
        let light = direction(phase, -ray.direction, random);
        let Some(reach) = medium.reach_mm(ray, thickness) else {
            // Rounding at the far end.
            sums.add(DVec3::ZERO);
            continue;
        };
        // On either side of a face: inside for the colour, before it for the light.
        let slip = 1e-9 * (1.0 + reach);
        let color = medium.optics(ray.origin_mm + ray.direction * (reach + slip)).color;
        let from = Ray { origin_mm: ray.origin_mm + ray.direction * (reach - slip), direction: light };
        sums.add(color * (-medium.thickness(&from, f64::INFINITY)).exp());
    }
    Estimate {
        mean: sums.mean * hits + background * (-total).exp(),
        standard_error: sums.standard_error() * hits,
    }
}

/// [`radiance`] of every pixel, row after row from the top.
pub fn picture(
    medium: &dyn Medium,
    camera: &Camera,
    size: [u32; 2],
    phase: Phase,
    background: DVec3,
    samples: u32,
    seed: u64,
) -> Vec<Estimate> {
    let size_px = DVec2::new(f64::from(size[0]), f64::from(size[1]));
    (0..u64::from(size[0]) * u64::from(size[1]))
        .into_par_iter()
        .map(|i| {
            let pixel = DVec2::new((i % u64::from(size[0])) as f64, (i / u64::from(size[0])) as f64) + 0.5;
            let ray = camera.ray(pixel, size_px);
            radiance(medium, &ray, phase, background, samples, &mut Random::new(seed, i))
        })
        .collect()
}
