//! In which order light is carried through the cells of an image. Pure: no device is touched.

use glam::DVec3;
use glioscope_core::Grid;

use crate::light::cones::grid::Cells;

/// Axes along which light crosses cells by at least this share less than along the fastest one aren't swept.
const MIXED: f64 = 0.25;
/// Most samples of the image on the way from a slice to the next.
const MOST_SAMPLES: f64 = 64.0;

/// A sweep of light through the slices of cells along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sweep {
    /// Of the image's grid.
    pub axis: usize,
    /// Whether light meets slices by rising number.
    pub rises: bool,
    /// Its share of the result, above 0.
    pub weight: f64,
    /// From a cell back to where its light crosses the slice before: cells along each axis, exactly one along `axis`.
    pub shift: DVec3,
    /// The same way in millimetres.
    pub segment_mm: f64,
}

/// The sweeps of light that travels in a direction of the world (unit length): along the axis along which it crosses cells fastest,
/// and along each that is nearly as fast. Weights add up to 1 and have no jump when the light turns.
pub(crate) fn sweeps(grid: &Grid, cells: &Cells, light: DVec3) -> Vec<Sweep> {
    let voxels = grid.voxel_from_world().transform_vector3(light);
    let rate = voxels / DVec3::from_array(cells.voxels.map(|v| v as f64));
    let fastest = rate.abs().max_element();
    let weight = |axis: usize| (rate[axis].abs() / fastest - (1.0 - MIXED)).max(0.0);
    let sum: f64 = (0..3).map(weight).sum();
    let swept = (0..3).filter(|axis| weight(*axis) > 0.0);
    swept
        .map(|axis| {
            let segment_mm = 1.0 / rate[axis].abs();
            let mut shift = -rate * segment_mm;
            shift[axis] = -rate[axis].signum();
            Sweep { axis, rises: rate[axis] > 0.0, weight: weight(axis) / sum, shift, segment_mm }
        })
        .collect()
}

impl Sweep {
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

    fn turned(deg: f64) -> DVec3 {
        let (s, c) = deg.to_radians().sin_cos();
        DVec3::new(c, s, 0.0)
    }

    #[test]
    fn weights_add_up_and_have_no_jump() {
        let grid = Grid::axis_aligned([20, 16, 6], DVec3::new(1.0, 1.0, 3.0), DVec3::ZERO).unwrap();
        let cells = Cells::new(&grid, 3.0);
        assert_eq!(cells.voxels, [3, 3, 1]);
        let weights = |light: DVec3| {
            let mut out = [0.0; 3];
            for sweep in sweeps(&grid, &cells, light) {
                out[sweep.axis] += sweep.weight;
                // Back along the light, one slice.
                let back = sweep.shift * 3.0 + light * sweep.segment_mm;
                assert!(back.length() < 1e-12 && sweep.shift[sweep.axis].abs() == 1.0, "{sweep:?}");
                assert!(sweep.shift.abs().max_element() < 1.34 && sweep.weight > 0.0, "{sweep:?}");
            }
            assert!((out.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{out:?}");
            out
        };
        let mut last = weights(turned(0.0));
        assert_eq!(last, [1.0, 0.0, 0.0]);
        for n in 1..=720 {
            let now = weights(turned(0.5 * f64::from(n)));
            assert!((0..3).all(|a| (now[a] - last[a]).abs() < 0.04), "{n}: {last:?} {now:?}");
            last = now;
        }
        let [x, y, z] = weights(DVec3::splat(-1.0).normalize());
        assert!((x - y).abs() < 1e-12 && (y - z).abs() < 1e-12);
        assert_eq!(weights(-DVec3::Z), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn slices_come_in_the_lights_order() {
        let grid = Grid::axis_aligned([4; 3], DVec3::ONE, DVec3::ZERO).unwrap();
        let cells = Cells::new(&grid, 1.0);
        let order = |light: DVec3| sweeps(&grid, &cells, light)[0].slices(&cells).collect::<Vec<_>>();
        assert_eq!(order(DVec3::Y), [0, 1, 2, 3]);
        assert_eq!(order(-DVec3::Y), [3, 2, 1, 0]);
        assert_eq!(sweeps(&grid, &cells, DVec3::X)[0].samples(&grid), 1);
    }
}
