//! Sums, changes and margins as they are reported, and as the words of reasons.

use super::{
    history::Repeatability,
    judge::Judge,
    margin::{Margin, false_fall, false_rise, margin},
    missing::{Input, Unknown},
    result::{Category, Missing, Quantity, Reason, Reference, SumReport, TargetReport},
    rules::RuleId,
    sums::{Line, Minor, Sum},
    targets::Targets,
};

/// A change in words: `+50 %`.
fn percent(change: f64) -> String {
    format!("{change:+.1} %")
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
        let sum = whole(at).map_or_else(|| "unknown".to_owned(), |sum| format!("{sum:.1} {unit}"));
        let lowest = line.nadir_before(at);
        let from_baseline = whole(at).zip(whole(self.baseline)).and_then(|(sum, base)| change(sum, base));
        let from_lowest = whole(at).zip(lowest).and_then(|(sum, lowest)| change(sum, lowest.sum));
        let compared = |change: Option<f64>, threshold: String| {
            change.map_or_else(String::new, |change| format!(", {}{threshold}", percent(change)))
        };
        let lowest_words = lowest.map_or_else(String::new, |lowest| {
            let scans = if lowest.scans == 1 { "scan" } else { "scans" };
            format!(
                "the lowest ({:.1} at {}, of {} {scans})",
                lowest.sum,
                self.label(lowest.at),
                lowest.scans
            )
        });
        let (id, words) = match category {
            Category::Complete => (RuleId::CompleteResponse, "all targets are gone".to_owned()),
            Category::Progression => {
                let than = format!(" from {lowest_words}, threshold +{} %", t.progression);
                let words = if from_lowest.is_some() {
                    compared(from_lowest, than)
                } else {
                    format!(", +{} % or more from an earlier sum, after a lowest sum of 0", t.progression)
                };
                (t.progression_rule, format!("sum {sum}{words}"))
            }
            Category::Partial => {
                let than = format!(" from the baseline, threshold -{} %", t.partial);
                (t.partial_rule, format!("sum {sum}{}", compared(from_baseline, than)))
            }
            Category::Minor | Category::MinorOrStable => {
                let minor = if let Minor::Percent(minor) = t.minor {
                    format!(", threshold -{minor} %")
                } else {
                    String::new()
                };
                (
                    RuleId::MinorResponse,
                    format!("sum {sum}{}", compared(from_baseline, format!(" from the baseline{minor}"))),
                )
            }
            Category::Stable => {
                let base = compared(from_baseline, format!(" from the baseline, threshold -{} %", t.partial));
                let low =
                    compared(from_lowest, format!(" from {lowest_words}, threshold +{} %", t.progression));
                (RuleId::StableDisease, format!("sum {sum}{base}{low}"))
            }
            Category::Reappeared => {
                (RuleId::Reappearance, format!("sum {sum} after a lowest sum of 0: no ratio"))
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
        let mut words = input.to_string();
        let lines = self.lines.iter().filter(|line| self.sum_input(line) == input);
        for line in lines {
            let lacking = unknown.scan.and_then(|scan| line.at(scan)).map(|sum| sum.lacking.join(", "));
            words = format!("{words}: not measured: {}", lacking.unwrap_or_default());
        }
        if input == Input::Targets {
            let why = self.lines.iter().filter_map(|line| match &line.targets {
                Targets::Unknown(why) => Some(why.as_str()),
                _ => None,
            });
            words = format!("{words}: {}", why.collect::<Vec<_>>().join("; "));
        }
        let assumption = match input {
            Input::Clinical => "not worse",
            Input::Steroids => "none, or not raised",
            Input::Technique => "unchanged",
            Input::Histology => "not done",
            Input::CallAt => "as it stands",
            _ => "not lower than the lowest that is measured",
        };
        Missing {
            input,
            date: unknown.scan.map(|scan| self.label(scan).to_owned()),
            words,
            assumed: assumed.then(|| assumption.to_owned()),
        }
    }
}
