//! Parts a component at its neck.

use std::{cmp::Ordering, collections::BinaryHeap};

use crate::{
    Grid, MaskBits,
    components::Run,
    distance::{Crop, FeatureTransform},
    glam::DVec3,
};

use super::error::LesionsError;

/// A voxel to be flooded: the deepest first, of equally deep ones that reached first.
struct Front {
    depth_mm: f64,
    order: u64,
    voxel: [usize; 3],
    basin: u8,
}

impl PartialEq for Front {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Front {}

impl PartialOrd for Front {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Front {
    fn cmp(&self, other: &Self) -> Ordering {
        self.depth_mm.total_cmp(&other.depth_mm).then(other.order.cmp(&self.order))
    }
}

/// The voxels of `runs` in two connected pieces, one about each seed: a watershed from both (Meyer 1991) of the distance to
/// the nearest voxel outside. The reason, where the seeds don't lie in two of the voxels.
pub(super) fn at_neck(
    runs: &[Run],
    grid: &Grid,
    seeds_mm: [DVec3; 2],
) -> Result<Result<[Vec<Run>; 2], String>, LesionsError> {
    let wrong =
        || Ok(Err("found seeds that aren't two voxels of the component, expected one in each lesion".into()));
    let Some((start, dims)) = bounds(runs) else { return wrong() };
    // With a margin of one voxel.
    let mut bits = MaskBits::empty(dims.map(|n| n + 2));
    let local = |voxel: [usize; 3]| -> [usize; 3] { std::array::from_fn(|a| voxel[a] + 1 - start[a]) };
    for run in runs {
        (run.first..=run.last).for_each(|x| bits.set(local([x as usize, run.y as usize, run.z as usize])));
    }
    let seeds = seeds_mm.map(|mm| {
        let inside = |voxel: &[usize; 3]| (0..3).all(|a| (start[a]..start[a] + dims[a]).contains(&voxel[a]));
        grid.voxel_at(mm).filter(inside).map(local).filter(|voxel| bits.get(*voxel))
    });
    let [Some(first), Some(second)] = seeds else { return wrong() };
    if first == second {
        return wrong();
    }
    let spacing_mm = grid.world_from_voxel();
    let boxed = Grid::new(bits.dims(), spacing_mm, grid.sides())?;
    let outside = FeatureTransform::of(&bits.inverted(), &boxed, Crop::whole(&boxed))?;
    let depth_mm = |voxel: [usize; 3]| outside.as_ref().and_then(|map| map.distance_mm(voxel)).unwrap_or(0.0);
    let mut reached = MaskBits::empty(bits.dims());
    let mut heap = BinaryHeap::new();
    let mut order = 0;
    for (basin, voxel) in [(0, first), (1, second)] {
        reached.set(voxel);
        heap.push(Front { depth_mm: f64::INFINITY, order, voxel, basin });
        order += 1;
    }
    let mut pieces = [Vec::new(), Vec::new()];
    while let Some(Front { voxel, basin, .. }) = heap.pop() {
        if let Some(piece) = pieces.get_mut(usize::from(basin)) {
            piece.push(voxel);
        }
        // The margin keeps every neighbour inside.
        for neighbor in
            (0..27).map(|n| [voxel[0] + n % 3 - 1, voxel[1] + n / 3 % 3 - 1, voxel[2] + n / 9 - 1])
        {
            if bits.get(neighbor) && !reached.get(neighbor) {
                reached.set(neighbor);
                heap.push(Front { depth_mm: depth_mm(neighbor), order, voxel: neighbor, basin });
                order += 1;
            }
        }
    }
    Ok(Ok(pieces.map(|voxels| as_runs(voxels, start))))
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

/// Voxels of a box with a margin of one about one that begins at `start`, as runs in raster order.
fn as_runs(mut voxels: Vec<[usize; 3]>, start: [usize; 3]) -> Vec<Run> {
    voxels.sort_unstable_by_key(|[x, y, z]| [*z, *y, *x]);
    let mut runs: Vec<Run> = Vec::new();
    for voxel in voxels {
        let [x, y, z]: [u32; 3] = std::array::from_fn(|a| (voxel[a] + start[a] - 1) as u32);
        match runs.last_mut() {
            Some(run) if run.z == z && run.y == y && run.last + 1 == x => run.last = x,
            _ => runs.push(Run { first: x, last: x, y, z }),
        }
    }
    runs
}
