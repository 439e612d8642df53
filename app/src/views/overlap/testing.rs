//! Regions of wanted sizes, for tests.

use glam::DVec3;
use glioscope_core::{Grid, Mask, MaskBits, Regions, TumorIndex};

/// Regions with these bits and voxel counts, on voxels of 1 mm³ and over the masks `ids`.
pub fn regions(ids: &[&str], sizes: &[(u32, usize)]) -> Regions {
    Regions::of(&index(ids, sizes))
}

/// The index that [`regions`] is of.
pub fn index(ids: &[&str], sizes: &[(u32, usize)]) -> TumorIndex {
    let bits: Vec<u32> = sizes.iter().flat_map(|&(bits, n)| std::iter::repeat_n(bits, n)).collect();
    let dims = [bits.len().max(1), 1, 1];
    let grid = Grid::axis_aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap();
    let masks: Vec<Mask> = ids
        .iter()
        .enumerate()
        .map(|(k, id)| {
            let active = MaskBits::from_fn(dims, |i| bits.get(i).is_some_and(|b| b >> k & 1 == 1));
            Mask::new(*id, grid.clone(), active).unwrap()
        })
        .collect();
    TumorIndex::new(grid, &masks.iter().collect::<Vec<_>>()).unwrap()
}
