//! Axes of what masks show, and of grids, as rotations of the patient's axes.

use glam::{DMat3, DVec3};

use crate::{Grid, Selection, TumorIndex, eigen::symmetric_eigen};

/// Columns shorter than this share of the longest have no direction.
const LEAST_SHARE: f64 = 1e-9;

/// The principal axes of the shown voxels of `index`, as the rotation that takes the patient's axes R, A and S to those nearest to
/// them. The voxels count as solid cells. `None` where nothing is shown. Where two spreads are equal, as of a ball, the axes
/// between them mean nothing. The same voxels give the same bits.
pub fn of_selection(index: &TumorIndex, selection: &Selection) -> Option<DMat3> {
    let grid = index.grid();
    let [nx, ny, nz] = grid.dims();
    // Whole numbers: sums are exact in any order.
    let mut n = 0_i128;
    let mut first = [0_i128; 3];
    let mut second = [[0_i128; 3]; 3];
    for z in 0..nz {
        for y in 0..ny {
            let start = (z * ny + y) * nx;
            // Of one row: number, sum and sum of squares of x.
            let [mut count, mut sum, mut squares] = [0_i128; 3];
            for x in 0..nx {
                if selection.shows(index.get(start + x)) {
                    count += 1;
                    sum += x as i128;
                    squares += (x * x) as i128;
                }
            }
            let (y, z) = (y as i128, z as i128);
            n += count;
            for (at, value) in [sum, count * y, count * z].into_iter().enumerate() {
                first[at] += value;
            }
            let rows = [
                [squares, sum * y, sum * z],
                [sum * y, count * y * y, count * y * z],
                [sum * z, count * y * z, count * z * z],
            ];
            for (own, row) in second.iter_mut().zip(rows) {
                for (own, value) in own.iter_mut().zip(row) {
                    *own += value;
                }
            }
        }
    }
    if n == 0 {
        return None;
    }
    // n² times the covariance is a whole number, too.
    let covariance = |a: usize, b: usize| {
        let whole = second[a][b] * n - first[a] * first[b];
        // A cell of side 1 adds 1/12 along its axes.
        whole as f64 / (n as f64 * n as f64) + if a == b { 1.0 / 12.0 } else { 0.0 }
    };
    let column = |b: usize| DVec3::new(covariance(0, b), covariance(1, b), covariance(2, b));
    let in_voxels = DMat3::from_cols(column(0), column(1), column(2));
    let m = grid.world_from_voxel().matrix3;
    let (_, vectors) = symmetric_eigen(m * in_voxels * m.transpose());
    Some(nearest_to_patient(vectors))
}

/// The axes of a grid, as the rotation that takes the patient's axes to those nearest to them: the planes that were scanned.
/// A sheared grid's are the rotation nearest to it.
pub fn of_grid(grid: &Grid) -> DMat3 {
    let m = grid.world_from_voxel().matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis].map(|column| column.try_normalize().unwrap_or(DVec3::ZERO));
    let directions = DMat3::from_cols(columns[0], columns[1], columns[2]);
    // The polar factor of its directions.
    let (values, vectors) = symmetric_eigen(directions.transpose() * directions);
    let longest = values.iter().fold(0.0_f64, |a, &b| a.max(b));
    if !values.iter().all(|&value| value > longest * LEAST_SHARE) {
        return DMat3::IDENTITY;
    }
    let inverse_root = DMat3::from_diagonal(DVec3::from_array(values.map(|value| 1.0 / value.sqrt())));
    nearest_to_patient(directions * (vectors * inverse_root * vectors.transpose()))
}

/// How far a rotation turns, degrees, 0 to 180.
pub fn turn_deg(rotation: DMat3) -> f64 {
    let trace = rotation.x_axis.x + rotation.y_axis.y + rotation.z_axis.z;
    ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
}

/// Of the rotations whose columns are `axes` in some order and direction, that which turns least.
fn nearest_to_patient(axes: DMat3) -> DMat3 {
    let columns = [axes.x_axis, axes.y_axis, axes.z_axis];
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut best = (f64::NEG_INFINITY, DMat3::IDENTITY);
    for order in orders {
        for signs in 0..8_u8 {
            let column = |at: usize| columns[order[at]] * if signs >> at & 1 == 1 { -1.0 } else { 1.0 };
            let turned = DMat3::from_cols(column(0), column(1), column(2));
            let trace = turned.x_axis.x + turned.y_axis.y + turned.z_axis.z;
            if turned.determinant() > 0.0 && trace > best.0 {
                best = (trace, turned);
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::{Mask, MaskBits, Sides};

    /// A box of half sides `half_mm` along the columns of `turn`, about the origin, on a grid of `spacing_mm`.
    fn of_box(turn: DMat3, half_mm: DVec3, spacing_mm: DVec3) -> Option<DMat3> {
        let dims = (DVec3::splat(80.0) / spacing_mm).to_array().map(|n| n.ceil() as usize);
        let grid = Grid::axis_aligned(dims, spacing_mm, DVec3::splat(-40.0)).unwrap();
        let inside = |linear: usize| {
            let at = turn.transpose() * grid.center_of_voxel_mm(grid.ijk(linear));
            at.abs().cmple(half_mm).all()
        };
        let bits = MaskBits::from_fn(grid.dims(), inside);
        let mask = Mask::new("A", grid.clone(), bits).unwrap();
        of_selection(&TumorIndex::new(grid, &[&mask]).unwrap(), &Selection::all())
    }

    fn turned(axis: DVec3, deg: f64) -> DMat3 {
        DMat3::from_axis_angle(axis.try_normalize().unwrap(), deg.to_radians())
    }

    #[test]
    fn axes_of_a_turned_box_are_its_own() {
        for (axis, deg) in [(DVec3::Z, 20.0), (DVec3::new(1.0, 2.0, 0.5), 31.0), (DVec3::X, -40.0)] {
            for spacing_mm in [DVec3::ONE, DVec3::new(1.0, 1.0, 3.0)] {
                let turn = turned(axis, deg);
                let found = of_box(turn, DVec3::new(30.0, 18.0, 9.0), spacing_mm).unwrap();
                let off_deg = turn_deg(found * turn.transpose());
                assert!(off_deg < 1.0, "{axis} {deg} {spacing_mm}: {off_deg}");
                assert!((turn_deg(found) - deg.abs()).abs() < 1.0);
                assert!((found.determinant() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn what_is_turned_by_more_than_a_half_quarter_takes_its_nearest_axis() {
        let found = of_box(turned(DVec3::Z, 70.0), DVec3::new(30.0, 18.0, 9.0), DVec3::ONE).unwrap();
        assert!((turn_deg(found) - 20.0).abs() < 1.0, "{}", turn_deg(found));
    }

    #[test]
    fn nothing_shown_has_no_axes_and_a_voxel_those_of_the_patient() {
        assert_eq!(of_box(DMat3::IDENTITY, DVec3::splat(-1.0), DVec3::ONE), None);
        let voxel = of_box(DMat3::IDENTITY, DVec3::new(0.6, 0.6, 6.0), DVec3::new(1.0, 1.0, 12.0)).unwrap();
        assert!(turn_deg(voxel) < 1e-9);
    }

    #[test]
    fn axes_of_a_grid_are_those_of_its_scan_in_any_storage_order() {
        let turn = turned(DVec3::new(0.3, 1.0, 0.2), 14.0);
        for columns in [[0, 1, 2], [2, 0, 1]] {
            for flip in [1.0, -1.0] {
                let c = columns.map(|at| turn.col(at) * [0.9, 1.0, 3.3][at]);
                let m = DMat3::from_cols(c[0] * flip, c[1], c[2]);
                let grid = Grid::new(
                    [8; 3],
                    DAffine3 { matrix3: m, translation: DVec3::new(1e6, 0.0, 0.0) },
                    Sides::Known,
                );
                assert!(turn_deg(of_grid(&grid.unwrap()) * turn.transpose()) < 1e-6);
            }
        }
        // Sheared by a gantry's tilt: the nearest rotation, half of it.
        let tilt = 20_f64.to_radians();
        let m = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(0.0, tilt.sin(), tilt.cos()) * 3.0);
        let grid =
            Grid::new([8; 3], DAffine3 { matrix3: m, translation: DVec3::ZERO }, Sides::Known).unwrap();
        assert!((turn_deg(of_grid(&grid)) - 10.0).abs() < 1e-6, "{}", turn_deg(of_grid(&grid)));
    }
}
