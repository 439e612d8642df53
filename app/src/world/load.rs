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

/// The case that a reference names, before it is read. A folder's files are opened where their names
/// don't say enough.
///
/// # Errors
/// [`CaseError`]: the manifest, folder or argument is wrong.
pub fn spec_of(case: &CaseRef, options: &LoadOptions, progress: &Progress) -> Result<CaseSpec, CaseError> {
    match case {
        CaseRef::Sample => Ok(sample::sample_spec()),
        CaseRef::Path(path) => case::open_spec(path, options, progress),
        CaseRef::Arguments { masks, contexts } => CaseSpec::from_arguments(masks, contexts),
    }
}

/// What a worker hands back.
pub enum Opened {
    /// The case's files were guessed from names: the user sees the guess before it is used.
    Guessed(CaseSpec),
    /// The case is read.
    Loaded(Box<Loaded>),
}

/// A worker that opens a case.
pub struct LoadJob {
    /// What is being opened.
    pub case: CaseRef,
    /// Files of fibre tracts beside those that it names.
    pub tracts: Vec<PathBuf>,
    /// A document to continue with, from a session file.
    pub document: Option<Document>,
    /// The worker.
    pub job: Job<Opened>,
}

impl LoadJob {
    /// Starts opening `case` and `tracts` beside it, or reading `accepted`, a spec that the user has
    /// seen.
    pub fn start(
        case: CaseRef,
        tracts: Vec<PathBuf>,
        accepted: Option<CaseSpec>,
        options: LoadOptions,
        document: Option<Document>,
        wake: Waker,
    ) -> Self {
        let (wanted, beside) = (case.clone(), tracts.clone());
        let job = Job::start(wake, move |progress| open(&wanted, &beside, accepted, &options, progress));
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
