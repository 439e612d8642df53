//! The cases of a data set: a folder of cases, or a table that names them.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use glioscope_core::files::{absolute, is_misleading, read_head, read_small_text};

use crate::CohortError;

/// Maximum size of a table of cases in bytes.
const MAX_TABLE_BYTES: u64 = 64 << 20;
/// Maximum size of a data set's description in bytes.
const MAX_DESCRIPTION_BYTES: u64 = 1 << 20;
/// Bytes of a file in which a manifest says that it is one.
const HEAD_BYTES: u64 = 1 << 16;
/// Maximum length of a case's name in bytes: it names a folder.
const MAX_LABEL_BYTES: usize = 200;
/// What BIDS puts before a participant's label.
const SUBJECT: &str = "sub-";
/// The file that makes a folder a BIDS data set.
pub(crate) const DESCRIPTION: &str = "dataset_description.json";

/// One case of a cohort.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CohortCase {
    /// Its name within the cohort, which names its folder of results.
    pub label: String,
    /// What is opened: a folder, manifest, archive, image or session; absolute.
    pub path: PathBuf,
    /// Its history for response criteria, where the table names one; absolute.
    pub history: Option<PathBuf>,
}

/// The cases of `input`, sorted by label:
///
/// - a table (`.csv`, `.tsv`) with the columns `case` (or `participant_id`) and `path`, optionally `history`; paths are relative to it,
///   and without a path the case is the folder of its name beside the table;
/// - a folder of manifests (`.toml`): each is a case, named as its file;
/// - a BIDS data set: each `sub-LABEL` is a case; `check_bids`: it must have a valid `dataset_description.json`;
/// - any other folder: each folder in it is a case (BraTS, DICOM studies); hidden ones are none.
///
/// With `chosen` only these, named with or without `sub-`.
///
/// # Errors
/// [`CohortError`]: nothing there, an unreadable table, two cases of one label, a chosen label that no case has.
pub fn find(input: &Path, chosen: &[String], check_bids: bool) -> Result<Vec<CohortCase>, CohortError> {
    let input = absolute(input);
    let metadata = std::fs::metadata(&input)
        .map_err(|e| CohortError::io(&input, &e, "a folder of cases, or a table (.csv, .tsv)"))?;
    let mut cases = if metadata.is_dir() { of_folder(&input, check_bids)? } else { of_table(&input)? };
    cases.sort_by(|a, b| a.label.cmp(&b.label));
    let mut labels = BTreeSet::new();
    for case in &cases {
        // Some file systems don't tell upper from lower case.
        if !labels.insert(case.label.to_lowercase()) {
            return Err(CohortError::at(
                &input,
                format!("two cases {}", case.label),
                "a name of its own for each",
            ));
        }
    }
    if chosen.is_empty() {
        return Ok(cases);
    }
    let is = |case: &CohortCase, label: &str| {
        case.label == label || case.label.strip_prefix(SUBJECT) == Some(label)
    };
    for label in chosen {
        if !cases.iter().any(|case| is(case, label)) {
            let known: Vec<&str> = cases.iter().take(10).map(|case| case.label.as_str()).collect();
            let more = if cases.len() > known.len() { ", …" } else { "" };
            let expected = format!("cases of {}: {}{more}", input.display(), known.join(", "));
            return Err(CohortError::wrong("--participant-label", format!("\"{label}\""), expected));
        }
    }
    cases.retain(|case| chosen.iter().any(|label| is(case, label)));
    Ok(cases)
}

/// Checks that a label can name a folder on every system and mislead no reader.
fn checked_label(label: &str, place: &Path) -> Result<(), CohortError> {
    let is_forbidden =
        |c: char| is_misleading(c) || matches!(c, '/' | '\\' | ':' | '*' | '?' | '"' | '<' | '>' | '|');
    let is_right = !label.is_empty()
        && label.len() <= MAX_LABEL_BYTES
        && !label.starts_with('.')
        && label.trim() == label
        && !label.chars().any(is_forbidden);
    if is_right {
        return Ok(());
    }
    let expected = format!(
        "a name for a folder: up to {MAX_LABEL_BYTES} bytes without / \\ : * ? \" < > |, not starting with a dot"
    );
    let shown: String = label.chars().take(60).collect();
    Err(CohortError::at(place, format!("the case {shown:?}"), expected))
}

fn of_folder(folder: &Path, check_bids: bool) -> Result<Vec<CohortCase>, CohortError> {
    let (mut folders, mut manifests) = (Vec::new(), Vec::new());
    let unreadable = |e: std::io::Error| CohortError::io(folder, &e, "a folder that can be read");
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let Some(name) = path.file_name().and_then(|name| name.to_str()).map(str::to_owned) else {
            return Err(CohortError::at(&path, "a name that is not UTF-8", "one that is"));
        };
        if name.starts_with('.') {
            continue;
        }
        if path.is_dir() {
            folders.push((name, path));
        } else if let Some(stem) = name.strip_suffix(".toml").filter(|_| is_manifest(&path)) {
            manifests.push((stem.to_owned(), path.clone()));
        }
    }
    let subjects: Vec<(String, PathBuf)> =
        folders.iter().filter(|(name, _)| name.starts_with(SUBJECT)).cloned().collect();
    let found = if !manifests.is_empty() {
        manifests
    } else if subjects.is_empty() {
        folders
    } else {
        if check_bids {
            check_description(folder)?;
        }
        subjects
    };
    if found.is_empty() {
        return Err(CohortError::at(
            folder,
            "no folder and no manifest",
            "one folder or manifest for each case, or a table (.csv, .tsv)",
        ));
    }
    let case = |(label, path): (String, PathBuf)| {
        checked_label(&label, &path)?;
        Ok(CohortCase { label, path, history: None })
    };
    found.into_iter().map(case).collect()
}

/// Whether a `.toml` says that it is a case.
fn is_manifest(path: &Path) -> bool {
    let head = read_head(path, HEAD_BYTES).unwrap_or_default();
    String::from_utf8_lossy(&head).lines().any(|line| line.trim_start().starts_with("glioscope"))
}

/// Checks what BIDS requires of every data set.
fn check_description(folder: &Path) -> Result<(), CohortError> {
    let path = folder.join(DESCRIPTION);
    let expected = "a BIDS data set's name and BIDSVersion, or --skip-bids-validation";
    let wrong = |found: &str| CohortError::at(&path, found, expected);
    if !path.exists() {
        return Err(wrong("no such file"));
    }
    let text = read_small_text(&path, MAX_DESCRIPTION_BYTES, "a data set's description")?;
    let value: serde_json::Value =
        serde_json::from_str(&text).map_err(|e| wrong(&format!("no JSON ({e})")))?;
    match ["Name", "BIDSVersion"].into_iter().find(|key| !value[key].is_string()) {
        Some(key) => Err(wrong(&format!("no {key}"))),
        None => Ok(()),
    }
}

fn of_table(path: &Path) -> Result<Vec<CohortCase>, CohortError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let delimiter = match extension.as_str() {
        "csv" => b',',
        "tsv" => b'\t',
        _ => {
            return Err(CohortError::at(
                path,
                "a file of another kind",
                "a folder of cases, or a table (.csv, .tsv)",
            ));
        }
    };
    let text = read_small_text(path, MAX_TABLE_BYTES, "a table of cases")?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut reader =
        csv::ReaderBuilder::new().delimiter(delimiter).trim(csv::Trim::All).from_reader(text.as_bytes());
    let broken =
        |e: csv::Error| CohortError::at(path, e.to_string(), "a table with as many fields in every row");
    let head = reader.headers().map_err(broken)?.clone();
    let column = |names: &[&str]| head.iter().position(|name| names.contains(&name));
    let Some(label_column) = column(&["case", "participant_id"]) else {
        return Err(CohortError::at(
            path,
            "no column \"case\" or \"participant_id\"",
            "one, and a column \"path\"",
        ));
    };
    let [path_column, history_column] = [column(&["path"]), column(&["history"])];
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut cases = Vec::new();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let field = |column: Option<usize>| {
            column.and_then(|column| record.get(column)).filter(|text| !matches!(*text, "" | "n/a"))
        };
        let Some(label) = field(Some(label_column)) else {
            let line = record.position().map_or(0, csv::Position::line);
            return Err(CohortError::at(path, format!("no case in line {line}"), "a name in every row"));
        };
        checked_label(label, path)?;
        cases.push(CohortCase {
            label: label.to_owned(),
            path: folder.join(field(path_column).unwrap_or(label)),
            history: field(history_column).map(|history| folder.join(history)),
        });
    }
    if cases.is_empty() {
        return Err(CohortError::at(path, "no row", "a row for each case"));
    }
    Ok(cases)
}
