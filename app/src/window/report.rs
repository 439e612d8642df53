//! The dialog that writes a report, and the report of what the window shows.

use std::path::Path;

use egui::{Button, Grid, Ui};
use glioscope_core::{
    Progress,
    case::{Case, LoadOptions},
    files::Inputs,
    lesions::LesionsReport,
    response::Evaluated,
};
use glioscope_render::Gpu;
use jiff::Timestamp;

use super::{
    modal::{self, Reply},
    report_file::{Asked, ReportFile, file_of},
};
pub use crate::report::Options;
use crate::{
    command::{AppCommand, Command, Commands, EditCommand, Notice, Workstation},
    error::AppError,
    model::{
        Document,
        document::MOST_CAPTION,
        reading::{MOST_CONCLUSION, MOST_READER},
    },
    output,
    report::{self, FileKind, Filing, Identity},
    views::draw,
    words::{Language, Words},
    world::{World, load},
};

const WIDTH_POINTS: f32 = 420.0;
/// Height of the list of pictures, points.
const LIST_POINTS: f32 = 170.0;

/// The dialog.
pub struct ReportDialog {
    options: Options,
    /// The sentences of each language: parsing them takes longer than drawing.
    words: [Words; 2],
}

impl ReportDialog {
    /// The dialog as it opens. How much of the patient's identity a report has is asked for anew each time.
    pub fn new(language: Language) -> Self {
        // A report is signed unless its reader says otherwise.
        let options = Options { language, names_reader: true, ..Options::default() };
        Self { options, words: [Language::En, Language::De].map(report::words) }
    }
}

/// Draws the dialog while it is open. `evaluated`, `lesions`: the response and lesions shown.
pub fn show(
    ui: &Ui,
    open: &mut Option<ReportDialog>,
    work: &Workstation,
    (evaluated, lesions): (Option<&Evaluated>, Option<&LesionsReport>),
    out: &mut Commands,
) {
    let (Some(ReportDialog { options, words }), Some(case)) = (open.as_mut(), work.world.case()) else {
        return;
    };
    let patient = &case.patient;
    let reply = modal::show(ui.ctx(), "Write a report", |ui| {
        ui.set_width(WIDTH_POINTS);
        ui.label("One file to hand over: calls, warnings, pictures and numbers.");
        ui.add_space(6.0);
        Grid::new("report").num_columns(2).spacing([16.0, 8.0]).show(ui, |ui| {
            ui.label("Patient");
            ui.vertical(|ui| {
                let name =
                    if patient.name.is_empty() { String::new() } else { format!(" ({})", patient.name) };
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
            ui.vertical(|ui| modal::language(ui, &mut options.language));
            ui.end_row();
        });
        if let Some(doc) = &work.doc {
            let now = words.each_ref().map(|words| {
                let calls = evaluated.and_then(|evaluated| report::calls_in_words(evaluated, lesions, words));
                calls.filter(|_| doc.edit.response.history.is_some())
            });
            let chosen = usize::from(options.language == Language::De);
            reading(ui, doc, (&now, chosen), options, out);
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
        ui.horizontal(|ui| {
            if ui.add(Button::new("Choose the file…")).clicked() {
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
        Reply::Cancel => *open = None,
        Reply::Accept => {
            out.push(AppCommand::WriteReport(*options));
            *open = None;
        }
    }
}

/// The conclusion, and who signs it. `now`: the calls of the response in a sentence, by language, of which that `chosen` can be taken
/// over.
fn reading(
    ui: &mut Ui,
    doc: &Document,
    (now, chosen): (&[Option<String>; 2], usize),
    options: &mut Options,
    out: &mut Commands,
) {
    let mut new = doc.edit.reading.clone();
    ui.add_space(6.0);
    let label = ui.strong("Conclusion");
    let field = egui::TextEdit::multiline(&mut new.conclusion).desired_width(f32::INFINITY).desired_rows(3);
    ui.add(field.char_limit(MOST_CONCLUSION)).labelled_by(label.id);
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
        // A signature is the reader's own deed, also where the program knows who stated the facts.
        let author = &doc.edit.response.author;
        if !author.is_empty() && new.reader.trim().is_empty() && ui.button(format!("I am {author}")).clicked()
        {
            new.reader.clone_from(author);
        }
        let is_full = options.identity == Identity::Full;
        let mut is_named = is_full || options.names_reader;
        let tick = ui.add_enabled(!is_full, egui::Checkbox::new(&mut is_named, "printed, with the day"));
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
