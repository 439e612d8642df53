//! Reference ambient occlusion of a scene of first hits, which screen-space and vicinity occlusion approximate.

use glam::{DVec2, DVec3};

use super::{
    camera::{Camera, Ray},
    monte_carlo::around,
    random::Random,
};

/// Weight of the directions of the hemisphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// By the cosine to the normal, as on a diffuse surface.
    Cosine,
    /// Uniform in solid angle.
    Uniform,
}

/// Fraction of the hemisphere about `normal` (unit length) that isn't occluded within `radius_mm`, and
/// its standard error. `hidden` returns whether a ray is blocked within a distance in millimetres.
pub fn openness(
    hidden: &dyn Fn(&Ray, f64) -> bool,
    at_mm: DVec3,
    normal: DVec3,
    radius_mm: f64,
    weight: Weight,
    samples: u32,
    random: &mut Random,
) -> (f64, f64) {
    let (u, v) = around(normal);
    let mut open = 0u32;
    for _ in 0..samples {
        let a = random.unit();
        let cos = match weight {
            Weight::Cosine => (1.0 - a).sqrt(),
            Weight::Uniform => 1.0 - a,
        };
        let (sin_azimuth, cos_azimuth) = (std::f64::consts::TAU * random.unit()).sin_cos();
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let direction = normal * cos + (u * cos_azimuth + v * sin_azimuth) * sin;
        if !hidden(&Ray { origin_mm: at_mm, direction }, radius_mm) {
            open += 1;
        }
    }
    let n = f64::from(samples.max(1));
    let mean = f64::from(open) / n;
    (mean, (mean * (1.0 - mean) / n).sqrt())
}

/// The depth buffer of a frame: all that screen-space methods know of a scene.
#[derive(Clone, Debug)]
pub struct DepthScene {
    /// The camera of the frame.
    pub camera: Camera,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// View depth of each pixel, millimetres from the eye plane; infinite where nothing was hit.
    pub depths_mm: Vec<f64>,
    /// Assumed thickness of the opaque geometry behind each first hit.
    pub thickness_mm: f64,
}

impl DepthScene {
    /// View depth stored at the pixel that a world point projects to, and the point's own; `None` outside
    /// the frame.
    fn depths_at(&self, at_mm: DVec3) -> Option<(f64, f64)> {
        let size = DVec2::new(f64::from(self.size[0]), f64::from(self.size[1]));
        let pixel = self.camera.project(at_mm, size)?;
        if !(pixel.cmpge(DVec2::ZERO).all() && pixel.cmplt(size).all()) {
            return None;
        }
        let own_mm = (self.camera.eye_mm() - at_mm).dot(self.camera.axes()[2]);
        let stored_mm = self.depths_mm.get(pixel.y as usize * self.size[0] as usize + pixel.x as usize)?;
        Some((*stored_mm, own_mm))
    }

    /// World position of a pixel's first hit; `None` where nothing was hit.
    pub fn point_mm(&self, pixel: [u32; 2]) -> Option<DVec3> {
        let depth = *self.depths_mm.get((pixel[1] * self.size[0] + pixel[0]) as usize)?;
        if !depth.is_finite() {
            return None;
        }
        let size = DVec2::new(f64::from(self.size[0]), f64::from(self.size[1]));
        let ray = self.camera.ray(DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5), size);
        let forward = -self.camera.axes()[2];
        let start = (ray.origin_mm - self.camera.eye_mm()).dot(forward);
        Some(ray.origin_mm + ray.direction * ((depth - start) / ray.direction.dot(forward)))
    }

    /// Whether a ray passes behind a first hit within `radius_mm`, sampled every `step_mm` or closer;
    /// points at most `bias_mm` behind it don't count.
    pub fn hidden(&self, ray: &Ray, radius_mm: f64, step_mm: f64, bias_mm: f64) -> bool {
        let steps = (radius_mm / step_mm).ceil().clamp(1.0, 1e6) as u32;
        (0..steps).any(|i| {
            let at = ray.origin_mm + ray.direction * ((f64::from(i) + 0.5) * radius_mm / f64::from(steps));
            self.depths_at(at)
                .is_some_and(|(stored, own)| own > stored + bias_mm && own < stored + self.thickness_mm)
        })
    }
}
