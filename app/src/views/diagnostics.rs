//! Diagnostics: adapter, size and quality of each 3D view's frame, time of each render pass, omitted passes with
//! reason.

use egui::{Grid, RichText, ScrollArea, Ui};
use glioscope_render::{Gpu, Quality, light};

use super::{
    pane::{Pane, Stage},
    view3d::ScreenReport,
};
use crate::command::Commands;

/// The pane of diagnostics.
#[derive(Default)]
pub struct DiagnosticsPane;

impl Pane for DiagnosticsPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, _: &mut Commands) {
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            match stage.graphics {
                Some(graphics) => {
                    ui.label(RichText::new("Adapter").strong());
                    ui.label(graphics.gpu.describe());
                    for (pane, screen) in &mut stage.screens {
                        report(ui, pane.tab(), &graphics.gpu, *screen);
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

/// Lighting mode and its expected error, as text.
pub fn light_text(quality: &Quality) -> String {
    let mode = light::row(quality.lighting.mode).title;
    let ambient = 100.0 * (1.0 - quality.occlusion_strength.clamp(0.0, 1.0));
    let mode = format!("{mode}, {ambient:.0} % of it ambient");
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

fn report(ui: &mut Ui, name: &str, gpu: &Gpu, screen: &mut dyn ScreenReport) {
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
    if let Some(quality) = screen.quality() {
        ui.label(light_text(quality));
    }
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
