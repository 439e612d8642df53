//! Equations 7 to 10 of the directional occlusion paper (Schott et al. 2009) by Monte Carlo: single
//! scattering, constant ambient light, a backward-peaked cone or an isotropic phase function.
//!
//! Collisions are sampled from the transmittance along the ray, light directions from the phase
//! function; transmittance to the light is computed from the medium itself. Each pixel has its own
//! random stream, so that frames don't depend on the number of threads.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    camera::{Camera, Ray},
    medium::Medium,
    random::Random,
};

/// Phase function: the distribution of the directions that light arrives from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// Directions in a cone about the direction to the eye, uniform in solid angle: equation 6.
    Cone {
        /// Half the opening angle, degrees, below 90.
        aperture_deg: f64,
    },
    /// Directions in a cone about a fixed direction instead of the one to the eye, uniform in solid angle: a wide light far
    /// away.
    Lamp {
        /// Towards the light, unit length.
        towards: DVec3,
        /// Half the opening angle, degrees, below 90.
        aperture_deg: f64,
    },
    /// The cone about the direction to the eye, directions through the points of a disc uniform in area, as the paper's slices
    /// sample it.
    Disc {
        /// Half the opening angle, degrees, below 90.
        aperture_deg: f64,
    },
    /// All directions equally.
    Isotropic,
    /// All directions equally, from a sphere about the point: what is farther away hides nothing.
    Near {
        /// Of the sphere, millimetres.
        radius_mm: f64,
    },
}

impl Phase {
    /// How far away what hides light may be.
    fn reach_mm(self) -> f64 {
        if let Self::Near { radius_mm } = self { radius_mm } else { f64::INFINITY }
    }
}

/// A sample mean and its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Of linear radiance, or of visibility in every channel.
    pub mean: DVec3,
    /// Standard error of each channel.
    pub standard_error: DVec3,
}

/// Running mean and sum of squared deviations from it.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    n: f64,
    mean: DVec3,
    m2: DVec3,
}

impl Sums {
    pub(super) fn add(&mut self, x: DVec3) {
        self.n += 1.0;
        let off = x - self.mean;
        self.mean += off / self.n;
        self.m2 += off * (x - self.mean);
    }

    fn standard_error(&self) -> DVec3 {
        let v = self.m2 / ((self.n - 1.0).max(1.0) * self.n.max(1.0));
        DVec3::new(v.x.sqrt(), v.y.sqrt(), v.z.sqrt())
    }

    pub(super) fn estimate(&self) -> Estimate {
        Estimate { mean: self.mean, standard_error: self.standard_error() }
    }
}

/// Two unit vectors orthogonal to `axis` (unit length) and to each other.
pub fn around(axis: DVec3) -> (DVec3, DVec3) {
    let helper = if axis.x.abs() < 0.5 { DVec3::X } else { DVec3::Y };
    let u = axis.cross(helper).normalize_or(DVec3::Z);
    (u, axis.cross(u))
}

/// A direction sampled from the phase function about `axis` (unit length, towards the eye), or about its own.
pub fn direction(phase: Phase, axis: DVec3, random: &mut Random) -> DVec3 {
    let (a, b) = (random.unit(), random.unit());
    let (sin_azimuth, cos_azimuth) = (std::f64::consts::TAU * b).sin_cos();
    let cos = match phase {
        Phase::Cone { aperture_deg } | Phase::Lamp { aperture_deg, .. } => {
            1.0 - a * (1.0 - aperture_deg.to_radians().cos())
        }
        Phase::Disc { aperture_deg } => 1.0 / (1.0 + a * aperture_deg.to_radians().tan().powi(2)).sqrt(),
        Phase::Isotropic | Phase::Near { .. } => 1.0 - 2.0 * a,
    };
    let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
    let axis = if let Phase::Lamp { towards, .. } = phase { towards } else { axis };
    let (u, v) = around(axis);
    axis * cos + (u * cos_azimuth + v * sin_azimuth) * sin
}

/// Equation 10: the fraction of the light that reaches a point.
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
        sums.add(DVec3::splat((-medium.thickness(&ray, phase.reach_mm())).exp()));
    }
    sums.estimate()
}

/// Equation 7 along one ray with ambient light 1. A surface of an opaque medium is lit by the
/// light that reaches the point just in front of it.
pub fn radiance(
    medium: &dyn Medium,
    ray: &Ray,
    phase: Phase,
    background: DVec3,
    samples: u32,
    random: &mut Random,
) -> Estimate {
    let total = medium.thickness(ray, f64::INFINITY);
    let hit_probability = -(-total).exp_m1();
    if hit_probability <= 0.0 {
        return Estimate { mean: background, standard_error: DVec3::ZERO };
    }
    let mut sums = Sums::default();
    for _ in 0..samples {
        let thickness = -(-random.unit() * hit_probability).ln_1p();
        let light = direction(phase, -ray.direction, random);
        let Some(reach) = medium.reach_mm(ray, thickness) else {
            // Rounding at the far end of the ray.
            sums.add(DVec3::ZERO);
            continue;
        };
        // On either side of a face: behind it for the colour, in front of it for the light.
        let offset = 1e-9 * (1.0 + reach);
        let color = medium.optics(ray.origin_mm + ray.direction * (reach + offset)).color;
        let from = Ray { origin_mm: ray.origin_mm + ray.direction * (reach - offset), direction: light };
        sums.add(color * (-medium.thickness(&from, phase.reach_mm())).exp());
    }
    Estimate {
        mean: sums.mean * hit_probability + background * (-total).exp(),
        standard_error: sums.standard_error() * hit_probability,
    }
}

/// [`radiance`] of every pixel, row by row from the top.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::medium::{Shape, Shapes};

    /// What is within the radius hides, and nothing else.
    #[test]
    fn light_from_nearby_has_its_closed_form() {
        let half = DVec3::splat(100.0);
        let medium = Shapes::one(Shape::Box { min_mm: -half, max_mm: half }, 0.1, DVec3::ONE);
        for (radius_mm, expected) in [(0.0, 1.0), (5.0, 0.5f64.exp().recip()), (10.0, 1f64.exp().recip())] {
            let mut random = Random::new(3, 0);
            let found =
                visibility(&medium, DVec3::ZERO, DVec3::Z, Phase::Near { radius_mm }, 20, &mut random);
            assert!((found.mean.x - expected).abs() < 1e-9, "{radius_mm}: {found:?}");
        }
        let far = Phase::Near { radius_mm: 1e4 };
        let [near, all] = [far, Phase::Isotropic]
            .map(|phase| visibility(&medium, half * 0.99, DVec3::Z, phase, 50, &mut Random::new(3, 0)).mean);
        assert_eq!(near, all);
    }
}
