use crate::{Grid, Progress, Samples, Scaling, Volume, grid::ijk};
use glam::{DAffine3, DMat3, DVec3};

use super::{
    curve::Curve,
    level::{Level, finest},
    mutual,
    pair::Pair,
    pose::{HalfWay, apart_mm, half_way, rotated, solve},
    types::Model,
};

fn smooth(p: DVec3) -> f64 {
    0.5 + 0.2 * (p.x * 0.2).sin() + 0.15 * (p.y * 0.17 + 0.4).cos() + 0.1 * (p.z * 0.23 + p.x * 0.1).sin()
}

fn level(dims: [usize; 3], spacing_mm: [f64; 3], value: impl Fn(DVec3) -> f64, resolution_mm: f64) -> Level {
    let spacing = DVec3::from_array(spacing_mm);
    let last = DVec3::from_array(dims.map(|n| n as f64 - 1.0));
    let grid = Grid::axis_aligned(dims, spacing, -0.5 * spacing * last).unwrap();
    let values =
        (0..grid.voxel_count()).map(|l| value(grid.center_of_voxel_mm(ijk(dims, l))) as f32).collect();
    let volume = Volume::new(grid, Samples::F32(values), Scaling::NONE).unwrap();
    finest(&volume, DVec3::ZERO, resolution_mm, &Progress::new()).unwrap().unwrap()
}

fn some_pose() -> DAffine3 {
    DAffine3 { matrix3: rotated(DVec3::new(0.1, -0.2, 0.15)), translation: DVec3::new(3.0, -2.0, 1.0) }
}

#[test]
fn half_way_twice_is_the_pose() {
    let sheared = DAffine3 {
        matrix3: some_pose().matrix3 * DMat3::from_diagonal(DVec3::new(1.1, 0.95, 1.02)),
        ..some_pose()
    };
    for (pose, model) in [(some_pose(), Model::Rigid), (sheared, Model::Affine), (some_pose(), Model::Affine)]
    {
        let half = half_way(pose, model).unwrap();
        assert!(apart_mm(half.moving_from_half * half.moving_from_half, pose, 100.0) < 1e-9);
        assert!(apart_mm(half.moving_from_half * half.fixed_from_half, DAffine3::IDENTITY, 100.0) < 1e-9);
    }
    let half_turn = DAffine3::from_mat3(rotated(DVec3::Z * std::f64::consts::PI));
    assert!(half_way(half_turn, Model::Rigid).is_none());
    assert!(half_way(DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)), Model::Affine).is_none());
}

#[test]
fn a_step_of_a_translation_and_a_rotation_is_what_it_says() {
    let identity = half_way(DAffine3::IDENTITY, Model::Rigid).unwrap();
    let after = |step: &[f64], model| identity.stepped(step, model).unwrap().pose().unwrap();
    let moved = after(&[1.0, 2.0, 3.0, 0.0, 0.0, 0.0], Model::Rigid);
    assert!(moved.translation.distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-12);
    let turned = after(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.3], Model::Rigid);
    assert!(apart_mm(turned, DAffine3::from_mat3(DMat3::from_rotation_z(0.3)), 1.0) < 1e-12);
    let mut scale = [0.0; 12];
    scale[3] = 2_f64.ln();
    let wide = after(&scale, Model::Affine);
    assert!(apart_mm(wide, DAffine3::from_scale(DVec3::new(2.0, 1.0, 1.0)), 1.0) < 1e-12);
}

#[test]
fn cholesky_solves_and_refuses() {
    let x = solve(&[4.0, 2.0, 2.0, 3.0], &[10.0, 9.0]).unwrap();
    assert!((x[0] - 1.5).abs() < 1e-12 && (x[1] - 2.0).abs() < 1e-12);
    assert!(solve(&[1.0, 2.0, 2.0, 1.0], &[1.0, 1.0]).is_none());
    assert!(solve(&[f64::NAN], &[1.0]).is_none());
}

/// A linear image is reproduced exactly, whatever is smoothed and thinned out.
#[test]
fn levels_keep_linear_images_in_place() {
    let linear = |p: DVec3| 3.0 + 0.5 * p.x - 0.25 * p.y + 0.125 * p.z;
    let fine = level([40, 41, 18], [1.0, 0.9, 3.0], linear, 2.0);
    let coarse = fine.coarser(4.0, &Progress::new()).unwrap();
    assert_eq!((fine.dims, coarse.dims), ([20, 21, 18], [10, 11, 18]));
    for level in [&fine, &coarse, &coarse.turned(DMat3::IDENTITY)] {
        // Away from the border, where kernels are cut.
        for p in [DVec3::ZERO, DVec3::new(3.3, -4.1, 5.7), DVec3::new(-5.0, 4.0, -7.7)] {
            let found = level.probe(level.voxel_from_centred.transform_point3(p)).unwrap();
            assert!((found.value - linear(p)).abs() < 1e-4, "{p} {}", found.value - linear(p));
            let gradient = level.voxel_from_centred.matrix3.transpose() * found.gradient;
            assert!(gradient.distance(DVec3::new(0.5, -0.25, 0.125)) < 1e-4);
        }
    }
    assert!(fine.probe(DVec3::new(-0.01, 1.0, 1.0)).is_none());
    assert!(fine.probe(DVec3::new(19.0, 20.0, 17.0)).is_some());
    assert!(fine.probe(DVec3::new(1.0, f64::NAN, 1.0)).is_none());
}

#[test]
fn voxels_that_are_not_finite_neither_spread_nor_count() {
    let holed = |p: DVec3| if p.x > 4.0 { f64::NAN } else { 2.0 };
    let level = level([40, 40, 40], [1.0; 3], holed, 2.0);
    let at = |x: f64| level.probe(level.voxel_from_centred.transform_point3(DVec3::new(x, 0.2, 0.3)));
    assert!((at(1.0).unwrap().value - 2.0).abs() < 1e-6);
    assert_eq!((at(6.5), at(12.0)), (None, None));
}

/// Against central differences, for every parameter.
#[test]
fn the_derivative_of_mutual_information_is_exact() {
    let fixed = level([30, 30, 30], [2.0; 3], smooth, 2.0);
    let other = |p: DVec3| (1.2 - smooth(p)).powi(2);
    let moving = level([30, 30, 30], [2.0; 3], other, 2.0);
    let points: Vec<DVec3> = (0..4000)
        .map(|i| {
            let at = |step: f64| (f64::from(i) * step).fract() * 30.0 - 15.0;
            DVec3::new(at(0.754_877_67), at(0.569_840_29), at(0.438_579_02))
        })
        .collect();
    let curves = (&Curve::of(&fixed.values), &Curve::of(&moving.values));
    for model in [Model::Rigid, Model::Affine] {
        let of = |half: &HalfWay| {
            mutual::similarity(&Pair::new(&fixed, &moving, half), &points, 20, curves, model).unwrap()
        };
        let half = half_way(some_pose(), model).unwrap();
        let found = of(&half);
        let count = if model == Model::Rigid { 6 } else { 12 };
        for parameter in 0..count {
            let h = if parameter < 3 { 1e-4 } else { 1e-5 };
            let mut step = vec![0.0; count];
            step[parameter] = h;
            let up = of(&half.stepped(&step, model).unwrap()).value;
            step[parameter] = -h;
            let down = of(&half.stepped(&step, model).unwrap()).value;
            let numeric = (up - down) / (2.0 * h);
            let scale = if parameter < 3 { 1e-6 } else { 1e-5 };
            let difference = (found.gradient[parameter] - numeric).abs();
            assert!(
                difference < 1e-3 * numeric.abs() + scale,
                "{parameter}: {} {numeric}",
                found.gradient[parameter]
            );
        }
    }
}

/// Of independent images 1, of an image and any one-to-one function of it nearly 2.
#[test]
fn normalised_mutual_information_has_its_bounds() {
    let fixed = level([30, 30, 30], [2.0; 3], smooth, 2.0);
    let inverted = level([30, 30, 30], [2.0; 3], |p| 1.0 - smooth(p), 2.0);
    let hash = |p: DVec3| (p.dot(DVec3::new(12.9898, 78.233, 37.719)).sin() * 43758.5453).rem_euclid(1.0);
    let noise = level([30, 30, 30], [2.0; 3], hash, 2.0);
    let points: Vec<DVec3> = (0..40_000)
        .map(|i| {
            let at = |step: f64| (f64::from(i) * step).fract() * 40.0 - 20.0;
            DVec3::new(at(0.754_877_67), at(0.569_840_29), at(0.438_579_02))
        })
        .collect();
    let half = half_way(DAffine3::IDENTITY, Model::Rigid).unwrap();
    let of = |moving: &Level| {
        let curves = (&Curve::of(&fixed.values), &Curve::of(&moving.values));
        mutual::value(&Pair::new(&fixed, moving, &half), &points, 24, curves).unwrap()
    };
    let (same, opposite, independent) = (of(&fixed), of(&inverted), of(&noise));
    assert!((1.0..1.01).contains(&independent), "{independent}");
    assert!((same - opposite).abs() < 0.03 && same > 1.3 && same <= 2.0, "{same} {opposite}");
}

#[test]
fn curves_are_monotone_and_end_at_0_and_1() {
    let skewed: Vec<f32> = (0..10_000).map(|i| (i as f32 / 1e4).powi(6)).collect();
    let curve = Curve::of(&skewed);
    let mut last = 0.0;
    for i in 0..=1000 {
        let (at, slope) = curve.at(f64::from(i) / 1000.0);
        assert!(at >= last && slope >= 0.0);
        last = at;
    }
    assert!((last - 1.0).abs() < 1e-12);
    assert_eq!((curve.at(-1.0), curve.at(2.0), curve.at(f64::NAN)), ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)));
    assert!(curve.at(0.05).0 > 0.1, "where most values are, bins are finer");
    assert!(curve.at(0.05).0 < 0.3, "but no more than four times");
}
