//! Critical points of the force: where it vanishes, and their classification.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::field::Lattice;
use crate::{MaskBits, eigen::symmetric_eigen};

/// Components below this fraction of the cell's largest corner value count as zero: rounding error.
const RELATIVE_ZERO: f64 = 1e-12;

/// Tolerance, in cell lengths, for a zero outside its cell: one on a shared face is found from both sides.
const CELL_TOLERANCE: f64 = 1e-6;

/// Maximum number of boxes that bisection examines in one cell.
const MAX_BOXES: usize = 400;

/// Maximum number of halvings of a cell's edge.
const MAX_DEPTH: u32 = 20;

/// Kind of a critical point, from the signs of the Jacobian's eigenvalues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Attracting,
    Repelling,
    Saddle,
}

#[derive(Clone, Debug)]
pub(super) struct CriticalPoint {
    pub at: DVec3,
    pub kind: Kind,
    /// Unit directions in which the force points away: eigenvectors of positive eigenvalues.
    pub outgoing: Vec<DVec3>,
}

/// The force in one cell: trilinear between its corners.
struct Cell([DVec3; 8]);

impl Cell {
    fn value(&self, u: DVec3) -> DVec3 {
        let v = &self.0;
        let x = |a: usize| v[a].lerp(v[a + 1], u.x);
        x(0).lerp(x(2), u.y).lerp(x(4).lerp(x(6), u.y), u.z)
    }

    /// Derivative of [`Cell::value`], exact.
    fn jacobian(&self, u: DVec3) -> DMat3 {
        let v = &self.0;
        let (w, t) = (DVec3::ONE - u, u);
        let dx = (v[1] - v[0]) * (w.y * w.z)
            + (v[3] - v[2]) * (t.y * w.z)
            + (v[5] - v[4]) * (w.y * t.z)
            + (v[7] - v[6]) * (t.y * t.z);
        let dy = (v[2] - v[0]) * (w.x * w.z)
            + (v[3] - v[1]) * (t.x * w.z)
            + (v[6] - v[4]) * (w.x * t.z)
            + (v[7] - v[5]) * (t.x * t.z);
        let dz = (v[4] - v[0]) * (w.x * w.y)
            + (v[5] - v[1]) * (t.x * w.y)
            + (v[6] - v[2]) * (w.x * t.y)
            + (v[7] - v[3]) * (t.x * t.y);
        DMat3::from_cols(dx, dy, dz)
    }

    fn scale(&self) -> f64 {
        self.0.iter().map(|v| v.abs().max_element()).fold(0.0, f64::max)
    }

    /// Whether every component changes sign (or vanishes) over the corners of a box in the cell: necessary for a zero.
    fn may_vanish(corners: &[DVec3; 8], tolerance: f64) -> bool {
        let (lo, hi) = corners.iter().fold((corners[0], corners[0]), |(lo, hi), &v| (lo.min(v), hi.max(v)));
        lo.max_element() <= tolerance && hi.min_element() >= -tolerance
    }

    /// A zero in the cell: Newton's method from the centre, bisection where that fails.
    fn zero(&self) -> Option<DVec3> {
        let scale = self.scale();
        let tolerance = RELATIVE_ZERO * scale;
        self.newton(DVec3::splat(0.5), scale).or_else(|| self.bisect(scale, tolerance))
    }

    fn newton(&self, mut u: DVec3, scale: f64) -> Option<DVec3> {
        for _ in 0..12 {
            let value = self.value(u);
            let inside = u.min_element() >= -CELL_TOLERANCE && u.max_element() <= 1.0 + CELL_TOLERANCE;
            if value.abs().max_element() <= 1e-12 * scale && inside {
                return Some(u.clamp(DVec3::ZERO, DVec3::ONE));
            }
            let jacobian = self.jacobian(u);
            if jacobian.determinant().abs() <= 1e-12 * scale * scale * scale {
                return None;
            }
            u -= jacobian.inverse() * value;
            if !u.is_finite() || (u - 0.5).abs().max_element() > 1.5 {
                return None;
            }
        }
        None
    }

    fn bisect(&self, scale: f64, tolerance: f64) -> Option<DVec3> {
        let mut boxes = vec![(DVec3::ZERO, 0)];
        for _ in 0..MAX_BOXES {
            let (lo, depth) = boxes.pop()?;
            let size = 0.5_f64.powi(depth as i32);
            let corners = std::array::from_fn(|c| self.value(lo + corner(c) * size));
            if !Self::may_vanish(&corners, tolerance) {
                continue;
            }
            let middle = lo + size * 0.5;
            if depth == MAX_DEPTH {
                return Some(middle);
            }
            if let Some(u) = (depth > 0).then(|| self.newton(middle, scale)).flatten() {
                return Some(u);
            }
            // The first octant is examined first.
            boxes.extend((0..8).rev().map(|c| (lo + corner(c) * (size * 0.5), depth + 1)));
        }
        None
    }
}

fn corner(c: usize) -> DVec3 {
    DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64)
}

/// At most one critical point per cell, in memory order of the cells. Those on shared faces are found more than once;
/// [`distinct`](super::trace::distinct) removes the duplicates.
pub(super) fn critical_points(lattice: &Lattice, cells: &MaskBits, forces: &[DVec3]) -> Vec<CriticalPoint> {
    let per_line = cells.words_per_line();
    let [_, ny, nz] = cells.dims();
    let inverse = lattice.unit_from_node.inverse();
    let lines: Vec<Vec<CriticalPoint>> = (0..ny * nz)
        .into_par_iter()
        .map(|line| {
            let mut found = Vec::new();
            for (w, &word) in cells.words()[line * per_line..][..per_line].iter().enumerate() {
                let mut rest = word;
                while rest != 0 {
                    let at = [w * 64 + rest.trailing_zeros() as usize, line % ny, line / ny];
                    rest &= rest - 1;
                    let cell = cell_at(lattice, forces, at);
                    if !Cell::may_vanish(&cell.0, RELATIVE_ZERO * cell.scale()) {
                        continue;
                    }
                    if let Some(u) = cell.zero() {
                        let base = DVec3::new(at[0] as f64, at[1] as f64, at[2] as f64);
                        found.push(classify(lattice.unit(base + u), cell.jacobian(u) * inverse));
                    }
                }
            }
            found
        })
        .collect();
    lines.concat()
}

fn cell_at(lattice: &Lattice, forces: &[DVec3], [i, j, k]: [usize; 3]) -> Cell {
    let ranks = [[i, j, k], [i, j + 1, k], [i, j, k + 1], [i, j + 1, k + 1]].map(|n| lattice.rank(n));
    Cell(std::array::from_fn(|c| forces[ranks[c / 2] + c % 2]))
}

fn classify(at: DVec3, jacobian: DMat3) -> CriticalPoint {
    // The force is a gradient, so its Jacobian is symmetric: the antisymmetric part is interpolation error.
    let (values, vectors) = symmetric_eigen((jacobian + jacobian.transpose()) * 0.5);
    let outgoing: Vec<DVec3> =
        (0..3).filter(|&i| values[i] > 0.0).map(|i| with_fixed_sign(vectors.col(i))).collect();
    let kind = match outgoing.len() {
        0 => Kind::Attracting,
        3 => Kind::Repelling,
        _ => Kind::Saddle,
    };
    CriticalPoint { at, kind, outgoing }
}

/// The one of ±v whose largest component is positive, so that signs don't depend on rounding.
fn with_fixed_sign(v: DVec3) -> DVec3 {
    let a = v.abs();
    let axis = (1..3).fold(0, |best, i| if a[i] > a[best] * (1.0 + 1e-9) { i } else { best });
    if v[axis] < 0.0 { -v } else { v }
}
