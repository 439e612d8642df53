//! The session file: a [`Document`] as JSON under a format version, written whole or not at all.

use std::path::Path;

use glioscope_core::files::{FileError, write_whole};
use serde::{Deserialize, Serialize};

use crate::document::Document;

/// Ending of a session file.
pub const ENDING: &str = "glioscope.json";
/// The version this program writes, and the newest it reads.
const VERSION: u32 = 1;

#[derive(Serialize, Deserialize)]
struct SessionFile {
    glioscope_session: u32,
    document: Document,
}

/// Whether a path has the ending of a session file.
pub fn is_session(path: &Path) -> bool {
    path.to_string_lossy().to_lowercase().ends_with(ENDING)
}

/// Saves the document. Images are not copied: the case is named by its path.
///
/// # Errors
/// [`FileError`]; what stood at `path` is untouched then.
pub fn save(path: &Path, document: &Document) -> Result<(), FileError> {
    let file = SessionFile { glioscope_session: VERSION, document: document.clone() };
    let text = serde_json::to_string_pretty(&file)
        .map_err(|e| wrong(path, &format!("a document that can't be written ({e})"), "one that can"))?;
    write_whole(path, text.as_bytes())
}

/// Reads a session.
///
/// # Errors
/// [`FileError`]; a newer version's file is refused, not guessed at.
pub fn load(path: &Path) -> Result<Document, FileError> {
    let bytes = std::fs::read(path).map_err(|e| wrong(path, &e.to_string(), "a session file"))?;
    let value: serde_json::Value = serde_json::from_slice(&bytes)
        .map_err(|e| wrong(path, &format!("broken JSON ({e})"), "a session file"))?;
    match value.get("glioscope_session").and_then(serde_json::Value::as_u64) {
        Some(version) if version == u64::from(VERSION) => {}
        Some(version) => {
            return Err(wrong(path, &format!("session version {version}"), &format!("version {VERSION}")));
        }
        None => return Err(wrong(path, "JSON without \"glioscope_session\"", "a session file")),
    }
    let file: SessionFile = serde_json::from_value(value)
        .map_err(|e| wrong(path, &format!("a session that doesn't fit ({e})"), "a session file"))?;
    Ok(file.document)
}

fn wrong(path: &Path, found: &str, expected: &str) -> FileError {
    FileError::Wrong { file: path.display().to_string(), found: found.into(), expected: expected.into() }
}
