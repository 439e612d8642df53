//! The dialog that writes a report, and the report of what the window shows.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use egui::{Button, Grid, Ui};
use glioscope_core::{
    Progress,
    case::{Case, LoadOptions},
    files::{Inputs, is_writable_folder},
    lesions::LesionsReport,
    response::Evaluated,
};
use glioscope_render::Gpu;
use jiff::Timestamp;

use super::{
    modal::{self, Reply},
    report_file::{Asked, ReportFile, file_of},
    report_preview::Preview,
};
pub use crate::report::{FileKind, Form, Options};
use crate::{
    command::{AppCommand, Command, Commands, EditCommand, Notice, Workstation},
    error::AppError,
    model::{
        Document,
        document::MOST_CAPTION,
        reading::{MOST_CONCLUSION, MOST_READER},
    },
    output,
    report::{self, Filing, Identity},
    views::draw,
    words::{Language, Words},
    world::{World, jobs::Handle, load},
};

const WIDTH_POINTS: f32 = 420.0;
/// Height of the list of pictures, points.
const LIST_POINTS: f32 = 170.0;
/// Width of the first page beside it, points; left out where the window hasn't the room.
const PAGE_POINTS: f32 = 520.0;
/// Height of the conclusion's field, points; more is scrolled.
const CONCLUSION_POINTS: f32 = 120.0;
/// What of the window's sides isn't the dialog's, points.
const MARGIN_POINTS: f32 = 80.0;

/// The dialog.
pub struct ReportDialog {
    /// The case that it was opened for.
    case: Handle<Case>,
    options: Options,
    /// The sentences of each language: parsing them takes longer than drawing.
    words: [Words; 2],
    is_pdf: bool,
    /// Files that don't exist yet in the folder proposed: HTML and PDF.
    proposed: Option<[PathBuf; 2]>,
    preview: Preview,
}

impl ReportDialog {
    /// The dialog as it opens, in the language and form of the report written last. How much of the patient's identity a report has is asked
    /// for anew each time. A file is proposed in `folder`.
    pub fn new(case: &Arc<Case>, language: Language, is_pdf: bool, folder: Option<PathBuf>) -> Self {
        // A report is signed unless its reader says otherwise.
        let options = Options { language, names_reader: true, ..Options::default() };
        let folder = folder.filter(|folder| is_writable_folder(folder));
        let proposed = folder.and_then(|folder| Some([unused(&folder, "html")?, unused(&folder, "pdf")?]));
        let words = [Language::En, Language::De].map(report::words);
        Self { case: Handle::of(case), options, words, is_pdf, proposed, preview: Preview::default() }
    }
}

/// The file proposed in the form chosen.
fn proposed_of(all: &Option<[PathBuf; 2]>, is_pdf: bool) -> Option<&Path> {
    all.as_ref().map(|[html, pdf]| if is_pdf { pdf } else { html }.as_path())
}

/// `report.html`, or with the least number behind it of which nothing is there: `report-2.html`.
fn unused(folder: &Path, ending: &str) -> Option<PathBuf> {
    let names = (1..1000).map(|n| match n {
        1 => format!("report.{ending}"),
        n => format!("report-{n}.{ending}"),
    });
    names.map(|name| folder.join(name)).find(|path| path.symlink_metadata().is_err())
}

/// Draws the dialog while it is open. `evaluated`, `lesions`: the response and lesions shown.
pub fn show(
    ui: &Ui,
    open: &mut Option<ReportDialog>,
    work: &Workstation,
    (evaluated, lesions): (Option<&Evaluated>, Option<&LesionsReport>),
    out: &mut Commands,
) {
    let (Some(dialog), Some(case)) = (open.as_mut(), work.world.case()) else { return };
    if dialog.case != Handle::of(case) {
        // Its page and its folder are those of the patient before.
        *open = None;
        return;
    }
    let window = ui.ctx().content_rect().size();
    let has_page = window.x >= WIDTH_POINTS + PAGE_POINTS + MARGIN_POINTS;
    let mut pressed = None;
    let reply = modal::show(ui.ctx(), "Write a report", |ui| {
        ui.horizontal_top(|ui| {
            let reply = ui.vertical(|ui| {
                ui.set_width(WIDTH_POINTS);
                content(ui, dialog, (work, case), (evaluated, lesions), &mut pressed, out)
            });
            if let (true, Some(doc)) = (has_page, &work.doc) {
                ui.add_space(12.0);
                let room = (dialog.options, PAGE_POINTS, window.y - 2.0 * MARGIN_POINTS);
                dialog.preview.show(ui, case, doc, room);
            }
            reply.inner
        })
        .inner
    });
    let is_signed = work.doc.as_ref().is_some_and(|doc| !doc.edit.reading.reader.trim().is_empty());
    let proposed = proposed_of(&dialog.proposed, dialog.is_pdf);
    let command = match (reply, pressed) {
        (Reply::None, _) => return,
        (Reply::Cancel, _) => None,
        // Enter writes what is signed; a report that nobody has signed is written by its button alone.
        (Reply::Accept, None) if !is_signed => return,
        (Reply::Accept, None | Some(Pressed::Write)) => {
            // Something may have been written there since the dialog was opened.
            let free = proposed.and_then(|path| unused(path.parent()?, path.extension()?.to_str()?));
            Some(free.map_or(AppCommand::WriteReport(dialog.options), |path| {
                AppCommand::WriteReportTo(dialog.options, path)
            }))
        }
        (Reply::Accept, Some(Pressed::Choose)) => Some(AppCommand::WriteReport(dialog.options)),
    };
    command.into_iter().for_each(|command| out.push(command));
    *open = None;
}

/// A button that was pressed.
#[derive(Clone, Copy)]
enum Pressed {
    Write,
    Choose,
}

/// The dialog's fields and buttons; `pressed`: the one of its buttons that was.
fn content(
    ui: &mut Ui,
    dialog: &mut ReportDialog,
    (work, case): (&Workstation, &Case),
    (evaluated, lesions): (Option<&Evaluated>, Option<&LesionsReport>),
    pressed: &mut Option<Pressed>,
    out: &mut Commands,
) -> Reply {
    let ReportDialog { options, words, is_pdf, proposed, .. } = dialog;
    let patient = &case.patient;
    ui.add_space(6.0);
    Grid::new("report").num_columns(2).spacing([16.0, 8.0]).show(ui, |ui| {
        ui.label("Patient");
        ui.vertical(|ui| {
            let name = if patient.name.is_empty() { String::new() } else { format!(" ({})", patient.name) };
            for (identity, text) in [
                (Identity::None, "Neither name nor file names".to_owned()),
                (Identity::Initials, "Initials".to_owned()),
                (Identity::Full, format!("In full, with file names{name}")),
            ] {
                ui.radio_value(&mut options.identity, identity, text);
            }
        });
        ui.end_row();
        ui.label("Language");
        ui.horizontal(|ui| modal::language(ui, &mut options.language));
        ui.end_row();
        if proposed.is_some() {
            ui.label("Form");
            ui.horizontal(|ui| {
                ui.radio_value(is_pdf, false, "HTML");
                ui.radio_value(is_pdf, true, "PDF");
            });
            ui.end_row();
        }
    });
    if let Some(doc) = &work.doc {
        let now = words.each_ref().map(|words| {
            let calls = evaluated.and_then(|evaluated| report::calls_in_words(evaluated, lesions, words));
            calls.filter(|_| doc.edit.response.history.is_some())
        });
        let chosen = usize::from(options.language == Language::De);
        reading(ui, (doc, &work.usual.reader), (&now, chosen), options, out);
        pictures(ui, case, doc, out);
    }
    ui.add_space(6.0);
    let open = evaluated.map_or(0, |evaluated| evaluated.response.missing_answers());
    if open > 0 {
        let text = match open {
            1 => "1 answer is missing in the response: it can change the call".to_owned(),
            several => format!("{several} answers are missing in the response: they can change the call"),
        };
        ui.colored_label(ui.visuals().warn_fg_color, text);
    }
    let mut reply = Reply::None;
    let path = proposed_of(proposed, *is_pdf);
    ui.horizontal(|ui| {
        if let Some(path) = path {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if ui.button(format!("Write {name}")).on_hover_text(path.display().to_string()).clicked() {
                (reply, *pressed) = (Reply::Accept, Some(Pressed::Write));
            }
        }
        let tip = "Another name or folder, or another form by the ending: .md, .json, .csv, .dcm, .sr.dcm";
        if ui.button("Choose the file…").on_hover_text(tip).clicked() {
            (reply, *pressed) = (Reply::Accept, Some(Pressed::Choose));
        }
        if ui.button("Cancel").clicked() {
            reply = Reply::Cancel;
        }
    });
    if let Some(folder) = path.and_then(|path| path.parent()) {
        ui.add(egui::Label::new(egui::RichText::new(format!("in {}", folder.display())).weak()).truncate());
    }
    reply
}

/// The conclusion, and who signs it. `now`: the calls of the response in a sentence, by language, of which that `chosen` can be taken
/// over; `reader`: who read last.
fn reading(
    ui: &mut Ui,
    (doc, reader): (&Document, &String),
    (now, chosen): (&[Option<String>; 2], usize),
    options: &mut Options,
    out: &mut Commands,
) {
    let mut new = doc.edit.reading.clone();
    ui.add_space(6.0);
    let label = ui.strong("Conclusion");
    let field = egui::TextEdit::multiline(&mut new.conclusion).desired_width(f32::INFINITY).desired_rows(3);
    let area = egui::ScrollArea::vertical().id_salt("conclusion").max_height(CONCLUSION_POINTS);
    area.show(ui, |ui| ui.add(field.char_limit(MOST_CONCLUSION)).labelled_by(label.id));
    let calls = now[chosen].clone().unwrap_or_default();
    let is_old = new.repeats_old_calls(now);
    // Always there, so that nothing moves once it was pressed.
    ui.horizontal(|ui| {
        let can_take = !calls.is_empty() && !new.conclusion.contains(&calls);
        // What was taken over and not touched is replaced: when the calls changed, and in another language.
        let replaces = !new.taken.is_empty() && new.conclusion.contains(&new.taken);
        let text = if replaces { "Replace the calls" } else { "Take over the calls" };
        let button = ui.add_enabled(can_take, Button::new(text));
        let button = button.on_hover_text(&calls);
        if button.on_disabled_hover_text("The response has no calls, or they are there").clicked() {
            new.conclusion = if replaces {
                new.conclusion.replacen(&new.taken, &calls, 1)
            } else {
                let separator = if new.conclusion.trim().is_empty() { "" } else { "\n" };
                format!("{}{separator}{calls}", new.conclusion.trim_end())
            };
            new.conclusion = new.conclusion.chars().take(MOST_CONCLUSION).collect();
            new.taken.clone_from(&calls);
        }
        if is_old {
            ui.colored_label(ui.visuals().warn_fg_color, "The calls have changed since they were taken over");
        }
    });
    ui.horizontal(|ui| {
        let label = ui.label("Read by");
        let field = egui::TextEdit::singleline(&mut new.reader).desired_width(200.0).char_limit(MOST_READER);
        ui.add(field).labelled_by(label.id);
        // A signature is the reader's own deed, also where the program knows who stated the facts. Its room stays when it was pressed.
        let author = &doc.edit.response.author;
        let known = if author.is_empty() { reader } else { author };
        let is_asked = !known.is_empty() && new.reader.trim().is_empty();
        let button = ui.add_visible(is_asked, Button::new(format!("I am {known}")).truncate());
        if is_asked && button.clicked() {
            new.reader.clone_from(known);
        }
    });
    ui.horizontal(|ui| {
        let is_full = options.identity == Identity::Full;
        let mut is_named = is_full || options.names_reader;
        let tick = egui::Checkbox::new(&mut is_named, "Name printed, with the day");
        let tick = ui.add_enabled(!is_full, tick);
        if tick.changed() {
            options.names_reader = is_named;
        }
        tick.on_hover_text("Without it the report says that its reader isn't named");
    });
    if new != doc.edit.reading {
        new.day = Timestamp::now().strftime("%Y-%m-%d").to_string();
        out.push(EditCommand::SetReading(Box::new(new)));
    }
}

/// The views kept for the report: their captions and order.
fn pictures(ui: &mut Ui, case: &Case, doc: &Document, out: &mut Commands) {
    let kept = &doc.edit.pictures;
    ui.add_space(6.0);
    if kept.is_empty() {
        let key = Command::from(AppCommand::KeepPicture).shortcut_text().unwrap_or_default();
        ui.weak(format!("Pictures: every view as it is now, or only those that {key} over a view has kept."));
        return;
    }
    ui.strong("Pictures");
    let mut new = kept.clone();
    // As high with few as with many: what is below stays where it is.
    let list = egui::ScrollArea::vertical().max_height(LIST_POINTS).min_scrolled_height(LIST_POINTS);
    list.auto_shrink([false, false]).show(ui, |ui| {
        for (n, picture) in kept.iter().enumerate() {
            ui.horizontal(|ui| {
                let date = case.time_points.get(picture.nav.time).map_or("", |time| time.label.as_str());
                // A view of two dates has none of its own.
                let date = if picture.pane.row().needs_dates { "" } else { date };
                ui.label(format!("{}. {} {date}", n + 1, picture.pane.tab()));
                let number = n + 1;
                let mut button = |text: &str, enabled: bool, label: String| {
                    let response = ui.add_enabled(enabled, Button::new(text).small());
                    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, enabled, &label));
                    response.on_hover_text(&label).clicked()
                };
                if button("Up", n > 0, format!("Move picture {number} up")) {
                    new.swap(n, n - 1);
                }
                if button("×", true, format!("Leave out picture {number}")) {
                    new.remove(n);
                }
            });
            let mut caption = picture.caption.clone();
            let field = egui::TextEdit::singleline(&mut caption)
                .desired_width(f32::INFINITY)
                .char_limit(MOST_CAPTION)
                .hint_text("Caption; empty: the report's own words");
            let response = ui.add(field);
            draw::name_widget(ui, &response, &format!("Caption of picture {}", n + 1));
            if response.changed()
                && let Some(changed) = new.get_mut(n)
            {
                changed.caption = caption;
            }
        }
    });
    if new != *kept {
        out.push(EditCommand::SetPictures(new));
    }
}

/// Writes the report of a document and returns the notice about it.
///
/// # Errors
/// [`AppError`], as [`report::make`]; also for a file of the case, and for another ending.
pub fn write(
    doc: Document,
    world: &World,
    options: Options,
    (gpu, inputs): (&Gpu, &Inputs),
    path: &Path,
    progress: &Progress,
) -> Result<Notice, AppError> {
    let kind = FileKind::of(path).ok_or_else(|| AppError::file(path, "another ending", FileKind::ENDINGS))?;
    // Before seconds of drawing.
    inputs.refuse_as_output(path)?;
    kind.check_language(options.language)?;
    let no_case = || AppError::file(path, "no case", "an open one");
    let case = world.case().ok_or_else(no_case)?;
    let source = doc.case.clone();
    // Files are read again for it, as only DICOM names them.
    let filing = || -> Result<Filing, AppError> {
        let spec = load::spec_of(&source, &LoadOptions::default(), progress)?;
        Filing::of(case, &spec, options.identity, progress)
    };
    let shown = report::anonymous(case, doc, options)?;
    let gpu = || Ok(gpu.clone());
    let asked = Asked { kind, options, response: None, filing: &filing, gpu: &gpu };
    let ReportFile { bytes, notes, .. } = file_of(&shown.case, &shown.doc, &asked, progress)?;
    output::write(path, inputs, &bytes)?;
    let notes = if notes.is_empty() { String::new() } else { format!(" ({})", notes.join("; ")) };
    Ok(Notice::wrote(format!("Report written to {}{notes}", path.display()), path))
}
