//! How the surface of a mask moved between two dates: thesis 7.3.4.
//!
//! The skeleton of the two masks' intersection tells each outer surface voxel which part of the
//! other surface it belongs to. What the thesis leaves open has an answer here: a partner is looked
//! for only among components that overlap; a component without a counterpart gets no arrow but is
//! listed; beside each length stand the plain distance to the nearest surface voxel and what can't
//! be told from no change.

mod choice;
mod groups;
mod report;
mod stats;
#[cfg(test)]
mod tests;
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

pub use choice::{Choice, ids_at};
pub use groups::{Fate, Group, Part};
pub use report::{
    ChangeReport, Counters, GroupReport, NearestReport, PartReport, UncertaintyReport, between, csv, report,
};
pub use stats::{COVERAGE, Histogram, Lengths, Uncertainty};
use vectors::{Place, Site, Surfaces};

/// Registration error taken where none is given: half a millimetre, good practice for rigid
/// registration of one patient's brain images.
pub const DEFAULT_REGISTRATION_MM: f64 = 0.5;

/// Choices of [`change`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangeOptions {
    /// The skeleton's.
    pub skeleton: SkeletonOptions,
    /// How far off the two dates may lie from one another: standard deviation along any direction,
    /// finite, at least 0.
    pub registration_mm: f64,
}

impl Default for ChangeOptions {
    fn default() -> Self {
        Self { skeleton: SkeletonOptions::default(), registration_mm: DEFAULT_REGISTRATION_MM }
    }
}

/// Why there is no answer.
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
    /// The registration error is no length.
    #[error("found a registration error of {0} mm, expected a finite number of at least 0")]
    Registration(f64),
    /// The case has less than two dates.
    #[error("{case}: found {dates} time point, expected at least two dates to compare")]
    OneDate {
        /// The case.
        case: String,
        /// How many it has.
        dates: usize,
    },
    /// The two dates have no mask of one id.
    #[error("{0}: found no mask that both dates have, expected one of the same id")]
    NoCommonMask(String),
    /// The case has no such mask or date.
    #[error("{case}: found {found}, expected {expected}")]
    Choice {
        /// The case.
        case: String,
        /// What was asked for.
        found: String,
        /// What there is.
        expected: String,
    },
    /// The masks have too many components or runs.
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    /// No distance can be told.
    #[error(transparent)]
    Distance(#[from] DistanceError),
    /// No skeleton can be told.
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// The cropped grid can't be used.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// What is special about one vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChangeFlags {
    /// No voxel of the other surface shares the skeleton point: the partner is the nearest voxel of
    /// the other surface in the same group.
    pub no_set: bool,
    /// Shorter than its uncertainty.
    pub within_uncertainty: bool,
}

/// How the surface moved at one outer surface voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceChange {
    /// The voxel, on the case grid.
    pub voxel: [usize; 3],
    /// Where the surface was, world millimetres.
    pub from_mm: DVec3,
    /// Where it is at the later date.
    pub to_mm: DVec3,
    /// The distance between them: above 0 growth, below 0 recession, never 0.
    pub signed_mm: f64,
    /// From the voxel to the nearest voxel of the other mask's surface, for comparison.
    pub nearest_mm: f64,
    /// What can't be told from no change, along this vector.
    pub uncertainty_mm: f64,
    /// Its group, as a position in [`Change::groups`].
    pub group: u32,
    /// What is special.
    pub flags: ChangeFlags,
}

/// An outer surface voxel of a component that overlaps none of the other date: it has no partner,
/// and no arrow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unpartnered {
    /// The voxel, on the case grid.
    pub voxel: [usize; 3],
    /// Its centre, world millimetres.
    pub position_mm: DVec3,
    /// Appeared at the later date; else vanished.
    pub appeared: bool,
    /// To the nearest voxel of the other mask's surface, whatever component; `None` where that mask
    /// is empty.
    pub nearest_mm: Option<f64>,
    /// Its group.
    pub group: u32,
}

/// What is special about a pair of masks. Names in JSON are stable, lower case, hyphenated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, IntoStaticStr)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Flag {
    /// The masks are identical.
    NoChange,
    /// They differ, but only inside: no outer surface voxel.
    InsideOnly,
    /// The earlier mask is empty.
    FromEmpty,
    /// The later mask is empty.
    ToEmpty,
    /// Neither is empty, and they share no voxel.
    NoOverlap,
    /// Some component vanished.
    Vanished,
    /// Some component appeared.
    Appeared,
    /// Some component split.
    Split,
    /// Some components merged.
    Merged,
    /// Several components became several others.
    Regrouped,
    /// Some vectors had an empty set, see [`ChangeFlags::no_set`].
    NoSet,
    /// A mask touches the border of the image: what lies beyond isn't known.
    TouchesBorder,
}

/// What was counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ChangeCounts {
    /// Surface voxels of the earlier mask.
    pub surface_from: u64,
    /// Surface voxels of the later mask.
    pub surface_to: u64,
    /// Vectors whose set was empty.
    pub no_set: u64,
    /// Outer surface voxels of vanished components.
    pub vanished_voxels: u64,
    /// Outer surface voxels of appeared components.
    pub appeared_voxels: u64,
}

/// How a mask changed between two dates.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Voxels active at both dates.
    pub kept_voxels: u64,
    /// Voxels active at the earlier date only.
    pub gone_voxels: u64,
    /// Voxels active at the later date only.
    pub new_voxels: u64,
    /// What is special.
    pub flags: Vec<Flag>,
    /// One vector for each outer surface voxel that has a partner, in memory order of the voxels.
    pub vectors: Vec<SurfaceChange>,
    /// The other outer surface voxels, in memory order.
    pub unpartnered: Vec<Unpartnered>,
    /// Components of both dates, matched by overlap.
    pub groups: Vec<Group>,
    /// Skeleton of the intersection; empty where no vector needs it.
    pub skeleton: Skeleton,
    /// Voxels of the grid that have a skeleton point: the points that vectors go by.
    pub skeleton_voxels: u64,
    /// Of every vector.
    pub uncertainty: Uncertainty,
    /// What was counted.
    pub counts: ChangeCounts,
}

fn cropped(mask: &MaskBits, crop: Crop) -> MaskBits {
    let mut out = MaskBits::empty(crop.dims);
    let [nx, ny, _] = mask.dims();
    // The crop holds all active voxels.
    mask.for_each(|l| {
        let v = [l % nx, l / nx % ny, l / (nx * ny)];
        out.set(std::array::from_fn(|a| v[a] - crop.start[a]));
    });
    out
}

fn touches_border(mask: &MaskBits) -> bool {
    mask.bounds()
        .is_some_and(|(start, size)| (0..3).any(|a| start[a] == 0 || start[a] + size[a] == mask.dims()[a]))
}

/// How `before` became `after`, two masks on `grid`.
///
/// Identical masks, masks without an overlap and empty ones need no skeleton and get none. Costs
/// that of the skeleton of the intersection, and `O(surface·log(surface))`.
///
/// # Errors
/// [`ChangeError`] when sizes differ, the registration error is no length, 32 bits don't count the
/// voxels, or the user stops it.
pub fn change(
    before: &MaskBits,
    after: &MaskBits,
    grid: &Grid,
    options: &ChangeOptions,
    progress: &Progress,
) -> Result<Change, ChangeError> {
    change_with(before, after, grid, options, None, progress)
}

/// As [`change`], with the skeleton's force from `source` where there is one and it can.
///
/// # Errors
/// As [`change`].
pub fn change_with(
    before: &MaskBits,
    after: &MaskBits,
    grid: &Grid,
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
        groups: Vec::new(),
        skeleton: Skeleton::default(),
        skeleton_voxels: 0,
        uncertainty: Uncertainty::new(mm, options.registration_mm),
        counts: ChangeCounts::default(),
    };
    let mut flag = |flag: Flag, holds: bool| {
        if holds {
            out.flags.push(flag);
        }
    };
    let (gone, new) = (out.gone_voxels, out.new_voxels);
    flag(Flag::NoChange, gone == 0 && new == 0);
    flag(Flag::FromEmpty, kept_voxels + gone == 0);
    flag(Flag::ToEmpty, kept_voxels + new == 0);
    flag(Flag::NoOverlap, kept_voxels == 0 && gone > 0 && new > 0);
    flag(Flag::TouchesBorder, touches_border(before) || touches_border(after));
    let Some(crop) = Crop::around(&[before, after], 1) else { return Ok(out) };
    progress.say("surfaces");
    let local = [cropped(before, crop), cropped(after, crop)];
    let place = Place { grid, start: crop.start, dims: crop.dims };
    let groups = groups::Groups::new(&local[0], &local[1], &grid.crop(crop.start, crop.dims)?)?;
    let has = |fate: Fate| groups.list.iter().any(|g| g.fate == fate);
    flag(Flag::Vanished, has(Fate::Vanished));
    flag(Flag::Appeared, has(Fate::Appeared));
    flag(Flag::Split, has(Fate::Split));
    flag(Flag::Merged, has(Fate::Merged));
    flag(Flag::Regrouped, has(Fate::Regrouped));
    let surfaces = Surfaces::new([&local[0], &local[1]], &groups, mm);
    out.counts.surface_from = surfaces.all[0].len() as u64;
    out.counts.surface_to = surfaces.all[1].len() as u64;
    let outer = || surfaces.outer.iter().flatten();
    if outer().next().is_none() {
        if gone + new > 0 {
            out.flags.push(Flag::InsideOnly);
        }
        out.groups = groups.list;
        return Ok(out);
    }
    let mut points = Vec::new();
    // A component without a counterpart asks nothing of the skeleton.
    if outer().any(|s| groups.list[s.group as usize].kept_voxels > 0) {
        out.skeleton = skeleton_with(&both, grid, &options.skeleton, source, progress)?;
        let shared: Vec<Site> = surfaces.all[0]
            .iter()
            .filter(|s| groups.list[s.group as usize].kept_voxels > 0)
            .copied()
            .collect();
        points = vectors::skeleton_sites(&out.skeleton, crop.start, crop.dims, mm, &shared, &groups)?;
        out.skeleton_voxels = points.len() as u64;
    }
    progress.say("surface change");
    let found = vectors::find(&surfaces, &points, &out.uncertainty, &place, progress)?;
    out.counts.no_set = found.vectors.iter().filter(|v| v.flags.no_set).count() as u64;
    out.counts.appeared_voxels = found.unpartnered.iter().filter(|v| v.appeared).count() as u64;
    out.counts.vanished_voxels = found.unpartnered.len() as u64 - out.counts.appeared_voxels;
    if out.counts.no_set > 0 {
        out.flags.push(Flag::NoSet);
    }
    out.vectors = found.vectors;
    out.unpartnered = found.unpartnered;
    out.groups = groups.list;
    Ok(out)
}
