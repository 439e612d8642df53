//! The light grid of a context image: its cells, and which of them a frame can sample.

use glam::DVec3;
use glioscope_core::{Grid, RegionVolume, grid::ijk};

/// Maximum number of cells.
const MOST_CELLS: usize = 1 << 26;

/// The shape of a light grid.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cells {
    /// Cells along each axis.
    pub dims: [usize; 3],
    /// Voxels along a cell's sides.
    pub voxels: [usize; 3],
}

impl Cells {
    /// Cells about `side_mm` long, of whole voxels, at least one; longer if there would be too many cells.
    pub fn new(grid: &Grid, side_mm: f64) -> Self {
        Self::at_most(grid, side_mm, MOST_CELLS)
    }

    /// The same, of at most so many cells.
    pub fn at_most(grid: &Grid, side_mm: f64, most: usize) -> Self {
        let spacing = grid.spacing_mm();
        let dims = grid.dims();
        let mut side_mm = if side_mm.is_finite() { side_mm.max(0.0) } else { 0.0 };
        loop {
            let voxels: [usize; 3] =
                std::array::from_fn(|a| ((side_mm / spacing[a]).round() as usize).clamp(1, dims[a].max(1)));
            let cells = std::array::from_fn(|a| dims[a].div_ceil(voxels[a]));
            if cells.iter().product::<usize>() <= most || voxels == dims {
                return Self { dims: cells, voxels };
            }
            side_mm = (1.3 * side_mm).max(spacing.min_element());
        }
    }

    /// Total number of cells.
    pub fn count(&self) -> usize {
        self.dims.iter().product()
    }

    /// Where a cell's surroundings are looked for, in voxels: in its middle, for the outermost cells on the image's faces. Light is
    /// interpolated between cells and constant from the outermost middles outwards, so that tissue which the image ends in, as CT
    /// and MR of a part of the body do, would be as dark on its face as half a cell below it.
    pub fn place(&self, grid: &Grid, n: usize) -> DVec3 {
        let (p, dims) = (ijk(self.dims, n), grid.dims());
        DVec3::from_array(std::array::from_fn(|a| {
            let last = self.dims[a].saturating_sub(1);
            match p[a] {
                0 if last > 0 => -0.5,
                at if at == last && last > 0 => dims[a] as f64 - 0.5,
                at => (at as f64 + 0.5) * self.voxels[a] as f64 - 0.5,
            }
        }))
    }

    /// Marks the cells that are sampled anywhere between these voxels (first and last centre along each
    /// axis, which may lie outside the image).
    fn mark(&self, marks: &mut [bool], first: [f64; 3], last: [f64; 3]) {
        let span = |a: usize| {
            // Light is interpolated between the centres of cells.
            let at = |voxel: f64| (voxel + 0.5) / self.voxels[a] as f64 - 0.5;
            let most = self.dims[a] as f64 - 1.0;
            (at(first[a]).floor().clamp(0.0, most) as usize)..=(at(last[a]).ceil().clamp(0.0, most) as usize)
        };
        for z in span(2) {
            for y in span(1) {
                for x in span(0) {
                    if let Some(mark) = marks.get_mut((z * self.dims[1] + y) * self.dims[0] + x) {
                        *mark = true;
                    }
                }
            }
        }
    }

    /// Numbers of the cells that a frame can sample: around the visible bricks (of `brick` voxels per side,
    /// between voxel centres), and around the masks.
    pub fn needed(
        &self,
        grid: &Grid,
        brick: usize,
        brick_dims: [usize; 3],
        visible: &[u32],
        tumor: Option<&RegionVolume>,
    ) -> Vec<u32> {
        let mut marks = vec![false; self.count()];
        for b in 0..brick_dims.iter().product::<usize>() {
            if visible.get(b / 32).is_some_and(|word| word >> (b % 32) & 1 == 1) {
                let at =
                    [b % brick_dims[0], b / brick_dims[0] % brick_dims[1], b / brick_dims[0] / brick_dims[1]];
                // Half a voxel more at the image's edge.
                let first = at.map(|a| (a * brick) as f64 - 0.5);
                self.mark(&mut marks, first, first.map(|f| f + brick as f64 + 1.0));
            }
        }
        if let Some(tumor) = tumor {
            let corners = tumor.grid().corners_mm().map(|c| grid.voxel_from_world().transform_point3(c));
            let low = corners.iter().fold(DVec3::INFINITY, |a, c| a.min(*c));
            let high = corners.iter().fold(DVec3::NEG_INFINITY, |a, c| a.max(*c));
            self.mark(&mut marks, low.to_array(), high.to_array());
        }
        (0..).zip(marks).filter_map(|(number, on)| on.then_some(number)).collect()
    }
}
