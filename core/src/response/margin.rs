//! What the repeatability of measurements leaves of a change: intervals, and how often noise alone makes a call.
//!
//! The logarithm of a measured sum is taken as normal about that of the true one, with standard deviation `s` (the stated
//! relative standard deviation), the same and independent at all scans. The logarithm of a ratio of two then has √2·s.

use serde::Serialize;

use super::history::Repeatability;

/// Coverage of the intervals.
pub const COVERAGE: f64 = 0.95;
/// Normal quantile of the intervals' ends: of (1 + [`COVERAGE`]) / 2.
const QUANTILE: f64 = 1.959_963_984_540_054;

/// The margin of a change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Margin {
    /// Relative standard deviation of one sum.
    pub relative_sd: f64,
    /// Where it is from.
    pub source: String,
    /// Lower end of the interval of the change, in %.
    pub low_percent: f64,
    /// Upper end of the interval of the change, in %.
    pub high_percent: f64,
    /// Thresholds of the criterion, as changes in %, that lie within the interval.
    pub straddles_percent: Vec<f64>,
}

/// The interval of a change by `ratio` (above 0), and which of `thresholds_percent` it straddles. A reference that is the
/// lowest of several scans is lower than its true size, which the interval doesn't correct.
pub(super) fn margin(ratio: f64, stated: &Repeatability, thresholds_percent: &[f64]) -> Margin {
    let half = QUANTILE * std::f64::consts::SQRT_2 * stated.relative_sd;
    let percent = |log: f64| 100.0 * (ratio * log.exp() - 1.0);
    let (low_percent, high_percent) = (percent(-half), percent(half));
    let within = |threshold: &f64| (low_percent..=high_percent).contains(threshold);
    Margin {
        relative_sd: stated.relative_sd,
        source: stated.source.clone(),
        low_percent,
        high_percent,
        straddles_percent: thresholds_percent.iter().copied().filter(within).collect(),
    }
}

/// Probability that an unchanged tumour measures at least `1 + rise` times the lowest of `scans` earlier measurements, all
/// with the relative standard deviation `relative_sd`. Closed for one scan, else an integral by Simpson's rule on a fixed
/// grid.
///
/// With the new scan at z standard deviations, the lowest of n is at most z - t in 1 - (1 - Φ(z - t))ⁿ of all cases, where
/// t = ln(1 + rise) / s.
pub fn false_rise(rise: f64, relative_sd: f64, scans: usize) -> f64 {
    let threshold = rise.ln_1p() / relative_sd;
    if scans <= 1 {
        return normal_cdf(-threshold / std::f64::consts::SQRT_2);
    }
    let exponent = i32::try_from(scans).unwrap_or(i32::MAX);
    // 1e-22 of a normal distribution lies beyond; the integrand is smooth over several steps.
    const END: f64 = 10.0;
    const INTERVALS: u32 = 2000;
    let step = 2.0 * END / f64::from(INTERVALS);
    let integrand = |z: f64| {
        let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
        density * (1.0 - normal_cdf(threshold - z).powi(exponent))
    };
    let weight = |k: u32| {
        if k == 0 || k == INTERVALS {
            1.0
        } else if k % 2 == 1 {
            4.0
        } else {
            2.0
        }
    };
    let sum: f64 = (0..=INTERVALS).map(|k| weight(k) * integrand(f64::from(k) * step - END)).sum();
    sum * step / 3.0
}

/// Probability that an unchanged tumour measures at most `1 - fall` times one earlier measurement.
pub fn false_fall(fall: f64, relative_sd: f64) -> f64 {
    normal_cdf((-fall).ln_1p() / relative_sd / std::f64::consts::SQRT_2)
}

/// Distribution function of the standard normal distribution, by its series near 0 and its continued fraction in the tails.
pub(super) fn normal_cdf(z: f64) -> f64 {
    let x = z.abs();
    let density = (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let upper = if x < 3.0 {
        // Φ(x) - 1/2 = φ(x) (x + x³/3 + x⁵/(3·5) + …)
        let (mut term, mut sum) = (x, x);
        for k in 1..100 {
            term *= x * x / f64::from(2 * k + 1);
            sum += term;
        }
        0.5 - density * sum
    } else {
        // 1 - Φ(x) = φ(x) / (x + 1/(x + 2/(x + …)))
        let fraction = (1..=100).rev().fold(x, |below, k| x + f64::from(k) / below);
        density / fraction
    };
    if z > 0.0 { 1.0 - upper } else { upper }
}
