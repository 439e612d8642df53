//! Which voxels are shown, one bit each: what rays of ambient occlusion and smoothed normals read. Packed on the CPU once
//! per volume and selection (a quarter of a byte per voxel, as each is in two words).

use std::sync::Arc;

use glioscope_core::{RegionVolume, Selection};
use rayon::prelude::*;

use crate::{
    device::{Gpu, RenderError},
    scene::same,
};

/// Empty voxels around the volume on every side.
const MARGIN: usize = 3;

/// The bits of a volume and a selection on the device, as lib/shown reads them.
pub(crate) struct ShownVoxels {
    volume: Option<Arc<RegionVolume>>,
    selection: Selection,
    pub bits: wgpu::Buffer,
}

impl ShownVoxels {
    /// The bits of `tumor` and `selection`: the held ones if they are their own, else new ones.
    ///
    /// # Errors
    /// [`RenderError::Buffer`] past the device's limits; nothing is held then.
    pub fn reuse<'a>(
        held: &'a mut Option<Self>,
        gpu: &Gpu,
        tumor: Option<&Arc<RegionVolume>>,
        selection: &Selection,
    ) -> Result<&'a Self, RenderError> {
        let is_its_own = |h: &Self| same(h.volume.as_ref(), tumor) && h.selection == *selection;
        let shown = match held.take().filter(is_its_own) {
            Some(shown) => shown,
            None => {
                let bytes = 4 * tumor.map_or(1, |t| word_count(t.grid().dims())) as u64;
                gpu.check_size("the shown voxels", bytes)?;
                let words = tumor.map_or(vec![0], |t| packed(t, selection));
                let bits = gpu.storage("ShownVoxels::bits", bytemuck::cast_slice(&words));
                gpu.check()?;
                Self { volume: tumor.cloned(), selection: selection.clone(), bits }
            }
        };
        Ok(held.insert(shown))
    }
}

/// Words along each axis: of 8x4 voxels of a layer each, every four voxels along x.
fn word_counts(dims: [usize; 3]) -> [usize; 3] {
    let [x, y, z] = dims.map(|n| n + 2 * MARGIN);
    [x.div_ceil(4), y.div_ceil(4), z]
}

fn word_count(dims: [usize; 3]) -> usize {
    word_counts(dims).iter().product()
}

fn packed(volume: &RegionVolume, selection: &Selection) -> Vec<u32> {
    let grid = volume.grid();
    let dims = grid.dims();
    let is_shown: Vec<bool> = volume.bits_of_id().iter().map(|&bits| selection.shows(bits)).collect();
    let [across, down, _] = word_counts(dims);
    let mut words = vec![0u32; word_count(dims)];
    words.par_chunks_mut(across * down).skip(MARGIN).take(dims[2]).enumerate().for_each(|(z, layer)| {
        for y in 0..dims[1] {
            let first = grid.linear([0, y, z]);
            let row = y + MARGIN;
            for x in 0..dims[0] {
                let id = volume.id(first + x) as usize;
                if id != 0 && is_shown.get(id).copied().unwrap_or(false) {
                    let column = x + MARGIN;
                    let at = (row / 4) * across + column / 4;
                    let bit = 8 * (row % 4) + column % 4;
                    if let Some(word) = layer.get_mut(at) {
                        *word |= 1 << bit;
                    }
                    // The word before holds it, too; the margin has none.
                    if let Some(word) = (column / 4).checked_sub(1).and_then(|_| layer.get_mut(at - 1)) {
                        *word |= 16 << bit;
                    }
                }
            }
        }
    });
    words
}
