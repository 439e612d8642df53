//! A transfer function as a file, JSON as docs/schemas/transfer.schema.json has it: what a session keeps of one image, to be
//! used for others.

use std::path::Path;

use glioscope_core::files::{FileError, read_small, write_whole};
use glioscope_render::TransferFunction;
use serde::Deserialize;
use serde_json::Value;

use super::session_limits::unknown_keys;

/// The key by which such a file is recognised, and the version that it holds.
const KEY: &str = "glioscope_transfer";
/// The version this program writes, and the newest it reads.
const VERSION: u64 = 1;
/// Maximum size of such a file.
const MAX_BYTES: u64 = 1 << 20;
/// Ending of such a file, without the first dot.
pub const EXTENSION: &str = "transfer.json";

fn wrong(path: &Path, found: impl Into<String>, expected: impl Into<String>) -> FileError {
    FileError::Wrong { file: path.display().to_string(), found: found.into(), expected: expected.into() }
}

/// Reads a transfer function.
///
/// # Errors
/// [`FileError`] for a file that can't be read or is too large, other content, a newer version, an unknown key, and a
/// number out of its range.
pub fn load(path: &Path) -> Result<TransferFunction, FileError> {
    let bytes = read_small(path, MAX_BYTES, "a transfer function")?;
    let mut json: Value = serde_json::from_slice(&bytes)
        .map_err(|e| wrong(path, format!("broken JSON ({e})"), "a transfer function"))?;
    let version = json.as_object_mut().and_then(|keys| keys.remove(KEY));
    match version.as_ref().and_then(Value::as_u64) {
        Some(VERSION) => {}
        Some(other) => {
            return Err(wrong(
                path,
                format!("transfer function version {other}"),
                format!("version {VERSION}"),
            ));
        }
        None => return Err(wrong(path, format!("JSON without \"{KEY}\""), "a transfer function")),
    }
    let transfer = TransferFunction::deserialize(&json).map_err(|e| {
        let text = e.to_string();
        // Wrong numbers are told in full by the function itself.
        match text.strip_prefix("transfer function: found ").and_then(|rest| rest.split_once(", expected ")) {
            Some((found, expected)) => wrong(path, found, expected),
            None => wrong(path, text, "points, gradient and shapes as docs/json.md has them"),
        }
    })?;
    let known = serde_json::to_value(&transfer).unwrap_or_default();
    let unknown = unknown_keys(&json, &known);
    if !unknown.is_empty() {
        return Err(wrong(
            path,
            format!("unknown keys {}", unknown.join(", ")),
            "points, gradient, shapes and theirs",
        ));
    }
    Ok(transfer)
}

/// Writes a transfer function, whole or not at all.
///
/// # Errors
/// [`FileError`] where it can't be written; an existing file is then unchanged.
pub fn save(path: &Path, transfer: &TransferFunction) -> Result<(), FileError> {
    let cant =
        |e: serde_json::Error| wrong(path, format!("a function that can't be written ({e})"), "one that can");
    let mut json = serde_json::to_value(transfer).map_err(cant)?;
    if let Some(keys) = json.as_object_mut() {
        keys.insert(KEY.to_owned(), VERSION.into());
    }
    let text = serde_json::to_string_pretty(&json).map_err(cant)?;
    write_whole(path, format!("{text}\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use glioscope_core::{Grid, Samples, Scaling, Volume};
    use glioscope_render::{TransferPreset, flat};
    use strum::VariantArray;

    use super::*;

    #[test]
    fn what_is_saved_is_loaded_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.transfer.json");
        let grid = Grid::axis_aligned([100, 1, 1], glam::DVec3::ONE, glam::DVec3::ZERO).unwrap();
        let values = (0..100).map(|i| (f64::from(i) * 0.37).exp() / 3.0).collect();
        let statistics =
            flat::Histogram::of(&Volume::new(grid, Samples::F64(values), Scaling::NONE).unwrap());
        for preset in TransferPreset::VARIANTS {
            let transfer = preset.transfer(&statistics);
            save(&path, &transfer).unwrap();
            assert_eq!(load(&path).unwrap(), transfer, "{preset:?}");
        }
    }

    #[test]
    fn files_that_are_no_transfer_functions_are_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.transfer.json");
        let blob = r#"{"blob": {"value": 1, "gradient_per_mm": 1, "value_deviation": 1, "gradient_deviation_per_mm": 1}}"#;
        let one = |shape: &str| format!(r#"{{"glioscope_transfer": 1, "shapes": [{shape}]}}"#);
        let good = one(&format!(r#"{{"form": {blob}, "color": [255, 0, 0], "opacity": 0.5}}"#));
        for (text, expected) in [
            ("{", "found broken JSON"),
            ("{}", "found JSON without \"glioscope_transfer\""),
            (r#"{"glioscope_transfer": 2}"#, "found transfer function version 2, expected version 1"),
            (r#"{"glioscope_transfer": 1}"#, "found 0 control points, expected at least 2"),
            (&good.replace("0.5", "5"), "found 5 as opacity of shape 0, expected 0 to 1"),
            (&good.replace("\"value_deviation\": 1", "\"value_deviation\": 0"), "found 0 as value_deviation of shape 0"),
            (&good.replace("\"color\"", "\"x\": 1, \"color\""), "found unknown keys shapes.0.x"),
            (&good.replace("blob", "disc"), "unknown variant `disc`"),
            (&good.replace("255", "256"), "256"),
            (&one(&vec![r#"{"form": {"box": {"values": [0, 1], "gradients_per_mm": [0, 1], "soft": 0}}, "color": [0, 0, 0], "opacity": 0}"#; 65].join(",")), "found 65 shapes, expected at most 64"),
        ] {
            write_whole(&path, text.as_bytes()).unwrap();
            let error = load(&path).unwrap_err().to_string();
            assert!(error.contains(expected) && error.contains("a.transfer.json"), "{error}");
            assert!(!error.contains('\n'), "{error}");
        }
        write_whole(&path, good.as_bytes()).unwrap();
        let read = load(&path).unwrap();
        assert_eq!((read.shapes().map(<[_]>::len), read.points().len()), (Some(1), 2));
        assert!(load(&folder.path().join("nothing.transfer.json")).is_err());
    }
}
