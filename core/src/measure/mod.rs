//! Measurements of a case: volumes of masks and regions, pairwise metrics (Dice, Jaccard) and agreement, defined for
//! empty masks too.

mod compared;
pub mod conventions;
mod metrics;
mod statistics;

use serde::{Serialize, Serializer, ser::SerializeMap};

pub use compared::{DateComparison, Operand, PairComparison, Raters, compared, compared_at, compared_two};
pub use metrics::{PAIR_CONVENTION, PAIR_METRICS, PairInput, PairMetric};
pub use statistics::{Statistics, ValueHistogram, in_ball, in_circle, of as statistics_of, statistics};

use crate::{
    Check, TumorIndex,
    case::{Aligned, Case},
    grid::Grid,
    regions::Regions,
};

/// Agreement of two masks.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Id of the first mask.
    pub a: String,
    /// Id of the second mask.
    pub b: String,
    /// One value per metric of [`PAIR_METRICS`]; `None` where it is undefined.
    pub values: Vec<Option<f64>>,
}

impl Pair {
    /// The metrics with their values.
    pub fn metrics(&self) -> impl Iterator<Item = (&'static PairMetric, Option<f64>)> {
        PAIR_METRICS.iter().zip(self.values.iter().copied())
    }

    /// The value of the metric with this key.
    pub fn value(&self, key: &str) -> Option<f64> {
        self.metrics().find(|(metric, _)| metric.key == key)?.1
    }
}

impl Serialize for Pair {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(3 + self.values.len()))?;
        map.serialize_entry("a", &self.a)?;
        map.serialize_entry("b", &self.b)?;
        map.serialize_entry("convention", &PAIR_CONVENTION)?;
        for (metric, value) in self.metrics() {
            map.serialize_entry(metric.key, &value)?;
        }
        map.end()
    }
}

/// All pairs of masks, in the order of the index, with all metrics of [`PAIR_METRICS`].
///
/// ```
/// use glioscope_core::{Grid, Mask, MaskBits, Regions, TumorIndex, glam::DVec3, measure};
///
/// // Boxes of 4 and 6 voxels along x, 2 of them shared.
/// let grid = Grid::axis_aligned([8, 1, 1], DVec3::ONE, DVec3::ZERO)?;
/// let a = Mask::new("a", grid.clone(), MaskBits::from_fn([8, 1, 1], |i| i < 4)).ok_or("size")?;
/// let b = Mask::new("b", grid.clone(), MaskBits::from_fn([8, 1, 1], |i| i >= 2)).ok_or("size")?;
/// let index = TumorIndex::new(grid, &[&a, &b])?;
///
/// let pairs = measure::pairs(&index, &Regions::of(&index));
/// assert_eq!(pairs[0].value("dice"), Some(2.0 * 2.0 / (4.0 + 6.0)));
/// assert_eq!(pairs[0].value("jaccard"), Some(2.0 / 8.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn pairs(index: &TumorIndex, regions: &Regions) -> Vec<Pair> {
    let ids = regions.mask_ids();
    let pair = |a: usize, b: usize| {
        let input = PairInput { index, regions, a, b };
        let values = PAIR_METRICS.iter().map(|metric| metric.value(&input)).collect();
        Pair { a: ids[a].clone(), b: ids[b].clone(), values }
    };
    (0..ids.len()).flat_map(|a| (a + 1..ids.len()).map(move |b| (a, b))).map(|(a, b)| pair(a, b)).collect()
}

/// The voxels where exactly `masks` masks are active, whichever they are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// Number of active masks: 1 to the number of masks.
    pub masks: u32,
    /// Number of voxels where exactly that many are active; may be 0.
    pub voxels: u64,
    /// Their volume.
    pub volume_ml: f64,
}

/// Agreement of all masks, voxel by voxel: one level per number of active masks, from 1 to all of them.
/// The voxels of all levels add up to the union's.
pub fn agreement(regions: &Regions) -> Vec<Agreement> {
    let levels = 1..=regions.mask_ids().len() as u32;
    levels
        .map(|masks| {
            let of_level = regions.list().iter().filter(|r| r.mask_count() == masks);
            let (voxels, volume_ml) = of_level.fold((0, 0.0), |(n, ml), r| (n + r.voxels, ml + r.volume_ml));
            Agreement { masks, voxels, volume_ml }
        })
        .collect()
}

/// All measurements of a case, as `measure --json` writes them. Field names are stable.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasureReport {
    /// Name of the case.
    pub case: String,
    /// The grid of all measurements but the native volumes.
    pub grid: GridReport,
    /// The images and masks that registration transforms moved.
    pub aligned: Vec<Aligned>,
    /// All findings, most severe first.
    pub warnings: Vec<Check>,
    /// The time points, in the order of the case.
    pub time_points: Vec<TimeReport>,
}

/// A grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GridReport {
    /// Voxels along each axis.
    pub dims: [usize; 3],
    /// Distance between neighbouring voxel centres along each axis.
    pub spacing_mm: [f64; 3],
    /// The four rows of the matrix from voxel centres to RAS+ millimetres.
    pub world_from_voxel: [[f64; 4]; 4],
}

/// One time point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimeReport {
    /// Its label; empty where the case has one time point without a name.
    pub time: String,
    /// All masks, in the order of the case.
    pub masks: Vec<MaskReport>,
    /// All non-empty regions, fewest masks first; none when all masks are empty.
    pub regions: Vec<RegionReport>,
    /// All pairs of masks; see [`PAIR_METRICS`] for empty ones.
    pub pairs: Vec<Pair>,
    /// Voxels by number of active masks, from 1 to all; see [`agreement`].
    pub agreement: Vec<Agreement>,
    /// Values of every image in every mask; `None` where they weren't asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub statistics: Option<Vec<Statistics>>,
}

/// One mask. An empty one has 0 voxels and 0 ml.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaskReport {
    /// Its id.
    pub id: String,
    /// What the case calls it beside its id; null for nothing.
    pub name: Option<String>,
    /// Active voxels on the case grid.
    pub voxels: u64,
    /// Their volume.
    pub volume_ml: f64,
    /// Active voxels on the mask's native grid, before resampling.
    pub native_voxels: u64,
    /// Volume on the mask's native grid.
    pub native_volume_ml: f64,
    /// Of a soft mask: the sum of its probabilities as a volume on the native grid; null for others.
    pub expected_volume_ml: Option<f64>,
    /// Fraction of the union of all masks, 0 to 1; 0 where the union is empty.
    pub share: f64,
}

/// One region.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegionReport {
    /// Ids of exactly the masks that are active in it.
    pub masks: Vec<String>,
    /// Number of voxels; never 0.
    pub voxels: u64,
    /// Their volume.
    pub volume_ml: f64,
    /// Fraction of the union of all masks, above 0 to 1; the shares of one time point's regions add up to 1.
    pub share: f64,
}

impl GridReport {
    /// The report of `grid`.
    pub fn of(grid: &Grid) -> Self {
        Self {
            dims: grid.dims(),
            spacing_mm: grid.spacing_mm().to_array(),
            world_from_voxel: crate::grid::rows(grid.world_from_voxel()),
        }
    }
}

/// All measurements of `case`.
pub fn report(case: &Case) -> MeasureReport {
    let time_points = case.time_points.iter().map(|time| {
        let regions = &time.regions;
        let union = regions.union_voxels();
        let share = |voxels: u64| if union == 0 { 0.0 } else { voxels as f64 / union as f64 };
        let ids = |bits: u32| {
            let active = regions.mask_ids().iter().enumerate().filter(|(k, _)| bits >> k & 1 == 1);
            active.map(|(_, id)| id.clone()).collect()
        };
        TimeReport {
            time: time.label.clone(),
            masks: time
                .masks
                .iter()
                .enumerate()
                .map(|(k, m)| MaskReport {
                    id: m.mask.id().to_owned(),
                    name: m.name.clone(),
                    voxels: regions.mask_voxels(k),
                    volume_ml: regions.mask_ml(k),
                    native_voxels: m.native_voxels,
                    native_volume_ml: m.native_volume_ml,
                    expected_volume_ml: m.expected_volume_ml,
                    share: share(regions.mask_voxels(k)),
                })
                .collect(),
            regions: regions
                .list()
                .iter()
                .map(|r| RegionReport {
                    masks: ids(r.bits),
                    voxels: r.voxels,
                    volume_ml: r.volume_ml,
                    share: share(r.voxels),
                })
                .collect(),
            pairs: pairs(&time.index, regions),
            agreement: agreement(regions),
            statistics: None,
        }
    });
    MeasureReport {
        case: case.name.clone(),
        grid: GridReport::of(&case.grid),
        aligned: case.aligned.clone(),
        warnings: case.checks.clone(),
        time_points: time_points.collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Grid, Mask, MaskBits, TumorIndex};
    use glam::DVec3;

    fn pair_of(a: &[usize], b: &[usize]) -> Pair {
        let grid = Grid::axis_aligned([4, 3, 2], DVec3::ONE, DVec3::ZERO).unwrap();
        let mask = |id: &str, on: &[usize]| {
            Mask::new(id, grid.clone(), MaskBits::from_fn([4, 3, 2], |l| on.contains(&l))).unwrap()
        };
        let (a, b) = (mask("a", a), mask("b", b));
        let index = TumorIndex::new(grid, &[&a, &b]).unwrap();
        pairs(&index, &Regions::of(&index)).remove(0)
    }

    #[test]
    fn dice_and_jaccard_match_closed_forms() {
        let p = pair_of(&[0, 1, 2, 3], &[2, 3, 4, 5, 6, 7]);
        assert!((p.value("dice").unwrap() - 4.0 / 10.0).abs() < 1e-15);
        assert!((p.value("jaccard").unwrap() - 2.0 / 8.0).abs() < 1e-15);
        let json = serde_json::to_string(&p).unwrap();
        // Further metrics follow.
        assert!(
            json.starts_with(r#"{"a":"a","b":"b","convention":"metrics-reloaded","dice":0.4,"jaccard":0.25"#),
            "{json}"
        );
    }

    #[test]
    fn agreement_levels_are_counted_per_voxel() {
        let grid = Grid::axis_aligned([4, 3, 2], DVec3::new(1.0, 2.0, 5.0), DVec3::ZERO).unwrap();
        let on: [&[usize]; 3] = [&[0, 1, 2, 3, 9], &[2, 3, 4], &[3, 11]];
        let masks: Vec<Mask> = on
            .iter()
            .enumerate()
            .map(|(k, on)| {
                let bits = MaskBits::from_fn([4, 3, 2], |l| on.contains(&l));
                Mask::new(format!("m{k}"), grid.clone(), bits).unwrap()
            })
            .collect();
        let index = TumorIndex::new(grid, &masks.iter().collect::<Vec<_>>()).unwrap();
        let levels = agreement(&Regions::of(&index));
        // 0, 1, 4, 9, 11 once, 2 twice, 3 in all.
        assert_eq!(levels.iter().map(|l| (l.masks, l.voxels)).collect::<Vec<_>>(), [(1, 5), (2, 1), (3, 1)]);
        for level in levels {
            assert!((level.volume_ml - level.voxels as f64 * 0.01).abs() < 1e-15);
        }
    }

    #[test]
    fn empty_masks_have_defined_metrics() {
        let values = |p: Pair| ["dice", "jaccard"].map(|key| p.value(key).unwrap());
        assert_eq!(values(pair_of(&[], &[])), [1.0, 1.0]);
        assert_eq!(values(pair_of(&[1], &[])), [0.0, 0.0]);
        assert_eq!(values(pair_of(&[1, 5], &[1, 5])), [1.0, 1.0]);
    }

    #[test]
    fn metrics_are_printed_with_their_decimals() {
        let dice = &PAIR_METRICS[0];
        assert_eq!((dice.print(Some(0.5), 0), dice.print(Some(0.5), 2)), ("0.500".into(), "0.50000".into()));
        assert_eq!(dice.print(None, 0), "unknown");
        let mut with_unit = *dice;
        (with_unit.unit, with_unit.decimals) = ("mm", 1);
        assert_eq!(with_unit.print(Some(2.25), 1), "2.25 mm");
        let pair = pair_of(&[0, 1, 2, 3], &[2, 3]);
        assert_eq!(pair.metrics().map(|(metric, _)| metric.key).collect::<Vec<_>>(), ["dice", "jaccard"]);
        assert_eq!((pair.a.as_str(), pair.b.as_str(), pair.value("none")), ("a", "b", None));
    }

    #[test]
    fn a_grid_is_reported_by_rows() {
        let columns = glam::DMat3::from_cols(
            DVec3::new(0.0, 2.0, 0.0),
            DVec3::new(-3.0, 0.0, 0.0),
            DVec3::new(0.0, 0.0, 4.0),
        );
        let affine = glam::DAffine3 { matrix3: columns, translation: DVec3::new(5.0, 6.0, 7.0) };
        let report = GridReport::of(&Grid::new([2, 3, 4], affine, crate::Sides::Known).unwrap());
        assert_eq!((report.dims, report.spacing_mm), ([2, 3, 4], [2.0, 3.0, 4.0]));
        let rows = [[0.0, -3.0, 0.0, 5.0], [2.0, 0.0, 0.0, 6.0], [0.0, 0.0, 4.0, 7.0], [0.0, 0.0, 0.0, 1.0]];
        assert_eq!(report.world_from_voxel, rows);
    }

    /// Every order of three masks: pairs are those of the masks, whatever their position.
    #[test]
    fn every_pair_is_compared_once() {
        let grid = Grid::axis_aligned([10, 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        let sizes = [2, 4, 10];
        let masks = sizes.map(|n| {
            Mask::new(format!("{n}"), grid.clone(), MaskBits::from_fn([10, 1, 1], |l| l < n)).unwrap()
        });
        let index = TumorIndex::new(grid, &masks.each_ref()).unwrap();
        let found = pairs(&index, &Regions::of(&index));
        let of = |a: usize, b: usize| (format!("{a}"), format!("{b}"), Some(2.0 * a as f64 / (a + b) as f64));
        let found: Vec<_> = found.into_iter().map(|p| (p.a.clone(), p.b.clone(), p.value("dice"))).collect();
        assert_eq!(found, [of(2, 4), of(2, 10), of(4, 10)]);
    }
}
