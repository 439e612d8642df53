//! Components on grids.

use glam::{DAffine3, DMat3, DVec3};

use super::{all, blob, check_corners, index_of, random, skewed_grid, unit_grid};
use crate::{
    Connectivity, Grid, MaskBits, Progress, Sides,
    ellipsoid::{ComponentReport, EllipsoidError, Of, OfReport, Options, ellipsoids_of},
    grid::ijk,
};

fn solid(dims: [usize; 3], start: [usize; 3], size: [usize; 3]) -> MaskBits {
    let mut bits = MaskBits::empty(dims);
    for z in 0..size[2] {
        for y in 0..size[1] {
            for x in 0..size[0] {
                bits.set([start[0] + x, start[1] + y, start[2] + z]);
            }
        }
    }
    bits
}

#[test]
fn solid_boxes_on_anisotropic_grids() {
    let dims = [50, 45, 44];
    let spacing = DVec3::new(0.5, 0.9, 6.0);
    for size in [[1, 1, 1], [1, 1, 40], [40, 1, 1], [30, 40, 1], [3, 5, 7]] {
        let grid = Grid::axis_aligned(dims, spacing, DVec3::new(-3.0, 11.0, 2.0)).unwrap();
        let found = all(&index_of(&grid, &[solid(dims, [2, 3, 4], size)]));
        assert_eq!(found.len(), 2);
        let mm = DVec3::from(size.map(|s| s as f64)) * spacing;
        let mut want = (mm * (3_f64.sqrt() / 2.0)).to_array();
        want.sort_by(|a, b| b.total_cmp(a));
        let center = grid.center_of_voxel_mm([2, 3, 4]) + mm * 0.5 - spacing * 0.5;
        for c in found {
            for (have, want) in c.enclosing.semi_axes_mm.to_array().into_iter().zip(want) {
                assert!((have / want - 1.0).abs() < 1e-12);
            }
            assert!(c.enclosing.center_mm.distance(center) < 1e-11);
            assert!((c.exaggeration - 3_f64.sqrt() * std::f64::consts::PI / 2.0).abs() < 1e-12);
            assert!((c.enclosing.rotation.determinant() - 1.0).abs() < 1e-12);
            assert_eq!(c.volume_bound, 1.0);
            // The moment ellipsoid of a box is a smaller one of the same form.
            assert!((c.moment.volume_ml() / c.volume_ml - 1.0).abs() < 1e-12);
            assert!(
                (c.moment.semi_axes_mm / c.enclosing.semi_axes_mm)
                    .distance(DVec3::splat((c.volume_ml / c.enclosing.volume_ml()).cbrt()))
                    < 1e-12
            );
            assert!(c.moment.center_mm.distance(center) < 1e-11);
        }
    }
}

#[test]
fn every_corner_is_inside() {
    let mut state = 77;
    let dims = [70, 33, 21];
    for grid in [unit_grid(dims), skewed_grid(dims, 30.0)] {
        let masks: Vec<MaskBits> = (0..3).map(|k| blob(dims, &mut state, 2 + k)).collect();
        check_corners(&index_of(&grid, &masks), 1e-9);
        let specks: Vec<MaskBits> =
            (0..2).map(|_| MaskBits::from_fn(dims, |_| random(&mut state).is_multiple_of(25))).collect();
        check_corners(&index_of(&grid, &specks), 1e-9);
    }
}

#[test]
fn voxel_line_sheet_and_diagonal_are_enclosed() {
    let dims = [90, 90, 90];
    let mut diagonal = MaskBits::empty(dims);
    (0..90).for_each(|i| diagonal.set([i, i, i]));
    let mut steps = MaskBits::empty(dims);
    (0..90).for_each(|i| steps.set([i, i / 3, 4]));
    let mut sheet = solid(dims, [0, 5, 0], [80, 1, 60]);
    sheet.set([80, 5, 3]);
    for bits in [diagonal, steps, sheet, solid(dims, [89; 3], [1; 3])] {
        for grid in [unit_grid(dims), skewed_grid(dims, 1e3)] {
            let index = index_of(&grid, std::slice::from_ref(&bits));
            check_corners(&index, 1e-9);
            for c in all(&index) {
                assert!(c.volume_bound <= 1.0 + 1e-7, "{}", c.volume_bound);
                assert!(c.exaggeration > 1.0);
                assert!((c.moment.volume_ml() / c.volume_ml - 1.0).abs() < 1e-11);
            }
        }
    }
}

#[test]
fn distant_sheared_and_mirrored_grids_agree_up_to_rounding() {
    let dims = [40, 30, 20];
    let bits = blob(dims, &mut 4, 3);
    let plain = all(&index_of(&unit_grid(dims), std::slice::from_ref(&bits)));
    let shear =
        DMat3::from_cols(DVec3::new(0.8, 0.0, 0.1), DVec3::new(0.3, 1.1, 0.0), DVec3::new(-0.4, 0.7, 3.0));
    for matrix in [DMat3::IDENTITY, DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), shear, -shear] {
        for offset in [0.0, 1e6] {
            let world_from_voxel = DAffine3 { matrix3: matrix, translation: DVec3::splat(offset) };
            let grid = Grid::new(dims, world_from_voxel, Sides::Known).unwrap();
            let placed = all(&index_of(&grid, std::slice::from_ref(&bits)));
            assert_eq!(plain.len(), placed.len());
            for (p, q) in plain.iter().zip(&placed) {
                assert_eq!(p.exaggeration, q.exaggeration);
                assert_eq!(p.volume_bound, q.volume_bound);
                for (p, q) in [(p.enclosing, q.enclosing), (p.moment, q.moment)] {
                    assert!(world_from_voxel.transform_point3(p.center_mm).distance(q.center_mm) <= 1e-9);
                    // Each ellipsoid as its matrix Q = R diag(a²) Rᵀ, which has no signs or order.
                    let form = |e: &crate::ellipsoid::Ellipsoid| {
                        e.rotation
                            * DMat3::from_diagonal(e.semi_axes_mm * e.semi_axes_mm)
                            * e.rotation.transpose()
                    };
                    let want = matrix * form(&p) * matrix.transpose();
                    assert!(want.abs_diff_eq(form(&q), 1e-9 * q.semi_axes_mm.x.powi(2)));
                    assert!((q.rotation.determinant() - 1.0).abs() < 1e-12);
                    assert!(q.semi_axes_mm.x >= q.semi_axes_mm.y && q.semi_axes_mm.y >= q.semi_axes_mm.z);
                }
            }
        }
    }
}

#[test]
fn moments_equal_brute_force() {
    let dims = [33, 20, 17];
    let bits = blob(dims, &mut 15, 1);
    let grid = skewed_grid(dims, -500.0);
    let found = all(&index_of(&grid, std::slice::from_ref(&bits)))[0];
    // Mean and covariance in world space; each voxel is a solid parallelepiped, which adds M Mᵀ / 12.
    let mut positions = Vec::new();
    bits.for_each(|l| {
        let voxel = ijk(dims, l);
        positions.push(grid.center_of_voxel_mm(voxel));
    });
    let n = positions.len() as f64;
    let mean = positions.iter().sum::<DVec3>() / n;
    let outer = |d: DVec3| DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    let m = grid.world_from_voxel().matrix3;
    let covariance =
        positions.iter().fold(m * m.transpose() * (1.0 / 12.0), |sum, &p| sum + outer(p - mean) * (1.0 / n));
    assert!(found.moment.center_mm.distance(mean) < 1e-9);
    let axes = found.moment.rotation.transpose() * covariance * found.moment.rotation;
    let scale = axes.x_axis.x / found.moment.semi_axes_mm.x.powi(2);
    let want = DMat3::from_diagonal(found.moment.semi_axes_mm * found.moment.semi_axes_mm) * scale;
    assert!(axes.abs_diff_eq(want, 1e-9 * axes.x_axis.x), "{axes} {want}");
    assert!((found.moment.volume_ml() / found.volume_ml - 1.0).abs() < 1e-12);
}

#[test]
fn empty_masks_have_none_and_reports_name_the_mask_or_region() {
    let dims = [12, 9, 8];
    let grid = unit_grid(dims);
    assert!(all(&index_of(&grid, &[])).is_empty());
    assert!(all(&index_of(&grid, &[MaskBits::empty(dims)])).is_empty());
    let masks = [solid(dims, [0; 3], [4, 4, 4]), MaskBits::empty(dims), solid(dims, [2, 2, 2], [4, 4, 4])];
    let index = index_of(&grid, &masks);
    let found = all(&index);
    let of: Vec<Of> = found.iter().map(|c| c.of).collect();
    assert_eq!(of, [Of::Mask(0), Of::Mask(2), Of::Region(1), Of::Region(4), Of::Region(5)]);
    assert_eq!(found.iter().map(|c| c.voxels).collect::<Vec<_>>(), [64, 64, 56, 56, 8]);

    let last = ComponentReport::of(&found[4], index.mask_ids(), "2024");
    assert_eq!(last.of, OfReport::Region(vec!["m0".into(), "m2".into()]));
    let json = serde_json::to_value(&last).unwrap();
    assert_eq!(json["of"], serde_json::json!({"region": ["m0", "m2"]}));
    assert_eq!(json["time"], "2024");
    let keys: Vec<&String> = json.as_object().unwrap().keys().collect();
    for key in [
        "center_mm",
        "exaggeration",
        "moment",
        "of",
        "rotation",
        "semi_axes_mm",
        "time",
        "volume_bound",
        "volume_ml",
        "voxels",
    ] {
        assert!(keys.iter().any(|k| *k == key), "{key}");
    }
    // Rows of a matrix whose columns are the axes.
    let skewed = all(&index_of(&skewed_grid(dims, 0.0), &masks))[0];
    let json = serde_json::to_value(ComponentReport::of(&skewed, index.mask_ids(), "")).unwrap();
    assert_eq!(json["of"], serde_json::json!({"mask": "m0"}));
    for r in 0..3 {
        for k in 0..3 {
            assert_eq!(json["rotation"][r][k].as_f64().unwrap(), skewed.enclosing.rotation.col(k)[r]);
        }
    }
}

#[test]
fn connectivity_is_used_and_cancelling_stops() {
    let dims = [4, 4, 4];
    let mut bits = MaskBits::empty(dims);
    bits.set([0, 0, 0]);
    bits.set([1, 1, 1]);
    let index = index_of(&unit_grid(dims), &[bits]);
    let options = Options::default();
    let count = |c| ellipsoids_of(&index, c, &options, &Progress::new()).unwrap().len();
    assert_eq!(
        (count(Connectivity::TwentySix), count(Connectivity::Eighteen), count(Connectivity::Six)),
        (2, 4, 4)
    );
    let progress = Progress::new();
    progress.cancel();
    let cancelled = ellipsoids_of(&index, Connectivity::Six, &options, &progress);
    assert!(matches!(cancelled, Err(EllipsoidError::Cancelled(_))));
}
