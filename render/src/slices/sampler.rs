//! From a row of pixels to voxels, the same way however the file stores its axes.
//!
//! Voxel axes are first reordered and flipped to run nearest to R, A and S. The place of the first
//! voxel in that order is rounded to at most 2⁻¹³ of the finest spacing (about 0.1 µm for 1 mm):
//! NIfTI affines are `f32`, so flipped copies of one image disagree by up to 10⁻⁵ mm. Voxel
//! coordinates are rounded to 2⁻²⁰ voxel. So one image stored in any of the 48 axis orders goes
//! through the very same arithmetic and gives the same bytes, for less than 10⁻⁴ voxel.

use glam::DVec3;
use glioscope_core::Grid;

use super::view::SliceView;

/// Voxel coordinates are counted in 2⁻²⁰ of a voxel.
const FRACTION_BITS: u32 = 20;
const ONE: i64 = 1 << FRACTION_BITS;

/// The voxels of one grid with its axes reordered to run right, anterior and superior.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sampler {
    dims: [i64; 3],
    /// Steps in memory along the reordered axes; negative where flipped.
    strides: [i64; 3],
    /// Memory place of reordered voxel 0, 0, 0.
    first: i64,
    /// Rows of the reordered voxel-from-world matrix.
    rows: [DVec3; 3],
    /// World place of reordered voxel 0, 0, 0.
    origin_mm: DVec3,
}

/// Where a line of pixels runs, in reordered voxel coordinates.
pub(super) struct Row {
    start: DVec3,
    step: DVec3,
}

/// A place inside the grid: 2⁻²⁰ voxels along each reordered axis.
#[derive(Clone, Copy)]
pub(super) struct Place([i64; 3]);

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

    /// The line of pixels at height `y` of a view.
    pub(super) fn row(&self, view: &SliceView, y: u32) -> Row {
        let world = view.world_at(glam::DVec2::new(0.5, f64::from(y) + 0.5));
        let along = view.right() * view.mm_per_pixel;
        let turned = |v: DVec3| DVec3::from_array(self.rows.map(|row| row.dot(v)));
        Row { start: turned(world - self.origin_mm), step: turned(along) }
    }

    /// The place of pixel `x` of a row; `None` outside the voxels' cells.
    #[inline]
    pub(super) fn place(&self, row: &Row, x: u32) -> Option<Place> {
        let at = row.start + row.step * f64::from(x);
        let mut fixed = [0; 3];
        for axis in 0..3 {
            // Casting cuts towards zero and saturates; the shift by one voxel keeps what can be
            // inside positive. NaN becomes 0 and so lies outside.
            let shifted = ((at[axis] + 1.0) * ONE as f64 + 0.5) as i64;
            if !(shifted >= ONE / 2 && shifted < self.dims[axis] * ONE + ONE / 2) {
                return None;
            }
            fixed[axis] = shifted - ONE;
        }
        Some(Place(fixed))
    }

    /// Memory place of the voxel whose cell holds `place`.
    #[inline]
    pub(super) fn nearest(&self, place: Place) -> usize {
        let cell = |axis: usize| ((place.0[axis] + ONE / 2) >> FRACTION_BITS) * self.strides[axis];
        (self.first + cell(0) + cell(1) + cell(2)) as usize
    }

    /// Trilinear value of `at(memory place)`; past the outermost centres the edge voxels go on.
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
            weight[axis] = (place.0[axis] & (ONE - 1)) as f64 * (1.0 / ONE as f64);
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
