//! The file of a report, in any of its forms.

use std::sync::Arc;

use glioscope_core::{Progress, case::Case};
use glioscope_render::Gpu;

use super::{
    numbers::{Shown, as_file},
    offscreen_app::OffscreenApp,
};
use crate::{
    command::Workstation,
    error::AppError,
    model::Document,
    report::{self, Anonymous, FileKind, Filing, Form, Options, Recipe, Report, ResponseRecipe},
    world::{Loaded, World, load::ReadCase, response::Answered},
};

/// A report's file.
pub struct ReportFile {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// What was assumed, for the user.
    pub notes: Vec<String>,
    /// What it was made with, where it has that in it.
    pub recipe: Option<Recipe>,
}

/// What a file is asked for with.
pub struct Asked<'a> {
    /// Its kind.
    pub kind: FileKind,
    /// How much it says.
    pub options: Options,
    /// The response that it has, in place of what its document states.
    pub response: Option<&'a (Answered, ResponseRecipe)>,
    /// What its DICOM objects state.
    pub filing: &'a dyn Fn() -> Result<Filing, AppError>,
    /// What draws its pictures.
    pub gpu: &'a dyn Fn() -> Result<Gpu, AppError>,
}

/// The file of a case and document that have no more of the identity than it may show ([`report::anonymous`]).
///
/// # Errors
/// As [`report::make`]; where a DICOM object can't be written.
pub fn file_of(
    case: &Arc<Case>,
    doc: &Document,
    asked: &Asked<'_>,
    progress: &Progress,
) -> Result<ReportFile, AppError> {
    let Asked { kind, options, response, .. } = *asked;
    let pages = |form: Form| -> Result<(Vec<u8>, Report), AppError> {
        let report = pages_of(case, doc, (options, form), response, &(asked.gpu)()?, progress)?;
        Ok((report::write(&report, form, options.language)?, report))
    };
    Ok(match kind {
        FileKind::Pages(form) => {
            let (bytes, report) = pages(form)?;
            ReportFile { bytes, notes: Vec::new(), recipe: Some(report.recipe) }
        }
        FileKind::EncapsulatedPdf => {
            let filing = (asked.filing)()?;
            let (pdf, report) = pages(Form::Pdf)?;
            let bytes = filing.encapsulated(&pdf, &report.title)?;
            ReportFile { bytes, notes: filing.notes, recipe: Some(report.recipe) }
        }
        FileKind::Structured => {
            let filing = (asked.filing)()?;
            let answered = response.map(|(answered, _)| answered);
            let bytes = report::structured(case, doc, &filing, answered, progress)?;
            ReportFile { bytes, notes: filing.notes, recipe: None }
        }
        FileKind::Numbers(format) => {
            let numbers = Shown::of(case, doc, response.map(|(answered, _)| answered.clone()));
            let numbers = report::without_identity(case, options, numbers.json(progress)?);
            ReportFile { bytes: as_file(&numbers, format)?, notes: Vec::new(), recipe: None }
        }
    })
}

/// A case that was read and its document as its report may show them.
///
/// # Errors
/// [`AppError`] where the document can't be renamed.
pub fn shown(read: ReadCase, options: Options) -> Result<Anonymous, AppError> {
    let work = Workstation::with_opened(read.into());
    let (Some(case), Some(doc)) = (work.world.case(), work.doc) else {
        return Err(AppError::arguments("no case", "a path, --mask and --context, or --sample"));
    };
    report::anonymous(case, doc, options)
}

/// What draws the panes of a case as its document shows them.
///
/// # Errors
/// [`AppError`] where the adapter can't.
pub fn painter(case: &Arc<Case>, doc: &Document, gpu: &Gpu) -> Result<OffscreenApp, AppError> {
    let loaded = Loaded::with_made(case.clone(), Vec::new(), case.clone());
    let work = Workstation { doc: Some(doc.clone()), world: World::new(loaded), ..Workstation::default() };
    OffscreenApp::new(work, gpu, false)
}

fn pages_of(
    case: &Arc<Case>,
    doc: &Document,
    options: (Options, Form),
    response: Option<&(Answered, ResponseRecipe)>,
    gpu: &Gpu,
    progress: &Progress,
) -> Result<Report, AppError> {
    report::make((case, doc), options, response, &mut painter(case, doc, gpu)?, progress)
}
