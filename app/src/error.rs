//! The error type of the window and the command line; each error displays as one line.

use std::path::Path;

use glioscope_cohort::CohortError;
use glioscope_core::{
    Cancelled, case::CaseError, change::ChangeError, distance::DistanceError, ellipsoid::EllipsoidError,
    files::FileError, lesions::LesionsError, self_check::SelfCheckError, tumor_index::IndexError,
};
use glioscope_render::{GpuError, RenderError};

use crate::page::PageError;

/// Why an operation failed.
#[derive(Debug, thiserror::Error)]
pub enum AppError {
    /// A file can't be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// No copy of unsaved work can be kept.
    #[error("unsaved work is not kept safe: {0}")]
    Unkept(FileError),
    /// A case can't be opened.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// Two time points can't be compared.
    #[error(transparent)]
    Change(#[from] ChangeError),
    /// The case can't check itself.
    #[error(transparent)]
    SelfCheck(#[from] SelfCheckError),
    /// Two masks or regions can't be compared: which and why, in one line.
    #[error("{0}")]
    Compared(String),
    /// Lesions can't be found.
    #[error(transparent)]
    Lesions(#[from] LesionsError),
    /// The page to take home can't be made.
    #[error(transparent)]
    Page(#[from] PageError),
    /// Ellipsoids can't be computed.
    #[error("ellipsoids: {0}")]
    Ellipsoids(#[from] EllipsoidError),
    /// Distances of fibres can't be computed.
    #[error(transparent)]
    Distance(#[from] DistanceError),
    /// A tumour index can't be built.
    #[error(transparent)]
    Index(#[from] IndexError),
    /// A frame can't be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// No usable graphics adapter or device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// A server of an archive can't be used.
    #[error(transparent)]
    Pacs(#[from] glioscope_pacs::Error),
    /// A cohort can't be run.
    #[error(transparent)]
    Cohort(#[from] CohortError),
    /// Some cases of a cohort failed; which, as a sentence.
    #[error("{0}")]
    CasesFailed(String),
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Any other invalid input, or a failure without an error type of its own.
    #[error("{place}: found {found}, expected {expected}")]
    Wrong {
        /// The file, option or part of the program.
        place: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// The window can't be opened.
    #[error(
        "the window can't be opened ({0}); a display is needed, and a Vulkan driver: on Debian or Ubuntu install \
         mesa-vulkan-drivers and libvulkan1"
    )]
    Window(String),
    /// A result is unavailable; why, as a sentence for the pane that would show it.
    #[error("{0}")]
    Unavailable(&'static str),
}

impl AppError {
    /// The program's exit code: 1 where some cases of a cohort failed, else 2.
    pub fn exit_code(&self) -> u8 {
        if matches!(self, Self::CasesFailed(_)) { 1 } else { 2 }
    }

    /// An [`AppError::Wrong`]: at `place`, `found` instead of `expected`.
    pub fn wrong(place: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Wrong { place: place.into(), found: found.into(), expected: expected.into() }
    }

    /// [`AppError::wrong`] for a file.
    pub fn file(path: &Path, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::wrong(path.display().to_string(), found, expected)
    }

    /// [`AppError::wrong`] for an option of the command line, given without its dashes.
    pub fn option(name: &str, found: &str, expected: impl Into<String>) -> Self {
        Self::wrong(format!("--{name}"), format!("\"{found}\""), expected)
    }

    /// [`AppError::wrong`] for the arguments as a whole.
    pub fn arguments(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::wrong("arguments", found, expected)
    }
}
