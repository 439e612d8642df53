//! The table of metrics between two masks: result tables, tooltips, JSON and docs are derived from its rows.

use super::conventions::Convention;
use crate::{TumorIndex, regions::Regions};

/// Input of a metric: two masks of one tumour index.
#[derive(Clone, Copy, Debug)]
pub struct PairInput<'a> {
    /// The tumour index.
    pub index: &'a TumorIndex,
    /// Its regions.
    pub regions: &'a Regions,
    /// Index of the first mask.
    pub a: usize,
    /// Index of the second mask.
    pub b: usize,
}

impl PairInput<'_> {
    /// Number of voxels in the regions that `wanted` accepts, given whether masks `a` and `b` are active there.
    fn voxels(&self, wanted: impl Fn(bool, bool) -> bool) -> u64 {
        let has = |bits: u32, k: usize| bits >> k & 1 == 1;
        let regions = self.regions.list().iter();
        regions.filter(|r| wanted(has(r.bits, self.a), has(r.bits, self.b))).map(|r| r.voxels).sum()
    }

    /// Number of voxels in the intersection.
    pub fn both(&self) -> u64 {
        self.voxels(|a, b| a && b)
    }

    /// Number of voxels in the union.
    pub fn either(&self) -> u64 {
        self.voxels(|a, b| a || b)
    }
}

/// A metric between two masks.
#[derive(Clone, Copy, Debug)]
pub struct PairMetric {
    /// Its key in JSON.
    pub key: &'static str,
    /// Name in tables.
    pub name: &'static str,
    /// Definition with range and values for empty masks, for tooltips.
    pub definition: &'static str,
    /// Its unit; empty if dimensionless.
    pub unit: &'static str,
    /// Decimals in tables.
    pub decimals: usize,
    /// Its value if both masks are empty; `None`: undefined.
    pub both_empty: Option<f64>,
    /// Its value if exactly one mask is empty; `None`: undefined.
    pub one_empty: Option<f64>,
    /// Its value for two non-empty masks.
    of: fn(&PairInput<'_>) -> f64,
}

/// The convention that [`PAIR_METRICS`] follow: two empty masks agree perfectly.
pub const PAIR_CONVENTION: Convention = Convention::MetricsReloaded;

/// All metrics, in the order of tables, by [`PAIR_CONVENTION`].
pub const PAIR_METRICS: &[PairMetric] = &[
    PairMetric {
        key: "dice",
        name: "Dice",
        definition: "2|A∩B| / (|A|+|B|), 0 to 1; 1 for two empty masks",
        unit: "",
        decimals: 3,
        both_empty: Some(1.0),
        one_empty: Some(0.0),
        of: |pair| (2 * pair.both()) as f64 / (pair.both() + pair.either()) as f64,
    },
    PairMetric {
        key: "jaccard",
        name: "Jaccard",
        definition: "|A∩B| / |A∪B|, 0 to 1; 1 for two empty masks",
        unit: "",
        decimals: 3,
        both_empty: Some(1.0),
        one_empty: Some(0.0),
        of: |pair| pair.both() as f64 / pair.either() as f64,
    },
];

impl PairMetric {
    /// Its value for two masks; `None` where it is undefined or not finite.
    pub fn value(&self, pair: &PairInput<'_>) -> Option<f64> {
        let empty = |k: usize| pair.regions.mask_voxels(k) == 0;
        match (empty(pair.a), empty(pair.b)) {
            (true, true) => self.both_empty,
            (true, false) | (false, true) => self.one_empty,
            (false, false) => Some((self.of)(pair)).filter(|value| value.is_finite()),
        }
    }

    /// Formats a value with its unit, with `more` decimals than in tables.
    pub fn print(&self, value: Option<f64>, more: usize) -> String {
        let Some(value) = value else { return "unknown".into() };
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        format!("{value:.*}{unit}", self.decimals + more)
    }
}
