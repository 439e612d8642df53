//! The tables of a cohort: which there are, what their columns mean, and how they are written.

mod answers;
mod kinds;
mod read;
mod write;

use serde::Serialize;

pub(crate) use answers::{PairValue, pair_values, rows_of};
pub(crate) use kinds::{CHANGES, FAILURES, LESIONS, MASKS, PAIRS, RANKS, REGIONS, RESPONSES, TESTS};
pub use kinds::{Column, KINDS, Kind, Type};
pub(crate) use read::{Names, Table, Values, read as read_table};
pub(crate) use write::Writer;

/// One field of a row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Field {
    /// Not known, or not defined.
    Null,
    /// Text.
    Text(String),
    /// A whole number.
    Whole(i64),
    /// A number, infinite where a distance is.
    Number(f64),
    /// Yes or no.
    Bool(bool),
}

impl Field {
    /// Text, or null.
    pub(crate) fn text(text: Option<impl Into<String>>) -> Self {
        text.map_or(Self::Null, |text| Self::Text(text.into()))
    }

    /// A number, or null.
    pub(crate) fn number(number: Option<f64>) -> Self {
        number.map_or(Self::Null, Self::Number)
    }
}

/// What the tables of a cohort mean, as `dictionary.json` says it.
#[derive(Debug, Serialize)]
pub struct Dictionary {
    /// Version of the program.
    pub glioscope: String,
    /// The tables.
    pub tables: &'static [Kind],
}
