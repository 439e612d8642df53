//! Questions about unsaved work: before it is left, and about that of a window that ended without asking.

use std::path::Path;

use egui::{Context, Ui};

use super::{GlioscopeApp, modal};
use crate::{
    command::AppCommand,
    model::{CaseRef, session},
    world::jobs::Waker,
};

/// What leaves the work.
#[derive(Clone, Debug, PartialEq)]
enum Leaving {
    /// The window is closed.
    Close,
    /// Another case is opened.
    Open(AppCommand),
}

/// The question about unsaved work.
#[derive(Default)]
pub(super) struct Leave {
    /// What waits for an answer.
    asked: Option<Leaving>,
    /// What follows once the file chooser has a name to save to.
    after_save: Option<Leaving>,
    /// The window may close.
    agreed: bool,
}

#[derive(Clone, Copy)]
enum Answer {
    Save,
    Discard,
    Cancel,
}

impl GlioscopeApp {
    /// Whether a question is shown.
    pub fn is_asking(&self) -> bool {
        self.leave.asked.is_some()
    }

    /// Closes the window, after asking about unsaved work.
    pub(super) fn quit(&mut self, ctx: &Context) {
        if self.asks() { self.leave.asked = Some(Leaving::Close) } else { self.proceed(ctx, Leaving::Close) }
    }

    /// Whether `command`, which opens another case, waits for an answer about unsaved work.
    pub(super) fn asks_before(&mut self, command: &AppCommand) -> bool {
        let asks = self.asks();
        if asks {
            self.leave.asked = Some(Leaving::Open(command.clone()));
        }
        asks
    }

    fn asks(&self) -> bool {
        self.scripted.is_none() && self.work.has_unsaved_work()
    }

    /// Keeps the window open while the question is asked.
    pub(super) fn hold_window(&mut self, ctx: &Context) {
        if ctx.input(|i| i.viewport().close_requested()) && !self.leave.agreed && self.asks() {
            ctx.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.leave.asked = Some(Leaving::Close);
        }
    }

    fn proceed(&mut self, ctx: &Context, leaving: Leaving) {
        match leaving {
            Leaving::Close => {
                self.leave.agreed = true;
                if let Some(autosave) = &mut self.autosave {
                    autosave.forget();
                }
                ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            }
            Leaving::Open(command) => self.open_now(ctx, &command),
        }
    }

    /// Opens what a command names.
    pub(super) fn open_now(&mut self, ctx: &Context, command: &AppCommand) {
        let wake = Waker::of(ctx);
        match command {
            AppCommand::Open(case) => self.work.open(case.clone(), Vec::new(), wake),
            AppCommand::OpenSubject { folder, derivatives } => {
                self.work.open_subject(folder.clone(), derivatives.clone(), wake);
            }
            AppCommand::OpenFiles(files) => self.work.open_files(files.clone(), wake),
            AppCommand::OpenSample => self.work.open(CaseRef::Sample, Vec::new(), wake),
            AppCommand::OpenSession(path) => self.work.open_session(path, &[], wake),
            _ => {}
        }
    }

    /// What waited for the session to be saved, once it is or isn't.
    pub(super) fn after_save(&mut self, ctx: &Context, saved: bool) {
        if let Some(leaving) = self.leave.after_save.take()
            && saved
        {
            self.proceed(ctx, leaving);
        }
    }

    /// Shows the questions.
    pub(super) fn ask(&mut self, ui: &Ui) {
        let ctx = ui.ctx().clone();
        if let Some(leaving) = self.leave.asked.clone()
            && let Some(answer) = ask_unsaved(&ctx, &leaving)
        {
            self.leave.asked = None;
            match answer {
                Answer::Cancel => {}
                Answer::Discard => self.proceed(&ctx, leaving),
                Answer::Save => {
                    self.leave.after_save = Some(leaving);
                    match self.work.session_path.clone() {
                        Some(path) => {
                            let saved = self.save_to(&path);
                            self.after_save(&ctx, saved);
                        }
                        None => self.open_file_dialog(&ctx, self.save_session()),
                    }
                }
            }
        }
        self.offer_left_behind(&ctx);
    }

    fn offer_left_behind(&mut self, ctx: &Context) {
        let Some(autosave) = &mut self.autosave else { return };
        let Some(path) = autosave.left_behind() else { return };
        if self.work.job.is_some() || self.leave.asked.is_some() {
            return;
        }
        match ask_left_behind(ctx, path) {
            None => {}
            Some(Answer::Save) => {
                if let Some(path) = autosave.take_over() {
                    self.work.open_unsaved(&path, Waker::of(ctx));
                }
            }
            Some(answer) => autosave.pass_over(matches!(answer, Answer::Discard)),
        }
    }
}

/// Enter is the first button, Escape the last.
fn question(ctx: &Context, title: &str, text: &str, buttons: &[(&str, Answer)]) -> Option<Answer> {
    let mut answer = None;
    let reply = modal::show(ctx, title, |ui| {
        ui.set_max_width(460.0);
        ui.label(text);
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            for (label, of_button) in buttons {
                if ui.button(*label).clicked() {
                    answer = Some(*of_button);
                }
            }
        });
        modal::Reply::None
    });
    let of = |button: Option<&(&str, Answer)>| button.map(|(_, answer)| *answer);
    match reply {
        modal::Reply::Accept => of(buttons.first()),
        modal::Reply::Cancel => of(buttons.last()),
        modal::Reply::None => answer,
    }
}

fn ask_unsaved(ctx: &Context, leaving: &Leaving) -> Option<Answer> {
    let next = match leaving {
        Leaving::Close => "Glioscope closes".to_owned(),
        Leaving::Open(command) => match name_of(command) {
            Some(name) => format!("{name} is opened"),
            None => "the other case is opened".to_owned(),
        },
    };
    let text = format!("Your work on this case isn't saved. Save it before {next}?");
    let buttons = [("Save", Answer::Save), ("Discard", Answer::Discard), ("Cancel", Answer::Cancel)];
    question(ctx, "Unsaved changes", &text, &buttons)
}

/// What is opened next, where it has a name.
fn name_of(command: &AppCommand) -> Option<String> {
    let path = match command {
        AppCommand::OpenSample | AppCommand::Open(CaseRef::Sample) => return Some("the sample".to_owned()),
        AppCommand::Open(CaseRef::Path(path)) | AppCommand::OpenSession(path) => path,
        AppCommand::Open(CaseRef::Files { folder, .. }) | AppCommand::OpenSubject { folder, .. } => folder,
        _ => return None,
    };
    Some(format!("“{}”", path.file_name()?.to_string_lossy()))
}

fn ask_left_behind(ctx: &Context, path: &Path) -> Option<Answer> {
    let case = session::load(path).ok().map(|session| match session.document.case {
        CaseRef::Sample => "the sample".to_owned(),
        CaseRef::Path(path) => path.display().to_string(),
        CaseRef::Arguments { masks, .. } => masks.join(" "),
        CaseRef::Files { folder, .. } => format!("files in {}", folder.display()),
    });
    let of = case.unwrap_or_else(|| "a file that can't be read".into());
    let text = format!("Glioscope ended without saving the work on {of}.");
    let buttons = [
        ("Open that work", Answer::Save),
        ("Delete it", Answer::Discard),
        ("Ask again next time", Answer::Cancel),
    ];
    question(ctx, "Unsaved work", &text, &buttons)
}
