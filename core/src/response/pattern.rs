//! What one scan shows, compared with its baseline and lowest sum, before windows and confirmations.

use super::{
    effects::{Dose, Effect},
    fact::Fact,
    history::{NonTarget, SteroidReason},
    judge::{Judge, Look},
    missing::{Ask, Input},
    phrases as say,
    result::{Category, Reason},
    rules::RuleId,
    sums::{Line, Nadir},
    targets::Targets,
    timeline::value,
};
use crate::phrase::Value;

/// What a scan shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Complete,
    Partial,
    Minor,
    Stable,
    Progression,
    Observe,
    CannotSay,
}

/// What a scan shows, and why.
#[derive(Clone, Debug)]
pub(super) struct Pattern {
    pub kind: Kind,
    pub reasons: Vec<Reason>,
    /// Index of the scan from which progression is dated.
    pub dated: Option<usize>,
}

/// What the sums of all compartments say together.
enum Together {
    Category(Category),
    NoTargets,
    NotComparable(usize),
    /// Minor and partial response.
    MixedUnstated,
}

impl Judge<'_> {
    /// What scan `at` shows. Known facts that make progression come first, so that nothing is asked beside them.
    pub fn pattern(&self, at: usize, ask: &mut Ask) -> Pattern {
        let effects: [&dyn Fn(&mut Look<'_>) -> Effect; 5] = [
            &|look| self.sum_effect(at, look),
            &|look| self.new_lesion_effect(at, look),
            &|look| self.non_target_effect(at, look),
            &|look| self.flair_effect(at, look),
            &|look| self.clinical_effect(at, look),
        ];
        let known: Vec<Effect> = effects.iter().map(|effect| effect(&mut Look::Known)).collect();
        let progressions = || known.iter().filter_map(Effect::progression);
        if progressions().next().is_some() {
            let dated = progressions().filter_map(|(_, dated)| dated).min();
            let mut reasons: Vec<Reason> = progressions().map(|(reason, _)| reason.clone()).collect();
            // What would make progression by an assumption is said beside it, but asks for nothing.
            let unknown = effects.iter().zip(&known).filter(|(_, known)| matches!(known, Effect::Unknown));
            reasons.extend(unknown.filter_map(|(effect, _)| {
                let effect = effect(&mut Look::Assuming);
                let (Reason { rule, phrase, .. }, _) = effect.progression()?;
                let words = say::AS_ASSUMED.with([("reason", phrase.clone().into())]);
                Some(Reason { rule: *rule, ..Reason::plain(words) })
            }));
            return Pattern { kind: Kind::Progression, reasons, dated };
        }
        let (mut reasons, mut blocks) = (Vec::new(), Vec::new());
        for (effect, known) in effects.iter().zip(known) {
            let effect =
                if matches!(known, Effect::Unknown) { effect(&mut Look::Asking(ask)) } else { known };
            match effect {
                Effect::Progression(reason, dated) => {
                    return Pattern { kind: Kind::Progression, reasons: vec![reason], dated };
                }
                Effect::Block(reason) => blocks.push(reason),
                Effect::Notes(more) => reasons.extend(more),
                Effect::Unknown => {}
            }
        }
        if !blocks.is_empty() {
            blocks.extend(reasons);
            return Pattern { kind: Kind::CannotSay, reasons: blocks, dated: None };
        }
        self.without_progression(at, ask, reasons)
    }

    /// Response or stable disease: what steroids and the lesions that aren't targets allow.
    fn without_progression(&self, at: usize, ask: &mut Ask, mut reasons: Vec<Reason>) -> Pattern {
        let together = self.together(at, &mut Look::Asking(ask)).map(|(together, _)| together);
        let mut kind = match together {
            Some(Together::Category(Category::Complete)) => Kind::Complete,
            Some(Together::Category(Category::Partial)) => Kind::Partial,
            Some(Together::Category(Category::Minor)) => Kind::Minor,
            _ => Kind::Stable,
        };
        if kind == Kind::Complete && self.non_target(at, &mut Look::Asking(ask)) == Some(NonTarget::NotWorse)
        {
            kind = Kind::Partial;
            reasons.push(Reason::of(RuleId::CompleteResponse, say::NON_TARGET_REMAIN));
        }
        // The dose matters to a complete response as soon as there is one, else where it is above that at baseline.
        let dose = self.dose(at, kind == Kind::Complete, ask);
        if dose == Dose::None {
            return Pattern { kind, reasons, dated: None };
        }
        let steroids = || Value::from(self.dose_words(at));
        let unstated = || self.rules.unstated(RuleId::SteroidsNotRaised).into();
        let cannot = |mut reasons: Vec<Reason>, reason| {
            reasons.insert(0, reason);
            Pattern { kind: Kind::CannotSay, reasons, dated: None }
        };
        if kind == Kind::Complete {
            if self.rules.get(RuleId::SteroidsNone).is_none() {
                let words = say::STEROIDS_UNSTATED.with([("steroids", steroids()), ("unstated", unstated())]);
                return cannot(reasons, Reason::of(RuleId::SteroidsNone, words));
            }
            kind = Kind::Partial;
            let words = say::STEROIDS_NO_COMPLETE.with([("steroids", steroids())]);
            reasons.push(Reason::of(RuleId::SteroidsNone, words));
        }
        if dose == Dose::NotRaised {
            return Pattern { kind, reasons, dated: None };
        }
        if kind == Kind::Stable && self.rules.get(RuleId::SteroidsOther).is_some() {
            return self.raised_on_stable_scan(at, ask, reasons);
        }
        let reason = if self.rules.get(RuleId::SteroidsNotRaised).is_some() {
            say::STEROIDS_RAISED.with([("steroids", steroids())])
        } else {
            say::STEROIDS_RAISED_UNSTATED.with([("steroids", steroids()), ("unstated", unstated())])
        };
        cannot(reasons, Reason::of(RuleId::SteroidsNotRaised, reason))
    }

    /// RANO 2.0: steroids are raised, and the scan is stable.
    fn raised_on_stable_scan(&self, at: usize, ask: &mut Ask, mut reasons: Vec<Reason>) -> Pattern {
        let fact = self.facts(at).and_then(|facts| facts.steroids_reason.as_ref());
        let values =
            [("steroids", self.dose_words(at).into()), ("by", Value::after(" ", fact.and_then(Fact::by)))];
        let options = [SteroidReason::Other, SteroidReason::Tumour];
        let why = Look::Asking(ask).fact(value(fact), (Input::SteroidsReason, Some(at), false), &options);
        if why == Some(SteroidReason::Tumour) {
            let mut first = at;
            while first > self.baseline + 1 && self.known_dose(first - 1) == Some(Dose::Raised) {
                first -= 1;
            }
            let words = say::STEROIDS_TUMOUR.with(values);
            let dated = (first < at).then_some(first);
            return Pattern {
                kind: Kind::Progression,
                reasons: vec![Reason::of(RuleId::SteroidsTumour, words)],
                dated,
            };
        }
        reasons.insert(0, Reason::of(RuleId::SteroidsOther, say::STEROIDS_OTHER.with(values)));
        Pattern { kind: Kind::Observe, reasons, dated: None }
    }

    fn sum_effect(&self, at: usize, look: &mut Look<'_>) -> Effect {
        let Some((together, reasons)) = self.together(at, look) else { return Effect::Unknown };
        let all = || reasons.iter().map(|reason| reason.phrase.clone()).collect();
        let joined = || ("reasons", Value::joined("; ", all()));
        match together {
            Together::Category(Category::Progression) => {
                let own = self.lines.first().map(|line| line.thresholds.progression_rule);
                let rise = own.filter(|_| self.lines.len() == 1).unwrap_or(RuleId::MixedProgression);
                Effect::Progression(Reason::of(rise, say::JOINED.with([joined()])), None)
            }
            Together::Category(Category::Reappeared) => {
                Effect::Block(Reason::of(RuleId::Reappearance, say::IS_IT_NEW.with([joined()])))
            }
            Together::Category(Category::MinorOrStable) => {
                let unstated = self.rules.unstated(RuleId::MinorResponse).into();
                let words = say::REASONS_UNSTATED.with([joined(), ("unstated", unstated)]);
                Effect::Block(Reason::of(RuleId::MinorResponse, words))
            }
            Together::Category(_) => Effect::Notes(reasons),
            Together::NotComparable(scan) => {
                let words = say::TECHNIQUE_CHANGED.with([("scan", self.label(scan).into())]);
                Effect::Block(Reason::of(RuleId::TechniqueChanged, words))
            }
            Together::MixedUnstated => {
                Effect::Block(Reason::of(RuleId::MixedStable, say::MIXED_UNSTATED.with([joined()])))
            }
            Together::NoTargets => {
                let id = RuleId::NonMeasurableOnly;
                if self.rules.get(id).is_some() && self.lines.len() == 1 {
                    Effect::Notes(vec![Reason::of(id, say::AT_BEST_STABLE)])
                } else {
                    let unstated = self.rules.unstated(id).into();
                    let words = say::NO_MEASURABLE_UNSTATED.with([("unstated", unstated)]);
                    Effect::Block(Reason::of(id, words))
                }
            }
        }
    }

    /// What the sums of all compartments say.
    fn together(&self, at: usize, look: &mut Look<'_>) -> Option<(Together, Vec<Reason>)> {
        if let Some(scan) = self.changed_technique(at, look)? {
            return self.since_change(scan, at, look);
        }
        let (mut reasons, mut categories) = (Vec::new(), Vec::new());
        let mut together: Option<Together> = None;
        for line in &self.lines {
            let one = match &line.targets {
                Targets::NoneMeasurable => Together::NoTargets,
                Targets::Unknown(_) => {
                    let options =
                        [Category::Stable, Category::Partial, Category::Complete, Category::Progression];
                    let input = (Input::Targets, Some(self.baseline), false);
                    Together::Category(look.fact(None, input, &options)?)
                }
                Targets::Known(_) => {
                    let category = self.category(line, at, look)?;
                    categories.push(category);
                    reasons.push(self.sum_reason(line, at, category));
                    Together::Category(category)
                }
            };
            together = Some(match together {
                None => one,
                Some(first) => combine(first, one),
            });
        }
        if let [a, b] = categories.as_slice() {
            let (id, statement) = match (a, b) {
                _ if a == b => (RuleId::MixedAlike, say::MIXED_ALIKE),
                (Category::Progression, _) | (_, Category::Progression) => {
                    (RuleId::MixedProgression, say::MIXED_PROGRESSION)
                }
                (Category::Complete, _) | (_, Category::Complete) => {
                    (RuleId::MixedComplete, say::MIXED_COMPLETE)
                }
                _ => (RuleId::MixedStable, say::MIXED_STABLE),
            };
            reasons.extend(self.rules.get(id).map(|_| Reason::of(id, statement)));
        }
        Some((together?, reasons))
    }

    /// What sums say after the technique changed at scan `change`: they are comparable from there on, which shows
    /// progression, but neither response nor stable disease.
    fn since_change(&self, change: usize, at: usize, look: &mut Look<'_>) -> Option<(Together, Vec<Reason>)> {
        for line in self.lines.iter().filter(|line| matches!(line.targets, Targets::Known(_))) {
            let (sum, _) = self.values(line, at, look)?;
            let lowest = line.nadir_between(change, at).and_then(|lowest| lowest.above_0);
            let rises = lowest.is_some_and(|lowest| line.thresholds.is_rise(sum, lowest))
                || self.between(line, sum, change..at, look)? == Between::Lower;
            if rises {
                let id = line.thresholds.progression_rule;
                let words = say::SINCE_TECHNIQUE.with([("scan", self.label(change).into())]);
                return Some((Together::Category(Category::Progression), vec![Reason::of(id, words)]));
            }
        }
        Some((Together::NotComparable(change), Vec::new()))
    }

    /// The last scan since the baseline at which the technique changed, if it did.
    fn changed_technique(&self, at: usize, look: &mut Look<'_>) -> Option<Option<usize>> {
        if !self.lines.iter().any(|line| matches!(line.targets, Targets::Known(_))) {
            return Some(None);
        }
        let from = self.baseline;
        for scan in (from + 1..=at).rev() {
            let stated = self.facts(scan).and_then(|facts| facts.technique_changed.as_ref());
            let stated = stated
                .map(|fact| !fact.value.is_empty())
                .or_else(|| self.thickness_changed(scan).then_some(true));
            if look.fact(stated, (Input::Technique, Some(scan), true), &[false, true])? {
                return Some(Some(scan));
            }
        }
        Some(None)
    }

    /// Whether a target's stated slice thickness differs from that of the scan before.
    fn thickness_changed(&self, at: usize) -> bool {
        /// Thicknesses in headers differ in their last digits.
        const SAME: f64 = 0.01;
        let thickness = |scan: usize, name: &str| self.scans.get(scan)?.lesions.get(name)?.slice_thickness_mm;
        let names = self.lines.iter().flat_map(|line| match &line.targets {
            Targets::Known(names) => names.as_slice(),
            _ => &[],
        });
        names.copied().any(|name| {
            match (thickness(at, name), at.checked_sub(1).and_then(|k| thickness(k, name))) {
                (Some(now), Some(before)) => (now / before - 1.0).abs() > SAME,
                _ => false,
            }
        })
    }

    /// What the sum of one compartment says.
    fn category(&self, line: &Line<'_>, at: usize, look: &mut Look<'_>) -> Option<Category> {
        let (sum, baseline) = self.values(line, at, look)?;
        let lowest = line.nadir_before(at).unwrap_or(Nadir::of(self.baseline, baseline));
        let above_0 = lowest.above_0.unwrap_or(baseline).min(baseline);
        let category = line.thresholds.category(sum, baseline, lowest.sum.min(baseline), above_0);
        if matches!(category, Category::Complete | Category::Progression) {
            return Some(category);
        }
        Some(match self.between(line, sum, self.baseline + 1..at, look)? {
            Between::NotLower => category,
            Between::Lower => Category::Progression,
            Between::Gone => Category::Reappeared,
        })
    }

    /// The sum of a scan and that of the baseline; where they are unknown, values that stand for all they can be.
    fn values(&self, line: &Line<'_>, at: usize, look: &mut Look<'_>) -> Option<(f64, f64)> {
        let input = self.sum_input(line);
        let (sum, base) = (line.at(at)?, line.at(self.baseline)?);
        let known = line.nadir_before(at);
        let scale =
            sum.whole().filter(|&sum| sum > 0.0).or(known.and_then(|known| known.above_0)).unwrap_or(1.0);
        // For any sum a baseline from which it is stable, a minor or partial response, and progression.
        let bases = [1.0, 1.7, 3.5, 0.6].map(|factor| (scale * factor).max(base.measured));
        let baseline = look.fact(base.whole(), (input, Some(self.baseline), false), &bases)?;
        let lowest = known.unwrap_or(Nadir::of(self.baseline, baseline));
        let since = (self.baseline..at).filter_map(|first| line.nadir_between(first, at)?.above_0);
        let mut lows: Vec<f64> = since.collect();
        lows.dedup();
        let tries = if sum.whole().is_some() {
            Vec::new()
        } else {
            line.thresholds.tries(sum, baseline, lowest, &lows)
        };
        let only = if let [only] = tries.as_slice() { Some(*only) } else { None };
        let sum = look.fact(sum.whole().or(only), (input, Some(at), false), &tries)?;
        Some((sum, baseline))
    }

    /// What the scans that aren't measured can have been, below what is measured, where that matters to `sum`.
    fn between(
        &self,
        line: &Line<'_>,
        sum: f64,
        scans: std::ops::Range<usize>,
        look: &mut Look<'_>,
    ) -> Option<Between> {
        for scan in scans.filter(|&scan| scan != self.baseline) {
            let Some(between) = line.at(scan).filter(|between| between.whole().is_none()) else { continue };
            let can_be_gone = between.measured == 0.0;
            if sum == 0.0 || !(can_be_gone || line.thresholds.is_rise(sum, between.measured)) {
                continue;
            }
            let all = [Between::NotLower, Between::Lower, Between::Gone];
            let options = if can_be_gone { &all[..] } else { &all[..2] };
            match look.fact(None, (self.sum_input(line), Some(scan), true), options)? {
                Between::NotLower => {}
                Between::Lower => return Some(Between::Lower),
                // What the scans after it were is asked where this one wasn't gone.
                Between::Gone => return Some(Between::Gone),
            }
        }
        Some(Between::NotLower)
    }
}

/// What a scan that isn't measured can have been.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Between {
    /// Not below the lowest sum that is measured.
    NotLower,
    /// So low that the sum is a rise of progression.
    Lower,
    /// Without targets.
    Gone,
}

/// What two compartments say together (RANO 2.0, mixed disease).
fn combine(a: Together, b: Together) -> Together {
    use Category::{Complete, Minor, MinorOrStable, Partial, Progression, Reappeared, Stable};
    use Together::{Category as C, MixedUnstated};
    match (a, b) {
        (C(Progression), _) | (_, C(Progression)) => C(Progression),
        (C(a), C(b)) => match (a, b) {
            (Reappeared, _) | (_, Reappeared) => C(Reappeared),
            (a, b) if a == b => C(a),
            (Complete, other) | (other, Complete) => C(other),
            (other, Stable) | (Stable, other) => C(other),
            (Partial, Minor | MinorOrStable) | (Minor | MinorOrStable, Partial) => MixedUnstated,
            (a, _) => C(a),
        },
        (C(_), other) | (other, _) => other,
    }
}
