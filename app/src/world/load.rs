//! Opening a case on a worker, and the case of a session.

use std::{collections::BTreeSet, path::PathBuf};

use glioscope_core::{
    Check, Progress,
    case::{self, Case, CaseGridChoice, CaseSpec, LoadOptions},
    files::FileMark,
};

pub use super::session_case::spec_of;
use super::{
    Loaded,
    jobs::{Job, Waker},
    session_case::{self, Found},
};
use crate::{
    error::AppError,
    model::{CaseRef, Document, Place, Session},
};

/// What a case is opened with.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// The case; that of the session, where there is one.
    pub case: CaseRef,
    /// Files of fibre tracts in addition to those of the case and of the session.
    pub tracts: Vec<PathBuf>,
    /// What is restored once the case is read; `None`: an initial document.
    pub session: Option<Box<Session>>,
    /// The file of the session; from then on the session is saved there.
    pub session_path: Option<PathBuf>,
    /// Whether the session has work that no file has.
    pub is_unsaved: bool,
    /// Options of loading.
    pub options: LoadOptions,
}

impl Request {
    /// A session with additional `tracts`. The order of dates and the case grid are as in the session where `given` leaves
    /// them open.
    pub fn of_session(session: Session, tracts: &[PathBuf], given: &LoadOptions) -> Self {
        let mut options = given.clone();
        let Document { case, order, case_grid, .. } = &session.document;
        if options.order.is_empty() {
            options.order.clone_from(order);
        }
        if let (CaseGridChoice::FinestMask, Some(id)) = (&options.case_grid, case_grid) {
            options.case_grid = CaseGridChoice::Of(id.clone());
        }
        let session_path = session.origin.as_ref().map(|origin| origin.path.clone());
        let case = case.clone();
        let (tracts, session) = (tracts.to_vec(), Some(Box::new(session)));
        Self { case, tracts, session, session_path, is_unsaved: false, options }
    }
}

/// Result of a [`LoadJob`].
pub enum Opened {
    /// The roles of the files were guessed from their names: the user confirms the guess before the case is read.
    Guessed(CaseSpec),
    /// The case has been read.
    Loaded(Box<OpenedCase>),
}

/// A case that was read, and the document restored for it.
pub struct ReadCase {
    /// What it was opened from.
    pub place: Place,
    /// Its description.
    pub spec: CaseSpec,
    /// The case.
    pub case: Case,
    /// Its files as they were read; empty where that isn't known.
    pub files: Vec<FileMark>,
    /// The document restored from a session; `None`: the initial one.
    pub document: Option<Document>,
    /// The options it was read with.
    pub options: LoadOptions,
}

/// As [`ReadCase`], with what every view needs.
pub struct OpenedCase {
    /// What it was opened from.
    pub place: Place,
    /// The case, prepared for the views.
    pub loaded: Loaded,
    /// The document restored from a session; `None`: the initial one.
    pub document: Option<Document>,
    /// The options it was read with.
    pub options: LoadOptions,
}

impl From<ReadCase> for OpenedCase {
    fn from(read: ReadCase) -> Self {
        let ReadCase { place, case, files, document, options, .. } = read;
        Self { place, loaded: Loaded::new(case).with_files(files), document, options }
    }
}

/// A worker that opens a case.
pub struct LoadJob {
    /// What is being opened.
    pub request: Request,
    /// The worker.
    pub job: Job<Opened>,
}

impl LoadJob {
    /// Starts opening what `request` names; where given, `accepted`, a guess that the user has confirmed, is read instead
    /// of resolving the case again.
    pub fn start(request: Request, accepted: Option<CaseSpec>, wake: Waker) -> Self {
        let of_job = request.clone();
        let job = Job::start(wake, move |progress| open(of_job, accepted, progress));
        Self { request, job }
    }
}

fn open(mut request: Request, accepted: Option<CaseSpec>, progress: &Progress) -> Result<Opened, AppError> {
    progress.say("reading names");
    let mut found = find(&mut request, progress)?;
    match accepted {
        Some(spec) => found.spec = spec,
        None if found.spec.notes.is_empty() => {}
        None => return Ok(Opened::Guessed(found.spec)),
    }
    let mut read = read(request, found, progress)?;
    if read.files.is_empty() {
        // Where a file has gone since it was read, sessions are saved without marks.
        read.files = session_case::marks(&read.spec, progress).unwrap_or_default();
    }
    Ok(Opened::Loaded(Box::new(read.into())))
}

/// Reads the case that `request` names at once, as its names were guessed.
///
/// # Errors
/// [`AppError`] where the case can't be read.
pub fn read_at_once(mut request: Request, progress: &Progress) -> Result<ReadCase, AppError> {
    let found = find(&mut request, progress)?;
    read(request, found, progress)
}

/// The description of the case that `request` names, with what its session finds changed, without reading it.
///
/// # Errors
/// [`AppError`] where there is no such case.
pub fn describe(mut request: Request, progress: &Progress) -> Result<CaseSpec, AppError> {
    let Found { mut spec, findings, .. } = find(&mut request, progress)?;
    spec.add_tracts(&request.tracts);
    spec.notes.extend(findings);
    Ok(spec)
}

/// Where the case of `request` lies, and its description.
fn find(request: &mut Request, progress: &Progress) -> Result<Found, AppError> {
    let Request { case, session, options, .. } = request;
    let Some(session) = session else {
        return Found::unchecked(Place { case: case.clone(), tracts: Vec::new() }, options, progress);
    };
    let mut found = match &session.origin {
        Some(origin) => session_case::find(session, origin, options, progress)?,
        None => Found::unchecked(Place::of(&session.document), options, progress)?,
    };
    found.findings.extend(session.findings.iter().cloned());
    found.findings.extend(stale_options(&found.spec, &session.document, options));
    Ok(found)
}

/// Reads the case found for `request` and restores the session for it. What the session says about dates, masks and images
/// that the case lacks is left out, with a warning among the case's findings.
fn read(request: Request, found: Found, progress: &Progress) -> Result<ReadCase, AppError> {
    let Found { mut place, mut spec, files, mut findings } = found;
    let options = request.options;
    spec.add_tracts(&request.tracts);
    place.tracts.extend(request.tracts);
    let mut case = case::load(&spec, &options, progress)?;
    let document = match request.session {
        None => None,
        Some(session) => {
            let (document, checks) = session.restore(&case)?;
            findings.extend(checks);
            Some(document)
        }
    };
    case.checks.extend(findings);
    case.checks.sort_by_key(|check| std::cmp::Reverse(check.severity));
    Ok(ReadCase { place, spec, case, files, document, options })
}

/// Leaves out the order of dates and the case grid of a session where they name others than the case has now. Those given
/// on the command line are refused instead, when the case is read.
fn stale_options(spec: &CaseSpec, document: &Document, options: &mut LoadOptions) -> Vec<Check> {
    let mut findings = Vec::new();
    let times = spec.contexts.iter().map(|c| &c.time).chain(spec.masks.iter().map(|m| &m.time));
    let dates: BTreeSet<&String> = times.flatten().collect();
    let of_session = !options.order.is_empty() && options.order == document.order;
    if of_session && options.order.iter().collect::<BTreeSet<_>>() != dates {
        let dates: Vec<&str> = dates.into_iter().map(String::as_str).collect();
        let text = format!(
            "The session has the order {} of dates, and the case the dates {}; the order of the case is used.",
            options.order.join(", "),
            dates.join(", ")
        );
        findings.push(Check::warning("session-order", text));
        options.order.clear();
    }
    let mut ids = spec.contexts.iter().map(|c| &c.id).chain(spec.masks.iter().map(|m| &m.id));
    if let CaseGridChoice::Of(id) = &options.case_grid
        && document.case_grid.as_ref() == Some(id)
        && !ids.any(|known| known == id)
    {
        let text = format!(
            "The session has the grid of {id}, which the case lacks; that of the finest mask is used."
        );
        findings.push(Check::warning("session-case-grid", text));
        options.case_grid = CaseGridChoice::FinestMask;
    }
    findings
}
