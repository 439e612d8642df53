//! What a user says about lesions, as plain data: a session keeps the list, undo takes the last away.

use crate::glam::DVec3;
use serde::{Deserialize, Serialize};

/// The farthest that a place may lie from a component and still mean it: masks are corrected by a voxel or two.
pub(super) const ANCHOR_MM: f64 = 3.0;

/// A component, by a place in it: this survives another order of masks, dates and components, unlike a number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Anchor {
    /// Label of the date.
    pub time: String,
    /// The mask, or of a union [`super::Of::name`].
    pub of: String,
    /// A place inside the component, RAS+ millimetres.
    pub at_mm: DVec3,
}

/// One edit. They apply in the order of the list, but for splits, which come first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "edit", rename_all = "snake_case")]
pub enum Edit {
    /// Both are one lesion, of two dates.
    Link {
        /// One.
        from: Anchor,
        /// The other.
        to: Anchor,
    },
    /// They are not.
    Unlink {
        /// One.
        from: Anchor,
        /// The other.
        to: Anchor,
    },
    /// Both, of one date, are one lesion.
    Merge {
        /// One.
        from: Anchor,
        /// The other.
        to: Anchor,
    },
    /// The component is two lesions, parted at the neck between these places: a watershed of the distance to its surface.
    Split {
        /// The component.
        at: Anchor,
        /// A place in each, RAS+ millimetres.
        seeds_mm: [DVec3; 2],
    },
    /// The component is no lesion: it doesn't count.
    Ignore {
        /// The component.
        at: Anchor,
    },
    /// The lesion's name.
    Name {
        /// One of its components.
        at: Anchor,
        /// What it is called.
        name: String,
    },
    /// The link is right.
    Verify {
        /// One.
        from: Anchor,
        /// The other.
        to: Anchor,
    },
    /// All links at this point of the list are right.
    VerifyAll,
}

impl Edit {
    /// A component that it is about; `None` where it is about all.
    pub fn anchor(&self) -> Option<&Anchor> {
        match self {
            Self::Link { from, .. }
            | Self::Unlink { from, .. }
            | Self::Merge { from, .. }
            | Self::Verify { from, .. } => Some(from),
            Self::Split { at, .. } | Self::Ignore { at } | Self::Name { at, .. } => Some(at),
            Self::VerifyAll => None,
        }
    }

    /// All places that it names, RAS+ millimetres.
    pub fn places_mm(&self) -> Vec<DVec3> {
        match self {
            Self::Link { from, to }
            | Self::Unlink { from, to }
            | Self::Merge { from, to }
            | Self::Verify { from, to } => vec![from.at_mm, to.at_mm],
            Self::Split { at, seeds_mm: [a, b] } => vec![at.at_mm, *a, *b],
            Self::Ignore { at } | Self::Name { at, .. } => vec![at.at_mm],
            Self::VerifyAll => Vec::new(),
        }
    }
}

/// An edit that has no effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotApplied {
    /// Its position in the list of edits, from 0.
    pub number: usize,
    /// The edit.
    pub edit: Edit,
    /// Why: what was found and what was expected.
    pub reason: String,
}
