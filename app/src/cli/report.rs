//! `glioscope report`: a case as one file that is handed over, or as a folder of pictures and numbers.

use glioscope_core::{case::Case, files::Inputs};

use super::{arguments::ReportArguments, offscreen::gpu, report_folder, terminal};
use crate::{
    command::Workstation,
    error::AppError,
    model::Document,
    output,
    report::{self, Form, Options, Report},
    window::offscreen_app::OffscreenApp,
    world::{Loaded, World, load::ReadCase},
};

pub(super) fn run(arguments: &ReportArguments) -> Result<(), AppError> {
    let ReportArguments { case, out, identity, language, force, software } = arguments;
    let Some(form) = Form::of(out) else {
        let options = [("identity", identity.is_some()), ("language", language.is_some())];
        if let Some((option, _)) = options.into_iter().find(|(_, given)| *given) {
            return Err(AppError::option(option, "a folder", "a file: --out FILE.html, FILE.pdf or FILE.md"));
        }
        if out.extension().is_some() && !out.is_dir() {
            return Err(AppError::file(out, "a file of another kind", ".html, .pdf, .md, or a folder"));
        }
        return report_folder::run(case, out, *software);
    };
    let read = case.read(true)?;
    let inputs = inputs(&read.case, case.path.as_deref());
    output::refuse(out, &inputs, *force)?;
    let options = Options { identity: identity.unwrap_or_default(), language: language.unwrap_or_default() };
    let report = make(read, options, *software)?;
    let bytes = report::write(&report, form, options.language)?;
    output::write(out, &inputs, &bytes)?;
    terminal::print(&format!("report written to {}", out.display()))
}

/// The files that aren't written over: those of the case, and the session.
fn inputs(case: &Case, path: Option<&std::path::Path>) -> Inputs {
    path.into_iter().fold(case.inputs.clone(), |inputs, path| inputs.with(path.to_owned()))
}

/// The report of a case.
pub(super) fn make(read: ReadCase, options: Options, software: bool) -> Result<Report, AppError> {
    let work = Workstation::with_opened(read.into());
    let (Some(case), Some(doc)) = (work.world.case(), work.doc) else {
        return Err(AppError::arguments("no case", "a path, --mask and --context, or --sample"));
    };
    let (case, doc) = report::anonymous(case, doc, options)?;
    of_anonymous(case, &doc, options, software)
}

/// The report of a case and document that have no more of the identity than it may show.
pub(super) fn of_anonymous(
    case: Case,
    doc: &Document,
    options: Options,
    software: bool,
) -> Result<Report, AppError> {
    let loaded = Loaded::new(case);
    let case = loaded.case.clone();
    let work = Workstation { doc: Some(doc.clone()), world: World::new(loaded), ..Workstation::default() };
    terminal::with_progress(|progress| {
        let mut app = OffscreenApp::new(work, &gpu(software)?, false)?;
        report::make((&case, doc), options, &mut app, progress)
    })
}
