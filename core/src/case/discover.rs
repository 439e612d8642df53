//! A case from a path: a manifest, a folder interpreted by its file names, or a single file. Guesses are recorded in
//! the case's notes, which are shown before the case.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use super::{
    CaseError, CaseSpec, LoadOptions, Proposal, ProposedFile, Role, Scheme, bids,
    folder::{self, Listing},
    manifest::{self, folder_name, read_manifest},
    names::{self, Kind, ParsedName},
    order,
    proposal::{LeftOutFor, drop_alike_colors, tell_files_apart},
    select, sessions, study, subject,
};
use crate::{
    Check, Progress,
    check::listed,
    files::{
        self, ReadOptions, Segment, Source, archive, dicom,
        format::{self, volume_stem},
        printable, read_small_text,
    },
    tumor_index::MAX_MASKS,
};

/// Maximum number of distinct values in a label map: BraTS has 5, a whole-brain parcellation hundreds.
const MAX_LABELS: usize = 64;

fn wrong(path: &Path, found: impl Into<String>, expected: &str) -> CaseError {
    CaseError::wrong(printable(&path.display().to_string()), found, expected)
}

/// How a case is described.
#[derive(Clone, Debug, PartialEq)]
pub enum Description {
    /// By a manifest.
    Stated(CaseSpec),
    /// By names and contents of its files.
    Proposed(Proposal),
}

impl Description {
    /// The case where nobody is asked.
    ///
    /// # Errors
    /// As [`Proposal::unasked`].
    pub fn unasked(self, options: &LoadOptions) -> Result<CaseSpec, CaseError> {
        match self {
            Self::Stated(spec) => Ok(spec),
            Self::Proposed(proposal) => proposal.unasked(!options.order.is_empty()),
        }
    }
}

/// The case at `path`: a manifest (`.toml`), a folder with one (`case.toml`, or the only `.toml`
/// that has a `glioscope` key), a folder without, or one image file. Files are opened only where their names are
/// ambiguous.
///
/// # Errors
/// [`CaseError`]: no such path, an invalid manifest, a folder without images or with images of several subjects,
/// an unreadable file; folders that may be patients or dates, where `options` doesn't state their order.
pub fn open_spec(path: &Path, options: &LoadOptions, progress: &Progress) -> Result<CaseSpec, CaseError> {
    describe(path, options, progress)?.unasked(options)
}

/// As [`open_spec`], where what was guessed can be corrected before it is used.
///
/// The folder that a DICOMDIR means: the index of a medium means the medium; what lies there is seen from the files themselves.
/// `None` for other files.
pub fn folder_of_dicomdir(path: &Path) -> Option<&Path> {
    let is_one = path.file_name().is_some_and(|name| name.eq_ignore_ascii_case("DICOMDIR"));
    let folder = path.parent().filter(|_| is_one && path.is_file())?;
    Some(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
}

/// # Errors
/// As [`open_spec`], but where folders may be patients or dates: the proposal says so.
pub fn describe(path: &Path, options: &LoadOptions, progress: &Progress) -> Result<Description, CaseError> {
    let kind = format::volume_names();
    let expected =
        &format!("a case manifest (.toml), a folder or zip archive of {kind} files, or a {kind} file");
    let metadata = std::fs::metadata(path).map_err(|e| files::missing(path, &e, expected))?;
    let manifest = if metadata.is_dir() { manifest_in(path)? } else { None };
    if metadata.is_dir() && manifest.is_none() {
        return Ok(Description::Proposed(guess_folder(path, options, progress)?));
    }
    if !options.derivatives.is_empty() {
        return Err(bids::no_subject(path));
    }
    if let Some(manifest) = manifest {
        return Ok(Description::Stated(read_manifest(&manifest)?));
    }
    let Some(name) = path.file_name().and_then(|name| name.to_str()).map(str::to_owned) else {
        return Err(wrong(path, "a name that is not UTF-8", "one that is"));
    };
    if archive::is_zip(path) {
        return describe_archive(path, &name, options, progress);
    }
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Ok(Description::Stated(read_manifest(path)?));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    if let Some(folder) = folder_of_dicomdir(path) {
        return describe(folder, options, progress);
    }
    if volume_stem(&name).is_none() && dicom::is_dicom(path) {
        // One slice means its series.
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let uid = dicom::series_of(path)?;
        let name = folder_name(path);
        let proposal = study::propose(folder, name, Some(&uid), progress)?;
        return Ok(Description::Proposed(proposal.with_key(true)));
    }
    if volume_stem(&name).is_none() {
        return Err(wrong(path, "a file of another kind", expected));
    }
    let listing = Listing { volumes: vec![PathBuf::from(&name)], ..Listing::default() };
    let mut proposal = guess(folder, (listing, &[]), name, options, progress)?;
    if folder.as_os_str().is_empty() {
        // A bare name: the folder is kept, in sessions and with answers, where another one may be the current folder.
        proposal.folder = std::env::current_dir().unwrap_or_default();
    }
    Ok(Description::Proposed(proposal.with_key(true)))
}

/// The case in a zip archive, described as a folder with its files.
fn describe_archive(
    path: &Path,
    name: &str,
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Description, CaseError> {
    let folder = archive::unpacked(path, options.max_bytes, progress)?;
    match describe(&folder, options, progress) {
        Ok(Description::Stated(mut spec)) => {
            spec.described_by.push(path.to_owned());
            Ok(Description::Stated(spec))
        }
        Ok(Description::Proposed(mut proposal)) => {
            proposal.name = name.strip_suffix(".zip").unwrap_or(name).to_owned();
            proposal.described_by.push(path.to_owned());
            proposal.archive = Some(path.to_owned());
            Ok(Description::Proposed(proposal.with_key(true)))
        }
        // The folder's own name says nothing to anybody.
        Err(CaseError::Wrong { case, found, expected }) => {
            let inside = printable(&folder.display().to_string());
            let case = case.replace(&inside, &printable(&path.display().to_string()));
            Err(CaseError::Wrong { case, found, expected })
        }
        Err(other) => Err(other),
    }
}

/// Some files and folders as one case, fibre tracts among them; at least one path.
///
/// # Errors
/// As [`describe`].
pub fn describe_files(
    paths: &[PathBuf],
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Proposal, CaseError> {
    let all: Vec<PathBuf> = paths.iter().map(|path| files::absolute(path)).collect();
    let parent = |path: &Path| path.parent().map(Path::to_owned).unwrap_or_default();
    let mut folder = all.first().map(|path| parent(path)).unwrap_or_default();
    while !all.iter().all(|path| path.starts_with(&folder)) && folder.pop() {}
    let relative: Vec<PathBuf> =
        all.iter().map(|path| path.strip_prefix(&folder).unwrap_or(path).to_owned()).collect();
    let listing = folder::list_files(&folder, &relative, progress)?;
    let mut proposal = guess_listed(&folder, listing, options, progress)?;
    for file in proposal.files.iter_mut().filter(|file| file.left_out_for == LeftOutFor::Tracts) {
        file.role = Role::Tracts;
    }
    Ok(proposal.with_key(false))
}

/// Whether a folder has a manifest, so that it needn't be guessed what its files are.
pub fn has_manifest(folder: &Path) -> bool {
    folder.is_dir() && !matches!(manifest_in(folder), Ok(None))
}

/// The manifest of a folder, if it has one.
fn manifest_in(folder: &Path) -> Result<Option<PathBuf>, CaseError> {
    let usual = folder.join("case.toml");
    // Also a broken link: reading says what it is.
    if usual.symlink_metadata().is_ok() {
        return Ok(Some(usual));
    }
    let mut found = Vec::new();
    for entry in folder::entries(folder)? {
        if entry.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
            && read_small_text(&entry, manifest::MAX_BYTES, "a manifest")
                .is_ok_and(|t| t.lines().any(|l| l.trim_start().starts_with("glioscope")))
        {
            found.push(entry);
        }
    }
    match found.len() {
        0 | 1 => Ok(found.pop()),
        n => Err(wrong(folder, format!("{n} manifests"), "one, or one named case.toml")),
    }
}

fn guess_folder(folder: &Path, options: &LoadOptions, progress: &Progress) -> Result<Proposal, CaseError> {
    let listing = folder::list(folder, progress)?;
    let others = bids::partners(folder, &listing, &options.derivatives)?;
    let mut proposal = if others.is_empty() || listing.volumes.is_empty() {
        guess_listed(folder, listing, options, progress)?
    } else {
        let (root, listing, places) = others.join(folder, listing, progress)?;
        let name = folder_name(&folder.join("x"));
        guess(&root, (listing, &places), name, options, progress)?
    };
    sessions::order_by_sessions(folder, &mut proposal);
    for raw in others.raw() {
        if proposal.order.is_empty() {
            sessions::order_by_sessions(raw, &mut proposal);
        }
    }
    proposal.notes.extend(others.notes);
    Ok(proposal.with_key(true))
}

fn guess_listed(
    folder: &Path,
    listing: Listing,
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Proposal, CaseError> {
    if listing.volumes.is_empty() && !listing.dicom.is_empty() {
        let name = folder_name(&folder.join("x"));
        let mut proposal = study::propose(folder, name, None, progress)?;
        add_tracts(&mut proposal, folder, &listing.tracts);
        return Ok(proposal);
    }
    if listing.volumes.is_empty() && listing.has_deeper {
        // Studies nest deeper than research folders.
        let name = folder_name(&folder.join("x"));
        if let Ok(proposal) = study::propose(folder, name, None, progress) {
            return Ok(proposal);
        }
    }
    if listing.volumes.is_empty() {
        let kind = format::volume_names();
        let others = listing.left_out.into_iter().map(|check| format!("; {}", check.message));
        let tracts: Vec<String> = listing.tracts.iter().map(|path| path.display().to_string()).collect();
        let tracts = (!tracts.is_empty())
            .then(|| format!("; {}: found fibre tracts", listed(&tracts, folder::MAX_LISTED)));
        let others: Vec<String> = others.chain(tracts).collect();
        let found = format!("no {kind} file ({}){}", format::volume_endings(), others.concat());
        return Err(wrong(folder, found, &format!("a case.toml or {kind} files")));
    }
    let name = folder_name(&folder.join("x"));
    guess(folder, (listing, &[]), name, options, progress)
}

/// A file to be added to the case.
struct Entry {
    path: PathBuf,
    /// Its path within the folder from which on names tell of the case.
    named_path: PathBuf,
    /// Put before the id of a mask.
    set: Option<String>,
    named: ParsedName,
    is_mask: bool,
    by_content: bool,
    /// Distinct values, where the file was read and looks like a label map.
    labels: Option<Vec<i64>>,
    /// The masks that the file names.
    segments: Vec<Segment>,
    id: String,
}

/// Distinct values of a file that looks like a label map: few, all integers, and not a single non-zero one.
fn label_values(
    path: &Path,
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Option<Vec<i64>>, CaseError> {
    let read = ReadOptions { max_bytes: options.max_bytes, ..ReadOptions::default() };
    let loaded = files::read(&Source::File(path.to_path_buf()), &read, progress)?;
    let values = select::label_map_values(&loaded.volume, MAX_LABELS);
    Ok(values.filter(|v| v.len() > 1 || v == &[0]))
}

/// Assigns ids, unique within each kind and time: from the name's parts, else the whole name, else the path.
fn assign_ids(entries: &mut [Entry]) {
    for e in entries.iter_mut() {
        let id = names::id(&e.named, e.is_mask);
        e.id = e.set.iter().filter(|_| e.is_mask).map(|set| format!("{set}-")).chain([id]).collect();
    }
    let clashes = |entries: &[Entry]| -> Vec<usize> {
        let same =
            |a: &Entry, b: &Entry| a.is_mask == b.is_mask && a.named.time == b.named.time && a.id == b.id;
        (0..entries.len())
            .filter(|&n| entries.iter().enumerate().any(|(m, other)| m != n && same(&entries[n], other)))
            .collect()
    };
    for n in clashes(entries) {
        entries[n].id = entries[n].named.stem.clone();
    }
    for n in clashes(entries) {
        entries[n].id = entries[n].path.display().to_string();
    }
}

/// Times as they were assigned.
struct Times {
    /// Files without a time where others have one.
    timeless: Vec<Entry>,
    /// Why they may not be times.
    doubt: Option<String>,
}

/// Assigns times from the names. A single time label is ignored; files without a time are left out where others have
/// one. Where no name has a time and ids clash, the top-level folders' names are the times; where these don't state an
/// order in time, they may be patients.
fn assign_times(entries: &mut Vec<Entry>, notes: &mut Vec<Check>) -> Times {
    let mut doubt = None;
    if entries.iter().all(|e| e.named.time.is_none()) {
        let top = |e: &Entry| {
            let mut parts = e.named_path.iter().filter_map(|p| p.to_str());
            parts.next().filter(|_| e.named_path.components().count() > 1).map(str::to_owned)
        };
        let folders: Option<Vec<String>> = entries.iter().map(top).collect();
        let ids: Vec<(bool, String)> =
            entries.iter().map(|e| (e.is_mask, names::id(&e.named, e.is_mask))).collect();
        let clash = (0..ids.len()).any(|n| ids[..n].contains(&ids[n]));
        if let (Some(folders), true) = (folders, clash) {
            let distinct: BTreeSet<&String> = folders.iter().collect();
            let distinct: Vec<&str> = distinct.into_iter().map(String::as_str).collect();
            doubt = (!order::is_stated_by(&distinct)).then(|| {
                format!("the same files in {}, which may be patients or dates", distinct.join(", "))
            });
            for (e, folder) in entries.iter_mut().zip(folders) {
                e.named.time = Some(folder);
            }
        }
    }
    let mut labels: Vec<String> = entries.iter().filter_map(|e| e.named.time.clone()).collect();
    labels.sort();
    labels.dedup();
    if labels.len() < 2 {
        entries.iter_mut().for_each(|e| e.named.time = None);
        return Times { timeless: Vec::new(), doubt };
    }
    let (timed, timeless) = std::mem::take(entries).into_iter().partition(|e| e.named.time.is_some());
    *entries = timed;
    notes.push(Check::note("guessed-times", format!("times: guessed from names: {}", labels.join(", "))));
    Times { timeless, doubt }
}

/// Where each time has at most one mask file, a label map, each of its labels becomes a mask. Returns the labels of all
/// times together; `None` where this doesn't apply.
fn labels_as_masks(
    folder: &Path,
    entries: &mut [Entry],
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Option<Vec<i64>>, CaseError> {
    let times: Vec<_> = entries.iter().filter(|e| e.is_mask).map(|e| e.named.time.clone()).collect();
    if entries.iter().any(|e| !e.segments.is_empty()) {
        return Ok(None);
    }
    if times.is_empty() || (0..times.len()).any(|n| times[..n].contains(&times[n])) {
        return Ok(None);
    }
    let mut all = Vec::new();
    for e in entries.iter_mut().filter(|e| e.is_mask) {
        if !e.by_content {
            e.labels = label_values(&folder.join(&e.path), options, progress)?;
        }
        all.extend(e.labels.iter().flatten().copied().filter(|&l| l != 0));
    }
    all.sort_unstable();
    all.dedup();
    Ok((2..=MAX_MASKS).contains(&all.len()).then_some(all))
}

fn list<'a>(ids: impl Iterator<Item = &'a Entry>) -> Option<String> {
    let mut unique: Vec<&str> = Vec::new();
    for e in ids {
        if !unique.contains(&e.id.as_str()) {
            unique.push(&e.id);
        }
    }
    (!unique.is_empty()).then(|| unique.join(", "))
}

fn note_kinds(entries: &[Entry], notes: &mut Vec<Check>) {
    let mut note = |is_mask: bool, by_content: bool, text: &str| {
        if let Some(ids) = list(entries.iter().filter(|e| e.is_mask == is_mask && e.by_content == by_content))
        {
            let kind = if is_mask { "masks" } else { "images" };
            notes.push(Check::note("guessed-kinds", format!("{kind}: guessed {text}: {ids}")));
        }
    };
    note(false, false, "from names");
    note(false, true, "from contents (values of an image, not of labels)");
    note(true, false, "from names");
    note(true, true, "from contents (few values, all whole numbers)");
}

/// Makes each of the labels of all label maps a mask. Where dates number tissues differently, each group of their schemes is
/// one instead, so that no label is compared with another tissue's.
fn divide(files: &mut [ProposedFile], labels: &[i64], notes: &mut Vec<Check>) {
    let mut maps: Vec<&mut ProposedFile> = files.iter_mut().filter(|file| file.role == Role::Mask).collect();
    let schemes: Vec<Option<&Scheme>> = maps.iter().map(|file| file.scheme.as_ref()).collect();
    let mut names: Vec<&str> = schemes.iter().flatten().map(|scheme| scheme.name.as_str()).collect();
    names.dedup();
    let meanings = |scheme: &Scheme| -> Vec<Option<String>> {
        labels.iter().map(|label| Some(scheme.label(*label)?.name.clone())).collect()
    };
    let differ = schemes.iter().flatten().any(|scheme| Some(meanings(scheme)) != schemes[0].map(meanings));
    let is_grouped =
        differ && schemes.iter().all(|scheme| scheme.is_some_and(|scheme| !scheme.groups.is_empty()));
    if differ {
        let instead = if is_grouped {
            "whole tumour, core and enhancing tumour are masks instead"
        } else {
            "a label isn't the same tissue at every date"
        };
        let known = if schemes.contains(&None) { "some as in" } else { "as in" };
        let text = format!(
            "label maps: found labels {known} {}, expected the same at every date; {instead}",
            names.join(" and ")
        );
        notes.push(Check::warning("label-schemes-differ", text));
    }
    let text = if is_grouped {
        format!("masks: guessed the groups of {}", names.join(" and "))
    } else {
        let words: Vec<String> = labels.iter().map(i64::to_string).collect();
        let meaning = match names.as_slice() {
            [one] if !differ && schemes.iter().all(Option::is_some) => format!("named as in {one}"),
            _ => "what they mean is unknown".into(),
        };
        format!("masks: guessed one for each label of the label map: {}; {meaning}", words.join(", "))
    };
    for file in &mut maps {
        if is_grouped {
            file.group();
            continue;
        }
        // Every date has a mask of each label, whether its map has it or not.
        let own = std::mem::replace(&mut file.labels, labels.to_vec());
        file.split();
        file.labels = own;
    }
    notes.push(Check::note("guessed-labels", text));
}

/// `places`: where names are read from, in files of several data sets.
fn guess(
    folder: &Path,
    (listing, places): (Listing, &[bids::Place]),
    name: String,
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Proposal, CaseError> {
    let mut named: Vec<ParsedName> = Vec::new();
    let mut paths = Vec::new();
    let (mut named_paths, mut sets) = (Vec::new(), Vec::new());
    for path in listing.volumes {
        let place =
            places.iter().find_map(|place| Some((path.strip_prefix(&place.folder).ok()?, &place.set)));
        let (within, set) = place.unwrap_or((&path, &None));
        if let Some(n) = names::parse_name(within) {
            named.push(n);
            named_paths.push(within.to_owned());
            sets.push(set.clone());
            paths.push(path);
        }
    }
    let subjects = subject::subjects(&named_paths, &named);
    if subjects.len() > 1 {
        return Err(wrong(
            folder,
            format!("files of {} patients ({})", subjects.len(), listed(&subjects, 3)),
            "the folder of one, or its files named one by one or in a case.toml",
        ));
    }
    names::drop_common_start(&mut named);

    let mut entries = Vec::new();
    for (((path, named), named_path), set) in paths.into_iter().zip(named).zip(named_paths).zip(sets) {
        let (mut is_mask, mut labels) = (named.kind == Kind::Mask, None);
        // A file that can't be read says so when the case is.
        let segments = files::segments(&Source::File(folder.join(&path)), progress).unwrap_or_default();
        let by_content = named.kind == Kind::Unknown && segments.is_empty();
        is_mask |= !segments.is_empty();
        if by_content {
            labels = label_values(&folder.join(&path), options, progress)?;
            is_mask = labels.is_some();
        }
        let id = String::new();
        entries.push(Entry { path, named_path, set, named, is_mask, by_content, labels, segments, id });
    }
    let mut notes = Vec::new();
    let Times { timeless, doubt } = assign_times(&mut entries, &mut notes);
    assign_ids(&mut entries);
    note_kinds(&entries, &mut notes);
    let split = labels_as_masks(folder, &mut entries, options, progress)?;
    let has_masks = entries.iter().any(|e| e.is_mask);
    let mut files: Vec<ProposedFile> = entries.into_iter().map(|e| proposed(folder, e)).collect();
    for file in &mut files {
        let relative = file.path.strip_prefix(folder).unwrap_or(&file.path).to_owned();
        let table = Scheme::beside(folder, &listing.tables, &relative).unwrap_or_else(|why| {
            let check = Check::warning("label-table-unused", format!("{why}; labels have no names of it"));
            if file.role == Role::Mask && !notes.contains(&check) {
                notes.push(check);
            }
            None
        });
        file.find_scheme(table.as_ref());
        if let (Some(table), None, Role::Mask) = (&table, &file.scheme, file.role)
            && !file.labels.is_empty()
        {
            let labels: Vec<String> = file.labels.iter().map(i64::to_string).collect();
            notes.push(Check::warning(
                "label-table-unused",
                format!(
                    "{}: names not every label of {} ({}); labels have no names of it",
                    table.name,
                    printable(&relative.display().to_string()),
                    labels.join(", ")
                ),
            ));
        }
    }
    tell_files_apart(&mut files);
    drop_alike_colors(&mut files);
    if let Some(labels) = &split {
        divide(&mut files, labels, &mut notes);
    } else if files.iter().any(|file| file.masks.iter().any(|mask| mask.segment.is_some())) {
        notes.push(Check::note("guessed-labels", "masks: one for each segment that a file names"));
    } else if has_masks {
        notes.push(Check::note(
            "guessed-labels",
            "masks: guessed that every voxel above 0.5 is active, whatever its label",
        ));
    }
    files.extend(timeless.into_iter().map(|mut e| {
        e.id = names::id(&e.named, e.is_mask);
        let file = proposed(folder, e);
        let reason = "no date in its name, while others have one".into();
        ProposedFile { role: Role::LeftOut, reason, left_out_for: LeftOutFor::NoTime, ..file }
    }));
    notes.extend(listing.left_out);
    if !listing.dicom.is_empty() {
        let names: Vec<String> =
            listing.dicom.iter().map(|path| printable(&path.display().to_string())).collect();
        let text =
            format!("{}: found DICOM beside other images; left out", listed(&names, folder::MAX_LISTED));
        notes.push(Check::warning("left-out", text));
    }
    let mut proposal = Proposal::new(name, folder, files, notes, doubt);
    add_tracts(&mut proposal, folder, &listing.tracts);
    Ok(proposal)
}

/// Adds fibre tracts, which are read where the user says so.
fn add_tracts(proposal: &mut Proposal, folder: &Path, paths: &[PathBuf]) {
    let mut tracts = CaseSpec::default();
    let of_folder: Vec<PathBuf> = paths.iter().map(|path| folder.join(path)).collect();
    tracts.add_tracts(&of_folder);
    proposal.files.extend(of_folder.into_iter().zip(tracts.tracts).map(|(path, tracts)| {
        let file = ProposedFile::new(path, Role::LeftOut, tracts.id, String::new());
        let reason = "fibre tracts are read where you say so".into();
        ProposedFile { reason, left_out_for: LeftOutFor::Tracts, ..file }
    }));
}

fn proposed(folder: &Path, entry: Entry) -> ProposedFile {
    let role = if entry.is_mask { Role::Mask } else { Role::Image };
    let time = entry.named.time.unwrap_or_default();
    let mut file = ProposedFile::new(folder.join(entry.path), role, entry.id, time);
    if !entry.segments.is_empty() {
        file.set_segments(&entry.segments);
        file.reason = "by its content: it names its segments".into();
        return file;
    }
    file.labels = entry.labels.unwrap_or_default().into_iter().filter(|label| *label != 0).collect();
    file.reason = match (entry.by_content, entry.is_mask) {
        (false, _) => "by its name",
        (true, true) => "by its content: few values, all whole numbers",
        (true, false) => "by its content: values of an image, not of labels",
    }
    .into();
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(stem: &str, time: &str, labels: &[i64]) -> ProposedFile {
        let path = PathBuf::from(format!("{stem}.nii.gz"));
        let mut file = ProposedFile::new(path, Role::Mask, "seg".into(), time.into());
        file.labels = labels.to_vec();
        file.find_scheme(None);
        file
    }

    fn ids(file: &ProposedFile) -> Vec<String> {
        file.masks.iter().map(|mask| format!("{}={}", mask.id, mask.labels)).collect()
    }

    #[test]
    fn dates_that_number_tissues_differently_are_compared_by_tissue() {
        let mut notes = Vec::new();
        // Label 4 is the enhancing tumour at first, the resection cavity then.
        let mut files =
            [map("BraTS2021_00002_seg", "a", &[1, 2, 4]), map("BraTS-GLI-00002-000-seg", "b", &[1, 2, 3, 4])];
        divide(&mut files, &[1, 2, 3, 4], &mut notes);
        assert_eq!(ids(&files[0]), ["seg-WT=1, 2, 4", "seg-TC=1, 4", "seg-ET=4"]);
        assert_eq!(ids(&files[1]), ["seg-WT=1, 2, 3", "seg-TC=1, 3", "seg-ET=3"]);
        assert_eq!(notes[0].code, "label-schemes-differ");

        // A date of which nothing is known can't be grouped.
        let mut notes = Vec::new();
        let mut files = [map("BraTS2021_00002_seg", "a", &[1, 2, 4]), map("seg", "b", &[1, 2, 4])];
        divide(&mut files, &[1, 2, 4], &mut notes);
        assert_eq!(ids(&files[1]), ["seg-1=1", "seg-2=2", "seg-4=4"]);
        assert!(notes[0].message.ends_with("what they mean is unknown"), "{}", notes[0].message);

        let mut notes = Vec::new();
        let mut files =
            [map("BraTS2021_00002_seg", "a", &[1, 2]), map("BraTS2021_00002_b_seg", "b", &[1, 4])];
        divide(&mut files, &[1, 2, 4], &mut notes);
        assert_eq!(
            (notes.len(), ids(&files[1])),
            (1, ["seg-1=1", "seg-2=2", "seg-4=4"].map(str::to_owned).to_vec())
        );
        assert!(notes[0].message.ends_with("named as in BraTS 2021"), "{}", notes[0].message);
        assert_eq!(files[0].labels, [1, 2], "its own are kept");
    }
}
