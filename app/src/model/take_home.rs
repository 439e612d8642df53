//! The page that a patient takes home, as a doctor prepares it.

use serde::{Deserialize, Serialize};

use crate::words::Language;

/// The longest text of the page, characters.
pub const MOST_PAGE_TEXT: usize = 20_000;

/// What the page is written with.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TakeHome {
    /// Its language.
    pub language: Language,
    /// Whether masks have their names; else they are numbered.
    pub has_names: bool,
    /// Whether dates have their labels; else they are numbered.
    pub has_dates: bool,
    /// The doctor's words, paragraphs separated by empty lines and headings with `#`; `None`: the program's own.
    pub text: Option<String>,
}

impl TakeHome {
    /// Whether nothing was chosen.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
