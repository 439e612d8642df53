//! The force on a lattice of points inside the mask.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{
    filled_mask::FilledMask,
    force::{Block, Charges, PowerLaw},
};
use crate::{Cancelled, MaskBits, Progress};

/// Lattice points along the edge of a block that shares one list of charges.
const EDGE: usize = 4;

/// Maximum number of lattice points along one voxel of a thick slice.
const MAX_REFINE: f64 = 6.0;

/// The points at which the force is sampled: voxel centres; with coarse sampling every c-th one; along the axis of
/// thick slices several per voxel, so that the spacing is about equal in all directions.
pub(super) struct Lattice {
    /// Lattice points inside the mask.
    pub nodes: MaskBits,
    offset: DVec3,
    step: DVec3,
    /// Maps lattice steps to units.
    pub unit_from_node: DMat3,
    origin: DVec3,
    /// Number of inside points in the words before each word.
    rank: Vec<u32>,
}

impl Lattice {
    pub fn new(filled: &FilledMask, coarse: usize) -> Self {
        let dims = filled.bits.dims();
        let coarse = coarse.max(1) as f64;
        let (mut offset, mut step) = (DVec3::ZERO, DVec3::ONE);
        for a in 0..3 {
            let refine = (filled.ratio[a] / (2.0 * coarse)).round().clamp(1.0, MAX_REFINE);
            if refine > 1.0 {
                (step[a], offset[a]) = (1.0 / refine, 0.5 / refine - 0.5);
            } else {
                step[a] = (coarse / filled.ratio[a]).floor().max(1.0);
            }
        }
        let size: [usize; 3] =
            std::array::from_fn(|a| ((dims[a] as f64 - 0.5 - offset[a]) / step[a]).ceil() as usize);
        let mut lattice = Self {
            nodes: MaskBits::empty(size),
            offset,
            step,
            unit_from_node: filled.unit_from_voxel * DMat3::from_diagonal(step),
            origin: filled.unit(offset),
            rank: Vec::new(),
        };
        let per_axis: [Vec<usize>; 3] =
            std::array::from_fn(|a| (0..size[a]).map(|n| lattice.voxel(n, a).min(dims[a] - 1)).collect());
        for k in 0..size[2] {
            for j in 0..size[1] {
                for i in 0..size[0] {
                    if filled.bits.get([per_axis[0][i], per_axis[1][j], per_axis[2][k]]) {
                        lattice.nodes.set([i, j, k]);
                    }
                }
            }
        }
        let mut before = 0;
        lattice.rank = (lattice.nodes.words().iter())
            .map(|w| {
                before += w.count_ones();
                before - w.count_ones()
            })
            .collect();
        lattice
    }

    /// Voxel that contains lattice point `n` along an axis.
    pub fn voxel(&self, n: usize, axis: usize) -> usize {
        (self.offset[axis] + n as f64 * self.step[axis] + 0.5).floor() as usize
    }

    /// Converts a fractional lattice position to units.
    pub fn unit(&self, node: DVec3) -> DVec3 {
        self.origin + self.unit_from_node * node
    }

    /// Index of an inside point among all inside points; the next along x, if inside, has the next index.
    pub fn rank(&self, [i, j, k]: [usize; 3]) -> usize {
        let word = (k * self.nodes.dims()[1] + j) * self.nodes.words_per_line() + i / 64;
        let below = self.nodes.words()[word] & ((1 << (i % 64)) - 1);
        (self.rank[word] + below.count_ones()) as usize
    }

    /// Cells whose eight corners are all inside, at the position of their lowest corner.
    pub fn cells(&self) -> MaskBits {
        let [_, ny, nz] = self.nodes.dims();
        let per_line = self.nodes.words_per_line();
        let words = self.nodes.words();
        let mut cells = MaskBits::empty(self.nodes.dims());
        let out = cells.words_mut();
        for k in 0..nz.saturating_sub(1) {
            for j in 0..ny.saturating_sub(1) {
                let line = (k * ny + j) * per_line;
                let lines = [line, line + per_line, line + ny * per_line, line + (ny + 1) * per_line];
                let all = |w: usize| lines.iter().fold(u64::MAX, |a, l| a & words[l + w]);
                for w in 0..per_line {
                    let after = if w + 1 < per_line { all(w + 1) << 63 } else { 0 };
                    out[line + w] = all(w) & (all(w) >> 1 | after);
                }
            }
        }
        cells
    }

    /// The scaled force at every inside point, by rank, computed with the tree.
    pub fn forces(
        &self,
        charges: &Charges,
        law: PowerLaw,
        opening: f64,
        progress: &Progress,
    ) -> Result<Vec<DVec3>, Cancelled> {
        let [_, ny, nz] = self.nodes.dims();
        let per_slice = ny * self.nodes.words_per_line();
        let total = self.nodes.count();
        let slabs = nz.div_ceil(EDGE);
        let first =
            |slab: usize| self.rank.get(slab * EDGE * per_slice).map_or(total as usize, |&r| r as usize);
        let mut forces = vec![DVec3::ZERO; total as usize];
        let mut rest = forces.as_mut_slice();
        let mut parts = Vec::with_capacity(slabs);
        for slab in 0..slabs {
            let (part, more) = rest.split_at_mut(first(slab + 1) - first(slab));
            parts.push((slab, first(slab), part));
            rest = more;
        }
        progress.expect(total);
        parts.into_par_iter().try_for_each_init(Default::default, |scratch, (slab, first, out)| {
            self.slab(charges, law, opening, slab, |rank, force| out[rank - first] = force, scratch, progress)
        })?;
        Ok(forces)
    }

    fn slab(
        &self,
        charges: &Charges,
        law: PowerLaw,
        opening: f64,
        slab: usize,
        mut set: impl FnMut(usize, DVec3),
        (block, list, ranks): &mut (Block, super::force::ChargeList, Vec<usize>),
        progress: &Progress,
    ) -> Result<(), Cancelled> {
        let [nx, ny, nz] = self.nodes.dims();
        for by in (0..ny).step_by(EDGE) {
            for bx in (0..nx).step_by(EDGE) {
                block.clear();
                ranks.clear();
                let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
                for k in slab * EDGE..nz.min((slab + 1) * EDGE) {
                    for j in by..ny.min(by + EDGE) {
                        for i in bx..nx.min(bx + EDGE) {
                            if self.nodes.get([i, j, k]) {
                                let at = self.unit(DVec3::new(i as f64, j as f64, k as f64));
                                (lo, hi) = (lo.min(at), hi.max(at));
                                block.push(at);
                                ranks.push(self.rank([i, j, k]));
                            }
                        }
                    }
                }
                if ranks.is_empty() {
                    continue;
                }
                charges.gather((lo + hi) * 0.5, hi.distance(lo) * 0.5, opening, list);
                law.scaled_forces(list, block, |i, force| set(ranks[i], force));
                progress.advance(ranks.len() as u64)?;
            }
        }
        Ok(())
    }
}
