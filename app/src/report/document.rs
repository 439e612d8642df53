//! What a report says, independent of its format: HTML, PDF and Markdown are written from the same parts.

use super::plot::Plot;

/// A part of a report.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// A section's heading.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// Findings, the most severe first.
    Findings(Vec<Finding>),
    /// Names with their values.
    Facts(Vec<(String, String)>),
    /// A table.
    Table(Table),
    /// A picture.
    Picture(Picture),
    /// A diagram of lines.
    Plot(Plot),
}

impl Block {
    /// The picture, if it is one.
    pub fn as_picture(&self) -> Option<&Picture> {
        match self {
            Self::Picture(picture) => Some(picture),
            _ => None,
        }
    }
}

/// A finding about the case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Whether it is a warning; a note otherwise.
    pub is_warning: bool,
    /// What was found.
    pub text: String,
}

/// A table. Every row has as many cells as there are columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// Names of the columns.
    pub head: Vec<String>,
    /// Number of columns from the left that hold text; the others hold numbers and are set flush right.
    pub text_columns: usize,
    /// The rows.
    pub rows: Vec<Vec<String>>,
    /// A note below it.
    pub note: Option<String>,
}

/// A picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Its name, unique in the report: `closeup`.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// Its size, pixels.
    pub size: [u32; 2],
    /// RGBA, 8 bits, row by row, opaque.
    pub rgba: Vec<u8>,
}

/// A report.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Its language as a code of two letters.
    pub language: String,
    /// Its title.
    pub title: String,
    /// Who read it, and when, where that is said.
    pub signed: Option<String>,
    /// Its parts in order.
    pub blocks: Vec<Block>,
    /// What it was made with, so that it can be made again.
    pub recipe: super::recipe::Recipe,
}
