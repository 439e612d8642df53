//! Marks, medians and colours by hand; every family on tiny scenes.

use std::sync::LazyLock;

use glioscope_core::Progress;

use super::{half::to_half, *};
use crate::gpu::test_gpu;

static GPU: LazyLock<Gpu> = LazyLock::new(test_gpu);

fn point(median_ms: f64, error_rms: f64) -> Point {
    let mut errors = Errors::default();
    errors.add(error_rms);
    Point {
        time: Some(Timing { median_ms, q1_ms: median_ms, q3_ms: median_ms, runs: 1 }),
        ..Point::new(1.0, &errors)
    }
}

fn curve(scene: &str, points: Vec<Point>) -> Curve {
    Curve {
        family: Family::Occlusion,
        kernel: "k".to_owned(),
        scene: scene.to_owned(),
        knob: "x",
        truth: "t".to_owned(),
        truth_error: None,
        unit: "u",
        axis: Axis::Time,
        points,
    }
}

#[test]
fn the_front_is_what_nothing_beats() {
    let mut curves = vec![
        curve("a", vec![point(1.0, 4.0), point(2.0, 3.0), point(3.0, 3.0), point(4.0, 1.0)]),
        curve("a", vec![point(2.5, 2.0), point(4.0, 1.0), point(9.0, f64::NAN)]),
        // Another scene, where everything is better: it beats nothing of the first.
        curve("b", vec![point(0.1, 0.1)]),
    ];
    mark_pareto(&mut curves);
    let marks: Vec<Vec<bool>> =
        curves.iter().map(|c| c.points.iter().map(|p| p.is_pareto).collect()).collect();
    // Two equal points don't beat each other.
    assert_eq!(marks, [vec![true, true, false, true], vec![true, true, false], vec![true]]);
    // Processor time decides where there is some.
    let mut slow = point(9.0, 9.0);
    slow.cpu = Some(Timing { median_ms: 0.5, q1_ms: 0.5, q3_ms: 0.5, runs: 1 });
    let mut both = vec![curve("a", vec![slow, point(1.0, 9.0)])];
    mark_pareto(&mut both);
    assert!(both[0].points[0].is_pareto && !both[0].points[1].is_pareto);
    let mut knob = curve("a", vec![point(1.0, 1.0)]);
    knob.axis = Axis::Knob;
    let mut alone = vec![knob];
    mark_pareto(&mut alone);
    assert!(!alone[0].points[0].is_pareto);
}

/// What slows the machine for a while must slow all settings: none is finished before the next begins.
#[test]
fn settings_are_measured_in_rounds_and_looked_at_once() {
    let progress = Progress::new();
    let bench = Bench { gpu: &GPU, effort: Effort::Whole, progress: &progress };
    let sweep = sweep::Sweep {
        what: "sleep",
        rounds: 3,
        patience: std::time::Duration::from_secs(1),
        on_device: false,
    };
    let settings = [40u32, 200, 1200].map(|ms| (format!("{ms} ms"), ms));
    let look = |log: &mut Vec<(u32, bool)>, ms: &u32| {
        log.push((*ms, true));
        Ok(Point::new(f64::from(*ms), &Errors::default()))
    };
    let run = |log: &mut Vec<(u32, bool)>, ms: &u32| {
        std::thread::sleep(std::time::Duration::from_millis(u64::from(*ms)));
        log.push((*ms, false));
        Ok(())
    };
    let mut log = Vec::new();
    let points = bench.sweep(&sweep, &mut log, &settings, run, look).unwrap();
    log.dedup();
    let order: Vec<u32> = log.iter().filter(|l| !l.1).map(|l| l.0).collect();
    // The longest is one run and no more.
    assert!(order.starts_with(&[40, 200, 1200, 40, 200, 40]), "{order:?}");
    assert_eq!(log.iter().filter(|l| l.1).map(|l| l.0).collect::<Vec<_>>(), [40, 200, 1200]);
    assert_eq!(points.iter().map(|p| p.setting.as_str()).collect::<Vec<_>>(), ["40 ms", "200 ms", "1200 ms"]);
    let runs: Vec<usize> = points.iter().map(|p| p.time.unwrap().runs).collect();
    assert_eq!((runs[0], runs[2]), (3, 1), "{runs:?}");
    for (point, ms) in points.iter().zip([40.0, 200.0, 1200.0]) {
        assert!(point.time.unwrap().median_ms >= ms, "{point:?}");
    }
    // Whoever asks to stop is heard between two settings.
    progress.cancel();
    let stopped = bench.sweep(&sweep, &mut Vec::new(), &settings, run, look);
    assert!(matches!(stopped, Err(AccuracyError::Cancelled(_))));
}

#[test]
fn quartiles_lie_between_neighbours() {
    assert_eq!(quartiles(&[]), None);
    assert_eq!(quartiles(&[7.0]), Some([7.0; 3]));
    assert_eq!(quartiles(&[5.0, 1.0, 3.0]), Some([2.0, 3.0, 4.0]));
    assert_eq!(quartiles(&[4.0, 1.0, 2.0, 3.0]), Some([1.75, 2.5, 3.25]));
}

#[test]
fn errors_are_root_mean_square_and_largest() {
    let mut errors = Errors::default();
    [3.0, -4.0, 0.0, 0.0].iter().for_each(|e| errors.add(*e));
    assert_eq!((errors.rms(), errors.max()), (2.5, 4.0));
    errors.add(f64::NAN);
    assert!(errors.rms().is_nan() && errors.max().is_nan());
}

/// sRGB red, green and blue in CIELAB, as tables of colour have them (D65, two-degree observer).
#[test]
fn colour_differences_are_those_of_cielab() {
    let off = |a, b, expected: f64| assert!((delta_e(a, b) - expected).abs() < 0.2, "{}", delta_e(a, b));
    off([1.0; 3], [0.0; 3], 100.0);
    // Red is (53.24, 80.09, 67.20), green (87.74, −86.18, 83.18).
    let red = f64::hypot(f64::hypot(53.24, 80.09), 67.20);
    off([1.0, 0.0, 0.0], [0.0; 3], red);
    let apart = f64::hypot(f64::hypot(87.74 - 53.24, 86.18 + 80.09), 83.18 - 67.20);
    off([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], apart);
    assert_eq!(delta_e([0.3, 0.5, 0.7], [0.3, 0.5, 0.7]), 0.0);
}

#[test]
fn half_floats_round_as_ieee_754_says() {
    for exact in [0.0, 1.0, 0.5, 65504.0, 2f64.powi(-24), 2f64.powi(-14), -1.5] {
        assert_eq!(to_half(exact), exact);
    }
    let ulp = 2f64.powi(-10);
    assert_eq!(to_half(1.0 + 0.5 * ulp), 1.0, "ties to even");
    assert_eq!(to_half(1.0 + 1.5 * ulp), 1.0 + 2.0 * ulp);
    assert_eq!(to_half(1.0 - 0.2 * ulp), 1.0);
    assert_eq!(to_half(0.333_333), 0.333_251_953_125);
    assert_eq!(to_half(2f64.powi(-26)), 0.0);
    assert_eq!(to_half(70000.0), f64::INFINITY);
}

fn tiny(family: Family) -> Vec<Curve> {
    let curves = curves(&GPU, Effort::Tiny, &[family], &Progress::new()).unwrap();
    for c in &curves {
        println!("{} | {} | {} | truth off {:?}", c.kernel, c.scene, c.truth, c.truth_error);
        for p in &c.points {
            println!(
                "   {}: rms {:.3e} max {:.3e} ΔE {:?} {:?}",
                p.setting, p.error_rms, p.error_max, p.delta_e, p.time
            );
            assert!(p.error_rms.is_finite() && p.error_max >= p.error_rms, "{p:?}");
        }
    }
    assert!(curves.iter().all(|c| c.points.len() >= 2 && c.family == family));
    curves
}

/// Points of each curve that are marked as what the program does by itself: one where the curve's
/// kernel is the program's choice, and has a knob.
fn defaults(curves: &[Curve], expected: &[usize]) {
    let found: Vec<usize> = curves.iter().map(|c| c.points.iter().filter(|p| p.is_default).count()).collect();
    assert_eq!(found, expected);
}

fn falls(curve: &Curve, factor: f64) {
    let [first, .., last] = &curve.points[..] else { panic!("{curve:?}") };
    assert!(last.error_rms < factor * first.error_rms, "{}: {first:?} {last:?}", curve.kernel);
}

#[test]
fn smaller_ray_steps_are_righter() {
    let curves = tiny(Family::Context);
    falls(&curves[0], 0.5);
    assert!(curves[0].truth_error.unwrap() < 0.2 * curves[0].points[1].error_rms);
    defaults(&curves, &[1]);
}

/// More pairs come nearer to the pass's own integral.
#[test]
fn more_pairs_are_righter() {
    let curves = tiny(Family::Ambient);
    falls(&curves[1], 0.8);
    assert!(curves[0].truth_error.unwrap() > 0.0, "a standard error");
    defaults(&curves, &[1, 1]);
}

/// Cones fall to within two standard errors of Monte Carlo; all slices are held against the same.
#[test]
fn cones_come_to_monte_carlo() {
    let curves = tiny(Family::Occlusion);
    let cones = curves.iter().find(|c| c.kernel == "cones").unwrap();
    falls(cones, 0.5);
    let se = cones.truth_error.unwrap();
    assert!(cones.points.last().unwrap().error_rms <= 2.0 * se, "{cones:?}");
    assert!(curves.iter().all(|c| c.truth == cones.truth && c.truth_error == Some(se)));
    // The paper's approximate variant, the mended one, cones: the paper's is never the default.
    defaults(&curves, &[0, 1, 1]);
}

/// Along the path of the presets more time is less error.
#[test]
fn costlier_light_of_a_view_is_righter() {
    let curves = tiny(Family::View);
    let kernels: Vec<&str> = curves.iter().map(|c| c.kernel.as_str()).collect();
    assert_eq!(kernels, ["cones", "slices"]);
    for curve in &curves {
        falls(curve, 0.95);
        assert!(curve.truth_error.unwrap() < curve.points[0].error_rms, "{curve:?}");
    }
    // The slices' reference.
    defaults(&curves, &[0, 1]);
}

#[test]
fn tolerances_are_kept() {
    for c in tiny_ellipsoids() {
        for p in &c.points {
            assert!(p.error_max <= p.value * 1.000_001 + 1e-11, "{p:?}");
        }
    }
}

fn tiny_ellipsoids() -> Vec<Curve> {
    let curves = curves(&GPU, Effort::Tiny, &[Family::Ellipsoids], &Progress::new()).unwrap();
    falls(&curves[0], 0.1);
    // Exchange is the default's method.
    defaults(&curves, &[1, 0, 0]);
    curves
}

/// The force's angle falls with θ to nearly nothing, and the skeleton comes nearer.
#[test]
fn smaller_openings_are_nearer_the_exact_sum() {
    let curves = tiny(Family::Skeleton);
    let [force, skeleton] = &curves[..] else { panic!() };
    assert_eq!((force.unit, skeleton.unit), ("degrees", "mm"));
    for pair in force.points.windows(2) {
        assert!(pair[1].error_rms < pair[0].error_rms, "{force:?}");
    }
    falls(force, 0.2);
    assert!(force.points[2].error_rms > 0.0, "the truth is another sum");
    assert!(skeleton.points[2].error_rms <= skeleton.points[0].error_rms, "{skeleton:?}");
    defaults(&curves, &[1, 1]);
}

/// Trilinear interpolation is of second order.
#[test]
fn finer_images_are_righter() {
    let curves = tiny(Family::Resampling);
    falls(&curves[0], 1.5 / 9.0);
    // No knob of the program.
    defaults(&curves, &[0]);
}

/// algorithms.md 6: half floats stagnate as slices rise; figures as measured there, for a thickness of 1.
#[test]
fn half_floats_get_worse_with_slices() {
    let curves = tiny(Family::Half);
    let [half, single, visible, visible_single, opacity, opacity_single] = &curves[..] else { panic!() };
    assert!(half.points[6].error_rms > 3.0 * half.points[0].error_rms);
    assert!(single.points.iter().all(|p| p.error_max < 1e-4));
    let at = |c: &Curve, slices: f64| c.points.iter().find(|p| p.value == slices).unwrap().error_max;
    let e = (-1.0f64).exp();
    for (curve, slices, expected) in [
        (visible, 1000.0, 0.010),
        (visible, 4000.0, 0.61),
        // It never leaves 1, and the opacity sticks at a quarter.
        (visible, 8000.0, 1.0 - e),
        (opacity, 8000.0, 1.0 - e - 0.25),
    ] {
        assert!(
            (at(curve, slices) - expected).abs() < 0.002,
            "{} {slices}: {}",
            curve.kernel,
            at(curve, slices)
        );
    }
    for curve in [visible_single, opacity_single] {
        assert!(curve.points.iter().all(|p| p.error_max < 2e-4), "{curve:?}");
    }
    defaults(&curves, &[0; 6]);
}

#[test]
fn a_cancelled_run_stops() {
    let progress = Progress::new();
    progress.cancel();
    let stopped = curves(&GPU, Effort::Tiny, &Family::ALL, &progress);
    assert!(matches!(stopped, Err(AccuracyError::Cancelled(_))), "{stopped:?}");
}
