//! Response criteria of brain tumours: the call at each scan, by diameters and by volume, with its reasons, what is unknown,
//! and what the repeatability of measurements leaves of it.
//!
//! Rules are rows of [`RULES`]; what no source that was read states ([`UNSTATED`]) isn't applied: a call that needs it can't be
//! made, unless the trial's own value stands in the [`History`].
//!
//! An epoch is the time between surgeries. Its baseline is the stated scan, else the criterion's, else, after a surgery,
//! the first scan. Each later scan is compared with the baseline (response) and with the lowest sum of the scans before it
//! (progression). Percentages are compared in `f64` without rounding; a threshold counts as reached within 1e-9.

mod bt_rads;
mod call;
mod check;
mod effects;
mod fact;
mod history;
mod judge;
mod margin;
mod measured;
mod missing;
mod pattern;
mod phrases;
mod report;
mod result;
mod rules;
mod sums;
mod targets;
#[cfg(test)]
mod tests;
mod timeline;
mod trial;

pub use bt_rads::{Answer, BtRads, Category as BtRadsCategory, Question, bt_rads, bt_rads_answered};
pub use fact::{Fact, Label, PROGRAM, Radiotherapy, Stated, When};
pub use history::{
    Assessment, Clinical, Compartment, Disease, Field, Flair, Histology, History, HistoryError, Measurement,
    NewLesion, NonTarget, Repeatabilities, Repeatability, ScanFacts, SteroidReason, Surgery, Technique,
    Treatment, TreatmentKind,
};
pub use margin::{COVERAGE, Margin, false_fall, false_rise};
pub use measured::{Evaluated, evaluate_lesions, measured_compartments, name_of, unstated_new};
pub use missing::Input;
pub use phrases::ALL as PHRASES;
pub use result::{
    Call, Category, Confirmation, Confirmed, DateResponse, Judgement, Missing, Quantity, Reason, Reference,
    Response, SumReport, TargetReport,
};
pub use rules::{Criterion, Mark, RULES, Rule, RuleId, UNSTATED, Unstated};
pub use trial::{Part, Trial, TrialNumber, TrialValue};

use crate::phrase::{Phrase, Value};
use call::Outcome;
use judge::Judge;
use missing::explore;
use phrases as say;
use sums::{Line, Thresholds, sum};
use targets::{Rules, Targets, targets};
use timeline::{Epoch, Scan, compartments, epochs, scans};

/// Evaluates a history with the measurements in it and `measurements`, in any order.
///
/// # Errors
/// [`HistoryError`], one line: what [`History::check`] refuses, two scans on one day, scans without a day, dates mixed with
/// numbers of days, a lesion measured twice at a date or in two compartments, names of scans or lesions that nothing else
/// has.
pub fn evaluate(history: &History, measurements: &[Measurement]) -> Result<Response, HistoryError> {
    history.check()?;
    let scans = scans(history, measurements)?;
    let epochs = epochs(history, &scans)?;
    let mut dates = Vec::new();
    for epoch in &epochs {
        let by_diameters =
            if history.criterion == Criterion::RanoBm { Quantity::LongestMm } else { Quantity::ProductMm2 };
        let by_diameters = judgements(history, &scans, epoch, by_diameters);
        let by_volume = judgements(history, &scans, epoch, Quantity::VolumeMl);
        let indices = epoch.first..epoch.end;
        for ((at, by_diameters), by_volume) in indices.zip(by_diameters).zip(by_volume) {
            let day = |scan: usize| scans.get(scan).map(|scan| scan.day);
            let baseline = epoch.baseline.as_ref().ok().filter(|&&baseline| baseline <= at);
            dates.push(DateResponse {
                date: scans.get(at).map_or_else(String::new, |scan| scan.label.to_owned()),
                days_from_baseline: baseline.and_then(|&baseline| Some(day(at)? - day(baseline)?)),
                by_diameters,
                by_volume,
            });
        }
    }
    Ok(Response { criterion: history.criterion, assessment: history.assessment, dates })
}

fn plain(call: Call, reason: Reason) -> Judgement {
    Judgement {
        call,
        possible: Vec::new(),
        dated: None,
        confirmation: None,
        reasons: vec![reason],
        missing: Vec::new(),
        imaging_only: false,
        sums: Vec::new(),
    }
}

/// The judgements of all scans of an epoch.
fn judgements(
    history: &History,
    scans: &[Scan<'_>],
    epoch: &Epoch<'_>,
    quantity: Quantity,
) -> Vec<Judgement> {
    let rules = Rules { history };
    let thresholds =
        |&compartment: &Compartment| Some((compartment, Thresholds::of(rules, compartment, quantity)?));
    let stated: Option<Vec<_>> = compartments(history).iter().map(thresholds).collect();
    let indices = epoch.first..epoch.end;
    let Some(stated) = stated else {
        let words = say::UNSTATED.with([
            ("criteria", history.criterion.name().into()),
            ("what", Phrase::from(say::RULE_BY_VOLUME).into()),
            ("way", Value::after("", None)),
        ]);
        return indices.map(|_| plain(Call::CannotSay, Reason::plain(words.clone()))).collect();
    };
    let baseline = match &epoch.baseline {
        Ok(baseline) => *baseline,
        Err(lacking) => {
            let missing = |input: &Input| Missing::of(*input, None, input.template().into(), None);
            let judgement = Judgement {
                missing: lacking.iter().map(missing).collect(),
                ..plain(Call::CannotSay, epoch.why.clone())
            };
            return indices.map(|_| judgement.clone()).collect();
        }
    };
    let mut lesions = Vec::new();
    let lines = stated.into_iter().filter_map(|(compartment, thresholds)| {
        let (targets, reports) = targets(rules, epoch, scans.get(baseline)?, scans, compartment);
        let names = if let Targets::Known(names) = &targets { names.as_slice() } else { &[] };
        let after = scans.get(baseline..epoch.end).unwrap_or_default();
        let sums = after.iter().map(|scan| sum(scan, names.iter().copied(), quantity)).collect();
        lesions.push(reports);
        Some(Line { compartment, targets, thresholds, from: baseline, sums })
    });
    let lines: Vec<Line<'_>> = lines.collect();
    let judge = Judge { rules, scans, epoch, baseline, quantity, lines };
    let patterns: Vec<_> = (0..epoch.end)
        .map(|at| (at > baseline).then(|| explore(|ask| judge.pattern(at, ask), |pattern| pattern.kind)))
        .collect();
    let judgement = |at: usize| {
        let mut judgement = match at.cmp(&baseline) {
            std::cmp::Ordering::Less => plain(Call::BeforeBaseline, epoch.why.clone()),
            std::cmp::Ordering::Equal => plain(Call::Baseline, epoch.why.clone()),
            std::cmp::Ordering::Greater => judged(&judge, at, &patterns),
        };
        if at >= baseline {
            let reports = judge.lines.iter().zip(&lesions);
            if at == baseline {
                judgement.reasons.extend(epoch.against.clone());
            }
            judgement.sums =
                reports.filter_map(|(line, lesions)| judge.sum_report(line, at, lesions)).collect();
        }
        judgement
    };
    indices.map(judgement).collect()
}

/// The judgement of a scan after the baseline.
fn judged(judge: &Judge<'_>, at: usize, patterns: &call::Patterns) -> Judgement {
    let explored = explore(|ask| judge.call(at, patterns, ask), |outcome: &Outcome| outcome.call);
    let calls = |outcomes: &[Outcome]| outcomes.iter().map(|outcome| outcome.call).collect::<Vec<_>>();
    let possible = if explored.all.len() > 1 { calls(&explored.all) } else { Vec::new() };
    let missing: Vec<Missing> =
        explored.missing.iter().map(|&(unknown, assumed)| judge.missing(unknown, assumed)).collect();
    let outcome = explored.given.unwrap_or_else(|| {
        let open = calls(&explored.under_assumptions);
        let words = |call: Call| if call == Call::CannotSay { say::STILL_NO_CALL } else { call.template() };
        let open: Vec<Phrase> = open.into_iter().map(|call| words(call).into()).collect();
        let words: Phrase = if explored.complete {
            say::LEAVES.with([("calls", Value::joined("; ", open))])
        } else {
            say::TOO_MUCH_UNKNOWN.into()
        };
        Outcome {
            call: Call::CannotSay,
            confirmation: None,
            reasons: vec![Reason::plain(words)],
            dated: None,
        }
    });
    Judgement {
        call: outcome.call,
        possible,
        dated: outcome.dated.map(|scan| judge.label(scan).to_owned()),
        confirmation: outcome.confirmation,
        reasons: outcome.reasons,
        imaging_only: missing.iter().any(|m| matches!(m.input, Input::Steroids | Input::Clinical)),
        missing,
        sums: Vec::new(),
    }
}
