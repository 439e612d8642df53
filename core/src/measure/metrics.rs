//! The table of metrics between two masks. Tables, tooltips, JSON and docs take a metric's words from its row.

use crate::{TumorIndex, regions::Regions};

/// What a metric is computed from: two masks of one tumour index.
#[derive(Clone, Copy, Debug)]
pub struct PairInput<'a> {
    /// Which masks are active where.
    pub index: &'a TumorIndex,
    /// Its regions.
    pub regions: &'a Regions,
    /// Position of the one mask.
    pub a: usize,
    /// Position of the other.
    pub b: usize,
}

impl PairInput<'_> {
    /// Voxels of the regions that `wanted` says so of, given whether each mask is active.
    fn voxels(&self, wanted: impl Fn(bool, bool) -> bool) -> u64 {
        let has = |bits: u32, k: usize| bits >> k & 1 == 1;
        let regions = self.regions.list().iter();
        regions.filter(|r| wanted(has(r.bits, self.a), has(r.bits, self.b))).map(|r| r.voxels).sum()
    }

    /// Voxels of the intersection.
    pub fn both(&self) -> u64 {
        self.voxels(|a, b| a && b)
    }

    /// Voxels of the union.
    pub fn either(&self) -> u64 {
        self.voxels(|a, b| a || b)
    }
}

/// A number between two masks.
#[derive(Clone, Copy, Debug)]
pub struct PairMetric {
    /// Its key in JSON.
    pub key: &'static str,
    /// What tables call it.
    pub name: &'static str,
    /// How it is defined, with range and its values for empty masks: for tooltips.
    pub definition: &'static str,
    /// Its unit; empty for a share.
    pub unit: &'static str,
    /// Decimals in tables.
    pub decimals: usize,
    /// Its value where both masks are empty; `None`: unknown.
    pub both_empty: Option<f64>,
    /// Its value where one of them is.
    pub one_empty: Option<f64>,
    /// Its value for two masks with voxels.
    of: fn(&PairInput<'_>) -> f64,
}

/// Every metric, in the order of tables. Empty masks as MetricsReloaded and BraTS have it: two empty masks agree.
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
    /// Its value for two masks; `None` where it is unknown.
    pub fn value(&self, pair: &PairInput<'_>) -> Option<f64> {
        let empty = |k: usize| pair.regions.mask_voxels(k) == 0;
        match (empty(pair.a), empty(pair.b)) {
            (true, true) => self.both_empty,
            (true, false) | (false, true) => self.one_empty,
            (false, false) => Some((self.of)(pair)).filter(|value| value.is_finite()),
        }
    }

    /// A value with its unit and `more` decimals than tables have.
    pub fn print(&self, value: Option<f64>, more: usize) -> String {
        let Some(value) = value else { return "unknown".into() };
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        format!("{value:.*}{unit}", self.decimals + more)
    }
}
