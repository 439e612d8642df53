//! Change of a mask's surface between two time points: thesis 7.3.4.
//!
//! An outer surface voxel lies on the outer surface of one mask, outside the other mask. The skeleton of the masks'
//! intersection assigns it a partner on the other surface. Decisions that the thesis leaves open: walls of cavities are
//! reported apart; partners are sought only among overlapping components; a component without a counterpart gets no
//! arrow but is listed; masks without a common voxel are compared by volume only, as they may not be aligned; each
//! length is accompanied by the plain distance to the nearest place of the other surface and by its uncertainty, the smallest change
//! that can be distinguished from none.

mod call;
mod cavities;
mod choice;
mod displacement;
mod groups;
mod place;
mod point_cloud;
mod report;
mod stats;
mod surroundings;
#[cfg(test)]
mod surroundings_tests;
#[cfg(test)]
mod tests;
mod uncertainty;
mod vectors;

use glam::DVec3;
use serde::Serialize;
use strum::IntoStaticStr;

use crate::{
    Cancelled, Grid, GridError, MaskBits, Progress,
    components::TooLarge,
    distance::{Crop, DistanceError},
    skeleton::{ForceSource, Skeleton, SkeletonError, SkeletonOptions, skeleton_with},
};

pub use call::{Call, MOVED_SHARE, mean_move_mm};
pub use cavities::Cavities;
use cavities::Enclosing;
pub use choice::{Choice, ids_at};
use displacement::displacement_of;
pub use displacement::{Displacement, Explains};
pub use groups::{Fate, Group, Part};
use place::{Edges, Places};
pub(crate) use report::registration_mm;
pub use report::{
    ChangeReport, Counters, DisplacementReport, GroupReport, NearestReport, PartReport, UncertaintyReport,
    between, between_with_surroundings, csv, report,
};
pub use stats::{Histogram, Lengths};
pub use surroundings::{
    NotSaid, Surroundings, SurroundingsReport, Tissue, TissueCounts, TissueReport, surroundings,
};
pub use uncertainty::{COVERAGE, Sampling, Uncertainty};
use vectors::{CropFrame, SurfaceVoxel, Surfaces};

/// Default registration error: half a millimetre, good practice for rigid registration of one patient's brain images.
pub const DEFAULT_REGISTRATION_MM: f64 = 0.5;

/// Default of the smallest component that counts, millilitres: a ball of 5.8 mm. Smaller ones are mostly flecks of a segmentation's edge.
pub const DEFAULT_SMALLEST_ML: f64 = 0.1;

/// Options of [`change`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangeOptions {
    /// Options of the skeleton.
    pub skeleton: SkeletonOptions,
    /// Registration error between the two time points: standard deviation along any direction, finite, at least 0.
    pub registration_mm: f64,
    /// Whether the consistency of a registration, where one was run between the dates, replaces `registration_mm`.
    pub uses_consistency: bool,
    /// Smaller components make neither appeared, vanished, split nor merged, millilitres: finite, at least 0. They have vectors.
    pub smallest_ml: f64,
    /// Whether both masks are taken to lie in one space; otherwise only volumes are compared.
    pub is_aligned: bool,
    /// Whether partners are found through the skeleton. Without it each is the nearest place of the other surface: another length, but
    /// what is within uncertainty is the same, and so is the call.
    pub by_skeleton: bool,
}

impl Default for ChangeOptions {
    fn default() -> Self {
        Self {
            skeleton: SkeletonOptions::default(),
            registration_mm: DEFAULT_REGISTRATION_MM,
            uses_consistency: true,
            smallest_ml: DEFAULT_SMALLEST_ML,
            is_aligned: true,
            by_skeleton: true,
        }
    }
}

/// Why the change can't be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChangeError {
    /// A mask and the grid differ in size.
    #[error("found masks of {before:?} and {after:?} voxels, expected the grid's {grid:?}")]
    Dims {
        /// Size of the earlier mask.
        before: [usize; 3],
        /// Size of the later one.
        after: [usize; 3],
        /// Size of the grid.
        grid: [usize; 3],
    },
    /// The smallest component that counts is negative or not finite.
    #[error("found a smallest component of {0} ml, expected a finite number of at least 0")]
    Smallest(f64),
    /// The registration error is negative or not finite.
    #[error("found a registration error of {0} mm, expected a finite number of at least 0")]
    Registration(f64),
    /// The case has fewer than two time points.
    #[error("{case}: found {dates} time point, expected at least two dates to compare")]
    OneDate {
        /// The case.
        case: String,
        /// Its number of time points.
        dates: usize,
    },
    /// The order of the case's time points is unknown, and none were chosen.
    #[error(
        "{case}: found dates whose order isn't stated ({dates}), expected their order (--order) or an earlier and a later one (--from, --to)"
    )]
    UnknownOrder {
        /// The case.
        case: String,
        /// The labels of its time points.
        dates: String,
    },
    /// The two time points have no mask id in common.
    #[error("{case}: found no mask that both dates have ({from}; {to}), expected one of the same id")]
    NoCommonMask {
        /// The case.
        case: String,
        /// Ids of the earlier time point's masks.
        from: String,
        /// Ids of the later time point's masks.
        to: String,
    },
    /// The case has no such mask or time point.
    #[error("{case}: found {found}, expected {expected}")]
    Choice {
        /// The case.
        case: String,
        /// What was requested.
        found: String,
        /// What is available.
        expected: String,
    },
    /// The masks have too many components or runs.
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    /// A distance can't be computed.
    #[error(transparent)]
    Distance(#[from] DistanceError),
    /// The skeleton can't be computed.
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// The cropped grid is invalid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Flags of one vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChangeFlags {
    /// No voxel of the other surface has the same nearest skeleton point, or one about as near: the partner is the nearest voxel of the
    /// other surface in the same group.
    pub no_set: bool,
    /// Shorter than its uncertainty: the other surface lies so close, in whatever direction, that the two can't be
    /// told apart here.
    pub within_uncertainty: bool,
}

/// Movement of the surface at one outer surface voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceChange {
    /// The voxel, on the case grid.
    pub voxel: [usize; 3],
    /// Surface position at the earlier time point, world millimetres.
    pub from_mm: DVec3,
    /// Surface position at the later time point, world millimetres.
    pub to_mm: DVec3,
    /// Distance between the two: positive for growth, negative for recession, never 0.
    pub signed_mm: f64,
    /// Distance from the surface here to the nearest place of the other mask's surface, for comparison.
    pub nearest_mm: f64,
    /// Uncertainty along this vector: shorter lengths can't be distinguished from no change. The length times
    /// [`COVERAGE`], divided by the distance from the voxel to the other surface in standard deviations of
    /// [`Uncertainty`].
    pub uncertainty_mm: f64,
    /// Its group: index into [`Change::groups`].
    pub group: u32,
    /// Its flags.
    pub flags: ChangeFlags,
}

/// An outer surface voxel of a component that overlaps no component of the other time point: it has neither partner
/// nor arrow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unpartnered {
    /// The voxel, on the case grid.
    pub voxel: [usize; 3],
    /// Its centre, world millimetres.
    pub position_mm: DVec3,
    /// Whether it appeared at the later time point; otherwise it vanished.
    pub appeared: bool,
    /// Distance to the nearest voxel of the other mask's surface, of any component; `None` where that mask is empty.
    pub nearest_mm: Option<f64>,
    /// Its group: index into [`Change::groups`].
    pub group: u32,
}

/// Flags of a pair of masks. Names in JSON are stable, lower case, hyphenated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, IntoStaticStr)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Flag {
    /// The masks are identical.
    NoChange,
    /// They differ only inside: no outer surface voxel.
    InsideOnly,
    /// The earlier mask is empty.
    FromEmpty,
    /// The later mask is empty.
    ToEmpty,
    /// Neither is empty, and they share no voxel: perhaps the time points aren't aligned, so only volumes are compared.
    NoOverlap,
    /// The two masks are stated to lie in different spaces, and nothing says how these lie to each other: only volumes are
    /// compared.
    NotAligned,
    /// A component vanished.
    Vanished,
    /// A component appeared.
    Appeared,
    /// A component split.
    Split,
    /// Components merged.
    Merged,
    /// Several components became several others.
    Regrouped,
    /// Some vectors have [`ChangeFlags::no_set`].
    NoSet,
    /// A mask touches the border of the image and may extend beyond it.
    TouchesBorder,
}

/// Counters of the surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ChangeCounts {
    /// Surface voxels of the earlier mask.
    pub surface_from: u64,
    /// Surface voxels of the later mask.
    pub surface_to: u64,
    /// Vectors with [`ChangeFlags::no_set`].
    pub no_set: u64,
    /// Outer surface voxels of vanished components.
    pub vanished_voxels: u64,
    /// Outer surface voxels of appeared components.
    pub appeared_voxels: u64,
}

/// Change of a mask between two time points.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Voxels active at both time points.
    pub kept_voxels: u64,
    /// Voxels active only at the earlier time point.
    pub gone_voxels: u64,
    /// Voxels active only at the later time point.
    pub new_voxels: u64,
    /// Flags of the pair.
    pub flags: Vec<Flag>,
    /// One vector per outer surface voxel with a partner, in memory order of the voxels.
    pub vectors: Vec<SurfaceChange>,
    /// The outer surface voxels without a partner, in memory order.
    pub unpartnered: Vec<Unpartnered>,
    /// Sum over the voxels that lie on both outer surfaces, and so have no vector, of how far the surface moved within them in
    /// millimetres, outwards positive.
    pub moved_within_voxels_mm: f64,
    /// Components of both time points, matched by overlap; empty where the masks share no voxel.
    pub groups: Vec<Group>,
    /// The own displacement of each group, where one is sought; empty where there are no vectors.
    pub displacements: Vec<Option<Displacement>>,
    /// Skeleton of the intersection; empty where it isn't needed.
    pub skeleton: Skeleton,
    /// Number of voxels that contain a skeleton point; their mean points determine the partners.
    pub skeleton_voxels: u64,
    /// Uncertainty model of the vectors.
    pub uncertainty: Uncertainty,
    /// The cavities and their walls.
    pub cavities: Cavities,
    /// Counters of the surfaces.
    pub counts: ChangeCounts,
}

fn touches_border(mask: &MaskBits) -> bool {
    mask.bounds()
        .is_some_and(|(start, size)| (0..3).any(|a| start[a] == 0 || start[a] + size[a] == mask.dims()[a]))
}

/// Change from `before` to `after`, two masks on `grid`.
///
/// No skeleton is computed for identical, non-overlapping or empty masks. Cost: the skeleton of the intersection plus
/// `O(surface·log(surface))`.
///
/// # Errors
/// [`ChangeError`] when dimensions differ, the registration error is negative or not finite, the masks have too many
/// components or voxels for 32-bit indices, or the user cancels.
///
/// ```
/// use glioscope_core::{Grid, MaskBits, Progress, glam::DVec3};
/// use glioscope_core::change::{ChangeOptions, Fate, change};
///
/// // A ball grows from 6 to 9 mm.
/// let grid = Grid::axis_aligned([23, 23, 23], DVec3::ONE, DVec3::splat(-11.0))?;
/// let ball = |radius_mm: f64| {
///     MaskBits::from_fn(grid.dims(), |l| grid.center_of_voxel_mm(grid.ijk(l)).length() <= radius_mm)
/// };
/// let (before, after) = (ball(6.0), ball(9.0));
/// let change = change(&before, &after, &grid, &ChangeOptions::default(), &Progress::new())?;
///
/// assert_eq!(change.kept_voxels, before.count());
/// assert_eq!(change.new_voxels, after.count() - before.count());
/// assert_eq!(change.groups[0].fate, Fate::Matched);
/// // Every vector says growth, by 3 mm but for the voxels' size.
/// let lengths: Vec<f64> = change.vectors.iter().map(|vector| vector.signed_mm).collect();
/// assert!(lengths.iter().all(|&mm| mm > 0.0));
/// let mean_mm = lengths.iter().sum::<f64>() / lengths.len() as f64;
/// assert!((mean_mm - 3.0).abs() < 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn change(
    before: &MaskBits,
    after: &MaskBits,
    grid: &Grid,
    options: &ChangeOptions,
    progress: &Progress,
) -> Result<Change, ChangeError> {
    change_with(before, after, grid, [Sampling::native(grid); 2], options, None, progress)
}

/// As [`change`], of masks that were resampled onto `grid` so, and with the skeleton's force computed by `source` if
/// there is one and it doesn't refuse.
///
/// # Errors
/// As [`change`].
pub fn change_with(
    before: &MaskBits,
    after: &MaskBits,
    grid: &Grid,
    samplings: [Sampling; 2],
    options: &ChangeOptions,
    source: Option<&dyn ForceSource>,
    progress: &Progress,
) -> Result<Change, ChangeError> {
    if before.dims() != grid.dims() || after.dims() != grid.dims() {
        return Err(ChangeError::Dims { before: before.dims(), after: after.dims(), grid: grid.dims() });
    }
    if !(options.registration_mm.is_finite() && options.registration_mm >= 0.0) {
        return Err(ChangeError::Registration(options.registration_mm));
    }
    if !(options.smallest_ml.is_finite() && options.smallest_ml >= 0.0) {
        return Err(ChangeError::Smallest(options.smallest_ml));
    }
    let mm = grid.world_from_voxel().matrix3;
    let mut both = before.clone();
    both.words_mut().iter_mut().zip(after.words()).for_each(|(b, a)| *b &= a);
    let kept_voxels = both.count();
    let mut out = Change {
        kept_voxels,
        gone_voxels: before.count() - kept_voxels,
        new_voxels: after.count() - kept_voxels,
        flags: Vec::new(),
        vectors: Vec::new(),
        unpartnered: Vec::new(),
        moved_within_voxels_mm: 0.0,
        groups: Vec::new(),
        displacements: Vec::new(),
        skeleton: Skeleton::default(),
        skeleton_voxels: 0,
        uncertainty: Uncertainty::new(samplings, options.registration_mm),
        cavities: Cavities::default(),
        counts: ChangeCounts::default(),
    };
    let mut flag = |flag: Flag, is_set: bool| {
        if is_set {
            out.flags.push(flag);
        }
    };
    let (gone, new) = (out.gone_voxels, out.new_voxels);
    flag(Flag::NoChange, gone == 0 && new == 0 && options.is_aligned);
    flag(Flag::FromEmpty, kept_voxels + gone == 0);
    flag(Flag::ToEmpty, kept_voxels + new == 0);
    let shares_nothing = kept_voxels == 0 && gone > 0 && new > 0;
    let not_aligned = !options.is_aligned && kept_voxels + gone > 0 && kept_voxels + new > 0;
    flag(Flag::NotAligned, not_aligned);
    flag(Flag::NoOverlap, shares_nothing && !not_aligned);
    flag(Flag::TouchesBorder, touches_border(before) || touches_border(after));
    let has_volumes_only = shares_nothing || not_aligned;
    let Some(crop) = Crop::around(&[before, after], 1).filter(|_| !has_volumes_only) else { return Ok(out) };
    progress.say("surfaces");
    let local = [crop.part_of(before), crop.part_of(after)];
    let crop_frame = CropFrame { grid, start: crop.start, dims: crop.dims };
    let cropped = grid.crop(crop.start, crop.dims)?;
    let groups = groups::Groups::new(&local[0], &local[1], &cropped, options.smallest_ml)?;
    let has = |fate: Fate| groups.list.iter().any(|g| g.fate == fate && !g.is_small);
    flag(Flag::Vanished, has(Fate::Vanished));
    flag(Flag::Appeared, has(Fate::Appeared));
    flag(Flag::Split, has(Fate::Split));
    flag(Flag::Merged, has(Fate::Merged));
    flag(Flag::Regrouped, has(Fate::Regrouped));
    let enclosing = [Enclosing::new(&local[0], &groups, 0)?, Enclosing::new(&local[1], &groups, 1)?];
    let [[outer_from, walls_from], [outer_to, walls_to]] =
        [enclosing[0].surfaces(&groups, 0), enclosing[1].surfaces(&groups, 1)];
    out.cavities = Cavities::of(enclosing.each_ref(), [&walls_from, &walls_to], mm)?;
    let shifts_mm = samplings.map(|sampling| sampling.shift_mm);
    let places = Places::new(enclosing.each_ref(), &groups, mm, &samplings);
    let surfaces = Surfaces::new(enclosing.each_ref(), [&outer_from, &outer_to], &groups, &places);
    out.counts.surface_from = surfaces.all[0].len() as u64;
    out.counts.surface_to = surfaces.all[1].len() as u64;
    out.moved_within_voxels_mm = surfaces.moved_within_voxels_mm();
    let outer = || surfaces.outer.iter().flatten();
    if outer().next().is_none() {
        if gone + new > 0 {
            out.flags.push(Flag::InsideOnly);
        }
        out.groups = groups.list;
        return Ok(out);
    }
    let mut points = Vec::new();
    // Components without a counterpart don't need the skeleton.
    if options.by_skeleton && outer().any(|s| groups.list[s.group as usize].kept_voxels > 0) {
        out.skeleton = skeleton_with(&both, grid, &options.skeleton, source, progress)?;
        let shared_surface: Vec<SurfaceVoxel> = surfaces.all[0]
            .iter()
            .filter(|s| groups.list[s.group as usize].kept_voxels > 0)
            .copied()
            .collect();
        points =
            vectors::skeleton_points(&out.skeleton, crop.start, crop.dims, mm, &shared_surface, &groups)?;
        out.skeleton_voxels = points.len() as u64;
    }
    progress.say("surface change");
    let found =
        vectors::match_surfaces(&surfaces, &points, &out.uncertainty, shifts_mm, &crop_frame, progress)?;
    out.counts.no_set = found.vectors.iter().filter(|v| v.flags.no_set).count() as u64;
    out.counts.appeared_voxels = found.unpartnered.iter().filter(|v| v.appeared).count() as u64;
    out.counts.vanished_voxels = found.unpartnered.len() as u64 - out.counts.appeared_voxels;
    if out.counts.no_set > 0 {
        out.flags.push(Flag::NoSet);
    }
    out.vectors = found.vectors;
    out.unpartnered = found.unpartnered;
    let displacement = |(group, number): (&Group, u32)| {
        let ([before], [after]) = (group.before.as_slice(), group.after.as_slice()) else { return Ok(None) };
        if group.fate != Fate::Matched || group.is_small {
            return Ok(None);
        }
        let body = |date: usize, part: &Part| displacement::Body {
            surface: &surfaces.all[date],
            centroid_mm: part.centroid_mm + shifts_mm[date],
            volume_ml: part.volume_ml,
        };
        displacement_of(&out, number, [body(0, before), body(1, after)], &Edges::new(mm), progress)
    };
    let displacements: Result<Vec<_>, ChangeError> = groups.list.iter().zip(0..).map(displacement).collect();
    out.displacements = displacements?;
    out.groups = groups.list;
    Ok(out)
}
