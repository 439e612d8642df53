//! Counts of values in bins of equal width.

/// The most bins that are aimed at.
const BINS: f64 = 40.0;

/// Counts of values in bins of equal width.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bins {
    /// Width of a bin: 1, 2 or 5 times a power of ten.
    pub width: f64,
    /// Lower edge of the first bin, a multiple of the width; a bin includes its lower edge.
    pub first: f64,
    /// Number of values per bin, from the first to the last non-empty one.
    pub counts: Vec<u64>,
}

impl Bins {
    /// Bins of about a fortieth of `range`, which the values lie in; `None` without values, and for a range that is none.
    pub fn of(values: impl Iterator<Item = f64> + Clone, range: f64) -> Option<Self> {
        let (lo, hi) = extent(values.clone());
        if !(range.is_finite() && range > 0.0 && lo <= hi) {
            return None;
        }
        let raw = range / BINS;
        let decade = 10_f64.powf(raw.log10().floor());
        let width =
            [1.0, 2.0, 5.0].map(|f| f * decade).into_iter().find(|w| *w >= raw).unwrap_or(10.0 * decade);
        let first = (lo / width).floor();
        let last = (hi / width).floor() - first;
        // Values that differ by less than can be divided.
        if !(width.is_normal() && last < 10.0 * BINS) {
            return None;
        }
        let mut counts = vec![0; last as usize + 1];
        let last = counts.len() - 1;
        for v in values {
            counts[(((v / width).floor() - first).max(0.0) as usize).min(last)] += 1;
        }
        Some(Self { width, first: first * width, counts })
    }
}

/// The smallest and the largest value; infinite, the wrong way round, without values.
pub(crate) fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_have_round_edges_and_count_all() {
        let values = [-3.0, 0.0, 0.9, 1.0, 76.0];
        let bins = Bins::of(values.into_iter(), 79.0).unwrap();
        assert_eq!((bins.width, bins.first, bins.counts.len()), (2.0, -4.0, 41));
        assert_eq!((bins.counts[0], bins.counts[2], bins.counts[40]), (1, 3, 1));
        assert_eq!(bins.counts.iter().sum::<u64>(), 5);
        assert_eq!(Bins::of(std::iter::empty(), 1.0), None);
        assert_eq!(Bins::of([1.0, 1.0].into_iter(), 0.0), None);
        // No number of bins that memory lacks, whatever the values are.
        for (lo, range) in [(0.0, 5e-324), (1e300, 1e284), (-1.7e308, 1.7e308), (1e16, 2.0)] {
            let bins = Bins::of([lo, lo + range].into_iter(), range);
            assert!(bins.is_none_or(|bins| bins.counts.iter().sum::<u64>() == 2), "{lo} {range}");
        }
    }
}
