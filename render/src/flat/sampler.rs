//! Maps rows of pixels to voxels, independently of the file's axis order.
//!
//! Voxel axes are first reordered and flipped to run nearest to R, A and S. The position of the first
//! voxel in that order is rounded to at most 2⁻¹³ of the finest spacing (about 0.1 µm for 1 mm):
//! NIfTI affines are `f32`, so flipped copies of one image disagree by up to 10⁻⁵ mm. Voxel
//! coordinates are rounded to 2⁻²⁰ voxel. So one image stored in any of the 48 axis orders goes through
//! identical arithmetic and gives identical bytes, at the cost of less than 10⁻⁴ voxel.

use std::ops::Range;

use glam::{DVec2, DVec3};
use glioscope_core::Grid;
use rayon::prelude::*;

use crate::flat::view::SliceView;

/// Along a row, voxel coordinates are integers in units of 2⁻³² voxel, which add up exactly.
const FRACTION_BITS: u32 = 32;
const ONE: i64 = 1 << FRACTION_BITS;
/// Interpolation weights have 20 bits.
const WEIGHT_BITS: u32 = 20;
/// Coordinates beyond this many voxels are outside every image that fits in memory.
const FARTHEST: f64 = (1u64 << 28) as f64;

/// A grid's voxels with axes reordered to run right, anterior and superior.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sampler {
    dims: [i64; 3],
    /// Steps in memory along the reordered axes; negative where flipped.
    strides: [i64; 3],
    /// Linear index of reordered voxel 0, 0, 0.
    first: i64,
    /// Rows of the reordered voxel-from-world matrix.
    rows: [DVec3; 3],
    /// World position of reordered voxel 0, 0, 0.
    origin_mm: DVec3,
}

/// A row of pixels inside the grid.
pub(super) struct Row {
    /// Pixels that are inside.
    pub(super) span: Range<usize>,
    start: [i64; 3],
    step: [i64; 3],
}

/// A position inside the grid: units of 2⁻³² voxel along each reordered axis.
#[derive(Clone, Copy)]
pub(super) struct Place([i64; 3]);

impl Row {
    /// Position of pixel `x`; inside the grid if `x` is in the span.
    #[inline]
    pub(super) fn place(&self, x: usize) -> Place {
        let x = x as i64;
        Place(std::array::from_fn(|axis| self.start[axis] + self.step[axis] * x))
    }
}

impl Sampler {
    pub(super) fn new(grid: &Grid) -> Self {
        let codes = grid.axis_codes();
        let dims = grid.dims().map(|d| d as i64);
        let native_strides = [1, dims[0], dims[0] * dims[1]];
        let inverse = grid.voxel_from_world().matrix3;
        let native_rows = [0, 1, 2].map(|a| inverse.row(a));
        let mut sampler =
            Self { dims, strides: native_strides, first: 0, rows: native_rows, origin_mm: DVec3::ZERO };
        let mut first = [0; 3];
        for (axis, [negative, positive]) in [['L', 'R'], ['P', 'A'], ['I', 'S']].into_iter().enumerate() {
            let from = codes.iter().position(|&c| c == negative || c == positive).unwrap_or(axis);
            let flipped = codes[from] == negative;
            first[from] = if flipped { grid.dims()[from] - 1 } else { 0 };
            sampler.dims[axis] = dims[from];
            sampler.strides[axis] = if flipped { -native_strides[from] } else { native_strides[from] };
            sampler.rows[axis] = if flipped { -native_rows[from] } else { native_rows[from] };
        }
        sampler.first = grid.linear(first) as i64;
        let quantum = (grid.spacing_mm().min_element().log2().floor() - 13.0).exp2();
        sampler.origin_mm = (grid.center_of_voxel_mm(first) / quantum).round() * quantum;
        sampler
    }

    /// The pixel row `y` of a view.
    pub(super) fn row(&self, view: &SliceView, y: u32) -> Row {
        let world = view.world_at(DVec2::new(0.5, f64::from(y) + 0.5));
        let along = view.right() * view.mm_per_pixel;
        let in_voxels = |v: DVec3| self.rows.map(|row| row.dot(v));
        let (start, step) = (in_voxels(world - self.origin_mm), in_voxels(along));
        let width = f64::from(view.size_px[0]);
        // NaN fails this too.
        let near = (0..3).all(|a| start[a].abs() < FARTHEST && (start[a] + step[a] * width).abs() < FARTHEST);
        if !near {
            return Row { span: 0..0, start: [0; 3], step: [0; 3] };
        }
        // Half a weight unit is added, so that truncation rounds.
        let fixed = |v: f64| (v * ONE as f64).round() as i64;
        let start = start.map(|v| fixed(v) + (1 << (FRACTION_BITS - WEIGHT_BITS - 1)));
        let step = step.map(fixed);
        let mut span = 0..i64::from(view.size_px[0]);
        for axis in 0..3 {
            let inside = inside_span(start[axis], step[axis], -ONE / 2, self.dims[axis] * ONE - ONE / 2);
            span = span.start.max(inside.start)..span.end.min(inside.end);
        }
        let span = if span.is_empty() { 0..0 } else { span.start as usize..span.end as usize };
        Row { span, start, step }
    }

    /// Linear index of the voxel whose cell contains `place`.
    #[inline]
    pub(super) fn nearest(&self, place: Place) -> usize {
        let cell = |axis: usize| ((place.0[axis] + ONE / 2) >> FRACTION_BITS) * self.strides[axis];
        (self.first + cell(0) + cell(1) + cell(2)) as usize
    }

    /// Trilinear interpolation of `at(linear index)`; beyond the outermost centres the edge voxels extend.
    #[inline]
    pub(super) fn trilinear(&self, place: Place, at: impl Fn(usize) -> f64) -> f64 {
        let mut lower = [0; 3];
        let mut step = [0; 3];
        let mut weight = [0.0; 3];
        for axis in 0..3 {
            let base = place.0[axis] >> FRACTION_BITS;
            let first = base.max(0);
            lower[axis] = first * self.strides[axis];
            step[axis] = ((base + 1).min(self.dims[axis] - 1) - first) * self.strides[axis];
            let fraction = (place.0[axis] & (ONE - 1)) >> (FRACTION_BITS - WEIGHT_BITS);
            weight[axis] = fraction as f64 * (1.0 / f64::from(1 << WEIGHT_BITS));
        }
        let corner = self.first + lower[0] + lower[1] + lower[2];
        let line = |offset: i64| {
            let a = at((corner + offset) as usize);
            let b = at((corner + offset + step[0]) as usize);
            a + (b - a) * weight[0]
        };
        let sheet = |offset: i64| {
            let (a, b) = (line(offset), line(offset + step[1]));
            a + (b - a) * weight[1]
        };
        let (a, b) = (sheet(0), sheet(step[2]));
        a + (b - a) * weight[2]
    }
}

/// The integers x with `low <= start + step·x < high`.
fn inside_span(start: i64, step: i64, low: i64, high: i64) -> Range<i64> {
    let above = |numerator: i64, step: i64| -(-numerator).div_euclid(step);
    match step {
        0 if (low..high).contains(&start) => i64::MIN..i64::MAX,
        0 => 0..0,
        1.. => above(low - start, step)..above(high - start, step),
        _ => (start - high).div_euclid(-step) + 1..(start - low).div_euclid(-step) + 1,
    }
}

/// Interpolated stored value. Next to a voxel that isn't finite, the nearest voxel's value; `None` where
/// that one isn't finite.
#[inline]
pub(super) fn value_at(sampler: &Sampler, place: Place, at: &impl Fn(usize) -> f64) -> Option<f64> {
    let value = sampler.trilinear(place, at);
    if value.is_finite() {
        return Some(value);
    }
    Some(at(sampler.nearest(place))).filter(|v| v.is_finite())
}

/// The rows of a picture of a view, in parallel.
pub(super) fn rows_of<'a>(
    rgba: &'a mut [u8],
    view: &SliceView,
) -> impl IndexedParallelIterator<Item = (u32, &'a mut [u8])> + use<'a> {
    let width = view.size_px[0] as usize;
    (0..view.size_px[1]).into_par_iter().zip(rgba.par_chunks_exact_mut(width * 4))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_match_testing_each_number() {
        for step in [-7, -3, -1, 0, 1, 2, 5] {
            for start in -40..40 {
                let span = inside_span(start, step, -11, 17);
                for x in -60..60 {
                    let expected = (-11..17).contains(&(start + step * x));
                    assert_eq!(span.contains(&x), expected, "{start} + {step}·{x}");
                }
            }
        }
    }
}
