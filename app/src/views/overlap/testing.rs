//! Regions of given sizes, for tests.

use glam::DVec3;
use glioscope_core::{Grid, Mask, MaskBits, Regions, TumorIndex};

/// Regions of the masks `ids` with these (bits, voxel count), in voxels of 1 mm³.
pub fn regions(ids: &[&str], sizes: &[(u32, usize)]) -> Regions {
    Regions::of(&index(ids, sizes))
}

/// The tumour index of [`regions`].
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
