//! The warnings above the panes and the status line below them.

use std::time::Duration;

use egui::{Panel, Ui};
use glioscope_core::{Check, Severity, case::Case};

use crate::{
    command::{AppCommand, Command, Commands, Workstation},
    theme::Tokens,
    world::jobs::progress_text,
};

/// Strip of the case's warnings, shown as long as there are any. `open`: whether all are listed.
pub fn strip(ui: &mut Ui, checks: &[Check], open: &mut bool) {
    let (serious, notes): (Vec<&Check>, Vec<&Check>) =
        checks.iter().partition(|check| check.severity >= Severity::Warning);
    let Some(first) = serious.first() else { return };
    let tokens = Tokens::in_ui(ui);
    let frame = egui::Frame::new().fill(tokens.warning_ground).inner_margin(egui::Margin::symmetric(8, 4));
    Panel::top("warnings").frame(frame).show(ui, |ui| {
        ui.horizontal(|ui| {
            let text = if *open { "Hide warnings" } else { "Show warnings" };
            let count = format!("{} warning{}", serious.len(), if serious.len() == 1 { "" } else { "s" });
            sign(ui, tokens.warning);
            ui.label(egui::RichText::new(count).strong().color(tokens.warning));
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

/// A triangle with an exclamation mark: warnings and errors aren't told by colour alone. Drawn, because egui's default
/// fonts lack it.
fn sign(ui: &mut Ui, ink: egui::Color32) {
    let (rect, _) = ui.allocate_exact_size(egui::vec2(14.0, 13.0), egui::Sense::hover());
    let at = |x: f32, y: f32| rect.lerp_inside(egui::vec2(x, y));
    let stroke = egui::Stroke::new(1.4, ink);
    let corners = vec![at(0.5, 0.05), at(0.98, 0.95), at(0.02, 0.95)];
    ui.painter().add(egui::Shape::closed_line(corners, stroke));
    ui.painter().line_segment([at(0.5, 0.36), at(0.5, 0.64)], stroke);
    ui.painter().circle_filled(at(0.5, 0.8), 0.9, ink);
}

/// Width that the words at the right of the status line take, points.
const DISCLAIMER_POINTS: f32 = 270.0;

/// A text that is cut where the words at the right begin; whole under the pointer.
fn line(ui: &mut Ui, text: egui::RichText) {
    let width = (ui.available_width() - DISCLAIMER_POINTS).max(120.0);
    ui.scope(|ui| {
        ui.set_max_width(width);
        ui.add(egui::Label::new(text).truncate());
    });
}

/// What transforms moved in a case, in one line; `None` for nothing.
fn moved(case: &Case) -> Option<String> {
    let mut all: Vec<String> = Vec::new();
    for aligned in &case.aligned {
        let what = if aligned.time.is_empty() || aligned.has_own() { &aligned.id } else { &aligned.time };
        let seen = match &aligned.accepted {
            Some(day) => format!("accepted {day}"),
            None => "no reader has accepted it".to_owned(),
        };
        let text = format!("{what} moved by {} ({seen})", aligned.by.join(", then by "));
        if !all.contains(&text) {
            all.push(text);
        }
    }
    (!all.is_empty()).then(|| all.join("; "))
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
            let ink = ui.visuals().error_fg_color;
            sign(ui, ink);
            line(ui, egui::RichText::new(error.to_string()).color(ink));
        } else if let Some(notice) = &work.notice {
            if let Some(file) = &notice.file {
                let command = AppCommand::OpenWritten(file.clone());
                let tip = Command::from(command.clone()).tooltip();
                if ui.button("Open").on_hover_text(tip).clicked() {
                    out.push(command);
                }
            }
            line(ui, notice.text.as_str().into());
        } else if let Some(text) = work.world.case().and_then(|case| moved(case)) {
            let width = (ui.available_width() - DISCLAIMER_POINTS).max(120.0);
            ui.scope(|ui| {
                ui.set_max_width(width);
                let link = egui::Label::new(&text).truncate().sense(egui::Sense::click());
                if ui.add(link).on_hover_text(Command::from(AppCommand::ShowAlign).tooltip()).clicked() {
                    out.push(AppCommand::ShowAlign);
                }
            });
        }
        if dismissed {
            work.error = None;
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.weak("Research use only. Not a medical device.");
        });
    });
}
