//! Opening a case on a worker.

use std::path::PathBuf;

use glioscope_core::{
    Progress,
    case::{self, CaseError, CaseSpec, LoadOptions},
    sample,
};

use super::{
    Loaded,
    jobs::{Job, Waker},
};
use crate::{
    error::AppError,
    model::{CaseRef, Document},
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

/// Result of a [`LoadJob`].
pub enum Opened {
    /// The roles of the files were guessed from their names: the user confirms the guess before the case is read.
    Guessed(CaseSpec),
    /// The case has been read.
    Loaded(Box<Loaded>),
}

/// A worker that opens a case.
pub struct LoadJob {
    /// The case being opened.
    pub case: CaseRef,
    /// Files of fibre tracts in addition to the case's.
    pub tracts: Vec<PathBuf>,
    /// The document to restore, from a session file.
    pub document: Option<Document>,
    /// The worker.
    pub job: Job<Opened>,
}

impl LoadJob {
    /// Starts opening `case` with additional `tracts`; where given, `accepted`, a guess that the user has confirmed, is
    /// read instead of resolving `case` again.
    pub fn start(
        case: CaseRef,
        tracts: Vec<PathBuf>,
        accepted: Option<CaseSpec>,
        options: LoadOptions,
        document: Option<Document>,
        wake: Waker,
    ) -> Self {
        let (job_case, job_tracts) = (case.clone(), tracts.clone());
        let job =
            Job::start(wake, move |progress| open(&job_case, &job_tracts, accepted, &options, progress));
        Self { case, tracts, document, job }
    }
}

fn open(
    case: &CaseRef,
    tracts: &[PathBuf],
    accepted: Option<CaseSpec>,
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Opened, AppError> {
    let mut spec = match accepted {
        Some(spec) => spec,
        None => {
            progress.say("reading names");
            let spec = spec_of(case, options, progress)?;
            if !spec.notes.is_empty() {
                return Ok(Opened::Guessed(spec));
            }
            spec
        }
    };
    spec.add_tracts(tracts);
    let case = case::load(&spec, options, progress)?;
    Ok(Opened::Loaded(Box::new(Loaded::new(case))))
}
