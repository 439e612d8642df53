//! Curve skeleton of a mask, along which the repulsive force of its boundary converges.
//!
//! After Cornea, Silver, Yuan and Balasubramanian, *Computing hierarchical curve-skeletons of 3D
//! objects* (2005): charges on the boundary, critical points of their force, streamlines between.
//! Differences: distances are in millimetres and charges weighted by area; balls, lines and parts of even thickness
//! have skeletons; each step of a streamline must lower the potential, so that none circles; pieces of one component
//! are joined, so that the skeleton is connected where the mask is.

mod bridge;
mod critical;
mod field;
mod filled_mask;
mod force;
mod seeds;
mod source;
#[cfg(test)]
mod tests;
mod trace;

use glam::DVec3;

use crate::{
    Cancelled, Grid, GridError, MaskBits, Progress, components::TooLarge, distance::DistanceError, grid::ijk,
};
use field::Lattice;
use filled_mask::FilledMask;
pub use force::Charge;
use force::{Charges, PowerLaw};
pub use source::{ForceSource, ForceTask, ForceUsed, Refused};
use trace::{SkeletonBuilder, Tracer};

/// Uncovered voxels within this many steps of a covered one are bumps of the surface, not thin parts.
const MAX_BUMP_STEPS: usize = 2;

/// Level of detail of the skeleton.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Level 0: critical points, and streamlines from saddles.
    #[default]
    Core,
    /// Level 1: also streamlines from minima of the divergence of the force.
    Divergence,
    /// Level 2: also streamlines from tips of the boundary.
    Boundary,
}

/// Options of [`skeleton`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkeletonOptions {
    /// Level of detail.
    pub level: Level,
    /// The force decays with the `exponent`-th power of the distance, 4 to 9. With higher exponents a lobe affects its
    /// neighbours less; odd exponents need no square root.
    pub exponent: u32,
    /// Opening angle θ (Barnes and Hut): a cluster of charges whose radius is at most θ times its distance is summed as
    /// one charge. 0 gives the exact sum.
    pub opening: f64,
    /// The force is sampled at every `coarse`-th voxel along each axis: 1 for all. Parts thinner than that contain no
    /// lattice cell, and their voxels are kept as they are ([`PointKind::Thin`]).
    pub coarse: usize,
    /// Level 1 starts at local minima of the divergence in this lowest fraction of its range, 0 to 1.
    pub divergence_part: f64,
}

impl Default for SkeletonOptions {
    fn default() -> Self {
        Self { level: Level::Core, exponent: 5, opening: 0.25, coarse: 1, divergence_part: 0.3 }
    }
}

/// Why the skeleton can't be computed. An empty mask is no error: its skeleton is empty.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SkeletonError {
    /// The mask and the grid differ in dimensions.
    #[error("found a mask of {mask:?} voxels, expected the grid's {grid:?}")]
    Dims {
        /// Dimensions of the mask.
        mask: [usize; 3],
        /// Dimensions of the grid.
        grid: [usize; 3],
    },
    /// The mask has too many voxels or runs.
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    /// A distance can't be computed.
    #[error(transparent)]
    Distance(#[from] DistanceError),
    /// The cropped grid is invalid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The mask has no background. Can't happen, as its box has a margin.
    #[error("found a mask without an outside, expected a margin around it")]
    NoOutside,
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Origin of a skeleton point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// Critical point that attracts from all directions.
    Attracting,
    /// Critical point that attracts from some directions and repels in others.
    Saddle,
    /// Critical point that repels in all directions.
    Repelling,
    /// On a streamline.
    Streamline,
    /// A voxel of a part too thin to contain a lattice cell.
    Thin,
    /// The deepest voxel of a component without any other point.
    Deepest,
    /// A voxel on a path that joins two pieces.
    Bridge,
}

/// A point of the skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkeletonPoint {
    /// World millimetres.
    pub position_mm: DVec3,
    /// The same as a fractional voxel index of the grid.
    pub voxel: DVec3,
    /// Its origin.
    pub kind: PointKind,
}

/// Counters of the skeleton.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SkeletonCounts {
    /// Voxels of cavities, treated as inside.
    pub filled_voxels: u64,
    /// Boundary charges.
    pub charges: u64,
    /// Lattice points at which the force was sampled.
    pub samples: u64,
    /// Attracting critical points.
    pub attracting: u64,
    /// Saddles.
    pub saddles: u64,
    /// Repelling critical points; the exact force has none.
    pub repelling: u64,
    /// Seeds of levels 1 and 2.
    pub seeds: u64,
    /// Streamlines traced.
    pub streamlines: u64,
    /// Accepted steps of all streamlines.
    pub steps: u64,
    /// Streamlines that ended at a critical point or an earlier streamline.
    pub met: u64,
    /// Streamlines that ended where no step lowers the potential.
    pub arrived: u64,
    /// Streamlines stopped by the limit on steps.
    pub stopped: u64,
    /// Critical points discarded as gaps between charges, and streamlines that would start outside the mask.
    pub skipped: u64,
    /// Voxels kept of thin parts.
    pub thin: u64,
    /// Components represented by their deepest voxel alone.
    pub deepest: u64,
    /// Paths that join pieces.
    pub bridges: u64,
}

/// Points, lines between them, and counters. The result is deterministic, whatever the number of threads.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skeleton {
    /// The points.
    pub points: Vec<SkeletonPoint>,
    /// Polylines as indices into `points`. Those of one component are connected.
    pub lines: Vec<Vec<u32>>,
    /// Counters.
    pub counts: SkeletonCounts,
    /// What computed the force.
    pub force: ForceUsed,
}

/// The curve skeleton of `mask`, which lies on `grid`. Cavities are treated as inside. Empty for an empty mask,
/// otherwise with at least one point per component (26-neighbourhood), the points of each connected by lines.
///
/// Cost: `O(voxels·log(boundary)/θ²)`; about 150 bytes per voxel of the mask.
///
/// # Errors
/// [`SkeletonError`] when dimensions differ, the mask has too many voxels for 32-bit indices, or the user cancels.
pub fn skeleton(
    mask: &MaskBits,
    grid: &Grid,
    options: &SkeletonOptions,
    progress: &Progress,
) -> Result<Skeleton, SkeletonError> {
    skeleton_with(mask, grid, options, None, progress)
}

/// As [`skeleton`], with the force at the lattice points computed by `source` if there is one and it doesn't refuse;
/// [`Skeleton::force`] states which was used.
///
/// # Errors
/// As [`skeleton`]: a refusal by the source is no error.
pub fn skeleton_with(
    mask: &MaskBits,
    grid: &Grid,
    options: &SkeletonOptions,
    source: Option<&dyn ForceSource>,
    progress: &Progress,
) -> Result<Skeleton, SkeletonError> {
    if mask.dims() != grid.dims() {
        return Err(SkeletonError::Dims { mask: mask.dims(), grid: grid.dims() });
    }
    let mut counts = SkeletonCounts::default();
    let Some(filled) = FilledMask::new(mask, grid)? else { return Ok(Skeleton::default()) };
    progress.say("curve skeleton");
    counts.filled_voxels = filled.filled_voxels;
    let law = PowerLaw::new(options.exponent);
    let charges = Charges::new(force::boundary_charges(&filled));
    counts.charges = charges.len() as u64;
    let lattice = Lattice::new(&filled, options.coarse);
    counts.samples = lattice.nodes.count();
    let cells = lattice.cells();
    let mut builder = SkeletonBuilder::default();
    let mut force = ForceUsed::Nothing;
    if cells.bounds().is_some() {
        let (forces, used) =
            lattice.forces_from(source, &charges, options.exponent, options.opening, progress)?;
        force = used;
        let critical = trace::distinct(&critical::critical_points(&lattice, &cells, &forces));
        let mut tracer = Tracer::new(&filled, &charges, law, options.opening, progress);
        tracer.core(&critical, &mut builder, &mut counts)?;
        if options.level >= Level::Divergence {
            let seeds = seeds::low_divergence(&lattice, &forces, options.divergence_part);
            counts.seeds += seeds.len() as u64;
            tracer.seeds(&seeds, &mut builder, &mut counts)?;
        }
        if options.level >= Level::Boundary {
            let seeds = seeds::curved_boundary(&filled);
            counts.seeds += seeds.len() as u64;
            tracer.seeds(&seeds, &mut builder, &mut counts)?;
        }
    }
    let covered = filled.covered(&cells, |n, axis| (lattice.voxel(n, axis), lattice.voxel(n + 1, axis)));
    for voxel in filled.thin(&covered, MAX_BUMP_STEPS) {
        builder.add(filled.center(voxel), PointKind::Thin, 0);
        counts.thin += 1;
    }
    bridge::complete(&filled, &mut builder, &mut counts, progress)?;
    let world_from_voxel = grid.world_from_voxel();
    let points = (builder.points.iter())
        .map(|&(at, kind)| {
            let voxel = filled.grid_voxel(at);
            SkeletonPoint { position_mm: world_from_voxel.transform_point3(voxel), voxel, kind }
        })
        .collect();
    Ok(Skeleton { points, lines: builder.lines, counts, force })
}

/// The boundary's force at the lattice points at which the skeleton samples it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceField {
    /// Fractional voxel indices of the grid, in memory order.
    pub voxels: Vec<DVec3>,
    /// The force there times the m-th power of the distance to the nearest charge: direction and zeros are those of the
    /// force, the magnitude has no physical unit.
    pub forces: Vec<DVec3>,
    /// What computed it.
    pub used: ForceUsed,
}

/// The force that [`skeleton`] follows, for figures and for measuring the error due to θ. Empty for an empty mask.
///
/// # Errors
/// As [`skeleton`].
pub fn force_field(
    mask: &MaskBits,
    grid: &Grid,
    options: &SkeletonOptions,
    progress: &Progress,
) -> Result<ForceField, SkeletonError> {
    force_field_with(mask, grid, options, None, progress)
}

/// As [`force_field`], computed by `source` if there is one and it doesn't refuse.
///
/// # Errors
/// As [`skeleton`].
pub fn force_field_with(
    mask: &MaskBits,
    grid: &Grid,
    options: &SkeletonOptions,
    source: Option<&dyn ForceSource>,
    progress: &Progress,
) -> Result<ForceField, SkeletonError> {
    if mask.dims() != grid.dims() {
        return Err(SkeletonError::Dims { mask: mask.dims(), grid: grid.dims() });
    }
    let Some(filled) = FilledMask::new(mask, grid)? else { return Ok(ForceField::default()) };
    let charges = Charges::new(force::boundary_charges(&filled));
    let lattice = Lattice::new(&filled, options.coarse);
    let (forces, used) =
        lattice.forces_from(source, &charges, options.exponent, options.opening, progress)?;
    let dims = lattice.nodes.dims();
    let mut voxels = Vec::with_capacity(forces.len());
    lattice.nodes.for_each(|l| {
        let node = DVec3::from_array(ijk(dims, l).map(|v| v as f64));
        voxels.push(filled.grid_voxel(lattice.unit(node)));
    });
    Ok(ForceField { voxels, forces, used })
}
