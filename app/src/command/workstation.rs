//! Document, world and history together: the state that commands act on. Independent of the window, so that tests and
//! the command line use it too.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    time::{Instant, SystemTime},
};

use egui_tiles::Tree;
use glioscope_cohort::hidden_order;
use glioscope_core::{
    case::{self, Case, LoadOptions, Proposal},
    files::{Inputs, absolute, printable},
};

use glioscope_render::MaskColors;

use super::{Command, EditCommand};
use crate::{
    error::AppError,
    model::{
        Answer, Answers, CaseRef, Document, Edit, History, PaneId, PictureSize, Place, Session, Usual,
        cohort::{CohortReading, OpenCohort},
        layout::{self, Held},
        masks::{MaskLook, MaskLooks},
        rulers::MOST_RULERS,
        session,
    },
    world::{
        Loaded, World,
        jobs::Waker,
        load::{Accepted, LoadJob, Opened, OpenedCase, Request, Unordered},
    },
};

/// A case whose files' roles were guessed from their names.
pub struct Guess {
    /// What is being opened.
    pub request: Request,
    /// The guess, with its reasons in the notes, as the user changes it.
    pub proposal: Proposal,
    /// The guess as it was.
    pub proposed: Proposal,
}

/// A case with dates whose order the user is asked for.
pub struct OrderQuestion {
    /// What is being opened.
    pub request: Request,
    /// What was accepted of its files, where that was asked.
    pub accepted: Option<Accepted>,
    /// The dates, as the user orders them.
    pub unordered: Unordered,
}

impl OrderQuestion {
    /// Names these dates of this case among the answers. `None` where the answer about its files has their order.
    fn key(&self) -> Option<String> {
        let CaseRef::Path(path) = &self.request.case else { return None };
        if self.accepted.as_ref().is_some_and(|accepted| !accepted.key.is_empty()) {
            return None;
        }
        let mut times = self.unordered.times.clone();
        times.sort();
        Some(format!("dates of {}: {}", absolute(path).display(), times.join(", ")))
    }
}

/// Size and time of last change of a file.
type Stamp = (u64, SystemTime);

fn stamp(path: &Path) -> Option<Stamp> {
    let metadata = path.metadata().ok()?;
    Some((metadata.len(), metadata.modified().ok()?))
}

/// The running program's state.
#[derive(Default)]
pub struct Workstation {
    /// The document; `None` while no case is open.
    pub doc: Option<Document>,
    /// The loaded case.
    pub world: World,
    /// Undo and redo.
    pub history: History,
    /// The load in progress.
    pub job: Option<LoadJob>,
    /// The cohort that is open, in front of the case or behind it.
    pub cohort: Option<OpenCohort>,
    /// A guess that awaits the user's confirmation.
    pub guess: Option<Guess>,
    /// Dates that await their order.
    pub order_question: Option<OrderQuestion>,
    /// What was accepted before.
    pub answers: Answers,
    /// Names the files of the open case among the answers; empty where they were never asked about.
    pub case_key: String,
    /// Accept guesses without confirmation: for scripted pictures.
    pub accept_guesses: bool,
    /// Path where the session was last saved or read.
    pub session_path: Option<PathBuf>,
    /// Size and time of that file then.
    pub session_stamp: Option<Stamp>,
    /// What was last saved or opened; `None`: nothing of the document.
    pub saved: Option<Box<Edit>>,
    /// Options of loading.
    pub options: LoadOptions,
    /// The size of exported pictures.
    pub picture_size: PictureSize,
    /// What a case that is opened next is read with.
    pub usual: Usual,
    /// The panes with which the case opened, where the program chose them for its reading.
    pub opened_with: Option<Tree<PaneId>>,
    /// The last error, until dismissed.
    pub error: Option<AppError>,
    /// The last completed action, for the status line.
    pub notice: Option<Notice>,
    /// How often a case was installed: what was derived of another one isn't shown of this.
    pub installed: u64,
}

/// What was completed, and what it wrote.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// In words.
    pub text: String,
    /// A file or folder that a reader would look at next.
    pub file: Option<PathBuf>,
}

impl<T: Into<String>> From<T> for Notice {
    fn from(text: T) -> Self {
        Self { text: text.into(), file: None }
    }
}

impl Notice {
    /// With the file that was written.
    pub fn wrote(text: impl Into<String>, file: &Path) -> Self {
        Self { text: text.into(), file: Some(file.to_owned()) }
    }
}

/// A, B, … Z, AA, AB, …
fn letters(place: usize) -> String {
    let letter = char::from(b'A' + (place % 26) as u8);
    if place < 26 { letter.to_string() } else { format!("{}{letter}", letters(place / 26 - 1)) }
}

impl Workstation {
    /// Says that something the user asked for was done, in place of an error about what was asked for before; that work isn't kept safe stays.
    pub fn succeeded(&mut self, notice: Notice) {
        self.error.take_if(|error| !matches!(error, AppError::Unkept(_)));
        self.notice = Some(notice);
    }

    /// A workstation with an open case.
    pub fn with_case(case: CaseRef, loaded: Loaded) -> Self {
        let mut work = Self::default();
        work.install(case, loaded, None);
        work
    }

    /// A workstation with a case that was read, and the session with it, if any.
    pub fn with_opened(opened: OpenedCase) -> Self {
        let mut work = Self::default();
        work.install_opened(opened);
        work
    }

    /// Returns whether the panes are as they were arranged for the case before.
    fn install_opened(&mut self, opened: OpenedCase) -> bool {
        let OpenedCase { place: Place { case, tracts, alignments: _ }, loaded, document, options } = opened;
        let keeps_layout = self.install(case.clone(), loaded, document);
        if let Some(doc) = &mut self.doc {
            doc.set_source(case, tracts, &options);
        }
        self.options = options;
        keeps_layout
    }

    /// Replaces the current case; starts with `document`, or with the initial one. Returns whether that has the layout of the case before.
    fn install(&mut self, case: CaseRef, loaded: Loaded, document: Option<Document>) -> bool {
        let count = self.world.time_point_count();
        let held = self.world.case().and_then(|case| Some(Held::at(case.time_points.first()?, count)));
        let arranged = self.doc.as_ref().map(|doc| &doc.edit.layout).zip(held);
        let opened_with = self.opened_with.take();
        let arranged = arranged.filter(|(layout, held)| {
            !layout::is_as_opened(layout, *held)
                && !opened_with.is_some_and(|opened| layout::is_same(layout, &opened))
        });
        let before = arranged.map(|(layout, _)| (count, layout.clone()));
        self.world = World::new(loaded);
        self.installed += 1;
        // Whoever opens a case wants to see it.
        if let Some(cohort) = &mut self.cohort {
            cohort.is_shown = false;
        }
        self.history = History::default();
        self.saved = None;
        let first = self.world.case().and_then(|c| c.time_points.first());
        let mut keeps_layout = false;
        self.doc = document.or_else(|| {
            let mut doc = Document::new(case, first?, self.world.time_point_count());
            doc.edit.masks = self.world.case().map(|case| MaskLooks::of_case(case)).unwrap_or_default();
            // Whoever reads case after case has arranged the panes for them; with several dates other panes matter.
            if let Some((count, layout)) = before
                && (count > 1) == (self.world.time_point_count() > 1)
            {
                doc.edit.layout = layout;
                keeps_layout = true;
            }
            Some(doc)
        });
        if let Some(doc) = &mut self.doc {
            doc.nav.time = doc.nav.time.min(self.world.time_point_count().saturating_sub(1));
            self.world.set_made(&doc.edit.made);
            self.saved = Some(Box::new(doc.edit.clone()));
        }
        keeps_layout
    }

    /// The cohort, where it is in front of the case.
    pub fn cohort_in_front(&self) -> Option<&OpenCohort> {
        self.cohort.as_ref().filter(|cohort| cohort.is_shown)
    }

    /// The reading list, while one is read.
    pub fn reading(&self) -> Option<&CohortReading> {
        self.cohort.as_ref()?.reading.as_ref()
    }

    /// The case that is read, where it is the one that is open.
    pub fn read_case(&self) -> Option<&str> {
        let (case, path) = self.reading()?.current.as_ref()?;
        let doc = self.doc.as_ref().filter(|_| self.job.is_none())?;
        let is_open = match &doc.case {
            CaseRef::Path(open) => open == path,
            CaseRef::Files { folder, .. } => folder == path,
            CaseRef::Sample | CaseRef::Arguments { .. } => false,
        };
        (is_open || self.session_path.as_ref() == Some(path)).then_some(case.as_str())
    }

    /// Where names are hidden from the reader, calls the masks of the case that is read by letters, in another order for each case, with
    /// the colours of these.
    pub fn hide_names(&mut self) {
        let Some(seed) =
            self.reading().filter(|reading| reading.verdicts.names_hidden).map(|r| r.verdicts.seed)
        else {
            return;
        };
        let Some(case) = self.read_case().map(str::to_owned) else { return };
        let (Some(loaded), Some(doc)) = (self.world.case(), &mut self.doc) else { return };
        let masks = loaded.time_points.iter().flat_map(|time| &time.masks).map(|mask| mask.mask.id());
        let ids: BTreeSet<&str> = masks.collect();
        let order = hidden_order(seed, &case, ids.len());
        let colors = MaskColors::new(doc.edit.palette, &vec![None; ids.len()]);
        let mut looks = doc.edit.masks.clone();
        for (id, place) in ids.into_iter().zip(order) {
            let name = Some(format!("Mask {}", letters(place)));
            looks.set(id, &MaskLook { name, color: Some(colors.mask(place)) });
        }
        if looks != doc.edit.masks {
            doc.edit.masks = looks.clone();
            // The reader did nothing that could be lost.
            if let Some(saved) = &mut self.saved {
                saved.masks = looks;
            }
        }
    }

    /// Opens the cohort in `folder`, in front of the case.
    pub fn open_cohort(&mut self, folder: &Path) {
        self.error = None;
        self.cohort = Some(OpenCohort::new(folder, self.cohort.as_ref()));
    }

    /// Whether there is work that would be lost if the case were closed: anything that undo covers but the arrangement of
    /// the panes.
    pub fn has_unsaved_work(&self) -> bool {
        let Some(doc) = &self.doc else { return false };
        self.saved.as_ref().is_none_or(|saved| !saved.same_work(&doc.edit))
    }

    /// Options of loading `case`. The case grid and the order of dates were given for the case open now, or for the first
    /// one: they say nothing about another.
    fn options_for(&self, case: &CaseRef) -> LoadOptions {
        let is_another = self.doc.as_ref().is_some_and(|doc| doc.case != *case);
        if is_another { self.limits() } else { self.options.clone() }
    }

    /// Options of loading that hold for every case.
    fn limits(&self) -> LoadOptions {
        LoadOptions { max_bytes: self.options.max_bytes, ..LoadOptions::default() }
    }

    /// Starts opening a case with additional files of fibre tracts; the current one remains until the new one is loaded
    /// completely.
    pub fn open(&mut self, case: CaseRef, tracts: Vec<PathBuf>, wake: Waker) {
        let options = self.options_for(&case);
        self.start(Request { case, tracts, options, ..Request::default() }, wake);
    }

    /// Starts opening a subject's folder of BIDS with the masks of these derived data sets.
    pub fn open_subject(&mut self, folder: PathBuf, derivatives: Vec<PathBuf>, wake: Waker) {
        let options = LoadOptions { derivatives, ..self.limits() };
        self.start(Request { case: CaseRef::Path(folder), options, ..Request::default() }, wake);
    }

    /// Starts opening files and folders as one case.
    pub fn open_files(&mut self, files: Vec<PathBuf>, wake: Waker) {
        let options = self.limits();
        self.start(Request { files, options, ..Request::default() }, wake);
    }

    fn start(&mut self, request: Request, wake: Waker) {
        if let Some(job) = self.job.take() {
            job.job.progress.cancel();
        }
        self.error = None;
        self.drop_questions();
        let request = Request { unasked_order: request.unasked_order || self.accept_guesses, ..request };
        self.job = Some(LoadJob::start(request, None, wake));
    }

    /// Drops what is asked about a case before it is read; the one that is open stays.
    pub fn drop_questions(&mut self) {
        let (guess, order) = (self.guess.take(), self.order_question.take());
        let mut requests = guess.iter().map(|g| &g.request).chain(order.iter().map(|o| &o.request));
        // Without an answer the open case isn't read with its new transforms, and isn't asked about anew.
        if requests.any(|request| request.realigns) {
            self.drop_alignments();
        }
    }

    /// Asks again what the files of the open case are. The sample has none.
    pub fn edit_case_files(&mut self, wake: Waker) {
        let doc = self.doc.as_ref().filter(|doc| doc.case != CaseRef::Sample);
        let (Some(doc), Some(case)) = (doc, self.world.case()) else { return };
        match Session::of(doc, case) {
            Ok(session) => {
                let session_path = self.session_path.clone();
                let request = Request::of_session(session, &[], &self.limits());
                let edits = true;
                let request =
                    Request { session_path, is_unsaved: true, edits, unasked_order: false, ..request };
                self.start(request, wake);
            }
            Err(error) => self.error = Some(error.into()),
        }
    }

    /// Reads the open case again where its transforms were changed: by a command, by undo or redo. Call it every frame.
    pub fn follow_alignments(&mut self, wake: Waker) {
        let (Some(doc), Some(case)) = (&self.doc, self.world.case()) else { return };
        if doc.edit.alignments == self.options.alignments || self.job.is_some() {
            return;
        }
        match Session::of(doc, case) {
            Ok(session) => {
                let session_path = self.session_path.clone();
                let request = Request::of_session(session, &[], &self.limits());
                self.start(Request { session_path, is_unsaved: true, realigns: true, ..request }, wake);
            }
            Err(error) => self.error = Some(error.into()),
        }
    }

    /// Takes back transforms with which the case can't be read.
    fn drop_alignments(&mut self) {
        if let Some(doc) = &mut self.doc {
            doc.edit.alignments.clone_from(&self.options.alignments);
        }
    }

    /// Opens the case again with additional files of fibre tracts, keeping the current document.
    pub fn add_tracts(&mut self, files: &[PathBuf], wake: Waker) {
        let (Some(doc), Some(case)) = (&self.doc, self.world.case()) else { return };
        match Session::of(doc, case) {
            Ok(session) => {
                let session_path = self.session_path.clone();
                let request = Request::of_session(session, files, &self.limits());
                self.start(Request { session_path, is_unsaved: true, ..request }, wake);
            }
            Err(error) => self.error = Some(error.into()),
        }
    }

    /// Reads the case as guessed and changed. Nothing happens while the proposal has problems.
    pub fn accept_guess(&mut self, wake: Waker) {
        let Some(Guess { request, mut proposal, proposed }) = self.guess.take() else { return };
        // Where nobody is asked, a warning of the case says it.
        let is_aligned = proposal.is_aligned;
        proposal.is_aligned |= self.accept_guesses;
        let has_problems = !proposal.problems().is_empty();
        proposal.is_aligned = is_aligned;
        if has_problems {
            self.guess = Some(Guess { request, proposal, proposed });
            return;
        }
        // An answer about the files changes nothing of what they are.
        let mut files = proposal.clone();
        files.is_aligned = proposed.is_aligned;
        let is_changed = files != proposed;
        if self.accept_guesses
            && let Err(error) = proposal.unasked(!request.options.order.is_empty())
        {
            self.error = Some(error.into());
            return;
        }
        let spec = proposal.spec();
        let has_order = case::unordered_times(&spec, &LoadOptions::default()).is_none();
        let is_told_again = proposal.is_aligned == proposed.is_aligned;
        if request.edits && !is_changed && is_told_again && has_order {
            return;
        }
        // Files that were dropped have no other description.
        match Accepted::new(&proposal, is_changed || !request.files.is_empty()) {
            Ok(mut accepted) => {
                if request.edits && accepted.key.is_empty() {
                    accepted.key.clone_from(&self.case_key);
                }
                self.job = Some(LoadJob::start(request, Some(accepted), wake));
            }
            Err(error) => self.error = Some(error.into()),
        }
    }

    /// Takes up dates without an order: as they were ordered before, or to be asked about.
    fn unordered(&mut self, question: OrderQuestion, wake: Waker) {
        let known = question.key().and_then(|key| self.answers.find(&key)).map(|answer| answer.order.clone());
        let is_asked = question.request.edits || question.accepted.is_some();
        self.order_question = Some(question);
        if let (false, Some(order)) = (is_asked, known) {
            self.notice =
                Some("Opened with its dates as ordered before; File, Case files… asks again.".into());
            self.order_dates(order, wake);
        }
    }

    /// Reads the case with its dates in this order; empty: in none.
    pub fn order_dates(&mut self, order: Vec<String>, wake: Waker) {
        let Some(question) = self.order_question.take() else { return };
        if let Some(key) = question.key() {
            self.answers.add(Answer { key, order: order.clone(), ..Answer::default() });
        }
        let OrderQuestion { mut request, accepted, .. } = question;
        request.options.order = order;
        request.unasked_order = true;
        self.job = Some(LoadJob::start(request, accepted, wake));
    }

    /// The manifest of the case that is being asked about, to be written at `path`.
    ///
    /// # Errors
    /// [`AppError`] where it has problems, or where `path` is one of the case's files.
    pub fn manifest_for(&self, path: &Path) -> Result<String, AppError> {
        let Some(Guess { request, proposal, .. }) = &self.guess else {
            return Err(AppError::file(path, "no case whose files are shown", "one (Case files…)"));
        };
        if let Some(problem) = proposal.problems().into_iter().next() {
            return Err(AppError::file(
                path,
                format!("a case with {}", problem.text),
                "one that can be read",
            ));
        }
        let mut spec = proposal.spec();
        spec.make_absolute();
        let order = &request.options.order;
        if spec.order.is_empty() && spec.is_ordered_by(order) {
            spec.order.clone_from(order);
        }
        spec.inputs().refuse_as_output(path)?;
        self.inputs().refuse_as_output(path)?;
        let path = absolute(path);
        Ok(case::write_manifest(&spec, path.parent().unwrap_or(&path))?)
    }

    /// Opens a session file and the case it refers to, with additional `tracts`.
    pub fn open_session(&mut self, path: &Path, tracts: &[PathBuf], wake: Waker) {
        match session::load(path) {
            Ok(session) => {
                // What was given on the command line is for the first case opened.
                let given = if self.doc.is_some() { self.limits() } else { self.options.clone() };
                self.start(Request::of_session(session, tracts, &given), wake);
            }
            Err(error) => self.error = Some(error.into()),
        }
    }

    /// Opens work that was never saved, from the file that it was kept in meanwhile. Where it is saved is asked later.
    pub fn open_unsaved(&mut self, path: &Path, wake: Waker) {
        match session::load(path) {
            Ok(session) => {
                let request = Request::of_session(session, &[], &self.limits());
                self.start(Request { session_path: None, is_unsaved: true, ..request }, wake);
            }
            Err(error) => self.error = Some(error.into()),
        }
    }

    /// Takes over a finished load, if any. Returns the path of the case or the session that was opened.
    pub fn poll(&mut self, wake: Waker) -> Option<PathBuf> {
        let result = self.job.as_ref()?.job.poll()?;
        let LoadJob { request, accepted, job } = self.job.take()?;
        match result {
            Ok(Opened::Guessed(proposal)) => {
                self.guessed(request, proposal, wake);
                None
            }
            Ok(Opened::Unordered(unordered)) => {
                self.unordered(OrderQuestion { request, accepted, unordered }, wake);
                None
            }
            Ok(Opened::Loaded(opened)) => {
                let is_unsaved = request.is_unsaved;
                // A session that is open already isn't read anew: what another window saved meanwhile stays unseen.
                if !is_unsaved || self.session_path != request.session_path {
                    self.session_stamp = request.session_path.as_deref().and_then(stamp);
                }
                let of_session = request.session.is_some();
                self.session_path = request.session_path;
                let before = self.world.case().cloned();
                let mut opened = *opened;
                // The open case was read again: what was done meanwhile stays.
                if request.session.as_ref().is_some_and(|session| session.origin.is_none()) {
                    opened.document = self.document_for(&opened.loaded.case).or(opened.document);
                }
                let kept = request.realigns.then(|| {
                    let alignments = self.doc.as_ref().map(|doc| doc.edit.alignments.clone());
                    (std::mem::take(&mut self.history), self.saved.take(), alignments)
                });
                let is_new = opened.document.is_none();
                let keeps_layout = self.install_opened(opened);
                let mut notices = Vec::new();
                if let (true, Some(case), Some(doc)) = (is_new, self.world.case(), &mut self.doc) {
                    // The sample is nobody's to judge.
                    let usual =
                        if doc.case == CaseRef::Sample { Usual::default() } else { self.usual.clone() };
                    let is_judged = doc.open_for_reading(case, &usual, !keeps_layout);
                    self.opened_with = (!keeps_layout).then(|| doc.edit.layout.clone());
                    self.saved = Some(Box::new(doc.edit.clone()));
                    // Whoever opens the folder again may look for what was done last time.
                    if let Some(session) = session::beside(&doc.case) {
                        let name = session.file_name().unwrap_or_default().to_string_lossy();
                        notices.push(format!("A session lies beside the case: {}.", printable(&name)));
                    }
                    if let Some(criterion) = usual.criterion.filter(|_| is_judged) {
                        notices.push(format!("Criteria as in the last report: {}.", criterion.name()));
                    }
                }
                if let (true, Some(before), Some(case), Some(doc)) =
                    (request.edits, before, self.world.case(), &mut self.doc)
                {
                    doc.edit.masks.follow(&before, case);
                }
                // The session doesn't have what was corrected of its case.
                let corrected = |accepted: &Accepted| accepted.case.is_some() && !accepted.silently;
                if is_unsaved || (of_session && accepted.as_ref().is_some_and(corrected)) {
                    self.saved = None;
                }
                if let Some((history, saved, alignments)) = kept {
                    (self.history, self.saved) = (history, saved);
                    // Changed once more meanwhile: the case is read again.
                    if let (Some(doc), Some(alignments)) = (&mut self.doc, alignments) {
                        doc.edit.alignments = alignments;
                    }
                }
                self.case_key.clear();
                if let Some(accepted) = accepted {
                    // A session says itself what its files are: that is no answer for the folder.
                    if !(of_session && accepted.silently) {
                        self.answers.add(accepted.answer(&request.options.order));
                    }
                    if accepted.silently {
                        notices.insert(
                            0,
                            "Opened as accepted before; File, Case files… changes what they are.".into(),
                        );
                    }
                    self.case_key = accepted.key;
                }
                if !notices.is_empty() {
                    self.notice = Some(notices.join(" ").into());
                }
                let is_path = request.files.is_empty() && !request.edits;
                self.session_path.clone().or(match request.case {
                    CaseRef::Path(path) if is_path => Some(path),
                    _ => None,
                })
            }
            Err(error) => {
                let failed = job.progress.check().is_ok();
                if let Some(accepted) = accepted.filter(|accepted| accepted.silently && failed) {
                    // Next time it is asked about.
                    self.answers.forget(&accepted.key);
                }
                if request.realigns {
                    self.drop_alignments();
                }
                if failed {
                    self.error = Some(error);
                } else {
                    self.notice = Some("Loading cancelled; nothing was changed.".into());
                }
                None
            }
        }
    }

    /// The document as it is now, for the open case as it was read again.
    fn document_for(&self, case: &Case) -> Option<Document> {
        let session = Session::of(self.doc.as_ref()?, self.world.case()?).ok()?;
        Some(session.restore(case).ok()?.0)
    }

    /// Takes up a guess: as it was accepted before, or to be shown.
    fn guessed(&mut self, mut request: Request, proposal: Proposal, wake: Waker) {
        // A session of a folder says nothing of its files: a correction made since is asked about.
        let applies = |answer: &&Answer| {
            !request.edits && !self.accept_guesses && (request.session.is_none() || answer.manifest.is_none())
        };
        let known = self.answers.find(&proposal.key).filter(applies);
        if let Some(answer) = known
            && let Ok(accepted) = Accepted::before(&proposal, answer)
        {
            if request.options.order.is_empty() {
                request.options.order.clone_from(&answer.order);
            }
            request.unasked_order = true;
            self.job = Some(LoadJob::start(request, Some(accepted), wake));
            return;
        }
        self.guess = Some(Guess { request, proposed: proposal.clone(), proposal });
    }

    /// The files that the open case and its session were read from: no output is written over them, but the session's own.
    pub fn inputs(&self) -> Inputs {
        let inputs = self.world.case().map(|case| case.inputs.clone()).unwrap_or_default();
        match &self.session_path {
            Some(session) => inputs.with(session.clone()),
            None => inputs,
        }
    }

    /// Saves the session to `path`; returns whether that succeeded.
    pub fn save(&mut self, path: PathBuf) -> bool {
        let (Some(doc), Some(case)) = (&self.doc, self.world.case()) else { return false };
        let now = stamp(&path);
        if self.session_path.as_ref() == Some(&path)
            && self.session_stamp.is_some_and(|known| now.is_some_and(|now| now != known))
        {
            let found = "a session that changed on disk since it was opened or saved here";
            self.error =
                Some(AppError::file(&path, found, "another name (Save session as), or to open it again"));
            return false;
        }
        let written = case
            .inputs
            .refuse_as_output(&path)
            .and_then(|()| session::save(&path, doc, case, self.world.files()));
        match written {
            Ok(()) => {
                self.notice = Some("Session saved.".into());
                self.saved = Some(Box::new(doc.edit.clone()));
                self.session_stamp = stamp(&path);
                self.session_path = Some(path);
                true
            }
            Err(error) => {
                self.error = Some(error.into());
                false
            }
        }
    }

    /// Applies a command to the document and records it for undo. [`Command::App`] has no effect here.
    pub fn apply(&mut self, command: &Command, now: Instant) {
        let Some(doc) = &mut self.doc else { return };
        match command {
            Command::App(_) => {}
            Command::Edit(command @ (EditCommand::Undo | EditCommand::Redo)) => {
                let center_mm = doc.edit.lens.center_mm;
                let arrangement = doc.edit.clone();
                if *command == EditCommand::Undo {
                    self.history.undo(&mut doc.edit);
                } else {
                    self.history.redo(&mut doc.edit);
                }
                doc.edit.arrange_as(&arrangement);
                // The camera orbits the lens, so it follows it.
                if doc.edit.lens.center_mm != center_mm {
                    doc.nav.camera.focus_mm = doc.edit.lens.center_mm;
                }
            }
            Command::Edit(edit) => {
                if matches!(edit, EditCommand::AddRuler(_)) && doc.edit.rulers.len() >= MOST_RULERS {
                    let found = format!("{MOST_RULERS} of them");
                    self.error = Some(AppError::wrong("lines", found, "fewer, to keep another"));
                }
                let mut before = doc.edit.clone();
                edit.apply(doc, &self.world);
                before.arrange_as(&doc.edit);
                if doc.edit != before {
                    self.history.record(before, command.gesture(), now);
                }
            }
            Command::Look(look) => look.apply(doc, &self.world),
        }
        self.world.set_made(&doc.edit.made);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{model::PaneId, world::load::spec_of};
    use glioscope_core::{Progress, case};

    fn sample() -> Workstation {
        let (options, progress) = (LoadOptions::default(), Progress::new());
        let spec = spec_of(&CaseRef::Sample, &options, &progress).unwrap();
        let loaded = Loaded::new(case::load(&spec, &options, &progress).unwrap());
        Workstation::with_case(CaseRef::Sample, loaded)
    }

    #[test]
    fn the_order_of_dates_and_the_case_grid_are_not_applied_to_another_case() {
        let options = LoadOptions {
            max_bytes: 7,
            case_grid: case::CaseGridChoice::Of("T1".into()),
            order: vec!["b".into(), "a".into()],
            alignments: vec![case::Alignment::from_argument("T1=a.tfm").unwrap()],
            one_space: true,
            derivatives: vec!["nnunet".into()],
        };
        let first = Workstation { options: options.clone(), ..Workstation::default() };
        assert_eq!(first.options_for(&CaseRef::Sample), options);
        let open = Workstation { options: options.clone(), ..sample() };
        assert_eq!(open.options_for(&CaseRef::Sample), options, "with additional tracts, say");
        let another = open.options_for(&CaseRef::Path("other".into()));
        assert_eq!(another, LoadOptions { max_bytes: 7, ..LoadOptions::default() });
    }

    #[test]
    fn undo_takes_back_deeds_and_leaves_the_panes_where_they_are() {
        let mut work = sample();
        let now = Instant::now();
        work.apply(&EditCommand::MaximizePane(PaneId::Axial).into(), now);
        work.apply(&EditCommand::TogglePane(PaneId::Diagnostics).into(), now);
        assert!(!work.history.can_undo(), "nothing was done yet");
        work.apply(&EditCommand::ToggleRegion(1).into(), now);
        work.apply(&EditCommand::MaximizePane(PaneId::Axial).into(), now);
        work.apply(&EditCommand::TogglePane(PaneId::Coronal).into(), now);
        let arranged = work.doc.clone().unwrap().edit;
        for (command, shown) in [(EditCommand::Undo, true), (EditCommand::Redo, false)] {
            work.apply(&command.into(), now);
            let doc = work.doc.as_ref().unwrap();
            let edit = &doc.edit;
            assert_eq!(work.world.selection(doc).shows(1), shown);
            assert_eq!((&edit.layout, edit.maximized), (&arranged.layout, arranged.maximized));
        }
    }

    #[test]
    fn a_drag_is_one_gesture_whatever_its_pauses() {
        let mut work = sample();
        let start = Instant::now();
        let later = start + Duration::from_secs(4);
        let radius = |work: &Workstation| work.doc.as_ref().unwrap().edit.lens.radius_mm;
        let set_radius = |radius_mm: f64| Command::from(EditCommand::SetLensRadius(radius_mm));
        let initial_mm = radius(&work);
        work.history.hold(true);
        work.apply(&set_radius(20.0), start);
        work.apply(&set_radius(21.0), later);
        work.history.hold(false);
        // Another press soon after is another gesture.
        work.history.hold(true);
        work.apply(&set_radius(22.0), later);
        work.history.hold(false);
        work.apply(&EditCommand::Undo.into(), later);
        assert_eq!(radius(&work), 21.0);
        work.apply(&EditCommand::Undo.into(), later);
        assert_eq!(radius(&work), initial_mm);
        assert!(!work.history.can_undo());
    }
}
