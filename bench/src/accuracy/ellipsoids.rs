//! Tolerance and method of the enclosing ellipsoids, compared with a run at tolerance 1e-12.

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
    about: "The error is the relative excess of the volume over the minimum; the tolerance is certified, so the \
            error never exceeds it. Time is that of all components one after another, without computing the hull \
            corners. The default, exchange at 1e-7, costs little more than 1e-3, because the last digits come from \
            Newton steps, and keeps volumes accurate in every displayed digit.",
    defaults: Defaults::One,
    curves,
};

/// Tolerance of the truth.
const TRUTH_TOLERANCE: f64 = 1e-12;

/// Hull corners of every component of every mask and region of the phantom, except of filled boxes.
fn component_corners() -> Outcome<Vec<Vec<DVec3>>> {
    let index = &scenes::phantom()?.index;
    let labelled = |c| Components::of_index_mask(index, c, Connectivity::TwentySix);
    let masks = (0..index.mask_ids().len()).map(labelled);
    let mut out = Vec::new();
    for components in masks.chain([Components::of_index(index, Connectivity::TwentySix)]) {
        let components = components?;
        let corners = components.list().iter().map(|c| hull_corners(components.runs(c), c.start));
        // Boxes, with eight corners, have a closed form and need no iteration.
        out.extend(corners.filter(|c| c.len() > 8));
    }
    Ok(out)
}

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let mut components = component_corners()?;
    if bench.effort == Effort::Tiny {
        components.sort_by_key(Vec::len);
        components.truncate(3);
    }
    let volumes = |options: &Options| -> Vec<Option<f64>> {
        components.iter().map(|points| enclose(points, options).map(|e| e.volume())).collect()
    };
    bench.begin("ellipsoids: truth", "1e-12");
    let truth = volumes(&Options { tolerance: TRUTH_TOLERANCE, ..Options::default() });
    let decades: &[f64] = bench.effort.of(
        &[1e-1, 1e-7],
        &[1e-1, 1e-3, 1e-5, 1e-7, 1e-9],
        &[1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10],
    );
    let min_tolerance = |method| match method {
        Method::Exchange => 0.0,
        Method::AwaySteps => 1e-9,
        // Its number of iterations is of the order of one over the tolerance.
        Method::Khachiyan => 1e-3,
    };
    let mut out = Vec::new();
    for method in [Method::Exchange, Method::AwaySteps, Method::Khachiyan] {
        let sweep = Sweep {
            label: method.name(),
            rounds: bench.effort.of(1, 3, 25),
            time_budget: Duration::from_millis(3000),
            on_device: false,
        };
        let settings: Vec<(String, Options)> = decades
            .iter()
            .filter(|t| **t >= min_tolerance(method))
            .map(|&tolerance| (format!("{tolerance:e}"), Options { method, tolerance, ..Options::default() }))
            .collect();
        let run = |found: &mut Vec<Option<f64>>, options: &Options| {
            *found = volumes(options);
            Ok(())
        };
        let evaluate = |found: &mut Vec<Option<f64>>, options: &Options| {
            let error =
                |(f, t): (&Option<f64>, &Option<f64>)| f.zip(*t).map_or(f64::NAN, |(f, t)| f / t - 1.0);
            let errors = Errors::of(found.iter().zip(&truth).map(error));
            let is_default = *options == Options::default();
            Ok(Point { is_default, ..Point::new(options.tolerance, &errors) })
        };
        out.push(Curve {
            family: FAMILY.name,
            kernel: method.name().to_owned(),
            scene: format!("{} components of the head phantom's masks and regions", components.len()),
            knob: "ellipsoid::Options::tolerance",
            truth: format!("volumes by exchange at tolerance {TRUTH_TOLERANCE:e}, certified"),
            truth_error: Some(TRUTH_TOLERANCE),
            unit: "relative volume",
            axis: Axis::Time,
            points: bench.sweep(&sweep, &mut Vec::new(), &settings, run, evaluate)?,
        });
    }
    Ok(out)
}
