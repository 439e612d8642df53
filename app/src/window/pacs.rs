//! The dialog that opens a study of an archive (PACS).

use egui::{Align, Button, ComboBox, Grid, Label, Layout, ScrollArea, TextEdit, Ui};
use glioscope_core::files::printable;
use glioscope_pacs::{InUse, Query, Retrieved, StudyRow};

use super::modal::{self, Reply};
use crate::{
    command::{AppCommand, Commands, Workstation},
    model::CaseRef,
    pacs::{self, KnownServer},
    world::jobs::{Job, Waker, progress_text},
};

const WIDTH_POINTS: f32 = 640.0;
const FIELD_POINTS: f32 = 300.0;
/// The most studies that are listed; what is looked for can be said more narrowly.
const MOST_STUDIES: usize = 200;

/// What the server is asked.
enum Asked {
    Studies(Job<Vec<StudyRow>>),
    Study(Job<Retrieved>),
}

/// The dialog, while it is open.
pub struct PacsDialog {
    /// The user's servers, as the dialog opened.
    known: Vec<KnownServer>,
    server: String,
    patient: String,
    name: String,
    date: String,
    modality: String,
    studies: Option<Vec<StudyRow>>,
    asked: Option<Asked>,
    problem: Option<String>,
}

impl PacsDialog {
    /// The dialog with the first of the user's servers.
    pub fn new() -> Self {
        let known = pacs::servers();
        Self {
            server: known.first().map(|server| server.name.clone()).unwrap_or_default(),
            known,
            patient: String::new(),
            name: String::new(),
            date: String::new(),
            modality: String::new(),
            studies: None,
            asked: None,
            problem: None,
        }
    }

    fn query(&self) -> Query {
        let given = |text: &str| Some(text.trim().to_owned()).filter(|text| !text.is_empty());
        let (from, to) = pacs::date_range(&self.date);
        Query {
            patient_id: given(&self.patient),
            patient_name: given(&self.name),
            from,
            to,
            modality: given(&self.modality),
            limit: Some(MOST_STUDIES),
            ..Query::default()
        }
    }

    fn search(&mut self, wake: Waker) {
        let (server, query) = (self.server.clone(), self.query());
        self.problem = None;
        self.asked = Some(Asked::Studies(Job::start(wake, move |progress| {
            pacs::studies(&pacs::server(&server)?.connect()?, &query, progress)
        })));
    }

    fn retrieve(&mut self, row: &StudyRow, wake: Waker) {
        let (server, Some(study)) = (self.server.clone(), row.uid.clone()) else {
            self.problem = Some("The server gave no UID of this study.".into());
            return;
        };
        self.problem = None;
        self.asked = Some(Asked::Study(Job::start(wake, move |progress| {
            pacs::retrieve(&pacs::server(&server)?.connect()?, &study, None, progress)
        })));
    }

    fn clear_cache(&mut self) {
        let cleared = pacs::cache().and_then(|cache| Ok(cache.clear()?));
        self.problem = cleared.err().map(|error| error.to_string());
    }

    fn cancel(&mut self) {
        match self.asked.take() {
            Some(Asked::Studies(job)) => job.progress.cancel(),
            Some(Asked::Study(job)) => job.progress.cancel(),
            None => {}
        }
    }

    /// Takes up an answer; returns a study that was retrieved.
    fn receive(&mut self) -> Option<Retrieved> {
        let result = match &self.asked {
            Some(Asked::Studies(job)) => job.poll()?.map(|rows| {
                self.studies = Some(rows);
                None
            }),
            Some(Asked::Study(job)) => job.poll()?.map(Some),
            None => return None,
        };
        self.asked = None;
        match result {
            Ok(study) => study,
            Err(error) => {
                self.problem = Some(error.to_string());
                None
            }
        }
    }
}

/// Draws the dialog while it is open. Studies that were retrieved stay in the cache as long as `in_use` has them.
pub fn show(
    ui: &Ui,
    open: &mut Option<PacsDialog>,
    in_use: &mut Vec<InUse>,
    work: &mut Workstation,
    out: &mut Commands,
) {
    let Some(dialog) = open.as_mut() else { return };
    if let Some(study) = dialog.receive() {
        if study.files.is_empty() {
            let why = study.failed.first().map_or("it has none", |failed| failed.reason.as_str());
            dialog.problem = Some(format!("No image of the study could be retrieved: {}", printable(why)));
        } else {
            if let Some(first) = study.failed.first() {
                let count = study.failed.len();
                let why = printable(&first.reason);
                work.notice = Some(format!("{count} images couldn't be retrieved: {why}").into());
            }
            in_use.push(study.in_use);
            out.push(AppCommand::Open(CaseRef::Path(study.folder)));
            *open = None;
            return;
        }
    }
    let (mut searches, mut entered, mut chosen) = (false, false, None);
    let reply = modal::show(ui.ctx(), "Open from PACS", |ui| {
        ui.set_width(WIDTH_POINTS);
        entered = fields(ui, dialog);
        ui.add_space(4.0);
        let working = match &dialog.asked {
            Some(Asked::Studies(job)) => Some(&job.progress),
            Some(Asked::Study(job)) => Some(&job.progress),
            None => None,
        };
        if let Some(progress) = working {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label(progress_text(progress));
            });
            ui.ctx().request_repaint_after(std::time::Duration::from_millis(200));
        }
        if let Some(problem) = &dialog.problem {
            ui.colored_label(ui.visuals().error_fg_color, problem);
        }
        chosen = studies(ui, dialog);
        ui.add_space(6.0);
        let mut reply = Reply::None;
        ui.horizontal(|ui| {
            searches = ui.add_enabled(dialog.asked.is_none(), Button::new("Search")).clicked();
            if ui.button("Cancel").clicked() {
                reply = Reply::Cancel;
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let button = ui.add_enabled(dialog.asked.is_none(), Button::new("Empty the cache"));
                if button.on_hover_text("Removes all studies retrieved, but those that are open").clicked() {
                    dialog.clear_cache();
                }
            });
        });
        reply
    });
    match reply {
        // What is asked is cancelled first.
        Reply::Cancel if dialog.asked.is_some() => dialog.cancel(),
        Reply::Cancel => *open = None,
        Reply::Accept | Reply::None => {
            let wake = Waker::of(ui.ctx());
            if let Some(row) = chosen {
                dialog.retrieve(&row, wake);
            } else if (searches || entered || reply == Reply::Accept) && dialog.asked.is_none() {
                dialog.search(wake);
            }
        }
    }
}

/// The fields of the search. Returns whether Enter was pressed in one.
fn fields(ui: &mut Ui, dialog: &mut PacsDialog) -> bool {
    let mut entered = false;
    Grid::new("pacs").num_columns(3).show(ui, |ui| {
        let label = ui.label("Server").id;
        let tip = "A name of the list, or the address of its DICOMweb service. Credentials come from the environment: \
                   GLIOSCOPE_PACS_USER and GLIOSCOPE_PACS_PASSWORD, or GLIOSCOPE_PACS_TOKEN";
        let server = field(ui, &mut dialog.server, "https://host/dicom-web").labelled_by(label);
        entered |= modal::entered(ui, &server.on_hover_text(tip));
        if !dialog.known.is_empty() {
            ComboBox::from_id_salt("servers").selected_text("Known").show_ui(ui, |ui| {
                for known in &dialog.known {
                    if ui.button(&known.name).on_hover_text(&known.url).clicked() {
                        dialog.server.clone_from(&known.name);
                    }
                }
            });
        }
        ui.end_row();
        for (name, text, hint) in [
            ("Patient's ID", &mut dialog.patient, "all"),
            ("Patient's name", &mut dialog.name, "Doe^Jane, Doe*"),
            ("Date", &mut dialog.date, "2026-03-02, or 2026-03-02..2026-04-01"),
            ("Modality", &mut dialog.modality, "MR, PT, SEG"),
        ] {
            let label = ui.label(name).id;
            let response = field(ui, text, hint).labelled_by(label);
            entered |= modal::entered(ui, &response);
            ui.end_row();
        }
    });
    entered
}

fn field(ui: &mut Ui, text: &mut String, hint: &str) -> egui::Response {
    let size = [FIELD_POINTS, ui.spacing().interact_size.y];
    ui.add_sized(size, TextEdit::singleline(text).hint_text(hint))
}

/// The studies found. Returns the one that is chosen.
fn studies(ui: &mut Ui, dialog: &PacsDialog) -> Option<StudyRow> {
    let rows = dialog.studies.as_ref()?;
    ui.separator();
    match rows.len() {
        0 => drop(ui.label("No study matches.")),
        MOST_STUDIES => drop(ui.weak(format!("The first {MOST_STUDIES}: search more narrowly for others."))),
        _ => {}
    }
    let mut chosen = None;
    ScrollArea::vertical().max_height(280.0).auto_shrink([false, true]).show(ui, |ui| {
        for row in rows {
            ui.horizontal(|ui| {
                let line = pacs::study_line(row);
                let button = ui.add_enabled(dialog.asked.is_none(), Button::new("Open"));
                button.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::Role::Button, true, format!("Open {line}"))
                });
                if button.clicked() {
                    chosen = Some(row.clone());
                }
                ui.add(Label::new(line).truncate());
            });
        }
    });
    chosen
}
