//! Dialogs within the window: how a folder without a manifest was read, and a field for a path.

use std::path::{Path, PathBuf};

use egui::Ui;

use super::dialogs::{open_command, openable};
use crate::command::{AppCommand, Commands, Workstation, workstation::Guess};

/// Shows how a folder's files were interpreted, for the user to accept or reject.
pub fn guess(ui: &mut Ui, work: &Workstation, out: &mut Commands) {
    let Some(guess) = &work.guess else { return };
    if work.accept_guesses {
        out.push(AppCommand::AcceptGuess(true));
        return;
    }
    let window = egui::Window::new("How this folder is read").collapsible(false).resizable(false);
    window.default_width(560.0).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).show(ui.ctx(), |ui| {
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
        ui.horizontal(|ui| {
            if ui.button("Open it like this").clicked() {
                out.push(AppCommand::AcceptGuess(true));
            }
            if ui.button("Cancel").clicked() {
                out.push(AppCommand::AcceptGuess(false));
            }
        });
    });
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

/// The dialog to type a path, if it is open.
pub fn open_path(ui: &mut Ui, open: &mut Option<String>, out: &mut Commands) {
    let Some(path) = open else { return };
    let mut close = false;
    let window = egui::Window::new("Open a case").collapsible(false).resizable(false);
    window.anchor(egui::Align2::CENTER_CENTER, [0.0, -60.0]).show(ui.ctx(), |ui| {
        let mut what = openable();
        what.replace_range(..1, "A");
        ui.label(format!("{what}:"));
        let label = ui.label("Path");
        let field = ui.add(egui::TextEdit::singleline(path).desired_width(420.0)).labelled_by(label.id);
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        ui.horizontal(|ui| {
            if (ui.button("Open").clicked() || entered) && !path.trim().is_empty() {
                out.push(open_command(PathBuf::from(path.trim())));
                close = true;
            }
            if ui.button("Browse files…").clicked() {
                out.push(AppCommand::BrowseFiles);
                close = true;
            }
            if ui.button("Browse folders…").clicked() {
                out.push(AppCommand::BrowseFolders);
                close = true;
            }
            close |= ui.button("Cancel").clicked();
        });
    });
    if close {
        *open = None;
    }
}
