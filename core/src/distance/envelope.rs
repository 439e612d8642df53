//! The separable feature transform: one scan along x, two lower envelopes of parabolas.
//!
//! Felzenszwalb and Huttenlocher, *Distance transforms of sampled functions* (2012), section 2,
//! carrying sites as Maurer, Qi and Raghavan (2003) do. What is added is exactness: rounding is
//! monotone, so the minimum of `((wx·dx² + wy·dy²) + wz·dz²)` in `f64` is the minimum of the
//! minima of its partial sums, bit for bit, if each line's minimum is. Crossings of parabolas are
//! rounded, so every parabola that comes within the rounding of the envelope at a voxel is
//! compared there by its own rounded value.

use rayon::prelude::*;

use super::Crop;
use crate::MaskBits;

/// No site on this line or in this plane.
const NONE: u32 = u32::MAX;

/// Nearest site of each voxel of the crop, as a position `(k·ny + j)·nx + i` in the crop, stored
/// at `(j·nz + k)·nx + i`. `weights` are the squared spacings. The crop holds a site.
pub(super) fn nearest_sites(sites: &MaskBits, crop: Crop, weights: [f64; 3]) -> Vec<u32> {
    let [nx, ny, nz] = crop.dims;
    let mut by_slice = vec![NONE; nx * ny * nz];
    by_slice.par_chunks_mut(nx * ny).enumerate().for_each_init(Line::default, |line, (z, slab)| {
        for (y, row) in slab.chunks_exact_mut(nx).enumerate() {
            scan_row(sites, [crop.start[0], crop.start[1] + y, crop.start[2] + z], row);
        }
        along_rows(slab, nx, nx as u32, weights[1], line, |x, site| square(weights[0], x, site as usize));
    });
    // Third pass on planes of constant y: a copy in that order needs no strided writes.
    let mut by_row = vec![NONE; nx * ny * nz];
    by_row.par_chunks_mut(nx * nz).enumerate().for_each_init(Line::default, |line, (y, plane)| {
        for (z, row) in plane.chunks_exact_mut(nx).enumerate() {
            let from = (z * ny + y) * nx;
            row.copy_from_slice(&by_slice[from..from + nx]);
        }
        let stride = (nx * ny) as u32;
        along_rows(plane, nx, stride, weights[2], line, |x, site| {
            let (site_x, site_y) = (site % nx as u32, site / nx as u32);
            square(weights[0], x, site_x as usize) + square(weights[1], y, site_y as usize)
        });
    });
    by_row
}

/// `weight·(a − b)²`; the square itself is exact.
#[inline]
fn square(weight: f64, a: usize, b: usize) -> f64 {
    let d = a as f64 - b as f64;
    weight * (d * d)
}

/// Writes the nearest site's x, the smaller of two equally near, to each voxel of `row`.
fn scan_row(sites: &MaskBits, start: [usize; 3], row: &mut [u32]) {
    let mut before = NONE;
    for (x, nearest) in row.iter_mut().enumerate() {
        if sites.get([start[0] + x, start[1], start[2]]) {
            before = x as u32;
        }
        *nearest = before;
    }
    let mut after = NONE;
    for (x, nearest) in row.iter_mut().enumerate().rev() {
        let x = x as u32;
        if *nearest == x {
            after = x;
        } else if after != NONE && (*nearest == NONE || after - x < x - *nearest) {
            *nearest = after;
        }
    }
}

/// Replaces each site in `plane` (rows of `nx`) by the nearest among its column's, plus `stride`
/// times the row that one came from. `partial(x, site)` is the square of the distance within a row.
fn along_rows(
    plane: &mut [u32],
    nx: usize,
    stride: u32,
    weight: f64,
    line: &mut Line,
    partial: impl Fn(usize, u32) -> f64,
) {
    for x in 0..nx {
        let column = plane[x..].iter().step_by(nx).copied();
        line.sites.clear();
        line.sites.extend(column);
        line.partial.clear();
        line.partial
            .extend(line.sites.iter().map(|&s| if s == NONE { f64::INFINITY } else { partial(x, s) }));
        if !line.nearest_rows(weight) {
            continue;
        }
        for (voxel, &row) in plane[x..].iter_mut().step_by(nx).zip(&line.best) {
            *voxel = line.sites[row] + stride * row as u32;
        }
    }
}

/// One line's work, kept between lines.
#[derive(Default)]
struct Line {
    sites: Vec<u32>,
    /// Height of each row's parabola, infinite where the row has none.
    partial: Vec<f64>,
    /// Rows on the envelope and where each begins to be lowest.
    rows: Vec<usize>,
    begins: Vec<f64>,
    /// `(voxel, row)`: rows taken off the envelope that rounding may yet make lowest there.
    near: Vec<(usize, usize)>,
    /// Row of the lowest parabola at each voxel.
    best: Vec<usize>,
}

impl Line {
    /// Fills `best` with the row of the smallest `partial[row] + weight·(voxel − row)²` in `f64`,
    /// of equal ones the smallest row. `false` when the line has no parabola.
    fn nearest_rows(&mut self, weight: f64) -> bool {
        let Self { partial, rows, begins, near, best, .. } = self;
        let n = partial.len();
        let highest = partial.iter().filter(|f| f.is_finite()).fold(0.0_f64, |a, &f| a.max(f));
        // Both parabolas' values and their crossing are each wrong by a few units of roundoff of
        // at most highest + weight·n²; neighbours differ by at least 2·weight a voxel.
        let slack = 16.0 * f64::EPSILON * (highest / weight + (n * n) as f64);
        rows.clear();
        begins.clear();
        near.clear();
        best.clear();
        for q in (0..n).filter(|&q| partial[q].is_finite()) {
            let mut begin = f64::NEG_INFINITY;
            while let (Some(&v), Some(&v_begin)) = (rows.last(), begins.last()) {
                begin = 0.5 * ((partial[q] - partial[v]) / (weight * (q - v) as f64) + (q + v) as f64);
                if begin > v_begin {
                    break;
                }
                // v is lowest nowhere, but within the rounding from v_begin back to begin.
                let (from, to) = ((v_begin - slack).ceil().max(0.0), (begin + slack).floor());
                if from <= to {
                    near.extend((from as usize..=(to as usize).min(n - 1)).map(|p| (p, v)));
                }
                rows.pop();
                begins.pop();
            }
            rows.push(q);
            begins.push(begin);
        }
        if rows.is_empty() {
            return false;
        }
        let value = |p: usize, q: usize| partial[q] + square(weight, p, q);
        let lower = |p: usize, a: usize, b: usize| {
            let (va, vb) = (value(p, a), value(p, b));
            if va < vb || (va == vb && a < b) { a } else { b }
        };
        let mut k = 0;
        for p in 0..n {
            let at = p as f64;
            while k + 1 < rows.len() && begins[k + 1] < at {
                k += 1;
            }
            let mut lowest = rows[k];
            let mut left = k;
            while left > 0 && at - begins[left] <= slack {
                left -= 1;
                lowest = lower(p, rows[left], lowest);
            }
            let mut right = k + 1;
            while right < rows.len() && begins[right] - at <= slack {
                lowest = lower(p, lowest, rows[right]);
                right += 1;
            }
            best.push(lowest);
        }
        for &(p, q) in near.iter() {
            best[p] = lower(p, q, best[p]);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines on which all parabolas meet in one point, give or take a few units in the last place:
    /// a site's neighbours on a sphere seen from its middle.
    #[test]
    fn near_ties_are_settled_as_trying_all_rows_does() {
        let mut state = 7_u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let mut line = Line::default();
        let mut near = 0;
        for trial in 0..4_000 {
            let n = 1 + random() as usize % 40;
            let weight = [1.0, 0.25, 36.0, 2.0 / 3.0, 0.9765625_f64.powi(2), 1e-16, 1e16][trial % 7];
            let middle = random() as usize % n;
            let radius = weight * (n * n) as f64 * [1.0, 1.7, 1e3][random() as usize % 3];
            line.partial.clear();
            for q in 0..n {
                let jitter = 1.0 + f64::EPSILON * (random() % 5) as f64;
                let missing = random() % 4 == 0;
                let height = (radius - square(weight, middle, q)) * jitter;
                line.partial.push(if missing { f64::INFINITY } else { height });
            }
            let any = line.nearest_rows(weight);
            assert_eq!(any, line.partial.iter().any(|f| f.is_finite()));
            near += line.near.len();
            for p in 0..if any { n } else { 0 } {
                let all = (0..n).map(|q| (line.partial[q] + square(weight, p, q), q));
                let truth = all.fold((f64::INFINITY, usize::MAX), |a, b| if b < a { b } else { a });
                let row = line.best[p];
                assert_eq!((line.partial[row] + square(weight, p, row), row), truth, "{trial}: {p} of {n}");
            }
        }
        assert!(near > 1_000, "the lines made only {near} near ties");
    }
}
