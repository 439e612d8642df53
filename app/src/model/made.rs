//! Masks that the user makes from those of the case. They are kept in the session, voxels and all, so that sources are
//! never changed and nothing lies beside a session that could be lost or exchanged.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::{
    Grid, Mask, MaskBits, Sides,
    case::{self, Case},
};
use serde::{Deserialize, Serialize};

/// The most masks that are made in one session.
pub const MOST_MADE: usize = 256;
/// The most voxels of all their grids together: a gigabyte of bits.
const MOST_VOXELS: u64 = 1 << 33;
/// The longest id, in characters.
pub const LONGEST_ID: usize = 64;

/// A mask made by the user.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MadeMask {
    /// Its name in the case.
    pub id: String,
    /// The label of the date that it belongs to.
    pub time: String,
    /// Ids of the masks that it was made of.
    pub parents: Vec<String>,
    /// How, in words: "where at least 2 of 3 masks agree".
    pub how: String,
    /// Who made it, as far as that was said.
    pub author: Option<String>,
    /// Its voxels, shared by undo's copies.
    voxels: Arc<Voxels>,
}

/// Voxels of a mask.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Voxels {
    dims: [usize; 3],
    /// Columns of the matrix, then the origin, millimetres.
    world_from_voxel: [[f64; 3]; 4],
    sides_known: bool,
    /// As [`MaskBits::runs`], separated by spaces: JSON's lists have a line for each number.
    runs: String,
}

impl MadeMask {
    /// A mask with the voxels of `bits` on `grid`; `None` where their dimensions differ.
    pub fn new(id: String, time: String, grid: &Grid, bits: &MaskBits) -> Option<Self> {
        let affine = grid.world_from_voxel();
        let m = affine.matrix3;
        let columns = [m.x_axis, m.y_axis, m.z_axis, affine.translation];
        let runs: Vec<String> = bits.runs().iter().map(u64::to_string).collect();
        let voxels = Voxels {
            dims: grid.dims(),
            world_from_voxel: columns.map(|column| column.to_array()),
            sides_known: grid.sides() == Sides::Known,
            runs: runs.join(" "),
        };
        let made = Self {
            id,
            time,
            parents: Vec::new(),
            how: String::new(),
            author: None,
            voxels: Arc::new(voxels),
        };
        (bits.dims() == grid.dims()).then_some(made)
    }

    /// What it was made of, how and by whom, in words.
    pub fn provenance(&self) -> String {
        let author = self.author.as_deref().map(|author| format!(" by {author}")).unwrap_or_default();
        format!("in this program of {}{author}: {}", self.parents.join(", "), self.how)
    }

    /// The mask; `None` where its voxels don't fit its grid.
    fn mask(&self) -> Option<Mask> {
        let Voxels { dims, world_from_voxel: [x, y, z, origin], sides_known, runs } = &*self.voxels;
        let runs: Vec<u64> = runs.split_ascii_whitespace().map(|n| n.parse().ok()).collect::<Option<_>>()?;
        let matrix = DMat3::from_cols(DVec3::from(*x), DVec3::from(*y), DVec3::from(*z));
        let affine = DAffine3::from_mat3_translation(matrix, DVec3::from(*origin));
        let sides = if *sides_known { Sides::Known } else { Sides::Unknown };
        let grid = Grid::new(*dims, affine, sides).ok()?;
        Mask::new(self.id.clone(), grid, MaskBits::of_runs(*dims, &runs)?)
    }

    /// Voxels of its grid.
    fn grid_voxels(&self) -> u64 {
        self.voxels.dims.iter().fold(1, |product, n| product.saturating_mul(*n as u64))
    }
}

/// Why masks of a session can't be used: what was found, and what was expected.
pub(super) fn fault(made: &[MadeMask]) -> Option<(String, String)> {
    if made.len() > MOST_MADE {
        return Some((format!("{} made masks", made.len()), format!("at most {MOST_MADE}")));
    }
    let voxels = made.iter().fold(0_u64, |sum, mask| sum.saturating_add(mask.grid_voxels()));
    if voxels > MOST_VOXELS {
        return Some((format!("made masks with {voxels} voxels"), format!("at most {MOST_VOXELS} together")));
    }
    let unfit = made.iter().find(|mask| mask.mask().is_none())?;
    Some((format!("made mask {:?} whose voxels don't fit its grid", unfit.id), "runs within the grid".into()))
}

/// `case` with the masks made from it.
pub fn with_made(case: &Case, made: &[MadeMask]) -> Case {
    let masks: Vec<case::MadeMask> = made
        .iter()
        .filter_map(|made| {
            let (time, provenance) = (made.time.clone(), made.provenance());
            Some(case::MadeMask { mask: made.mask()?, time, provenance })
        })
        .collect();
    case.with_made_masks(&masks)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(runs: &str, dims: [usize; 3]) -> MadeMask {
        let grid = Grid::axis_aligned([4, 2, 1], DVec3::new(1.0, 2.0, 3.0), DVec3::splat(-5.5)).unwrap();
        let bits = MaskBits::from_fn(grid.dims(), |at| at > 4);
        let made = MadeMask::new("m".into(), String::new(), &grid, &bits).unwrap();
        assert_eq!(made.mask().unwrap(), Mask::new("m", grid, bits).unwrap());
        let world_from_voxel = made.voxels.world_from_voxel;
        let voxels = Voxels { dims, world_from_voxel, sides_known: true, runs: runs.into() };
        MadeMask { voxels: Arc::new(voxels), ..made }
    }

    #[test]
    fn voxels_survive_json_and_wrong_ones_are_refused() {
        let good = made("5 3", [4, 2, 1]);
        let json = serde_json::to_string(&good).unwrap();
        let back: MadeMask = serde_json::from_str(&json).unwrap();
        assert_eq!(back, good);
        assert_eq!(back.mask().unwrap().voxels(), 3);
        assert_eq!(fault(&[good]), None);
        for (runs, dims) in [("5 4", [4, 2, 1]), ("5 x", [4, 2, 1]), ("5", [4, 2, 1]), ("0 1", [0, 2, 1])] {
            assert!(fault(&[made(runs, dims)]).unwrap().0.contains("don't fit"), "{runs}");
        }
        assert!(fault(&[made("", [1 << 20, 1 << 20, 1])]).unwrap().0.contains("voxels"));
        assert!(fault(&vec![made("", [4, 2, 1]); MOST_MADE + 1]).is_some());
    }
}
