//! A region volume on the device, as lib/march reads it: divided into bricks once per input, reused while it is drawn.

use std::sync::Arc;

use glioscope_core::RegionVolume;

use super::{
    bricks::{Bricks, SIDE},
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
    /// The buffers of `tumor`: the held ones if they are its own, else new ones.
    ///
    /// # Errors
    /// [`RenderError::Volume`] past the device's limits; [`RenderError::Device`] with the driver's
    /// message. Nothing is held then.
    pub fn reuse<'a>(
        held: &'a mut Option<Self>,
        gpu: &Gpu,
        tumor: Option<&Arc<RegionVolume>>,
    ) -> Result<&'a Self, RenderError> {
        let is_its_own = |buffers: &Self| same(buffers.volume.as_ref(), tumor);
        // The previous volume may be large: freed before the next is uploaded.
        let buffers = match held.take().filter(is_its_own) {
            Some(buffers) => buffers,
            None => Self::upload(gpu, tumor)?,
        };
        Ok(held.insert(buffers))
    }

    fn upload(gpu: &Gpu, tumor: Option<&Arc<RegionVolume>>) -> Result<Self, RenderError> {
        let limit = gpu.storage_limit();
        let (dims, bricks, region_count) = match tumor {
            None => {
                let none = Bricks { dims: [0; 3], table: vec![[0; 2]], words: vec![0], log2_ids_per_word: 2 };
                ([0; 3], none, 1)
            }
            Some(volume) => {
                let dims = volume.grid().dims();
                // Checked before anything is allocated.
                let brick_count: usize = dims.iter().map(|d| d.div_ceil(SIDE)).product();
                let most = byte_len(2).saturating_mul(brick_count as u64);
                if most > limit {
                    return Err(RenderError::Volume { found: most, limit });
                }
                (dims, Bricks::of(volume), volume.bits_of_id().len())
            }
        };
        let needed = byte_len(bricks.words.len()).max(byte_len(region_count));
        if needed > limit {
            return Err(RenderError::Volume { found: needed, limit });
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffers = Self {
            volume: tumor.cloned(),
            dims: dims.map(|d| d as u32),
            brick_dims: bricks.dims.map(|d| d as u32),
            log2_ids_per_word: bricks.log2_ids_per_word,
            table: gpu.storage("RegionBuffers::table", bytemuck::cast_slice(&bricks.table)),
            words: gpu.storage("RegionBuffers::words", bytemuck::cast_slice(&bricks.words)),
            regions: gpu.buffer("RegionBuffers::regions", byte_len(region_count), usage),
        };
        gpu.check()?;
        Ok(buffers)
    }

    /// Writes the volume's shape into `view`, and the visibility and colours of its regions to the device.
    pub fn show(&self, gpu: &Gpu, scene: &RegionScene, view: &mut View) {
        view.dims = self.dims;
        view.bricks = self.brick_dims;
        view.log2_ids_per_word = self.log2_ids_per_word;
        let regions = region_table(scene, view);
        gpu.queue.write_buffer(&self.regions, 0, bytemuck::cast_slice(&regions));
    }
}

/// Colour and visibility of every region number; sets the bits of the shown ones in `view`.
fn region_table(scene: &RegionScene, view: &mut View) -> Vec<u32> {
    const SHOWN: u32 = 0x8000_0000;
    let Some(tumor) = &scene.tumor else { return vec![0] };
    // Number 0 is empty; numbers 1 to 32 have a bit each.
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
