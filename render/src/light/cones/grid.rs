//! The light grid of a context image: its cells, and which of them a frame can sample.

use glam::DVec3;
use glioscope_core::{Grid, RegionVolume, grid::ijk};

/// Maximum number of cells.
const MOST_CELLS: usize = 1 << 26;

/// The shape of a light grid.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cells {
    /// Cells along each axis, those outside the image included.
    pub dims: [usize; 3],
    /// Voxels along a cell's sides.
    pub voxels: DVec3,
    /// Cells outside each face of the image.
    pub ring: usize,
}

impl Cells {
    /// Cells about `side_mm` long, at least a voxel, that fill the image exactly; longer if there would be too many. A ring of cells
    /// lies outside of it: light is interpolated between middles, so that tissue which the image ends in, as CT and MR of a part of
    /// the body do, would otherwise be as dark on its face as half a cell below it.
    pub fn new(grid: &Grid, side_mm: f64) -> Self {
        let dims = grid.dims();
        let sides = |side_mm: f64| -> Self {
            let inside: [usize; 3] = std::array::from_fn(|a| {
                let count = (dims[a] as f64 * grid.spacing_mm()[a] / side_mm).round();
                (count as usize).clamp(1, dims[a].max(1))
            });
            let voxels = DVec3::from_array(std::array::from_fn(|a| dims[a] as f64 / inside[a] as f64));
            Self { dims: inside.map(|count| count + 2), voxels, ring: 1 }
        };
        longer_until(grid, side_mm, sides, |cells| cells.count() <= MOST_CELLS)
    }

    /// Cells of whole voxels, at least one, of which the last ones may reach past the image, and none outside; at most so many.
    pub fn of_whole_voxels(grid: &Grid, side_mm: f64, most: usize) -> Self {
        let (spacing, dims) = (grid.spacing_mm(), grid.dims());
        let sides = |side_mm: f64| -> Self {
            let voxels: [usize; 3] =
                std::array::from_fn(|a| ((side_mm / spacing[a]).round() as usize).clamp(1, dims[a].max(1)));
            let dims = std::array::from_fn(|a| dims[a].div_ceil(voxels[a]));
            Self { dims, voxels: DVec3::from_array(voxels.map(|v| v as f64)), ring: 0 }
        };
        longer_until(grid, side_mm, sides, |cells| cells.count() <= most)
    }

    /// Total number of cells.
    pub fn count(&self) -> usize {
        self.dims.iter().product()
    }

    /// A cell's middle, voxels, 0 in the middle of the first.
    pub fn middle(&self, n: usize) -> DVec3 {
        let p = DVec3::from_array(ijk(self.dims, n).map(|c| c as f64));
        (p + 0.5 - self.ring as f64) * self.voxels - 0.5
    }

    /// The middle in whose stead a cell's light from a direction of the world is looked for: `middle_for` of lib/light_cell.
    #[cfg(test)]
    pub fn middle_for(&self, grid: &Grid, n: usize, from: DVec3) -> DVec3 {
        let d = grid.voxel_from_world().transform_vector3(from);
        let least = 1e-3 * d.abs().max_element();
        let mut p = ijk(self.dims, n);
        for a in 0..3 {
            let low = if d[a] < -least { 0 } else { self.ring };
            let high = self.dims[a] - 1 - if d[a] > least { 0 } else { self.ring };
            p[a] = p[a].clamp(low, high);
        }
        self.middle((p[2] * self.dims[1] + p[1]) * self.dims[0] + p[0])
    }

    /// Where the surroundings of a cell without a ring outside are looked for, in voxels: in its middle, for the outermost cells on
    /// the image's faces.
    pub fn place(&self, grid: &Grid, n: usize) -> DVec3 {
        let (p, dims, middle) = (ijk(self.dims, n), grid.dims(), self.middle(n));
        DVec3::from_array(std::array::from_fn(|a| {
            let last = self.dims[a].saturating_sub(1);
            match p[a] {
                0 if last > 0 => -0.5,
                at if at == last && last > 0 => dims[a] as f64 - 0.5,
                _ => middle[a],
            }
        }))
    }

    /// Marks the cells that are sampled anywhere between these voxels (first and last centre along each
    /// axis, which may lie outside the image).
    fn mark(&self, marks: &mut [bool], first: [f64; 3], last: [f64; 3]) {
        let span = |a: usize| {
            // Light is interpolated between the centres of cells.
            let at = |voxel: f64| (voxel + 0.5) / self.voxels[a] - 0.5 + self.ring as f64;
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

/// The shape that `sides` gives for the first side, of ever longer ones, whose cells are few enough, or that can't have fewer.
fn longer_until(
    grid: &Grid,
    side_mm: f64,
    sides: impl Fn(f64) -> Cells,
    are_few: impl Fn(&Cells) -> bool,
) -> Cells {
    let spacing_mm = grid.spacing_mm().min_element();
    let coarsest = grid.dims().iter().max().map_or(1.0, |&n| n as f64) * grid.spacing_mm().max_element();
    let mut side_mm = if side_mm.is_finite() { side_mm.max(0.0) } else { 0.0 };
    loop {
        let cells = sides(side_mm);
        if are_few(&cells) || side_mm > coarsest {
            return cells;
        }
        side_mm = (1.3 * side_mm).max(spacing_mm);
    }
}
