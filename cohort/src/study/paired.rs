//! Student's test of paired numbers, and Pearson's correlation.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Two lights compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// One light.
    pub a: String,
    /// The other.
    pub b: String,
    /// Mean of a less mean of b.
    pub difference: f64,
    /// Student's t of the participants' differences; null where these are all the same.
    pub t: Option<f64>,
    /// Its degrees of freedom.
    pub df: f64,
    /// Its two-sided p.
    pub p: Option<f64>,
    /// The same times the number of comparisons, at most 1 (Bonferroni).
    pub p_bonferroni: Option<f64>,
}

/// Pearson's correlation of two measures of the same trials.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Correlation {
    /// Its coefficient, -1 to 1.
    pub r: f64,
    /// Its two-sided p.
    pub p: f64,
    /// Number of trials.
    pub trials: usize,
}

/// Both tails of Student's distribution from `t` on.
fn two_sided(t: f64, df: f64) -> Option<f64> {
    let distribution = StudentsT::new(0.0, 1.0, df).ok()?;
    t.is_finite().then(|| (2.0 * distribution.sf(t.abs())).min(1.0))
}

/// Mean difference, t and p of pairs; no t where there is one pair or all differ by the same.
fn paired(pairs: &[[f64; 2]]) -> (f64, Option<f64>, Option<f64>) {
    let n = pairs.len() as f64;
    let differences: Vec<f64> = pairs.iter().map(|[a, b]| a - b).collect();
    let mean = differences.iter().sum::<f64>() / n;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let size = pairs.iter().flatten().map(|x| x * x).sum::<f64>() / n;
    let t = (variance > size * 1e-28).then(|| mean / (variance / n).sqrt()).filter(|t| t.is_finite());
    (mean, t, t.and_then(|t| two_sided(t, n - 1.0)))
}

/// Every two lights of `rows`, a participant's numbers for each of `lights`.
pub(super) fn comparisons(rows: &[Vec<f64>], lights: &[String]) -> Vec<Comparison> {
    if rows.len() < 2 {
        return Vec::new();
    }
    let count = lights.len() * lights.len().saturating_sub(1) / 2;
    let pair = |a: usize, b: usize| {
        let pairs: Vec<[f64; 2]> = rows.iter().map(|row| [row[a], row[b]]).collect();
        let (difference, t, p) = paired(&pairs);
        Comparison {
            a: lights[a].clone(),
            b: lights[b].clone(),
            difference,
            t,
            df: rows.len() as f64 - 1.0,
            p,
            p_bonferroni: p.map(|p| (p * count as f64).min(1.0)),
        }
    };
    (0..lights.len()).flat_map(|a| (a + 1..lights.len()).map(move |b| pair(a, b))).collect()
}

/// The correlation of pairs; `None` with fewer than three, and where one of both never varies.
pub(super) fn correlation(pairs: &[[f64; 2]]) -> Option<Correlation> {
    let n = pairs.len() as f64;
    if pairs.len() < 3 {
        return None;
    }
    let mean = [0, 1].map(|k| pairs.iter().map(|pair| pair[k]).sum::<f64>() / n);
    let sum = |a: usize, b: usize| pairs.iter().map(|p| (p[a] - mean[a]) * (p[b] - mean[b])).sum::<f64>();
    let r = sum(0, 1) / (sum(0, 0) * sum(1, 1)).sqrt();
    if !r.is_finite() {
        return None;
    }
    let r = r.clamp(-1.0, 1.0);
    let p = if r.abs() == 1.0 { 0.0 } else { two_sided(r * ((n - 2.0) / (1.0 - r * r)).sqrt(), n - 2.0)? };
    Some(Correlation { r, p, trials: pairs.len() })
}
