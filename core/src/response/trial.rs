//! What a trial states where no source of the criterion that was read does.

use serde::{Deserialize, Serialize};
use strum::VariantArray;

use super::rules::{Criterion, RuleId, rule};

/// A number that the trial states.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialValue<T> {
    /// The number.
    pub value: T,
    /// Where the trial states it.
    pub source: String,
}

/// A part of RANO 2010 that a trial takes over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// Which lesions are measurable.
    Measurable,
    /// Non-target disease.
    NonTarget,
    /// Steroids.
    Steroids,
    /// Clinical state.
    Clinical,
}

/// What a trial states where no source of the criterion that was read does.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    /// Parts that follow RANO 2010.
    pub follow_2010: Option<TrialValue<Vec<Part>>>,
    /// Most targets.
    pub max_targets: Option<TrialValue<u32>>,
    /// Days after which a response is confirmed.
    pub confirm_response_days: Option<TrialValue<u32>>,
    /// Days after which progression is confirmed.
    pub confirm_progression_days: Option<TrialValue<u32>>,
    /// Decrease of volume of a minor response in %.
    pub minor_response_volume_percent: Option<TrialValue<f64>>,
    /// Least absolute rise of progression in mm.
    pub progression_absolute_mm: Option<TrialValue<f64>>,
}

/// A number of a [`Trial`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, VariantArray)]
pub enum TrialNumber {
    /// [`Trial::max_targets`].
    MaxTargets,
    /// [`Trial::confirm_response_days`].
    ConfirmResponseDays,
    /// [`Trial::confirm_progression_days`].
    ConfirmProgressionDays,
    /// [`Trial::minor_response_volume_percent`].
    MinorResponseVolumePercent,
    /// [`Trial::progression_absolute_mm`].
    ProgressionAbsoluteMm,
}

impl TrialNumber {
    /// The most that it can be.
    pub fn most(self) -> f64 {
        match self {
            // Nothing shrinks by more than all of it.
            Self::MinorResponseVolumePercent => 100.0,
            _ => 10_000.0,
        }
    }

    /// Its key in the history.
    pub fn key(self) -> &'static str {
        match self {
            Self::MaxTargets => "max_targets",
            Self::ConfirmResponseDays => "confirm_response_days",
            Self::ConfirmProgressionDays => "confirm_progression_days",
            Self::MinorResponseVolumePercent => "minor_response_volume_percent",
            Self::ProgressionAbsoluteMm => "progression_absolute_mm",
        }
    }

    /// Whether a criterion leaves it to the trial: it has the rule, and states no number of its own.
    pub fn is_open(self, criterion: Criterion) -> bool {
        // RANO-LGG states it of partial response alone.
        let unstated = |id| rule(criterion, id).is_none() || criterion == Criterion::RanoLgg;
        match self {
            Self::MaxTargets => unstated(RuleId::MaxTargets),
            Self::ConfirmResponseDays => unstated(RuleId::ConfirmResponse),
            Self::ConfirmProgressionDays => {
                matches!(criterion, Criterion::ModifiedRano | Criterion::ImmunoRano)
            }
            Self::MinorResponseVolumePercent => criterion == Criterion::Rano20,
            Self::ProgressionAbsoluteMm => criterion == Criterion::RanoBm,
        }
    }

    /// The number and where the trial states it; `None`: not stated.
    pub fn of(self, trial: &Trial) -> Option<(f64, &str)> {
        fn count(stated: Option<&TrialValue<u32>>) -> Option<(f64, &str)> {
            stated.map(|stated| (f64::from(stated.value), stated.source.as_str()))
        }
        fn number(stated: Option<&TrialValue<f64>>) -> Option<(f64, &str)> {
            stated.map(|stated| (stated.value, stated.source.as_str()))
        }
        match self {
            Self::MaxTargets => count(trial.max_targets.as_ref()),
            Self::ConfirmResponseDays => count(trial.confirm_response_days.as_ref()),
            Self::ConfirmProgressionDays => count(trial.confirm_progression_days.as_ref()),
            Self::MinorResponseVolumePercent => number(trial.minor_response_volume_percent.as_ref()),
            Self::ProgressionAbsoluteMm => number(trial.progression_absolute_mm.as_ref()),
        }
    }

    /// Sets it in `trial`; whole numbers are rounded. `None`: not stated.
    pub fn set(self, trial: &mut Trial, stated: Option<(f64, String)>) {
        let number = stated.map(|(value, source)| TrialValue { value, source });
        let count = || {
            let whole = |TrialValue { value, source }| TrialValue { value: f64::round(value) as u32, source };
            number.clone().map(whole)
        };
        match self {
            Self::MaxTargets => trial.max_targets = count(),
            Self::ConfirmResponseDays => trial.confirm_response_days = count(),
            Self::ConfirmProgressionDays => trial.confirm_progression_days = count(),
            Self::MinorResponseVolumePercent => trial.minor_response_volume_percent = number,
            Self::ProgressionAbsoluteMm => trial.progression_absolute_mm = number,
        }
    }
}
