//! Light that reaches a place among solids, by brute force: the reference of directional light on opaque geometry.

use std::ops::Range;

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

/// Capsules in a hierarchy of boxes, so that a ray is compared with few of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CapsuleTree {
    boxes: Vec<CapsuleBox>,
    capsules: Vec<Capsule>,
}

/// A box of a [`CapsuleTree`]; those in it follow it.
#[derive(Clone, Debug, PartialEq)]
struct CapsuleBox {
    low_mm: DVec3,
    high_mm: DVec3,
    /// Number of the first box that isn't in it.
    next: usize,
    /// Its capsules, if no boxes are in it.
    capsules: Range<usize>,
}

impl CapsuleTree {
    /// Capsules of a box without boxes in it, at most.
    const MOST: usize = 4;

    /// Of any number of capsules.
    pub fn new(mut capsules: Vec<Capsule>) -> Self {
        let mut boxes = Vec::new();
        let all = 0..capsules.len();
        if !capsules.is_empty() {
            Self::add(&mut boxes, &mut capsules, all);
        }
        Self { boxes, capsules }
    }

    /// Adds the box of `range` of all capsules, which it reorders, and the boxes in it.
    fn add(boxes: &mut Vec<CapsuleBox>, all: &mut [Capsule], range: Range<usize>) {
        let Some(capsules) = all.get_mut(range.clone()) else { return };
        let (mut low_mm, mut high_mm) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut least, mut most) = (low_mm, high_mm);
        for c in capsules.iter() {
            low_mm = low_mm.min(c.a_mm.min(c.b_mm) - c.radius_mm);
            high_mm = high_mm.max(c.a_mm.max(c.b_mm) + c.radius_mm);
            least = least.min(c.a_mm + c.b_mm);
            most = most.max(c.a_mm + c.b_mm);
        }
        let at = boxes.len();
        let is_leaf = capsules.len() <= Self::MOST;
        let held = if is_leaf { range.clone() } else { 0..0 };
        boxes.push(CapsuleBox { low_mm, high_mm, next: at + 1, capsules: held });
        if is_leaf {
            return;
        }
        let axis = (most - least).max_position();
        let half = capsules.len() / 2;
        let place = |c: &Capsule| (c.a_mm + c.b_mm)[axis];
        capsules.select_nth_unstable_by(half, |x, y| place(x).total_cmp(&place(y)));
        Self::add(boxes, all, range.start..range.start + half);
        Self::add(boxes, all, range.start + half..range.end);
        let next = boxes.len();
        if let Some(added) = boxes.get_mut(at) {
            added.next = next;
        }
    }

    /// The capsules in the boxes that `meets` lets pass.
    fn among<'a>(
        &'a self,
        mut meets: impl FnMut(&CapsuleBox) -> bool + 'a,
    ) -> impl Iterator<Item = &'a Capsule> + 'a {
        let mut at = 0;
        let leaves = std::iter::from_fn(move || {
            while let Some(found) = self.boxes.get(at) {
                let is_met = meets(found);
                at = if is_met { at + 1 } else { found.next };
                if is_met && !found.capsules.is_empty() {
                    return self.capsules.get(found.capsules.clone());
                }
            }
            None
        });
        leaves.flatten()
    }

    /// Whether a ray passes within the radius of an axis before `far_mm`.
    pub fn hidden(&self, ray: &Ray, far_mm: f64) -> bool {
        let inverse = ray.direction.recip();
        self.among(move |b| {
            // NaN, where a ray along a box begins on its side, is left out by `min` and `max`.
            let (to_low, to_high) =
                ((b.low_mm - ray.origin_mm) * inverse, (b.high_mm - ray.origin_mm) * inverse);
            let near = (0..3).fold(0.0, |near: f64, axis| near.max(to_low[axis].min(to_high[axis])));
            let far = (0..3).fold(far_mm, |far: f64, axis| far.min(to_low[axis].max(to_high[axis])));
            near <= far
        })
        .any(|c| c.hidden(ray, far_mm))
    }

    /// A distance within which all of it lies; 0 without capsules.
    pub fn farthest_mm(&self, at_mm: DVec3) -> f64 {
        self.boxes
            .first()
            .map_or(0.0, |all| (at_mm - all.low_mm).abs().max((at_mm - all.high_mm).abs()).length())
    }

    /// The outward normal of the capsule whose surface is nearest to a place, of those within `most_mm`; `None` without any.
    pub fn normal(&self, at_mm: DVec3, most_mm: f64) -> Option<DVec3> {
        let from_axis = |c: &Capsule| {
            let along = c.b_mm - c.a_mm;
            let share = (at_mm - c.a_mm).dot(along) / along.length_squared();
            at_mm - c.a_mm - along * if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
        };
        let is_near = move |b: &CapsuleBox| {
            at_mm.cmpge(b.low_mm - most_mm).all() && at_mm.cmple(b.high_mm + most_mm).all()
        };
        self.among(is_near)
            .map(|c| (from_axis(c), c.radius_mm))
            .map(|(off, radius_mm)| ((off.length() - radius_mm).abs(), off))
            .filter(|(away_mm, _)| *away_mm <= most_mm)
            .min_by(|x, y| x.0.total_cmp(&y.0))
            .and_then(|(_, off)| off.try_normalize())
    }
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

    #[test]
    fn a_tree_of_capsules_hides_what_its_capsules_hide() {
        let mut random = Random::new(7, 0);
        let mut place = |size: f64| size * (DVec3::new(random.unit(), random.unit(), random.unit()) - 0.5);
        let mut capsules: Vec<Capsule> = (0..300)
            .map(|n| {
                let a_mm = place(60.0);
                Capsule { a_mm, b_mm: a_mm + place(8.0), radius_mm: 0.3 + f64::from(n % 3) }
            })
            .collect();
        // Many in one place, and one without a length.
        capsules.extend([Capsule { a_mm: DVec3::ONE, b_mm: DVec3::ONE, radius_mm: 0.5 }; 9]);
        let tree = CapsuleTree::new(capsules.clone());
        let mut hits = 0;
        for n in 0..600 {
            let direction = match n % 3 {
                0 => DVec3::AXES[n % 9 / 3],
                _ => place(2.0).normalize_or(DVec3::X),
            };
            let ray = Ray { origin_mm: place(80.0), direction };
            let far_mm = [5.0, 30.0, 1e4][n % 5 % 3];
            let expected = capsules.iter().any(|c| c.hidden(&ray, far_mm));
            hits += usize::from(expected);
            assert_eq!(tree.hidden(&ray, far_mm), expected, "{ray:?} {far_mm}");
        }
        assert!((100..500).contains(&hits), "{hits}");
        let ray = Ray { origin_mm: DVec3::ZERO, direction: DVec3::X };
        assert!(!CapsuleTree::new(Vec::new()).hidden(&ray, 1e9));
        let alone = Capsule { a_mm: DVec3::ZERO, b_mm: DVec3::X * 4.0, radius_mm: 1.0 };
        let tree = CapsuleTree::new(vec![alone]);
        assert_eq!(tree.normal(DVec3::new(2.0, 1.0, 0.0), 0.1), Some(DVec3::Y));
        assert_eq!(tree.normal(DVec3::new(-1.01, 0.0, 0.0), 0.1), Some(-DVec3::X));
        assert_eq!(tree.normal(DVec3::new(2.0, 1.2, 0.0), 0.1), None);
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
