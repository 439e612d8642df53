//! Enclosing ellipsoids of connected components: the numbers behind the ellipsoid diagram (thesis 7.6).
//!
//! Each component of each mask and of each region gets the minimum-volume ellipsoid that contains all
//! its voxel cubes, to a certified factor, and the *moment ellipsoid*: same centroid, same principal
//! axes, same volume as the component. Enclosing ellipsoids exaggerate overlap (thesis 7.7);
//! [`ComponentEllipsoid::exaggeration`] gives the factor.
//!
//! Methods, certificate and figures: docs/ellipsoids.md.

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    Cancelled, Progress,
    components::{Component, Components, Connectivity, Run, TooLarge},
    grid::Grid,
    tumor_index::TumorIndex,
};

pub mod cache;
mod exchange;
mod newton;
mod place;
mod points;
mod report;
mod solve;
mod state;
mod steps;

#[cfg(test)]
mod tests;

pub use place::Ellipsoid;
pub use points::hull_corners;
pub use report::{ComponentReport, EllipsoidReport, EllipsoidsReport, OfReport, report};
pub use solve::{Enclosing, enclose};

/// Algorithm that finds the minimum. All end with the same certificate; they differ in run time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Method {
    /// Exchange of weight between pairs of points, each by an exact line search (REX), with a Newton step on
    /// all weights every ten sweeps.
    #[default]
    Exchange,
    /// Wolfe and Atwood: steps towards the farthest point or away from the nearest.
    AwaySteps,
    /// Khachiyan: steps towards the farthest point only. The thesis's method; slow for tolerances below 1e-3.
    Khachiyan,
}

/// Method and stop criteria.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Algorithm that finds the minimum.
    pub method: Method,
    /// The volume is at most `1 + tolerance` times the minimum; above 0. Below 1e-13 rounding dominates.
    pub tolerance: f64,
    /// Maximum number of sweeps (exchange) or steps (the others) per component. Where they don't
    /// suffice, [`ComponentEllipsoid::volume_bound`] is larger.
    pub max_iterations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { method: Method::default(), tolerance: 1e-7, max_iterations: 100_000 }
    }
}

/// What a component is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Of {
    /// Mask k of the tumour index.
    Mask(usize),
    /// The region with these bits.
    Region(u32),
}

/// One component and its ellipsoids.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComponentEllipsoid {
    /// The mask or region it is a component of.
    pub of: Of,
    /// Number of its voxels; never 0.
    pub voxels: u64,
    /// Volume of its voxels.
    pub volume_ml: f64,
    /// The smallest ellipsoid found that contains all its voxel cubes.
    pub enclosing: Ellipsoid,
    /// The volume of `enclosing` is at most this times the minimum; at least 1.
    pub volume_bound: f64,
    /// Volume of `enclosing` over that of the component; above 1. A solid box has √3 π / 2 = 2.72.
    pub exaggeration: f64,
    /// The ellipsoid with the component's centroid, principal axes and volume.
    pub moment: Ellipsoid,
}

/// Why ellipsoids can't be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EllipsoidError {
    /// Cancelled by the user.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// More voxels than can be labelled.
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
}

/// The ellipsoids of every component of every mask, then of every region (fewest masks first, then by
/// bits, as [`crate::Regions::list`]); the components of each in raster order of their first voxels. The
/// same for any number of threads. Empty masks have none.
///
/// Regions are labelled in one pass, masks in one each. Progress counts components.
///
/// # Errors
/// [`EllipsoidError`].
///
/// ```
/// use glioscope_core::{Connectivity, Grid, Mask, MaskBits, Progress, TumorIndex, glam::DVec3};
/// use glioscope_core::ellipsoid::{Of, Options, ellipsoids_of};
///
/// // A box of 6 x 4 x 2 mm. Its smallest enclosing ellipsoid has √3 times its half lengths as semi-axes.
/// let grid = Grid::axis_aligned([10, 10, 10], DVec3::new(1.0, 1.0, 2.0), DVec3::ZERO)?;
/// let bits = MaskBits::from_fn(grid.dims(), |linear| {
///     let [i, j, k] = grid.ijk(linear);
///     (2..8).contains(&i) && (2..6).contains(&j) && k == 5
/// });
/// let mask = Mask::new("box", grid.clone(), bits).ok_or("size")?;
/// let index = TumorIndex::new(grid, &[&mask])?;
/// let found = ellipsoids_of(&index, Connectivity::default(), &Options::default(), &Progress::new())?;
///
/// assert_eq!((found[0].of, found[1].of), (Of::Mask(0), Of::Region(0b1)));
/// let enclosing = &found[0].enclosing;
/// assert!(enclosing.semi_axes_mm.abs_diff_eq(DVec3::new(3.0, 2.0, 1.0) * 3_f64.sqrt(), 1e-9));
/// assert!(enclosing.center_mm.abs_diff_eq(DVec3::new(4.5, 3.5, 10.0), 1e-9));
/// assert!((found[0].exaggeration - 3_f64.sqrt() * std::f64::consts::PI / 2.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn ellipsoids_of(
    index: &TumorIndex,
    connectivity: Connectivity,
    options: &Options,
    progress: &Progress,
) -> Result<Vec<ComponentEllipsoid>, EllipsoidError> {
    let mut labelled = Vec::with_capacity(index.mask_ids().len() + 1);
    for mask in 0..index.mask_ids().len() {
        progress.check()?;
        labelled.push(Components::of_index_mask(index, mask, connectivity)?);
    }
    progress.check()?;
    let regions = Components::of_index(index, connectivity)?;
    let mut jobs: Vec<(Of, &Components, &Component)> = Vec::new();
    for (mask, components) in labelled.iter().enumerate() {
        jobs.extend(components.list().iter().map(|c| (Of::Mask(mask), components, c)));
    }
    let masks_end = jobs.len();
    jobs.extend(regions.list().iter().map(|c| (Of::Region(c.value), &regions, c)));
    jobs[masks_end..].sort_by_key(|(_, _, c)| (c.value.count_ones(), c.value));

    progress.expect(jobs.len() as u64);
    let one = |&(of, components, component): &(Of, &Components, &Component)| {
        let found = ellipsoid_of(of, component, components.runs(component), index.grid(), options);
        progress.advance(1).map(|()| found)
    };
    // Small work items: one component may take as long as a thousand others.
    Ok(jobs.par_iter().with_max_len(8).map(one).collect::<Result<_, Cancelled>>()?)
}

/// Both ellipsoids of one component of `grid`; `runs` as [`Components::runs`].
fn ellipsoid_of(
    of: Of,
    component: &Component,
    runs: &[Run],
    grid: &Grid,
    options: &Options,
) -> ComponentEllipsoid {
    let world_from_voxel = grid.world_from_voxel();
    let found = enclosing_of(component, runs, options);
    let first_corner = DVec3::from(component.start.map(|v| v as f64 - 0.5));
    let (moment_center, moment_shape) = place::moment_shape(component, runs);
    ComponentEllipsoid {
        of,
        voxels: component.voxels,
        volume_ml: grid.volume_ml(component.voxels),
        enclosing: Ellipsoid::placed(&world_from_voxel, first_corner + found.center, found.shape),
        volume_bound: found.volume_bound,
        // The grid's matrix scales both volumes alike.
        exaggeration: found.volume() / component.voxels as f64,
        moment: Ellipsoid::placed(&world_from_voxel, moment_center, moment_shape),
    }
}

/// In index space, relative to the first corner of the component's bounding box.
fn enclosing_of(component: &Component, runs: &[Run], options: &Options) -> Enclosing {
    let size = DVec3::from(component.dims.map(|d| d as f64));
    let box_ellipsoid = Enclosing {
        center: size * 0.5,
        shape: DMat3::from_diagonal(size * (0.5 * 3_f64.sqrt())),
        volume_bound: 1.0,
        iterations: 0,
    };
    let box_voxels = component.dims.iter().try_fold(1_u64, |n, &d| n.checked_mul(d as u64));
    if box_voxels == Some(component.voxels) {
        return box_ellipsoid;
    }
    enclose(&hull_corners(runs, component.start), options).unwrap_or_else(|| {
        // Corners of a voxel span space, so only rounding leads here. The bounding box's ellipsoid
        // contains the voxels too, and no enclosing ellipsoid has less volume than the voxels.
        Enclosing { volume_bound: box_ellipsoid.volume() / component.voxels as f64, ..box_ellipsoid }
    })
}
