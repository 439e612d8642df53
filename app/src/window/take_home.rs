//! The dialog that writes the page which a patient takes home: a doctor reads and edits its words first.

use std::path::Path;

use egui::{Button, Grid, ScrollArea, TextEdit, Ui};
use glioscope_core::{Progress, files::Inputs};

use super::modal::{self, Reply};
use crate::{
    command::{AppCommand, Commands, EditCommand, Notice, Workstation},
    error::AppError,
    model::{Document, take_home::MOST_PAGE_TEXT},
    output, page,
    world::{
        World,
        jobs::{Ask, Lookup, progress_text},
        take_home::{Proposals, page_of},
    },
};

const WIDTH_POINTS: f32 = 520.0;
/// Height of the words, points.
const WORDS_POINTS: f32 = 260.0;
/// The file's ending.
pub const ENDING: &str = "html";

/// Draws the dialog while it is open.
pub fn show(
    ui: &Ui,
    is_open: &mut bool,
    work: &Workstation,
    (proposals, ask): (&mut Proposals, &Ask),
    out: &mut Commands,
) {
    let (true, Some(doc), Some(case)) = (*is_open, &work.doc, work.world.case()) else { return };
    let old = &doc.edit.take_home;
    let mut new = old.clone();
    let reply = modal::show(ui.ctx(), "A page to take home", |ui| {
        ui.set_width(WIDTH_POINTS);
        ui.label("One file for the patient: it turns in any browser, and names nobody unless you do.");
        ui.add_space(6.0);
        Grid::new("page").num_columns(2).spacing([16.0, 8.0]).show(ui, |ui| {
            ui.label("Language");
            ui.horizontal(|ui| modal::language(ui, &mut new.language));
            ui.end_row();
            ui.label("With");
            ui.horizontal(|ui| {
                ui.checkbox(&mut new.has_names, "names of masks").on_hover_text("Else they are numbered");
                ui.checkbox(&mut new.has_dates, "dates").on_hover_text("Else they are numbered");
            });
            ui.end_row();
        });
        ui.add_space(6.0);
        let label = ui.strong("Words").on_hover_text("Empty lines separate paragraphs; # begins a heading");
        let (words, waiting) = match &old.text {
            Some(text) => (text.clone(), None),
            None => match proposals.get(case, doc, ask) {
                Lookup::Ready(text) => ((**text).clone(), None),
                Lookup::Working(progress) => (String::new(), Some(progress_text(progress))),
                Lookup::Failed(error) => (String::new(), Some(error.to_string())),
            },
        };
        let mut typed = words.clone();
        ScrollArea::vertical().max_height(WORDS_POINTS).min_scrolled_height(WORDS_POINTS).show(ui, |ui| {
            let field = TextEdit::multiline(&mut typed).desired_width(f32::INFINITY).desired_rows(14);
            ui.add_enabled(waiting.is_none(), field.char_limit(MOST_PAGE_TEXT)).labelled_by(label.id);
        });
        if typed != words {
            new.text = Some(typed);
        }
        ui.horizontal(|ui| {
            let button = ui.add_enabled(old.text.is_some(), Button::new("The program's words"));
            if button.on_hover_text("In place of yours").clicked() {
                new.text = None;
            }
            match waiting {
                Some(text) => ui.weak(text),
                None if old.text.is_some() => ui.weak("Your words stay as they are in either language"),
                None => ui.weak("The program's words, which you can change"),
            };
        });
        ui.add_space(6.0);
        let mut reply = Reply::None;
        ui.horizontal(|ui| {
            if ui.add(Button::new("Choose the file…")).clicked() {
                reply = Reply::Accept;
            }
            if ui.button("Close").clicked() {
                reply = Reply::Cancel;
            }
        });
        reply
    });
    if new != *old {
        out.push(EditCommand::SetTakeHome(Box::new(new)));
    }
    match reply {
        Reply::None => {}
        Reply::Cancel => *is_open = false,
        Reply::Accept => {
            out.push(AppCommand::WritePage);
            *is_open = false;
        }
    }
}

/// Writes the page and returns the notice about it.
///
/// # Errors
/// [`AppError`], as [`page_of`]; also for a file of the case, and for another ending.
pub fn write(
    doc: &Document,
    world: &World,
    inputs: &Inputs,
    path: &Path,
    progress: &Progress,
) -> Result<Notice, AppError> {
    page::check_ending(path)?;
    inputs.refuse_as_output(path)?;
    let case = world.case().ok_or_else(|| AppError::file(path, "no case", "an open one"))?;
    let setting = &doc.edit.take_home;
    let content = page_of(case, doc, setting, None, progress)?;
    output::write(path, inputs, page::page(&content, &page::words(setting.language)).as_bytes())?;
    Ok(Notice::wrote(format!("Page written to {}", path.display()), path))
}
