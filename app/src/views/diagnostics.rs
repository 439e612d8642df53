//! What was drawn, what was left out and why, how long each pass took, and on what.

use egui::{Grid, RichText, ScrollArea, Ui};
use glioscope_render::{Gpu, Quality, SceneRenderer};

use crate::{
    comparing::Comparisons,
    viewport::{Screen, Viewport},
};

/// Draws the panel.
pub fn show(ui: &mut Ui, viewport: Option<&mut Viewport>, comparisons: &Comparisons) {
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        let Some(viewport) = viewport else {
            ui.label("No graphics adapter.");
            ui.label(comparisons.force());
            return;
        };
        ui.label(RichText::new("Adapter").strong());
        ui.label(viewport.gpu.describe());
        let Viewport { gpu, closeup, context, ellipsoids, change } = viewport;
        screen(ui, "Closeup", gpu, closeup);
        screen(ui, "Context view", gpu, context);
        for note in context.frame().iter().flat_map(|frame| &frame.notes) {
            ui.label(format!("Note: {note}."));
        }
        screen(ui, "Ellipsoid diagram", gpu, ellipsoids);
        screen(ui, "Change view", gpu, change);
        ui.label(comparisons.force());
    });
}

/// How light was found, and how far off it is likely to be.
fn light_text(quality: &Quality) -> String {
    let way = quality.lighting.shading.title();
    match quality.expected_error() {
        Some([surfaces, tissue]) => format!(
            "{way}. Expected error: {surfaces:.3} of white on opaque surfaces, {tissue:.3} in tissue (root mean \
             square in linear light, as measured on the head phantom)."
        ),
        None => format!("{way}. Expected error: unknown, no truth was measured for it."),
    }
}

fn screen<R: SceneRenderer>(ui: &mut Ui, name: &str, gpu: &Gpu, screen: &mut Screen<R>) {
    ui.add_space(6.0);
    ui.label(RichText::new(name).strong());
    let Some((plan, [width, height])) = screen.plan() else {
        ui.label("Not drawn: no pane shows it.");
        return;
    };
    if let Some(share) = screen.share_done() {
        ui.label(format!("A finer picture is being drawn: {:.0} %.", 100.0 * share));
    }
    let omitted = plan.omitted.clone();
    let frames = screen.frames_drawn;
    let quality = screen.quality().copied();
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
            ui.label(error);
        }
    }
    if let Some(quality) = quality {
        ui.label(light_text(&quality));
    }
    if omitted.is_empty() {
        ui.label("Left out: nothing.");
    }
    for (pass, reason) in &omitted {
        ui.label(format!("Left out: {}: {reason}", pass.name()));
    }
    ui.weak(format!("Frames drawn: {frames}"));
}
