//! The session file: a [`Document`] as JSON under a format version, written whole or not at all.

use std::path::Path;

use glioscope_core::files::{FileError, write_whole};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::document::Document;

/// Extension of session files.
pub const EXTENSION: &str = "glioscope.json";
/// The version this program writes, and the newest it reads. [`upgrade_version_1`] converts the previous one.
const VERSION: u64 = 2;

#[derive(Serialize, Deserialize)]
struct SessionFile {
    glioscope_session: u64,
    document: Document,
}

/// Whether a path has the extension of a session file, in any case.
pub fn is_session(path: &Path) -> bool {
    path.to_string_lossy().to_lowercase().ends_with(EXTENSION)
}

/// Saves the document. Images are not copied: the file refers to the case by its path.
///
/// # Errors
/// [`FileError`]; an existing file at `path` is then unchanged.
pub fn save(path: &Path, document: &Document) -> Result<(), FileError> {
    let file = SessionFile { glioscope_session: VERSION, document: document.clone() };
    let text = serde_json::to_string_pretty(&file)
        .map_err(|e| wrong(path, &format!("a document that can't be written ({e})"), "one that can"))?;
    write_whole(path, text.as_bytes())
}

/// Reads a session.
///
/// # Errors
/// [`FileError`]; also for a file of a newer version.
pub fn load(path: &Path) -> Result<Document, FileError> {
    let bytes = std::fs::read(path).map_err(|e| wrong(path, &e.to_string(), "a session file"))?;
    let mut value: Value = serde_json::from_slice(&bytes)
        .map_err(|e| wrong(path, &format!("broken JSON ({e})"), "a session file"))?;
    match value.get("glioscope_session").and_then(Value::as_u64) {
        Some(1) => upgrade_version_1(&mut value),
        Some(VERSION) => {}
        Some(version) => {
            return Err(wrong(
                path,
                &format!("session version {version}"),
                &format!("version 1 to {VERSION}"),
            ));
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

/// JSON pointers to values that version 1 wrote in PascalCase instead of snake_case.
const PASCAL_CASE: [&str; 6] = [
    "/edit/overlay",
    "/edit/palette",
    "/edit/coloring",
    "/edit/overlap_mode",
    "/nav/convention",
    "/nav/camera/projection",
];

/// Fields renamed since version 1: JSON pointer to their object, old name, new name.
const RENAMED: [(&str, &str, &str); 5] = [
    ("/edit/light", "shading", "mode"),
    ("/edit/light/own", "shading", "mode"),
    ("/edit/light/own/mutual", "solid_on_image", "opaque_on_image"),
    ("/edit/light/own/mutual", "image_on_solid", "image_on_opaque"),
    ("/edit/light/own/mutual", "solid_on_solid", "opaque_on_opaque"),
];

/// Fields of single panes' magnifications in version 1, now in `zooms`: field, pane.
const ZOOMS: [(&str, &str); 3] =
    [("context_zoom", "context"), ("ellipsoid_zoom", "ellipsoids"), ("change_zoom", "change")];

/// Upgrades a file of version 1 to [`VERSION`]. Anything unexpected is left unchanged; deserialising then reports it.
fn upgrade_version_1(file: &mut Value) {
    file["glioscope_session"] = json!(VERSION);
    let Some(document) = file.get_mut("document") else { return };
    for pointer in PASCAL_CASE {
        if let Some(Value::String(word)) = document.pointer_mut(pointer) {
            *word = snake_case(word);
        }
    }
    for (pointer, old, new) in RENAMED {
        if let Some(object) = document.pointer_mut(pointer).and_then(Value::as_object_mut)
            && let Some(value) = object.remove(old)
        {
            object.insert(new.into(), value);
        }
    }
    if let Some(nav) = document.pointer_mut("/nav").and_then(Value::as_object_mut) {
        let zooms = ZOOMS.iter().filter_map(|(field, pane)| Some(((*pane).to_owned(), nav.remove(*field)?)));
        let zooms: serde_json::Map<String, Value> = zooms.collect();
        nav.insert("zooms".into(), zooms.into());
    }
    for pointer in ["/edit/layout", "/edit/maximized", "/edit/rulers"] {
        if let Some(part) = document.pointer_mut(pointer) {
            flatten_slice_panes(part);
        }
    }
}

/// Replaces `{"slice": "Axial"}`, version 1's name of a slice pane, with `"axial"` throughout `value`.
fn flatten_slice_panes(value: &mut Value) {
    match value {
        Value::Object(object) if object.len() == 1 && object.contains_key("slice") => {
            if let Some(Value::String(plane)) = object.remove("slice") {
                *value = snake_case(&plane).into();
            }
        }
        Value::Object(object) => object.values_mut().for_each(flatten_slice_panes),
        Value::Array(list) => list.iter_mut().for_each(flatten_slice_panes),
        _ => {}
    }
}

fn snake_case(word: &str) -> String {
    let mut out = String::with_capacity(word.len() + 2);
    for (i, letter) in word.char_indices() {
        if letter.is_ascii_uppercase() && i > 0 {
            out.push('_');
        }
        out.push(letter.to_ascii_lowercase());
    }
    out
}
