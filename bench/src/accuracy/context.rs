//! The context view's ray step, compared with the same integral in `f64` at an eighth of the default step.

use std::time::Duration;

use glioscope_render::{
    ContextRenderer, Quality, TransferPreset,
    views::context::reference::{Sampling, march},
};

use super::{
    Axis, Bench, Curve, Defaults, Family, Point,
    errors::{Errors, delta_e_of},
    scenes,
    sweep::Sweep,
};
use crate::Outcome;

pub(super) const FAMILY: Family = Family {
    name: "context",
    title: "Ray step of the context view",
    about: "The ray-marched image alone, over white, compared with the same rays in `f64` without table, bricks, \
            jitter or early ray termination. The device terminates rays that are almost opaque and packs colours \
            into 16 bits; with the jitter of the first step these set a lower bound of the error. The default, \
            0.5 mm, is half of the finest usual spacing (1 mm): two steps per voxel.",
    defaults: Defaults::One,
    curves,
};

/// The displayed colour: premultiplied red, green, blue and opacity composited over white.
fn over_white(p: &[f64; 4]) -> [f64; 3] {
    std::array::from_fn(|c| p[c] + 1.0 - p[3])
}

fn errors(found: &[[f64; 4]], truth: &[[f64; 4]]) -> (Errors, [f64; 2]) {
    // Empty pixels would dilute the error.
    let non_empty = || {
        let pairs = found.iter().zip(truth).filter(|(f, t)| f[3] > 0.0 || t[3] > 0.0);
        pairs.map(|(f, t)| (over_white(f), over_white(t)))
    };
    let errors = Errors::of(non_empty().flat_map(|(f, t)| (0..3).map(move |c| f[c] - t[c])));
    (errors, delta_e_of(non_empty()))
}

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let size = bench.effort.of([24, 24], [64, 64], [144, 144]);
    let finest = bench.effort.of(0.25, 0.0625, 0.0625);
    let steps: &[f64] = bench.effort.of(
        &[8.0, 1.0, 0.5],
        &[4.0, 2.0, 1.0, 0.5, 0.25],
        &[8.0, 4.0, 2.0, 1.5, 1.0, 0.75, 0.5, 0.35, 0.25, 0.125],
    );
    let presets: &[TransferPreset] = bench.effort.of(
        &[TransferPreset::MrTissue],
        &[TransferPreset::MrSurface],
        &[TransferPreset::MrSurface, TransferPreset::MrTissue],
    );
    let sweep = Sweep {
        label: "context: step",
        rounds: bench.effort.of(1, 3, 9),
        time_budget: Duration::from_millis(4000),
        on_device: true,
    };
    let settings: Vec<(String, f64)> = steps.iter().map(|step| (format!("{step} mm"), *step)).collect();
    let volume = scenes::phantom_image()?;
    let mut renderer = ContextRenderer::new(bench.gpu)?;
    let mut out = Vec::new();
    for preset in presets {
        let scene = scenes::head(&volume, *preset);
        bench.begin("context: truth", preset.name());
        let truth_at = |step_mm| march(&scene, size, Sampling { step_mm, jitter: false });
        let truth = truth_at(finest);
        // Halving the step reduces the midpoint rule's error to a quarter: a third of the last change remains.
        let truth_error = errors(&truth_at(2.0 * finest), &truth).0.rms() / 3.0;
        let run = |renderer: &mut ContextRenderer, &context_step_mm: &f64| {
            let quality = Quality { context_step_mm, ..Quality::FULL };
            renderer.render(bench.gpu, &scene, &quality, size)?;
            Ok(bench.gpu.wait()?)
        };
        let evaluate = |renderer: &mut ContextRenderer, &step_mm: &f64| {
            let found = renderer.frame().ok_or("no frame was drawn")?.image_rgba(bench.gpu)?;
            let (errors, delta_e) = errors(&found, &truth);
            let is_default = step_mm == Quality::FULL.context_step_mm;
            Ok(Point { delta_e: Some(delta_e), is_default, ..Point::new(step_mm, &errors) })
        };
        let points = bench.sweep(&sweep, &mut renderer, &settings, run, evaluate)?;
        out.push(Curve {
            family: FAMILY.name,
            kernel: "ray march".to_owned(),
            scene: format!("head phantom T1c, {}, {}x{} pixels", preset.name(), size[0], size[1]),
            knob: "Quality::context_step_mm",
            truth: format!("the emission-absorption integral in f64, steps of {finest} mm"),
            truth_error: Some(truth_error),
            unit: "display value, 0 to 1",
            axis: Axis::Time,
            points,
        });
    }
    Ok(out)
}
