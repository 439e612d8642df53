//! Reading and writing files. Every error names the file, what was found and what was expected.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use crate::{Cancelled, Check, Volume};

mod bounded_gzip;
mod content;
mod cross_check;
pub mod format;
mod inputs;
mod nifti;
mod nifti_describe;
pub mod nifti_header;
pub mod nifti_space;
mod nifti_write;
mod opened;
mod read;
mod tracts;
mod tracts_tck;
mod tracts_trk;

pub use content::FileMark;
pub use cross_check::{AffineCheck, BothReaders, CrossCheck, CrossChecked, ValueCheck, cross_check};
pub use inputs::Inputs;
pub(crate) use nifti::other_half;
pub use nifti::{HeaderInfo, nifti_info, nifti_info_with, read_bytes};
pub use nifti_write::{WriteOptions, nifti_bytes, write_nifti};
pub(crate) use opened::{broken_link, missing, open_regular, stand_in};
pub use opened::{read_head, read_small, read_small_text};
pub use read::{info, read, read_tract_bytes, read_tracts};
pub use tracts::{LoadedTracts, TractOptions};

/// Where a file's bytes come from.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Source {
    /// A file on disk.
    File(PathBuf),
    /// Bytes embedded in the program, with the name of the file they come from.
    Embedded {
        /// File name with extension.
        name: &'static str,
        /// File content.
        bytes: &'static [u8],
    },
}

impl Source {
    /// The name used in messages.
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => printable(&path.display().to_string()),
            Self::Embedded { name, .. } => (*name).to_owned(),
        }
    }
}

/// Default limit of the bytes that one file may declare: 4 GiB.
pub const DEFAULT_MAX_BYTES: u64 = 4 << 30;

/// Limits on reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadOptions {
    /// Maximum size of one frame's voxels in bytes.
    pub max_bytes: u64,
    /// Frame to read from a file of 4 or more dimensions, from 0, counted through dimensions 4 to 7.
    pub frame: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { max_bytes: DEFAULT_MAX_BYTES, frame: 0 }
    }
}

/// One frame of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// Its voxels and their grid.
    pub volume: Volume,
    /// Number of frames in the file: 1 for a 3-D file.
    pub frames: usize,
    /// Findings.
    pub checks: Vec<Check>,
}

/// Header information of a file, in its format's own terms.
pub trait FileInfo {
    /// Human-readable text, one line per item.
    fn text(&self) -> String;
    /// Findings.
    fn checks(&self) -> &[Check];
    /// Indented JSON; keys are stable.
    ///
    /// # Errors
    /// When a number is not finite.
    fn json(&self) -> serde_json::Result<String>;
}

/// Why a file can't be read or written, in one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FileError {
    /// The file is not as expected.
    #[error("{file}: found {found}, expected {expected}")]
    Wrong {
        /// Name of the file.
        file: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl FileError {
    pub(crate) fn wrong(
        file: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Wrong { file: file.into(), found: found.into(), expected: expected.into() }
    }
}

/// Whether a terminal or a reader may be misled by a character: control characters (a terminal obeys them), line
/// separators, and formatting characters that reverse the direction of writing.
pub fn is_misleading(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// `name` on one line: misleading characters are escaped.
pub fn printable(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    for c in name.chars() {
        if is_misleading(c) {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}

/// Start of the names of temporary files.
const PREFIX: &str = ".glioscope-";
/// Permissions of ordinary new files. Those of tempfile let only the owner read them, which is too strict for exported
/// results.
const ORDINARY: u32 = 0o666;
/// Permissions of files that only their owner reads.
const PRIVATE: u32 = 0o600;

/// Builder of temporary files with these permissions.
fn temporary(mode: u32) -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
    #[cfg(not(unix))]
    let _ = mode;
    builder
}

/// Writing to `path` failed.
fn write_failed(path: &Path, why: &dyn std::fmt::Display) -> FileError {
    let file = printable(&path.display().to_string());
    FileError::wrong(file, format!("writing failed: {why}"), "a place that can be written")
}

/// Writes `bytes` to `path` atomically, or leaves the existing file untouched: a temporary file in the same
/// folder is flushed to disk, then renamed over `path`. A symbolic link is kept: its target is written.
///
/// # Errors
/// [`FileError::Wrong`] with the system's reason, or where `path` is a folder, a device, a pipe, a write-protected file, or
/// a link whose target doesn't exist.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_whole_with(path, "", |file| file.write_all(bytes).map_err(|e| write_failed(path, &e)))
}

/// As [`write_whole`], readable and writable by its owner alone: for files that name patients' folders.
///
/// # Errors
/// As [`write_whole`].
pub fn write_whole_private(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    persist(path, "", PRIVATE, |file| file.write_all(bytes).map_err(|e| write_failed(path, &e)))
}

/// As [`write_whole`], with content that `write` writes to the temporary file, whose name ends in `suffix`.
/// When `write` fails, the temporary file is removed and nothing else changes.
pub(crate) fn write_whole_with(
    path: &Path,
    suffix: &'static str,
    write: impl FnOnce(&mut NamedTempFile) -> Result<(), FileError>,
) -> Result<(), FileError> {
    persist(path, suffix, ORDINARY, write)
}

fn persist(
    path: &Path,
    suffix: &'static str,
    mode: u32,
    write: impl FnOnce(&mut NamedTempFile) -> Result<(), FileError>,
) -> Result<(), FileError> {
    // Renaming over a device would replace it by a regular file.
    if path.metadata().is_ok_and(|metadata| !metadata.is_file()) {
        return Err(FileError::wrong(
            path.display().to_string(),
            "something that is no ordinary file",
            "a place that can be written",
        ));
    }
    let target = match path.is_symlink().then(|| path.canonicalize()) {
        None => None,
        Some(Ok(target)) => Some(target),
        Some(Err(e)) => return Err(write_failed(path, &format!("a link to nowhere ({e})"))),
    };
    let path = target.as_deref().unwrap_or(path);
    let failed = |e: std::io::Error| write_failed(path, &e);
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = temporary(mode).suffix(suffix).tempfile_in(folder).map_err(failed)?;
    write(&mut file)?;
    // A file that is replaced keeps its permissions, unless the new one is private.
    if let Some(replaced) = path.metadata().ok().map(|metadata| metadata.permissions()) {
        if replaced.readonly() {
            return Err(write_failed(path, &"a write-protected file"));
        }
        if mode == ORDINARY {
            file.as_file().set_permissions(replaced).map_err(failed)?;
        }
    }
    file.as_file().sync_all().map_err(failed)?;
    file.persist(path).map_err(|e| failed(e.error))?;
    sweep(folder);
    Ok(())
}

/// Age from which a temporary file belongs to a run that was killed: no write takes so long.
const STALE: std::time::Duration = std::time::Duration::from_secs(3600);

/// Removes the temporary files that killed runs left in `folder`.
fn sweep(folder: &Path) {
    let is_stale = |entry: &std::fs::DirEntry| {
        let age =
            entry.metadata().ok().filter(|m| m.is_file()).and_then(|m| m.modified().ok()?.elapsed().ok());
        entry.file_name().to_string_lossy().starts_with(PREFIX) && age.is_some_and(|age| age > STALE)
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries.filter(is_stale) {
        // One that can't be removed is left.
        let _ = std::fs::remove_file(entry.path());
    }
}
