//! Sums of the targets, what they are compared with, and what they say by themselves.

use super::{
    history::{Compartment, Measurement},
    result::{Category, Quantity},
    rules::{Criterion, RuleId},
    targets::{Rules, TOLERANCE, Targets, at_least},
    timeline::Scan,
};

/// The sum of some lesions at a scan.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sum {
    /// Sum of those that are measured: at least as much as the whole.
    pub measured: f64,
    /// Those that aren't.
    pub lacking: Vec<String>,
}

impl Sum {
    pub fn whole(&self) -> Option<f64> {
        self.lacking.is_empty().then_some(self.measured)
    }
}

/// Size of a lesion; 0 if it is gone, `None` if it isn't measured.
fn size(lesion: &Measurement, quantity: Quantity) -> Option<f64> {
    if lesion.gone {
        return Some(0.0);
    }
    match quantity {
        Quantity::ProductMm2 => lesion.product(),
        Quantity::LongestMm => lesion.longest_mm,
        Quantity::VolumeMl => lesion.volume_ml,
    }
}

/// The sum of `lesions` at `scan`.
pub(super) fn sum<'s>(scan: &Scan<'_>, lesions: impl Iterator<Item = &'s str>, quantity: Quantity) -> Sum {
    let mut sum = Sum { measured: 0.0, lacking: Vec::new() };
    for name in lesions {
        match scan.lesions.get(name).and_then(|lesion| size(lesion, quantity)) {
            Some(size) => sum.measured += size,
            None => sum.lacking.push(name.to_owned()),
        }
    }
    sum
}

/// What the lowest sum of a range of scans is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nadir {
    /// Index of the first scan that has it.
    pub at: usize,
    pub sum: f64,
    /// Number of scans of which it is the lowest.
    pub scans: usize,
    /// The lowest that is above 0.
    pub above_0: Option<f64>,
}

impl Nadir {
    /// Of one scan.
    pub fn of(at: usize, sum: f64) -> Self {
        Self { at, sum, scans: 1, above_0: (sum > 0.0).then_some(sum) }
    }
}

/// The lowest measured of `sums`, which begin at index `from`.
pub(super) fn nadir(sums: &[Sum], from: usize) -> Option<Nadir> {
    let known = || sums.iter().enumerate().filter_map(|(k, sum)| Some((from + k, sum.whole()?)));
    // The first of the lowest: `min_by` keeps the first of equals.
    let (at, sum) = known().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let above_0 = known().map(|(_, sum)| sum).filter(|&sum| sum > 0.0).min_by(f64::total_cmp);
    Some(Nadir { at, sum, scans: known().count(), above_0 })
}

/// The thresholds of one compartment and quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Thresholds {
    /// Decrease of a partial response, %.
    pub partial: f64,
    /// Decrease of a minor response, %.
    pub minor: Minor,
    /// Increase of progression, %.
    pub progression: f64,
    /// Least absolute rise of progression; 0 if none is known.
    pub absolute: f64,
    pub partial_rule: RuleId,
    pub progression_rule: RuleId,
}

/// Threshold of a minor response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Minor {
    /// The criteria have none.
    None,
    /// They have one, whose number isn't stated.
    Unstated,
    /// Its number, %.
    Percent(f64),
}

impl Thresholds {
    /// `None` where the criteria have no rule of this quantity.
    pub fn of(rules: Rules<'_>, compartment: Compartment, quantity: Quantity) -> Option<Self> {
        let by_volume = quantity == Quantity::VolumeMl;
        let (partial_rule, progression_rule) = if by_volume {
            (RuleId::PartialResponseVolume, RuleId::ProgressionVolume)
        } else {
            (RuleId::PartialResponse, RuleId::Progression)
        };
        let trial = &rules.history.trial;
        let has_minor =
            rules.history.criterion != Criterion::Rano20 || compartment == Compartment::NonEnhancing;
        let minor = match rules.number(RuleId::MinorResponse) {
            Some(percent) if has_minor && !by_volume => Minor::Percent(percent),
            Some(_) if has_minor => trial
                .minor_response_volume_percent
                .as_ref()
                .map_or(Minor::Unstated, |v| Minor::Percent(v.value)),
            _ => Minor::None,
        };
        Some(Self {
            partial: rules.number(partial_rule)?,
            minor,
            progression: rules.number(progression_rule)?,
            absolute: trial.progression_absolute_mm.as_ref().map_or(0.0, |stated| stated.value),
            partial_rule,
            progression_rule,
        })
    }

    /// As changes in %, for margins.
    pub fn changes_from_baseline(&self) -> Vec<f64> {
        let minor = match self.minor {
            Minor::Percent(percent) => Some(-percent),
            _ => None,
        };
        std::iter::once(-self.partial).chain(minor).collect()
    }

    /// Whether `sum` is a rise of progression over `lowest`, which is above 0.
    pub fn is_rise(&self, sum: f64, lowest: f64) -> bool {
        at_least(sum, lowest * (1.0 + self.progression / 100.0)) && at_least(sum - lowest, self.absolute)
    }

    /// What a sum says, compared with that of the baseline and with the lowest one, `lowest`. Above a lowest sum of 0 there
    /// is no ratio; but what is a rise over any sum, `above_0`, is one over the lowest.
    pub fn category(&self, sum: f64, baseline: f64, lowest: f64, above_0: f64) -> Category {
        let fallen = |percent: f64| {
            let threshold = baseline * (1.0 - percent / 100.0);
            sum <= threshold + TOLERANCE * baseline
        };
        if sum == 0.0 {
            return Category::Complete;
        }
        if self.is_rise(sum, above_0) {
            return Category::Progression;
        }
        if lowest == 0.0 {
            return Category::Reappeared;
        }
        if fallen(self.partial) {
            return Category::Partial;
        }
        match self.minor {
            Minor::Percent(percent) if fallen(percent) => Category::Minor,
            Minor::Unstated if sum < baseline * (1.0 - TOLERANCE) => Category::MinorOrStable,
            _ => Category::Stable,
        }
    }

    /// Values that stand for all that an incompletely measured `sum` can have: one of each category, and of each set of
    /// `lows`, the sums from which it can be a rise. They are tried on a grid finer than the distances of thresholds.
    pub fn tries(&self, sum: &Sum, baseline: f64, lowest: Nadir, lows: &[f64]) -> Vec<f64> {
        const FACTORS: [f64; 24] = [
            1e-4, 0.01, 0.1, 0.2, 0.25, 0.3, 0.34, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.74, 0.76, 0.8,
            0.9, 1.0, 1.1, 1.22, 1.5, 3.0, 1e4,
        ];
        let scale = lows.iter().copied().chain([sum.measured, baseline]).filter(|&s| s > 0.0);
        let grid = scale.flat_map(|s| FACTORS.map(|factor| s * factor)).filter(|&s| s >= sum.measured);
        let above_0 = lowest.above_0.unwrap_or(baseline);
        let mut keys = Vec::new();
        let mut found = Vec::new();
        for tried in std::iter::once(sum.measured).chain(grid) {
            let rises: Vec<bool> = lows.iter().map(|&low| self.is_rise(tried, low)).collect();
            let key = (self.category(tried, baseline, lowest.sum, above_0), rises);
            if !keys.contains(&key) {
                keys.push(key);
                found.push(tried);
            }
        }
        found
    }
}

/// The targets of one compartment and their sums from the baseline on.
pub(super) struct Line<'a> {
    pub compartment: Compartment,
    pub targets: Targets<'a>,
    pub thresholds: Thresholds,
    /// Index of the baseline.
    pub from: usize,
    /// From the baseline to the end of the epoch; empty without targets.
    pub sums: Vec<Sum>,
}

impl Line<'_> {
    pub fn at(&self, scan: usize) -> Option<&Sum> {
        self.sums.get(scan.checked_sub(self.from)?)
    }

    /// The lowest sum of the scans before `scan`.
    pub fn nadir_before(&self, scan: usize) -> Option<Nadir> {
        self.nadir_between(self.from, scan)
    }

    /// The lowest sum of the scans from `first` to before `scan`.
    pub fn nadir_between(&self, first: usize, scan: usize) -> Option<Nadir> {
        let end = scan.saturating_sub(self.from).min(self.sums.len());
        nadir(self.sums.get(first.saturating_sub(self.from)..end)?, first)
    }
}
