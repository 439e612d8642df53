//! Minimum-volume enclosing ellipsoid of points, to a certified volume.
//!
//! The dual problem gives each point a weight u, at least 0, of sum 1, and looks for the largest
//! determinant of `M = Σ uᵢ xᵢ xᵢᵀ`, `xᵢ = (pᵢ, 1)`. With `gᵢ = xᵢᵀ M⁻¹ xᵢ`, mean c and covariance S
//! of the weights, `gᵢ - 1 = (pᵢ - c)ᵀ S⁻¹ (pᵢ - c)`. The ellipsoid about c that S⁻¹ gives, scaled so
//! that the farthest point is on it, has a squared scale of `max gᵢ - 1 = 3 s`, and any weights bound
//! the optimum from below: volume ≤ s^{3/2} times the minimum (Khachiyan 1996; Todd, Yıldırım 2007).
//! That is the certificate; it holds whatever the method, and at every step.
//!
//! Points are first mapped by the covariance of a rough start, so that even a diagonal line of voxels
//! is of about the same size in every direction: the optimum maps along, and rounding stays small.

use glam::{DMat3, DVec3};

use super::{Method, Options, exchange, steps};

/// Dimension of the lifted points (p, 1).
pub(super) const N: f64 = 4.0;

/// The ellipsoid `{center + shape y : |y| ≤ 1}` about points, lengths as theirs.
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

/// Encloses `points` (finite; repeated ones are fine). All are inside to rounding, about 1e-13 of the
/// size, also when `options.max_iterations` ends the search early: then the bound says how good it is.
///
/// `None` when the points lie in one plane, or nearly: their minimum has no volume.
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
    let mut allowed = Allowance { target: squared_scale(options.tolerance), left: options.max_iterations };
    // Deleted points are on no optimum, but close to it one may look out of the ellipsoid found: then
    // it is taken back. Each round asks for more, so that a few rounds are enough.
    let mut rounds = 0;
    loop {
        match options.method {
            Method::Exchange => exchange::run(&mut state, &mut allowed)?,
            Method::AwaySteps => steps::run(&mut state, &mut allowed, true)?,
            Method::Khachiyan => steps::run(&mut state, &mut allowed, false)?,
        }
        let (center, shape) = state.factor()?;
        let inverse = lower_inverse(&shape);
        let farthest = all.iter().map(|&y| (inverse * (y - center)).length_squared()).fold(3.0, f64::max);
        let s = farthest / 3.0;
        rounds += 1;
        if s <= squared_scale(options.tolerance) || allowed.left == 0 || rounds == 20 {
            return Some(Enclosing {
                center: base + map * center,
                shape: map * shape * farthest.sqrt(),
                volume_bound: s.powf(1.5),
                iterations: options.max_iterations - allowed.left,
            });
        }
        state.take_back(&all);
        allowed.target = 1.0 + (allowed.target - 1.0) * 0.3;
    }
}

/// The squared scale s whose volume is `1 + tolerance`.
fn squared_scale(tolerance: f64) -> f64 {
    1.0 + (tolerance.max(0.0).ln_1p() * (2.0 / 3.0)).exp_m1()
}

/// How far a method may go.
pub(super) struct Allowance {
    /// It stops at this squared scale.
    pub target: f64,
    /// It stops when no iteration is left.
    pub left: usize,
}

/// A point that may still be on the optimum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Which of all points.
    pub id: usize,
    /// Where, mapped by the start.
    pub place: DVec3,
    /// Weight.
    pub weight: f64,
    /// Where, mapped so that the weights have mean 0 and covariance 1.
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

/// Points still in play, with their weights.
pub(super) struct State {
    pub points: Vec<Point>,
}

impl State {
    fn new(all: &[DVec3]) -> Self {
        let point = |(id, &place)| Point { id, place, weight: 0.0, z: DVec3::ZERO, g: 0.0 };
        Self { points: all.iter().enumerate().map(point).collect() }
    }

    /// All points again, weights kept.
    fn take_back(&mut self, all: &[DVec3]) {
        let held = std::mem::replace(self, Self::new(all));
        for p in held.points {
            self.points[p.id].weight = p.weight;
        }
    }

    pub fn factor(&self) -> Option<(DVec3, DMat3)> {
        factor(self.points.iter().filter(|p| p.weight > 0.0).map(|p| (p.place, p.weight)))
    }

    /// Writes `z` and `g` anew from the weights and returns the squared scale s. In this frame M is
    /// the identity.
    pub fn refresh(&mut self) -> Option<f64> {
        let total: f64 = self.points.iter().map(|p| p.weight).sum();
        for p in &mut self.points {
            p.weight /= total;
        }
        let (center, shape) = self.factor()?;
        let inverse = lower_inverse(&shape);
        let mut farthest = 0.0_f64;
        for p in &mut self.points {
            p.z = inverse * (p.place - center);
            let squared = p.z.length_squared();
            p.g = 1.0 + squared;
            farthest = farthest.max(squared);
        }
        Some(farthest / 3.0)
    }

    /// Drops points that can't carry weight in any optimum, from `g` of fresh weights (Harman,
    /// Pronzato 2007, with `e = max g - n`). Those that carry weight now stay: that is the method's to end.
    pub fn delete(&mut self, s: f64) {
        let e = (3.0 * s + 1.0 - N).max(0.0);
        let threshold = N * (1.0 + e / 2.0 - (e * (4.0 + e - 4.0 / N)).sqrt() / 2.0);
        // Rounding must not delete a point of the optimum.
        let threshold = threshold - 1e-9;
        self.points.retain(|p| p.weight > 0.0 || p.g >= threshold);
    }
}

/// Extreme points along three directions, each at right angles to the differences before it (Kumar,
/// Yıldırım 2005): six that span space. `None` when they don't.
fn starting_points(points: &[DVec3]) -> Option<Vec<usize>> {
    let first = *points.first()?;
    let (lo, hi) = points.iter().fold((first, first), |(lo, hi), &p| (lo.min(p), hi.max(p)));
    let size = hi - lo;
    let mut chosen = Vec::with_capacity(6);
    let mut spanned: Vec<DVec3> = Vec::with_capacity(3);
    for _ in 0..3 {
        // The axis with the longest extent once what is spanned is taken out.
        let directions = DMat3::IDENTITY.to_cols_array_2d().map(|axis| without(DVec3::from(axis), &spanned));
        let reach = |d: &DVec3| (d.abs() * size).element_sum();
        let direction = directions
            .into_iter()
            .fold(directions[0], |best, d| if reach(&d) > reach(&best) { d } else { best });
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

/// `v` without its parts along the unit vectors `spanned`, taken out twice for rounding.
fn without(v: DVec3, spanned: &[DVec3]) -> DVec3 {
    let once = |v: DVec3| spanned.iter().fold(v, |v, &s| v - s * v.dot(s));
    once(once(v))
}

/// Mean, and lower Cholesky factor of the covariance, of weighted points of total weight 1. `None`
/// when it has no volume.
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
