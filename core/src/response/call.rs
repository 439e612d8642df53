//! The call at a scan: what it shows, taken through the windows and confirmations of the criterion.

use super::{
    fact::{Fact, Radiotherapy, When},
    history::{Clinical, Disease, Field, Histology, TreatmentKind},
    judge::{Judge, Look},
    missing::{Ask, Explored, Input},
    pattern::{Kind, Pattern},
    phrases as say,
    result::{Call, Confirmation, Confirmed, Reason},
    rules::{Criterion, RuleId},
    timeline::value,
};
use crate::phrase::{Phrase, Value};

/// A call.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    pub call: Call,
    pub confirmation: Option<Confirmation>,
    pub reasons: Vec<Reason>,
    /// Index of the scan from which progression is dated.
    pub dated: Option<usize>,
}

/// What the scans of an epoch show, each with what is unknown of it; `None` up to the baseline.
pub(super) type Patterns = [Option<Explored<Pattern>>];

impl Judge<'_> {
    /// The call at scan `at`.
    pub fn call(&self, at: usize, patterns: &Patterns, ask: &mut Ask) -> Outcome {
        let pattern = self.pattern(at, ask);
        let confirmed = |yes: Call, no: Call, confirmation: Confirmation| {
            let call = if confirmation.state == Confirmed::No { no } else { yes };
            (call, Some(confirmation))
        };
        let (call, confirmation) = match pattern.kind {
            Kind::Complete => confirmed(
                Call::CompleteResponse,
                Call::UnconfirmedCompleteResponse,
                self.sustained(at, pattern.kind, patterns, ask),
            ),
            Kind::Partial => confirmed(
                Call::PartialResponse,
                Call::UnconfirmedPartialResponse,
                self.sustained(at, pattern.kind, patterns, ask),
            ),
            Kind::Minor => confirmed(
                Call::MinorResponse,
                Call::UnconfirmedMinorResponse,
                self.sustained(at, pattern.kind, patterns, ask),
            ),
            Kind::Stable => (Call::StableDisease, None),
            Kind::Observe => (Call::Observe, None),
            Kind::CannotSay => (Call::CannotSay, None),
            Kind::Progression => return self.progression(at, pattern, patterns, ask),
        };
        Outcome { call, confirmation, reasons: pattern.reasons, dated: pattern.dated }
    }

    /// What another scan shows; where that is unknown, it is asked for.
    fn shown(&self, scan: usize, patterns: &Patterns, ask: &mut Ask) -> Kind {
        let Some(Some(explored)) = patterns.get(scan) else { return Kind::CannotSay };
        let mut kinds: Vec<Kind> = explored.given.iter().map(|pattern| pattern.kind).collect();
        for pattern in &explored.all {
            if !kinds.contains(&pattern.kind) {
                kinds.push(pattern.kind);
            }
        }
        match kinds.as_slice() {
            [only] => *only,
            kinds => {
                let input = (Input::CallAt, Some(scan), explored.given.is_some());
                Look::Asking(ask).fact(None, input, kinds).unwrap_or(Kind::CannotSay)
            }
        }
    }

    fn days_between(&self, from: usize, to: usize) -> f64 {
        let day = |scan: usize| self.scans.get(scan).map_or(0.0, |scan| f64::from(scan.day));
        day(to) - day(from)
    }

    /// Days after which a response of this kind is confirmed.
    fn confirm_days(&self, kind: Kind) -> Option<f64> {
        let history = self.rules.history;
        let own = self.rules.number(RuleId::ConfirmResponse);
        // RANO-LGG states it of partial response.
        let own = own.filter(|_| history.criterion != Criterion::RanoLgg || kind == Kind::Partial);
        own.or_else(|| history.trial.confirm_response_days.as_ref().map(|stated| f64::from(stated.value)))
    }

    /// Whether a response was sustained: at all scans from this one to one long enough after it, or before it.
    fn sustained(&self, at: usize, kind: Kind, patterns: &Patterns, ask: &mut Ask) -> Confirmation {
        let Some(days) = self.confirm_days(kind) else {
            let words = self.rules.unstated(RuleId::ConfirmResponse);
            return Confirmation::of(Confirmed::NotStated, None, words);
        };
        let holds = |shown: Kind| match kind {
            Kind::Complete => shown == Kind::Complete,
            Kind::Partial => matches!(shown, Kind::Complete | Kind::Partial),
            _ => matches!(shown, Kind::Complete | Kind::Partial | Kind::Minor),
        };
        let yes = |scan: usize, words| Confirmation::of(Confirmed::Yes, Some(self.label(scan)), words);
        let interval = say::DAYS_LATER_LEAST.with([("days", Value::number(days))]);
        let mut why = say::NO_SCAN.with([("interval", interval.into())]);
        for scan in at + 1..self.epoch.end {
            let gap = self.days_between(at, scan);
            let values = [("scan", self.label(scan).into()), ("days", Value::number(gap))];
            if !holds(self.shown(scan, patterns, ask)) {
                why = say::NOT_SUSTAINED.with(values);
                break;
            }
            if gap >= days {
                return yes(scan, say::SUSTAINED.with(values));
            }
            let [label, gap] = values;
            why = say::SUSTAINED_TOO_SHORT.with([label, gap, ("needed", Value::number(days))]);
        }
        for scan in (self.baseline + 1..at).rev() {
            if !holds(self.shown(scan, patterns, ask)) {
                break;
            }
            let gap = self.days_between(scan, at);
            if gap >= days {
                let values = [("scan", self.label(scan).into()), ("days", Value::number(gap))];
                return yes(at, say::SUSTAINED_SINCE.with(values));
            }
        }
        Confirmation::of(Confirmed::No, None, why)
    }

    fn progression(&self, at: usize, pattern: Pattern, patterns: &Patterns, ask: &mut Ask) -> Outcome {
        let Pattern { mut reasons, dated, .. } = pattern;
        let outcome = |call, confirmation, reasons| Outcome { call, confirmation, reasons, dated };
        let criterion = self.rules.history.criterion;
        let in_window = match self.in_radiotherapy_window(at, ask) {
            Some(words) if self.window_holds(ask) => {
                reasons.push(Reason::of(RuleId::RadiotherapyWindow, words));
                true
            }
            _ => false,
        };
        if in_window {
            if let Some(words) = self.accepted(at, ask) {
                reasons.push(Reason::of(RuleId::WindowAccepts, words));
            } else if let Some(earliest) = self.rules.number(RuleId::ConfirmProgression) {
                let latest = self.rules.number(RuleId::ConfirmProgressionLatest);
                let (call, confirmation) = self.confirmed_progression(at, earliest, latest, patterns, ask);
                return outcome(call, Some(confirmation), reasons);
            } else {
                let words = say::NEITHER_FIELD_NOR_HISTOLOGY;
                reasons.insert(0, Reason::of(RuleId::WindowAccepts, words));
                return outcome(Call::CannotSay, None, reasons);
            }
        }
        let trial_days = self.rules.history.trial.confirm_progression_days.as_ref();
        let trial_days = trial_days.map(|stated| f64::from(stated.value));
        if criterion == Criterion::ImmunoRano && self.in_immunotherapy_window(at, ask, &mut reasons) {
            if self.clinical(at, &mut Look::Asking(ask)) == Some(Clinical::MuchWorse) {
                reasons.push(Reason::of(RuleId::ImmunotherapyMuchWorse, say::CLINICALLY_MUCH_WORSE));
                return outcome(Call::Progression, None, reasons);
            }
            let Some(days) = trial_days else {
                let words = self.rules.unstated(RuleId::ConfirmProgression);
                let confirmation = Confirmation::of(Confirmed::NotStated, None, words);
                return outcome(Call::PreliminaryProgression, Some(confirmation), reasons);
            };
            let (call, confirmation) = self.confirmed_progression(at, days, None, patterns, ask);
            return outcome(call, Some(confirmation), reasons);
        }
        if criterion == Criterion::ModifiedRano {
            let Some(days) = trial_days else {
                let words = self.rules.unstated(RuleId::ConfirmProgression);
                let confirmation = Confirmation::of(Confirmed::NotStated, None, words);
                return outcome(Call::Progression, Some(confirmation), reasons);
            };
            let (call, confirmation) = self.confirmed_progression(at, days, None, patterns, ask);
            return outcome(call, Some(confirmation), reasons);
        }
        outcome(Call::Progression, None, reasons)
    }

    /// Whether the scan lies in the window after radiotherapy, in words.
    fn in_radiotherapy_window(&self, at: usize, ask: &mut Ask) -> Option<Phrase> {
        let most = self.rules.number(RuleId::RadiotherapyWindow)?;
        // RANO 2.0: the window is of newly diagnosed disease.
        let history = self.rules.history;
        if history.criterion == Criterion::Rano20
            && value(history.disease.as_ref()) == Some(Disease::Recurrent)
        {
            return None;
        }
        let day = self.scans.get(at)?.day;
        match value(history.radiotherapy_end.as_ref()) {
            Some(Radiotherapy::None) => None,
            Some(Radiotherapy::Ended(when)) => {
                let days = day - when.number();
                let values = [("days", Value::number(days)), ("most", Value::number(most))];
                (0.0..=most).contains(&f64::from(days)).then(|| say::AFTER_RADIOTHERAPY.with(values))
            }
            None => {
                let input = (Input::RadiotherapyEnd, None, false);
                let within = Look::Asking(ask).fact(None, input, &[false, true])?;
                within.then(|| say::WITHIN_RADIOTHERAPY.with([("most", Value::number(most))]))
            }
        }
    }

    /// Whether the window applies to this disease.
    fn window_holds(&self, ask: &mut Ask) -> bool {
        let history = self.rules.history;
        if history.criterion != Criterion::Rano20 {
            return true;
        }
        let options = [Disease::NewlyDiagnosed, Disease::Recurrent];
        let known = value(history.disease.as_ref());
        let disease = Look::Asking(ask).fact(known, (Input::Disease, None, false), &options);
        disease == Some(Disease::NewlyDiagnosed)
    }

    /// What makes progression in the window after radiotherapy, if it is there.
    fn accepted(&self, at: usize, ask: &mut Ask) -> Option<Phrase> {
        let facts = self.facts(at);
        let mut look = Look::Asking(ask);
        if self.rules.history.criterion != Criterion::Rano20 {
            let field = facts.and_then(|facts| facts.field.as_ref());
            let input = (Input::Field, Some(at), false);
            if look.fact(value(field), input, &[Field::Inside, Field::Outside]) == Some(Field::Outside) {
                let by = Value::after(" ", field.and_then(Fact::by));
                return Some(say::OUTSIDE_FIELD.with([("by", by)]));
            }
        }
        let histology = facts.and_then(|facts| facts.histology.as_ref());
        let input = (Input::Histology, Some(at), true);
        let shown = look.fact(value(histology), input, &[Histology::NotDone, Histology::Tumour]);
        let by = Value::after(" ", histology.and_then(Fact::by));
        (shown == Some(Histology::Tumour)).then(|| say::HISTOLOGY_TUMOUR.with([("by", by)]))
    }

    /// Whether the scan lies in the window after the start of immunotherapy; adds the reason.
    fn in_immunotherapy_window(&self, at: usize, ask: &mut Ask, reasons: &mut Vec<Reason>) -> bool {
        let Some(months) = self.rules.number(RuleId::ImmunotherapyWindow) else { return false };
        let Some(scan) = self.scans.get(at) else { return false };
        let id = RuleId::ImmunotherapyWindow;
        let Some(treatments) = &self.rules.history.treatment else {
            let input = (Input::Treatment, None, false);
            return Look::Asking(ask).fact(None, input, &[false, true]) == Some(true);
        };
        let starts = treatments.iter().filter(|t| t.kind == TreatmentKind::Immunotherapy).map(|t| t.start);
        let start = starts.filter(|start| start.number() <= scan.day).max_by_key(|start| start.number());
        let within = start.is_some_and(|start| is_within_months(start, scan.when, months));
        if let Some(start) = start.filter(|_| within) {
            let values = [("months", Value::number(months)), ("start", start.value())];
            reasons.push(Reason::of(id, say::AFTER_IMMUNOTHERAPY.with(values)));
        }
        within
    }

    /// Progression that needs another scan that shows it too, `earliest` to `latest` days after or before.
    fn confirmed_progression(
        &self,
        at: usize,
        earliest: f64,
        latest: Option<f64>,
        patterns: &Patterns,
        ask: &mut Ask,
    ) -> (Call, Confirmation) {
        let interval = match latest {
            Some(latest) => say::DAYS_LATER_BETWEEN
                .with([("from", Value::number(earliest)), ("to", Value::number(latest))]),
            None => say::DAYS_LATER_LEAST.with([("days", Value::number(earliest))]),
        };
        let in_interval = |gap: f64| gap >= earliest && latest.is_none_or(|latest| gap <= latest);
        let mut why = vec![say::NO_SCAN.with([("interval", interval.into())])];
        for scan in at + 1..self.epoch.end {
            let (gap, label) = (self.days_between(at, scan), self.label(scan));
            let values = [("scan", label.into()), ("days", Value::number(gap))];
            if !in_interval(gap) {
                why.push(say::SCAN_IS_LATER.with(values));
                continue;
            }
            if self.shown(scan, patterns, ask) == Kind::Progression {
                let words = say::PROGRESSION_TOO.with(values);
                return (Call::Progression, Confirmation::of(Confirmed::Yes, Some(label), words));
            }
            why = vec![say::NOT_CONFIRMED.with(values)];
        }
        for scan in (self.baseline + 1..at).rev() {
            let gap = self.days_between(scan, at);
            if in_interval(gap) && self.shown(scan, patterns, ask) == Kind::Progression {
                let values = [("scan", self.label(scan).into()), ("days", Value::number(gap))];
                let words = say::PROGRESSION_ALREADY.with(values);
                return (Call::Progression, Confirmation::of(Confirmed::Yes, Some(self.label(at)), words));
            }
        }
        let why = say::CONFIRMATIONS.with([("all", Value::joined("; ", why))]);
        (Call::PreliminaryProgression, Confirmation::of(Confirmed::No, None, why))
    }
}

/// Whether `day` is at most so many months after `start`, by calendar; by days of the mean month where days are numbers.
fn is_within_months(start: When, day: When, months: f64) -> bool {
    const DAYS_OF_MONTH: f64 = 30.4375;
    match (start, day) {
        (When::Date(start), When::Date(day)) => {
            let whole = jiff::Span::new().try_months(months as i64);
            whole.and_then(|span| start.checked_add(span)).is_ok_and(|end| day <= end)
        }
        (start, day) => f64::from(day.number() - start.number()) <= months * DAYS_OF_MONTH,
    }
}
