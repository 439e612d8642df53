//! Participating media: extinction and colour at every point, in world millimetres.

use glam::DVec3;

use super::camera::Ray;

/// Optical properties of a medium at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Optics {
    /// Extinction per millimetre; 0 is empty, infinity opaque. Never NaN, never negative.
    pub extinction_per_mm: f64,
    /// Linear colour (single-scattering albedo).
    pub color: DVec3,
}

/// Optical thickness of `length_mm` of a material; 0 for no length, even of an opaque one.
pub fn thickness_of(extinction_per_mm: f64, length_mm: f64) -> f64 {
    if length_mm > 0.0 && extinction_per_mm > 0.0 { extinction_per_mm * length_mm } else { 0.0 }
}

/// A participating medium.
pub trait Medium: Sync {
    /// Corners of a box that contains everything that isn't empty.
    fn corners_mm(&self) -> [DVec3; 8];

    /// Optical properties at a point.
    fn optics(&self, at_mm: DVec3) -> Optics;

    /// Optical thickness of the ray over `length_mm`, which may be infinite, from its origin.
    fn thickness(&self, ray: &Ray, length_mm: f64) -> f64;

    /// Distance along the ray at which the optical thickness from its origin reaches `thickness`;
    /// `None` where it never does.
    fn reach_mm(&self, ray: &Ray, thickness: f64) -> Option<f64>;
}

/// A simple shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// An axis-aligned box. One that is long in two directions is a slab.
    Box {
        /// Corner of least coordinates.
        min_mm: DVec3,
        /// Corner of greatest coordinates.
        max_mm: DVec3,
    },
    /// A ball.
    Ball {
        /// Its centre.
        center_mm: DVec3,
        /// Its radius.
        radius_mm: f64,
    },
}

impl Shape {
    /// Interval of the ray inside, from its origin on; `None` if it misses.
    pub fn interval_mm(&self, ray: &Ray) -> Option<(f64, f64)> {
        let (near, far) = match *self {
            Self::Box { min_mm, max_mm } => {
                box_interval(ray.origin_mm - min_mm, ray.direction, max_mm - min_mm)?
            }
            Self::Ball { center_mm, radius_mm } => {
                let to = center_mm - ray.origin_mm;
                let along = to.dot(ray.direction);
                let off = (to - ray.direction * along).length();
                let half2 = (radius_mm - off) * (radius_mm + off);
                if half2.is_nan() || half2 <= 0.0 {
                    return None;
                }
                (along - half2.sqrt(), along + half2.sqrt())
            }
        };
        (far > near.max(0.0)).then_some((near.max(0.0), far))
    }

    fn contains(&self, at_mm: DVec3) -> bool {
        match *self {
            Self::Box { min_mm, max_mm } => at_mm.cmpge(min_mm).all() && at_mm.cmple(max_mm).all(),
            Self::Ball { center_mm, radius_mm } => at_mm.distance(center_mm) <= radius_mm,
        }
    }

    fn bounds_mm(&self) -> (DVec3, DVec3) {
        match *self {
            Self::Box { min_mm, max_mm } => (min_mm, max_mm),
            Self::Ball { center_mm, radius_mm } => (center_mm - radius_mm, center_mm + radius_mm),
        }
    }
}

/// Interval of a line inside the box from 0 to `size`; may begin before its origin.
pub fn box_interval(origin: DVec3, direction: DVec3, size: DVec3) -> Option<(f64, f64)> {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        if direction[axis].abs() < 1e-12 {
            if !(origin[axis] >= 0.0 && origin[axis] <= size[axis]) {
                return None;
            }
        } else {
            let (a, b) = (-origin[axis] / direction[axis], (size[axis] - origin[axis]) / direction[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
    }
    (far > near).then_some((near, far))
}

/// Homogeneous shapes that don't overlap; all results are exact.
#[derive(Clone, Debug, PartialEq)]
pub struct Shapes(pub Vec<(Shape, Optics)>);

impl Shapes {
    /// One shape.
    pub fn one(shape: Shape, extinction_per_mm: f64, color: DVec3) -> Self {
        Self(vec![(shape, Optics { extinction_per_mm, color })])
    }

    fn crossings(&self, ray: &Ray) -> Vec<(f64, f64, f64)> {
        let mut out: Vec<(f64, f64, f64)> = self
            .0
            .iter()
            .filter_map(|(shape, optics)| {
                shape.interval_mm(ray).map(|(near, far)| (near, far, optics.extinction_per_mm))
            })
            .collect();
        out.sort_by(|a, b| a.0.total_cmp(&b.0));
        out
    }
}

/// The eight corners of an axis-aligned box.
pub fn corners_of(min: DVec3, max: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|i| DVec3::select(glam::BVec3::new(i & 1 == 1, i & 2 == 2, i & 4 == 4), max, min))
}

impl Medium for Shapes {
    fn corners_mm(&self) -> [DVec3; 8] {
        let mut all = self.0.iter().map(|(shape, _)| shape.bounds_mm());
        let first = all.next().unwrap_or_default();
        let (min, max) = all.fold(first, |(min, max), (a, b)| (min.min(a), max.max(b)));
        corners_of(min, max)
    }

    fn optics(&self, at_mm: DVec3) -> Optics {
        self.0.iter().find(|(shape, _)| shape.contains(at_mm)).map(|(_, optics)| *optics).unwrap_or_default()
    }

    fn thickness(&self, ray: &Ray, length_mm: f64) -> f64 {
        self.crossings(ray)
            .into_iter()
            .map(|(near, far, extinction)| thickness_of(extinction, far.min(length_mm) - near))
            .sum()
    }

    fn reach_mm(&self, ray: &Ray, thickness: f64) -> Option<f64> {
        let mut left = thickness;
        for (near, far, extinction) in self.crossings(ray) {
            let here = thickness_of(extinction, far - near);
            if here > 0.0 && here >= left {
                return Some(near + left / extinction);
            }
            left -= here;
        }
        None
    }
}
