//! What became of lesions between two dates, as data.

use serde::Serialize;
use strum::IntoStaticStr;

/// What became of lesions between two dates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum EventKind {
    /// Linked to nothing at the date before.
    Born,
    /// Linked to nothing at the date after.
    Gone,
    /// One became one.
    Continued,
    /// One became several.
    Split,
    /// Several became one.
    Merged,
    /// Several became several others.
    ManyToMany,
}

/// An event between two dates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// What happened.
    pub kind: EventKind,
    /// Numbers of the earlier and the later date.
    pub dates: [usize; 2],
    /// Units ([`super::Tracked::units`]) of the earlier date; empty for births.
    pub from: Vec<usize>,
    /// Units of the later date; empty where gone.
    pub to: Vec<usize>,
    /// Number of the lesion.
    pub lesion: usize,
}
