//! A region volume on the device, as lib/march reads it: cut once per input, reused while it is drawn.

use std::sync::Arc;

use glioscope_core::RegionVolume;

use super::{
    bricks::{self, Bricks},
    view::{MANY_REGIONS, View},
};
use crate::{
    device::{Gpu, RenderError},
    scene::{RegionScene, same},
};

/// Bricks of a volume, and the colours of its regions.
pub(crate) struct RegionBuffers {
    volume: Option<Arc<RegionVolume>>,
    dims: [u32; 3],
    brick_dims: [u32; 3],
    log2_ids_per_word: u32,
    pub table: wgpu::Buffer,
    pub words: wgpu::Buffer,
    pub regions: wgpu::Buffer,
}

fn byte_len(words: usize) -> u64 {
    words as u64 * 4
}

impl RegionBuffers {
    /// The buffers of `tumor`: those held, when they are its own, else new ones.
    ///
    /// # Errors
    /// [`RenderError::Volume`] past the device's limits; [`RenderError::Device`] with what the driver
    /// says. Nothing is held then.
    pub fn reuse<'a>(
        held: &'a mut Option<Self>,
        gpu: &Gpu,
        tumor: Option<&Arc<RegionVolume>>,
    ) -> Result<&'a Self, RenderError> {
        let is_its_own = |up: &Self| same(up.volume.as_ref(), tumor);
        // The one before may be large: let it go first.
        let made = match held.take().filter(is_its_own) {
            Some(up) => up,
            None => Self::upload(gpu, tumor)?,
        };
        Ok(held.insert(made))
    }

    fn upload(gpu: &Gpu, tumor: Option<&Arc<RegionVolume>>) -> Result<Self, RenderError> {
        let limit = gpu.storage_limit();
        let (dims, cut, region_count) = match tumor {
            None => {
                let none = Bricks { dims: [0; 3], table: vec![[0; 2]], words: vec![0], log2_ids_per_word: 2 };
                ([0; 3], none, 1)
            }
            Some(volume) => {
                let dims = volume.grid().dims();
                // Counted before anything is allocated.
                let table: usize = dims.iter().map(|d| d.div_ceil(bricks::SIDE)).product();
                let most = byte_len(2).saturating_mul(table as u64);
                if most > limit {
                    return Err(RenderError::Volume { found: most, limit });
                }
                (dims, Bricks::of(volume), volume.bits_of_id().len())
            }
        };
        let needed = byte_len(cut.words.len()).max(byte_len(region_count));
        if needed > limit {
            return Err(RenderError::Volume { found: needed, limit });
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let made = Self {
            volume: tumor.cloned(),
            dims: dims.map(|d| d as u32),
            brick_dims: cut.dims.map(|d| d as u32),
            log2_ids_per_word: cut.log2_ids_per_word,
            table: gpu.storage("RegionBuffers::table", bytemuck::cast_slice(&cut.table)),
            words: gpu.storage("RegionBuffers::words", bytemuck::cast_slice(&cut.words)),
            regions: gpu.buffer("RegionBuffers::regions", byte_len(region_count), usage),
        };
        gpu.check()?;
        Ok(made)
    }

    /// Writes the volume's shape into `view`, and which regions are shown and in what colour.
    pub fn show(&self, gpu: &Gpu, scene: &RegionScene, view: &mut View) {
        view.dims = self.dims;
        view.bricks = self.brick_dims;
        view.log2_ids_per_word = self.log2_ids_per_word;
        let regions = region_table(scene, view);
        gpu.queue.write_buffer(&self.regions, 0, bytemuck::cast_slice(&regions));
    }
}

/// Colour and visibility of every region number; sets the bit set of the shown ones in `view`.
fn region_table(scene: &RegionScene, view: &mut View) -> Vec<u32> {
    const SHOWN: u32 = 0x8000_0000;
    let Some(tumor) = &scene.tumor else { return vec![0] };
    // Number 0 is empty; 1 to 32 have a bit of the set each.
    if tumor.bits_of_id().len() > 33 {
        view.flags |= MANY_REGIONS;
    }
    tumor
        .bits_of_id()
        .iter()
        .zip(0u32..)
        .map(|(&bits, number)| {
            if number == 0 {
                return 0;
            }
            let [r, g, b] = scene.colors.region(bits).map(u32::from);
            let rgb = r | g << 8 | b << 16;
            if scene.selection.shows(bits) {
                view.selected |= 1 << (number & 31);
                rgb | SHOWN
            } else {
                rgb
            }
        })
        .collect()
}
