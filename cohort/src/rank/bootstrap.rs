//! Percentile bootstrap of a mean over cases.

use glioscope_core::optics::random::Random;
use statrs::statistics::{Data, OrderStatistics};

/// Samples that are drawn.
const SAMPLES: u64 = 2000;

/// An interval of 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

/// The interval of 95 % of the mean of `values`, by drawing as many of them with replacement, 2000 times; `seed` fixes what is drawn:
/// two algorithms with the same seed are drawn in the same cases. `None` without values.
pub fn interval(values: &[f64], seed: u64) -> Option<Interval> {
    if values.is_empty() {
        return None;
    }
    let mean = |sample: u64| {
        let mut random = Random::new(seed, sample);
        let drawn = (0..values.len()).map(|_| values[(random.unit() * values.len() as f64) as usize]);
        drawn.sum::<f64>() / values.len() as f64
    };
    let mut means = Data::new((0..SAMPLES).map(mean).collect::<Vec<f64>>());
    Some(Interval { low: means.quantile(0.025), high: means.quantile(0.975) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_that_of_the_normal_approximation_for_many_cases() {
        // 400 values 1, 2, 1, 2 …: the mean's standard error is 0.5 / 20.
        let values: Vec<f64> = (0..400).map(|n| f64::from(n % 2) + 1.0).collect();
        let found = interval(&values, 7).unwrap();
        let expected = 1.96 * 0.5 / 20.0;
        assert!(
            (found.low - (1.5 - expected)).abs() < 0.005 && (found.high - (1.5 + expected)).abs() < 0.005,
            "{found:?}"
        );
        assert_eq!(interval(&values, 7), Some(found));
        assert_ne!(interval(&values, 8), Some(found));
        assert_eq!(interval(&[2.0; 5], 1), Some(Interval { low: 2.0, high: 2.0 }));
        assert_eq!(interval(&[], 1), None);
    }
}
