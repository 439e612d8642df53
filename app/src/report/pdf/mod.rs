//! A report as one PDF file that can be kept and read aloud: PDF/A-3a and PDF/UA-1, with its fonts in it.

mod draft;
mod layout;
mod picture;
mod table;
mod text;
mod write;

use super::document::Report;
use crate::words::Words;

/// The report as PDF. The same report gives the same bytes; the date in it is a fixed one.
///
/// # Errors
/// What the writer finds that the standards forbid, and fonts that can't be read.
pub fn pdf(report: &Report, words: &Words) -> Result<Vec<u8>, String> {
    let fonts = text::Fonts::new()?;
    let own = draft::shown(&report.title);
    let title = if own.is_empty() { words.get("title") } else { own };
    let draft = layout::layout(report, &title, words, &fonts);
    write::write(&draft, report, &title, words)
}

#[cfg(test)]
mod tests;
