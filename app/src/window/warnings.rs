//! The warnings above the panes and the status line below them.

use std::time::Duration;

use egui::{Color32, Panel, Ui};
use glioscope_core::{Check, Severity};

use crate::{
    command::{AppCommand, Commands, Workstation},
    world::jobs::progress_text,
};

/// Strip of the case's warnings, shown as long as there are any. `open`: whether all are listed.
pub fn strip(ui: &mut Ui, checks: &[Check], open: &mut bool) {
    let (serious, notes): (Vec<&Check>, Vec<&Check>) =
        checks.iter().partition(|check| check.severity >= Severity::Warning);
    let Some(first) = serious.first() else { return };
    let (fill, ink) = if ui.visuals().dark_mode {
        (Color32::from_rgb(92, 62, 6), Color32::from_rgb(255, 226, 165))
    } else {
        (Color32::from_rgb(255, 232, 176), Color32::from_rgb(82, 50, 0))
    };
    let frame = egui::Frame::new().fill(fill).inner_margin(egui::Margin::symmetric(8, 4));
    Panel::top("warnings").frame(frame).show(ui, |ui| {
        ui.visuals_mut().override_text_color = Some(ink);
        ui.horizontal(|ui| {
            let text = if *open { "Hide warnings" } else { "Show warnings" };
            ui.strong(format!("{} warning{}", serious.len(), if serious.len() == 1 { "" } else { "s" }));
            if ui.button(text).clicked() {
                *open = !*open;
            }
            ui.add(egui::Label::new(&first.message).truncate());
        });
        if *open {
            egui::ScrollArea::vertical().max_height(180.0).show(ui, |ui| {
                for check in serious.iter().chain(&notes) {
                    ui.horizontal_wrapped(|ui| {
                        ui.monospace(check.code);
                        ui.label(&check.message);
                    });
                }
            });
        }
    });
}

/// Status line: loading progress, and the last error, which can be dismissed, or notice.
pub fn status(ui: &mut Ui, work: &mut Workstation, out: &mut Commands) {
    ui.horizontal(|ui| {
        if let Some(load) = &work.job {
            let progress = &load.job.progress;
            ui.spinner();
            ui.label(progress_text(progress));
            if let Some(fraction) = progress.fraction() {
                ui.add(egui::ProgressBar::new(fraction as f32).desired_width(160.0));
            }
            if ui.button("Cancel").clicked() {
                out.push(AppCommand::CancelLoading);
            }
            ui.ctx().request_repaint_after(Duration::from_millis(100));
        }
        let mut dismissed = false;
        if let Some(error) = &work.error {
            dismissed = ui.button("Dismiss").clicked();
            ui.colored_label(ui.visuals().error_fg_color, error.to_string());
        } else if let Some(notice) = &work.notice {
            ui.label(notice);
        }
        if dismissed {
            work.error = None;
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.weak("Research use only. Not a medical device.");
        });
    });
}
