//! Diagnostics: adapter, size and quality of each 3D view's frame, time of each render pass, omitted passes with
//! reason.

use std::sync::Arc;

use egui::{Grid, RichText, ScrollArea, Ui};
use glioscope_render::{
    Gpu, Quality,
    light::{self, FrameError, FrameErrors, LightSample, StandardError},
};

use super::{
    draw::name_widget,
    pane::{Pane, Stage},
    view3d::ScreenReport,
};
use crate::{
    command::Commands,
    model::PaneId,
    world::jobs::{Ask, Derived, Lookup, progress_text},
};

/// A view and the number of its frame.
type FrameNumber = (PaneId, u64);

/// The pane of diagnostics.
#[derive(Default)]
pub struct DiagnosticsPane {
    /// The frame whose light was asked to be measured.
    sample: Option<(FrameNumber, Arc<LightSample>)>,
    measured: Derived<FrameNumber, FrameErrors>,
}

impl Pane for DiagnosticsPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, _: &mut Commands) {
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            match stage.graphics {
                Some(graphics) => {
                    ui.label(RichText::new("Adapter").strong());
                    ui.label(graphics.gpu.describe());
                    for (pane, screen) in &mut stage.screens {
                        self.report(ui, (*pane, stage.ask), &graphics.gpu, *screen);
                    }
                }
                None => {
                    ui.label("No graphics adapter.");
                }
            }
            ui.add_space(6.0);
            ui.label(stage.results.comparison.force_text());
        });
    }
}

/// Lighting mode and its error, as text: `measured` in the frame, or else expected.
pub fn light_text(quality: &Quality, measured: Option<StandardError>) -> String {
    let mode = light::row(quality.lighting.mode).title;
    let ambient = 100.0 * (1.0 - quality.occlusion_strength.clamp(0.0, 1.0));
    let mode = format!("{mode}, {ambient:.0} % of it ambient");
    if let Some(StandardError { surfaces, tissue }) = measured {
        let of = |name: &str, error: Option<f64>| error.map(|error| format!("{error:.3} {name}"));
        let errors: Vec<_> =
            [of("on opaque surfaces", surfaces), of("in tissue", tissue)].into_iter().flatten().collect();
        return format!(
            "{mode}. Standard error of this picture: {} (root mean square in linear light, measured in it).",
            if errors.is_empty() { "nothing is lit".to_owned() } else { errors.join(", ") }
        );
    }
    if let Some([tumor, folds]) = light::occlusion_error(quality) {
        return format!(
            "{mode}. Expected error of the occlusion in the closeup: {tumor:.3} of the light, {folds:.3} in deep folds (root \
             mean square, as measured)."
        );
    }
    match light::expected_error(quality) {
        Some([surfaces, tissue]) => format!(
            "{mode}. Expected error of the picture: {surfaces:.3} of white on opaque surfaces, {tissue:.3} in tissue \
             (root mean square in linear light, as measured on the head phantom)."
        ),
        None => format!("{mode}. Expected error: unknown (not measured)."),
    }
}

/// A frame's measured errors, as text.
pub fn measured_text(errors: &FrameErrors) -> String {
    let of = |error: Option<FrameError>, what: &str| {
        error.map(|FrameError { rms, rms_uncertainty, pixels }| {
            format!("{rms:.3} ± {rms_uncertainty:.3} {what} ({pixels} pixels)")
        })
    };
    let found: Vec<String> =
        [of(errors.surfaces, "of the light on opaque surfaces"), of(errors.tissue, "of white in tissue")]
            .into_iter()
            .flatten()
            .collect();
    if found.is_empty() {
        return "Measured in this frame: nothing, it shows nothing that is lit.".to_owned();
    }
    format!("Measured in this frame: {} (root mean square in linear light, against rays).", found.join(", "))
}

impl DiagnosticsPane {
    fn report(&mut self, ui: &mut Ui, (pane, ask): (PaneId, &Ask), gpu: &Gpu, screen: &mut dyn ScreenReport) {
        let name = pane.tab();
        ui.add_space(6.0);
        ui.label(RichText::new(name).strong());
        let Some((plan, [width, height])) = screen.plan() else {
            ui.label("Not drawn: no pane shows it.");
            return;
        };
        let omitted = plan.omitted.clone();
        if let Some(share) = screen.share_done() {
            ui.label(format!("A finer picture is being drawn: {:.0} %.", 100.0 * share));
        }
        match screen.pass_times(gpu) {
            Ok(times) => {
                ui.label(format!("{width} × {height} pixels, times by {}", times.source));
                Grid::new((name, "passes")).num_columns(2).striped(true).show(ui, |ui| {
                    for (pass, milliseconds) in &times.passes {
                        ui.label(pass.name());
                        ui.label(format!("{milliseconds:.2} ms"));
                        ui.end_row();
                    }
                });
            }
            Err(error) => {
                ui.label(error.to_string());
            }
        }
        let noise = screen.standard_error(gpu).ok().flatten();
        if let Some(quality) = screen.quality() {
            ui.label(light_text(quality, noise));
        }
        self.measurement(ui, (pane, screen.frames_drawn()), ask, gpu, screen);
        for note in screen.notes() {
            ui.label(format!("Note: {note}."));
        }
        if omitted.is_empty() {
            ui.label("Left out: nothing.");
        }
        for (pass, reason) in &omitted {
            ui.label(format!("Left out: {}: {reason}", pass.name()));
        }
        ui.weak(format!("Frames drawn: {}", screen.frames_drawn()));
    }

    /// The measured error of the frame, or the button that measures it.
    fn measurement(
        &mut self,
        ui: &mut Ui,
        frame: FrameNumber,
        ask: &Ask,
        gpu: &Gpu,
        screen: &dyn ScreenReport,
    ) {
        if let Some((_, sample)) = self.sample.as_ref().filter(|(number, _)| *number == frame) {
            let sample = Arc::clone(sample);
            match self.measured.get(frame, ask, move |progress| Ok(sample.measure(progress)?)) {
                Lookup::Ready(errors) => ui.label(measured_text(errors)),
                Lookup::Working(progress) => ui.label(format!("Measuring: {}", progress_text(progress))),
                Lookup::Failed(why) => ui.label(why.to_string()),
            };
            return;
        }
        if !screen.light_is_measurable() {
            return;
        }
        let button = ui.button("Measure the error of this frame");
        name_widget(ui, &button, &format!("Measure the error of this frame: {}", frame.0.tab()));
        if button
            .on_hover_text(
                "Compares some thousand of its pixels with rays past masks and fibres and through the image.",
            )
            .clicked()
        {
            match screen.light_sample(gpu) {
                Ok(Some(sample)) => self.sample = Some((frame, Arc::new(sample))),
                Ok(None) => {}
                Err(error) => {
                    ui.label(error.to_string());
                }
            }
        }
    }
}
