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

use super::{
    Method, Options, exchange,
    state::{State, StopCriteria, diagonal_product, factor, lower_inverse},
    steps,
};

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
