//! The case of a session: at which of the places that the session names it lies, and whether its files are still those that
//! the session was saved with.

use std::path::Path;

use glioscope_core::{
    Check, Progress,
    case::{self, CaseError, CaseSpec, Description, LoadOptions, Proposal},
    check::listed,
    files::{FileError, FileMark, archive},
    sample,
};

use crate::{
    error::AppError,
    model::{CaseRef, Origin, Place, Session},
};

/// The most files named in one message.
const MOST_NAMED: usize = 3;

/// The description of the case that a reference names, before it is read. Files of a folder are opened only where
/// their names are ambiguous.
///
/// # Errors
/// [`CaseError`]: the manifest, folder or argument is invalid.
pub fn spec_of(case: &CaseRef, options: &LoadOptions, progress: &Progress) -> Result<CaseSpec, CaseError> {
    description_of(case, options, progress)?.unasked(options)
}

/// As [`spec_of`], where what was guessed can still be corrected.
pub(super) fn description_of(
    case: &CaseRef,
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Description, CaseError> {
    let spec = match case {
        CaseRef::Sample => sample::sample_spec(),
        CaseRef::Path(path) => return case::describe(path, options, progress),
        CaseRef::Arguments { masks, contexts } => CaseSpec::from_arguments(masks, contexts)?,
        CaseRef::Files { folder, manifest, .. } => {
            let inside = if archive::is_zip(folder) {
                archive::unpacked(folder, options.max_bytes, progress)?
            } else {
                folder.clone()
            };
            accepted_spec(&inside, manifest)?
        }
    };
    Ok(Description::Stated(spec))
}

/// The description that the user gave of files in `folder`.
///
/// # Errors
/// As [`case::parse_manifest`].
pub(super) fn accepted_spec(folder: &Path, manifest: &str) -> Result<CaseSpec, CaseError> {
    let mut spec = case::parse_manifest(manifest, &folder.join("the case's files as accepted"))?;
    // It is no file.
    spec.described_by.clear();
    Ok(spec)
}

/// A case, found but not read.
pub(super) struct Found {
    /// Where it lies.
    pub place: Place,
    /// Its description.
    pub spec: CaseSpec,
    /// What was guessed of its files, where they are described by nothing else.
    pub proposal: Option<Proposal>,
    /// Its files; empty where they were not compared with a session.
    pub files: Vec<FileMark>,
    /// What differs from what the session was saved with.
    pub findings: Vec<Check>,
}

impl Found {
    /// The case at `place` as described, whose files are not looked at.
    pub(super) fn described(place: Place, spec: CaseSpec) -> Self {
        Self { place, spec, proposal: None, files: Vec::new(), findings: Vec::new() }
    }

    /// The case at `place`, whose files are not looked at.
    pub(super) fn unchecked(
        place: Place,
        options: &LoadOptions,
        progress: &Progress,
    ) -> Result<Self, AppError> {
        let (mut spec, proposal) = match description_of(&place.case, options, progress)? {
            Description::Stated(spec) => (spec, None),
            Description::Proposed(proposal) => (proposal.unasked(!options.order.is_empty())?, Some(proposal)),
        };
        spec.add_tracts(&place.tracts);
        Ok(Self { proposal, ..Self::described(place, spec) })
    }
}

/// The case of a session that was read from a file. Where it lies seen from that file comes first, if the files there have
/// the content that the session was saved with; then where it lay.
///
/// # Errors
/// [`AppError`] where neither place has a case, or where the files beside the session are mostly others: that is another
/// case, perhaps of another patient.
pub(super) fn find(
    session: &Session,
    origin: &Origin,
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Found, AppError> {
    let folder = origin.path.parent().unwrap_or(Path::new(""));
    let saved = &origin.files;
    let same = |found: &Found| {
        saved.iter().filter(|mark| found.files.iter().any(|file| file.same_content(mark))).count()
    };
    let own = Place::of(&session.document).seen_from(folder);
    let beside = origin.relative.as_ref().map(|place| place.seen_from(folder)).filter(|place| *place != own);
    let beside = beside.and_then(|place| at_place(place, options, progress).ok());
    // Nothing is changed at either place, most often; then the one beside the session is that which moved with it.
    let whole = |found: &Found| !saved.is_empty() && same(found) == saved.len();
    let mut found = match beside {
        Some(found) if whole(&found) => found,
        beside => nearest(at_place(own, options, progress), beside, origin, &same)?,
    };
    let finding = difference(&found, origin, same(&found));
    found.findings.extend(finding);
    Ok(found)
}

/// The place with more of the files that the session was saved with; on ties its `own`, where it lay. Beside the session,
/// half of them must be there.
fn nearest(
    own: Result<Found, AppError>,
    beside: Option<Found>,
    origin: &Origin,
    same: &dyn Fn(&Found) -> usize,
) -> Result<Found, AppError> {
    let of = origin.files.len();
    let Some(beside) = beside else { return own };
    let here = same(&beside);
    match own {
        Ok(mut own) if here <= same(&own) || 2 * here < of => {
            let opened = own.spec.inputs().paths().first().map(|file| file.display().to_string());
            let text = format!(
                "{}: found the case beside it changed ({here} of {of} files are as saved), expected all; the one it was \
                 saved with is opened instead ({})",
                origin.path.display(),
                opened.unwrap_or_else(|| own.spec.name.clone())
            );
            own.findings.push(Check::warning("session-place", text));
            Ok(own)
        }
        Err(gone) if of == 0 || 2 * here < of => {
            let found = format!(
                "a case of other files beside it ({here} of {of} are the same), and none where its own was ({gone})"
            );
            Err(AppError::file(&origin.path, found, "the case that the session was saved with"))
        }
        Ok(_) | Err(_) => Ok(beside),
    }
}

fn at_place(place: Place, options: &LoadOptions, progress: &Progress) -> Result<Found, AppError> {
    let found = Found::unchecked(place, options, progress)?;
    let files = marks(&found.spec, progress)?;
    Ok(Found { files, ..found })
}

/// Marks of all files of a case: images, masks, tracts and the manifest.
///
/// # Errors
/// [`FileError`] where one can't be read.
pub(super) fn marks(spec: &CaseSpec, progress: &Progress) -> Result<Vec<FileMark>, FileError> {
    progress.say("comparing files");
    FileMark::of_all(spec.inputs().paths(), progress)
}

/// What differs between the files of the case and those that the session was saved with.
fn difference(found: &Found, origin: &Origin, same: usize) -> Option<Check> {
    let session = origin.path.display();
    let saved = &origin.files;
    if saved.is_empty() {
        // A session of the sample has no files.
        return (!found.files.is_empty()).then(|| {
            let text = format!(
                "{session}: found no record of the files it was saved with, expected one; whether {} is that case \
                 can't be checked",
                found.spec.name
            );
            Check::warning("session-unchecked", text)
        });
    }
    let names = |marks: Vec<&FileMark>| {
        let names: Vec<String> = marks.iter().map(|mark| mark.file.display().to_string()).collect();
        listed(&names, MOST_NAMED)
    };
    let lacks = |list: &[FileMark], mark: &FileMark| !list.iter().any(|other| other.same_content(mark));
    let gone: Vec<&FileMark> = saved.iter().filter(|mark| lacks(&found.files, mark)).collect();
    let new: Vec<&FileMark> = found.files.iter().filter(|mark| lacks(saved, mark)).collect();
    let mut parts = Vec::new();
    if !gone.is_empty() {
        parts.push(format!("changed or gone since: {}", names(gone)));
    }
    if !new.is_empty() {
        parts.push(format!("changed or new: {}", names(new)));
    }
    let another = if same == 0 { "; this may be another patient" } else { "" };
    let text = format!(
        "{session}: found other files than it was saved with ({}), expected the same{another}",
        parts.join("; ")
    );
    (!parts.is_empty()).then(|| Check::warning("session-files-changed", text))
}
