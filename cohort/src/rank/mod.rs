//! Ranking of algorithms as challenges do it, and tests between two of them.
//!
//! Definitions, as in docs/cohort.md: algorithms are ranked within a case and metric, 1 is best, ties share the mean of their ranks, and
//! an undefined value or a missing mask ranks last (all such tie). A case's rank is the mean over its dates. The mean rank is that over
//! cases; its interval is the percentile bootstrap over cases. *Rank, then aggregate* of BraTS and FeTS (Bakas et al. 2018,
//! arXiv:1811.02629).

mod bootstrap;
mod holm;
mod wilcoxon;

use std::collections::{BTreeMap, BTreeSet};

pub use bootstrap::{Interval, interval};
pub use holm::corrected;
pub use wilcoxon::{Method, SignedRank, signed_rank};

/// Which values of a metric are better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Larger ones.
    More,
    /// Smaller ones.
    Less,
    /// Those nearer to 0, whatever their sign.
    NearZero,
}

impl Better {
    /// What of a value is ranked and tested: its size, where its sign says nothing.
    pub fn of(self, value: f64) -> f64 {
        if self == Self::NearZero { value.abs() } else { value }
    }
}

/// How a metric ranks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RankedMetric {
    /// Which values are better.
    pub better: Better,
    /// Whether it changes when the two masks change places: the reference must then be the first of a pair.
    pub is_directed: bool,
}

const fn same_both_ways(better: Better) -> RankedMetric {
    RankedMetric { better, is_directed: false }
}

const fn directed(better: Better) -> RankedMetric {
    RankedMetric { better, is_directed: true }
}

/// The metrics that rank, by their keys in the table of pairs.
const RANKED: [(&str, RankedMetric); 18] = [
    ("dice", same_both_ways(Better::More)),
    ("jaccard", same_both_ways(Better::More)),
    ("volume_similarity", same_both_ways(Better::More)),
    ("kappa", same_both_ways(Better::More)),
    ("nsd", same_both_ways(Better::More)),
    ("assd_mm", same_both_ways(Better::Less)),
    ("masd_mm", same_both_ways(Better::Less)),
    ("hd_mm", same_both_ways(Better::Less)),
    ("sensitivity", directed(Better::More)),
    ("precision", directed(Better::More)),
    ("relative_volume_difference", directed(Better::NearZero)),
    ("lesions_f1", directed(Better::More)),
    ("lesions_sq", directed(Better::More)),
    ("lesions_pq", directed(Better::More)),
    ("lesions_dice", directed(Better::More)),
    ("lesions_hd_percentile_mm", directed(Better::Less)),
    ("lesions_missed", directed(Better::Less)),
    ("lesions_false_positives", directed(Better::Less)),
];

/// How a metric ranks; `None` for those that don't. Every percentile of the Hausdorff distance does (`hd95_mm`).
pub fn ranked_metric(metric: &str) -> Option<RankedMetric> {
    let of_percentile = metric.strip_prefix("hd").and_then(|rest| rest.strip_suffix("_mm"));
    let is_percentile = of_percentile.is_some_and(|p| !p.is_empty() && p.parse::<f64>().is_ok());
    let known = RANKED.iter().find(|(key, _)| *key == metric).map(|(_, ranked)| *ranked);
    known.or_else(|| is_percentile.then_some(same_both_ways(Better::Less)))
}

/// Keys of the metrics that are ranked.
pub fn ranked_metrics() -> String {
    let keys: Vec<&str> = RANKED.iter().map(|(key, _)| *key).collect();
    format!("{}, hdP_mm of a percentile P", keys.join(", "))
}

/// Values of one metric: by algorithm, case and date.
#[derive(Clone, Debug, Default)]
pub struct Values {
    values: BTreeMap<(String, String), BTreeMap<String, Option<f64>>>,
    algorithms: BTreeSet<String>,
}

/// The rank of one algorithm in every case, and how often it had no value.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranks {
    /// The algorithm.
    pub algorithm: String,
    /// Its rank in each case.
    pub by_case: BTreeMap<String, f64>,
    /// Cases with a date at which it has no value.
    pub undefined: usize,
}

impl Values {
    /// Adds a value; `None`: undefined.
    pub fn add(&mut self, case: &str, date: &str, algorithm: &str, value: Option<f64>) {
        self.algorithms.insert(algorithm.to_owned());
        self.values
            .entry((case.to_owned(), date.to_owned()))
            .or_default()
            .insert(algorithm.to_owned(), value);
    }

    /// The algorithms, sorted.
    pub fn algorithms(&self) -> impl Iterator<Item = &str> {
        self.algorithms.iter().map(String::as_str)
    }

    /// The ranks of every one of `algorithms` in each case that has any value.
    pub fn ranks(&self, algorithms: &[&str], better: Better) -> Vec<Ranks> {
        let mut by_case: BTreeMap<&str, Vec<Vec<(f64, bool)>>> = BTreeMap::new();
        for ((case, _), values) in &self.values {
            let of = |algorithm: &&str| values.get(*algorithm).copied().flatten();
            let values: Vec<Option<f64>> = algorithms.iter().map(of).collect();
            let ranks = ranks_within(&values, better);
            let is_undefined = values.iter().map(Option::is_none);
            by_case.entry(case).or_default().push(ranks.into_iter().zip(is_undefined).collect());
        }
        let of = |n: usize| {
            let of_case = |dates: &Vec<Vec<(f64, bool)>>| {
                dates.iter().map(|date| date[n].0).sum::<f64>() / dates.len() as f64
            };
            let ranks = by_case.iter().map(|(case, dates)| ((*case).to_owned(), of_case(dates))).collect();
            let undefined = by_case.values().filter(|dates| dates.iter().any(|date| date[n].1)).count();
            Ranks { algorithm: algorithms[n].to_owned(), by_case: ranks, undefined }
        };
        (0..algorithms.len()).map(of).collect()
    }

    /// Values of two algorithms in the cases in which both have one: means over the dates at which both do.
    pub fn pairs(&self, a: &str, b: &str) -> Vec<[f64; 2]> {
        let mut by_case: BTreeMap<&str, Vec<[f64; 2]>> = BTreeMap::new();
        for ((case, _), values) in &self.values {
            if let (Some(Some(a)), Some(Some(b))) = (values.get(a), values.get(b)) {
                by_case.entry(case).or_default().push([*a, *b]);
            }
        }
        let mean = |dates: Vec<[f64; 2]>| {
            [0, 1].map(|k| dates.iter().map(|date| date[k]).sum::<f64>() / dates.len() as f64)
        };
        by_case.into_values().map(mean).collect()
    }
}

/// Ranks of values, 1 is best; equals share the mean of their ranks, those without a value are last and tie.
pub fn ranks_within(values: &[Option<f64>], better: Better) -> Vec<f64> {
    let worst = f64::INFINITY;
    let key = |value: &Option<f64>| match value {
        // Undefined is worse than infinitely far.
        None => (1, worst),
        Some(value) => (0, if better == Better::More { -value } else { better.of(*value) }),
    };
    let keys: Vec<(u8, f64)> = values.iter().map(key).collect();
    let is_less = |a: &(u8, f64), b: &(u8, f64)| a.0 < b.0 || (a.0 == b.0 && a.1 < b.1);
    let rank = |own: &(u8, f64)| {
        let before = keys.iter().filter(|other| is_less(other, own)).count();
        let equal = keys.iter().filter(|other| *other == own).count();
        before as f64 + (equal as f64 + 1.0) / 2.0
    };
    keys.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_share_ranks_and_what_is_undefined_is_last() {
        // scipy.stats.rankdata of the negated values, where all are defined.
        assert_eq!(
            ranks_within(&[Some(0.9), Some(0.7), Some(0.9), Some(0.8)], Better::More),
            [1.5, 4.0, 1.5, 3.0]
        );
        assert_eq!(
            ranks_within(&[None, Some(f64::INFINITY), Some(2.0), None], Better::Less),
            [3.5, 2.0, 1.0, 3.5]
        );
        assert_eq!(ranks_within(&[Some(f64::INFINITY); 2], Better::Less), [1.5, 1.5]);
        assert_eq!(ranks_within(&[Some(-0.2), Some(0.1), Some(0.2)], Better::NearZero), [2.5, 1.0, 2.5]);
    }

    #[test]
    fn a_case_of_several_dates_counts_once_and_a_missing_mask_ranks_last() {
        let mut values = Values::default();
        for (case, date, a, b) in [("1", "x", 0.9, 0.8), ("1", "y", 0.7, 0.8), ("2", "x", 0.9, 0.5)] {
            values.add(case, date, "a", Some(a));
            values.add(case, date, "b", Some(b));
        }
        values.add("3", "x", "b", Some(0.1));
        let algorithms: Vec<&str> = values.algorithms().collect();
        let ranks = values.ranks(&algorithms, Better::More);
        let of = |n: usize| ranks[n].by_case.values().copied().collect::<Vec<f64>>();
        assert_eq!((of(0), ranks[0].undefined), (vec![1.5, 1.0, 2.0], 1));
        assert_eq!((of(1), ranks[1].undefined), (vec![1.5, 2.0, 1.0], 0));
        let pairs = values.pairs("a", "b");
        assert!(
            (pairs[0][0] - 0.8).abs() < 1e-15 && (pairs[0][1] - 0.8).abs() < 1e-15 && pairs[1] == [0.9, 0.5]
        );
        assert_eq!(pairs.len(), 2);
    }

    #[test]
    fn metrics_rank_by_what_is_better_and_some_need_the_reference_first() {
        assert_eq!(ranked_metric("dice"), Some(same_both_ways(Better::More)));
        assert_eq!(ranked_metric("hd_mm"), Some(same_both_ways(Better::Less)));
        assert_eq!([ranked_metric("hd95_mm"), ranked_metric("hd97.5_mm")], [ranked_metric("hd_mm"); 2]);
        assert_eq!(ranked_metric("sensitivity"), Some(directed(Better::More)));
        assert_eq!([ranked_metric("hdx_mm"), ranked_metric("lesions_ignored")], [None, None]);
    }
}
