//! `glioscope page`: one HTML file for the patient to take home.

use std::path::PathBuf;

use clap::Args;
use glioscope_core::files::{absolute, read_small_text};

use super::{case::CaseArguments, terminal};
use crate::{
    command::Workstation, error::AppError, model::TakeHome, output, page, words::Language,
    world::take_home::page_of,
};

/// Maximum size of an edited text.
const MAX_TEXT_BYTES: u64 = 1 << 20;

/// Arguments of `page`.
#[derive(Debug, Args)]
pub struct PageArguments {
    /// The case; default: the embedded sample.
    #[command(flatten)]
    pub case: CaseArguments,
    /// The HTML file.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// The language.
    #[arg(long, value_enum, default_value_t)]
    pub language: Language,
    /// The masks' names; without it they are numbered.
    #[arg(long)]
    pub names: bool,
    /// The dates' labels; without it they are numbered.
    #[arg(long)]
    pub dates: bool,
    /// The image of slices and head; default: the first of each date.
    #[arg(long, value_name = "ID")]
    pub image: Option<String>,
    /// Text in place of the program's: paragraphs separated by empty lines, headings with #.
    #[arg(long, value_name = "FILE")]
    pub text: Option<PathBuf>,
    /// Also write the program's text to this file, to be edited and given to --text.
    #[arg(long, value_name = "FILE", conflicts_with = "text")]
    pub write_text: Option<PathBuf>,
    /// Write over files that exist.
    #[arg(long)]
    pub force: bool,
}

pub(super) fn run(arguments: &PageArguments) -> Result<(), AppError> {
    let PageArguments { case, out, language, names, dates, image, text, write_text, force } = arguments;
    page::check_ending(out)?;
    let text = text.as_ref().map(|path| read_small_text(path, MAX_TEXT_BYTES, "a text")).transpose()?;
    let setting = TakeHome { language: *language, has_names: *names, has_dates: *dates, text };
    let work = Workstation::with_opened(case.read(true)?.into());
    let (Some(case), Some(doc)) = (work.world.case(), &work.doc) else {
        return Err(AppError::arguments("no case", "a path, --mask and --context, or --sample"));
    };
    let mut outputs = std::iter::once(out).chain(write_text);
    outputs.try_for_each(|path| output::refuse(path, &case.inputs, *force))?;
    if write_text.as_ref().is_some_and(|path| absolute(path) == absolute(out)) {
        return Err(AppError::file(out, "the page and its words in one file", "two files"));
    }
    let content =
        terminal::with_progress(|progress| page_of(case, doc, &setting, image.as_deref(), progress))?;
    let words = page::words(*language);
    output::write(out, &case.inputs, page::page(&content, &words).as_bytes())?;
    if let Some(path) = write_text {
        output::write(path, &case.inputs, page::default_text(&content, &words).as_bytes())?;
    }
    terminal::print(&format!("page written to {}", out.display()))
}
