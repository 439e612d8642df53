use crate::{Grid, Mask, MaskBits, Progress, Samples, Scaling, Volume, grid::ijk};
use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::{Image, Measure, Model, Options, Outcome, RegisterError, Warning, around, consistency, register};

/// A head without symmetry: value at a point, mm; `contrast` 1 is another sequence, `grown` has a larger lesion.
fn head(p: DVec3, contrast: usize, grown: bool) -> f64 {
    let inside = |centre: [f64; 3], radii: [f64; 3]| {
        let q = (p - DVec3::from_array(centre)) / DVec3::from_array(radii);
        let r = q.length();
        // A soft edge, a little narrower than a voxel.
        1.0 / (1.0 + ((r - 1.0) * radii[0] * 1.0).exp())
    };
    let values = [[900.0, 300.0], [600.0, 700.0], [200.0, 950.0], [750.0, 450.0], [1000.0, 880.0]];
    let lesion = if grown { [21.0, 19.0, 20.0] } else { [16.0, 15.0, 15.0] };
    let shapes = [
        ([0.0, 0.0, 0.0], [70.0, 84.0, 62.0]),
        ([0.0, -2.0, 3.0], [60.0, 73.0, 52.0]),
        ([-9.0, -4.0, 2.0], [5.0, 20.0, 8.0]),
        ([22.0, -14.0, 9.0], [15.0, 24.0, 14.0]),
        ([-30.0, 30.0, 14.0], lesion),
    ];
    let folds = 60.0 * ((p.x * 0.31).sin() * (p.y * 0.27 + 1.0).sin() * (p.z * 0.29 - 0.5).sin());
    let mut value = 0.0;
    for (shape, values) in shapes.iter().zip(values) {
        let w = inside(shape.0, shape.1);
        value += w * (values[contrast] - value);
    }
    (value + folds * inside(shapes[1].0, shapes[1].1)).max(0.0)
}

fn grid(dims: [usize; 3], spacing_mm: [f64; 3]) -> Grid {
    let spacing = DVec3::from_array(spacing_mm);
    let last = DVec3::from_array(dims.map(|n| n as f64 - 1.0));
    Grid::axis_aligned(dims, spacing, -0.5 * spacing * last).unwrap()
}

fn usual() -> Grid {
    grid([51, 60, 44], [3.0, 3.0, 3.0])
}

fn scan(grid: &Grid, value: impl Fn(DVec3) -> f64) -> Volume {
    let values = (0..grid.voxel_count()).map(|l| value(grid.center_of_voxel_mm(ijk(grid.dims(), l))) as f32);
    Volume::new(grid.clone(), Samples::F32(values.collect()), Scaling::NONE).unwrap()
}

fn rigid(axis: [f64; 3], degrees: f64, shift_mm: [f64; 3]) -> DAffine3 {
    let axis = DVec3::from_array(axis).try_normalize().unwrap();
    let matrix3 = DMat3::from_quat(DQuat::from_axis_angle(axis, degrees.to_radians()));
    DAffine3 { matrix3, translation: DVec3::from_array(shift_mm) }
}

/// The head as a scanner at another date shows it: point x of the fixed image lies at `truth` x.
fn moved(grid: &Grid, truth: DAffine3, contrast: usize, grown: bool) -> Volume {
    let back = truth.inverse();
    scan(grid, |p| head(back.transform_point3(p), contrast, grown))
}

fn lesion_surface() -> Vec<DVec3> {
    let corner = |at: usize, bit: usize| if at >> bit & 1 == 1 { 7.0 } else { -7.0 };
    (0..8).map(|at| DVec3::new(-30.0 + corner(at, 0), 30.0 + corner(at, 1), 14.0 + corner(at, 2))).collect()
}

fn error_mm(outcome: &Outcome, truth: DAffine3) -> f64 {
    let distance = |p: &DVec3| outcome.moving_mm(*p).distance(truth.transform_point3(*p));
    lesion_surface().iter().map(distance).fold(0.0, f64::max)
}

fn options() -> Options {
    Options { finest_mm: 3.0, max_points: 15_000, ..Options::default() }
}

fn run(fixed: &Volume, moving: &Volume, options: &Options) -> Result<Outcome, RegisterError> {
    register(&Image::whole(fixed), &Image::whole(moving), options, &Progress::new())
}

#[test]
fn identical_images_stay_where_they_are() {
    let image = moved(&usual(), DAffine3::IDENTITY, 0, false);
    for (model, start) in [(Model::Rigid, None), (Model::Affine, Some(DAffine3::IDENTITY))] {
        let outcome = run(&image, &image, &Options { model, start, ..options() }).unwrap();
        assert!(error_mm(&outcome, DAffine3::IDENTITY) < 1e-6, "{outcome:?}");
        assert_eq!(outcome.measure, Measure::SameModality);
        assert!(outcome.warnings.is_empty(), "{outcome:?}");
    }
}

/// The parametric head is sampled exactly at both dates, so nothing is interpolated in the input.
#[test]
fn a_known_motion_with_growth_and_bias_is_found_and_leaving_lesions_out_helps() {
    let truth = rigid([1.0, -2.0, 0.5], 14.0, [12.0, -9.0, 15.0]);
    let fixed = scan(&usual(), |p| head(p, 0, false));
    let back = truth.inverse();
    let moving = scan(&usual(), |p| {
        let gain = 1.3 * (0.004 * p.x - 0.003 * p.y + 2e-5 * p.z * p.z).exp();
        gain * head(back.transform_point3(p), 0, true)
    });
    let outcome = run(&fixed, &moving, &options()).unwrap();
    assert_eq!(outcome.measure, Measure::SameModality);
    let whole_mm = error_mm(&outcome, truth);
    assert!(whole_mm < 0.1, "{whole_mm}");
    let ball = |grid: &Grid, pose: DAffine3| {
        let centre = pose.transform_point3(DVec3::new(-30.0, 30.0, 14.0));
        let inside = |l| grid.center_of_voxel_mm(ijk(grid.dims(), l)).distance(centre) < 22.0;
        Mask::new("lesion", grid.clone(), MaskBits::from_fn(grid.dims(), inside)).unwrap()
    };
    let masks = [ball(&usual(), DAffine3::IDENTITY), ball(&usual(), truth)];
    let (of_fixed, of_moving) = ([&masks[0]], [&masks[1]]);
    let fixed = Image { volume: &fixed, excluded: &of_fixed };
    let moving = Image { volume: &moving, excluded: &of_moving };
    let near = Options { start: Some(outcome.moving_from_fixed), ..options() };
    let without = register(&fixed, &moving, &near, &Progress::new()).unwrap();
    assert!(error_mm(&without, truth) < 0.05, "{}", error_mm(&without, truth));
    let found =
        consistency(&fixed, &moving, &options(), &without, &lesion_surface(), &Progress::new()).unwrap();
    assert_eq!((found.runs, found.failed), (6, 0));
    let (all, lesions) = (found.all.unwrap(), found.lesions.unwrap());
    assert!(all.p95_mm < 0.1 && lesions.max_mm <= all.max_mm, "{found:?}");
    // The fit with lesions is the very one above, so their distance is known.
    assert!(lesions.max_mm > 0.2 * whole_mm.min(0.02), "{found:?}");
    assert_eq!(found.floor_mm, 1.5);
    assert_eq!(found.p95_with_floor_mm(), Some(1.5));
}

#[test]
fn other_contrasts_are_aligned_with_a_third_of_the_field_cut() {
    let truth = rigid([0.2, 1.0, 0.7], 12.0, [-10.0, 8.0, 14.0]);
    let fixed = moved(&usual(), DAffine3::IDENTITY, 0, false);
    let cut = usual().crop([0, 0, 15], [51, 60, 29]).unwrap();
    let moving = moved(&cut, truth, 1, false);
    let outcome = run(&fixed, &moving, &options()).unwrap();
    assert_eq!(outcome.measure, Measure::AcrossModalities);
    assert!(error_mm(&outcome, truth) < 0.5, "{}", error_mm(&outcome, truth));
}

#[test]
fn thick_slices_are_aligned_with_thin_ones() {
    let truth = rigid([1.0, 0.3, -0.6], 9.0, [7.0, -12.0, 5.0]);
    let fixed = moved(&usual(), DAffine3::IDENTITY, 0, false);
    let moving = moved(&grid([76, 90, 26], [2.0, 2.0, 5.0]), truth, 0, false);
    let outcome = run(&fixed, &moving, &options()).unwrap();
    assert!(error_mm(&outcome, truth) < 0.3, "{}", error_mm(&outcome, truth));
}

#[test]
fn an_affine_map_is_found() {
    let mut truth = rigid([1.0, 1.0, 1.0], 7.0, [4.0, 3.0, -6.0]);
    truth.matrix3 *= DMat3::from_cols(
        DVec3::new(1.05, 0.0, 0.0),
        DVec3::new(0.02, 0.97, 0.0),
        DVec3::new(0.0, -0.03, 1.02),
    );
    let fixed = moved(&usual(), DAffine3::IDENTITY, 0, false);
    let moving = moved(&usual(), truth, 0, false);
    for measure in [Measure::SameModality, Measure::AcrossModalities] {
        let start = Some(rigid([1.0, 1.0, 1.0], 5.0, [3.0, 3.0, -4.0]));
        let affine = Options { model: Model::Affine, measure, start, ..options() };
        let outcome = run(&fixed, &moving, &affine).unwrap();
        assert!(error_mm(&outcome, truth) < 0.2, "{measure:?} {}", error_mm(&outcome, truth));
        let rigid = run(&fixed, &moving, &Options { model: Model::Rigid, ..affine }).unwrap();
        assert!(error_mm(&rigid, truth) > 0.5, "a rigid map can't be right");
        let lengths = rigid.moving_from_fixed.matrix3.to_cols_array();
        assert!((lengths[..3].iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

/// Exchanging the images inverts the transform: the half-way space and the points in it are the same.
#[test]
fn exchanging_images_inverts_the_transform() {
    let truth = rigid([0.0, 1.0, 1.0], 6.0, [5.0, 9.0, -4.0]);
    let fixed = moved(&usual(), DAffine3::IDENTITY, 0, false);
    let moving = moved(&usual(), truth, 0, true);
    for measure in [Measure::SameModality, Measure::AcrossModalities] {
        let given = |start| Options { measure, start: Some(start), ..options() };
        let near = rigid([0.0, 1.0, 1.0], 5.0, [4.0, 8.0, -4.0]);
        let forth = run(&fixed, &moving, &given(near)).unwrap().moving_from_fixed;
        let back = run(&moving, &fixed, &given(near.inverse())).unwrap().moving_from_fixed;
        let round = back * forth;
        for p in lesion_surface() {
            assert!(
                round.transform_point3(p).distance(p) < 0.002,
                "{measure:?} {}",
                round.transform_point3(p) - p
            );
        }
    }
}

#[test]
fn the_same_input_gives_the_same_bits_on_any_number_of_threads() {
    let truth = rigid([0.3, 1.0, 0.1], 5.0, [3.0, 6.0, -4.0]);
    let fixed = moved(&usual(), DAffine3::IDENTITY, 0, false);
    for (contrast, measure) in [(0, Measure::SameModality), (1, Measure::AcrossModalities)] {
        let moving = moved(&usual(), truth, contrast, false);
        let given = Options { measure, start: Some(DAffine3::IDENTITY), ..options() };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(&fixed, &moving, &given)).unwrap()
        };
        let (one, three) = (with(1), with(3));
        assert_eq!(one.moving_from_fixed.to_cols_array(), three.moving_from_fixed.to_cols_array());
        let other = run(&fixed, &moving, &Options { seed: 2, ..given }).unwrap();
        assert_ne!(one.moving_from_fixed, other.moving_from_fixed, "the seed chooses the points");
    }
}

#[test]
fn a_mirrored_image_is_refused_or_reported() {
    let truth = rigid([0.0, 0.3, 1.0], 8.0, [6.0, -5.0, 4.0]);
    let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let fixed = moved(&usual(), DAffine3::IDENTITY, 0, false);
    for contrast in [0, 1] {
        let moving = moved(&usual(), mirror * truth, contrast, false);
        match run(&fixed, &moving, &options()) {
            Err(RegisterError::Mirrored { straight, mirrored }) => assert!(mirrored > straight),
            // The other contrast hardly tells left from right in this head.
            Ok(outcome) if contrast == 1 => {
                assert!(matches!(outcome.warnings[..], [Warning::SidesUnsure { .. }]), "{outcome:?}");
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn wrong_axes_are_found_and_reported() {
    let fixed = moved(&usual(), DAffine3::IDENTITY, 0, false);
    let turn = rigid([0.0, 0.0, 1.0], 180.0, [0.0; 3]);
    let moving = moved(&grid([60, 60, 44], [3.0, 3.0, 3.0]), turn, 0, false);
    let outcome = run(&fixed, &moving, &options()).unwrap();
    assert!(error_mm(&outcome, turn) < 0.05, "{}", error_mm(&outcome, turn));
    assert_eq!(outcome.warnings, [Warning::AxesExchanged]);
    // A half turn has no half way: it is taken out of the start, and of repetitions.
    let near = rigid([0.0, 0.0, 1.0], 176.0, [2.0, -1.0, 1.0]);
    let given = run(&fixed, &moving, &Options { start: Some(near), ..options() }).unwrap();
    assert!(error_mm(&given, turn) < 0.05, "{}", error_mm(&given, turn));
    let (fixed, moving) = (Image::whole(&fixed), Image::whole(&moving));
    let found =
        consistency(&fixed, &moving, &options(), &given, &lesion_surface(), &Progress::new()).unwrap();
    assert_eq!((found.runs, found.failed, found.lesions), (5, 0, None));
    assert!(found.all.unwrap().p95_mm < 0.05, "{found:?}");
}

#[test]
fn voxels_that_are_not_finite_are_outside() {
    let truth = rigid([1.0, 0.0, 1.0], 4.0, [3.0, 2.0, -5.0]);
    let fixed = scan(&usual(), |p| if p.z < -30.0 { f64::NAN } else { head(p, 0, false) });
    let back = truth.inverse();
    let moving =
        scan(&usual(), |p| if p.x > 45.0 { f64::INFINITY } else { head(back.transform_point3(p), 0, false) });
    let outcome = run(&fixed, &moving, &Options { start: Some(DAffine3::IDENTITY), ..options() }).unwrap();
    assert!(error_mm(&outcome, truth) < 0.05, "{}", error_mm(&outcome, truth));
}

#[test]
fn what_can_not_be_aligned_is_refused_with_its_reason() {
    let good = moved(&usual(), DAffine3::IDENTITY, 0, false);
    let refused = |moving: &Volume| run(&good, moving, &options()).unwrap_err();
    let constant = refused(&scan(&usual(), |_| 5.0));
    assert_eq!(constant, RegisterError::Constant(super::Which::Moving));
    let nothing = refused(&scan(&usual(), |_| f64::NAN));
    assert_eq!(nothing, RegisterError::Empty(super::Which::Moving));
    let thin = refused(&moved(&grid([51, 60, 1], [3.0; 3]), DAffine3::IDENTITY, 0, false));
    assert!(matches!(thin, RegisterError::TooThin { voxels: 1, .. }), "{thin}");
    let noise = |p: DVec3| (p.dot(DVec3::new(12.9898, 78.233, 37.719)).sin() * 43758.5453).rem_euclid(1.0);
    let noise = refused(&scan(&usual(), noise));
    assert!(matches!(noise, RegisterError::Disagree { .. } | RegisterError::Ambiguous { .. }), "{noise}");
    // The lower parts of two heads that only share a rim.
    let far = Options { start: Some(DAffine3::from_translation(DVec3::new(0.0, 150.0, 0.0))), ..options() };
    let apart = run(&good, &good, &far).unwrap_err();
    assert!(matches!(apart, RegisterError::NoOverlap { share, .. } if share < 0.3), "{apart}");
    for (wrong, what) in [
        (Options { margin_mm: f64::NAN, ..options() }, "margin_mm"),
        (Options { finest_mm: 0.0, ..options() }, "finest_mm"),
        (Options { max_points: 0, ..options() }, "max_points"),
    ] {
        assert_eq!(run(&good, &good, &wrong), Err(RegisterError::Options(what)));
    }
    let reflection = Options { start: Some(DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0))), ..options() };
    assert!(matches!(run(&good, &good, &reflection), Err(RegisterError::NotFinite(_))));
}

#[test]
fn a_loop_that_turns_ends_a_chord_away() {
    let there = rigid([0.0, 0.0, 1.0], 20.0, [5.0, -3.0, 40.0]);
    let on = rigid([1.0, 0.0, 0.0], -11.0, [0.0, 12.0, 3.0]);
    let back = (on * there).inverse();
    // 3° too far about the z axis, and 4 mm along it.
    let beyond = rigid([0.0, 0.0, 1.0], 3.0, [0.0, 0.0, 4.0]);
    let at = |radius: f64| DVec3::new(0.6 * radius, 0.8 * radius, -17.0);
    let off_mm = |radius: f64| (2.0 * radius * 1.5_f64.to_radians().sin()).hypot(4.0);
    let spread = around(&[there, on, beyond * back], &[at(0.0), at(30.0), at(60.0)]).unwrap();
    assert!((spread.median_mm - off_mm(30.0)).abs() < 1e-9, "{spread:?}");
    assert!((spread.max_mm - off_mm(60.0)).abs() < 1e-9, "{spread:?}");
    assert_eq!(around(&[there], &[]), None);
}

#[test]
fn a_cancelled_registration_ends_without_an_outcome() {
    let image = moved(&usual(), DAffine3::IDENTITY, 0, false);
    let progress = Progress::new();
    progress.cancel();
    let whole = Image::whole(&image);
    let ended = register(&whole, &whole, &options(), &progress);
    assert!(matches!(ended, Err(RegisterError::Cancelled(_))), "{ended:?}");
    let progress = Progress::new();
    let near = Options { start: Some(DAffine3::IDENTITY), ..options() };
    register(&whole, &whole, &near, &progress).unwrap();
    assert_eq!(progress.fraction(), Some(1.0));
}
