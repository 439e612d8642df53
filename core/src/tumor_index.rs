//! The tumour index: one bit set per voxel; bit k is set where mask k is active (thesis 7.3).

use rayon::prelude::*;

use crate::{grid::Grid, mask::Mask};

/// Maximum number of masks in one index.
pub const MAX_MASKS: usize = 32;

/// Bit sets, in the smallest type that fits the number of masks, x fastest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IndexData {
    /// Up to 8 masks.
    U8(Vec<u8>),
    /// Up to 16 masks.
    U16(Vec<u16>),
    /// Up to 32 masks.
    U32(Vec<u32>),
}

/// Why an index can't be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum IndexError {
    /// More masks than bits.
    #[error("found {0} masks at one time point, expected at most {MAX_MASKS}")]
    TooManyMasks(usize),
    /// A mask is on another grid: resample it first.
    #[error("mask {0} is not on the case grid")]
    OtherGrid(String),
}

/// Which masks are active at each voxel of one grid.
#[derive(Clone, Debug, PartialEq)]
pub struct TumorIndex {
    grid: Grid,
    mask_ids: Vec<String>,
    data: IndexData,
}

fn fill<T: Copy + Default + Send + std::ops::BitOrAssign>(
    grid: &Grid,
    masks: &[&Mask],
    bit: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    let dims = grid.dims();
    let slice = dims[0] * dims[1];
    let mut data = vec![T::default(); grid.voxel_count()];
    data.par_chunks_mut(slice).enumerate().for_each(|(z, out)| {
        for (k, mask) in masks.iter().enumerate() {
            let bits = mask.bits();
            let per_line = bits.words_per_line();
            let lines = &bits.words()[z * dims[1] * per_line..][..dims[1] * per_line];
            for (y, words) in lines.chunks_exact(per_line).enumerate() {
                for (w, &word) in words.iter().enumerate() {
                    let mut rest = word;
                    while rest != 0 {
                        out[y * dims[0] + w * 64 + rest.trailing_zeros() as usize] |= bit(k);
                        rest &= rest - 1;
                    }
                }
            }
        }
    });
    data
}

impl TumorIndex {
    /// Bit k of each voxel is `masks[k]`. Without masks, all voxels are 0.
    ///
    /// # Errors
    /// [`IndexError`] past [`MAX_MASKS`] masks, or when one is on another grid than `grid`.
    pub fn new(grid: Grid, masks: &[&Mask]) -> Result<Self, IndexError> {
        if masks.len() > MAX_MASKS {
            return Err(IndexError::TooManyMasks(masks.len()));
        }
        if let Some(other) = masks.iter().find(|m| !grid.same_place(m.grid(), 1e-3)) {
            return Err(IndexError::OtherGrid(other.id().to_owned()));
        }
        let data = match masks.len() {
            0..=8 => IndexData::U8(fill(&grid, masks, |k| 1 << k)),
            9..=16 => IndexData::U16(fill(&grid, masks, |k| 1 << k)),
            _ => IndexData::U32(fill(&grid, masks, |k| 1 << k)),
        };
        Ok(Self { grid, mask_ids: masks.iter().map(|m| m.id().to_owned()).collect(), data })
    }

    /// The same with other ids of its masks, in their order.
    pub(crate) fn with_mask_ids(&self, mask_ids: Vec<String>) -> Self {
        Self { mask_ids, ..self.clone() }
    }

    /// The grid it is on.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Ids of the masks; bit k is `mask_ids()[k]`.
    pub fn mask_ids(&self) -> &[String] {
        &self.mask_ids
    }

    /// The bit sets.
    pub fn data(&self) -> &IndexData {
        &self.data
    }

    /// Bit set of the voxel at `linear`.
    #[inline]
    pub fn get(&self, linear: usize) -> u32 {
        match &self.data {
            IndexData::U8(v) => u32::from(v[linear]),
            IndexData::U16(v) => u32::from(v[linear]),
            IndexData::U32(v) => v[linear],
        }
    }

    /// Bit set at a world point; 0 outside the grid.
    pub fn at_mm(&self, world_mm: glam::DVec3) -> u32 {
        self.grid.voxel_at(world_mm).map_or(0, |ijk| self.get(self.grid.linear(ijk)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MaskBits;
    use glam::DVec3;

    /// Voxels of 2 mm about 0, 2 and 4 mm: the second has bit 0, the third bit 1.
    #[test]
    fn a_place_has_the_bits_of_the_voxel_around_it() {
        let grid = Grid::axis_aligned([3, 1, 1], DVec3::splat(2.0), DVec3::ZERO).unwrap();
        let masks = [1, 2].map(|at| {
            Mask::new("m", grid.clone(), MaskBits::from_fn([3, 1, 1], |linear| linear == at)).unwrap()
        });
        let index = TumorIndex::new(grid, &masks.each_ref()).unwrap();
        let at = |x: f64, y: f64| index.at_mm(DVec3::new(x, y, 0.0));
        assert_eq!([at(0.9, 0.0), at(1.1, 0.0), at(2.9, 0.9), at(3.1, 0.0)], [0, 0b01, 0b01, 0b10]);
        assert_eq!([at(2.0, 1.1), at(5.1, 0.0), at(-1.1, 0.0)], [0; 3], "outside");
    }
}
