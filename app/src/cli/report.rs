//! `glioscope report`: a case as one file that is handed over, or as a folder of pictures and numbers.

use std::{collections::BTreeMap, sync::Arc};

use glioscope_core::{
    case::{Case, CaseSpec},
    files::sha256,
};

use super::{
    arguments::ReportArguments,
    lesions::{Diameters, LesionOptions},
    offscreen::gpu,
    report_folder,
    response::{ResponseOptions, evaluated},
    terminal,
};
use crate::{
    error::AppError,
    model::{Document, LesionSetting},
    output,
    report::{Anonymous, FileKind, Filing, Identity, Options, ResponseRecipe},
    window::report_file::{self, ReportFile},
    world::{load::ReadCase, response::Answered},
};

pub(super) fn run(arguments: &ReportArguments) -> Result<(), AppError> {
    let ReportArguments { case, out, identity, name_reader, language, response, self_check, force, software } =
        arguments;
    let Some(kind) = FileKind::of(out) else {
        let options = [
            ("language", language.is_some()),
            ("criteria", response.criteria.is_some()),
            ("history", response.history.is_some()),
            ("self-check", *self_check),
        ];
        if let Some((option, _)) = options.into_iter().find(|(_, given)| *given) {
            return Err(AppError::option(option, "a folder", format!("a file: {}", FileKind::ENDINGS)));
        }
        if out.extension().is_some() && !out.is_dir() {
            let expected = format!("{}, or a folder", FileKind::ENDINGS);
            return Err(AppError::file(out, "a file of another kind", expected));
        }
        return report_folder::run(case, out, *identity, *force, *software);
    };
    let options = Options {
        identity: identity.unwrap_or_default(),
        language: language.unwrap_or_default(),
        names_reader: *name_reader,
    };
    kind.check_language(options.language)?;
    let asked = Asked::of(response)?;
    let read = case.read(true)?;
    let inputs = [&case.path, &response.history].into_iter().flatten();
    let inputs = inputs.fold(read.case.inputs.clone(), |inputs, path| inputs.with(path.clone()));
    output::refuse(out, &inputs, *force)?;
    let made = file(read, &How { kind, options, self_check: *self_check, software: *software }, asked)?;
    made.notes.iter().for_each(|note| terminal::assumed(note));
    output::write(out, &inputs, &made.bytes)?;
    terminal::print(&format!("report written to {}", out.display()))
}

/// How a report is made.
#[derive(Clone, Copy)]
pub(super) struct How {
    /// The kind of its file.
    pub kind: FileKind,
    /// How much it says.
    pub options: Options,
    /// Whether the change is checked on the case, if its document doesn't ask for it.
    pub self_check: bool,
    /// Whether only the software adapter draws.
    pub software: bool,
}

/// The response that a report is to have.
pub(super) struct Asked {
    options: ResponseOptions,
    /// The text of the history.
    text: Option<String>,
}

impl Asked {
    fn of(options: &ResponseOptions) -> Result<Option<Self>, AppError> {
        let ResponseOptions { assessment, non_enhancing, lesions, .. } = options;
        let of_lesions = !lesions.of.is_empty()
            || lesions.smallest.is_some()
            || lesions.within.is_some()
            || lesions.diameters != Diameters::default();
        let of_response = assessment.is_some() || !non_enhancing.is_empty() || of_lesions;
        if of_response && !options.is_asked() {
            return Err(AppError::arguments(
                "options of a response without criteria",
                "--criteria, or --history with a criterion",
            ));
        }
        let text = options.history_text()?;
        Ok(options.is_asked().then(|| Self { options: options.clone(), text }))
    }

    /// That of an earlier report.
    /// `text`: the history where the recipe doesn't have it.
    pub(super) fn of_recipe(recipe: &ResponseRecipe, text: Option<String>) -> Self {
        let diameters = if recipe.largest_product { Diameters::LargestProduct } else { Diameters::default() };
        let lesions = LesionOptions {
            of: recipe.of.clone(),
            smallest: Some(recipe.smallest_ml),
            within: Some(recipe.within_mm),
            diameters,
        };
        let options = ResponseOptions {
            criteria: recipe.criteria,
            assessment: recipe.assessment,
            history: None,
            non_enhancing: recipe.non_enhancing.clone(),
            lesions,
        };
        Self { options, text: text.or_else(|| recipe.history.clone()) }
    }

    fn recipe(&self, identity: Identity, setting: &LesionSetting) -> ResponseRecipe {
        let LesionOptions { of, diameters, .. } = &self.options.lesions;
        let LesionSetting { smallest_ml, within_mm, .. } = self.options.lesions.or(setting);
        ResponseRecipe {
            criteria: self.options.criteria,
            assessment: self.options.assessment,
            history: self.text.clone().filter(|_| identity == Identity::Full),
            history_sha256: self.text.as_ref().map(|text| sha256(text.as_bytes())),
            of: of.clone(),
            non_enhancing: self.options.non_enhancing.clone(),
            smallest_ml,
            within_mm,
            largest_product: *diameters == Diameters::LargestProduct,
        }
    }

    /// With the names that masks have in the report.
    fn renamed(mut self, names: &BTreeMap<String, String>) -> Self {
        let masks = self.options.lesions.of.iter_mut().chain(&mut self.options.non_enhancing);
        for id in masks {
            if let Some(new) = names.get(id) {
                id.clone_from(new);
            }
        }
        self
    }
}

/// The file of a case's report.
pub(super) fn file(read: ReadCase, how: &How, asked: Option<Asked>) -> Result<ReportFile, AppError> {
    let (opened, spec) = (read.case.clone(), read.spec.clone());
    let Anonymous { case, mut doc, names } = report_file::shown(read, how.options)?;
    doc.edit.change.self_check |= how.self_check;
    file_of_anonymous((&opened, &spec), (&case, &doc), how, asked.map(|asked| asked.renamed(&names)).as_ref())
}

/// The file of the report of a case and document that have no more of the identity than it may show; `opened`: the case as it was read.
pub(super) fn file_of_anonymous(
    (opened, spec): (&Case, &CaseSpec),
    (case, doc): (&Arc<Case>, &Document),
    how: &How,
    asked: Option<&Asked>,
) -> Result<ReportFile, AppError> {
    let How { kind, options, software, .. } = *how;
    let hides_authors = options.identity != Identity::Full;
    let evaluate = |asked: &Asked| -> Result<(Answered, ResponseRecipe), AppError> {
        let found = evaluated(
            case,
            (&doc.edit.lesions, &doc.edit.response),
            &asked.options,
            asked.text.as_deref(),
            hides_authors,
        )?;
        Ok((found, asked.recipe(options.identity, &doc.edit.lesions)))
    };
    let response = asked.map(evaluate).transpose()?;
    terminal::with_progress(|progress| {
        let filing = || Filing::of(opened, spec, options.identity, progress);
        let gpu = || gpu(software);
        let asked =
            report_file::Asked { kind, options, response: response.as_ref(), filing: &filing, gpu: &gpu };
        report_file::file_of(case, doc, &asked, progress)
    })
}
