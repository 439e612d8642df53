//! Light scattered up to a number of times in a participating medium, in the light of a uniform sky and of a lamp far away,
//! by Monte Carlo: collisions by inverting the optical thickness along each ray, the lamp's light by the transmittance itself.
//! The reference of paths of light on the device, which find both by tracking.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    camera::{Camera, Ray},
    medium::Medium,
    monte_carlo::{Estimate, Sums, around},
    random::Random,
};

/// The light, and how the medium scatters it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattering {
    /// Radiance of the sky, from all directions.
    pub sky: f64,
    /// Radiance of a white surface that faces the lamp.
    pub lamp_light: f64,
    /// Direction towards the lamp's middle, unit length.
    pub lamp: DVec3,
    /// Its angular radius, degrees, below 90.
    pub lamp_radius_deg: f64,
    /// Mean cosine of the scattering angle (Henyey and Greenstein 1941), between -1 and 1.
    pub anisotropy: f64,
    /// The most scatterings of a path, at least 1.
    pub bounces: u32,
}

/// A direction at an angle of this cosine to `axis`, both of unit length.
fn about(axis: DVec3, cosine: f64, random: &mut Random) -> DVec3 {
    let (u, v) = around(axis);
    let (sin, cos) = (std::f64::consts::TAU * random.unit()).sin_cos();
    axis * cosine + (u * cos + v * sin) * ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt()
}

impl Scattering {
    /// The phase function, relative to the isotropic one.
    fn phase(&self, cosine: f64) -> f64 {
        let g = self.anisotropy;
        (1.0 - g * g) / (1.0 + g * g - 2.0 * g * cosine).powf(1.5)
    }

    /// Cosine of a scattering angle.
    fn cosine(&self, random: &mut Random) -> f64 {
        let (g, u) = (self.anisotropy, random.unit());
        if g.abs() < 1e-6 {
            return 1.0 - 2.0 * u;
        }
        let part = (1.0 - g * g) / (1.0 + g - 2.0 * g * u);
        ((1.0 + g * g - part * part) / (2.0 * g)).clamp(-1.0, 1.0)
    }

    /// Light that goes back along a path which came to `at_mm` along `along` and was scattered there.
    fn scattered(&self, medium: &dyn Medium, at_mm: DVec3, along: DVec3, random: &mut Random) -> DVec3 {
        let (mut at_mm, mut along) = (at_mm, along);
        let (mut throughput, mut sum) = (DVec3::ONE, DVec3::ZERO);
        let cap = 1.0 - self.lamp_radius_deg.to_radians().cos();
        for n in 1..=self.bounces {
            throughput *= medium.optics(at_mm).color;
            if self.lamp_light > 0.0 {
                let direction = about(self.lamp, 1.0 - random.unit() * cap, random);
                let left = (-medium.thickness(&Ray { origin_mm: at_mm, direction }, f64::INFINITY)).exp();
                // A white surface that faces light of this irradiance has 1/π of it, an isotropic medium 1/4π.
                sum += throughput * (0.25 * self.lamp_light * self.phase(along.dot(direction)) * left);
            }
            let direction = about(along, self.cosine(random), random);
            let ray = Ray { origin_mm: at_mm, direction };
            if n == self.bounces {
                return sum + throughput * self.sky * (-medium.thickness(&ray, f64::INFINITY)).exp();
            }
            match medium.reach_mm(&ray, -(-random.unit()).ln_1p()) {
                Some(reach) => (at_mm, along) = (at_mm + direction * reach, direction),
                None => return sum + throughput * self.sky,
            }
        }
        sum
    }

    /// Radiance of the medium along a ray, without what is behind it.
    pub fn radiance(&self, medium: &dyn Medium, ray: &Ray, samples: u32, random: &mut Random) -> Estimate {
        let hit_probability = -(-medium.thickness(ray, f64::INFINITY)).exp_m1();
        let mut sums = Sums::default();
        for _ in 0..samples {
            let thickness = -(-random.unit() * hit_probability).ln_1p();
            // None: rounding at the far end of the ray.
            let light = medium.reach_mm(ray, thickness).map_or(DVec3::ZERO, |reach| {
                self.scattered(medium, ray.origin_mm + ray.direction * reach, ray.direction, random)
            });
            sums.add(light * hit_probability);
        }
        sums.estimate()
    }

    /// [`Scattering::radiance`] of every pixel, row by row from the top. Each has its own random numbers.
    pub fn picture(
        &self,
        medium: &dyn Medium,
        camera: &Camera,
        size: [u32; 2],
        samples: u32,
        seed: u64,
    ) -> Vec<Estimate> {
        let size_px = DVec2::new(f64::from(size[0]), f64::from(size[1]));
        (0..u64::from(size[0]) * u64::from(size[1]))
            .into_par_iter()
            .map(|i| {
                let pixel =
                    DVec2::new((i % u64::from(size[0])) as f64, (i / u64::from(size[0])) as f64) + 0.5;
                self.radiance(medium, &camera.ray(pixel, size_px), samples, &mut Random::new(seed, i))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::medium::{Shape, Shapes};

    fn slab(color: DVec3, extinction_per_mm: f64) -> Shapes {
        let (min_mm, max_mm) = (DVec3::new(-1e4, -1e4, -10.0), DVec3::new(1e4, 1e4, 0.0));
        Shapes::one(Shape::Box { min_mm, max_mm }, extinction_per_mm, color)
    }

    const DOWN: Ray = Ray { origin_mm: DVec3::new(0.0, 0.0, 5.0), direction: DVec3::new(0.0, 0.0, -1.0) };

    /// In a white sky, what absorbs nothing has the sky's radiance where it is not seen through.
    #[test]
    fn a_white_furnace_is_white() {
        for anisotropy in [0.0, 0.7] {
            let light = Scattering {
                sky: 1.0,
                lamp_light: 0.0,
                lamp: DVec3::Z,
                lamp_radius_deg: 0.0,
                anisotropy,
                bounces: 1000,
            };
            let found = light.radiance(&slab(DVec3::ONE, 0.2), &DOWN, 200, &mut Random::new(1, 0));
            assert!((found.mean.x - (1.0 - (-2.0f64).exp())).abs() < 1e-9, "{found:?}");
        }
    }

    /// Single scattering of a lamp in a slab (Chandrasekhar 1960): closed form.
    #[test]
    fn a_lamp_on_a_slab_has_its_closed_form() {
        for (degrees, anisotropy) in [(0.0f64, 0.0), (50.0, 0.6), (70.0, -0.4)] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let light = Scattering {
                sky: 0.0,
                lamp_light: 1.0,
                lamp: DVec3::new(sin, 0.0, cos),
                lamp_radius_deg: 0.0,
                anisotropy,
                bounces: 1,
            };
            let found = light.radiance(&slab(DVec3::ONE, 0.12), &DOWN, 20_000, &mut Random::new(2, 0));
            let slant = 1.0 + 1.0 / cos;
            let expected = 0.25 * light.phase(-cos) * (1.0 - (-1.2 * slant).exp()) / slant;
            let off = (found.mean.x - expected) / found.standard_error.x;
            assert!(off.abs() < 3.5, "{degrees}: {found:?}, expected {expected}");
        }
    }

    /// A second scattering adds light, of the colour squared.
    #[test]
    fn more_bounces_add_light_and_saturate_colour() {
        let light = |bounces| Scattering {
            sky: 0.5,
            lamp_light: 0.5,
            lamp: DVec3::Z,
            lamp_radius_deg: 20.0,
            anisotropy: 0.0,
            bounces,
        };
        let medium = slab(DVec3::new(0.9, 0.3, 0.1), 0.3);
        let [once, often] =
            [1, 16].map(|n| light(n).radiance(&medium, &DOWN, 20_000, &mut Random::new(3, 0)));
        assert!(often.mean.x > 1.2 * once.mean.x, "{once:?} {often:?}");
        assert!(often.mean.x / often.mean.y > 1.1 * once.mean.x / once.mean.y, "{once:?} {often:?}");
    }
}
