//! Solids with closed forms: whether a point is inside, and where a ray enters.

use glam::{DMat3, DVec3};

use super::sheet::Sheet;
use crate::optics::Ray;

/// A solid, millimetres.
#[derive(Clone, Debug)]
pub(super) enum Solid {
    /// Everything within a radius of a stretch of a line.
    Capsule {
        /// One end.
        from: DVec3,
        /// The other, elsewhere.
        to: DVec3,
        /// The radius.
        radius_mm: f64,
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Its centre.
        center: DVec3,
        /// Its axes, orthonormal columns.
        axes: DMat3,
        /// Its semi-axes along them.
        radii_mm: DVec3,
    },
    /// A sheet with hills and valleys.
    Sheet(Sheet),
}

/// Distance along the ray to the ball's near side; `None` where the ray misses it.
fn enter_ball(ray: &Ray, center: DVec3, radius: f64) -> Option<f64> {
    let to = ray.origin_mm - center;
    let b = to.dot(ray.direction);
    let discriminant = b * b - to.length_squared() + radius * radius;
    (discriminant > 0.0).then(|| -b - discriminant.sqrt())
}

impl Solid {
    /// Volume, mm³; infinite for a sheet, which is no structure to be compared.
    pub fn volume_mm3(&self) -> f64 {
        let pi = std::f64::consts::PI;
        match self {
            Self::Capsule { from, to, radius_mm: r } => pi * r * r * (from.distance(*to) + 4.0 / 3.0 * r),
            Self::Ellipsoid { radii_mm, .. } => 4.0 / 3.0 * pi * radii_mm.element_product(),
            Self::Sheet(_) => f64::INFINITY,
        }
    }

    /// A ball that contains it.
    pub fn ball(&self) -> (DVec3, f64) {
        match self {
            Self::Capsule { from, to, radius_mm } => {
                ((*from + *to) / 2.0, from.distance(*to) / 2.0 + radius_mm)
            }
            Self::Ellipsoid { center, radii_mm, .. } => (*center, radii_mm.max_element()),
            Self::Sheet(sheet) => sheet.ball(),
        }
    }

    pub fn contains(&self, point: DVec3) -> bool {
        match self {
            Self::Capsule { from, to, radius_mm } => {
                let along = *to - *from;
                let share = ((point - *from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                point.distance_squared(*from + along * share) <= radius_mm * radius_mm
            }
            Self::Ellipsoid { center, axes, radii_mm } => {
                (axes.transpose() * (point - *center) / *radii_mm).length_squared() <= 1.0
            }
            Self::Sheet(sheet) => sheet.contains(point),
        }
    }

    /// Distance along the ray at which it enters; `None` where it misses, or may be only behind `limit`. The ray starts outside.
    pub fn enter(&self, ray: &Ray, limit: f64) -> Option<f64> {
        match self {
            Self::Capsule { from, to, radius_mm: radius } => {
                let (along, start) = (*to - *from, ray.origin_mm - *from);
                let (length2, slant, at) =
                    (along.length_squared(), along.dot(ray.direction), along.dot(start));
                let a = length2 - slant * slant;
                let b = length2 * ray.direction.dot(start) - at * slant;
                let c = length2 * (start.length_squared() - radius * radius) - at * at;
                let discriminant = b * b - a * c;
                if a > 1e-9 * length2 && discriminant >= 0.0 {
                    let t = (-b - discriminant.sqrt()) / a;
                    if (0.0..=length2).contains(&(at + t * slant)) {
                        return Some(t);
                    }
                }
                let ends = [from, to].into_iter().filter_map(|end| enter_ball(ray, *end, *radius));
                ends.min_by(f64::total_cmp)
            }
            Self::Ellipsoid { center, axes, radii_mm } => {
                let origin = axes.transpose() * (ray.origin_mm - *center) / *radii_mm;
                let direction = axes.transpose() * ray.direction / *radii_mm;
                let (a, b) = (direction.length_squared(), direction.dot(origin));
                let discriminant = b * b - a * (origin.length_squared() - 1.0);
                (discriminant > 0.0).then(|| (-b - discriminant.sqrt()) / a)
            }
            Self::Sheet(sheet) => sheet.enter(ray, limit),
        }
    }
}
