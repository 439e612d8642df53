//! Reading and writing files. Every failure names the file, what was found and what was expected.

use std::path::{Path, PathBuf};

use crate::{Cancelled, Check, Progress, Volume};

mod bounded_gzip;
pub mod format;
mod nifti;
pub mod nifti_header;
pub mod nifti_space;
mod nifti_write;
mod tracts;
mod tracts_tck;
mod tracts_trk;

pub use format::FileInfo;
pub use nifti::{HeaderInfo, nifti_info, nifti_info_with, read_bytes};
pub use nifti_write::{WriteOptions, nifti_bytes, write_nifti};
pub use tracts::{LoadedTracts, TractOptions, read_tract_bytes, read_tracts};

/// Where a file's bytes come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A file on disk.
    File(PathBuf),
    /// Bytes that came with the program, under the name of the file they stand for.
    Embedded {
        /// Its name, with ending.
        name: &'static str,
        /// Its content.
        bytes: &'static [u8],
    },
}

impl Source {
    /// What messages call it.
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => printable(&path.display().to_string()),
            Self::Embedded { name, .. } => (*name).to_owned(),
        }
    }
}

/// Limits on reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadOptions {
    /// Most bytes of voxels that one frame may take.
    pub max_bytes: u64,
    /// Which frame of a 4-D or 5-D file, counting on through dimensions 4, 5, 6 and 7.
    pub frame: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { max_bytes: 4 << 30, frame: 0 }
    }
}

/// One frame of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// Its voxels and where they are.
    pub volume: Volume,
    /// Frames the file has: 1 for a 3-D file.
    pub frames: usize,
    /// What was noticed.
    pub checks: Vec<Check>,
}

/// Why a file can't be read or written: one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FileError {
    /// The file is not what it should be.
    #[error("{file}: found {found}, expected {expected}")]
    Wrong {
        /// Name of the file.
        file: String,
        /// What is there.
        found: String,
        /// What should be.
        expected: String,
    },
    /// The user asked to stop.
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

/// `name` on one line: control characters and those that turn the writing direction are escaped.
pub(crate) fn printable(name: &str) -> String {
    let turns =
        |c: char| matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let mut out = String::with_capacity(name.len());
    for c in name.chars() {
        if c.is_control() || turns(c) || matches!(c, '\u{2028}' | '\u{2029}') {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}

/// A temporary file with the permissions that the user's other new files have; tempfile's own are
/// for secrets, and a picture that only its owner can open is no use to a colleague.
fn temporary() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".glioscope-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}

/// Writes the whole of `bytes` to `path`, or leaves what stood there untouched: a temporary file
/// beside it, flushed to disk, then renamed over it. A link stays one: what it leads to is written.
///
/// # Errors
/// [`FileError::Wrong`] with the system's reason, or where a folder, a device or a pipe stands.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    // Renaming over a device would put a file in its place.
    if path.metadata().is_ok_and(|there| !there.is_file()) {
        return Err(FileError::wrong(
            path.display().to_string(),
            "something that is no ordinary file",
            "a place that can be written",
        ));
    }
    let target = if path.is_symlink() { path.canonicalize().ok() } else { None };
    let path = target.as_deref().unwrap_or(path);
    let fail = |e: std::io::Error| FileError::Wrong {
        file: path.display().to_string(),
        found: format!("writing failed: {e}"),
        expected: "a place that can be written".into(),
    };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = temporary().tempfile_in(folder).map_err(fail)?;
    std::io::Write::write_all(&mut file, bytes).map_err(fail)?;
    file.as_file().sync_all().map_err(fail)?;
    file.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

/// Reads one frame of an image or mask, in whichever of [`format::VOLUME_FORMATS`] it is. Of NIfTI: `.nii`, `.nii.gz`,
/// `.hdr`/`.img` in every mix, given by either half. gzip is recognised by content, not by name.
///
/// # Errors
/// [`FileError::Wrong`] for whatever is wrong with the file; nothing is allocated for voxels
/// before the header has passed against the file's length and `options.max_bytes`.
/// [`FileError::Cancelled`] when `progress` says so.
pub fn read(source: &Source, options: &ReadOptions, progress: &Progress) -> Result<Loaded, FileError> {
    (format::volume_format(source).read)(source, options, progress)
}

/// What a file of an image or mask says about itself. Reads through to its end, so that a damaged or cut-off file is
/// found out, but keeps no voxels.
///
/// # Errors
/// As [`read`], except that no size is too large.
pub fn info(source: &Source, progress: &Progress) -> Result<Box<dyn FileInfo>, FileError> {
    (format::volume_format(source).info)(source, progress)
}
