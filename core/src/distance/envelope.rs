//! The separable feature transform: one scan along x, two lower envelopes of parabolas.
//!
//! Felzenszwalb and Huttenlocher, *Distance transforms of sampled functions* (2012), section 2,
//! carrying sites as Maurer, Qi and Raghavan (2003) do. Added here is exactness: rounding is
//! monotone, so the minimum of `((wx·dx² + wy·dy²) + wz·dz²)` in `f64` equals, bit for bit, the
//! minimum of the minima of its partial sums, provided that each line's minimum is exact. Crossings
//! of parabolas are rounded, so every parabola within rounding error of the envelope at a voxel is
//! compared there by its own rounded value.

use rayon::prelude::*;

use super::{Crop, integers::scan_row};
use crate::MaskBits;

/// No site on this line or in this plane.
const NONE: u32 = u32::MAX;

/// Columns processed together, so that strided reads and writes move whole cache lines.
const TILE: usize = 16;

/// Nearest site of each voxel of the crop, as a position `(k·ny + j)·nx + i` in the crop, stored
/// at `(j·nz + k)·nx + i`. `weights` are the squared spacings. The crop contains a site.
pub(super) fn nearest_sites(sites: &MaskBits, crop: Crop, weights: [f64; 3]) -> Vec<u32> {
    let [nx, ny, nz] = crop.dims;
    let mut by_slice = vec![NONE; nx * ny * nz];
    by_slice.par_chunks_mut(nx * ny).enumerate().for_each_init(
        || (Vec::new(), tile()),
        |(scanned, tile), (z, slab)| {
            scanned.clear();
            for y in 0..ny {
                let start = [crop.start[0], crop.start[1] + y, crop.start[2] + z];
                if !scan_row(sites, start, nx, scanned) {
                    scanned.resize((y + 1) * nx, NONE);
                }
            }
            let row = |y: usize| &scanned[y * nx..][..nx];
            let partial = |x, site| square(weights[0], x, site as usize);
            along_rows(slab, nx, nx as u32, weights[1], tile, row, partial);
        },
    );
    let mut by_row = vec![NONE; nx * ny * nz];
    let inverse = 1.0 / nx as f64;
    by_row.par_chunks_mut(nx * nz).enumerate().for_each_init(tile, |tile, (y, plane)| {
        let row = |z: usize| &by_slice[(z * ny + y) * nx..][..nx];
        let stride = (nx * ny) as u32;
        along_rows(plane, nx, stride, weights[2], tile, row, |x, site| {
            // The quotient is at least half a unit of its numerator away from whole numbers.
            let site_y = ((f64::from(site) + 0.5) * inverse) as u32;
            let site_x = site - site_y * nx as u32;
            square(weights[0], x, site_x as usize) + square(weights[1], y, site_y as usize)
        });
    });
    by_row
}

fn tile() -> [Line; TILE] {
    std::array::from_fn(|_| Line::default())
}

/// `weight·(a − b)²`; the square itself is exact.
#[inline]
fn square(weight: f64, a: usize, b: usize) -> f64 {
    let d = a as f64 - b as f64;
    weight * (d * d)
}

/// Writes to each voxel of `plane` (rows of `nx`) the nearest of its column's sites in `row(0)`,
/// `row(1)` and so on, plus `stride` times its row. `partial(x, site)` is the square
/// of the distance within a row. A plane without sites is left unchanged.
fn along_rows<'a>(
    plane: &mut [u32],
    nx: usize,
    stride: u32,
    weight: f64,
    tile: &mut [Line; TILE],
    row: impl Fn(usize) -> &'a [u32],
    partial: impl Fn(usize, u32) -> f64,
) {
    let n = plane.len() / nx;
    let mut nearest = vec![[NONE; TILE]; n];
    for first in (0..nx).step_by(TILE) {
        let tile = &mut tile[..TILE.min(nx - first)];
        for line in tile.iter_mut() {
            line.sites.resize(n, NONE);
            line.partial.resize(n, f64::INFINITY);
        }
        for r in 0..n {
            let row = &row(r)[first..];
            let none = row[0] == NONE;
            for (c, (line, &site)) in tile.iter_mut().zip(row).enumerate() {
                line.sites[r] = if none { NONE } else { site + stride * r as u32 };
                line.partial[r] = if none { f64::INFINITY } else { partial(first + c, site) };
            }
        }
        for (c, line) in tile.iter_mut().enumerate() {
            // A row with a site has one for every column.
            if !line.nearest_rows(weight) {
                return;
            }
            for (nearest, &row) in nearest.iter_mut().zip(&line.best) {
                nearest[c] = line.sites[row];
            }
        }
        for (voxels, nearest) in plane.chunks_exact_mut(nx).zip(&nearest) {
            voxels[first..first + tile.len()].copy_from_slice(&nearest[..tile.len()]);
        }
    }
}

/// Scratch buffers for one line, reused between lines.
#[derive(Default)]
struct Line {
    sites: Vec<u32>,
    /// Height of each row's parabola, infinite where the row has none.
    partial: Vec<f64>,
    /// Rows on the envelope, each with the coordinate from which it is lowest.
    arcs: Vec<(usize, f64)>,
    /// `(voxel, row)`: rows that may be lowest at the voxel because of rounding.
    near_ties: Vec<(usize, usize)>,
    /// Row of the lowest parabola at each voxel.
    best: Vec<usize>,
    /// `1 / (2·weight·d)` for each difference of rows `d`, and that weight.
    inverse: Vec<f64>,
    inverse_for_weight: f64,
}

impl Line {
    /// Fills `best` with the row of the smallest `partial[row] + weight·(voxel − row)²` in `f64`,
    /// the smallest such row on ties. `false` when the line has no parabola.
    fn nearest_rows(&mut self, weight: f64) -> bool {
        let n = self.partial.len();
        if self.inverse_for_weight != weight || self.inverse.len() < n {
            self.inverse_for_weight = weight;
            self.inverse.clear();
            self.inverse.extend((0..n).map(|d| 0.5 / (weight * d as f64)));
        }
        let Self { partial, arcs, near_ties, best, inverse, .. } = self;
        let mut highest = [0.0_f64; 8];
        for heights in partial.chunks(8) {
            for (highest, &f) in highest.iter_mut().zip(heights) {
                *highest = if f > *highest && f < f64::INFINITY { f } else { *highest };
            }
        }
        let highest = highest.into_iter().fold(0.0, f64::max);
        // Both parabolas' values and their crossing each have an error of a few units of roundoff of
        // at most highest + weight·n²; their difference changes by at least 2·weight per voxel.
        let slack = 16.0 * f64::EPSILON * (highest / weight + (n * n) as f64);
        // Voxels within the slack of a crossing, or of the interval between two.
        let between = |from: f64, to: f64| {
            let (from, to) = ((from - slack).ceil().max(0.0), (to + slack).floor());
            if from <= to { from as usize..(to as usize).min(n - 1) + 1 } else { 0..0 }
        };
        arcs.clear();
        near_ties.clear();
        best.clear();
        let reach = (n - 1) as f64 + slack;
        let mut parabolas = (0..n).zip(partial.iter().copied()).filter(|(_, f)| f.is_finite());
        let Some((row, height)) = parabolas.next() else { return false };
        let mut top = (row, height, f64::NEG_INFINITY);
        for (q, height) in parabolas {
            let mut begin;
            loop {
                let (v, v_height, v_begin) = top;
                begin = (height - v_height) * inverse[q - v] + 0.5 * (q + v) as f64;
                if begin > v_begin {
                    break;
                }
                // v is lowest nowhere, except within rounding error from begin to v_begin.
                if v_begin - begin <= 2.0 * slack {
                    near_ties.extend(between(v_begin, begin).map(|p| (p, v)));
                }
                // The first one begins at −∞ and is never popped.
                let Some((v, v_begin)) = arcs.pop() else { break };
                top = (v, partial[v], v_begin);
            }
            // A parabola that begins past the last voxel is lowest nowhere.
            if begin <= reach {
                arcs.push((top.0, top.2));
                top = (q, height, begin);
            }
        }
        arcs.push((top.0, top.2));
        best.resize(n, 0);
        best[0] = arcs[0].0;
        // Adding and subtracting 1.5·2⁵² rounds a crossing to the nearest whole number.
        const ROUND: f64 = 1.5 * (1_u64 << 52) as f64;
        for pair in arcs.windows(2) {
            let [(before, _), (row, begin)] = [pair[0], pair[1]];
            let first = if begin < 0.0 { 0 } else { (begin as usize).saturating_add(1) };
            if let Some(best) = best.get_mut(first) {
                *best = row;
            }
            if (begin - ((begin + ROUND) - ROUND)).abs() <= slack {
                near_ties.extend(between(begin, begin).flat_map(|p| [(p, before), (p, row)]));
            }
        }
        // Rows ascend along the envelope: the lowest one is the largest so far.
        let mut lowest = 0;
        for row in best.iter_mut() {
            lowest = lowest.max(*row);
            *row = lowest;
        }
        let value = |p: usize, q: usize| partial[q] + square(weight, p, q);
        for &(p, q) in near_ties.iter() {
            let (new, old) = (value(p, q), value(p, best[p]));
            if new < old || (new == old && q < best[p]) {
                best[p] = q;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines on which all parabolas meet in one point up to a few units in the last place, as those
    /// of sites on a sphere do at its centre.
    #[test]
    fn near_ties_equal_brute_force() {
        let mut state = 7_u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let mut line = Line::default();
        let mut near_tie_count = 0;
        for trial in 0..4_000 {
            let n = 1 + random() as usize % 40;
            let weight = [1.0, 0.25, 36.0, 2.0 / 3.0, 0.9765625_f64.powi(2), 1e-16, 1e16][trial % 7];
            let center = random() as usize % n;
            let radius = weight * (n * n) as f64 * [1.0, 1.7, 1e3][random() as usize % 3];
            line.partial.clear();
            for q in 0..n {
                let jitter = 1.0 + f64::EPSILON * (random() % 5) as f64;
                let missing = random() % 4 == 0;
                let height = (radius - square(weight, center, q)) * jitter;
                line.partial.push(if missing { f64::INFINITY } else { height });
            }
            let any = line.nearest_rows(weight);
            assert_eq!(any, line.partial.iter().any(|f| f.is_finite()));
            near_tie_count += line.near_ties.len();
            for p in 0..if any { n } else { 0 } {
                let all = (0..n).map(|q| (line.partial[q] + square(weight, p, q), q));
                let truth = all.fold((f64::INFINITY, usize::MAX), |a, b| if b < a { b } else { a });
                let row = line.best[p];
                assert_eq!((line.partial[row] + square(weight, p, row), row), truth, "{trial}: {p} of {n}");
            }
        }
        assert!(near_tie_count > 1_000, "the lines have only {near_tie_count} near ties");
    }
}
