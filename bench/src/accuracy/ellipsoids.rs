//! Tolerance and method of enclosing ellipsoids, against a run asked for 1e-12.

use std::time::Duration;

use glam::DVec3;
use glioscope_core::{
    Components, Connectivity,
    ellipsoid::{Method, Options, enclose, hull_corners},
};

use super::{Axis, Bench, Curve, Defaults, Effort, Family, Point, errors::Errors, scenes, sweep::Sweep};
use crate::Outcome;

pub(super) const FAMILY: Family = Family {
    name: "ellipsoids",
    title: "Enclosing ellipsoids",
    about: "The error is what the volume exceeds the minimum by; the tolerance is a certificate, so the error \
            is never above it. Time is that of all components one after another, hull corners given. The \
            default, exchange at 1e-7, costs little over 1e-3, because the last digits come from Newton \
            steps, and keeps volumes right in every digit that is shown.",
    defaults: Defaults::One,
    curves,
};

const TRUTH: f64 = 1e-12;

/// Corners of every component of every mask and region of the phantom that are not solid boxes.
fn jobs() -> Outcome<Vec<Vec<DVec3>>> {
    let index = &scenes::phantom()?.index;
    let labelled = |c| Components::of_index_mask(index, c, Connectivity::TwentySix);
    let masks = (0..index.mask_ids().len()).map(labelled);
    let mut out = Vec::new();
    for components in masks.chain([Components::of_index(index, Connectivity::TwentySix)]) {
        let components = components?;
        let corners = components.list().iter().map(|c| hull_corners(components.runs(c), c.start));
        // Boxes have a closed form and don't come to a search.
        out.extend(corners.filter(|c| c.len() > 8));
    }
    Ok(out)
}

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let mut jobs = jobs()?;
    if bench.effort == Effort::Tiny {
        jobs.sort_by_key(Vec::len);
        jobs.truncate(3);
    }
    let volumes = |options: &Options| -> Vec<Option<f64>> {
        jobs.iter().map(|points| enclose(points, options).map(|e| e.volume())).collect()
    };
    bench.begin("ellipsoids: truth", "1e-12");
    let truth = volumes(&Options { tolerance: TRUTH, ..Options::default() });
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
        let run = |found: &mut Vec<Option<f64>>, options: &Options| {
            *found = volumes(options);
            Ok(())
        };
        let look = |found: &mut Vec<Option<f64>>, options: &Options| {
            let off = |(f, t): (&Option<f64>, &Option<f64>)| f.zip(*t).map_or(f64::NAN, |(f, t)| f / t - 1.0);
            let errors = Errors::of(found.iter().zip(&truth).map(off));
            let is_default = *options == Options::default();
            Ok(Point { is_default, ..Point::new(options.tolerance, &errors) })
        };
        out.push(Curve {
            family: FAMILY.name,
            kernel: method.name().to_owned(),
            scene: format!("{} components of the head phantom's masks and regions", jobs.len()),
            knob: "ellipsoid::Options::tolerance",
            truth: format!("volumes of exchange at {TRUTH:e}, certified"),
            truth_error: Some(TRUTH),
            unit: "relative volume",
            axis: Axis::Time,
            points: bench.sweep(&sweep, &mut Vec::new(), &settings, run, look)?,
        });
    }
    Ok(out)
}
