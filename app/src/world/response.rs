//! Response by criteria, evaluated on a worker from the lesions and what the reader states.

use std::{collections::BTreeMap, sync::Arc};

use glioscope_core::{
    Progress,
    case::Case,
    lesions::{Anchor, LesionsReport},
    response::{Compartment, Evaluated, History, HistoryError, evaluate_lesions, measured_compartments},
};

use super::{
    jobs::{Ask, Derived, Handle, Lookup},
    lesions::Lesions,
};
use crate::{
    error::AppError,
    model::{Document, LesionSetting, ResponseSetting},
};

type Reports = Vec<(Compartment, Arc<LesionsReport>)>;

/// A response, and the lesions that it was evaluated of, by compartment: those of the case first.
#[derive(Clone)]
pub struct Answered {
    /// The response.
    pub evaluated: Evaluated,
    /// The lesions.
    pub lesions: Vec<(Compartment, Arc<LesionsReport>)>,
}

impl Answered {
    /// The lesions of the case.
    pub fn main(&self) -> Option<&Arc<LesionsReport>> {
        self.lesions.first().map(|(_, report)| report)
    }
}

/// What a response is evaluated of.
#[derive(PartialEq)]
struct Key {
    reports: Vec<(Compartment, Handle<LesionsReport>)>,
    history: History,
    named_at: BTreeMap<String, Anchor>,
}

/// The response last requested.
#[derive(Default)]
pub struct Responses {
    /// Lesions of the mask of non-enhancing disease.
    other: Lesions,
    result: Derived<Key, Evaluated>,
}

impl Responses {
    /// The response of `case` as `doc` states it; `None` without criteria or masks. `main`: the lesions of the case.
    pub fn get(
        &mut self,
        case: &Arc<Case>,
        doc: &Document,
        main: &mut Lesions,
        ask: &Ask,
    ) -> Option<Lookup<'_, Evaluated>> {
        let history = doc.edit.response.history.as_ref()?;
        let change = &doc.edit.change;
        let mut reports: Reports = Vec::new();
        for (compartment, setting) in measured(case, doc, history) {
            let is_main = setting == doc.edit.lesions;
            let lesions = if is_main { &mut *main } else { &mut self.other };
            match lesions.get(case, (&setting, change), ask)? {
                Lookup::Ready(report) => reports.push((compartment, report.clone())),
                // What is shown meanwhile is the lesions' own state.
                Lookup::Working(_) | Lookup::Failed(_) => return None,
            }
        }
        let key = Key {
            reports: reports.iter().map(|(compartment, report)| (*compartment, Handle::of(report))).collect(),
            history: history.clone(),
            named_at: doc.edit.response.named_at.clone(),
        };
        let (history, own) = (history.clone(), doc.edit.response.clone());
        Some(self.result.get(key, ask, move |_| evaluated(history, &own, &reports)))
    }

    /// The response last evaluated, which may be for older statements.
    pub fn last(&self) -> Option<&Arc<Evaluated>> {
        self.result.last()
    }

    /// Whether a worker is computing it.
    pub fn working(&mut self) -> bool {
        // Each takes what is finished.
        self.other.working() | self.result.working()
    }
}

/// The response of `case` as `doc` states it, at once; `None` without criteria or masks. `main`: the lesions of the document, where
/// they are known.
///
/// # Errors
/// [`AppError`] where lesions can't be found, for statements that contradict each other, and where the user cancels.
fn evaluate_now(
    case: &Case,
    doc: &Document,
    main: Option<&Arc<LesionsReport>>,
    progress: &Progress,
) -> Result<Option<Answered>, AppError> {
    let Some(history) = &doc.edit.response.history else { return Ok(None) };
    let mut reports: Reports = Vec::new();
    for (compartment, setting) in measured(case, doc, history) {
        let known = main.filter(|_| setting == doc.edit.lesions).cloned();
        let found = || Ok::<_, AppError>(setting.report(case, &doc.edit.change, progress)?.map(Arc::new));
        let Some(report) = known.map_or_else(found, |report| Ok(Some(report)))? else { return Ok(None) };
        reports.push((compartment, report));
    }
    let evaluated = evaluated(history.clone(), &doc.edit.response, &reports)?;
    Ok(Some(Answered { evaluated, lesions: reports }))
}

/// The lesions to show beside a response, and the response that the document states where none is `given`: lesions that calls rest on are those
/// of the calls.
///
/// # Errors
/// [`AppError`] where lesions can't be found, for statements that contradict each other, and where the user cancels.
pub fn answered_of(
    case: &Case,
    doc: &Document,
    given: Option<&Answered>,
    progress: &Progress,
) -> Result<(Option<Arc<LesionsReport>>, Option<Answered>), AppError> {
    if let Some(main) = given.and_then(Answered::main) {
        return Ok((Some(main.clone()), None));
    }
    let lesions = doc.edit.lesions.report(case, &doc.edit.change, progress)?.map(Arc::new);
    let own = match given {
        Some(_) => None,
        None => evaluate_now(case, doc, lesions.as_ref(), progress)?,
    };
    Ok((lesions, own))
}

/// The compartments measured, each with the setting of its lesions.
fn measured(case: &Case, doc: &Document, history: &History) -> Vec<(Compartment, LesionSetting)> {
    let main = &doc.edit.lesions;
    let other = doc.edit.response.other_mask(case);
    let other =
        other.map(|id| LesionSetting { of: Some(id.clone()), image: None, surface: false, ..main.clone() });
    let setting = |compartment: Compartment| match &other {
        Some(other) if compartment == Compartment::NonEnhancing => other.clone(),
        _ => main.clone(),
    };
    measured_compartments(history, other.is_some()).iter().map(|c| (*c, setting(*c))).collect()
}

fn evaluated(mut history: History, own: &ResponseSetting, reports: &Reports) -> Result<Evaluated, AppError> {
    if let Some((_, main)) = reports.first() {
        own.follow_targets(&mut history, main)?;
    }
    let reports: Vec<(Compartment, &LesionsReport)> =
        reports.iter().map(|(compartment, report)| (*compartment, report.as_ref())).collect();
    let wrong = |HistoryError { place, found, expected }| AppError::wrong(place, found, expected);
    evaluate_lesions(history, &reports).map_err(wrong)
}
