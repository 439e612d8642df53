//! Why a cohort can't be run, in one line.

use std::path::Path;

use glioscope_core::{
    Cancelled,
    case::CaseError,
    files::{FileError, printable},
};

/// Why a cohort can't be run, in one line.
#[derive(Debug, thiserror::Error)]
pub enum CohortError {
    /// The input or output is not as expected.
    #[error("{place}: found {found}, expected {expected}")]
    Wrong {
        /// The file, folder or option.
        place: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// A file can't be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A manifest is invalid.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl CohortError {
    /// At `place`, `found` instead of `expected`.
    pub fn wrong(place: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Wrong { place: place.into(), found: found.into(), expected: expected.into() }
    }

    /// [`CohortError::wrong`] for a file or folder.
    pub(crate) fn at(path: &Path, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::wrong(printable(&path.display().to_string()), found, expected)
    }

    /// Something at `path` failed for the system's reason.
    pub(crate) fn io(path: &Path, why: &std::io::Error, expected: &str) -> Self {
        Self::at(path, why.to_string(), expected)
    }
}
