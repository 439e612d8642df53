//! The points that stand for a mask's surface: border voxels or border corners.

use crate::{MaskBits, surface::surface_of};

/// What the surface of a mask is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Surface {
    /// Centres of active voxels with an inactive neighbour across a face (beyond the image counts as inactive), all of
    /// one weight.
    Voxels,
    /// Corners of voxels where not all of the eight around are alike, each with the area of the surface (marching cubes)
    /// between them.
    Corners,
}

/// Points on a lattice of the mask's spacing.
pub(super) struct Points {
    /// The lattice's points; of corners one more along each axis than voxels, corner `ijk` below voxel `ijk`.
    pub(super) bits: MaskBits,
    /// Area in mm² of each point, in memory order; empty where all count the same.
    pub(super) areas_mm2: Vec<f64>,
}

impl Points {
    /// The surface of `mask`. `areas_mm2` are those of [`super::surfels::areas_mm2`].
    pub(super) fn of(mask: &MaskBits, surface: Surface, areas_mm2: &[f64; 256]) -> Self {
        match surface {
            Surface::Voxels => Self { bits: surface_of(mask), areas_mm2: Vec::new() },
            Surface::Corners => corners(mask, areas_mm2),
        }
    }
}

/// Corners with active and inactive voxels around, 64 at once.
fn corners(mask: &MaskBits, areas_mm2: &[f64; 256]) -> Points {
    let [nx, ny, nz] = mask.dims();
    let mut bits = MaskBits::empty([nx + 1, ny + 1, nz + 1]);
    let mut areas = Vec::new();
    let (per_line, out_per_line) = (mask.words_per_line(), bits.words_per_line());
    let words = mask.words();
    let lines = bits.words_mut().chunks_exact_mut(out_per_line);
    for (line, out) in lines.enumerate() {
        let [cy, cz] = [line % (ny + 1), line / (ny + 1)];
        // The four lines of voxels that meet in this line of corners; beyond the mask all is inactive.
        let around = [[0, 0], [0, 1], [1, 0], [1, 1]].map(|[dy, dz]| {
            let (y, z) = ((cy + dy).checked_sub(1)?, (cz + dz).checked_sub(1)?);
            (y < ny && z < nz).then(|| (z * ny + y) * per_line).and_then(|at| words.get(at..at + per_line))
        });
        for (w, out) in out.iter_mut().enumerate() {
            let mut eight = [0_u64; 8];
            for (place, voxels) in around.iter().enumerate() {
                let word = |w: usize| voxels.and_then(|v| v.get(w)).copied().unwrap_or(0);
                eight[place + 4] = word(w);
                eight[place] = word(w) << 1 | w.checked_sub(1).map_or(0, |before| word(before) >> 63);
            }
            let any = eight.iter().fold(0, |any, word| any | word);
            let all = eight.iter().fold(u64::MAX, |all, word| all & word);
            *out = any & !all;
            let mut rest = *out;
            while rest != 0 {
                let at = rest.trailing_zeros();
                let code = (0..8).fold(0, |code, place| code | (eight[place] >> at & 1) << place);
                areas.push(areas_mm2[code as usize]);
                rest &= rest - 1;
            }
        }
    }
    Points { bits, areas_mm2: areas }
}
