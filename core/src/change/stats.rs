//! Statistics of lengths: mean, percentiles, histogram.

use serde::Serialize;

use crate::histogram::{Bins, extent};

/// Summary of lengths. All fields but the count are `None` without any length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Lengths {
    /// Number of vectors.
    pub count: usize,
    /// Mean length.
    pub mean_mm: Option<f64>,
    /// Median; percentiles are interpolated linearly between neighbours.
    pub p50_mm: Option<f64>,
    /// 95th percentile.
    pub p95_mm: Option<f64>,
    /// Maximum.
    pub max_mm: Option<f64>,
}

impl Lengths {
    /// Summary of `lengths`, in any order.
    pub fn of(mut lengths: Vec<f64>) -> Self {
        lengths.sort_unstable_by(f64::total_cmp);
        let count = lengths.len();
        let percentile = |p: f64| {
            let at = p * count.saturating_sub(1) as f64;
            let (below, above) = (lengths.get(at.floor() as usize)?, lengths.get(at.ceil() as usize)?);
            Some(below + (above - below) * at.fract())
        };
        Self {
            count,
            mean_mm: (count > 0).then(|| lengths.iter().sum::<f64>() / count as f64),
            p50_mm: percentile(0.5),
            p95_mm: percentile(0.95),
            max_mm: lengths.last().copied(),
        }
    }
}

/// Histogram of signed lengths, with bins of equal width.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Histogram {
    /// Width of a bin.
    pub bin_mm: f64,
    /// Lower edge of the first bin; a bin includes its lower edge.
    pub first_mm: f64,
    /// Number of vectors per bin, from the first to the last non-empty one.
    pub counts: Vec<u64>,
}

impl Histogram {
    /// `None` without values. Bin widths are 1, 2 or 5 times a power of ten; zero is a bin edge.
    pub fn of(signed_mm: impl Iterator<Item = f64> + Clone) -> Option<Self> {
        let (lo, hi) = extent(signed_mm.clone());
        let bins = Bins::of(signed_mm, hi.max(0.0) - lo.min(0.0))?;
        Some(Self { bin_mm: bins.width, first_mm: bins.first, counts: bins.counts })
    }
}
