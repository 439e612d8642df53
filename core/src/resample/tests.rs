use glam::{DAffine3, DMat3, DVec3};

use super::*;
use crate::{Samples, Scaling, Sides, grid::ijk};

fn grid(dims: [usize; 3], matrix3: DMat3, translation: DVec3) -> Grid {
    Grid::new(dims, DAffine3 { matrix3, translation }, Sides::Known).unwrap()
}

fn axis_aligned(dims: [usize; 3], spacing_mm: DVec3, origin_mm: DVec3) -> Grid {
    Grid::axis_aligned(dims, spacing_mm, origin_mm).unwrap()
}

fn speckle(dims: [usize; 3], grid: Grid, seed: u64) -> Mask {
    let mut state = seed;
    let bits = MaskBits::from_fn(dims, |_| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        state >> 62 == 0
    });
    Mask::new("speckle", grid, bits).unwrap()
}

fn resampled(mask: &Mask, target: &Grid) -> MaskBits {
    mask_onto(mask, target, &Progress::new()).unwrap()
}

/// Reference: nearest neighbour through world coordinates, voxel by voxel.
fn reference(mask: &Mask, target: &Grid) -> MaskBits {
    let dims = target.dims();
    MaskBits::from_fn(target.dims(), |l| {
        let world = target.center_of_voxel_mm(ijk(dims, l));
        mask.grid().voxel_at(world).is_some_and(|ijk| mask.bits().get(ijk))
    })
}

#[test]
fn masks_already_on_the_target_grid_keep_every_bit() {
    let m = DMat3::from_rotation_y(0.4) * DMat3::from_diagonal(DVec3::new(-0.7, 1.1, 3.0));
    let dims = [67, 9, 5];
    let mask = speckle(dims, grid(dims, m, DVec3::new(3.0, -40.0, 7.0)), 1);
    assert_eq!(&resampled(&mask, mask.grid()), mask.bits());
    // And through the affine: moved by less than half a voxel but by more than `SAME_PLACE_VOXELS`.
    for part in [0.01, 0.4995, -0.4995] {
        let moved = grid(dims, m, DVec3::new(3.0, -40.0, 7.0) + m * DVec3::splat(part));
        assert_eq!(&resampled(&mask, &moved), mask.bits(), "{part} of a voxel");
    }
}

/// Every voxel of the source becomes exactly f³ voxels when the target divides it by f.
#[test]
fn integer_upsampling_multiplies_voxel_counts_exactly() {
    let dims = [7, 6, 5];
    for factor in [2_usize, 3, 4] {
        for origin_mm in [DVec3::ZERO, DVec3::new(1e6, -1e6, 1e6)] {
            let spacing = DVec3::new(3.0, 1.2, 6.0);
            let mask = speckle(dims, axis_aligned(dims, spacing, origin_mm), factor as u64);
            let fine = spacing / factor as f64;
            let target = axis_aligned(dims.map(|n| n * factor), fine, origin_mm - spacing / 2.0 + fine / 2.0);
            let found = resampled(&mask, &target);
            assert_eq!(found.count(), mask.voxels() * factor.pow(3) as u64);
            for z in 0..target.dims()[2] {
                for y in 0..target.dims()[1] {
                    for x in 0..target.dims()[0] {
                        assert_eq!(
                            found.get([x, y, z]),
                            mask.bits().get([x / factor, y / factor, z / factor])
                        );
                    }
                }
            }
        }
    }
}

/// Quarter turns and reflections are permutations of the voxels.
#[test]
fn axis_permutations_and_flips_permute_voxels() {
    let dims = [6, 5, 4];
    let mask = speckle(dims, axis_aligned(dims, DVec3::ONE, DVec3::ZERO), 9);
    // Target axes: x along -R from 5, y along S, z along A.
    let m = DMat3::from_cols(-DVec3::X, DVec3::Z, DVec3::Y);
    let target = grid([6, 4, 5], m, DVec3::new(5.0, 0.0, 0.0));
    assert!(m.determinant() > 0.0 && DMat3::from_cols(-DVec3::X, DVec3::Y, DVec3::Z).determinant() < 0.0);
    let found = resampled(&mask, &target);
    for z in 0..5 {
        for y in 0..4 {
            for x in 0..6 {
                assert_eq!(found.get([x, y, z]), mask.bits().get([5 - x, z, y]));
            }
        }
    }
}

/// Oblique, sheared, mirrored, far away: equal to the reference, ties aside.
#[test]
fn any_affine_matches_the_reference() {
    let dims = [20, 17, 9];
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.3, 1.0, 0.0), DVec3::new(0.1, -0.2, 1.0));
    let sources = [
        DMat3::from_rotation_x(0.31) * DMat3::from_diagonal(DVec3::new(1.0, 1.3, 2.9)),
        shear * DMat3::from_diagonal(DVec3::new(-0.8, 1.1, 3.1)),
    ];
    let turned = DMat3::from_rotation_z(-0.7) * DMat3::from_rotation_y(0.2);
    for origin_mm in [DVec3::ZERO, DVec3::splat(1e6)] {
        for m in sources {
            let mask = speckle(dims, grid(dims, m, origin_mm), 4);
            let fine = turned * DMat3::from_diagonal(DVec3::new(0.9, -1.1, 1.0));
            let middle = fine * DVec3::new(20.3, 18.1, 16.4);
            let target = grid([41, 37, 33], fine, mask.grid().center_mm() - middle);
            let found = resampled(&mask, &target);
            assert!(found.count() > 500);
            assert_eq!(found, reference(&mask, &target));
        }
    }
}

/// The target's own size limits what is visited; bits past the end of a line stay 0.
#[test]
fn a_target_inside_the_source_is_filled_to_its_edges() {
    let source = axis_aligned([80, 40, 30], DVec3::ONE, DVec3::ZERO);
    let full = Mask::new("full", source.clone(), MaskBits::full(source.dims())).unwrap();
    let volume = Volume::new(source, Samples::U8(vec![7; 80 * 40 * 30]), Scaling::NONE).unwrap();
    for turn in [0.0, 0.2] {
        let m = DMat3::from_rotation_z(turn) * DMat3::from_diagonal(DVec3::new(0.5, 0.75, 1.5));
        let target = grid([70, 9, 11], m, DVec3::new(25.2, 10.1, 6.3));
        assert_eq!(resampled(&full, &target), MaskBits::full(target.dims()));
        let found = image_onto(&volume, &target, &Progress::new()).unwrap();
        assert_eq!(found.inside, MaskBits::full(target.dims()));
        assert_eq!(found.values, vec![7.0; target.voxel_count()]);
    }
}

#[test]
fn a_place_is_in_the_voxel_around_it() {
    let at = |x: f64, y: f64, z: f64| source_voxel(DVec3::new(x, y, z), [5, 4, 3]);
    assert_eq!((at(-0.5, 1.49, 1.5), at(4.4, 3.0, 0.0)), (Some([0, 1, 2]), Some([4, 3, 0])));
    assert_eq!([at(-0.6, 0.0, 0.0), at(0.0, 3.5, 0.0), at(0.0, 0.0, 2.5)], [None; 3]);
}

/// Half the resolution, centres on the border of two voxels: the higher index decides, also where
/// rounding puts the centre a little below the border.
#[test]
fn a_tie_goes_to_the_higher_index() {
    let origin_mm = DVec3::new(0.1, 1e6 / 3.0, -7.7);
    let source = axis_aligned([8, 1, 1], DVec3::new(0.3, 1.0, 1.0), origin_mm);
    let mask = Mask::new("odd", source, MaskBits::from_fn([8, 1, 1], |l| l % 2 == 1)).unwrap();
    let target = axis_aligned([4, 1, 1], DVec3::new(0.6, 1.0, 1.0), origin_mm + DVec3::new(0.15, 0.0, 0.0));
    assert_eq!(resampled(&mask, &target), MaskBits::full([4, 1, 1]));
}

#[test]
fn voxels_outside_are_inactive_and_counted() {
    let full = Mask::new("full", axis_aligned([4, 4, 4], DVec3::ONE, DVec3::ZERO), MaskBits::full([4, 4, 4]))
        .unwrap();
    let away = axis_aligned([4, 4, 4], DVec3::ONE, DVec3::splat(100.0));
    assert_eq!(resampled(&full, &away).count(), 0);
    assert_eq!(voxels_outside(&full, &[&away]), 64);
    let half = axis_aligned([4, 4, 2], DVec3::ONE, DVec3::ZERO);
    assert_eq!(voxels_outside(&full, &[&half]), 32);
    assert_eq!(voxels_outside(&full, &[&half, full.grid()]), 0);
    // Two halves together cover the mask.
    let other = axis_aligned([4, 4, 2], DVec3::ONE, DVec3::new(0.0, 0.0, 2.0));
    assert_eq!(voxels_outside(&full, &[&half, &other]), 0);
    let empty = Mask::new("empty", away, MaskBits::empty([4, 4, 4])).unwrap();
    assert_eq!(resampled(&empty, &half).count(), 0);
    assert_eq!(voxels_outside(&empty, &[]), 0);
    assert_eq!(voxels_outside(&full, &[]), 64);
}

/// A plane across a diagonal separates one corner of 4³ voxels: at 4.5/√3 mm from the centre, its neighbours at 3.5/√3.
#[test]
fn each_corner_of_a_mask_is_outside_where_a_grid_ends_before_it() {
    let m = axis_aligned([4; 3], DVec3::ONE, DVec3::splat(-1.5));
    let full = Mask::new("full", m, MaskBits::full([4; 3])).unwrap();
    for corner in 0..8 {
        let diagonal = DVec3::from_array([0, 1, 2].map(|a| if corner >> a & 1 == 1 { 1.0 } else { -1.0 }));
        let (end_mm, x) = (4.0 / 3_f64.sqrt(), diagonal / 3_f64.sqrt());
        let (y, z) = x.any_orthonormal_pair();
        let to_first = DVec3::new(end_mm - 19.5, -9.5, -9.5);
        let turned = DMat3::from_cols(x, y, z);
        let cut = grid([20; 3], turned, turned * to_first);
        assert_eq!(voxels_outside(&full, &[&cut]), 1, "{diagonal}");
        assert_eq!(voxels_outside(&full, &[&cut, full.grid()]), 0);
    }
}

/// A linear function of position is reproduced by trilinear interpolation, between the outermost
/// centres.
#[test]
fn trilinear_interpolation_reproduces_a_linear_ramp() {
    let ramp = |p: DVec3| 3.0 + 0.5 * p.x - 0.25 * p.y + 2.0 * p.z;
    let dims = [12, 11, 10];
    let m = DMat3::from_rotation_x(0.2) * DMat3::from_diagonal(DVec3::new(1.0, -1.5, 2.0));
    let source = grid(dims, m, DVec3::new(-4.0, 9.0, 2.0));
    let values: Vec<f64> = (0..source.voxel_count())
        .map(|l| ramp(source.center_of_voxel_mm([l % 12, l / 12 % 11, l / 132])))
        .collect();
    let volume = Volume::new(source, Samples::F64(values), Scaling { slope: 2.0, intercept: -1.0 }).unwrap();
    let target = axis_aligned([30, 30, 40], DVec3::new(0.7, 0.9, 0.6), DVec3::new(-6.0, -8.0, 0.0));
    let found = image_onto(&volume, &target, &Progress::new()).unwrap();
    let map = source_from_target(volume.grid(), &target);
    let mut tested = 0;
    for l in 0..target.voxel_count() {
        let ijk = [l % 30, l / 30 % 30, l / 900];
        let at = map.transform_point3(DVec3::new(ijk[0] as f64, ijk[1] as f64, ijk[2] as f64));
        let inside = (0..3).all(|a| at[a] >= -0.5 && at[a] < dims[a] as f64 - 0.5);
        assert_eq!(found.inside.get(ijk), inside, "{at}");
        if (0..3).all(|a| at[a] >= 0.0 && at[a] <= dims[a] as f64 - 1.0) {
            let expected = 2.0 * ramp(target.center_of_voxel_mm(ijk)) - 1.0;
            assert!((f64::from(found.values[l]) - expected).abs() < 1e-5, "{} {expected}", found.values[l]);
            assert!((value_at(&volume, at).unwrap() - expected).abs() < 1e-11);
            tested += 1;
        } else if !inside {
            assert_eq!((found.values[l], value_at(&volume, at)), (0.0, None));
        }
    }
    assert!(tested > 1000);
}

#[test]
fn images_already_on_the_target_keep_their_values_and_edges_extend() {
    let g = axis_aligned([5, 1, 1], DVec3::ONE, DVec3::ZERO);
    let volume = Volume::new(g.clone(), Samples::I16(vec![5, -3, 9, 1, 7]), Scaling::NONE).unwrap();
    let same = image_onto(&volume, &g, &Progress::new()).unwrap();
    assert_eq!((same.values, same.inside), (vec![5.0, -3.0, 9.0, 1.0, 7.0], MaskBits::full([5, 1, 1])));
    let at = |x: f64| value_at(&volume, DVec3::new(x, 0.0, 0.0));
    assert_eq!((at(-0.4), at(4.4), at(0.5), at(1.25)), (Some(5.0), Some(7.0), Some(1.0), Some(0.0)));
    assert_eq!((at(-0.6), at(4.6)), (None, None));
}

/// A NaN affects only positions with a non-zero weight of it, not the centre of its finite neighbour.
#[test]
fn nan_does_not_spread_to_zero_weight_neighbors() {
    let g = axis_aligned([3, 1, 1], DVec3::ONE, DVec3::ZERO);
    let volume = Volume::new(g, Samples::F32(vec![1.0, f32::NAN, 3.0]), Scaling::NONE).unwrap();
    let at = |x: f64| value_at(&volume, DVec3::new(x, 0.0, 0.0)).unwrap();
    assert_eq!((at(0.0), at(2.0)), (1.0, 3.0));
    assert!(at(0.5).is_nan());
}

#[test]
fn cancelling_is_reported() {
    let mask = speckle([4, 4, 4], axis_aligned([4, 4, 4], DVec3::ONE, DVec3::ZERO), 1);
    let target = axis_aligned([8, 8, 8], DVec3::splat(0.5), DVec3::ZERO);
    let progress = Progress::new();
    progress.cancel();
    assert_eq!(mask_onto(&mask, &target, &progress), Err(Cancelled));
}
