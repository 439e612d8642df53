//! Small JSON files in the user's configuration folder, for the user alone. Nothing depends on them, so errors are ignored.

use std::path::{Path, PathBuf};

use glioscope_core::files::{read_small, write_whole_private};
use serde::{Serialize, de::DeserializeOwned};

/// The user's configuration folder; `GLIOSCOPE_CONFIG` overrides it.
pub fn config_folder() -> Option<PathBuf> {
    std::env::var_os("GLIOSCOPE_CONFIG").map(PathBuf::from).or_else(|| {
        directories::ProjectDirs::from("", "", "glioscope").map(|folders| folders.config_dir().to_owned())
    })
}

/// What `file` holds; `None` where it can't be read, has more than `max_bytes` or is something else than `expected`.
pub fn read<T: DeserializeOwned>(file: &Path, max_bytes: u64, expected: &str) -> Option<T> {
    serde_json::from_slice(&read_small(file, max_bytes, expected).ok()?).ok()
}

/// Writes `value` to `file`, whose folder is made; returns whether that succeeded.
pub fn write(file: &Path, value: &impl Serialize) -> bool {
    let (Some(folder), Ok(bytes)) = (file.parent(), serde_json::to_vec_pretty(value)) else { return false };
    std::fs::create_dir_all(folder).is_ok() && write_whole_private(file, &bytes).is_ok()
}
