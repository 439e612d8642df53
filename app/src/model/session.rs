//! The session file: a [`Document`] as JSON under a format version, written whole or not at all.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glioscope_core::{
    Check,
    case::{AlignedBy, Case},
    files::{FileError, FileMark, read_head, read_small, write_whole_private},
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{
    document::{CaseRef, Document, KeyPicture},
    place::{Place, relative_to},
    session_limits::{self, unknown_keys},
    session_names,
    session_old::{upgrade_version_1, upgrade_version_2},
};

/// Extension of session files.
pub const EXTENSION: &str = "glioscope.json";
/// The version this program writes, and the newest it reads. Version 2 had numbers of dates and of masks instead of their
/// names, which [`session_names`] still reads.
const VERSION: u64 = 3;
/// The key by which a session file is recognised.
const KEY: &str = "glioscope_session";
/// Number of bytes in which the key stands if this program wrote the file.
const HEAD_BYTES: u64 = 1024;
/// Maximum size of a session file.
const MAX_BYTES: u64 = 16 << 20;

#[derive(Serialize, Deserialize)]
struct SessionFile {
    glioscope_session: u64,
    /// Where the case lies, seen from the folder of the session file.
    #[serde(default)]
    relative: Option<Place>,
    /// The case's files as they were read.
    #[serde(default)]
    files: Vec<FileMark>,
    document: Value,
}

/// A session as read, before its case is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// The document, without what refers to dates of the case.
    pub document: Document,
    /// The file it was read from; `None` for the session of an open case.
    pub origin: Option<Origin>,
    /// What was found while it was read.
    pub findings: Vec<Check>,
    /// The document as JSON: dates by label.
    named: Value,
}

/// The file of a session, and what it says about the files of its case.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// The session file.
    pub path: PathBuf,
    /// Where the case lies, seen from the session file's folder; `None` before version 3.
    pub relative: Option<Place>,
    /// The case's files as they were when the session was saved; empty before version 3 and for the sample.
    pub files: Vec<FileMark>,
}

fn has_ending(path: &Path) -> bool {
    path.to_string_lossy().to_lowercase().ends_with(&format!(".{EXTENSION}"))
}

/// Whether a file is a session: by its ending, or by its content whatever its name.
pub fn is_session(path: &Path) -> bool {
    if has_ending(path) {
        return !path.is_dir();
    }
    // Other files that a case may be opened from don't begin with a brace, and may be large.
    let Some(head) = read_head(path, HEAD_BYTES) else { return false };
    let is_json = head.trim_ascii_start().first() == Some(&b'{');
    let has_key = |bytes: &[u8]| bytes.windows(KEY.len()).any(|window| window == KEY.as_bytes());
    is_json
        && (has_key(&head) || read_small(path, MAX_BYTES, "a session file").is_ok_and(|all| has_key(&all)))
}

/// The session that saving proposes for a folder that is a case, where there is one.
pub fn beside(case: &CaseRef) -> Option<PathBuf> {
    let CaseRef::Path(folder) = case else { return None };
    let folder = std::path::absolute(folder).ok().filter(|folder| folder.is_dir())?;
    let mut name = folder.file_name()?.to_owned();
    name.push(".");
    name.push(EXTENSION);
    Some(folder.with_file_name(name)).filter(|session| session.is_file())
}

/// `path` with the ending of session files, unless it has it.
pub fn with_ending(path: PathBuf) -> PathBuf {
    if has_ending(&path) {
        return path;
    }
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let stem =
        if name.to_lowercase().ends_with(".json") { &name[..name.len() - ".json".len()] } else { &name };
    path.with_file_name(format!("{stem}.{EXTENSION}"))
}

/// Saves the document of `case`, whose files are `files`. Images are not copied: the session file refers to the case by
/// its absolute path and by the one seen from its own folder.
///
/// # Errors
/// [`FileError`]; an existing file at `path` is then unchanged.
pub fn save(path: &Path, document: &Document, case: &Case, files: &[FileMark]) -> Result<(), FileError> {
    let cant = |e: serde_json::Error| {
        wrong(path, &format!("a document that can't be written ({e})"), "one that can")
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut document = document.clone();
    let place = Place::of(&document).absolute();
    let relative = place.relative_to(folder);
    (document.case, document.tracts, document.edit.alignments) = (place.case, place.tracts, place.alignments);
    let marks = files.iter().map(|mark| {
        let file = relative_to(&mark.file, folder);
        FileMark { file, ..mark.clone() }
    });
    let file = SessionFile {
        glioscope_session: VERSION,
        relative: Some(relative),
        files: marks.collect(),
        document: session_names::named(&document, case).map_err(cant)?,
    };
    let text = serde_json::to_string_pretty(&file).map_err(cant)?;
    write_whole_private(path, text.as_bytes())
}

/// Reads a session.
///
/// # Errors
/// [`FileError`]; also for a file of a newer version.
pub fn load(path: &Path) -> Result<Session, FileError> {
    parse(path, &read_small(path, MAX_BYTES, "a session file")?)
}

/// The document of `case` as a session file has it, to be kept in another file. `has_place`: with the paths of the case's files;
/// without them it can only be opened together with a case.
///
/// # Errors
/// [`FileError`] where the document can't be written as JSON.
pub fn value(document: &Document, case: &Case, has_place: bool) -> Result<Value, FileError> {
    let cant =
        |e: serde_json::Error| wrong(Path::new("session"), &e.to_string(), "a document that can be written");
    let mut document = document.clone();
    if has_place {
        let place = Place::of(&document).absolute();
        (document.case, document.tracts, document.edit.alignments) =
            (place.case, place.tracts, place.alignments);
    } else {
        (document.case, document.tracts) = (CaseRef::Sample, Vec::new());
        document.edit.alignments.retain(|alignment| matches!(alignment.by, AlignedBy::Matrix { .. }));
    }
    let document = session_names::named(&document, case).map_err(cant)?;
    let file = SessionFile { glioscope_session: VERSION, relative: None, files: Vec::new(), document };
    serde_json::to_value(file).map_err(cant)
}

/// Reads a session from the content of `path`.
///
/// # Errors
/// As [`load`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Session, FileError> {
    let mut value: Value = serde_json::from_slice(bytes)
        .map_err(|e| wrong(path, &format!("broken JSON ({e})"), "a session file"))?;
    let version = value.get(KEY).and_then(Value::as_u64);
    let mut document = value.get_mut("document");
    match (version, &mut document) {
        (Some(1), Some(document)) => {
            upgrade_version_1(document);
            upgrade_version_2(document);
        }
        (Some(2), Some(document)) => upgrade_version_2(document),
        (Some(1..=VERSION), _) => {}
        (Some(version), _) => {
            return Err(wrong(
                path,
                &format!("session version {version}"),
                &format!("version 1 to {VERSION}"),
            ));
        }
        (None, _) => return Err(wrong(path, &format!("JSON without \"{KEY}\""), "a session file")),
    }
    let unfit =
        |e: serde_json::Error| wrong(path, &format!("a session that doesn't fit ({e})"), "a session file");
    // Lists in it may be long: it is taken, not copied.
    let named = value.get_mut("document").map(Value::take);
    let named = named.ok_or_else(|| wrong(path, "no \"document\"", "a session file"))?;
    let file: SessionFile = SessionFile::deserialize(&value).map_err(unfit)?;
    let blank = session_names::blank(&named);
    let document = Document::deserialize(&blank).map_err(unfit)?;
    session_limits::check(&document, &named).map_err(|fault| wrong(path, &fault.found, &fault.expected))?;
    let known = serde_json::to_value(&document).map_err(unfit)?;
    let mut unknown = unknown_keys(&blank, &known);
    unknown.extend(unknown_keys(&value, &serde_json::to_value(&file).map_err(unfit)?));
    let findings = (!unknown.is_empty()).then(|| {
        let found =
            format!("{}: found unknown keys, which are ignored: {}", path.display(), unknown.join(", "));
        Check::warning("session-unknown-key", found)
    });
    let origin = Origin { path: path.to_owned(), relative: file.relative, files: file.files };
    Ok(Session { document, origin: Some(origin), findings: findings.into_iter().collect(), named })
}

impl Session {
    /// The session of an open case, to open that again.
    ///
    /// # Errors
    /// [`FileError`] where the document can't be written as JSON.
    pub fn of(document: &Document, case: &Case) -> Result<Self, FileError> {
        let named = session_names::named(document, case)
            .map_err(|e| wrong(Path::new("session"), &e.to_string(), "a document that can be written"))?;
        Ok(Self { document: document.clone(), origin: None, findings: Vec::new(), named })
    }

    /// The session with other names of masks, images or dates: each value or key that equals an old name becomes the new one.
    #[must_use]
    pub fn renamed(mut self, names: &BTreeMap<String, String>) -> Self {
        each_text(&mut self.named, &|text| names.get(text).cloned().unwrap_or_else(|| text.to_owned()));
        self
    }

    /// With every text of the document as `change` gives it, keys too.
    #[must_use]
    pub fn with_texts(mut self, change: &dyn Fn(&str) -> String) -> Self {
        each_text(&mut self.named, change);
        self
    }

    /// The document for `case`, and a warning about what refers to dates, masks or images that the case lacks and is left
    /// out.
    ///
    /// # Errors
    /// [`FileError`] where a name is of the wrong kind.
    pub fn restore(&self, case: &Case) -> Result<(Document, Vec<Check>), FileError> {
        let (value, dropped) = session_names::numbered(&self.named, case);
        let path = self.origin.as_ref().map_or(Path::new("session"), |origin| &origin.path);
        let mut document: Document = serde_json::from_value(value)
            .map_err(|e| wrong(path, &format!("a session that doesn't fit ({e})"), "a session file"))?;
        document.edit.pictures.iter_mut().for_each(KeyPicture::without_the_case);
        let checks = (!dropped.is_empty()).then(|| {
            let text =
                format!("Not restored from the session, as the case lacks it: {}.", dropped.join("; "));
            Check::warning("session-dropped", text)
        });
        Ok((document, checks.into_iter().collect()))
    }
}

/// Replaces every text of `value`, keys too.
fn each_text(value: &mut Value, change: &dyn Fn(&str) -> String) {
    match value {
        Value::String(text) => *text = change(text),
        Value::Array(all) => all.iter_mut().for_each(|one| each_text(one, change)),
        Value::Object(map) => {
            let entries = std::mem::take(map).into_iter().map(|(key, mut one)| {
                each_text(&mut one, change);
                (change(&key), one)
            });
            *map = entries.collect();
        }
        _ => {}
    }
}

fn wrong(path: &Path, found: &str, expected: &str) -> FileError {
    FileError::Wrong { file: path.display().to_string(), found: found.into(), expected: expected.into() }
}

#[cfg(test)]
mod tests {
    use glioscope_core::files::write_whole;
    use serde_json::json;

    use super::*;
    use crate::model::{CaseRef, session_names::tests::case};

    #[test]
    fn a_session_is_known_by_its_ending_or_by_its_content() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let far = format!("{{\"document\": \"{}\", \"{KEY}\": 3}}", "x".repeat(2 * HEAD_BYTES as usize));
        for (name, text, expected) in [
            ("A.Glioscope.JSON", "anything", true),
            ("first", "{\"glioscope_session\": 3}", true),
            ("later.txt", &far, true),
            ("spaced", "\n {\"glioscope_session\": 3}", true),
            ("other.json", "{\"of_another_program\": [1, 2, 3]}", false),
            ("list", "[\"glioscope_session\"]", false),
            ("empty", "", false),
            ("glioscope.json", "{}", false),
        ] {
            write_whole(&path(name), text.as_bytes()).unwrap();
            assert_eq!(is_session(&path(name)), expected, "{name}");
        }
        std::fs::create_dir(path("folder.glioscope.json")).unwrap();
        assert!(!is_session(&path("folder.glioscope.json")) && !is_session(folder.path()));
        assert!(is_session(&path("gone.glioscope.json")) && !is_session(&path("gone")));
    }

    #[test]
    fn the_ending_is_added_once_and_replaces_json() {
        for (name, expected) in [
            ("a/visit", "a/visit.glioscope.json"),
            ("visit.txt", "visit.txt.glioscope.json"),
            ("visit.json", "visit.glioscope.json"),
            ("Visit.JSON", "Visit.glioscope.json"),
            ("visit.glioscope.json", "visit.glioscope.json"),
            ("Visit.Glioscope.Json", "Visit.Glioscope.Json"),
        ] {
            assert_eq!(with_ending(name.into()), PathBuf::from(expected));
        }
    }

    #[test]
    fn a_session_comes_back_with_its_files_as_seen_from_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("visit.glioscope.json");
        let case = case();
        let source = folder.path().join("nii").join("case.toml");
        let mut document = Document::new(CaseRef::Path(source), &case.time_points[0], 2);
        document.nav.time = 1;
        let mark = |file: PathBuf| FileMark { file, bytes: 5, hash: "ab".into() };
        save(&path, &document, &case, &[mark(folder.path().join("nii").join("T1.nii"))]).unwrap();
        let session = load(&path).unwrap();
        assert_eq!(session.findings, []);
        let origin = session.origin.clone().unwrap();
        assert_eq!(origin.path, path);
        assert_eq!(origin.files, [mark(Path::new("nii").join("T1.nii"))]);
        let relative = Place {
            case: CaseRef::Path(Path::new("nii").join("case.toml")),
            tracts: Vec::new(),
            alignments: Vec::new(),
        };
        assert_eq!(origin.relative, Some(relative));
        assert_eq!(session.document.nav.time, 0, "not before its case is known");
        assert_eq!(session.restore(&case).unwrap(), (document.clone(), Vec::new()));
        assert_eq!(Session::of(&document, &case).unwrap().restore(&case).unwrap(), (document, Vec::new()));

        // Without feb: the first date, and that is said.
        let mut less = case;
        less.time_points.truncate(1);
        let (restored, checks) = session.restore(&less).unwrap();
        assert_eq!(restored.nav.time, 0);
        assert!(
            matches!(&checks[..], [check] if check.code == "session-dropped" && check.message.contains("\"feb\""))
        );
    }

    #[test]
    fn what_a_session_file_says_too_much_or_wrongly_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("visit.glioscope.json");
        let case = case();
        save(&path, &Document::new(CaseRef::Sample, &case.time_points[0], 2), &case, &[]).unwrap();
        let good: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        let with = |pointer: &str, key: &str, value: Value| {
            let mut changed = good.clone();
            let object = changed.pointer_mut(pointer).and_then(Value::as_object_mut).unwrap();
            object.insert(key.into(), value);
            write_whole(&path, changed.to_string().as_bytes()).unwrap();
            load(&path)
        };
        for (pointer, key, path) in [("", "fils", "fils"), ("/document/edit", "lens_onn", "edit.lens_onn")] {
            let findings = with(pointer, key, json!(1)).unwrap().findings;
            assert!(
                matches!(&findings[..], [check] if check.code == "session-unknown-key" && check.message.ends_with(&format!(": {path}")))
            );
        }
        // Version 2 may have numbers, too.
        assert!(with("", KEY, json!(2)).is_ok());
        for (pointer, key, value, word) in [
            ("", KEY, json!(0), "found session version 0, expected version 1 to 3"),
            ("", KEY, json!(4), "found session version 4"),
            ("", KEY, json!("3"), "JSON without \"glioscope_session\""),
            ("", "document", json!(null), "doesn't fit"),
            ("", "files", json!(3), "doesn't fit"),
            ("/document/nav", "time", json!([]), "doesn't fit"),
            ("/document/nav", "mm_per_point", json!(0.0), "found mm_per_point 0e0"),
        ] {
            let error = with(pointer, key, value).unwrap_err().to_string();
            assert!(error.contains("visit.glioscope.json: ") && error.contains(word), "{error}");
        }
    }
}
