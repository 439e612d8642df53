//! Sums, changes and margins as they are reported, and as the words of reasons.

use super::{
    history::Repeatability,
    judge::Judge,
    margin::{Margin, false_fall, false_rise, margin},
    missing::{Input, Unknown},
    phrases as say,
    result::{Category, Missing, Quantity, Reason, Reference, SumReport, TargetReport},
    rules::RuleId,
    sums::{Line, Minor, Sum},
    targets::Targets,
};
use crate::phrase::{Phrase, Value};

/// A change in words: `+50 %`.
fn percent(change: f64) -> Value {
    Value::Number(format!("{change:+.1} %"))
}

fn change(sum: f64, reference: f64) -> Option<f64> {
    (reference > 0.0).then(|| 100.0 * (sum / reference - 1.0))
}

impl Judge<'_> {
    /// What the sum of a compartment says, with its numbers.
    pub fn sum_reason(&self, line: &Line<'_>, at: usize, category: Category) -> Reason {
        let t = &line.thresholds;
        let whole = |scan: usize| line.at(scan).and_then(Sum::whole);
        let unit = self.unit();
        let sum = whole(at).map_or_else(
            || Phrase::from(say::UNKNOWN).into(),
            |sum| Value::number(format!("{sum:.1} {unit}")),
        );
        let lowest = line.nadir_before(at);
        let from_baseline = whole(at).zip(whole(self.baseline)).and_then(|(sum, base)| change(sum, base));
        let from_lowest = whole(at).zip(lowest).and_then(|(sum, lowest)| change(sum, lowest.sum));
        let compared_with_baseline = |threshold: Option<f64>| {
            let change = ("change", percent(from_baseline?));
            Some(match threshold {
                Some(threshold) => say::FROM_BASELINE.with([change, ("threshold", Value::number(threshold))]),
                None => say::FROM_BASELINE_ALONE.with([change]),
            })
        };
        let compared_with_lowest = || {
            let lowest = lowest?;
            let [change, low, scan, threshold] = [
                ("change", percent(from_lowest?)),
                ("lowest", Value::number(format!("{:.1}", lowest.sum))),
                ("scan", self.label(lowest.at).into()),
                ("threshold", Value::number(t.progression)),
            ];
            Some(match lowest.scans {
                1 => say::FROM_LOWEST_OF_ONE.with([change, low, scan, threshold]),
                scans => {
                    say::FROM_LOWEST.with([change, low, scan, ("scans", Value::number(scans)), threshold])
                }
            })
        };
        let after_zero = || say::AFTER_ZERO.with([("threshold", Value::number(t.progression))]);
        let changes: Vec<Phrase> = match category {
            Category::Complete | Category::Reappeared => Vec::new(),
            Category::Progression => vec![compared_with_lowest().unwrap_or_else(after_zero)],
            Category::Partial => compared_with_baseline(Some(t.partial)).into_iter().collect(),
            Category::Minor | Category::MinorOrStable => {
                let minor = if let Minor::Percent(minor) = t.minor { Some(minor) } else { None };
                compared_with_baseline(minor).into_iter().collect()
            }
            Category::Stable => [compared_with_baseline(Some(t.partial)), compared_with_lowest()]
                .into_iter()
                .flatten()
                .collect(),
        };
        let id = match category {
            Category::Complete => RuleId::CompleteResponse,
            Category::Progression => t.progression_rule,
            Category::Partial => t.partial_rule,
            Category::Minor | Category::MinorOrStable => RuleId::MinorResponse,
            Category::Stable => RuleId::StableDisease,
            Category::Reappeared => RuleId::Reappearance,
        };
        let words = match category {
            Category::Complete => say::ALL_GONE.into(),
            Category::Reappeared => say::SUM_REAPPEARED.with([("sum", sum)]),
            _ => {
                let changes = Value::Phrases { before: ", ", between: ", ", all: changes };
                say::SUM.with([("sum", sum), ("changes", changes)])
            }
        };
        Reason::of(id, words)
    }

    /// The sum of a compartment at a scan.
    pub fn sum_report(&self, line: &Line<'_>, at: usize, lesions: &[TargetReport]) -> Option<SumReport> {
        if !matches!(line.targets, Targets::Known(_)) {
            return None;
        }
        let whole = |scan: usize| line.at(scan).and_then(Sum::whole);
        let (sum, base, lowest) = (whole(at), whole(self.baseline), line.nadir_before(at));
        let reference = |scan: usize, sum, scans| Reference { date: self.label(scan).to_owned(), sum, scans };
        let after_baseline = at > self.baseline;
        let compared = |reference: Option<f64>| sum.zip(reference).filter(|_| after_baseline);
        let from_baseline = compared(base);
        let from_lowest = compared(lowest.map(|lowest| lowest.sum));
        let by_sum = compared(base).zip(lowest).map(|((sum, base), low)| {
            line.thresholds.category(sum, base, low.sum, low.above_0.unwrap_or(base))
        });
        let stated = self.stated_repeatability();
        let margin_of = |pair: Option<(f64, f64)>, thresholds: &[f64]| -> Option<Margin> {
            let (sum, reference) = pair.filter(|&(sum, reference)| sum > 0.0 && reference > 0.0)?;
            Some(margin(sum / reference, stated?, thresholds))
        };
        Some(SumReport {
            compartment: line.compartment,
            quantity: self.quantity,
            sum,
            baseline: base.map(|sum| reference(self.baseline, sum, 1)),
            nadir: lowest.map(|lowest| reference(lowest.at, lowest.sum, lowest.scans)),
            change_from_baseline_percent: from_baseline.and_then(|(sum, base)| change(sum, base)),
            change_from_nadir_percent: from_lowest.and_then(|(sum, lowest)| change(sum, lowest)),
            by_sum,
            margin_from_baseline: margin_of(from_baseline, &line.thresholds.changes_from_baseline()),
            margin_from_nadir: margin_of(from_lowest, &[line.thresholds.progression]),
            noise_alone: stated.and_then(|stated| {
                let t = &line.thresholds;
                match (by_sum?, t.minor) {
                    (Category::Progression, _) => lowest
                        .filter(|lowest| lowest.sum > 0.0)
                        .map(|lowest| false_rise(t.progression / 100.0, stated.relative_sd, lowest.scans)),
                    (Category::Partial, _) => Some(false_fall(t.partial / 100.0, stated.relative_sd)),
                    (Category::Minor, Minor::Percent(minor)) => {
                        Some(false_fall(minor / 100.0, stated.relative_sd))
                    }
                    _ => None,
                }
            }),
            lesions: lesions.to_vec(),
        })
    }

    fn stated_repeatability(&self) -> Option<&Repeatability> {
        let stated = &self.rules.history.repeatability;
        match self.quantity {
            Quantity::ProductMm2 => stated.product.as_ref(),
            Quantity::LongestMm => stated.longest.as_ref(),
            Quantity::VolumeMl => stated.volume.as_ref(),
        }
    }

    /// An unknown input in words.
    pub fn missing(&self, unknown: Unknown, assumed: bool) -> Missing {
        let input = unknown.input;
        let mut words = Phrase::from(input.template());
        let lines = self.lines.iter().filter(|line| self.sum_input(line) == input);
        for line in lines {
            let lacking = unknown.scan.and_then(|scan| line.at(scan)).map(|sum| sum.lacking.join(", "));
            let lesions = Value::Text(lacking.unwrap_or_default());
            words = say::INPUT_NOT_MEASURED.with([("input", words.into()), ("lesions", lesions)]);
        }
        if input == Input::Targets {
            let why = self.lines.iter().filter_map(|line| match &line.targets {
                Targets::Unknown(why) => Some(why.clone()),
                _ => None,
            });
            let why = Value::joined("; ", why.collect());
            words = say::INPUT_WHY.with([("input", words.into()), ("why", why)]);
        }
        let assumption = match input {
            Input::Clinical => say::ASSUMED_NOT_WORSE,
            Input::Steroids => say::ASSUMED_NO_STEROIDS,
            Input::Technique => say::ASSUMED_UNCHANGED,
            Input::Histology => say::ASSUMED_NOT_DONE,
            Input::CallAt => say::ASSUMED_AS_IT_STANDS,
            _ => say::ASSUMED_NOT_LOWER,
        };
        let date = unknown.scan.map(|scan| self.label(scan));
        Missing::of(input, date, words, assumed.then(|| assumption.into()))
    }
}
