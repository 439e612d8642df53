//! Parts a component at its neck.

use std::{
    cmp::{Ordering, Reverse},
    collections::BinaryHeap,
};

use crate::{Components, Connectivity, Grid, MaskBits, components::Run, glam::DVec3};

use super::{
    boxed::{Boxed, around},
    error::LesionsError,
};

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
///
/// Cavities count as inside, for seeds too: where a lesion is a shell about a necrotic core, its neck is that of the outer
/// surface.
pub(super) fn at_neck(
    runs: &[Run],
    grid: &Grid,
    seeds_mm: [DVec3; 2],
) -> Result<Result<[Vec<Run>; 2], String>, LesionsError> {
    let wrong =
        || Ok(Err("found seeds that aren't two voxels of the component, expected one in each lesion".into()));
    let Some(boxed) = Boxed::new(runs, grid)? else { return wrong() };
    let [Some(first), Some(second)] = seeds_mm.map(|mm| boxed.voxel_at(mm)) else { return wrong() };
    if first == second {
        return wrong();
    }
    let mut pieces = [0, 1].map(|_| MaskBits::empty(boxed.bits.dims()));
    let mut reached = MaskBits::empty(boxed.bits.dims());
    let mut heap = BinaryHeap::new();
    let mut order = 0;
    for (basin, voxel) in [(0, first), (1, second)] {
        reached.set(voxel);
        heap.push(Front { depth_mm: f64::INFINITY, order, voxel, basin });
        order += 1;
    }
    while let Some(Front { voxel, basin, .. }) = heap.pop() {
        if let (Some(piece), true) = (pieces.get_mut(usize::from(basin)), boxed.bits.get(voxel)) {
            piece.set(voxel);
        }
        for neighbor in around(voxel).filter(|neighbor| boxed.filled.get(*neighbor)) {
            if !reached.get(neighbor) {
                reached.set(neighbor);
                heap.push(Front { depth_mm: boxed.depth_mm(neighbor), order, voxel: neighbor, basin });
                order += 1;
            }
        }
    }
    // Beside a cavity a piece may lie in parts: all but the largest go to the other, the first's before the second's, so that
    // what the second loses touches what is left of the first.
    for own in [0, 1] {
        let parts = Components::of_mask(&pieces[own], Connectivity::TwentySix)?;
        let numbered = parts.list().iter().enumerate();
        let Some((largest, _)) = numbered.max_by_key(|(n, part)| (part.voxels, Reverse(*n))) else {
            return wrong();
        };
        if parts.list().len() > 1 {
            let mut kept = MaskBits::empty(boxed.bits.dims());
            for (n, part) in parts.list().iter().enumerate() {
                let to = if n == largest { &mut kept } else { &mut pieces[1 - own] };
                for run in parts.runs(part) {
                    (run.first..=run.last).for_each(|x| to.set([x, run.y, run.z].map(|n| n as usize)));
                }
            }
            pieces[own] = kept;
        }
    }
    let mut found = [Vec::new(), Vec::new()];
    for (found, piece) in found.iter_mut().zip(&pieces) {
        let parts = Components::of_mask(piece, Connectivity::TwentySix)?;
        *found = parts.list().iter().flat_map(|part| boxed.of_grid(parts.runs(part))).collect();
    }
    Ok(Ok(found))
}
