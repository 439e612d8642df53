//! Opening a case on a worker.

use std::{collections::BTreeSet, path::PathBuf};

use glioscope_core::{
    Check, Progress,
    case::{self, CaseError, CaseGridChoice, CaseSpec, LoadOptions},
    sample,
};

use super::{
    Loaded,
    jobs::{Job, Waker},
};
use crate::{
    error::AppError,
    model::{CaseRef, Document, Session},
};

/// The description of the case that a reference names, before it is read. Files of a folder are opened only where
/// their names are ambiguous.
///
/// # Errors
/// [`CaseError`]: the manifest, folder or argument is invalid.
pub fn spec_of(case: &CaseRef, options: &LoadOptions, progress: &Progress) -> Result<CaseSpec, CaseError> {
    match case {
        CaseRef::Sample => Ok(sample::sample_spec()),
        CaseRef::Path(path) => case::open_spec(path, options, progress),
        CaseRef::Arguments { masks, contexts } => CaseSpec::from_arguments(masks, contexts),
    }
}

/// What a case is opened with.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// The case.
    pub case: CaseRef,
    /// Files of fibre tracts in addition to the case's.
    pub tracts: Vec<PathBuf>,
    /// What is restored once the case is read; `None`: an initial document.
    pub session: Option<Box<Session>>,
    /// The file of the session; from then on the session is saved there.
    pub session_path: Option<PathBuf>,
    /// Options of loading.
    pub options: LoadOptions,
}

/// Result of a [`LoadJob`].
pub enum Opened {
    /// The roles of the files were guessed from their names: the user confirms the guess before the case is read.
    Guessed(CaseSpec),
    /// The case has been read.
    Loaded(Box<LoadedCase>),
}

/// A case that was read, and the document restored for it.
pub struct LoadedCase {
    /// The case.
    pub loaded: Loaded,
    /// The document restored from a session; `None`: the initial one.
    pub document: Option<Document>,
    /// The options it was read with.
    pub options: LoadOptions,
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

fn open(request: Request, accepted: Option<CaseSpec>, progress: &Progress) -> Result<Opened, AppError> {
    let spec = match accepted {
        Some(spec) => spec,
        None => {
            progress.say("reading names");
            let spec = spec_of(&request.case, &request.options, progress)?;
            if !spec.notes.is_empty() {
                return Ok(Opened::Guessed(spec));
            }
            spec
        }
    };
    Ok(Opened::Loaded(Box::new(read(request, spec, progress)?)))
}

/// Reads the case that `request` names, described by `spec`, and restores the session for it. What the session says about
/// dates, masks and images that the case lacks is left out, with a warning among the case's findings.
///
/// # Errors
/// [`AppError`] where the case can't be read.
pub fn read(request: Request, mut spec: CaseSpec, progress: &Progress) -> Result<LoadedCase, AppError> {
    let Request { tracts, mut session, mut options, .. } = request;
    let mut findings = Vec::new();
    if let Some(session) = &mut session {
        findings.extend(stale_options(&spec, &mut options));
        session.document.order.clone_from(&options.order);
        session.document.case_grid = case_grid_id(&options);
    }
    spec.add_tracts(&tracts);
    let mut case = case::load(&spec, &options, progress)?;
    let document = match session {
        None => None,
        Some(session) => {
            let (document, checks) = session.restore(&case)?;
            findings.extend(checks);
            Some(document)
        }
    };
    case.checks.extend(findings);
    case.checks.sort_by_key(|check| std::cmp::Reverse(check.severity));
    Ok(LoadedCase { loaded: Loaded::new(case), document, options })
}

/// The id of the mask or image whose grid is chosen.
pub fn case_grid_id(options: &LoadOptions) -> Option<String> {
    match &options.case_grid {
        CaseGridChoice::FinestMask => None,
        CaseGridChoice::Of(id) => Some(id.clone()),
    }
}

/// Leaves out the order of dates and the case grid of a session where they name others than the case has now.
fn stale_options(spec: &CaseSpec, options: &mut LoadOptions) -> Vec<Check> {
    let mut findings = Vec::new();
    let times = spec.contexts.iter().map(|c| &c.time).chain(spec.masks.iter().map(|m| &m.time));
    let dates: BTreeSet<&String> = times.flatten().collect();
    if !options.order.is_empty() && options.order.iter().collect::<BTreeSet<_>>() != dates {
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
        && !ids.any(|known| known == id)
    {
        let text = format!("The session has the grid of {id}, which the case lacks; that of the finest mask is used.");
        findings.push(Check::warning("session-case-grid", text));
        options.case_grid = CaseGridChoice::FinestMask;
    }
    findings
}
