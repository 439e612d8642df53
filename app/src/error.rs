//! Why something that was asked for can't be done, as one line for people.

use std::path::Path;

use glioscope_core::{
    Cancelled, case::CaseError, change::ChangeError, distance::DistanceError, ellipsoid::EllipsoidError,
    files::FileError, tumor_index::IndexError,
};
use glioscope_render::{GpuError, RenderError};

/// Why something can't be done.
#[derive(Debug, thiserror::Error)]
pub enum AppError {
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// A case.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// Two dates.
    #[error(transparent)]
    Change(#[from] ChangeError),
    /// Ellipsoids.
    #[error("ellipsoids: {0}")]
    Ellipsoids(#[from] EllipsoidError),
    /// Distances of fibres.
    #[error(transparent)]
    Distance(#[from] DistanceError),
    /// A tumour index.
    #[error(transparent)]
    Index(#[from] IndexError),
    /// A picture.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The graphics adapter.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Something else that was given.
    #[error("{place}: found {found}, expected {expected}")]
    Wrong {
        /// The file, option or part of the program.
        place: String,
        /// What is there.
        found: String,
        /// What should be.
        expected: String,
    },
    /// The window can't be opened.
    #[error(
        "the window can't be opened ({0}); a display is needed, and a Vulkan driver: on Debian or Ubuntu install \
         mesa-vulkan-drivers and libvulkan1"
    )]
    Window(String),
    /// A result has no reason to wait for, in a sentence for the pane that would show it.
    #[error("{0}")]
    Nothing(&'static str),
}

impl AppError {
    /// At `place` is `found` instead of `expected`.
    pub fn wrong(place: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Wrong { place: place.into(), found: found.into(), expected: expected.into() }
    }

    /// As [`AppError::wrong`] for a file.
    pub fn file(path: &Path, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::wrong(path.display().to_string(), found, expected)
    }

    /// As [`AppError::wrong`] for an option of the command line.
    pub fn option(name: &str, found: &str, expected: impl Into<String>) -> Self {
        Self::wrong(format!("--{name}"), format!("\"{found}\""), expected)
    }

    /// As [`AppError::wrong`] for arguments as a whole.
    pub fn arguments(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::wrong("arguments", found, expected)
    }
}
