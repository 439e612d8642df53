//! A case from a path: a manifest, a folder interpreted by its file names, or a single file. Guesses are recorded in
//! the case's notes, which are shown before the case.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use jiff::civil::DateTime;

use super::{
    CaseError, CaseSpec, ContextSpec, LoadOptions, MaskSpec,
    manifest::{folder_name, read_manifest},
    names::{self, Kind, ParsedName},
    select,
};
use crate::{
    Check, Progress,
    files::{
        self, ReadOptions, Source,
        format::{self, volume_stem},
    },
    tumor_index::MAX_MASKS,
};

/// Maximum number of distinct values in a label map: BraTS has 5, a whole-brain parcellation hundreds.
const MAX_LABELS: usize = 64;

/// Depth of subfolders searched below the opened one: BIDS has sub-, ses- and anat.
const MAX_DEPTH: usize = 4;

/// Maximum number of files and folders visited.
const MAX_ENTRIES: usize = 10_000;

fn wrong(path: &Path, found: impl Into<String>, expected: &str) -> CaseError {
    CaseError::wrong(path.display().to_string(), found, expected)
}

/// The case at `path`: a manifest (`.toml`), a folder with one (`case.toml`, or the only `.toml`
/// that has a `glioscope` key), a folder without, or one image file. Files are opened only where their names are
/// ambiguous.
///
/// # Errors
/// [`CaseError`]: no such path, an invalid manifest, a folder without images or with images of several subjects,
/// an unreadable file.
pub fn open_spec(path: &Path, options: &LoadOptions, progress: &Progress) -> Result<CaseSpec, CaseError> {
    let kind = format::volume_names();
    let expected = &format!("a case manifest (.toml), a folder of {kind} files, or a {kind} file");
    let metadata = std::fs::metadata(path).map_err(|e| wrong(path, e.to_string(), expected))?;
    if metadata.is_dir() {
        return match manifest_in(path)? {
            Some(manifest) => read_manifest(&manifest),
            None => guess_folder(path, options, progress),
        };
    }
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return read_manifest(path);
    }
    if volume_stem(&name).is_none() {
        return Err(wrong(path, "a file of another kind", expected));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    guess(folder, vec![PathBuf::from(&name)], name, options, progress)
}

/// The manifest that [`open_spec`] reads for `path`; `None` without one.
pub fn manifest_of(path: &Path) -> Option<PathBuf> {
    if path.is_dir() {
        return manifest_in(path).ok().flatten();
    }
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")).then(|| path.to_owned())
}

/// The manifest of a folder, if it has one.
fn manifest_in(folder: &Path) -> Result<Option<PathBuf>, CaseError> {
    let usual = folder.join("case.toml");
    if usual.is_file() {
        return Ok(Some(usual));
    }
    let mut found = Vec::new();
    for entry in read_folder(folder)? {
        let small = entry.metadata().is_ok_and(|m| m.is_file() && m.len() < 1 << 20);
        if small
            && entry.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
            && std::fs::read_to_string(&entry)
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

fn read_folder(folder: &Path) -> Result<Vec<PathBuf>, CaseError> {
    let fail = |e: std::io::Error| wrong(folder, e.to_string(), "a folder that can be read");
    let entries = std::fs::read_dir(folder).map_err(fail)?;
    let mut paths = entries.map(|e| Ok(e.map_err(fail)?.path())).collect::<Result<Vec<_>, CaseError>>()?;
    paths.sort();
    Ok(paths)
}

/// Images and masks below `folder`, relative to it, sorted by path. Hidden entries and symbolic links to folders are
/// skipped.
fn volume_files(folder: &Path, progress: &Progress) -> Result<Vec<PathBuf>, CaseError> {
    let mut found = Vec::new();
    let mut visited = 0;
    let mut pending = vec![(folder.to_path_buf(), 0)];
    while let Some((current, depth)) = pending.pop() {
        progress.check()?;
        for path in read_folder(&current)? {
            visited += 1;
            if visited > MAX_ENTRIES {
                let text = format!("more than {MAX_ENTRIES} files and folders");
                return Err(wrong(folder, text, "the folder of one case"));
            }
            let Some(name) = path.file_name().and_then(|n| n.to_str()).filter(|n| !n.starts_with('.')) else {
                continue;
            };
            if path.is_dir() {
                if depth < MAX_DEPTH && !path.is_symlink() {
                    pending.push((path, depth + 1));
                }
            } else if volume_stem(name).is_some() {
                found.extend(path.strip_prefix(folder).map(Path::to_path_buf));
            }
        }
    }
    found.sort();
    Ok(found)
}

fn guess_folder(folder: &Path, options: &LoadOptions, progress: &Progress) -> Result<CaseSpec, CaseError> {
    let files = volume_files(folder, progress)?;
    if files.is_empty() {
        let kind = format::volume_names();
        let found = format!("no {kind} file ({})", format::volume_endings());
        return Err(wrong(folder, found, &format!("a case.toml or {kind} files")));
    }
    let name = folder_name(&folder.join("x"));
    let mut spec = guess(folder, files, name, options, progress)?;
    order_by_sessions(folder, &mut spec);
    Ok(spec)
}

/// Sets the order of the time points by the acquisition times in a BIDS `sessions.tsv`, in `folder` or in the folder of
/// its subject, if it lists every time point.
fn order_by_sessions(folder: &Path, spec: &mut CaseSpec) {
    let is_sessions = |path: &PathBuf| {
        path.file_name().is_some_and(|name| name.to_string_lossy().ends_with("sessions.tsv"))
            && path.metadata().is_ok_and(|m| m.is_file() && m.len() < 1 << 20)
    };
    let subjects = read_folder(folder).unwrap_or_default().into_iter().filter(|path| path.is_dir());
    let folders = std::iter::once(folder.to_path_buf()).chain(subjects);
    let mut tables = folders.flat_map(|f| read_folder(&f).unwrap_or_default()).filter(is_sessions);
    let Some((file, order)) = tables.find_map(|file| Some((file.clone(), sessions(&file)?))) else { return };
    let images = spec.contexts.iter().filter_map(|c| c.time.clone());
    let times: BTreeSet<String> = spec.masks.iter().filter_map(|m| m.time.clone()).chain(images).collect();
    let order: Vec<String> = order.into_iter().filter(|label| times.contains(label)).collect();
    if order.len() == times.len() && order.len() > 1 {
        let text = format!("times: in the order of {}: {}", file.display(), order.join(", "));
        spec.notes.push(Check::note("time-order-sessions", text));
        spec.order = order;
    }
}

/// The sessions of a BIDS `sessions.tsv`, without `ses-`, by acquisition time; `None` unless each has a different one.
fn sessions(file: &Path) -> Option<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new().delimiter(b'\t').from_path(file).ok()?;
    let columns = reader.headers().ok()?.clone();
    let column = |name: &str| columns.iter().position(|c| c == name);
    let (id, time) = (column("session_id")?, column("acq_time")?);
    let mut found: Vec<(DateTime, String)> = Vec::new();
    for row in reader.records() {
        let row = row.ok()?;
        let time = row.get(time)?.trim_end_matches('Z').parse().ok()?;
        found.push((time, row.get(id)?.trim_start_matches("ses-").to_owned()));
    }
    found.sort();
    let differ = found.windows(2).all(|pair| pair[0].0 < pair[1].0);
    differ.then(|| found.into_iter().map(|(_, id)| id).collect())
}

/// A file to be added to the case.
struct Entry {
    path: PathBuf,
    named: ParsedName,
    is_mask: bool,
    by_content: bool,
    /// Distinct values, where the file was read and looks like a label map.
    labels: Option<Vec<i64>>,
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
        e.id = names::id(&e.named, e.is_mask);
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

/// Assigns times from the names. A single time label is ignored; files without a time are left out where others have
/// one. Where no name has a time and ids clash, the top-level folders' names are the times.
fn assign_times(entries: &mut Vec<Entry>, notes: &mut Vec<Check>) {
    if entries.iter().all(|e| e.named.time.is_none()) {
        let top = |e: &Entry| {
            let mut parts = e.path.iter().filter_map(|p| p.to_str());
            parts.next().filter(|_| e.path.components().count() > 1).map(str::to_owned)
        };
        let folders: Option<Vec<String>> = entries.iter().map(top).collect();
        let ids: Vec<(bool, String)> =
            entries.iter().map(|e| (e.is_mask, names::id(&e.named, e.is_mask))).collect();
        let clash = (0..ids.len()).any(|n| ids[..n].contains(&ids[n]));
        if let (Some(folders), true) = (folders, clash) {
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
        return;
    }
    let timeless: Vec<String> =
        entries.iter().filter(|e| e.named.time.is_none()).map(|e| e.named.stem.clone()).collect();
    entries.retain(|e| e.named.time.is_some());
    notes.push(Check::note("guessed-times", format!("times: guessed from names: {}", labels.join(", "))));
    if !timeless.is_empty() {
        let text =
            format!("{}: found no time in the name while others have one; left out", timeless.join(", "));
        notes.push(Check::warning("guess-left-out", text));
    }
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

fn guess(
    folder: &Path,
    files: Vec<PathBuf>,
    name: String,
    options: &LoadOptions,
    progress: &Progress,
) -> Result<CaseSpec, CaseError> {
    let mut named: Vec<ParsedName> = Vec::new();
    let mut paths = Vec::new();
    for path in files {
        if let Some(n) = names::parse_name(&path) {
            named.push(n);
            paths.push(path);
        }
    }
    let mut subjects: Vec<&String> = named.iter().filter_map(|n| n.subject.as_ref()).collect();
    subjects.sort();
    subjects.dedup();
    if subjects.len() > 1 {
        return Err(wrong(folder, format!("files of {} subjects", subjects.len()), "the folder of one"));
    }
    names::drop_common_start(&mut named);

    let mut entries = Vec::new();
    for (path, named) in paths.into_iter().zip(named) {
        let (mut is_mask, mut labels) = (named.kind == Kind::Mask, None);
        let by_content = named.kind == Kind::Unknown;
        if by_content {
            labels = label_values(&folder.join(&path), options, progress)?;
            is_mask = labels.is_some();
        }
        entries.push(Entry { path, named, is_mask, by_content, labels, id: String::new() });
    }
    let mut spec = CaseSpec { name, ..CaseSpec::default() };
    assign_times(&mut entries, &mut spec.notes);
    assign_ids(&mut entries);
    note_kinds(&entries, &mut spec.notes);
    let split = labels_as_masks(folder, &mut entries, options, progress)?;
    if let Some(labels) = &split {
        let words: Vec<String> = labels.iter().map(i64::to_string).collect();
        spec.notes.push(Check::note(
            "guessed-labels",
            format!(
                "masks: guessed one for each label of the label map: {}; what they mean is unknown",
                words.join(", ")
            ),
        ));
    } else if entries.iter().any(|e| e.is_mask) {
        spec.notes.push(Check::note(
            "guessed-labels",
            "masks: guessed that every voxel above 0.5 is active, whatever its label",
        ));
    }
    for e in entries {
        let (source, time) = (Source::File(folder.join(&e.path)), e.named.time);
        if !e.is_mask {
            spec.contexts.push(ContextSpec { id: e.id, source, time });
            continue;
        }
        let parts: Vec<(String, Option<Vec<i64>>)> = match &split {
            Some(labels) => labels.iter().map(|l| (format!("{}-{l}", e.id), Some(vec![*l]))).collect(),
            None => vec![(e.id, None)],
        };
        for (id, labels) in parts {
            spec.masks.push(MaskSpec { id, source: source.clone(), labels, time: time.clone(), color: None });
        }
    }
    Ok(spec)
}
