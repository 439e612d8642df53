//! What was drawn, what was left out and why, how long each pass took, and on what.

use egui::{Grid, RichText, ScrollArea, Ui};
use glioscope_render::Scene;

use crate::viewport::Viewport;

/// Draws the panel.
pub fn show(ui: &mut Ui, scene: Option<&Scene>, viewport: Option<&mut Viewport>) {
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        let Some(viewport) = viewport else {
            ui.label("No graphics adapter.");
            return;
        };
        ui.label(RichText::new("Adapter").strong());
        ui.label(viewport.gpu.describe());
        ui.add_space(6.0);
        ui.label(RichText::new("Closeup").strong());
        let Some(frame) = viewport.frame().filter(|_| scene.is_some()) else {
            ui.label("Not drawn: no pane shows it.");
            return;
        };
        let ([width, height], omitted) = (frame.size_px, frame.plan.omitted.clone());
        let times = match viewport.pass_times() {
            Ok(times) => times,
            Err(error) => {
                ui.label(error);
                return;
            }
        };
        ui.label(format!("{width} × {height} pixels, times by {}", times.source));
        Grid::new("passes").num_columns(2).striped(true).show(ui, |ui| {
            for (pass, milliseconds) in &times.passes {
                ui.label(pass.name());
                ui.label(format!("{milliseconds:.2} ms"));
                ui.end_row();
            }
        });
        ui.add_space(6.0);
        ui.label(RichText::new("Left out").strong());
        if omitted.is_empty() {
            ui.label("Nothing.");
        }
        for (pass, reason) in &omitted {
            ui.label(format!("{}: {reason}", pass.name()));
        }
        ui.add_space(6.0);
        ui.label(format!("Frames drawn: {}", viewport.frames_drawn));
    });
}
