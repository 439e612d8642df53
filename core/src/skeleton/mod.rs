//! Curve skeleton of a mask: the curves that its boundary repels everything to.
//!
//! After Cornea, Silver, Yuan and Balasubramanian, *Computing hierarchical curve-skeletons of 3D
//! objects* (2005): charges on the boundary, critical points of their force, streamlines between.
//! What differs: distances are millimetres and charges weighted by area; a ball, a line and an even
//! thickness have answers; each step of a streamline must lower the potential, so that none circles;
//! pieces of one component are joined, so that the skeleton is connected where the mask is.

mod bridge;
mod critical;
mod field;
mod force;
mod seeds;
mod solid;
mod source;
#[cfg(test)]
mod tests;
mod trace;

use glam::DVec3;

use crate::{Cancelled, Grid, GridError, MaskBits, Progress, components::TooLarge, distance::DistanceError};
use field::Lattice;
pub use force::Charge;
use force::{Charges, Law};
use solid::Solid;
pub use source::{ForceSource, ForceTask, ForceUsed, Refused};
use trace::{Sketch, Tracer};

/// Steps inside the mask within which a part without an inside is a mere bump.
const BUMP: usize = 2;

/// How much of the skeleton is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Critical points, and streamlines from saddles.
    #[default]
    Core,
    /// Also streamlines from where the force converges most.
    Divergence,
    /// Also streamlines from tips of the boundary.
    Boundary,
}

/// Choices of [`skeleton`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkeletonOptions {
    /// How much of it.
    pub level: Level,
    /// The force falls with the `exponent`-th power of the distance: 4 to 9. Higher is sharper and
    /// lets less of a lobe be felt in the next; 5 needs no root.
    pub exponent: u32,
    /// Opening bound θ: boundary whose extent is below θ times its distance is summed as one charge.
    /// 0 is the exact sum.
    pub opening: f64,
    /// The force is sampled at every `coarse`-th voxel along each axis: 1 for all. Parts thinner
    /// than that have no inside then, and keep their voxels.
    pub coarse: usize,
    /// Level 1 starts at minima of divergence in this lowest part of its range, 0 to 1.
    pub divergence_part: f64,
}

impl Default for SkeletonOptions {
    fn default() -> Self {
        Self { level: Level::Core, exponent: 5, opening: 0.25, coarse: 1, divergence_part: 0.3 }
    }
}

/// Why there is no skeleton. An empty mask is no error: its skeleton is empty.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SkeletonError {
    /// The mask and the grid differ in size.
    #[error("found a mask of {mask:?} voxels, expected the grid's {grid:?}")]
    Dims {
        /// Size of the mask.
        mask: [usize; 3],
        /// Size of the grid.
        grid: [usize; 3],
    },
    /// The mask has too many voxels or runs.
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    /// No distance can be told.
    #[error(transparent)]
    Distance(#[from] DistanceError),
    /// The cropped grid can't be used.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// Nothing lies outside the mask: can't happen, as the box has a margin.
    #[error("found a mask without an outside, expected a margin around it")]
    NoOutside,
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Where a point of the skeleton comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// The force vanishes and points here from all sides.
    Attracting,
    /// The force vanishes and points here from some sides, away to others.
    Saddle,
    /// The force vanishes and points away to all sides.
    Repelling,
    /// On a streamline.
    Streamline,
    /// A voxel of a part too thin to have an inside.
    Thin,
    /// The deepest voxel of a component that has no other point.
    Deepest,
    /// A voxel on the way between two pieces.
    Bridge,
}

/// A point of the skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkeletonPoint {
    /// World millimetres.
    pub position_mm: DVec3,
    /// The same as a fractional voxel index of the grid.
    pub voxel: DVec3,
    /// Where it comes from.
    pub kind: PointKind,
}

/// What was found and done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SkeletonCounts {
    /// Voxels of cavities, counted as inside.
    pub filled_voxels: u64,
    /// Boundary charges.
    pub charges: u64,
    /// Places where the force was sampled.
    pub samples: u64,
    /// Attracting critical points.
    pub attracting: u64,
    /// Saddles.
    pub saddles: u64,
    /// Repelling critical points; the exact force has none.
    pub repelling: u64,
    /// Seeds of level 1 and 2.
    pub seeds: u64,
    /// Streamlines followed.
    pub streamlines: u64,
    /// Accepted steps of all streamlines.
    pub steps: u64,
    /// Streamlines that met a critical point or an earlier one.
    pub met: u64,
    /// Streamlines that came where the potential falls no more.
    pub arrived: u64,
    /// Streamlines stopped by the limit on steps.
    pub stopped: u64,
    /// Critical points left out as holes between charges, and streamlines whose start lies outside.
    pub skipped: u64,
    /// Voxels of thin parts.
    pub thin: u64,
    /// Components whose deepest voxel stands in.
    pub deepest: u64,
    /// Paths that join pieces.
    pub bridges: u64,
}

/// Points, lines between them, and what was counted. The order is the same in every run, whatever
/// the number of threads.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skeleton {
    /// The points.
    pub points: Vec<SkeletonPoint>,
    /// Polylines as positions in `points`. Those of one component hang together.
    pub lines: Vec<Vec<u32>>,
    /// What was found and done.
    pub counts: SkeletonCounts,
    /// What summed the force.
    pub force: ForceUsed,
}

/// The curve skeleton of `mask`, which lies on `grid`. Cavities count as inside. Empty for an empty
/// mask, otherwise with at least one point in each component (26-neighbourhood), the points of each
/// joined by lines.
///
/// Costs `O(voxels·log(boundary)/θ²)`; about 150 bytes a voxel of the mask.
///
/// # Errors
/// [`SkeletonError`] when sizes differ, 32 bits don't count the voxels, or the user stops it.
pub fn skeleton(
    mask: &MaskBits,
    grid: &Grid,
    options: &SkeletonOptions,
    progress: &Progress,
) -> Result<Skeleton, SkeletonError> {
    skeleton_with(mask, grid, options, None, progress)
}

/// As [`skeleton`], with the force at the lattice's places from `source` where there is one and it
/// can; [`Skeleton::force`] tells.
///
/// # Errors
/// As [`skeleton`]: a source that refuses is none.
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
    let Some(solid) = Solid::new(mask, grid)? else { return Ok(Skeleton::default()) };
    progress.say("curve skeleton");
    counts.filled_voxels = solid.filled;
    let law = Law::new(options.exponent);
    let charges = Charges::new(force::boundary_charges(&solid));
    counts.charges = charges.len() as u64;
    let lattice = Lattice::new(&solid, options.coarse);
    counts.samples = lattice.nodes.count();
    let cells = lattice.cells();
    let mut sketch = Sketch::default();
    let mut force = ForceUsed::Nothing;
    if cells.bounds().is_some() {
        let (forces, used) =
            lattice.forces_from(source, &charges, options.exponent, options.opening, progress)?;
        force = used;
        let critical = trace::distinct(&critical::critical_points(&lattice, &cells, &forces));
        let mut tracer = Tracer::new(&solid, &charges, law, options.opening, progress);
        tracer.core(&critical, &mut sketch, &mut counts)?;
        if options.level >= Level::Divergence {
            let seeds = seeds::low_divergence(&lattice, &forces, options.divergence_part);
            counts.seeds += seeds.len() as u64;
            tracer.seeds(&seeds, &mut sketch, &mut counts)?;
        }
        if options.level >= Level::Boundary {
            let seeds = seeds::curved_boundary(&solid);
            counts.seeds += seeds.len() as u64;
            tracer.seeds(&seeds, &mut sketch, &mut counts)?;
        }
    }
    let covered = solid.covered(&cells, |n, axis| (lattice.voxel(n, axis), lattice.voxel(n + 1, axis)));
    for voxel in solid.thin(&covered, BUMP) {
        sketch.add(solid.center(voxel), PointKind::Thin, 0);
        counts.thin += 1;
    }
    bridge::complete(&solid, &mut sketch, &mut counts, progress)?;
    let world_from_voxel = grid.world_from_voxel();
    let points = (sketch.points.iter())
        .map(|&(at, kind)| {
            let voxel = solid.grid_voxel(at);
            SkeletonPoint { position_mm: world_from_voxel.transform_point3(voxel), voxel, kind }
        })
        .collect();
    Ok(Skeleton { points, lines: sketch.lines, counts, force })
}

/// The boundary's force where the skeleton samples it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceField {
    /// Fractional voxel indices of the grid, in memory order.
    pub voxels: Vec<DVec3>,
    /// The force there times the m-th power of the distance to the nearest charge: its direction and
    /// zeros are the force's, its size has no unit.
    pub forces: Vec<DVec3>,
    /// What summed it.
    pub used: ForceUsed,
}

/// The force that [`skeleton`] follows, for pictures and for measuring what θ costs. Empty for an
/// empty mask.
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

/// As [`force_field`], from `source` where there is one and it can.
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
    let Some(solid) = Solid::new(mask, grid)? else { return Ok(ForceField::default()) };
    let charges = Charges::new(force::boundary_charges(&solid));
    let lattice = Lattice::new(&solid, options.coarse);
    let (forces, used) =
        lattice.forces_from(source, &charges, options.exponent, options.opening, progress)?;
    let [nx, ny, _] = lattice.nodes.dims();
    let mut voxels = Vec::with_capacity(forces.len());
    lattice.nodes.for_each(|l| {
        let node = DVec3::new((l % nx) as f64, (l / nx % ny) as f64, (l / (nx * ny)) as f64);
        voxels.push(solid.grid_voxel(lattice.unit(node)));
    });
    Ok(ForceField { voxels, forces, used })
}
