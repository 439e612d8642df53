//! The conventions by which published packages compare two masks, as a table.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

use super::surface::Surface;

/// How two masks are compared. Packages agree on what Dice is, and differ in what a surface is, in what a percentile is,
/// and in what empty masks give.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, IntoStaticStr, VariantArray,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Convention {
    /// DeepMind's surface-distance.
    #[default]
    Deepmind,
    /// MetricsReloaded.
    MetricsReloaded,
    /// MedPy.
    Medpy,
    /// The lesion-wise metrics of BraTS 2023.
    Brats,
    /// Panoptica.
    Panoptica,
}

/// The robust Hausdorff distance of two lists of distances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Percentile {
    /// The larger of the two directed percentiles: each the first distance at which the areas up to it reach the part.
    LargerOfAreaWeighted,
    /// The larger of the two directed percentiles: each linear between points.
    LargerOfLinear,
    /// Of the distances of both directions together, linear between points.
    Pooled,
}

/// The normalised surface distance (surface Dice).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SurfaceDice {
    /// Part of both surfaces within the tolerance.
    OfBoth,
    /// Mean of each surface's part within the tolerance.
    MeanOfParts,
    /// The package has none.
    Absent,
}

/// Average distances that a package has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Averages {
    /// `assd_mm` over all points of both surfaces, `masd_mm` the mean of the two directed means.
    Both,
    /// `assd_mm` over all points of both surfaces.
    OfAll,
    /// `assd_mm` is the mean of the two directed means.
    OfMeans,
    /// The package has none.
    Absent,
}

/// How lesions (connected components, 26 neighbours) are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lesions {
    /// Reference lesions joined where they touch once dilated; each with all predicted ones in its dilation.
    Dilated,
    /// Pairs whose Jaccard index is at least 0.5, best first.
    Overlapping,
    /// Lesions aren't matched.
    Absent,
}

/// Which masks of a pair are empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Empty {
    /// Both.
    Both,
    /// Only the reference.
    Reference,
    /// Only the mask compared with it.
    Compared,
}

/// Values for both masks empty, only the reference, only the other; `None`: undefined.
type OfEmpty = [Option<f64>; 3];

const NONE: OfEmpty = [None; 3];
const INFINITE: OfEmpty = [Some(f64::INFINITY); 3];
const DISJOINT_INFINITE: OfEmpty = [None, Some(f64::INFINITY), Some(f64::INFINITY)];
const DISJOINT_ZERO: OfEmpty = [None, Some(0.0), Some(0.0)];
const AGREED: OfEmpty = [Some(1.0), Some(0.0), Some(0.0)];

/// What a package gives for empty masks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OfEmptyMasks {
    pub(super) dice: OfEmpty,
    pub(super) jaccard: OfEmpty,
    pub(super) relative_volume_difference: OfEmpty,
    pub(super) sensitivity: OfEmpty,
    pub(super) precision: OfEmpty,
    pub(super) hausdorff: OfEmpty,
    pub(super) assd: OfEmpty,
    pub(super) masd: OfEmpty,
    pub(super) surface_dice: OfEmpty,
}

impl OfEmptyMasks {
    /// What the formulas give: 0/0 and x/0 are undefined.
    const FORMULAS: Self = Self {
        dice: DISJOINT_ZERO,
        jaccard: DISJOINT_ZERO,
        relative_volume_difference: [None, None, Some(-1.0)],
        sensitivity: [None, None, Some(0.0)],
        precision: [None, Some(0.0), None],
        hausdorff: NONE,
        assd: NONE,
        masd: NONE,
        surface_dice: NONE,
    };
}

/// One convention.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConventionRow {
    /// Which.
    pub convention: Convention,
    /// Name in menus and tables.
    pub title: &'static str,
    /// The surface.
    pub surface: Surface,
    /// The percentile of `hd95_mm`.
    pub percentile: Percentile,
    /// Averages.
    pub averages: Averages,
    /// The surface Dice.
    pub surface_dice: SurfaceDice,
    /// Lesions.
    pub lesions: Lesions,
    /// The surface in words, for tooltips.
    pub surface_definition: &'static str,
    /// The percentile in words, for tooltips.
    pub percentile_definition: &'static str,
    /// Lesions in words, for tooltips; empty where they aren't matched.
    pub lesion_definition: &'static str,
    /// Empty masks in words, for tooltips.
    pub empty_definition: &'static str,
    /// Package and version that the figures were compared with.
    pub source: &'static str,
    pub(super) of_empty: OfEmptyMasks,
}

const VOXELS: &str =
    "active voxels with an inactive one across a face (6 neighbours), at voxel centres, all of one weight";
const CORNERS: &str =
    "voxel corners where the eight voxels around differ, weighted by the area between them (marching cubes)";

/// Hausdorff distance that BraTS 2023 gives a lesion found in one mask only, mm.
pub const BRATS_MISSED_MM: f64 = 374.0;

/// All conventions.
pub const CONVENTIONS: &[ConventionRow] = &[
    ConventionRow {
        convention: Convention::Deepmind,
        title: "DeepMind",
        surface: Surface::Corners,
        percentile: Percentile::LargerOfAreaWeighted,
        averages: Averages::Both,
        surface_dice: SurfaceDice::OfBoth,
        lesions: Lesions::Absent,
        surface_definition: CORNERS,
        percentile_definition: "larger of the two directed percentiles, weighted by area",
        lesion_definition: "",
        empty_definition: "both: Dice, averages and surface Dice undefined, Hausdorff infinite; one: Dice and surface Dice 0, distances infinite",
        source: "surface-distance 0.1 (PyPI)",
        of_empty: OfEmptyMasks {
            hausdorff: INFINITE,
            assd: DISJOINT_INFINITE,
            surface_dice: DISJOINT_ZERO,
            ..OfEmptyMasks::FORMULAS
        },
    },
    ConventionRow {
        convention: Convention::MetricsReloaded,
        title: "MetricsReloaded",
        surface: Surface::Voxels,
        percentile: Percentile::LargerOfLinear,
        averages: Averages::Both,
        surface_dice: SurfaceDice::OfBoth,
        lesions: Lesions::Absent,
        surface_definition: VOXELS,
        percentile_definition: "larger of the two directed percentiles, linear between points",
        lesion_definition: "",
        empty_definition: "both: Dice 1, Jaccard and surface Dice undefined, distances 0; one: overlaps 0, distances and surface Dice undefined",
        source: "MetricsReloaded, commit 00219d0",
        of_empty: OfEmptyMasks {
            dice: AGREED,
            relative_volume_difference: [Some(0.0), Some(1.0), Some(-1.0)],
            precision: DISJOINT_ZERO,
            hausdorff: [Some(0.0), None, None],
            assd: [Some(0.0), None, None],
            masd: [Some(0.0), None, None],
            ..OfEmptyMasks::FORMULAS
        },
    },
    ConventionRow {
        convention: Convention::Medpy,
        title: "MedPy",
        surface: Surface::Voxels,
        percentile: Percentile::Pooled,
        averages: Averages::OfAll,
        surface_dice: SurfaceDice::Absent,
        lesions: Lesions::Absent,
        surface_definition: VOXELS,
        percentile_definition: "percentile of both directions' distances together, linear between points",
        lesion_definition: "",
        empty_definition: "both: Dice and Jaccard 1, sensitivity and precision 0; one: overlaps 0; distances undefined (the package refuses)",
        source: "MedPy 0.5.2 (PyPI)",
        of_empty: OfEmptyMasks {
            dice: AGREED,
            jaccard: AGREED,
            sensitivity: [Some(0.0); 3],
            precision: [Some(0.0); 3],
            ..OfEmptyMasks::FORMULAS
        },
    },
    ConventionRow {
        convention: Convention::Brats,
        title: "BraTS 2023",
        surface: Surface::Corners,
        percentile: Percentile::LargerOfAreaWeighted,
        averages: Averages::Absent,
        surface_dice: SurfaceDice::Absent,
        lesions: Lesions::Dilated,
        surface_definition: CORNERS,
        percentile_definition: "larger of the two directed percentiles, weighted by area",
        lesion_definition: "components of 26 neighbours; those of the reference joined where they touch once dilated (18 neighbours), each compared with all predicted ones that touch its dilation; small ones left out; missed and false ones count with Dice 0 and 374 mm",
        empty_definition: "both: Dice and sensitivity 1, Hausdorff 0 mm; one: overlaps 0, Hausdorff 374 mm; averages and surface Dice aren't defined",
        source: "BraTS-2023-Metrics, commit 0c603fc",
        of_empty: OfEmptyMasks {
            dice: AGREED,
            sensitivity: AGREED,
            hausdorff: [Some(0.0), Some(BRATS_MISSED_MM), Some(BRATS_MISSED_MM)],
            ..OfEmptyMasks::FORMULAS
        },
    },
    ConventionRow {
        convention: Convention::Panoptica,
        title: "panoptica",
        surface: Surface::Voxels,
        percentile: Percentile::Pooled,
        averages: Averages::OfMeans,
        surface_dice: SurfaceDice::MeanOfParts,
        lesions: Lesions::Overlapping,
        surface_definition: VOXELS,
        percentile_definition: "percentile of both directions' distances together, linear between points",
        lesion_definition: "components of 26 neighbours; matched where their Jaccard index is at least 0.5",
        empty_definition: "both: undefined; one: overlaps and surface Dice 0, distances infinite, volume difference undefined",
        source: "panoptica 2.1.7 (PyPI)",
        of_empty: OfEmptyMasks {
            relative_volume_difference: NONE,
            hausdorff: DISJOINT_INFINITE,
            assd: DISJOINT_INFINITE,
            surface_dice: DISJOINT_ZERO,
            ..OfEmptyMasks::FORMULAS
        },
    },
];

impl Convention {
    /// Its row.
    pub fn row(self) -> &'static ConventionRow {
        // Every convention has its row (tested), in this order.
        &CONVENTIONS[self as usize]
    }

    /// Its name in files and on the command line: `deepmind`, `metrics-reloaded`, `medpy`, `brats`, `panoptica`.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// The convention of this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::VARIANTS.iter().copied().find(|c| c.name() == name)
    }
}
