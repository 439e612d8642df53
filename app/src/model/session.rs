//! The session file: a [`Document`] as JSON under a format version, written whole or not at all.

use std::path::Path;

use glioscope_core::{
    Check,
    case::Case,
    files::{FileError, write_whole},
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{document::Document, session_names, session_old::upgrade_version_1};

/// Extension of session files.
pub const EXTENSION: &str = "glioscope.json";
/// The version this program writes, and the newest it reads. Version 2 had numbers of dates and of masks instead of their
/// names, which [`session_names`] still reads.
const VERSION: u64 = 3;

#[derive(Serialize, Deserialize)]
struct SessionFile {
    glioscope_session: u64,
    document: Value,
}

/// A session as read, before its case is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// The document, without what refers to dates of the case.
    pub document: Document,
    /// The document as JSON: dates by label.
    named: Value,
}

/// Whether a path has the extension of a session file, in any case.
pub fn is_session(path: &Path) -> bool {
    path.to_string_lossy().to_lowercase().ends_with(EXTENSION)
}

/// Saves the document of `case`. Images are not copied: the file refers to the case by its path.
///
/// # Errors
/// [`FileError`]; an existing file at `path` is then unchanged.
pub fn save(path: &Path, document: &Document, case: &Case) -> Result<(), FileError> {
    let cant = |e: serde_json::Error| {
        wrong(path, &format!("a document that can't be written ({e})"), "one that can")
    };
    let document = session_names::named(document, case).map_err(cant)?;
    let file = SessionFile { glioscope_session: VERSION, document };
    let text = serde_json::to_string_pretty(&file).map_err(cant)?;
    write_whole(path, text.as_bytes())
}

/// Reads a session.
///
/// # Errors
/// [`FileError`]; also for a file of a newer version.
pub fn load(path: &Path) -> Result<Session, FileError> {
    let bytes = std::fs::read(path).map_err(|e| wrong(path, &e.to_string(), "a session file"))?;
    let mut value: Value = serde_json::from_slice(&bytes)
        .map_err(|e| wrong(path, &format!("broken JSON ({e})"), "a session file"))?;
    match value.get("glioscope_session").and_then(Value::as_u64) {
        Some(1) => value.get_mut("document").into_iter().for_each(upgrade_version_1),
        Some(2..=VERSION) => {}
        Some(version) => {
            return Err(wrong(
                path,
                &format!("session version {version}"),
                &format!("version 1 to {VERSION}"),
            ));
        }
        None => return Err(wrong(path, "JSON without \"glioscope_session\"", "a session file")),
    }
    let unfit = |e: serde_json::Error| {
        wrong(path, &format!("a session that doesn't fit ({e})"), "a session file")
    };
    let file: SessionFile = serde_json::from_value(value).map_err(unfit)?;
    let document = serde_json::from_value(session_names::blank(&file.document)).map_err(unfit)?;
    Ok(Session { document, named: file.document })
}

impl Session {
    /// The session of an open case, to open that again.
    ///
    /// # Errors
    /// [`FileError`] where the document can't be written as JSON.
    pub fn of(document: &Document, case: &Case) -> Result<Self, FileError> {
        let named = session_names::named(document, case)
            .map_err(|e| wrong(Path::new("session"), &e.to_string(), "a document that can be written"))?;
        Ok(Self { document: document.clone(), named })
    }

    /// The document for `case`, and a warning about what refers to dates, masks or images that the case lacks and is left
    /// out.
    ///
    /// # Errors
    /// [`FileError`] where a name is of the wrong kind.
    pub fn restore(&self, case: &Case) -> Result<(Document, Vec<Check>), FileError> {
        let (value, dropped) = session_names::numbered(&self.named, case);
        let mut document: Document = serde_json::from_value(value)
            .map_err(|e| wrong(Path::new("session"), &format!("a session that doesn't fit ({e})"), "a session"))?;
        // Where the case lies, and how it is loaded, is decided before it is read.
        let Document { case: place, tracts, order, case_grid, .. } = self.document.clone();
        (document.case, document.tracts, document.order, document.case_grid) = (place, tracts, order, case_grid);
        let checks = (!dropped.is_empty()).then(|| {
            let text = format!("Not restored, because the case lacks it: {}.", dropped.join("; "));
            Check::warning("session-dropped", text)
        });
        Ok((document, checks.into_iter().collect()))
    }
}

fn wrong(path: &Path, found: &str, expected: &str) -> FileError {
    FileError::Wrong { file: path.display().to_string(), found: found.into(), expected: expected.into() }
}
