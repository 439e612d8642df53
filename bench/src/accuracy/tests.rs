//! The Pareto front of hand-made points, every family on tiny scenes, and the written files.

use std::sync::LazyLock;

use glioscope_render::AdapterPreference;

use super::{front::mark_pareto, *};

static GPU: LazyLock<Gpu> =
    LazyLock::new(|| Gpu::headless(AdapterPreference::SoftwareOnly).expect("tests need mesa-vulkan-drivers"));

fn bench(effort: Effort) -> Bench<'static> {
    Bench { gpu: &GPU, effort }
}

fn point(median_ms: f64, error_rms: f64) -> Point {
    Point { time: Timing::of(&[median_ms]), ..Point::new(1.0, &Errors::of([error_rms])) }
}

fn curve(scene: &str, points: Vec<Point>) -> Curve {
    Curve {
        family: "context",
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
fn pareto_points_are_not_dominated() {
    let mut curves = vec![
        curve("a", vec![point(1.0, 4.0), point(2.0, 3.0), point(3.0, 3.0), point(4.0, 1.0)]),
        curve("a", vec![point(2.5, 2.0), point(4.0, 1.0), point(9.0, f64::NAN)]),
        // Another scene with better points, which don't dominate those of the first.
        curve("b", vec![point(0.1, 0.1)]),
    ];
    mark_pareto(&mut curves);
    let marks: Vec<Vec<bool>> =
        curves.iter().map(|c| c.points.iter().map(|p| p.is_pareto).collect()).collect();
    // Two equal points don't dominate each other.
    assert_eq!(marks, [vec![true, true, false, true], vec![true, true, false], vec![true]]);
    // Processor time is the cost where it is measured.
    let mut slow = point(9.0, 9.0);
    slow.cpu = Timing::of(&[0.5]);
    let mut both = vec![curve("a", vec![slow, point(1.0, 9.0)])];
    mark_pareto(&mut both);
    assert!(both[0].points[0].is_pareto && !both[0].points[1].is_pareto);
    let mut knob = curve("a", vec![point(1.0, 1.0)]);
    knob.axis = Axis::Knob;
    let mut knob_only = vec![knob];
    mark_pareto(&mut knob_only);
    assert!(!knob_only[0].points[0].is_pareto);
}

/// Rounds are interleaved: no setting is finished before the next begins.
#[test]
fn settings_are_measured_in_rounds_and_evaluated_once() {
    let sweep =
        sweep::Sweep { label: "sleep", rounds: 3, time_budget: Duration::from_secs(1), on_device: false };
    let settings = [40u32, 200, 1200].map(|ms| (format!("{ms} ms"), ms));
    let evaluate = |log: &mut Vec<(u32, bool)>, ms: &u32| {
        log.push((*ms, true));
        Ok(Point::new(f64::from(*ms), &Errors::default()))
    };
    let run = |log: &mut Vec<(u32, bool)>, ms: &u32| {
        std::thread::sleep(Duration::from_millis(u64::from(*ms)));
        log.push((*ms, false));
        Ok(())
    };
    let mut log = Vec::new();
    let points = bench(Effort::Whole).sweep(&sweep, &mut log, &settings, run, evaluate).unwrap();
    log.dedup();
    let order: Vec<u32> = log.iter().filter(|l| !l.1).map(|l| l.0).collect();
    // The longest setting runs once.
    assert!(order.starts_with(&[40, 200, 1200, 40, 200, 40]), "{order:?}");
    assert_eq!(log.iter().filter(|l| l.1).map(|l| l.0).collect::<Vec<_>>(), [40, 200, 1200]);
    assert_eq!(points.iter().map(|p| p.setting.as_str()).collect::<Vec<_>>(), ["40 ms", "200 ms", "1200 ms"]);
    let runs: Vec<usize> = points.iter().map(|p| p.time.unwrap().runs).collect();
    assert_eq!((runs[0], runs[2]), (3, 1), "{runs:?}");
    for (point, ms) in points.iter().zip([40.0, 200.0, 1200.0]) {
        assert!(point.time.unwrap().median_ms >= ms, "{point:?}");
    }
}

fn measure_tiny(name: &str) -> MeasuredFamily {
    let family = FAMILIES.into_iter().find(|f| f.name == name).unwrap();
    let measured = measure(&bench(Effort::Tiny), family).unwrap();
    for c in &measured.curves {
        println!("{} | {} | {} | error of the truth {:?}", c.kernel, c.scene, c.truth, c.truth_error);
        for p in &c.points {
            println!(
                "   {}: rms {:.3e} max {:.3e} ΔE {:?} {:?}",
                p.setting, p.error_rms, p.error_max, p.delta_e, p.time
            );
            assert!(p.error_rms.is_finite() && p.error_max >= p.error_rms, "{p:?}");
            assert!(p.time.is_some_and(|t| t.median_ms > 0.0));
        }
        assert!(!c.points.is_empty() && c.family == name);
    }
    measured
}

/// Number of points of each curve that are marked as defaults.
fn defaults(curves: &[Curve]) -> Vec<usize> {
    curves.iter().map(|c| c.points.iter().filter(|p| p.is_default).count()).collect()
}

/// Asserts that the last point's RMS error is below `factor` times the first's.
fn assert_error_falls(curve: &Curve, factor: f64) {
    let [first, .., last] = &curve.points[..] else { panic!("{curve:?}") };
    assert!(last.error_rms < factor * first.error_rms, "{}: {first:?} {last:?}", curve.kernel);
}

#[test]
fn smaller_ray_steps_are_more_accurate() {
    let MeasuredFamily { curves, .. } = measure_tiny("context");
    assert_error_falls(&curves[0], 0.5);
    assert!(curves[0].truth_error.unwrap() < 0.2 * curves[0].points[1].error_rms);
    assert_eq!(defaults(&curves), [1]);
}

/// More rays approach the hemisphere, and are nearer to it than what only reads depths; more pairs approach the pass's own
/// integral.
#[test]
fn more_rays_and_point_pairs_are_more_accurate() {
    let MeasuredFamily { curves, .. } = measure_tiny("ambient");
    let [rays, horizons, pairs, .., own] = &curves[..] else { panic!("{} curves", curves.len()) };
    assert_error_falls(rays, 0.8);
    assert_error_falls(own, 0.8);
    assert!(rays.truth_error.unwrap() > 0.0, "a standard error");
    let least = |c: &Curve| c.points.iter().map(|p| p.error_rms).fold(f64::INFINITY, f64::min);
    assert!(least(rays) < least(horizons) && least(horizons) < least(pairs), "{curves:?}");
    assert_eq!(defaults(&curves), [2, 0, 0, 2, 0, 0, 0, 0]);
}

/// Many cones through the voxels themselves converge to Monte Carlo, up to 8-bit rounding; vicinity occlusion doesn't.
#[test]
fn cones_on_masks_converge_to_monte_carlo() {
    let MeasuredFamily { curves, .. } = measure_tiny("masks");
    let [cones, vicinity, layers] = &curves[..] else { panic!() };
    let at = |c: &Curve, name: &str| c.points.iter().find(|p| p.setting == name).unwrap().error_rms;
    let (one, many) = (at(cones, "1 sub-cones, voxels"), at(cones, "16 sub-cones, voxels"));
    assert!(many < 0.5 * one, "{one} {many}");
    assert!(at(cones, "reference") < at(cones, "draft"));
    assert!(many < vicinity.points.iter().map(|p| p.error_rms).fold(f64::INFINITY, f64::min));
    let (fine, coarse) = (at(layers, "cells 1, layers 1 mm"), at(layers, "cells 4, layers 1 mm"));
    assert!(fine != coarse && coarse < 1.2 * fine, "{fine} {coarse}");
    // Balanced's cells aren't among the tiny settings.
    assert_eq!(defaults(&curves), [3, 3, 0]);
}

/// Along the path of the presets the error falls as the cost rises.
#[test]
fn costlier_lighting_is_more_accurate() {
    let MeasuredFamily { curves, .. } = measure_tiny("light");
    let kernels: Vec<&str> = curves.iter().map(|c| c.kernel.as_str()).collect();
    assert_eq!(kernels, ["cones", "slices"]);
    for curve in &curves {
        assert_error_falls(curve, 0.95);
        assert!(curve.truth_error.unwrap() < curve.points[0].error_rms, "{curve:?}");
    }
    // Only the slices' reference is among the tiny settings.
    assert_eq!(defaults(&curves), [0, 1]);
}

/// So it does in the light of a lamp.
#[test]
fn costlier_lamplight_is_more_accurate() {
    let MeasuredFamily { curves, .. } = measure_tiny("lamp");
    let kernels: Vec<&str> = curves.iter().map(|c| c.kernel.as_str()).collect();
    assert_eq!(kernels, ["half-angle, lamp upper left", "shadow-volume, lamp upper left"]);
    for curve in &curves {
        assert_error_falls(curve, 0.5);
    }
    // The reference is among the tiny settings.
    assert_eq!(defaults(&curves), [1, 1]);
}

/// No volume exceeds the minimum by more than the tolerance.
#[test]
fn ellipsoid_tolerances_are_met() {
    let MeasuredFamily { curves, .. } = measure_tiny("ellipsoids");
    assert_error_falls(&curves[0], 0.1);
    // Exchange is the default's method.
    assert_eq!(defaults(&curves), [1, 0, 0]);
    for p in curves.iter().flat_map(|c| &c.points) {
        assert!(p.error_max <= p.value * 1.000_001 + 1e-11, "{p:?}");
    }
}

/// The force's angular error falls with θ to almost 0, and the skeleton's distance doesn't grow.
#[test]
fn smaller_opening_bounds_approach_the_exact_sum() {
    let MeasuredFamily { curves, .. } = measure_tiny("skeleton");
    let [force, skeleton] = &curves[..] else { panic!() };
    assert_eq!((force.unit, skeleton.unit), ("degrees", "mm"));
    for pair in force.points.windows(2) {
        assert!(pair[1].error_rms < pair[0].error_rms, "{force:?}");
    }
    assert_error_falls(force, 0.2);
    assert!(force.points[2].error_rms > 0.0, "the truth is computed independently");
    assert!(skeleton.points[2].error_rms <= skeleton.points[0].error_rms, "{skeleton:?}");
    assert_eq!(defaults(&curves), [1, 1]);
}

/// Trilinear interpolation is of second order. Numbers, plots and page are written completely.
#[test]
fn finer_images_are_more_accurate_and_files_are_well_formed() {
    let mut measured = measure_tiny("resampling");
    assert_error_falls(&measured.curves[0], 1.5 / 9.0);
    // There is no knob, so there is no default.
    assert_eq!(defaults(&measured.curves), [0]);
    // Characters that CSV and SVG must escape.
    measured.curves[0].scene = "a \"quoted\", <angled> & scene".into();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new/folder");
    let run_start = report::RunStart::now(&GPU);
    let points = measured.curves[0].points.len();
    let all = [measured];
    report::write(&all, &run_start, &out).unwrap();
    let mut csv = csv::Reader::from_path(out.join("accuracy.csv")).unwrap();
    assert_eq!(csv.records().map(|r| r.unwrap().len()).collect::<Vec<_>>(), vec![24; points]);
    let page = std::fs::read_to_string(out.join("accuracy.md")).unwrap();
    assert!(page.contains("images/accuracy-resampling.svg"));
    let svg = std::fs::read_to_string(out.join("images/accuracy-resampling.svg")).unwrap();
    assert!(svg.trim_end().ends_with("</svg>") && svg.matches("<circle").count() >= points, "{svg}");
    assert!(svg.contains("&lt;angled&gt; &amp; scene") && !svg.contains("<angled>"));
    let names: Vec<_> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 3, "no partial files: {names:?}");
    let json = report::json(&all, &run_start, true);
    assert_eq!(json["curves"][0]["points"].as_array().unwrap().len(), points);
}
