//! Which voxels are shown, one bit each: what rays of ambient occlusion and smoothed normals read. Packed on the CPU once
//! per volume and selection (an eighth of a byte per voxel).

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

fn words_per_line(dims: [usize; 3]) -> usize {
    (dims[0] + 2 * MARGIN).div_ceil(32)
}

/// With one more, as lib/shown reads two words for bits that may lie in one.
fn word_count(dims: [usize; 3]) -> usize {
    words_per_line(dims) * (dims[1] + 2 * MARGIN) * (dims[2] + 2 * MARGIN) + 1
}

fn packed(volume: &RegionVolume, selection: &Selection) -> Vec<u32> {
    let grid = volume.grid();
    let dims = grid.dims();
    let is_shown: Vec<bool> = volume.bits_of_id().iter().map(|&bits| selection.shows(bits)).collect();
    let line_words = words_per_line(dims);
    let layer_words = line_words * (dims[1] + 2 * MARGIN);
    let mut words = vec![0u32; word_count(dims)];
    words.par_chunks_mut(layer_words).skip(MARGIN).take(dims[2]).enumerate().for_each(|(z, layer)| {
        for (y, line) in layer.chunks_mut(line_words).skip(MARGIN).take(dims[1]).enumerate() {
            let first = grid.linear([0, y, z]);
            for x in 0..dims[0] {
                let id = volume.id(first + x) as usize;
                if id != 0 && is_shown.get(id).copied().unwrap_or(false) {
                    let bit = x + MARGIN;
                    if let Some(word) = line.get_mut(bit / 32) {
                        *word |= 1 << (bit % 32);
                    }
                }
            }
        }
    });
    words
}
