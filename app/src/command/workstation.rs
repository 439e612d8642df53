//! Document, world and history together: what commands act on. Knows no window, so tests and the
//! command line drive it too.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use glioscope_core::case::{CaseSpec, LoadOptions};

use crate::{
    commands::Command,
    document::{CaseRef, Document},
    history::History,
    session,
    world::{LoadJob, Loaded, Step, World},
};

/// A case whose files were guessed from their names.
pub struct Guess {
    /// What was asked for.
    pub case: CaseRef,
    /// What was guessed, with the reasons in its notes.
    pub spec: CaseSpec,
    /// Files of fibre tracts beside it.
    pub tracts: Vec<PathBuf>,
    /// A document to continue with.
    pub document: Option<Document>,
}

/// The running program's state.
#[derive(Default)]
pub struct Workstation {
    /// What is saved; `None` while no case is open.
    pub doc: Option<Document>,
    /// What is alive.
    pub world: World,
    /// Undo and redo.
    pub history: History,
    /// A case being read.
    pub job: Option<LoadJob>,
    /// A guess that the user has to see before it is used.
    pub guess: Option<Guess>,
    /// Uses guesses without asking: for scripted pictures.
    pub accept_guesses: bool,
    /// Where the session was last saved or read.
    pub session_path: Option<PathBuf>,
    /// Limits and choices of loading.
    pub options: LoadOptions,
    /// The last thing that went wrong, until dismissed.
    pub error: Option<String>,
    /// What was just done, for the status line.
    pub notice: Option<String>,
}

impl Workstation {
    /// A workstation with a case open.
    pub fn with_case(case: CaseRef, loaded: Loaded) -> Self {
        let mut it = Self::default();
        it.install(case, loaded, None);
        it
    }

    fn install(&mut self, case: CaseRef, loaded: Loaded, document: Option<Document>) {
        self.world = World::new(loaded);
        self.history = History::default();
        let first = self.world.case().and_then(|c| c.time_points.first());
        self.doc = document.or_else(|| {
            first.map(|time_point| Document::new(case, time_point, self.world.time_point_count()))
        });
        if let Some(doc) = &mut self.doc {
            doc.nav.time = doc.nav.time.min(self.world.time_point_count().saturating_sub(1));
        }
    }

    /// Starts opening a case; the current one stays until the new one is whole. Fibre tracts are those of
    /// `document`.
    pub fn open(&mut self, case: CaseRef, document: Option<Document>, wake: impl FnOnce() + Send + 'static) {
        let tracts = document.as_ref().map(|doc| doc.tracts.clone()).unwrap_or_default();
        self.open_with(case, tracts, document, wake);
    }

    /// As [`Workstation::open`], with files of fibre tracts beside the case.
    pub fn open_with(
        &mut self,
        case: CaseRef,
        tracts: Vec<PathBuf>,
        document: Option<Document>,
        wake: impl FnOnce() + Send + 'static,
    ) {
        if let Some(job) = self.job.take() {
            job.progress.cancel();
        }
        self.error = None;
        self.guess = None;
        self.job = Some(LoadJob::start(case, tracts, None, self.options.clone(), document, wake));
    }

    /// Opens the case again with more files of fibre tracts, as it is looked at now.
    pub fn add_tracts(&mut self, files: &[PathBuf], wake: impl FnOnce() + Send + 'static) {
        let Some(mut document) = self.doc.clone() else { return };
        document.tracts.extend_from_slice(files);
        self.open(document.case.clone(), Some(document), wake);
    }

    /// Reads the case as it was guessed.
    pub fn accept_guess(&mut self, wake: impl FnOnce() + Send + 'static) {
        if let Some(Guess { case, spec, tracts, document }) = self.guess.take() {
            self.job = Some(LoadJob::start(case, tracts, Some(spec), self.options.clone(), document, wake));
        }
    }

    /// Opens a session file and the case it names, with `more` fibre tracts.
    pub fn open_session(&mut self, path: &Path, more: &[PathBuf], wake: impl FnOnce() + Send + 'static) {
        match session::load(path) {
            Ok(mut document) => {
                document.tracts.extend_from_slice(more);
                self.session_path = Some(path.to_owned());
                self.open(document.case.clone(), Some(document), wake);
            }
            Err(error) => self.error = Some(error.to_string()),
        }
    }

    /// Takes the finished load, if there is one. Returns the case that was opened.
    pub fn poll(&mut self) -> Option<CaseRef> {
        let result = self.job.as_ref()?.poll()?;
        let job = self.job.take()?;
        match result {
            Ok(Step::Guessed(spec)) => {
                self.guess = Some(Guess { case: job.case, spec, tracts: job.tracts, document: job.document });
                None
            }
            Ok(Step::Loaded(loaded)) => {
                if job.document.is_none() {
                    self.session_path = None;
                }
                self.install(job.case.clone(), *loaded, job.document);
                if let Some(doc) = &mut self.doc {
                    doc.tracts = job.tracts;
                }
                Some(job.case)
            }
            Err(error) => {
                if job.progress.check().is_ok() {
                    self.error = Some(error);
                } else {
                    self.notice = Some("Loading cancelled; nothing was changed.".into());
                }
                None
            }
        }
    }

    /// Saves the session to `path`.
    pub fn save(&mut self, path: PathBuf) {
        let Some(doc) = &self.doc else { return };
        match session::save(&path, doc) {
            Ok(()) => {
                self.notice = Some("Session saved.".into());
                self.session_path = Some(path);
            }
            Err(error) => self.error = Some(error.to_string()),
        }
    }

    /// Does what a command does to the document, and remembers it for undo.
    pub fn apply(&mut self, command: &Command, now: Instant) {
        let Some(doc) = &mut self.doc else { return };
        match command {
            Command::Undo | Command::Redo => {
                let center_mm = doc.edit.lens.center_mm;
                if *command == Command::Undo {
                    self.history.undo(&mut doc.edit);
                } else {
                    self.history.redo(&mut doc.edit);
                }
                // The camera turns about the lens, wherever it goes.
                if doc.edit.lens.center_mm != center_mm {
                    doc.nav.camera.focus_mm = doc.edit.lens.center_mm;
                }
            }
            _ => {
                let before = doc.edit.clone();
                command.apply(doc, &self.world);
                if doc.edit != before {
                    self.history.record(before, command.gesture(), now);
                }
            }
        }
    }
}
