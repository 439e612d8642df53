//! In which order light is carried through the cells of an image. Pure: no device is touched.

use glam::DVec3;
use glioscope_core::Grid;

use crate::light::cones::grid::Cells;

/// Most samples of the image on the way from a slice to the next.
const MOST_SAMPLES: f64 = 64.0;

/// A sweep of light through the slices of cells along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sweep {
    /// Of the image's grid.
    pub axis: usize,
    /// Whether light meets slices by rising number.
    pub rises: bool,
    /// From a cell back to where its light crosses the slice before: cells along each axis, exactly one along `axis`.
    pub shift: DVec3,
    /// The same way in millimetres.
    pub segment_mm: f64,
}

/// The sweep of light that travels in a direction of the world (unit length): along the axis along which it crosses most cells.
/// Where it crosses as many along two, both sweeps are one: a light that turns past that direction changes its axis, not its result.
pub(crate) fn sweep(grid: &Grid, cells: &Cells, light: DVec3) -> Sweep {
    let rate = cells_per_mm(grid, cells, light);
    let fastest = (0..3).fold(0, |best, a| if rate[a].abs() > rate[best].abs() { a } else { best });
    Sweep::along(fastest, rate)
}

/// Cells along each axis that light crosses in a millimetre.
pub(super) fn cells_per_mm(grid: &Grid, cells: &Cells, light: DVec3) -> DVec3 {
    grid.voxel_from_world().transform_vector3(light) / cells.voxels
}

impl Sweep {
    /// Along an axis, of light that crosses cells along each at these rates.
    pub(super) fn along(axis: usize, rate: DVec3) -> Self {
        let segment_mm = 1.0 / rate[axis].abs();
        let mut shift = -rate * segment_mm;
        shift[axis] = -rate[axis].signum();
        Self { axis, rises: rate[axis] > 0.0, shift, segment_mm }
    }

    /// Samples of the image from a slice to the next, about as dense as its voxels.
    pub fn samples(&self, grid: &Grid) -> u32 {
        (self.segment_mm / grid.spacing_mm().min_element()).ceil().clamp(1.0, MOST_SAMPLES) as u32
    }

    /// The axes within a slice.
    pub fn across(&self) -> [usize; 2] {
        [(self.axis + 1) % 3, (self.axis + 2) % 3]
    }

    /// Numbers of the slices in the light's order.
    pub fn slices(&self, cells: &Cells) -> impl Iterator<Item = usize> + use<> {
        let (count, rises) = (cells.dims[self.axis], self.rises);
        (0..count).map(move |n| if rises { n } else { count - 1 - n })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turning_light_changes_its_axis_where_both_sweeps_are_one() {
        let grid = Grid::axis_aligned([20, 16, 6], DVec3::new(1.0, 1.0, 5.0), DVec3::ZERO).unwrap();
        let cells = Cells::new(&grid, 4.0);
        assert_eq!(cells.voxels, DVec3::new(4.0, 4.0, 1.0));
        let mut last = sweep(&grid, &cells, DVec3::X);
        let mut changes = 0;
        for n in 1..=3600 {
            let (s, c) = (0.1 * f64::from(n)).to_radians().sin_cos();
            let light = DVec3::new(c, 0.3 * s, s).normalize_or_zero();
            let now = sweep(&grid, &cells, light);
            // Back along the light, one slice; never by more than a cell aside.
            let back = now.shift * DVec3::new(4.0, 4.0, 5.0) + light * now.segment_mm;
            assert!(back.length() < 1e-12 && now.shift[now.axis].abs() == 1.0, "{now:?}");
            assert!(now.shift.abs().max_element() <= 1.0, "{now:?}");
            assert!((now.shift - last.shift).length() < 0.02 || now.rises != last.rises, "{last:?} {now:?}");
            changes += u32::from(now.axis != last.axis);
            last = now;
        }
        assert_eq!(changes, 4);
        assert_eq!(sweep(&grid, &cells, -DVec3::Z).axis, 2);
        let tie = cells_per_mm(&grid, &cells, DVec3::new(4.0, 1.0, -5.0).normalize_or_zero());
        let [x, z] = [0, 2].map(|axis| Sweep::along(axis, tie));
        assert!((x.shift - z.shift).length() < 1e-12 && (x.segment_mm - z.segment_mm).abs() < 1e-12);
    }

    #[test]
    fn slices_come_in_the_lights_order() {
        let grid = Grid::axis_aligned([4; 3], DVec3::ONE, DVec3::ZERO).unwrap();
        let cells = Cells::new(&grid, 1.0);
        let order = |light: DVec3| sweep(&grid, &cells, light).slices(&cells).collect::<Vec<_>>();
        assert_eq!(order(DVec3::Y), [0, 1, 2, 3, 4, 5]);
        assert_eq!(order(-DVec3::Y), [5, 4, 3, 2, 1, 0]);
        assert_eq!(sweep(&grid, &cells, DVec3::X).samples(&grid), 1);
    }
}
