//! The context view's ray step against the same integral in `f64`, sixteen times as fine.

use std::{sync::Arc, time::Duration};

use glam::DVec3;
use glioscope_core::Selection;

use super::{
    AccuracyError, Axis, Bench, Curve, Family, Point,
    measure::{Errors, delta_e_of},
    scenes,
    sweep::Sweep,
};
use crate::{
    ContextRenderer, ContextScene, ContextVolume, MaskColors, Palette, Quality, TransferPreset,
    reference::emission::{Sampling, march},
};

/// Red, green, blue over white: what is displayed.
fn over_white(p: &[f64; 4]) -> [f64; 3] {
    std::array::from_fn(|c| p[c] + 1.0 - p[3])
}

fn errors(found: &[[f64; 4]], truth: &[[f64; 4]]) -> (Errors, [f64; 2]) {
    let mut errors = Errors::default();
    // Pixels that nothing is in would water the error down.
    let seen = || found.iter().zip(truth).filter(|(f, t)| f[3] > 0.0 || t[3] > 0.0);
    for (f, t) in seen() {
        let (f, t) = (over_white(f), over_white(t));
        (0..3).for_each(|c| errors.add(f[c] - t[c]));
    }
    (errors, delta_e_of(seen().map(|(f, t)| (over_white(f), over_white(t)))))
}

pub(super) fn scene(volume: &Arc<ContextVolume>, preset: TransferPreset) -> ContextScene {
    let grid = volume.grid();
    let center_mm = grid.center_mm();
    let radius_mm = 0.62 * grid.corners_mm()[0].distance(center_mm);
    ContextScene {
        volume: Some(Arc::clone(volume)),
        transfer: Arc::new(preset.transfer(volume.statistics())),
        clip: Vec::new(),
        tumor: None,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[]),
        lens: None,
        tubes: Vec::new(),
        camera: scenes::camera(center_mm + DVec3::Z, radius_mm),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    }
}

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    let size = bench.effort.of([24, 24], [64, 64], [144, 144]);
    let finest = bench.effort.of(0.25, 0.0625, 0.03125);
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
        what: "context: step",
        rounds: bench.effort.of(1, 3, 9),
        patience: Duration::from_millis(4000),
        on_device: true,
    };
    let settings: Vec<(String, f64)> = steps.iter().map(|step| (format!("{step} mm"), *step)).collect();
    bench.progress.say("making the head phantom");
    let volume = Arc::new(ContextVolume::new(scenes::image(scenes::phantom()?, "T1c")?));
    let mut renderer = ContextRenderer::new(bench.gpu)?;
    let mut out = Vec::new();
    for preset in presets {
        let scene = scene(&volume, *preset);
        bench.begin("context: truth", preset.name())?;
        let truth_at = |step_mm| march(&scene, size, Sampling { step_mm, jitter: false });
        let truth = truth_at(finest);
        bench.progress.check()?;
        // The midpoint rule's error falls by four a halving, so a third of the last change is left.
        let truth_error = errors(&truth_at(2.0 * finest), &truth).0.rms() / 3.0;
        let run = |renderer: &mut ContextRenderer, &context_step_mm: &f64| {
            let quality = Quality { context_step_mm, ..Quality::FULL };
            renderer.render(bench.gpu, &scene, &quality, size)?;
            Ok(bench.wait()?)
        };
        let look = |renderer: &mut ContextRenderer, &step_mm: &f64| {
            let marched = renderer.frame().map(|f| f.marched(bench.gpu)).transpose()?.unwrap_or_default();
            let found: Vec<[f64; 4]> = marched.iter().map(|m| m.rgba()).collect();
            let (errors, delta_e) = errors(&found, &truth);
            let is_default = step_mm == Quality::FULL.context_step_mm;
            Ok(Point { delta_e: Some(delta_e), is_default, ..Point::new(step_mm, &errors) })
        };
        let points = bench.sweep(&sweep, &mut renderer, &settings, run, look)?;
        out.push(Curve {
            family: Family::Context,
            kernel: "ray march".to_owned(),
            scene: format!("head phantom T1c, {}, {}x{} pixels", preset.name(), size[0], size[1]),
            knob: "Quality::context_step_mm",
            truth: format!("the emission and absorption integral in f64, steps of {finest} mm"),
            truth_error: Some(truth_error),
            unit: "display value, 0 to 1",
            axis: Axis::Time,
            points,
        });
    }
    Ok(out)
}
