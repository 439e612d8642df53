//! The table of metrics and their values for two masks by one convention.

use std::borrow::Cow;

use crate::{
    Grid, MaskBits,
    distance::{Crop, DistanceError},
};
use glam::DVec3;
use serde::{Serialize, Serializer, ser::SerializeMap};

use super::{
    convention::{Averages, Convention, ConventionRow, Empty, Lesions, OfEmptyMasks, SurfaceDice},
    distances::SurfaceDistances,
    lesions::{self, LesionError, LesionReport, LesionRule, Measure},
    number::Number,
    overlap::Overlap,
    surface::Surface,
};

/// Cosine between two voxel axes up to which they count as perpendicular: packages know spacings only.
const PERPENDICULAR: f64 = 1e-6;

/// How two masks are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The convention.
    pub convention: Convention,
    /// Percentile of the robust Hausdorff distance, 0 to 100; 95 by default.
    pub percentile: f64,
    /// Tolerance of the surface Dice, mm; 1 by default, as in MetricsReloaded.
    pub tolerance_mm: f64,
    /// Which lesions count; used by [`Convention::Brats`].
    pub lesion_rule: LesionRule,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            convention: Convention::default(),
            percentile: 95.0,
            tolerance_mm: 1.0,
            lesion_rule: LesionRule::GLIOMA,
        }
    }
}

/// A metric of a reference A and a mask B compared with it.
#[derive(Clone, Copy, Debug)]
pub struct MetricRow {
    /// Its key in JSON. `hd95_mm` is that of another percentile where the settings have one: `hd90_mm`.
    pub key: &'static str,
    /// Name in tables.
    pub name: &'static str,
    /// Definition with range, for tooltips; conventions say what differs ([`ConventionRow`]).
    pub definition: &'static str,
    /// Its unit; empty if dimensionless.
    pub unit: &'static str,
    /// Decimals in tables.
    pub decimals: usize,
    of_overlap: Option<fn(&Overlap) -> f64>,
    of_distances: Option<fn(&SurfaceDistances, &Settings) -> Option<f64>>,
    of_empty: fn(&OfEmptyMasks) -> [Option<f64>; 3],
}

const OVERLAP: MetricRow = MetricRow {
    key: "",
    name: "",
    definition: "",
    unit: "",
    decimals: 3,
    of_overlap: None,
    of_distances: None,
    of_empty: |_| [None; 3],
};

const DISTANCE: MetricRow = MetricRow { unit: "mm", decimals: 2, ..OVERLAP };

const ROBUST_KEY: &str = "hd95_mm";

/// All metrics, in the order of tables.
pub const METRICS: &[MetricRow] = &[
    MetricRow {
        key: "dice",
        name: "Dice",
        definition: "2|A∩B| / (|A|+|B|), 0 to 1",
        of_overlap: Some(Overlap::dice),
        of_empty: |e| e.dice,
        ..OVERLAP
    },
    MetricRow {
        key: "jaccard",
        name: "Jaccard",
        definition: "|A∩B| / |A∪B|, 0 to 1",
        of_overlap: Some(Overlap::jaccard),
        of_empty: |e| e.jaccard,
        ..OVERLAP
    },
    MetricRow {
        key: "volume_similarity",
        name: "Volume similarity",
        definition: "1 − ||A|−|B|| / (|A|+|B|), 0 to 1: of volumes only, wherever they lie; undefined for two empty masks",
        of_overlap: Some(Overlap::volume_similarity),
        of_empty: |_| [None, Some(0.0), Some(0.0)],
        ..OVERLAP
    },
    MetricRow {
        key: "relative_volume_difference",
        name: "Volume difference",
        definition: "(|B|−|A|) / |A|, −1 upwards: negative where B is smaller than the reference A",
        of_overlap: Some(Overlap::relative_volume_difference),
        of_empty: |e| e.relative_volume_difference,
        ..OVERLAP
    },
    MetricRow {
        key: "sensitivity",
        name: "Sensitivity",
        definition: "|A∩B| / |A|, 0 to 1: part of the reference A that B has",
        of_overlap: Some(Overlap::sensitivity),
        of_empty: |e| e.sensitivity,
        ..OVERLAP
    },
    MetricRow {
        key: "precision",
        name: "Precision",
        definition: "|A∩B| / |B|, 0 to 1: part of B that lies in the reference A",
        of_overlap: Some(Overlap::precision),
        of_empty: |e| e.precision,
        ..OVERLAP
    },
    MetricRow {
        key: "kappa",
        name: "Cohen's kappa",
        definition: "agreement beyond chance over all voxels of the grid, up to 1: depends on how much background the grid has",
        of_overlap: Some(Overlap::kappa),
        of_empty: |_| [None, Some(0.0), Some(0.0)],
        ..OVERLAP
    },
    MetricRow {
        key: "hd_mm",
        name: "Hausdorff",
        definition: "largest distance from a surface to the other, both ways",
        of_distances: Some(|d, _| d.hausdorff_mm()),
        of_empty: |e| e.hausdorff,
        ..DISTANCE
    },
    MetricRow {
        key: ROBUST_KEY,
        name: "Robust Hausdorff",
        definition: "percentile (95) of the distances from a surface to the other, both ways",
        of_distances: Some(|d, settings| {
            d.percentile_mm(settings.percentile, settings.convention.row().percentile)
        }),
        of_empty: |e| e.hausdorff,
        ..DISTANCE
    },
    MetricRow {
        key: "assd_mm",
        name: "Average distance",
        definition: "average distance from a surface to the other: over all points of both, or the mean of both ways' averages (panoptica)",
        of_distances: Some(|d, settings| match settings.convention.row().averages {
            Averages::Both | Averages::OfAll => Some(d.mean_of_all_mm()),
            Averages::OfMeans => Some(d.mean_of_means_mm()),
            Averages::Absent => None,
        }),
        of_empty: |e| e.assd,
        ..DISTANCE
    },
    MetricRow {
        key: "masd_mm",
        name: "Mean of average distances",
        definition: "mean of both ways' average distances",
        of_distances: Some(|d, settings| {
            (settings.convention.row().averages == Averages::Both).then(|| d.mean_of_means_mm())
        }),
        of_empty: |e| e.masd,
        ..DISTANCE
    },
    MetricRow {
        key: "nsd",
        name: "Surface Dice",
        definition: "part of the surfaces within the tolerance of the other, 0 to 1",
        of_distances: Some(|d, settings| match settings.convention.row().surface_dice {
            SurfaceDice::OfBoth => Some(d.part_within(settings.tolerance_mm)),
            SurfaceDice::MeanOfParts => Some(d.mean_part_within(settings.tolerance_mm)),
            SurfaceDice::Absent => None,
        }),
        of_empty: |e| e.surface_dice,
        ..OVERLAP
    },
];

/// The two points that are as far apart as surfaces are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Hausdorff {
    /// Their distance.
    pub distance_mm: f64,
    /// On the surface of the reference, world millimetres.
    pub on_reference_mm: DVec3,
    /// On the surface of the mask compared with it, world millimetres.
    pub on_compared_mm: DVec3,
}

/// Why two masks have no distances, though neither is empty.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoDistances {
    /// Packages know spacings only: their distances would be wrong here.
    #[error("found voxel axes with a cosine of {0:.6}, expected perpendicular ones")]
    Sheared(f64),
    /// Distances can't be computed.
    #[error(transparent)]
    Distance(#[from] DistanceError),
    /// Lesions can't be numbered.
    #[error(transparent)]
    TooLarge(#[from] crate::components::TooLarge),
}

/// Masks that can't be compared voxel by voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found masks of {reference:?} and {compared:?} voxels, expected the grid's {grid:?}")]
pub struct Unequal {
    /// Size of the reference.
    pub reference: [usize; 3],
    /// Size of the mask compared with it.
    pub compared: [usize; 3],
    /// Size of the grid.
    pub grid: [usize; 3],
}

/// A mask compared with a reference by one convention.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The convention; its row has the definitions of surface, percentile and empty masks.
    pub convention: Convention,
    /// Percentile of the robust Hausdorff distance.
    pub percentile: f64,
    /// Tolerance of the surface Dice.
    pub tolerance_mm: f64,
    /// Voxels.
    #[serde(skip)]
    pub overlap: Overlap,
    /// One value per metric of [`METRICS`]: `None` where it is undefined or the package hasn't it, infinite where the
    /// package says so. In JSON by key; null for undefined, the text `"infinity"` for infinite ones.
    #[serde(flatten, serialize_with = "by_key")]
    pub values: Vec<(Cow<'static, str>, Option<f64>)>,
    /// Where the surfaces are farthest apart; `None` where a mask is empty.
    pub hausdorff: Option<Hausdorff>,
    /// Lesion by lesion; `None` where the convention has no lesions.
    pub lesions: Option<LesionReport>,
    /// Why there are neither distances nor lesions though no mask is empty.
    #[serde(serialize_with = "sentence")]
    pub no_distances: Option<NoDistances>,
}

impl Comparison {
    /// The value with this key.
    pub fn value(&self, key: &str) -> Option<f64> {
        self.values.iter().find(|(k, _)| k == key)?.1
    }
}

/// Compares `compared` with `reference`, two masks on `grid`.
///
/// # Errors
/// [`Unequal`] where sizes differ.
pub fn compare(
    reference: &MaskBits,
    compared: &MaskBits,
    grid: &Grid,
    settings: &Settings,
) -> Result<Comparison, Unequal> {
    let dims = [reference.dims(), compared.dims(), grid.dims()];
    if dims[0] != dims[2] || dims[1] != dims[2] {
        return Err(Unequal { reference: dims[0], compared: dims[1], grid: dims[2] });
    }
    let row = settings.convention.row();
    let mut overlap = Overlap { voxels: grid.voxel_count() as u64, reference: 0, compared: 0, both: 0 };
    let (mut distances, mut lesions, mut no_distances, mut start) = (None, None, None, [0; 3]);
    let margin = if row.lesions == Lesions::Dilated { settings.lesion_rule.dilations } else { 0 };
    if let Some(crop) = Crop::around(&[reference, compared], margin) {
        let [a, b] = [crop.part_of(reference), crop.part_of(compared)];
        overlap = Overlap { voxels: overlap.voxels, ..Overlap::of(&a, &b) };
        start = crop.start;
        match measured(&a, &b, grid, settings, overlap.empty()) {
            Ok(found) => (distances, lesions) = found,
            Err(reason) => no_distances = Some(reason),
        }
    } else if row.lesions != Lesions::Absent {
        let nothing = MaskBits::empty([1; 3]);
        lesions =
            measured(&nothing, &nothing, grid, settings, overlap.empty()).ok().and_then(|found| found.1);
    }
    let values = METRICS.iter().map(|metric| {
        let key = if metric.key == ROBUST_KEY {
            Cow::Owned(format!("hd{}_mm", settings.percentile))
        } else {
            Cow::Borrowed(metric.key)
        };
        (key, value_of(metric, &overlap, distances.as_ref(), settings))
    });
    Ok(Comparison {
        convention: settings.convention,
        percentile: settings.percentile,
        tolerance_mm: settings.tolerance_mm,
        overlap,
        values: values.collect(),
        hausdorff: distances.as_ref().and_then(|d| points_of(d, grid, start, row)),
        lesions,
        no_distances,
    })
}

type Measured = (Option<SurfaceDistances>, Option<LesionReport>);

fn measured(
    a: &MaskBits,
    b: &MaskBits,
    grid: &Grid,
    settings: &Settings,
    empty: Option<Empty>,
) -> Result<Measured, NoDistances> {
    let cosine = largest_cosine(grid);
    if cosine > PERPENDICULAR {
        return Err(NoDistances::Sheared(cosine));
    }
    let row = settings.convention.row();
    let spacing_mm = grid.spacing_mm();
    let distances = match empty {
        Some(_) => None,
        None => Some(SurfaceDistances::between(a, b, spacing_mm, row.surface)?),
    };
    let measure = Measure { row, percentile: settings.percentile, spacing_mm, rule: settings.lesion_rule };
    let lesions = lesions::report(a, b, &measure).map_err(|error| match error {
        LesionError::TooLarge(error) => NoDistances::TooLarge(error),
        LesionError::Distance(error) => NoDistances::Distance(error),
    })?;
    Ok((distances, lesions))
}

fn value_of(
    metric: &MetricRow,
    overlap: &Overlap,
    distances: Option<&SurfaceDistances>,
    settings: &Settings,
) -> Option<f64> {
    if let Some(empty) = overlap.empty() {
        let [both, reference, compared] = (metric.of_empty)(&settings.convention.row().of_empty);
        return match empty {
            Empty::Both => both,
            Empty::Reference => reference,
            Empty::Compared => compared,
        };
    }
    let of_overlap = metric.of_overlap.map(|of| of(overlap)).filter(|value| value.is_finite());
    // A sum of nothing may be −0.
    of_overlap.or_else(|| (metric.of_distances?)(distances?, settings)).map(|value| value + 0.0)
}

fn points_of(
    distances: &SurfaceDistances,
    grid: &Grid,
    start: [usize; 3],
    row: &ConventionRow,
) -> Option<Hausdorff> {
    // Corner `ijk` is half a voxel below the centre of voxel `ijk`.
    let shift = if row.surface == Surface::Corners { -0.5 } else { 0.0 };
    let world_mm = |point: [usize; 3]| {
        let voxel = [0, 1, 2].map(|a| (point[a] + start[a]) as f64 + shift);
        grid.world_from_voxel().transform_point3(DVec3::from_array(voxel))
    };
    let [on_reference, on_compared] = distances.hausdorff_points()?;
    Some(Hausdorff {
        distance_mm: distances.hausdorff_mm()?,
        on_reference_mm: world_mm(on_reference),
        on_compared_mm: world_mm(on_compared),
    })
}

/// The largest cosine between two voxel axes, without sign.
fn largest_cosine(grid: &Grid) -> f64 {
    let m = grid.world_from_voxel().matrix3;
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis / axis.length());
    [x.dot(y), x.dot(z), y.dot(z)].iter().fold(0.0, |most, cosine| cosine.abs().max(most))
}

fn by_key<S: Serializer>(
    values: &[(Cow<'static, str>, Option<f64>)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(values.len()))?;
    for (key, value) in values {
        map.serialize_entry(key, &Number(value))?;
    }
    map.end()
}

fn sentence<S: Serializer>(reason: &Option<NoDistances>, serializer: S) -> Result<S::Ok, S::Error> {
    reason.as_ref().map(ToString::to_string).serialize(serializer)
}
