//! Light that reaches a place among solids, by brute force: the reference of directional light on opaque geometry.

use glam::DVec3;

use super::{camera::Ray, monte_carlo::around, random::Random};

/// A segment with a radius, round at its ends: a piece of a fibre tube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// One end of its axis.
    pub a_mm: DVec3,
    /// The other.
    pub b_mm: DVec3,
    /// Half its width.
    pub radius_mm: f64,
}

impl Capsule {
    /// Whether a ray passes within the radius of the axis before `far_mm`.
    pub fn hidden(&self, ray: &Ray, far_mm: f64) -> bool {
        let end_mm = ray.origin_mm + ray.direction * far_mm;
        between_segments(ray.origin_mm, end_mm, self.a_mm, self.b_mm) < self.radius_mm
    }
}

/// Distance between two segments: the least of those between their lines' nearest points, where both lie in the
/// segments, and of their ends to the other segment.
fn between_segments(p: DVec3, q: DVec3, a: DVec3, b: DVec3) -> f64 {
    let to_segment = |x: DVec3, from: DVec3, to: DVec3| {
        let along = to - from;
        let share = (x - from).dot(along) / along.length_squared();
        x.distance(from + along * if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 })
    };
    let ends = [to_segment(p, a, b), to_segment(q, a, b), to_segment(a, p, q), to_segment(b, p, q)];
    let nearest = ends.into_iter().fold(f64::INFINITY, f64::min);
    let (u, v, w) = (q - p, b - a, p - a);
    let across = u.cross(v);
    let area = across.length_squared();
    if area <= 1e-24 * u.length_squared() * v.length_squared() {
        return nearest;
    }
    let s = v.cross(w).dot(across) / area;
    let t = u.cross(w).dot(across) / area;
    let inside = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
    if inside { nearest.min(w.dot(across).abs() / area.sqrt()) } else { nearest }
}

/// Share of the directions within `aperture_deg` of `to_eye` (unit length), uniform in solid angle, along which nothing
/// hides the eye from `at_mm`, and its standard error.
pub fn cone_openness(
    hidden: &dyn Fn(&Ray) -> bool,
    at_mm: DVec3,
    to_eye: DVec3,
    aperture_deg: f64,
    samples: u32,
    random: &mut Random,
) -> (f64, f64) {
    let (u, v) = around(to_eye);
    let least = aperture_deg.to_radians().cos();
    let mut open = 0u32;
    for _ in 0..samples {
        let cos = 1.0 - (1.0 - least) * random.unit();
        let (sin_azimuth, cos_azimuth) = (std::f64::consts::TAU * random.unit()).sin_cos();
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let direction = to_eye * cos + (u * cos_azimuth + v * sin_azimuth) * sin;
        open += u32::from(!hidden(&Ray { origin_mm: at_mm, direction }));
    }
    let n = f64::from(samples.max(1));
    let mean = f64::from(open) / n;
    (mean, (mean * (1.0 - mean) / n).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_segments_are_the_least_over_their_points() {
        let mut random = Random::new(3, 0);
        for _ in 0..200 {
            let [p, q, a, b] =
                std::array::from_fn(|_| DVec3::from_array(std::array::from_fn(|_| random.unit())));
            let found = between_segments(p, q, a, b);
            let at = |i: u32, from: DVec3, to: DVec3| from + (to - from) * (f64::from(i) / 200.0);
            let points = (0..=200).flat_map(|i| (0..=200).map(move |j| (i, j)));
            let least = points.map(|(i, j)| at(i, p, q).distance(at(j, a, b))).fold(f64::INFINITY, f64::min);
            assert!(found <= least + 1e-12 && found > least - 0.01, "{found} {least}");
        }
        let one = DVec3::ONE;
        assert_eq!(between_segments(DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Y + DVec3::X), 1.0, "parallel");
        assert_eq!(between_segments(one, one, DVec3::ZERO, DVec3::ZERO), 3f64.sqrt(), "points");
    }

    /// Half of the cone's solid angle lies within the angle whose cosine is halfway between the cone's and 1.
    #[test]
    fn a_ball_hides_its_own_solid_angle() {
        let ball =
            Capsule { a_mm: DVec3::Z * 10.0, b_mm: DVec3::Z * 10.0, radius_mm: 10.0 * 0.75f64.acos().sin() };
        let hidden = |ray: &Ray| ball.hidden(ray, 1e4);
        let (open, error) =
            cone_openness(&hidden, DVec3::ZERO, DVec3::Z, 60.0, 20_000, &mut Random::new(1, 0));
        assert!((open - 0.5).abs() < 4.0 * error && error < 0.004, "{open} {error}");
        let away = Ray { origin_mm: DVec3::ZERO, direction: -DVec3::Z };
        assert!(!ball.hidden(&away, 1e4) && !ball.hidden(&Ray { direction: DVec3::Z, ..away }, 3.0));
    }
}
