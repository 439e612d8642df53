//! What the reader concludes, for the report.

use serde::{Deserialize, Serialize};

/// The longest name of a reader, characters.
pub const MOST_READER: usize = 100;
/// The longest conclusion, characters.
pub const MOST_CONCLUSION: usize = 4000;

/// The reader's words at the end of a reading.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reading {
    /// The conclusion; empty: none.
    pub conclusion: String,
    /// Who read it; empty: not said.
    pub reader: String,
    /// The day on which that was written, 2024-01-31; empty: not known.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub day: String,
}
