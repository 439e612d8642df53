//! Tolerance and method of enclosing ellipsoids, against a run asked for 1e-12.

use std::time::Duration;

use glam::DVec3;
use glioscope_core::{
    Components, Connectivity,
    ellipsoid::{Method, Options, enclose, hull_corners},
};

use super::{AccuracyError, Axis, Bench, Curve, Family, Point, measure::Errors, scenes, sweep::Sweep};

const TRUTH: f64 = 1e-12;

/// Corners of every component of every mask and region of the phantom that are not solid boxes.
fn jobs() -> Result<Vec<Vec<DVec3>>, AccuracyError> {
    let index = &scenes::phantom()?.index;
    let labelled = |c| Components::of_index_mask(index, c, Connectivity::TwentySix);
    let masks = (0..index.mask_ids().len()).map(labelled);
    let mut out = Vec::new();
    for components in masks.chain([Components::of_index(index, Connectivity::TwentySix)]) {
        let components = components.map_err(|e| AccuracyError::of(&e))?;
        let corners = components.list().iter().map(|c| hull_corners(components.runs(c), c.start));
        // Boxes have a closed form and don't come to a search.
        out.extend(corners.filter(|c| c.len() > 8));
    }
    Ok(out)
}

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    bench.progress.say("making the head phantom");
    let mut jobs = jobs()?;
    if bench.effort == super::Effort::Tiny {
        jobs.sort_by_key(Vec::len);
        jobs.truncate(3);
    }
    let volumes = |options: &Options| -> Vec<Option<f64>> {
        jobs.iter().map(|points| enclose(points, options).map(|e| e.volume())).collect()
    };
    bench.begin("ellipsoids: truth", "1e-12")?;
    let exact = Options { tolerance: TRUTH, ..Options::default() };
    let truth = volumes(&exact);
    let decades: &[f64] = bench.effort.of(
        &[1e-1, 1e-7],
        &[1e-1, 1e-3, 1e-5, 1e-7, 1e-9],
        &[1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10],
    );
    let least = |method| match method {
        Method::Exchange => 0.0,
        Method::AwaySteps => 1e-9,
        // Its steps are of the order of one over the tolerance.
        Method::Khachiyan => 1e-3,
    };
    let mut out = Vec::new();
    for method in [Method::Exchange, Method::AwaySteps, Method::Khachiyan] {
        let sweep = Sweep {
            what: method.name(),
            rounds: bench.effort.of(1, 3, 25),
            patience: Duration::from_millis(3000),
            on_device: false,
        };
        let settings: Vec<(String, Options)> = decades
            .iter()
            .filter(|t| **t >= least(method))
            .map(|&tolerance| (format!("{tolerance:e}"), Options { method, tolerance, ..Options::default() }))
            .collect();
        let mut found = Vec::new();
        let points = bench.sweep(
            &sweep,
            &mut found,
            &settings,
            |found, options| {
                *found = volumes(options);
                Ok(())
            },
            |found, options| {
                let mut errors = Errors::default();
                for (f, t) in found.iter().zip(&truth) {
                    errors.add(f.zip(*t).map_or(f64::NAN, |(f, t)| f / t - 1.0));
                }
                let is_default = *options == Options::default();
                Ok(Point { is_default, ..Point::new(options.tolerance, &errors) })
            },
        )?;
        out.push(Curve {
            family: Family::Ellipsoids,
            kernel: method.name().to_owned(),
            scene: format!("{} components of the head phantom's masks and regions", jobs.len()),
            knob: "ellipsoid::Options::tolerance",
            truth: format!("volumes of exchange at {TRUTH:e}, certified"),
            truth_error: Some(TRUTH),
            unit: "relative volume",
            axis: Axis::Time,
            points,
        });
    }
    Ok(out)
}
