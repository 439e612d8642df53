//! Reading and writing files. Every error names the file, what was found and what was expected.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::{Cancelled, Check, Volume};

pub mod archive;
mod bounded_gzip;
mod content;
mod cross_check;
mod detached;
pub mod dicom;
pub mod format;
mod hash;
mod image;
mod inputs;
mod metaimage;
mod metaimage_header;
mod mgh;
mod nifti;
mod nifti_describe;
pub mod nifti_header;
pub mod nifti_space;
mod nifti_write;
mod nrrd;
mod nrrd_header;
mod nrrd_segments;
mod nrrd_space;
mod opened;
mod placed;
mod read;
mod segment_labels;
mod stored_file;
mod stored_voxels;
mod text_header;
mod tracts;
mod tracts_tck;
mod tracts_trk;
mod tracts_tsf;
mod voxel_text;
mod voxels;
mod write;

pub use content::FileMark;
pub use cross_check::{AffineCheck, BothReaders, CrossCheck, CrossChecked, ValueCheck, cross_check};
pub use hash::{sha256, sha256_of};
pub use image::ImageInfo;
pub use inputs::{Inputs, refuse_link};
pub use metaimage::read_metaimage_bytes;
pub use mgh::read_mgh_bytes;
pub(crate) use nifti::other_half;
pub use nifti::{HeaderInfo, nifti_info, nifti_info_with, read_bytes};
pub use nifti_write::{WriteOptions, nifti_bytes, write_nifti};
pub use nrrd::read_nrrd_bytes;
pub(crate) use opened::{broken_link, missing, stand_in};
pub use opened::{open_regular, read_head, read_small, read_small_text};
pub(crate) use read::other_files;
pub use read::{files_of, info, read, read_tract_bytes, read_tract_scalar, read_tracts, segments};
pub use tracts::{LoadedTracts, TractOptions};
pub use write::{
    is_writable_folder, replace_files, temporary_folder, write_whole, write_whole_by, write_whole_private,
};
pub(crate) use write::{sweep, write_failed, write_whole_with};

/// Where a file's bytes come from.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Source {
    /// A file on disk.
    File(PathBuf),
    /// A part of a file, or of a folder of DICOM files.
    Part(Part),
    /// Bytes embedded in the program, with the name of the file they come from.
    Embedded {
        /// File name with extension.
        name: &'static str,
        /// File content.
        bytes: &'static [u8],
    },
}

/// A part of a file, or of a folder of DICOM files.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Part {
    /// The file or folder.
    pub path: PathBuf,
    /// Series Instance UID; `None` for other formats, and for a folder of one series.
    pub series: Option<String>,
    /// Which of its volumes or masks.
    pub which: Which,
}

impl Part {
    /// The file, or the series, as a whole.
    fn whole(&self) -> Source {
        match &self.series {
            None => Source::File(self.path.clone()),
            Some(_) => Source::Part(Self { which: Which::Frame(0), ..self.clone() }),
        }
    }
}

/// Which volume or mask of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Which {
    /// A frame, from 0: a time point, an echo, a b-value.
    Frame(usize),
    /// A segment, by its number in the file: a mask of 0 and 1.
    Segment(i64),
}

impl Source {
    /// The path on disk; `None` for embedded bytes.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::File(path) | Self::Part(Part { path, .. }) => Some(path),
            Self::Embedded { .. } => None,
        }
    }

    /// The name used in messages.
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => printable(&path.display().to_string()),
            Self::Part(Part { path, which, .. }) => {
                let path = printable(&path.display().to_string());
                match which {
                    Which::Frame(0) => path,
                    Which::Frame(frame) => format!("{path}, frame {frame}"),
                    Which::Segment(number) => format!("{path}, segment {number}"),
                }
            }
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
    /// Frame to read from a file with axes that are not in space, from 0, counted through them in the file's order.
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
    /// Whose it is and where it lies; `None` in formats that don't say so.
    pub origin: Option<Origin>,
}

/// Whose a file is, and which space it claims: what it says itself, each empty where it doesn't.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Name and identifier for messages.
    pub patient: String,
    /// The patient's name, its parts separated by spaces, family name first.
    pub patient_name: String,
    /// The patient's identifier.
    pub patient_id: String,
    /// `YYYYMMDD`.
    pub birth_date: String,
    /// `M`, `F` or `O`.
    pub sex: String,
    /// Study Description.
    pub study_description: String,
    /// Accession Number of the study.
    pub accession_number: String,
    /// Frame of Reference UID: positions in files of one are comparable.
    pub frame_of_reference: String,
}

impl Origin {
    /// Whether both name a patient, and not the same: by identifier or date of birth, as far as both state them.
    pub fn is_other_patient(&self, other: &Self) -> bool {
        let differs = |a: &str, b: &str| !a.is_empty() && !b.is_empty() && a != b;
        differs(&self.patient_id, &other.patient_id) || differs(&self.birth_date, &other.birth_date)
    }
}

/// A segmentation that its file names: it becomes one mask.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Segment {
    /// Its number in the file; unique there.
    pub number: i64,
    /// Its name; may be empty, and need not be unique.
    pub name: String,
    /// Its display colour, sRGB.
    pub color: Option<[u8; 3]>,
    /// The frame that holds it, see [`ReadOptions::frame`].
    pub frame: usize,
    /// Its label in that frame; `None`: every voxel above 0.5.
    pub label: Option<i64>,
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

/// An absolute path, by the current folder; as it is where that is unknown. Links are kept.
pub fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
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
