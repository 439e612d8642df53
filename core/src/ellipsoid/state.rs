//! Weighted points that may carry an enclosing ellipsoid, and the linear algebra of them that every method needs.

use glam::{DMat3, DVec3};

/// Dimension of the lifted points (p, 1).
pub(super) const N: f64 = 4.0;

/// A symmetric matrix of the lifted points' space.
pub(super) type Matrix = [[f64; 4]; 4];

/// When a method stops.
pub(super) struct StopCriteria {
    /// At this squared scale s.
    pub squared_scale: f64,
    /// When no iteration is left.
    pub iterations_left: usize,
}

/// A point that may still be on the optimum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Index among all points.
    pub id: usize,
    /// Position, whitened by the rough start.
    pub position: DVec3,
    /// Weight.
    pub weight: f64,
    /// Position in the frame where the weighted points have mean 0 and covariance 1.
    pub z: DVec3,
    /// `xᵀ M⁻¹ x`.
    pub g: f64,
}

impl Point {
    /// The lifted point in the frame of `z`.
    pub fn lifted(&self) -> [f64; 4] {
        [self.z.x, self.z.y, self.z.z, 1.0]
    }
}

/// The points that aren't deleted, with their weights.
pub(super) struct State {
    pub points: Vec<Point>,
}

impl State {
    pub fn new(all: &[DVec3]) -> Self {
        let point = |(id, &position)| Point { id, position, weight: 0.0, z: DVec3::ZERO, g: 0.0 };
        Self { points: all.iter().enumerate().map(point).collect() }
    }

    /// Restores deleted points; weights are kept.
    pub fn restore_all(&mut self, all: &[DVec3]) {
        let remaining = std::mem::replace(self, Self::new(all));
        for p in remaining.points {
            self.points[p.id].weight = p.weight;
        }
    }

    pub fn factor(&self) -> Option<(DVec3, DMat3)> {
        factor(self.points.iter().filter(|p| p.weight > 0.0).map(|p| (p.position, p.weight)))
    }

    /// Normalises the weights, recomputes `z` and `g` from them and returns the squared scale s. In the
    /// frame of `z`, M is the identity. `None` when the weighted points are coplanar.
    pub fn refresh(&mut self) -> Option<f64> {
        let total: f64 = self.points.iter().map(|p| p.weight).sum();
        for p in &mut self.points {
            p.weight /= total;
        }
        let (center, shape) = self.factor()?;
        let inverse = lower_inverse(&shape);
        let mut farthest = 0.0_f64;
        for p in &mut self.points {
            p.z = inverse * (p.position - center);
            let squared = p.z.length_squared();
            p.g = 1.0 + squared;
            farthest = farthest.max(squared);
        }
        Some(farthest / 3.0)
    }

    /// Drops points that can't carry weight in any optimum, by their refreshed `g` (Harman, Pronzato 2007,
    /// with `e = max g - n`). Those that carry weight now stay: only the method reduces weights.
    pub fn delete(&mut self, s: f64) {
        let e = (3.0 * s + 1.0 - N).max(0.0);
        let threshold = N * (1.0 + e / 2.0 - (e * (4.0 + e - 4.0 / N)).sqrt() / 2.0);
        // Rounding must not delete a point of the optimum.
        let threshold = threshold - 1e-9;
        self.points.retain(|p| p.weight > 0.0 || p.g >= threshold);
    }
}

/// Mean, and lower Cholesky factor of the covariance, of weighted points of total weight 1. `None`
/// when they are coplanar.
pub(super) fn factor(points: impl Iterator<Item = (DVec3, f64)> + Clone) -> Option<(DVec3, DMat3)> {
    let center: DVec3 = points.clone().map(|(p, u)| p * u).sum();
    let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = [0.0; 6];
    for (p, u) in points {
        let d = p - center;
        xx += u * d.x * d.x;
        xy += u * d.x * d.y;
        xz += u * d.x * d.z;
        yy += u * d.y * d.y;
        yz += u * d.y * d.z;
        zz += u * d.z * d.z;
    }
    let lower = cholesky(DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]))?;
    Some((center, lower))
}

/// Lower factor L of a symmetric matrix, `L Lᵀ`; `None` unless it is positive definite.
pub(super) fn cholesky(m: DMat3) -> Option<DMat3> {
    let root = |v: f64| (v > 0.0 && v.is_finite()).then(|| v.sqrt());
    let a = root(m.x_axis.x)?;
    let (b, c) = (m.x_axis.y / a, m.x_axis.z / a);
    let d = root(m.y_axis.y - b * b)?;
    let e = (m.y_axis.z - b * c) / d;
    let f = root(m.z_axis.z - c * c - e * e)?;
    Some(DMat3::from_cols(DVec3::new(a, b, c), DVec3::new(0.0, d, e), DVec3::new(0.0, 0.0, f)))
}

/// Inverse of a lower triangular matrix without zeros on its diagonal.
pub(super) fn lower_inverse(l: &DMat3) -> DMat3 {
    let (a, b, c) = (1.0 / l.x_axis.x, 1.0 / l.y_axis.y, 1.0 / l.z_axis.z);
    let ba = -l.x_axis.y * a * b;
    let cb = -l.y_axis.z * b * c;
    let ca = -(l.x_axis.z * a + l.y_axis.z * ba) * c;
    DMat3::from_cols(DVec3::new(a, ba, ca), DVec3::new(0.0, b, cb), DVec3::new(0.0, 0.0, c))
}

/// Product of the diagonal: the determinant of a triangular matrix.
pub(super) fn diagonal_product(lower: &DMat3) -> f64 {
    lower.x_axis.x * lower.y_axis.y * lower.z_axis.z
}

/// `m v`.
pub(super) fn times(m: &Matrix, v: &[f64; 4]) -> [f64; 4] {
    std::array::from_fn(|r| dot(&m[r], v))
}

/// Dot product.
pub(super) fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}
