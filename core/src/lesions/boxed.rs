//! A component in a box of its own.

use crate::{
    Grid, MaskBits,
    components::Run,
    distance::{Crop, FeatureTransform},
    glam::{DAffine3, DVec3},
    surface::without_cavities,
};

use super::error::LesionsError;

/// The voxels of a component in its bounding box with a margin of one voxel, so that every neighbour of a voxel is in it.
pub(super) struct Boxed {
    /// The component.
    pub bits: MaskBits,
    /// The component with its cavities.
    pub filled: MaskBits,
    /// The box.
    pub grid: Grid,
    /// The grid's voxel of the box's voxel (1, 1, 1).
    start: [usize; 3],
    depth: FeatureTransform,
}

impl Boxed {
    /// The voxels of `runs` on `grid`; `None` without a voxel. 8 bytes per voxel of the box while it is made, then 4.
    pub fn new(runs: &[Run], grid: &Grid) -> Result<Option<Self>, LesionsError> {
        let Some((start, dims)) = bounds(runs) else { return Ok(None) };
        let mut bits = MaskBits::empty(dims.map(|n| n + 2));
        let local =
            |voxel: [u32; 3]| -> [usize; 3] { std::array::from_fn(|a| voxel[a] as usize + 1 - start[a]) };
        for run in runs {
            (run.first..=run.last).for_each(|x| bits.set(local([x, run.y, run.z])));
        }
        let world = grid.world_from_voxel();
        let corner = DVec3::from_array(start.map(|n| n as f64 - 1.0));
        let placed = DAffine3 { matrix3: world.matrix3, translation: world.transform_point3(corner) };
        let boxed = Grid::new(bits.dims(), placed, grid.sides())?;
        let filled = without_cavities(&bits)?;
        let outside = FeatureTransform::of(&filled.inverted(), &boxed, Crop::whole(&boxed))?;
        Ok(outside.map(|depth| Self { bits, filled, grid: boxed, start, depth }))
    }

    /// From the centre of a voxel of the box to that of the nearest one outside the component and its cavities.
    pub fn depth_mm(&self, voxel: [usize; 3]) -> f64 {
        self.depth.distance_mm(voxel).unwrap_or(0.0)
    }

    /// As [`Boxed::depth_mm`], to that one's nearest point instead of its centre: half a voxel less.
    pub fn radius_mm(&self, voxel: [usize; 3]) -> f64 {
        let Some(outside) = self.depth.nearest(voxel) else { return 0.0 };
        let apart = std::array::from_fn(|a| (voxel[a].abs_diff(outside[a]) as f64 - 0.5).max(0.0));
        (self.grid.world_from_voxel().matrix3 * DVec3::from_array(apart)).length()
    }

    /// The voxel of the component or its cavities at a place.
    pub fn voxel_at(&self, at_mm: DVec3) -> Option<[usize; 3]> {
        self.grid.voxel_at(at_mm).filter(|voxel| self.filled.get(*voxel))
    }

    /// Runs of the box as runs of the grid.
    pub fn of_grid(&self, runs: &[Run]) -> Vec<Run> {
        let [dx, dy, dz] = self.start.map(|n| n as u32);
        let moved = |run: &Run| Run {
            first: run.first + dx - 1,
            last: run.last + dx - 1,
            y: run.y + dy - 1,
            z: run.z + dz - 1,
        };
        runs.iter().map(moved).collect()
    }
}

/// The 26 neighbours of a voxel of the component or its cavities, and itself; the margin keeps them in the box.
pub(super) fn around([x, y, z]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..27).map(move |n| [x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1])
}

fn bounds(runs: &[Run]) -> Option<([usize; 3], [usize; 3])> {
    let first = runs.first()?;
    let start = |run: &Run| [run.first, run.y, run.z].map(|n| n as usize);
    let end = |run: &Run| [run.last, run.y, run.z].map(|n| n as usize);
    let (lo, hi): ([usize; 3], [usize; 3]) = runs.iter().fold((start(first), end(first)), |(lo, hi), run| {
        let (s, e) = (start(run), end(run));
        (std::array::from_fn(|a| lo[a].min(s[a])), std::array::from_fn(|a| hi[a].max(e[a])))
    });
    Some((lo, std::array::from_fn(|a| hi[a] - lo[a] + 1)))
}
