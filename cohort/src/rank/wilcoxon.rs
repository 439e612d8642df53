//! Wilcoxon's signed-rank test of paired values (Wilcoxon 1945), as `scipy.stats.wilcoxon` computes it with `zero_method="wilcox"`.

use statrs::distribution::{ContinuousCDF, Normal};

/// Number of differences up to which the distribution is counted, where no two are equally large.
const MOST_EXACT: usize = 50;

/// How a probability was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Method {
    /// By counting all signs: at most 50 differences, no two equally large.
    Exact,
    /// By the normal approximation with ties corrected, without a correction for continuity.
    Normal,
}

/// The answer of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignedRank {
    /// Pairs that differ; the others are left out.
    pub differing: usize,
    /// The smaller of the sums of ranks of positive and of negative differences.
    pub statistic: f64,
    /// Two-sided probability; `None` where nothing differs.
    pub p: Option<f64>,
    /// How it was found.
    pub method: Method,
}

/// Tests whether the differences of `pairs` are symmetric about 0. Values may be infinite: equal ones don't differ.
pub fn signed_rank(pairs: &[[f64; 2]]) -> SignedRank {
    let differences = pairs.iter().filter(|[a, b]| a != b).map(|[a, b]| a - b);
    let mut differences: Vec<f64> = differences.collect();
    differences.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let n = differences.len();
    let (mut positive, mut ties, mut has_ties, mut first) = (0.0, 0.0, false, 0);
    while first < n {
        let size = differences[first].abs();
        let end = first + differences[first..].iter().take_while(|d| d.abs() == size).count();
        let (count, rank) = ((end - first) as f64, (first + end + 1) as f64 / 2.0);
        positive += rank * differences[first..end].iter().filter(|d| **d > 0.0).count() as f64;
        ties += count * count * count - count;
        has_ties |= end - first > 1;
        first = end;
    }
    let total = (n * (n + 1)) as f64 / 2.0;
    let statistic = f64::min(positive, total - positive);
    let method = if n <= MOST_EXACT && !has_ties { Method::Exact } else { Method::Normal };
    let p = match method {
        _ if n == 0 => None,
        Method::Exact => Some((2.0 * part_at_most(n, statistic as usize)).min(1.0)),
        Method::Normal => {
            let n = n as f64;
            let sd = ((n * (n + 1.0) * (2.0 * n + 1.0) - ties / 2.0) / 24.0).sqrt();
            Some((2.0 * Normal::standard().cdf((statistic - total / 2.0) / sd)).min(1.0))
        }
    };
    SignedRank { differing: n, statistic, p, method }
}

/// The part of all signs of ranks 1 to `n` (at most 50) whose positive ones sum to at most `sum`.
fn part_at_most(n: usize, sum: usize) -> f64 {
    // How many subsets of 1 … n have each sum: below 2^50, so that every number is exact.
    let mut subsets = vec![0.0; n * (n + 1) / 2 + 1];
    subsets[0] = 1.0;
    for rank in 1..=n {
        for total in (rank..subsets.len()).rev() {
            subsets[total] += subsets[total - rank];
        }
    }
    subsets.iter().take(sum + 1).sum::<f64>() / 2.0_f64.powi(n as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: SignedRank, statistic: f64, p: f64, method: Method) {
        assert_eq!((found.statistic, found.method), (statistic, method));
        assert!((found.p.unwrap() / p - 1.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn values_are_those_of_scipy() {
        // scipy 1.17.1: wilcoxon(a, b, method="exact"), (…, method="approx", correction=False) where differences tie.
        let a = [0.91, 0.85, 0.77, 0.94, 0.66, 0.88, 0.73, 0.9];
        let b = [0.89, 0.86, 0.7, 0.9, 0.61, 0.8, 0.7, 0.84];
        let pairs: Vec<[f64; 2]> = a.into_iter().zip(b).map(|(a, b)| [a, b]).collect();
        near(signed_rank(&pairs), 1.0, 0.015625, Method::Exact);
        let b = [2.0, 2.0, 1.0, 6.0, 3.0, 9.0, 3.0, 4.0, 9.0, 14.0];
        let pairs: Vec<[f64; 2]> = b.into_iter().enumerate().map(|(n, b)| [n as f64 + 1.0, b]).collect();
        let found = signed_rank(&pairs);
        assert_eq!(found.differing, 8);
        near(found, 16.0, 0.7772974107895215, Method::Normal);
        let pairs: Vec<[f64; 2]> = (1..=50)
            .map(|n| {
                let (i, s) = (f64::from(n), if n % 3 > 0 { 1.0 } else { -1.0 });
                [i * i, i * i + s * i]
            })
            .collect();
        near(signed_rank(&pairs), 408.0, 0.02616696817119646, Method::Exact);
    }

    #[test]
    fn equal_and_infinite_values_are_understood() {
        assert_eq!(
            signed_rank(&[[1.0, 1.0], [f64::INFINITY; 2]]),
            SignedRank { differing: 0, statistic: 0.0, p: None, method: Method::Exact }
        );
        let found = signed_rank(&[[1.0, f64::INFINITY], [2.0, 1.0], [f64::INFINITY; 2]]);
        // Two differences, the negative one larger: ranks 2 and 1.
        near(found, 1.0, 1.0, Method::Exact);
    }
}
