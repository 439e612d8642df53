//! Opening a case on a worker, and the case of a session.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use glioscope_core::{
    Check, Progress,
    case::{self, Case, CaseError, CaseGridChoice, CaseSpec, Description, LoadOptions, Proposal},
    files::{FileMark, absolute},
};

pub use super::session_case::spec_of;
use super::{
    Loaded,
    jobs::{Job, Waker},
    session_case::{self, Found},
};
use crate::{
    error::AppError,
    model::{
        Answer, CaseRef, Document, Place, Session,
        made::{self, MadeMask},
    },
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
    /// Files and folders to open as one case, in place of the case.
    pub files: Vec<PathBuf>,
    /// Whether the user wants to say again what the files of the open case are.
    pub edits: bool,
    /// Whether the open case is read again because its transforms changed: undo and redo stay.
    pub realigns: bool,
    /// Whether dates without an order in time are taken as they are listed.
    pub unasked_order: bool,
    /// Options of loading.
    pub options: LoadOptions,
    /// What was found before it is read.
    pub findings: Vec<Check>,
}

impl Request {
    /// A session with additional `tracts`. The order of dates and the case grid are as in the session where `given` leaves
    /// them open.
    pub fn of_session(session: Session, tracts: &[PathBuf], given: &LoadOptions) -> Self {
        let mut options = given.clone();
        let Document { case, order, case_grid, one_space, derivatives, .. } = &session.document;
        options.one_space |= one_space;
        if options.derivatives.is_empty() {
            options.derivatives.clone_from(derivatives);
        }
        if options.order.is_empty() {
            options.order.clone_from(order);
        }
        if let (CaseGridChoice::FinestMask, Some(id)) = (&options.case_grid, case_grid) {
            options.case_grid = CaseGridChoice::Of(id.clone());
        }
        let session_path = session.origin.as_ref().map(|origin| origin.path.clone());
        let case = case.clone();
        let (tracts, session) = (tracts.to_vec(), Some(Box::new(session)));
        Self { case, tracts, session, session_path, unasked_order: true, options, ..Self::default() }
    }
}

/// What the user accepted of a proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Accepted {
    /// The description of the case.
    pub spec: CaseSpec,
    /// The case with its description, where the user changed it; `None`: as it was named.
    pub case: Option<CaseRef>,
    /// Names the files: [`Proposal::key`].
    pub key: String,
    /// Why it may not be one case, if so.
    pub doubt: Option<String>,
    /// Whether it was accepted before, and wasn't asked about again.
    pub silently: bool,
}

impl Accepted {
    /// A proposal as the user left it.
    ///
    /// # Errors
    /// [`CaseError`] where it can't be described by a manifest: a file's name isn't UTF-8.
    pub fn new(proposal: &Proposal, is_changed: bool) -> Result<Self, CaseError> {
        let mut spec = proposal.spec();
        let case = if is_changed {
            // The guesses are no guesses any more.
            spec.notes.retain(|note| !note.code.starts_with("guessed-"));
            Some(CaseRef::Files {
                folder: proposal.archive.clone().unwrap_or_else(|| proposal.folder.clone()),
                manifest: case::write_manifest(&spec, &proposal.folder)?,
                left_out: proposal.left_out(),
            })
        } else {
            None
        };
        Ok(Self { spec, case, key: proposal.key.clone(), doubt: proposal.doubt.clone(), silently: false })
    }

    /// What was accepted of the same files before.
    ///
    /// # Errors
    /// [`CaseError`] for a manifest that can't be read.
    pub fn before(proposal: &Proposal, answer: &Answer) -> Result<Self, CaseError> {
        let mut spec = proposal.spec();
        let case = match &answer.manifest {
            Some(manifest) => {
                let folder = proposal.archive.clone().unwrap_or_else(|| proposal.folder.clone());
                let accepted = session_case::accepted_spec(&proposal.folder, manifest)?;
                let mut notes = proposal.notes.clone();
                notes.retain(|note| !note.code.starts_with("guessed-"));
                spec = CaseSpec { notes, described_by: spec.described_by, ..accepted };
                let left_out = answer.left_out.clone();
                Some(CaseRef::Files { folder, manifest: manifest.clone(), left_out })
            }
            None => None,
        };
        spec.one_space |= answer.one_space;
        Ok(Self { spec, case, key: proposal.key.clone(), doubt: proposal.doubt.clone(), silently: true })
    }

    /// What is remembered of it, with the order of dates that was asked for.
    pub fn answer(&self, order: &[String]) -> Answer {
        let (manifest, left_out) = match &self.case {
            Some(CaseRef::Files { manifest, left_out, .. }) => (Some(manifest.clone()), left_out.clone()),
            _ => (None, Vec::new()),
        };
        let (order, one_space) = (order.to_vec(), self.spec.one_space);
        Answer { key: self.key.clone(), manifest, left_out, order, one_space }
    }
}

/// Dates whose order nothing states.
#[derive(Clone, Debug, PartialEq)]
pub struct Unordered {
    /// Their labels, in the order in which they were last stated or listed.
    pub times: Vec<String>,
    /// Why they may not be dates, if so.
    pub doubt: Option<String>,
}

/// Result of a [`LoadJob`].
pub enum Opened {
    /// The roles of the files were guessed from their names: the user confirms the guess before the case is read.
    Guessed(Proposal),
    /// The user is asked for the order of the dates before the case is read.
    Unordered(Unordered),
    /// The case has been read.
    Loaded(Box<OpenedCase>),
}

/// A case that was read, and the document restored for it.
pub struct ReadCase {
    /// What it was opened from.
    pub place: Place,
    /// Its description.
    pub spec: CaseSpec,
    /// The case as its files have it.
    base: Arc<Case>,
    /// The masks made from it in its session.
    made: Vec<MadeMask>,
    /// The case with them.
    pub case: Arc<Case>,
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
        let ReadCase { place, base, made, case, files, document, options, .. } = read;
        let loaded = Loaded::with_made(base, made, case).with_files(files);
        Self { place, loaded, document, options }
    }
}

/// A worker that opens a case.
pub struct LoadJob {
    /// What is being opened.
    pub request: Request,
    /// What the user accepted of it.
    pub accepted: Option<Accepted>,
    /// The worker.
    pub job: Job<Opened>,
}

impl LoadJob {
    /// Starts opening what `request` names; where given, `accepted` is read instead of resolving the case again.
    pub fn start(request: Request, accepted: Option<Accepted>, wake: Waker) -> Self {
        let of_job = (request.clone(), accepted.clone());
        let job = Job::start(wake, move |progress| open(of_job.0, of_job.1, progress));
        Self { request, accepted, job }
    }
}

fn open(mut request: Request, accepted: Option<Accepted>, progress: &Progress) -> Result<Opened, AppError> {
    progress.say("reading names");
    let doubt = accepted.as_ref().and_then(|accepted| accepted.doubt.clone());
    let found = match accepted {
        None if request.session.is_none() => match described_anew(&request, progress)? {
            Description::Proposed(proposal) => return Ok(Opened::Guessed(proposal)),
            Description::Stated(spec) => Found::described(initial_place(&request), spec),
        },
        None => {
            let mut found = find(&mut request, progress)?;
            let mut proposal = found.proposal.take();
            if let (true, Some(proposal)) = (request.edits, &mut proposal) {
                proposal.take_tracts(&found.place.tracts);
            }
            let proposal = if request.edits { proposal.or_else(|| described(&found)) } else { proposal };
            if let Some(mut proposal) = proposal {
                proposal.is_aligned |= request.options.one_space;
                return Ok(Opened::Guessed(proposal));
            }
            found
        }
        Some(accepted) => accept(&mut request, accepted, progress)?,
    };
    let options = if request.edits { LoadOptions::default() } else { request.options.clone() };
    if !request.unasked_order
        && let Some(mut times) = case::unordered_times(&found.spec, &options)
    {
        let stated = &request.options.order;
        if found.spec.is_ordered_by(stated) {
            times.clone_from(stated);
        }
        return Ok(Opened::Unordered(Unordered { times, doubt }));
    }
    let mut read = read(request, found, false, progress)?;
    if read.files.is_empty() {
        // Where a file has gone since it was read, sessions are saved without marks.
        read.files = session_case::marks(&read.spec, progress).unwrap_or_default();
    }
    Ok(Opened::Loaded(Box::new(read.into())))
}

/// The description of what `request` names without a session.
fn described_anew(request: &Request, progress: &Progress) -> Result<Description, CaseError> {
    if request.files.is_empty() {
        return session_case::description_of(&request.case, &request.options, progress);
    }
    Ok(Description::Proposed(case::describe_files(&request.files, &request.options, progress)?))
}

/// Where the case of `request` lies, without a session.
fn initial_place(request: &Request) -> Place {
    Place { case: request.case.clone(), tracts: Vec::new(), alignments: Vec::new() }
}

/// The files of a case that is described, to say again what they are. `None` for the sample, which has none.
fn described(found: &Found) -> Option<Proposal> {
    let mut spec = found.spec.clone();
    spec.make_absolute();
    let (folder, left_out) = match &found.place.case {
        CaseRef::Files { folder, left_out, .. } => (folder.clone(), left_out.clone()),
        CaseRef::Path(path) => {
            let path = absolute(path);
            let folder = if path.is_dir() { path } else { path.parent().map(Path::to_owned)? };
            (folder, Vec::new())
        }
        CaseRef::Arguments { .. } | CaseRef::Sample => (std::env::current_dir().ok()?, Vec::new()),
    };
    Proposal::of_spec(&spec, &absolute(&folder), &left_out)
}

/// The case of `request` as the user accepted it.
fn accept(request: &mut Request, accepted: Accepted, progress: &Progress) -> Result<Found, AppError> {
    let is_changed = accepted.case.is_some();
    let was_asked = request.edits;
    request.options.one_space = accepted.spec.one_space || (request.options.one_space && !was_asked);
    let mut found = if request.session.is_some() {
        find(request, progress)?
    } else {
        Found::described(initial_place(request), CaseSpec::default())
    };
    if is_changed || request.session.is_none() {
        found.spec = accepted.spec;
    }
    if let Some(case) = accepted.case {
        found.place.case = case;
        // Other files may have been chosen.
        found.files.clear();
    }
    match (is_changed, request.edits) {
        // They are among the files accepted.
        (true, true) => found.place.tracts.clear(),
        (true, false) => found.spec.add_tracts(&found.place.tracts),
        (false, _) => {}
    }
    if (request.edits || is_changed) && !found.spec.is_ordered_by(&request.options.order) {
        request.options.order.clear();
    }
    // A mask or an image that was renamed or left out has no grid to choose.
    if let CaseGridChoice::Of(id) = &request.options.case_grid
        && is_changed
        && !found.spec.has_grid_of(id)
    {
        request.options.case_grid = CaseGridChoice::FinestMask;
    }
    Ok(found)
}

/// Reads the case that `request` names at once, as its names were guessed. Its session is one of its inputs.
///
/// # Errors
/// [`AppError`] where the case can't be read.
pub fn read_at_once(mut request: Request, progress: &Progress) -> Result<ReadCase, AppError> {
    let found = find(&mut request, progress)?;
    read(request, found, true, progress)
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
    let place = initial_place(request);
    let Request { session, options, .. } = request;
    let Some(session) = session else {
        return Found::unchecked(place, options, progress);
    };
    let mut found = match &session.origin {
        Some(origin) => session_case::find(session, origin, options, progress)?,
        None => Found::unchecked(Place::of(&session.document), options, progress)?,
    };
    found.findings.extend(session.findings.iter().cloned());
    found.findings.extend(stale_options(&found.spec, &session.document, options));
    let (kept, stale): (Vec<_>, Vec<_>) =
        found.place.alignments.drain(..).partition(|alignment| alignment.moves_any(&found.spec));
    found.place.alignments = kept;
    found.findings.extend(stale.iter().map(|alignment| {
        let (by, target) = (alignment.by.name(), alignment.target());
        let text =
            format!("The session moves {target} by {by}, and the case lacks it; the transform is left out.");
        Check::warning("session-transform", text)
    }));
    Ok(found)
}

/// Reads the case found for `request` and restores the session for it. What the session says about dates, masks and images
/// that the case lacks is left out, with a warning among the case's findings.
fn read(
    request: Request,
    found: Found,
    is_session_kept: bool,
    progress: &Progress,
) -> Result<ReadCase, AppError> {
    let Found { mut place, mut spec, files, mut findings, .. } = found;
    findings.extend(request.findings);
    let mut options = request.options;
    // Of the session; one given now replaces one of the same target.
    let given = |target: &str| options.alignments.iter().any(|alignment| alignment.target() == target);
    place.alignments.retain(|alignment| !given(&alignment.target()));
    place.alignments.append(&mut options.alignments);
    options.alignments.clone_from(&place.alignments);
    spec.add_tracts(&request.tracts);
    place.tracts.extend(request.tracts);
    let mut base = case::load(&spec, &options, progress)?;
    if let (true, Some(session)) = (is_session_kept, request.session_path) {
        // Not written over either.
        base.inputs = base.inputs.with(session);
    }
    let made = request.session.as_ref().map(|session| session.document.edit.made.clone()).unwrap_or_default();
    let mut with_made = (!made.is_empty()).then(|| made::with_made(&base, &made));
    let document = match request.session {
        None => None,
        Some(session) => {
            let (document, checks) = session.restore(with_made.as_ref().unwrap_or(&base))?;
            findings.extend(checks);
            Some(document)
        }
    };
    for case in std::iter::once(&mut base).chain(&mut with_made) {
        case.checks.extend(findings.iter().cloned());
        case.checks.sort_by_key(|check| std::cmp::Reverse(check.severity));
    }
    let base = Arc::new(base);
    let case = with_made.map_or_else(|| base.clone(), Arc::new);
    Ok(ReadCase { place, spec, base, made, case, files, document, options })
}

/// Leaves out the order of dates and the case grid of a session where they name others than the case has now. Those given
/// on the command line are refused instead, when the case is read.
fn stale_options(spec: &CaseSpec, document: &Document, options: &mut LoadOptions) -> Vec<Check> {
    let mut findings = Vec::new();
    let of_session = !options.order.is_empty() && options.order == document.order;
    if of_session && !spec.is_ordered_by(&options.order) {
        let mut dates = spec.times();
        dates.sort();
        let text = format!(
            "The session has the order {} of dates, and the case the dates {}; the order of the case is used.",
            options.order.join(", "),
            dates.join(", ")
        );
        findings.push(Check::warning("session-order", text));
        options.order.clear();
    }
    if let CaseGridChoice::Of(id) = &options.case_grid
        && document.case_grid.as_ref() == Some(id)
        && !spec.has_grid_of(id)
    {
        let text = format!(
            "The session has the grid of {id}, which the case lacks; that of the finest mask is used."
        );
        findings.push(Check::warning("session-case-grid", text));
        options.case_grid = CaseGridChoice::FinestMask;
    }
    findings
}
