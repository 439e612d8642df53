//! Which lesions are targets: measurable at the baseline, and within the criterion's number.

use super::{
    history::{Assessment, Compartment, History, Measurement},
    phrases as say,
    result::TargetReport,
    rules::{Criterion, Rule, RuleId, rule, unstated_phrase},
    timeline::{Epoch, Scan},
    trial::Part,
};
use crate::phrase::{Phrase, Value};

/// The relative difference below which two numbers count as equal, so that a change of 25 % is reached whatever the
/// rounding of the sums.
pub(super) const TOLERANCE: f64 = 1e-9;

/// Whether `value` is at least `threshold`, up to rounding.
pub(super) fn at_least(value: f64, threshold: f64) -> bool {
    value >= threshold - TOLERANCE * threshold.abs()
}

/// The rules that hold for a history: those of its criterion, and those of RANO 2010 that its trial follows.
#[derive(Clone, Copy)]
pub(super) struct Rules<'a> {
    pub history: &'a History,
}

impl Rules<'_> {
    /// The rule about `id`.
    pub fn get(self, id: RuleId) -> Option<&'static Rule> {
        let own = rule(self.history.criterion, id);
        own.or_else(|| {
            let part = match id {
                RuleId::MeasurableLongest
                | RuleId::MeasurablePerpendicular
                | RuleId::MeasurableSlices
                | RuleId::ThickSlice
                | RuleId::ThickSliceFactor => Part::Measurable,
                RuleId::NonTarget => Part::NonTarget,
                RuleId::SteroidsNone | RuleId::SteroidsNotRaised => Part::Steroids,
                RuleId::Clinical => Part::Clinical,
                _ => return None,
            };
            let follows = self.history.trial.follow_2010.as_ref()?.value.contains(&part);
            // RANO-BM has thresholds of its own, without thick slices.
            let follows = follows && self.history.criterion != Criterion::RanoBm;
            follows.then(|| rule(Criterion::Rano2010, id)).flatten()
        })
    }

    /// Its number.
    pub fn number(self, id: RuleId) -> Option<f64> {
        self.get(id).and_then(|rule| rule.number)
    }

    /// That it isn't stated.
    pub fn unstated(self, id: RuleId) -> Phrase {
        unstated_phrase(self.history.criterion, id)
    }

    /// The most targets of one compartment.
    fn max_targets(self) -> Option<f64> {
        let trial = self.history.trial.max_targets.as_ref().map(|stated| f64::from(stated.value));
        let mixed = self.history.assessment == Some(Assessment::Mixed);
        trial.or_else(|| self.number(if mixed { RuleId::MaxTargetsMixed } else { RuleId::MaxTargets }))
    }

    /// Whether a lesion is measurable, with what decides it; `None`: unknown, or not stated.
    fn measurable(self, lesion: &Measurement) -> (Option<bool>, Phrase) {
        if lesion.gone {
            return (Some(false), say::GONE.into());
        }
        let (Some(longest), Some(perpendicular), Some(slices)) = (
            self.number(RuleId::MeasurableLongest),
            self.number(RuleId::MeasurablePerpendicular),
            self.number(RuleId::MeasurableSlices),
        ) else {
            return (None, self.unstated(RuleId::MeasurableLongest));
        };
        let (mut least_longest, mut least_perpendicular) = (Some(longest), Some(perpendicular));
        if let (Some(thick), Some(factor)) =
            (self.number(RuleId::ThickSlice), self.number(RuleId::ThickSliceFactor))
        {
            let least = match lesion.slice_thickness_mm {
                Some(thickness) if thickness > thick => Some(factor * thickness),
                Some(_) => Some(0.0),
                None => None,
            };
            least_longest = least.map(|least| longest.max(least));
            least_perpendicular = least.map(|least| perpendicular.max(least));
        }
        let conditions = [
            (say::LONGEST, lesion.longest_mm, least_longest, longest),
            (say::PERPENDICULAR, lesion.perpendicular_mm, least_perpendicular, perpendicular),
            (say::SLICES, lesion.slices.map(f64::from), Some(slices), slices),
        ];
        for (name, value, threshold, lowest) in conditions {
            // Thick slices only ask for more.
            let needed = threshold.unwrap_or(lowest);
            if let Some(value) = value.filter(|&value| !at_least(value, needed)) {
                let size = Phrase::from(name).into();
                let values =
                    [("size", size), ("value", Value::number(value)), ("least", Value::number(needed))];
                return (Some(false), say::TOO_SMALL.with(values));
            }
        }
        let not_stated = |size| (None, say::SIZE_NOT_STATED.with([("size", Phrase::from(size).into())]));
        for (name, value, threshold, _) in conditions {
            if value.is_none() {
                return not_stated(name);
            }
            if threshold.is_none() {
                return not_stated(say::THICKNESS);
            }
        }
        (Some(true), say::MEASURABLE.into())
    }
}

/// The targets of an epoch in one compartment.
pub(super) enum Targets<'a> {
    /// These lesions.
    Known(Vec<&'a str>),
    /// There is no measurable disease.
    NoneMeasurable,
    /// They can't be chosen, in words.
    Unknown(Phrase),
}

/// The targets at the baseline, and all lesions of the compartment there.
pub(super) fn targets<'a>(
    rules: Rules<'a>,
    epoch: &Epoch<'a>,
    baseline: &Scan<'a>,
    scans: &[Scan<'a>],
    compartment: Compartment,
) -> (Targets<'a>, Vec<TargetReport>) {
    let mut reports: Vec<TargetReport> = Vec::new();
    let mut chosen: Vec<&'a str> = Vec::new();
    let mut unclear = None;
    let mut add = |name: &'a str, lesion: Option<&Measurement>, is_stated: bool| {
        let (measurable, words) =
            lesion.map_or_else(|| (None, say::NOT_MEASURED.into()), |lesion| rules.measurable(lesion));
        // A lesion that the user chose as target is taken as measurable where nothing says otherwise.
        let target = measurable.unwrap_or(is_stated);
        if target {
            chosen.push(name);
        } else if measurable.is_none() && unclear.is_none() {
            let values = [("lesion", name.into()), ("why", words.clone().into())];
            unclear = Some(say::WHETHER_MEASURABLE.with(values));
        }
        reports.push(TargetReport { lesion: name.to_owned(), target, measurable, words: words.to_string() });
    };
    if let Some(stated) = epoch.stated_targets {
        for name in stated.iter().filter(|name| is_of(scans, name, compartment)) {
            add(name, baseline.lesions.get(name.as_str()).copied(), true);
        }
    } else {
        let present = baseline.lesions.iter().filter(|(_, lesion)| lesion.compartment == compartment);
        for (name, lesion) in
            present.filter(|(name, _)| !rules.history.non_target_names().iter().any(|n| n == *name))
        {
            add(name, Some(lesion), false);
        }
        if reports.is_empty() {
            unclear = Some(say::NO_LESION_AT_BASELINE.into());
        }
    }
    let most = rules.max_targets();
    let targets = match (unclear, most) {
        (Some(words), _) => Targets::Unknown(words),
        (None, Some(most)) if chosen.len() as f64 > most => {
            let values = [("count", Value::number(chosen.len())), ("most", Value::number(most))];
            Targets::Unknown(say::TOO_MANY_TARGETS.with(values))
        }
        (None, _) if chosen.is_empty() => Targets::NoneMeasurable,
        (None, _) => {
            chosen.sort_unstable();
            Targets::Known(chosen)
        }
    };
    reports.sort_by(|a, b| a.lesion.cmp(&b.lesion));
    (targets, reports)
}

/// Whether a lesion is of this compartment, which is the same at all scans.
pub(super) fn is_of(scans: &[Scan<'_>], name: &str, compartment: Compartment) -> bool {
    let lesion = scans.iter().find_map(|scan| scan.lesions.get(name));
    lesion.is_some_and(|lesion| lesion.compartment == compartment)
}
