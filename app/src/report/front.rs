//! What stands in front of a report's pictures, and what a report is made of.

use std::sync::Arc;

use glioscope_core::{
    Check, Progress,
    case::{Case, OrderBasis},
    change::{self, ChangeReport, Choice},
    lesions::LesionsReport,
    measure::{self, DateComparison},
    self_check::{self, SelfCheckError, SelfCheckReport},
};

use super::{
    Options, calls_in_words,
    content::Content,
    document::Block,
    identity::{Identity, Redactor},
    responses, sentences, stated, targets,
};
use crate::{
    error::AppError,
    model::Document,
    words::{Language, Words},
    world::response::{Answered, answered_of},
};

/// What a report is made of that takes time to compute.
pub struct Found {
    /// Changes between the dates, and what they found.
    changes: Vec<ChangeReport>,
    own: Vec<Check>,
    compared: Vec<DateComparison>,
    lesions: Option<Arc<LesionsReport>>,
    /// The response that the document states, where none was given.
    pub(super) response: Option<Answered>,
    self_check: Option<SelfCheckReport>,
}

/// What stands before the pictures: with a response, the first page.
pub struct Front {
    /// The report's title.
    pub title: String,
    /// Its parts in order.
    pub blocks: Vec<Block>,
    /// What stands near the end: notes of the case.
    pub(super) notes: Vec<Block>,
}

impl Found {
    /// What is found of a case and its document, both as [`super::anonymous`] gives them; `answered`: their response, if it is known;
    /// `front_alone`: without what the first page doesn't say.
    ///
    /// # Errors
    /// [`AppError`] where something can't be computed; cancelled.
    pub fn of(
        case: &Arc<Case>,
        doc: &Document,
        answered: Option<&Answered>,
        front_alone: bool,
        progress: &Progress,
    ) -> Result<Self, AppError> {
        let (lesions, response) = answered_of(case, doc, answered, progress)?;
        // With a response, changes are said behind the first page.
        let has_response = answered.is_some() || response.is_some();
        let (changes, own) = changes(case, doc, !(front_alone && has_response), progress)?;
        let compared = measure::compared(case, &[], &doc.edit.agreement.settings(), progress)?;
        let self_check = self_checked(case, doc, progress)?;
        Ok(Self { changes, own, compared, lesions, response, self_check })
    }

    /// The first page of the report that `doc` gives, as text, to stand beside the conclusion.
    pub fn preview(&self, case: &Arc<Case>, doc: &Document, options: Options) -> Front {
        let words = sentences::words(options.language);
        let redactor = Redactor::new(case, options.identity, words.get("removed"));
        let content = self.content((case, doc), (&words, &redactor), options.identity);
        self.front(&content, self.response.as_ref(), true)
    }

    pub(super) fn content<'a>(
        &'a self,
        (case, doc): (&'a Case, &'a Document),
        (words, redactor): (&'a Words, &'a Redactor),
        identity: Identity,
    ) -> Content<'a> {
        Content {
            case,
            doc,
            self_check: self.self_check.as_ref(),
            changes: &self.changes,
            compared: &self.compared,
            lesions: self.lesions.as_deref(),
            words,
            redactor,
            identity,
        }
    }

    /// `is_beside`: its reader has the conclusion in front of him.
    pub(super) fn front(&self, content: &Content<'_>, answered: Option<&Answered>, is_beside: bool) -> Front {
        let Content { case, doc, words, redactor, identity, .. } = *content;
        let is_named = identity == Identity::Full;
        let evaluated = answered.map(|answered| &answered.evaluated);
        let mut blocks = content.header();
        let contradictions = evaluated.map_or(&[][..], |evaluated| &evaluated.contradictions);
        let reading = &doc.edit.reading;
        let in_words = |language| {
            let calls = calls_in_words(evaluated?, content.lesions, &sentences::words(language))?;
            Some(redactor.text(&calls))
        };
        // Sentences of a language are parsed only where some were taken over.
        let repeated = (!reading.taken.is_empty()).then(|| {
            let [en, de] = [Language::En, Language::De].map(in_words);
            let own = match words.language() {
                Language::En => en.clone(),
                Language::De => de.clone(),
            };
            let now = [en, de];
            let of_another_language = reading.is_in_another_language(&now, own.as_deref());
            let is_old = reading.repeats_old_calls(&now);
            [(is_old, "conclusion-old"), (of_another_language, "conclusion-other-language")]
        });
        let repeated = repeated.into_iter().flatten().filter(|(is_so, _)| *is_so);
        let old_calls: Vec<String> = repeated.map(|(_, key)| words.get(key)).collect();
        let contradictions: Vec<String> =
            contradictions.iter().map(|phrase| sentences::phrase(phrase, words)).collect();
        let missing = evaluated.map_or(0, |evaluated| evaluated.response.missing_answers());
        let missing = (missing > 0).then(|| words.with("answers-missing", &[("count", missing.to_string())]));
        let own_warnings = [contradictions, old_calls, missing.into_iter().collect()].concat();
        // With a call, the first page is for it: why, of which lesions, and what the reader stated.
        let of_response = answered.map(|answered| {
            let evaluated = &answered.evaluated;
            let of_two_scans = targets::of_two_scans(answered, words, redactor);
            let others =
                if of_two_scans.is_some() { Vec::new() } else { targets::blocks(answered, words, redactor) };
            let mut of = responses::blocks(evaluated, content.lesions, of_two_scans, words, redactor);
            of.extend(others);
            of.extend(stated::blocks(&evaluated.stated, words, redactor, is_named));
            of
        });
        let is_doubt =
            |block: &Block| matches!(block, Block::Findings(all) if all.iter().any(|one| one.is_warning));
        let has_doubts = of_response.iter().flatten().any(is_doubt);
        let (warnings, notes) = content.findings(&self.own, &own_warnings, has_doubts);
        blocks.extend(warnings);
        blocks.extend(content.conclusion(is_beside));
        match of_response {
            Some(of_response) => blocks.extend(of_response),
            None => blocks.extend(content.summary(true)),
        }
        let title = match evaluated {
            Some(evaluated) => {
                let criteria = evaluated.response.criterion.name().to_owned();
                words.with("title-response", &[("criteria", criteria)])
            }
            None if case.time_points.len() > 1 && case.mask_ids().len() == 1 => words.get("title-dates"),
            None => words.get("title"),
        };
        let title = match is_named {
            true => words.with("title-of", &[("title", title), ("case", case.name.clone())]),
            false => title,
        };
        Front { title, blocks, notes }
    }
}

/// Changes of the compared mask between consecutive dates, and from the first to the last; with what they found. `with_tissue`: with the
/// tissue around what moved, which takes seconds.
fn changes(
    case: &Arc<Case>,
    doc: &Document,
    with_tissue: bool,
    progress: &Progress,
) -> Result<(Vec<ChangeReport>, Vec<Check>), AppError> {
    let Ok(whole) = doc.edit.change.chosen(case) else { return Ok(Default::default()) };
    let last = case.time_points.len() - 1;
    let mut pairs: Vec<[usize; 2]> = (0..last).map(|n| [n, n + 1]).collect();
    if case.order == OrderBasis::Unknown {
        pairs.clear();
    }
    if pairs.last() != Some(&whole.dates) {
        pairs.push(whole.dates);
    }
    let options = doc.edit.change.options();
    let (mut reports, mut found) = (Vec::new(), Vec::new());
    for dates in pairs {
        // A date may lack the mask.
        let Ok(choice) = Choice::at(case, Some(&whole.id), dates) else { continue };
        let report = match with_tissue {
            true => change::between_with_surroundings(case, &choice, &options, None, progress)?.0,
            false => change::between(case, &choice, &options, None, progress)?.0,
        };
        found.extend(report.own_warnings(case).iter().cloned());
        reports.push(report);
    }
    Ok((reports, found))
}

/// The check of the comparison on this case, where it is asked for and can be done.
fn self_checked(
    case: &Case,
    doc: &Document,
    progress: &Progress,
) -> Result<Option<SelfCheckReport>, AppError> {
    let setting = &doc.edit.change;
    let Some(choice) = setting.chosen(case).ok().filter(|_| setting.self_check) else { return Ok(None) };
    let options = self_check::Options::of(setting.options());
    match self_check::self_check(case, &self_check::Target::of(&choice), &options, progress) {
        Ok(report) => Ok(Some(report)),
        // Both dates may be empty.
        Err(SelfCheckError::Empty) => Ok(None),
        Err(error) => Err(error.into()),
    }
}
