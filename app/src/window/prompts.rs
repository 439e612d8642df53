//! Dialog within the window: how a folder without a manifest was read.

use std::path::Path;

use egui::Ui;

use super::modal::{self, Reply};
use crate::command::{AppCommand, Commands, Workstation, workstation::Guess};

/// Shows how a folder's files were interpreted, for the user to accept or reject.
pub fn guess(ui: &mut Ui, work: &Workstation, out: &mut Commands) {
    let Some(guess) = &work.guess else { return };
    if work.accept_guesses {
        out.push(AppCommand::AcceptGuess(true));
        return;
    }
    let reply = modal::show(ui.ctx(), "How this folder is read", |ui| {
        ui.set_width(560.0);
        ui.label(
            "There is no manifest, so files were told apart by their names and contents. Is this right?",
        );
        ui.add_space(6.0);
        egui::ScrollArea::vertical().max_height(360.0).show(ui, |ui| {
            guess_table(ui, guess);
            ui.add_space(6.0);
            for note in &guess.spec.notes {
                ui.label(&note.message);
            }
        });
        ui.add_space(6.0);
        let mut reply = Reply::None;
        ui.horizontal(|ui| {
            if ui.button("Open it like this").clicked() {
                reply = Reply::Accept;
            }
            if ui.button("Cancel").clicked() {
                reply = Reply::Cancel;
            }
        });
        reply
    });
    match reply {
        Reply::None => {}
        Reply::Accept => out.push(AppCommand::AcceptGuess(true)),
        Reply::Cancel => out.push(AppCommand::AcceptGuess(false)),
    }
}

fn guess_table(ui: &mut Ui, guess: &Guess) {
    egui::Grid::new("guess").num_columns(4).striped(true).show(ui, |ui| {
        for title in ["", "id", "file", "labels and date"] {
            ui.strong(title);
        }
        ui.end_row();
        for context in &guess.spec.contexts {
            guess_row(ui, "image", &context.id, &context.source.name(), "", context.time.as_deref());
        }
        for mask in &guess.spec.masks {
            let labels = mask.labels.as_ref().map(|l| format!("{l:?} ")).unwrap_or_default();
            guess_row(ui, "mask", &mask.id, &mask.source.name(), &labels, mask.time.as_deref());
        }
    });
}

fn guess_row(ui: &mut Ui, kind: &str, id: &str, file: &str, labels: &str, time: Option<&str>) {
    ui.label(kind);
    ui.label(id);
    let name =
        Path::new(file).file_name().map_or_else(|| file.to_owned(), |n| n.to_string_lossy().into_owned());
    ui.label(name).on_hover_text(file);
    ui.label(format!("{labels}{}", time.unwrap_or_default()));
    ui.end_row();
}
