//! Why lesions can't be found.

use crate::{
    Cancelled, GridError, change::ChangeError, components::TooLarge, distance::DistanceError,
    skeleton::SkeletonError,
};

/// Why lesions can't be found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LesionsError {
    /// No date has the mask.
    #[error("{case}: found no mask {of} at any date, expected one of {known}")]
    NoMask {
        /// The case.
        case: String,
        /// The masks asked for.
        of: String,
        /// The masks that the case has.
        known: String,
    },
    /// An option is out of range.
    #[error("found {found}, expected {expected}")]
    Option {
        /// What was given.
        found: String,
        /// What is possible.
        expected: &'static str,
    },
    /// A mask has too many components or runs.
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    /// A distance can't be computed.
    #[error(transparent)]
    Distance(#[from] DistanceError),
    /// The cropped grid is invalid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A skeleton can't be computed.
    #[error(transparent)]
    Skeleton(SkeletonError),
    /// The movement of the surface can't be computed.
    #[error(transparent)]
    Change(#[from] ChangeError),
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<SkeletonError> for LesionsError {
    fn from(error: SkeletonError) -> Self {
        match error {
            SkeletonError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Skeleton(other),
        }
    }
}
