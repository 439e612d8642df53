use super::*;
use super::{plan::Ball, shape::square_to};
use crate::{
    MaskBits, Samples, Scaling, Volume,
    case::{CaseSpec, ContextSpec, LoadOptions, MaskSpec, load_with},
    files::{Loaded, Source},
    grid::ijk,
};

fn grid_of(half_mm: f64, spacing: DVec3) -> Grid {
    let dims: [usize; 3] = spacing.to_array().map(|s| 2 * (half_mm / s).ceil() as usize + 1);
    let shift = DVec3::new(0.17, -0.31, 0.23) * spacing;
    let origin = DVec3::from_array(dims.map(|n| -((n - 1) as f64) / 2.0)) * spacing + shift;
    Grid::axis_aligned(dims, spacing, origin).unwrap()
}

fn mask_of(grid: &Grid, inside: impl Fn(DVec3) -> bool) -> Mask {
    let bits = MaskBits::from_fn(grid.dims(), |l| inside(grid.center_of_voxel_mm(ijk(grid.dims(), l))));
    Mask::new("M", grid.clone(), bits).unwrap()
}

/// A case of one date: a mask, and an image where there is one.
fn case_of(mask: &Mask, image: Option<&Volume>) -> Case {
    let source = |name: &'static str| Source::Embedded { name, bytes: &[] };
    let one = MaskSpec {
        id: "M".into(),
        source: source("mask"),
        labels: None,
        above: None,
        time: None,
        color: None,
        name: None,
    };
    let of_image = |_: &Volume| ContextSpec { id: "T1c".into(), source: source("image"), time: None };
    let spec = CaseSpec {
        name: "made".into(),
        masks: vec![one],
        contexts: image.iter().map(|image| of_image(image)).collect(),
        ..CaseSpec::default()
    };
    let dims = mask.grid().dims();
    let samples: Vec<u8> =
        (0..mask.grid().voxel_count()).map(|l| u8::from(mask.bits().get(ijk(dims, l)))).collect();
    let of_mask = Volume::new(mask.grid().clone(), Samples::U8(samples), Scaling::NONE).unwrap();
    let read = |source: &Source| {
        let volume = if source.name() == "mask" { of_mask.clone() } else { image.unwrap().clone() };
        Ok(Loaded { volume, frames: 1, checks: Vec::new(), origin: None })
    };
    load_with(&spec, &LoadOptions::default(), &Progress::new(), &read).unwrap()
}

/// Smooth structures within a ball, brighter in the lesion: something to register.
fn head(grid: &Grid, lesion: impl Fn(DVec3) -> bool) -> Volume {
    let value = |p: DVec3| {
        if p.length() > 55.0 {
            return 0.0;
        }
        let waves = (p.x / 7.0).sin() * (p.y / 9.0).cos() + (p.z / 8.0 + p.x / 15.0).sin();
        100.0 + 25.0 * waves + if lesion(p) { 80.0 } else { 0.0 } + 10.0 * (p.y / 30.0)
    };
    let values = (0..grid.voxel_count()).map(|l| value(grid.center_of_voxel_mm(ijk(grid.dims(), l))) as f32);
    Volume::new(grid.clone(), Samples::F32(values.collect()), Scaling::NONE).unwrap()
}

fn checked(case: &Case, options: &Options) -> Result<SelfCheckReport, SelfCheckError> {
    self_check(case, &Target::resolve(case, None, None).unwrap(), options, &Progress::new())
}

#[test]
fn distances_to_a_triangle_are_those_to_its_densest_points() {
    let mut random = Random::of(7, 1, 2);
    let mut place = || DVec3::new(random.within(3.0), random.within(3.0), random.within(3.0));
    for _ in 0..40 {
        let (triangle, p) = ([place(), place(), place()], place());
        let mut least = f64::INFINITY;
        for i in 0..=200 {
            for j in 0..=200 - i {
                let (u, v) = (f64::from(i) / 200.0, f64::from(j) / 200.0);
                let q = triangle[0] * (1.0 - u - v) + triangle[1] * u + triangle[2] * v;
                least = least.min(q.distance(p));
            }
        }
        let found = square_to(&triangle, p).sqrt();
        assert!(found <= least + 1e-9 && found > least - 0.06, "{found} {least}");
    }
}

#[test]
fn a_balls_shape_has_its_distances_and_volumes() {
    let (radius, progress) = (12.0, Progress::new());
    for (spacing, off_mm, off_ml) in [(DVec3::ONE, 0.15, 0.03), (DVec3::new(1.0, 1.0, 3.0), 0.45, 0.08)] {
        let mask = mask_of(&grid_of(20.0, spacing), |p| p.length() < radius);
        let shape = Shape::new(&mask, 2.0, &progress).unwrap().unwrap();
        let (mut sum, mut count, mut random) = (0.0, 0.0, Random::of(3, 4, 5));
        for _ in 0..4000 {
            let p = random.direction() * (radius + random.within(2.0));
            sum += (shape.at(p) - (p.length() - radius)).abs();
            count += 1.0;
        }
        assert!(sum / count < off_mm, "{spacing}: {}", sum / count);
        let own_ml = mask.volume_ml();
        let ml = shape.volume_ml([0.0; 2], &|mm, _| mm < 0.0);
        assert!((ml / own_ml - 1.0).abs() < 0.003, "{spacing}: {ml} of {own_ml}");
        // Grown and shrunk as a ball of the mask's volume.
        let same = (own_ml * 1000.0 * 0.75 / std::f64::consts::PI).cbrt();
        for by_mm in [-2.0, -1.0, 1.0, 2.0] {
            let truth_ml = std::f64::consts::PI / 750.0 * ((same + by_mm).powi(3) - same.powi(3));
            let change_ml = shape.volume_ml([by_mm; 2], &|mm, _| mm < by_mm) - ml;
            assert!((change_ml / truth_ml - 1.0).abs() < off_ml, "{spacing} {by_mm}: {change_ml} {truth_ml}");
        }
        // Rasterised where it lies, it is the mask but for a few voxels at its border.
        let again = shape.raster(mask.grid(), glam::DAffine3::IDENTITY, &|mm, _| mm < 0.0);
        let differ = (0..mask.grid().voxel_count()).map(|l| ijk(mask.grid().dims(), l));
        let differ = differ.filter(|v| again.get(*v) != mask.bits().get(*v)).count();
        assert!(differ as f64 <= 0.01 * mask.voxels() as f64, "{spacing}: {differ} of {}", mask.voxels());
    }
}

#[test]
fn one_side_moves_and_the_other_stays() {
    let side = Side { towards: DVec3::X, middle_mm: DVec3::new(5.0, 0.0, 0.0), half_mm: 4.0 };
    let known = Known { by_mm: -2.0, side: Some(side) };
    for (x, mm) in [(0.0, 0.0), (1.0, 0.0), (5.0, -1.0), (9.0, -2.0), (30.0, -2.0)] {
        assert!((known.at(DVec3::new(x, 7.0, -3.0)) - mm).abs() < 1e-12, "{x}");
    }
    assert_eq!(Known::NOTHING.at(DVec3::ONE), 0.0);
}

#[test]
fn new_lesions_have_room() {
    let mask = mask_of(&grid_of(20.0, DVec3::ONE), |p| p.length() < 10.0);
    let shape = Shape::new(&mask, 2.0, &Progress::new()).unwrap().unwrap();
    let sites = Sites::around(&shape, &surface::points_mm(&[&mask], usize::MAX), None, 30.0);
    let mut random = Random::of(1, 2, 3);
    for _ in 0..20 {
        let balls: Vec<Ball> =
            sites.balls(&[0.1, 0.5, 1.0], &|_| true, &mut random).into_iter().flatten().collect();
        assert_eq!(balls.len(), 3);
        for (n, ball) in balls.iter().enumerate() {
            let volume = 4.0 / 3.0 * std::f64::consts::PI * ball.radius_mm().powi(3) / 1000.0;
            assert!((volume - ball.volume_ml).abs() < 1e-12);
            let gap_mm = ball.centre_mm.length() - 10.0 - ball.radius_mm();
            assert!(gap_mm > 4.0, "{gap_mm}");
            for other in &balls[n + 1..] {
                let apart = other.centre_mm.distance(ball.centre_mm);
                assert!(apart > other.radius_mm() + ball.radius_mm() + 4.9);
            }
        }
    }
}

/// Without an image: the shares of masks alone, all known changes of a ball of 1 mm voxels.
#[test]
fn a_ball_without_an_image_recovers_what_is_known() {
    let mask = mask_of(&grid_of(20.0, DVec3::ONE), |p| (p * DVec3::new(1.0, 0.9, 1.1)).length() < 12.0);
    let case = case_of(&mask, None);
    let options = Options { runs: 8, full_runs: 0, ..Options::default() };
    let report = checked(&case, &options).unwrap();
    println!("{report:#?}");
    assert_eq!((report.unchanged.runs, report.unchanged.false_calls), (100, 0), "{:?}", report.unchanged);
    assert!(report.image.is_none() && report.registration.is_none());
    assert!(report.notes.iter().any(|note| note.contains("Without an image")), "{:?}", report.notes);
    for check in report.surfaces.iter().filter(|check| check.known_mm != 0.0) {
        let [surface, volume] = [check.surface.unwrap(), check.volume.unwrap()];
        // Where a surface moves by less than a voxel, lengths between voxel centres are too long: see docs/self-check.md.
        let most = if check.at == Where::Evenly { 1.1 } else { 1.25 };
        assert!((0.9..=most).contains(&surface.share), "{check:?}");
        assert_eq!(surface.marked, !GOOD.contains(&surface.share));
        assert!((volume.share - 1.0).abs() < 0.05 && !volume.marked, "{check:?}");
        assert!(surface.standard_error.unwrap() < 0.05, "{check:?}");
    }
    let still = report.surfaces.iter().find(|check| check.known_mm == 0.0).unwrap();
    assert!(still.mean_mm.abs() < 0.1 && still.surface.is_none() && still.called == 0, "{still:?}");
    for check in report.lesions.iter().filter(|check| check.known_ml >= 0.2) {
        assert_eq!(check.found, check.runs, "{check:?}");
    }
    let moved = report.surfaces.iter().find(|check| check.known_mm == 2.0).unwrap();
    assert_eq!(moved.called, moved.runs, "2 mm are called: {moved:?}");
}

/// A hundred runs without change on a small image: the whole way, registration included.
#[test]
fn a_hundred_runs_without_change_call_hardly_one() {
    let grid = grid_of(62.0, DVec3::new(2.0, 2.0, 2.5));
    let inside = |p: DVec3| (p - DVec3::new(15.0, 8.0, -5.0)).length() < 13.0;
    let case = case_of(&mask_of(&grid, inside), Some(&head(&grid, inside)));
    let options = Options { runs: 2, full_runs: 1, ..Options::default() };
    let report = checked(&case, &options).unwrap();
    println!("{report:#?}");
    let registration = report.registration.as_ref().unwrap();
    assert_eq!(registration.refused, 0, "{registration:?}");
    assert!(registration.max_mm.unwrap() < 0.5, "{registration:?}");
    assert_eq!(report.image.as_deref(), Some("T1c"));
    assert_eq!(report.unchanged.runs, 100);
    assert!(report.unchanged.false_calls <= 1 && !report.unchanged.marked, "{:?}", report.unchanged);
}

#[test]
fn the_same_seed_gives_the_same_report_and_another_another() {
    let mask = mask_of(&grid_of(14.0, DVec3::ONE), |p| p.length() < 7.0);
    let case = case_of(&mask, None);
    let options = Options { runs: 1, unchanged_runs: 3, full_runs: 0, ..Options::default() };
    let report = checked(&case, &options).unwrap();
    assert_eq!(checked(&case, &options).unwrap(), report);
    let other = checked(&case, &Options { seed: 2, ..options }).unwrap();
    assert_ne!(other.surfaces, report.surfaces);
}

#[test]
fn a_change_without_a_skeleton_is_called_alike() {
    use crate::change::{Call, change};
    let grid = grid_of(20.0, DVec3::new(1.0, 1.0, 2.0));
    let before = mask_of(&grid, |p| p.length() < 11.0);
    for (after, is_change) in [
        (mask_of(&grid, |p| (p - DVec3::new(0.4, 0.2, 0.0)).length() < 11.2), false),
        (mask_of(&grid, |p| p.length() < 14.0), true),
        (mask_of(&grid, |p| p.length() < 11.0 && p.x < 5.0), true),
    ] {
        let of = |by_skeleton: bool| {
            let options = ChangeOptions { by_skeleton, ..ChangeOptions::default() };
            Call::of(&change(before.bits(), after.bits(), &grid, &options, &Progress::new()).unwrap())
        };
        assert_eq!(of(true), of(false));
        assert_eq!(of(true).is_change(), is_change, "{:?}", of(true));
    }
}

#[test]
fn what_cannot_be_checked_is_refused() {
    let grid = grid_of(10.0, DVec3::ONE);
    let case = case_of(&mask_of(&grid, |_| false), None);
    assert_eq!(checked(&case, &Options::default()), Err(SelfCheckError::Empty));
    let case = case_of(&mask_of(&grid, |p| p.length() < 5.0), None);
    for options in [
        Options { unchanged_runs: 0, ..Options::default() },
        Options { runs: 0, ..Options::default() },
        Options { full_runs: 101, ..Options::default() },
    ] {
        assert!(matches!(checked(&case, &options), Err(SelfCheckError::Options(_))));
    }
    let text = Target::resolve(&case, Some("N"), None).unwrap_err().to_string();
    assert_eq!(text, "made: found no mask N, expected one of M");
    let progress = Progress::new();
    progress.cancel();
    let target = Target::resolve(&case, None, None).unwrap();
    let cancelled = self_check(&case, &target, &Options::default(), &progress);
    assert_eq!(cancelled, Err(SelfCheckError::Cancelled(Cancelled)));
}

#[test]
fn large_lesions_have_fewer_runs_and_it_is_said() {
    let mut notes = Vec::new();
    let options = Options::default();
    assert_eq!(options.fitting(1_500_000, &mut notes), options);
    assert_eq!(Options { fits_minute: false, ..options }.fitting(9_000_000, &mut notes).unchanged_runs, 100);
    assert!(notes.is_empty());
    let fewer = options.fitting(6_000_000, &mut notes);
    assert_eq!((fewer.unchanged_runs, fewer.runs, fewer.full_runs), (25, 1, 1));
    assert!(notes[0].contains("25 runs without change in place of 100"), "{notes:?}");
    let fewest = options.fitting(600_000_000, &mut notes);
    assert_eq!((fewest.unchanged_runs, fewest.runs), (10, 1));
    assert_eq!(Options { unchanged_runs: 3, ..options }.fitting(600_000_000, &mut notes).unchanged_runs, 3);
}
