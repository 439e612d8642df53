//! What the facts beside the targets' sums say of a scan.

use super::{
    fact::Fact,
    history::{Assessment, Clinical, Flair, NewLesion, NonTarget, ScanFacts, TreatmentKind},
    judge::{Judge, Look},
    missing::{Ask, Input},
    phrases as say,
    result::Reason,
    rules::{Criterion, RuleId},
    sums::{nadir, sum},
    targets::{Targets, is_of},
    timeline::value,
};
use crate::phrase::{Phrase, Template, Value};

/// What a fact says.
pub(super) enum Effect {
    /// It makes progression, dated from an earlier scan if one is given.
    Progression(Reason, Option<usize>),
    /// It doesn't allow a call other than progression.
    Block(Reason),
    /// It changes nothing.
    Notes(Vec<Reason>),
    /// It isn't known.
    Unknown,
}

impl Effect {
    pub fn progression(&self) -> Option<(&Reason, Option<usize>)> {
        match self {
            Self::Progression(reason, dated) => Some((reason, *dated)),
            _ => None,
        }
    }

    fn nothing() -> Self {
        Self::Notes(Vec::new())
    }
}

/// Steroids compared with the baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dose {
    None,
    NotRaised,
    Raised,
}

/// The states of lesions that aren't targets, as alternatives.
const NON_TARGETS: [NonTarget; 3] = [NonTarget::None, NonTarget::NotWorse, NonTarget::Worse];

impl Judge<'_> {
    fn fact<T>(&self, at: usize, of: impl Fn(&ScanFacts) -> Option<&Fact<T>>) -> Option<&Fact<T>> {
        self.facts(at).and_then(of)
    }

    /// What is stated of new lesions; none that weren't looked for are unknown.
    fn stated_new_lesion(&self, at: usize) -> Option<&Fact<NewLesion>> {
        let facts = self.facts(at)?;
        let not_looked_for = value(facts.new_lesions_looked_for.as_ref()) == Some(false);
        facts.new_lesion.as_ref().filter(|fact| fact.value != NewLesion::None || !not_looked_for)
    }

    pub fn new_lesion_effect(&self, at: usize, look: &mut Look<'_>) -> Effect {
        let stated = self.stated_new_lesion(at);
        let by = Value::after(" ", stated.and_then(Fact::by));
        let options =
            [NewLesion::None, NewLesion::Equivocal, NewLesion::NonMeasurable, NewLesion::Measurable];
        let input = (Input::NewLesion, Some(at), false);
        let Some(state) = look.fact(value(stated), input, &options) else { return Effect::Unknown };
        let id = RuleId::NewLesion;
        let said = |template: &'static Template| template.with([("by", by.clone())]);
        let unstated = |template: &'static Template, id| {
            let unstated = self.rules.unstated(id).into();
            Effect::Block(Reason::of(id, template.with([("by", by.clone()), ("unstated", unstated)])))
        };
        let note = |id, template| Effect::Notes(vec![Reason::of(id, said(template))]);
        let is_measurable = match state {
            NewLesion::None => return Effect::nothing(),
            NewLesion::Equivocal if self.rules.get(RuleId::EquivocalNewLesion).is_some() => {
                return note(RuleId::EquivocalNewLesion, say::EQUIVOCAL_WAIT);
            }
            NewLesion::Equivocal => {
                return unstated(say::EQUIVOCAL_UNSTATED, RuleId::EquivocalNewLesion);
            }
            NewLesion::Measurable => true,
            NewLesion::NonMeasurable => false,
        };
        if self.rules.get(id).is_none() {
            return unstated(say::NEW_LESION_UNSTATED, id);
        }
        if self.rules.history.criterion == Criterion::Rano20 && !is_measurable {
            return note(id, say::NEW_LESION_TOO_SMALL);
        }
        if self.rules.get(RuleId::NewLesionImmunotherapy).is_some() {
            match self.is_treated(at, TreatmentKind::Immunotherapy, look) {
                None => return Effect::Unknown,
                Some(true) => return note(RuleId::NewLesionImmunotherapy, say::NEW_LESION_IMMUNOTHERAPY),
                Some(false) => {}
            }
        }
        // Equivocal at the scans just before: progression began there.
        let can_date_back = self.rules.get(RuleId::EquivocalNewLesion).is_some();
        let equivocal =
            |scan: usize| self.stated_new_lesion(scan).is_some_and(|fact| fact.value == NewLesion::Equivocal);
        let mut first = at;
        while can_date_back && first > self.baseline + 1 && equivocal(first - 1) {
            first -= 1;
        }
        let kind = if is_measurable { say::NEW_LESION_MEASURABLE } else { say::NEW_LESION_NOT_MEASURABLE };
        Effect::Progression(Reason::of(id, said(kind)), (first < at).then_some(first))
    }

    /// Whether a treatment of this kind began on or before the scan.
    fn is_treated(&self, at: usize, kind: TreatmentKind, look: &mut Look<'_>) -> Option<bool> {
        let day = self.scans.get(at)?.day;
        let treatments = self.rules.history.treatment.as_ref();
        let known = treatments.map(|all| all.iter().any(|t| t.kind == kind && t.start.number() <= day));
        look.fact(known, (Input::Treatment, None, false), &[false, true])
    }

    /// State of the lesions that aren't targets.
    pub fn non_target(&self, at: usize, look: &mut Look<'_>) -> Option<NonTarget> {
        let stated = value(self.facts(at).and_then(|facts| facts.non_target.as_ref()));
        let known = self.non_target_by_numbers(at).or(stated);
        look.fact(known, (Input::NonTarget, Some(at), false), &NON_TARGETS)
    }

    pub fn non_target_effect(&self, at: usize, look: &mut Look<'_>) -> Effect {
        let Some(state) = self.non_target(at, look) else { return Effect::Unknown };
        if state != NonTarget::Worse {
            return Effect::nothing();
        }
        let id = RuleId::NonTarget;
        let by = Value::after(" ", self.fact(at, |facts| facts.non_target.as_ref()).and_then(Fact::by));
        self.worse(id, by, say::NON_TARGET_WORSE, say::NON_TARGET_WORSE_UNSTATED)
    }

    /// Progression where a rule says so; else no call, as none is stated.
    fn worse(&self, id: RuleId, by: Value, worse: &'static Template, unstated: &'static Template) -> Effect {
        if self.rules.get(id).is_some() {
            return Effect::Progression(Reason::of(id, worse.with([("by", by)])), None);
        }
        let why = self.rules.unstated(id).into();
        Effect::Block(Reason::of(id, unstated.with([("by", by), ("unstated", why)])))
    }

    /// RANO 2.0: the state of non-target lesions by their sums, where they and the targets are measured at all scans since
    /// the baseline, and their lowest sums are above 0.
    pub fn non_target_by_numbers(&self, at: usize) -> Option<NonTarget> {
        let non_targets = self.rules.history.non_target_names();
        if self.rules.history.criterion != Criterion::Rano20 || non_targets.is_empty() {
            return None;
        }
        let (mut is_worse, mut is_gone, mut found) = (false, true, false);
        for line in &self.lines {
            let Targets::Known(targets) = &line.targets else { return None };
            let of_line = |name: &&str| is_of(self.scans, name, line.compartment);
            let names: Vec<&str> = non_targets.iter().map(String::as_str).filter(of_line).collect();
            if names.is_empty() {
                continue;
            }
            found = true;
            let scans = self.scans.get(self.baseline..=at)?;
            let of = |all: &[&str]| {
                let sums: Vec<_> = scans.iter().map(|s| sum(s, all.iter().copied(), self.quantity)).collect();
                let (last, before) = sums.split_last()?;
                let all_known = before.iter().all(|sum| sum.whole().is_some());
                let lowest = nadir(before, self.baseline).filter(|_| all_known)?.sum;
                Some((last.whole()?, lowest))
            };
            let all: Vec<&str> = targets.iter().copied().chain(names.iter().copied()).collect();
            let ((own, own_lowest), (total, total_lowest)) = (of(&names)?, of(&all)?);
            if own > 0.0 && (own_lowest == 0.0 || total_lowest == 0.0) {
                return None;
            }
            is_gone &= own == 0.0;
            let rise = |sum, lowest| lowest > 0.0 && line.thresholds.is_rise(sum, lowest);
            is_worse |= rise(own, own_lowest) && rise(total, total_lowest);
        }
        let state = if is_worse {
            NonTarget::Worse
        } else if is_gone {
            NonTarget::Gone
        } else {
            NonTarget::NotWorse
        };
        found.then_some(state)
    }

    pub fn flair_effect(&self, at: usize, look: &mut Look<'_>) -> Effect {
        let id = RuleId::Flair;
        if self.rules.get(id).is_none() {
            return Effect::nothing();
        }
        let fact = self.fact(at, |facts| facts.flair.as_ref());
        if value(fact) == Some(Flair::NotWorse) {
            return Effect::nothing();
        }
        let history = self.rules.history;
        if history.criterion == Criterion::Rano20 {
            if history.assessment != Some(Assessment::Enhancing) {
                return Effect::nothing();
            }
            match self.is_treated(at, TreatmentKind::Antiangiogenic, look) {
                None => return Effect::Unknown,
                Some(false) => return Effect::nothing(),
                Some(true) => {}
            }
        }
        let input = (Input::Flair, Some(at), false);
        match look.fact(value(fact), input, &[Flair::NotWorse, Flair::Worse]) {
            None => Effect::Unknown,
            Some(Flair::NotWorse) => Effect::nothing(),
            Some(Flair::Worse) => {
                let by = Value::after(" ", fact.and_then(Fact::by));
                Effect::Progression(Reason::of(id, say::FLAIR_WORSE.with([("by", by)])), None)
            }
        }
    }

    /// Clinical state; assumed to be stable as long as it is unknown.
    pub fn clinical(&self, at: usize, look: &mut Look<'_>) -> Option<Clinical> {
        let all = [Clinical::Stable, Clinical::Worse, Clinical::MuchWorse];
        let has_much_worse = self.rules.get(RuleId::ImmunotherapyMuchWorse).is_some();
        let options = if has_much_worse { &all[..] } else { &all[..2] };
        let known = value(self.fact(at, |facts| facts.clinical.as_ref()));
        look.fact(known, (Input::Clinical, Some(at), true), options)
    }

    pub fn clinical_effect(&self, at: usize, look: &mut Look<'_>) -> Effect {
        match self.clinical(at, look) {
            None => Effect::Unknown,
            Some(Clinical::Stable | Clinical::Better) => Effect::nothing(),
            Some(Clinical::Worse | Clinical::MuchWorse) => {
                let by = self.fact(at, |facts| facts.clinical.as_ref()).and_then(Fact::by);
                let by = Value::after(" ", by);
                self.worse(RuleId::Clinical, by, say::CLINICALLY_WORSE, say::CLINICALLY_WORSE_UNSTATED)
            }
        }
    }

    fn stated_dose(&self, at: usize) -> Option<f64> {
        value(self.fact(at, |facts| facts.steroids_mg.as_ref()))
    }

    /// Steroids compared with the baseline, where both doses tell.
    pub fn known_dose(&self, at: usize) -> Option<Dose> {
        let now = self.stated_dose(at)?;
        if now == 0.0 {
            return Some(Dose::None);
        }
        let baseline = self.stated_dose(self.baseline)?;
        Some(if now > baseline { Dose::Raised } else { Dose::NotRaised })
    }

    /// Steroids compared with the baseline; assumed to be none as long as they are unknown. Where `any_matters` isn't set,
    /// only whether they are raised does.
    pub fn dose(&self, at: usize, any_matters: bool, ask: &mut Ask) -> Dose {
        if let Some(known) = self.known_dose(at) {
            return known;
        }
        let (now, before) = (self.stated_dose(at), self.stated_dose(self.baseline));
        let here = (Input::Steroids, Some(at), true);
        let there = (Input::Steroids, Some(self.baseline), true);
        let mut look = Look::Asking(ask);
        let raised_or_not = [Dose::NotRaised, Dose::Raised];
        match (now, before) {
            (Some(_), _) => look.fact(None, there, &raised_or_not),
            (None, Some(0.0)) => look.fact(None, here, &[Dose::None, Dose::Raised]),
            (None, Some(_)) if any_matters => {
                look.fact(None, here, &[Dose::None, Dose::NotRaised, Dose::Raised])
            }
            (None, Some(_)) => look.fact(None, here, &[Dose::None, Dose::Raised]),
            (None, None) => match look.fact(None, here, &[false, true]) {
                Some(true) => look.fact(None, there, &raised_or_not),
                _ => Some(Dose::None),
            },
        }
        .unwrap_or(Dose::None)
    }

    pub fn dose_words(&self, at: usize) -> Phrase {
        let words = |dose: Option<f64>| {
            dose.map_or_else(|| Phrase::from(say::UNKNOWN).into(), |mg| Value::number(format!("{mg} mg")))
        };
        let by = self.fact(at, |facts| facts.steroids_mg.as_ref()).and_then(Fact::by);
        let (now, before) = (words(self.stated_dose(at)), words(self.stated_dose(self.baseline)));
        say::STEROIDS.with([("now", now), ("by", Value::after(" ", by)), ("before", before)])
    }
}
