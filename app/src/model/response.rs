//! What a reader states for the response criteria.

use std::collections::BTreeMap;

use glioscope_core::{
    case::{Case, TimePoint},
    dates::leading_date,
    lesions::{Anchor, LesionsReport},
    response::{Assessment, Criterion, Fact, History, Label, Stated, name_of},
};
use serde::{Deserialize, Serialize};

use crate::error::AppError;

/// The longest name of an author, characters.
pub const MOST_AUTHOR: usize = 100;
/// The most dates with answers of BT-RADS.
pub const MOST_ANSWERED: usize = 1000;
/// The most answers of BT-RADS that are kept.
pub const MOST_ANSWERS: usize = 10_000;

/// The response that is evaluated, and what its reader states.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResponseSetting {
    /// Criteria, and what images don't show; `None`: no response is evaluated.
    pub history: Option<History>,
    /// The mask of non-enhancing disease, by id, where that is assessed besides the lesions' mask.
    pub non_enhancing: Option<String>,
    /// Who states it.
    pub author: String,
    /// Where the lesions lie that are named as targets or as not: a letter may come to mean another lesion.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub named_at: BTreeMap<String, Anchor>,
    /// Answers to the questions of BT-RADS, by label of the date and key of the question.
    #[serde(default)]
    pub bt_rads: BTreeMap<String, BTreeMap<String, String>>,
    /// Who gave the last of these answers, and when, by label of the date.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub bt_rads_by: BTreeMap<String, Stated>,
}

/// What the last report had, for the case that is opened next.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Usual {
    /// Its criteria; `None`: it had none.
    pub criterion: Option<Criterion>,
    /// Who stated or signed last; empty: nobody did.
    pub reader: String,
}

impl ResponseSetting {
    /// With these criteria and what was stated before; `None`: no response.
    pub fn set_criterion(&mut self, criterion: Option<Criterion>) {
        let Some(criterion) = criterion else {
            self.history = None;
            return;
        };
        let assessment = (criterion == Criterion::Rano20).then_some(Assessment::Enhancing);
        match &mut self.history {
            Some(history) => (history.criterion, history.assessment) = (criterion, assessment),
            None => self.history = Some(History::new(criterion, assessment)),
        }
    }

    /// Chooses criteria for the lesions of `mask`, with a proposed baseline.
    pub fn judge_by(&mut self, criterion: Criterion, case: &Case, mask: Option<&str>) {
        self.set_criterion(Some(criterion));
        self.propose_baseline(case, mask);
    }

    /// Proposes the baseline where the choice is none: the first of two scans with `mask`, as only that has a later one. What is
    /// stated stays; dates without a day have no order to tell.
    fn propose_baseline(&mut self, case: &Case, mask: Option<&str>) {
        let Some(history) = self.history.as_mut().filter(|history| history.baseline.is_none()) else {
            return;
        };
        let [one, two] = case.time_points.as_slice() else { return };
        let has_mask =
            |time: &TimePoint| time.masks.iter().any(|with| mask.is_some_and(|id| with.mask.id() == id));
        let (Some(a), Some(b)) = (leading_date(&one.label), leading_date(&two.label)) else { return };
        if a != b && has_mask(one) && has_mask(two) {
            let first = if a < b { one } else { two };
            history.baseline = Some(Fact::proposed(Label(first.label.clone())));
        }
    }

    /// Remembers where the lesions lie that `history` names.
    pub fn remember_targets(&mut self, report: &LesionsReport) {
        let Some(history) = &self.history else { return };
        let mut places = BTreeMap::new();
        for name in history.target_names().into_iter().flatten().chain(history.non_target_names()) {
            let of = report.lesions.iter().find(|l| l.name.as_ref() == Some(name) || l.id == *name);
            let parts = of.into_iter().flat_map(|lesion| lesion.dates.iter().flat_map(|date| &date.parts));
            if let Some(anchor) = parts.into_iter().find_map(|part| part.anchor.clone()) {
                places.insert(name.clone(), anchor);
            }
        }
        self.named_at = places;
    }

    /// Gives targets the names that the lesions at their places have now.
    ///
    /// # Errors
    /// [`AppError`] where a target isn't there any more: it was ignored, or its mask changed.
    pub fn follow_targets(&self, history: &mut History, report: &LesionsReport) -> Result<(), AppError> {
        let named = history.targets.iter_mut().chain(&mut history.non_targets);
        let names = named.flat_map(|fact| &mut fact.value);
        for name in names {
            let Some(place) = self.named_at.get(name).filter(|place| place.of == report.of) else { continue };
            let Some(lesion) = report.lesion_at(place) else {
                let found = format!("no lesion any more where {name} was");
                return Err(AppError::wrong("targets of the response", found, "one: name the targets again"));
            };
            *name = name_of(lesion, &report.lesions).to_owned();
        }
        Ok(())
    }

    /// What was stated on `day` without a name gets the author's.
    pub fn sign(&mut self, day: &str) {
        for by in self.bt_rads_by.values_mut() {
            if by.author.is_none() && by.entered.as_deref() == Some(day) {
                by.author = Some(self.author.clone());
            }
        }
        if let Some(history) = &mut self.history {
            history.sign(&self.author, day);
        }
    }

    /// The mask of non-enhancing disease, where `case` has it.
    pub fn other_mask(&self, case: &Case) -> Option<&String> {
        self.non_enhancing.as_ref().filter(|id| case.has_mask(id))
    }

    /// Without who stated it, and with `text` done to what the user wrote.
    pub fn anonymous(&mut self, text: impl Fn(&str) -> String) {
        self.author.clear();
        self.bt_rads_by.clear();
        let Some(history) = &mut self.history else { return };
        *history = std::mem::replace(history, History::new(history.criterion, None)).without_authors();
        for name in history.treatment.iter_mut().flatten().filter_map(|treatment| treatment.name.as_mut()) {
            *name = text(name);
        }
        let surgery = history.surgery.iter_mut().flat_map(|surgery| surgery.targets.iter_mut().flatten());
        let measured = history.measurement.iter_mut().map(|measurement| &mut measurement.lesion);
        let targets = history.targets.iter_mut().chain(&mut history.non_targets);
        let targets = targets.flat_map(|fact| &mut fact.value);
        for name in targets.chain(surgery).chain(measured) {
            *name = text(name);
        }
        self.named_at =
            std::mem::take(&mut self.named_at).into_iter().map(|(name, at)| (text(&name), at)).collect();
        let trial = &mut history.trial;
        let days =
            [&mut trial.confirm_response_days, &mut trial.confirm_progression_days, &mut trial.max_targets];
        let numbers = [&mut trial.minor_response_volume_percent, &mut trial.progression_absolute_mm];
        let sources = days.into_iter().flatten().map(|value| &mut value.source);
        let sources = sources.chain(numbers.into_iter().flatten().map(|value| &mut value.source));
        for source in sources.chain(trial.follow_2010.iter_mut().map(|value| &mut value.source)) {
            *source = text(source);
        }
        let stated = &mut history.repeatability;
        for stated in [&mut stated.product, &mut stated.longest, &mut stated.volume].into_iter().flatten() {
            stated.source = text(&stated.source);
        }
    }
}
