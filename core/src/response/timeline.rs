//! Scans in the order of their days, and the epochs that surgery makes of them, each with its baseline and targets.

use std::collections::{BTreeMap, HashMap};

use super::{
    check::{check_measurement, wrong},
    fact::{Fact, Label, Radiotherapy, When},
    history::{
        Assessment, Compartment, Disease, History, HistoryError, MAX_MEASUREMENTS, MAX_SCANS, Measurement,
        ScanFacts,
    },
    missing::Input,
    phrases as say,
    result::Reason,
    rules::{Criterion, RuleId, rule, unstated_phrase},
};
use crate::phrase::Value;

/// A scan.
pub(super) struct Scan<'a> {
    pub label: &'a str,
    pub when: When,
    pub day: i32,
    pub facts: Option<&'a ScanFacts>,
    pub lesions: BTreeMap<&'a str, &'a Measurement>,
}

/// The scans from one surgery to the next.
pub(super) struct Epoch<'a> {
    /// Index of the first scan.
    pub first: usize,
    /// Index after that of the last scan.
    pub end: usize,
    /// The baseline, or what is lacking to choose it.
    pub baseline: Result<usize, Vec<Input>>,
    /// How the baseline was chosen, or why not.
    pub why: Reason,
    /// What the criteria say against a baseline that was stated.
    pub against: Option<Reason>,
    /// Targets that the user states.
    pub stated_targets: Option<&'a [String]>,
}

fn when_of(label: &str, days: Option<i32>, place: &str) -> Result<When, HistoryError> {
    match (When::of_label(label), days) {
        (Some(date), None) => Ok(date),
        (None, Some(days)) => Ok(When::Day(days)),
        (Some(_), Some(days)) => Err(wrong(place, format!("days = {days} beside a date"), "one of them")),
        (None, None) => Err(wrong(place, "neither an ISO date nor days", "one of them")),
    }
}

/// All scans that facts or measurements name, in the order of their days.
pub(super) fn scans<'a>(
    history: &'a History,
    more: &'a [Measurement],
) -> Result<Vec<Scan<'a>>, HistoryError> {
    let mut by_label: HashMap<&str, Scan<'a>> = HashMap::new();
    let mut compartments: HashMap<&str, Compartment> = HashMap::new();
    let add = |by_label: &mut HashMap<&'a str, Scan<'a>>, label: &'a Label, days, place: &str| {
        let label = label.0.as_str();
        let when = when_of(label, days, place)?;
        let new = Scan { label, when, day: when.number(), facts: None, lesions: BTreeMap::new() };
        let scan = by_label.entry(label).or_insert(new);
        if scan.when != when {
            return Err(wrong(place, format!("{when}"), format!("{}, as stated elsewhere", scan.when)));
        }
        Ok(label)
    };
    for facts in &history.date {
        let place = format!("history, [[date]] {}", facts.date);
        let label = add(&mut by_label, &facts.date, facts.days, &place)?;
        let before = by_label.get_mut(label).and_then(|scan| scan.facts.replace(facts));
        if before.is_some() {
            return Err(wrong(&place, "this date twice", "one [[date]] of each"));
        }
    }
    let all = history.measurement.len() + more.len();
    if all > MAX_MEASUREMENTS {
        return Err(wrong("measurements", format!("{all}"), format!("at most {MAX_MEASUREMENTS}")));
    }
    for measurement in history.measurement.iter().chain(more) {
        check_measurement(measurement)?;
        let lesion = measurement.lesion.as_str();
        let place = format!("measurement of {lesion} at {}", measurement.date);
        let label = add(&mut by_label, &measurement.date, measurement.days, &place)?;
        let before = by_label.get_mut(label).and_then(|scan| scan.lesions.insert(lesion, measurement));
        if before.is_some() {
            return Err(wrong(&place, "this lesion and date twice", "one measurement of each"));
        }
        let compartment = *compartments.entry(lesion).or_insert(measurement.compartment);
        if compartment != measurement.compartment {
            return Err(wrong(&place, "another compartment than at another date", "the same at all dates"));
        }
    }
    let mut scans: Vec<Scan<'a>> = by_label.into_values().collect();
    if scans.len() > MAX_SCANS {
        return Err(wrong("history", format!("{} scans", scans.len()), format!("at most {MAX_SCANS}")));
    }
    scans.sort_by(|a, b| (a.day, a.label).cmp(&(b.day, b.label)));
    check_days(history, &scans)?;
    let after_surgery = history.surgery.iter().filter_map(|surgery| surgery.targets.as_deref());
    let named = history.target_names().into_iter().chain(after_surgery);
    for lesion in named.flatten().chain(history.non_target_names()) {
        if !compartments.contains_key(lesion.as_str()) {
            return Err(wrong(
                "history",
                format!("{lesion} among targets or non_targets"),
                "a measured lesion",
            ));
        }
    }
    Ok(scans)
}

/// Days are of one kind, and no day has two scans.
fn check_days(history: &History, scans: &[Scan<'_>]) -> Result<(), HistoryError> {
    for pair in scans.windows(2) {
        if let [a, b] = pair
            && a.day == b.day
            && matches!(a.when, When::Date(_)) == matches!(b.when, When::Date(_))
        {
            let found = format!("{:?} and {:?} on one day", a.label, b.label);
            return Err(wrong("history", found, "one scan a day"));
        }
    }
    let events = history.surgery.iter().map(|surgery| surgery.date);
    let events = events.chain(history.treatment.iter().flatten().map(|treatment| treatment.start));
    let end = history.radiotherapy_end.as_ref().and_then(|end| match end.value {
        Radiotherapy::Ended(when) => Some(when),
        Radiotherapy::None => None,
    });
    let mut days = scans.iter().map(|scan| scan.when).chain(events).chain(end);
    let is_date = |when: When| matches!(when, When::Date(_));
    let first = days.next();
    match first.and_then(|first| days.find(|&day| is_date(day) != is_date(first)).map(|day| (first, day))) {
        Some((a, b)) => Err(wrong("history", format!("{a} and {b}"), "dates only, or numbers of days only")),
        None => Ok(()),
    }
}

/// The epochs: before the first surgery, and after each. A scan of the day of surgery is before it.
pub(super) fn epochs<'a>(history: &'a History, scans: &[Scan<'a>]) -> Result<Vec<Epoch<'a>>, HistoryError> {
    let mut surgeries: Vec<_> = history.surgery.iter().collect();
    surgeries.sort_by_key(|surgery| surgery.date.number());
    let starts = std::iter::once(None).chain(surgeries.into_iter().map(Some));
    let starts: Vec<_> = starts
        .map(|surgery| {
            let after = surgery.map_or(i32::MIN, |surgery| surgery.date.number());
            (
                surgery,
                after,
                if surgery.is_some() { scans.partition_point(|scan| scan.day <= after) } else { 0 },
            )
        })
        .collect();
    let position = |label: &Label, place: &str| {
        let found = scans.iter().position(|scan| scan.label == label.0);
        found.ok_or_else(|| wrong(place, format!("baseline = {label}"), "a scan with facts or measurements"))
    };
    let stated = history.baseline.as_ref().map(|fact| position(&fact.value, "history")).transpose()?;
    let mut epochs: Vec<Epoch<'a>> = Vec::new();
    let mut has_targets = false;
    for (k, &(surgery, after, first)) in starts.iter().enumerate() {
        let end = starts.get(k + 1).map_or(scans.len(), |next| next.2);
        let own = surgery.and_then(|surgery| surgery.baseline.as_ref());
        let own = own.map(|label| position(label, "history, [[surgery]]")).transpose()?;
        if let Some(own) = own.filter(|own| !(first..end).contains(own)) {
            let found = scans.get(own).map_or("", |scan| scan.label);
            return Err(wrong(
                "history, [[surgery]]",
                format!("baseline = {found}"),
                "a scan after it, before the next",
            ));
        }
        let in_epoch = stated.filter(|stated| (first..end).contains(stated));
        let was_judged = epochs.iter().any(|epoch| epoch.baseline.is_ok());
        let by_rule = baseline_by_rule(history, scans, first, end, after);
        let mut against = None;
        // A proposal gives way to what the criteria choose.
        let is_proposed = history.baseline.as_ref().is_some_and(Fact::is_proposed);
        let in_epoch = in_epoch.filter(|_| !is_proposed || by_rule.0.is_err());
        let (baseline, why) = if let Some(chosen) = own.or(in_epoch) {
            against = own.is_none().then(|| said_against(chosen, &by_rule)).flatten();
            let label = scans.get(chosen).map_or("", |scan| scan.label);
            let how =
                if own.is_none() && is_proposed { say::BASELINE_FIRST_OF_TWO } else { say::BASELINE_STATED };
            let words = how.with([("scan", label.into())]);
            (Ok(chosen), Reason { rule: own.map(|_| RuleId::SurgeryResets), ..Reason::plain(words) })
        } else {
            match by_rule {
                (Err(_), _) if was_judged && first < end => {
                    let label = scans.get(first).map_or("", |scan| scan.label);
                    let words = say::BASELINE_AFTER_SURGERY.with([("scan", label.into())]);
                    (Ok(first), Reason::of(RuleId::SurgeryResets, words))
                }
                other => other,
            }
        };
        let stated_targets = surgery.and_then(|surgery| surgery.targets.as_deref());
        let stated_targets =
            stated_targets.or(history.target_names().filter(|_| !has_targets && baseline.is_ok()));
        has_targets |= baseline.is_ok();
        epochs.push(Epoch { first, end, baseline, why, against, stated_targets });
    }
    Ok(epochs)
}

type Chosen = (Result<usize, Vec<Input>>, Reason);

/// What the criteria's own choice says against a stated baseline; `None` where it is the same scan, or can't be made.
fn said_against(stated: usize, by_rule: &Chosen) -> Option<Reason> {
    let (chosen, why) = by_rule;
    match chosen {
        Ok(chosen) if *chosen == stated => None,
        Ok(_) => Some(Reason {
            rule: why.rule,
            ..Reason::plain(say::CRITERIA_CHOOSE.with([("baseline", why.phrase.clone().into())]))
        }),
        Err(_) => {
            let none = [say::NO_SCAN_BEFORE_TREATMENT, say::NO_SCAN_IN_DAYS, say::NO_SCAN_AFTER_RADIOTHERAPY];
            none.contains(&why.phrase.template).then(|| why.clone())
        }
    }
}

/// The baseline as the criterion states it, from sources that were read.
fn baseline_by_rule(history: &History, scans: &[Scan<'_>], first: usize, end: usize, after: i32) -> Chosen {
    let criterion = history.criterion;
    let number = |id| rule(criterion, id).and_then(|rule| rule.number);
    let in_epoch = || scans.iter().enumerate().take(end).skip(first);
    let label = |at: usize| scans.get(at).map_or("", |scan| scan.label);
    let disease = history.disease.as_ref().map(|fact| fact.value);
    if let Some(most) = number(RuleId::BaselineBeforeTreatment) {
        let id = RuleId::BaselineBeforeTreatment;
        let Some(treatments) = &history.treatment else {
            return (Err(vec![Input::Baseline, Input::Treatment]), Reason::of(id, say::NO_TREATMENT_STATED));
        };
        let start = treatments.iter().map(|t| t.start.number()).filter(|&start| start > after).min();
        let eligible =
            |day: i32| start.is_some_and(|start| (0.0..=most).contains(&(f64::from(start) - f64::from(day))));
        let chosen = in_epoch().filter(|(_, scan)| eligible(scan.day)).map(|(at, _)| at).next_back();
        let days = ("days", Value::number(most));
        return match chosen {
            Some(at) => {
                let words = say::BASELINE_BEFORE_TREATMENT.with([("scan", label(at).into()), days]);
                (Ok(at), Reason::of(id, words))
            }
            None => (Err(vec![Input::Baseline]), Reason::of(id, say::NO_SCAN_BEFORE_TREATMENT.with([days]))),
        };
    }
    let earliest = number(RuleId::BaselineEarliest);
    let is_after_radiotherapy = rule(criterion, RuleId::BaselineAfterRadiotherapy).is_some();
    let id = if earliest.is_some() { RuleId::BaselineEarliest } else { RuleId::BaselineAfterRadiotherapy };
    if earliest.is_none() && !is_after_radiotherapy {
        return (Err(vec![Input::Baseline]), Reason::of(id, unstated_phrase(criterion, id)));
    }
    if disease == Some(Disease::Recurrent) {
        let id = RuleId::BaselineBeforeTreatment;
        return (Err(vec![Input::Baseline]), Reason::of(id, unstated_phrase(criterion, id)));
    }
    let mut lacking = vec![Input::Baseline];
    lacking.extend(disease.is_none().then_some(Input::Disease));
    let ended = match history.radiotherapy_end.as_ref().map(|fact| fact.value) {
        Some(Radiotherapy::Ended(when)) => when.number(),
        Some(Radiotherapy::None) => {
            return (Err(vec![Input::Baseline]), Reason::of(id, say::NO_RADIOTHERAPY));
        }
        None => {
            lacking.push(Input::RadiotherapyEnd);
            return (Err(lacking), Reason::of(id, say::NO_RADIOTHERAPY_END));
        }
    };
    if disease.is_none() {
        return (Err(lacking), Reason::of(id, say::NO_DISEASE_STATED));
    }
    let latest = number(RuleId::BaselineLatest).unwrap_or(f64::INFINITY);
    let from = earliest.unwrap_or(0.0);
    // Radiotherapy before the surgery that began this epoch has its baseline before that surgery.
    let eligible = |day: i32| {
        let days = f64::from(day) - f64::from(ended);
        ended >= after && days > 0.0 && (from..=latest).contains(&days)
    };
    match in_epoch().find(|(_, scan)| eligible(scan.day)) {
        Some((at, scan)) => {
            let days = scan.day - ended;
            let values = [("scan", label(at).into()), ("days", Value::number(days))];
            (Ok(at), Reason::of(id, say::BASELINE_AFTER_RADIOTHERAPY.with(values)))
        }
        None if earliest.is_some() => {
            let values = [("from", Value::number(from)), ("to", Value::number(latest))];
            (Err(lacking), Reason::of(id, say::NO_SCAN_IN_DAYS.with(values)))
        }
        None => (Err(lacking), Reason::of(id, say::NO_SCAN_AFTER_RADIOTHERAPY)),
    }
}

/// The compartments that are summed, each on its own.
pub(super) fn compartments(history: &History) -> &'static [Compartment] {
    match (history.criterion, history.assessment) {
        (Criterion::RanoLgg, _) | (_, Some(Assessment::NonEnhancing)) => &[Compartment::NonEnhancing],
        (_, Some(Assessment::Mixed)) => &[Compartment::Enhancing, Compartment::NonEnhancing],
        _ => &[Compartment::Enhancing],
    }
}

/// The value of a fact.
pub(super) fn value<T: Copy>(fact: Option<&Fact<T>>) -> Option<T> {
    fact.map(|fact| fact.value)
}
