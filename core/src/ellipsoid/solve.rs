//! Minimum-volume enclosing ellipsoid of points, with a certified volume bound.
//!
//! The dual problem assigns each point a weight uᵢ ≥ 0, with sum 1, and maximises the determinant of
//! `M = Σ uᵢ xᵢ xᵢᵀ`, `xᵢ = (pᵢ, 1)`. With `gᵢ = xᵢᵀ M⁻¹ xᵢ`, mean c and covariance S of the weighted
//! points, `gᵢ - 1 = (pᵢ - c)ᵀ S⁻¹ (pᵢ - c)`. The ellipsoid about c defined by S⁻¹, scaled so that the
//! farthest point is on it, has a squared scale of `max gᵢ - 1 = 3 s`, and any weights bound the
//! optimum from below: volume ≤ s^{3/2} times the minimum (Khachiyan 1996; Todd, Yıldırım 2007).
//! That is the certificate; it holds for every method, and at every step.
//!
//! Points are first whitened by the covariance of a rough start, so that even a diagonal line of
//! voxels has about the same extent in every direction: the optimum maps with the points, and rounding
//! errors stay small.

use glam::{DMat3, DVec3};

use super::{Method, Options, exchange, steps};

/// Dimension of the lifted points (p, 1).
pub(super) const N: f64 = 4.0;

/// An ellipsoid `{center + shape y : |y| ≤ 1}` that encloses points, in their units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Enclosing {
    /// Its centre.
    pub center: DVec3,
    /// Lower triangular, positive diagonal.
    pub shape: DMat3,
    /// Its volume is at most this times the minimum; at least 1.
    pub volume_bound: f64,
    /// Sweeps of the exchange, or steps of the other methods.
    pub iterations: usize,
}

impl Enclosing {
    /// Its volume, in the points' units.
    pub fn volume(&self) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * diagonal_product(&self.shape)
    }
}

pub(super) fn diagonal_product(lower: &DMat3) -> f64 {
    lower.x_axis.x * lower.y_axis.y * lower.z_axis.z
}

/// Encloses `points` (finite; duplicates allowed). All are inside up to rounding, about 1e-13 of the
/// size, even when `options.max_iterations` ends the search early: `volume_bound` is then larger.
///
/// `None` when the points are coplanar, or nearly: their minimum has no volume.
pub fn enclose(points: &[DVec3], options: &Options) -> Option<Enclosing> {
    let start = starting_points(points)?;
    let sixth = 1.0 / start.len() as f64;
    let (base, map) = factor(start.iter().map(|&i| (points[i], sixth)))?;
    let inverse = lower_inverse(&map);
    let all: Vec<DVec3> = points.iter().map(|&p| inverse * (p - base)).collect();

    let mut state = State::new(&all);
    for &i in &start {
        state.points[i].weight += sixth;
    }
    let mut stop = StopCriteria {
        squared_scale: squared_scale(options.tolerance),
        iterations_left: options.max_iterations,
    };
    // Deleted points are on no optimum, but one may protrude from an ellipsoid close to it: then all
    // points are restored. Each round tightens the target, so that a few rounds are enough.
    let mut rounds = 0;
    loop {
        match options.method {
            Method::Exchange => exchange::run(&mut state, &mut stop)?,
            Method::AwaySteps => steps::run(&mut state, &mut stop, true)?,
            Method::Khachiyan => steps::run(&mut state, &mut stop, false)?,
        }
        let (center, shape) = state.factor()?;
        let inverse = lower_inverse(&shape);
        let farthest = all.iter().map(|&y| (inverse * (y - center)).length_squared()).fold(3.0, f64::max);
        let s = farthest / 3.0;
        rounds += 1;
        if s <= squared_scale(options.tolerance) || stop.iterations_left == 0 || rounds == 20 {
            return Some(Enclosing {
                center: base + map * center,
                shape: map * shape * farthest.sqrt(),
                volume_bound: s.powf(1.5),
                iterations: options.max_iterations - stop.iterations_left,
            });
        }
        state.restore_all(&all);
        stop.squared_scale = 1.0 + (stop.squared_scale - 1.0) * 0.3;
    }
}

/// The squared scale s for which s^{3/2} is `1 + tolerance`.
fn squared_scale(tolerance: f64) -> f64 {
    1.0 + (tolerance.max(0.0).ln_1p() * (2.0 / 3.0)).exp_m1()
}

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
    fn new(all: &[DVec3]) -> Self {
        let point = |(id, &position)| Point { id, position, weight: 0.0, z: DVec3::ZERO, g: 0.0 };
        Self { points: all.iter().enumerate().map(point).collect() }
    }

    /// Restores deleted points; weights are kept.
    fn restore_all(&mut self, all: &[DVec3]) {
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

/// Extreme points along three directions, each orthogonal to the previous differences (Kumar,
/// Yıldırım 2005): six that span space. `None` when they don't.
fn starting_points(points: &[DVec3]) -> Option<Vec<usize>> {
    let first = *points.first()?;
    let (lo, hi) = points.iter().fold((first, first), |(lo, hi), &p| (lo.min(p), hi.max(p)));
    let size = hi - lo;
    let mut chosen = Vec::with_capacity(6);
    let mut spanned: Vec<DVec3> = Vec::with_capacity(3);
    for _ in 0..3 {
        // The axis with the largest extent after the spanned directions are projected out.
        let directions = DMat3::IDENTITY.to_cols_array_2d().map(|axis| without(DVec3::from(axis), &spanned));
        let extent = |d: &DVec3| (d.abs() * size).element_sum();
        let direction = directions
            .into_iter()
            .fold(directions[0], |best, d| if extent(&d) > extent(&best) { d } else { best });
        let along = |i: usize| direction.dot(points[i] - lo);
        let (mut low, mut high) = (0, 0);
        for i in 0..points.len() {
            if along(i) < along(low) {
                low = i;
            }
            if along(i) > along(high) {
                high = i;
            }
        }
        let difference = without(points[high] - points[low], &spanned);
        if difference.length() <= 1e-12 * size.length() {
            return None;
        }
        spanned.push(difference.normalize_or_zero());
        chosen.extend([low, high]);
    }
    Some(chosen)
}

/// `v` without its components along the unit vectors `spanned`, removed twice against rounding.
fn without(v: DVec3, spanned: &[DVec3]) -> DVec3 {
    let once = |v: DVec3| spanned.iter().fold(v, |v, &s| v - s * v.dot(s));
    once(once(v))
}

/// Mean, and lower Cholesky factor of the covariance, of weighted points of total weight 1. `None`
/// when they are coplanar.
fn factor(points: impl Iterator<Item = (DVec3, f64)> + Clone) -> Option<(DVec3, DMat3)> {
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
fn lower_inverse(l: &DMat3) -> DMat3 {
    let (a, b, c) = (1.0 / l.x_axis.x, 1.0 / l.y_axis.y, 1.0 / l.z_axis.z);
    let ba = -l.x_axis.y * a * b;
    let cb = -l.y_axis.z * b * c;
    let ca = -(l.x_axis.z * a + l.y_axis.z * ba) * c;
    DMat3::from_cols(DVec3::new(a, ba, ca), DVec3::new(0.0, b, cb), DVec3::new(0.0, 0.0, c))
}
