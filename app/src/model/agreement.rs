//! Settings of the metrics of agreement.

use std::ops::RangeInclusive;

use glioscope_core::measure::{
    Operand,
    conventions::{Convention, Settings},
};
use serde::{Deserialize, Serialize};

/// The most masks of what is compared.
pub const MOST_COMPARED: usize = 64;
/// Tolerances of the surface Dice, millimetres.
pub const TOLERANCE_MM: RangeInclusive<f64> = 0.0..=1000.0;
/// Percentiles of the robust Hausdorff distance.
pub const PERCENTILE: RangeInclusive<f64> = 0.0..=100.0;

/// How masks are compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AgreementSetting {
    /// Whose definitions.
    pub convention: Convention,
    /// Percentile of the robust Hausdorff distance.
    pub percentile: f64,
    /// Tolerance of the surface Dice.
    pub tolerance_mm: f64,
    /// Two masks or regions of any dates that are compared beside the pairs of the date shown; the first is the reference.
    #[serde(default)]
    pub two: Option<[Operand; 2]>,
}

impl Default for AgreementSetting {
    fn default() -> Self {
        let Settings { convention, percentile, tolerance_mm, .. } = Settings::default();
        Self { convention, percentile, tolerance_mm, two: None }
    }
}

impl AgreementSetting {
    /// The settings of the comparison.
    pub fn settings(&self) -> Settings {
        let Self { convention, percentile, tolerance_mm, .. } = *self;
        Settings { convention, percentile, tolerance_mm, ..Settings::default() }
    }
}
