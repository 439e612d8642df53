//! The region volume divided into bricks of 8x8x8 voxels, as the shaders read it.

use glioscope_core::{IndexData, RegionVolume};
use rayon::prelude::*;

/// Voxels along a brick's side.
pub(crate) const SIDE: usize = 8;
/// Flag of a brick with a single region number (which may be 0).
pub(crate) const UNIFORM: u32 = 0x8000_0000;

/// See lib/march.wgsl.
pub(crate) struct Bricks {
    /// Bricks along each axis.
    pub dims: [usize; 3],
    /// Bit set of region numbers modulo 32; start of the brick's numbers in `words`, or [`UNIFORM`] with the number.
    pub table: Vec<[u32; 2]>,
    /// Region numbers of the bricks that aren't uniform, packed; never empty.
    pub words: Vec<u32>,
    /// 2, 1 or 0: four, two or one number per word.
    pub log2_ids_per_word: u32,
}

impl Bricks {
    /// Divides `volume` into bricks. Beyond the volume's end a brick holds zeros.
    pub fn of(volume: &RegionVolume) -> Self {
        let voxels = volume.grid().dims();
        let dims = voxels.map(|d| d.div_ceil(SIDE));
        let log2_ids_per_word = match volume.ids() {
            IndexData::U8(_) => 2,
            IndexData::U16(_) => 1,
            IndexData::U32(_) => 0,
        };
        let words_per_brick = (SIDE * SIDE * SIDE) >> log2_ids_per_word;
        let layers: Vec<(Vec<[u32; 2]>, Vec<u32>)> = (0..dims[2])
            .into_par_iter()
            .map(|bz| {
                let mut table = Vec::with_capacity(dims[0] * dims[1]);
                let mut words = Vec::new();
                let mut numbers = [0u32; SIDE * SIDE * SIDE];
                for by in 0..dims[1] {
                    for bx in 0..dims[0] {
                        fill(volume, [bx, by, bz], &mut numbers);
                        let set =
                            numbers.iter().filter(|&&n| n != 0).fold(0u32, |set, &n| set | 1 << (n & 31));
                        if numbers.iter().all(|&n| n == numbers[0]) {
                            table.push([set, UNIFORM | numbers[0]]);
                        } else {
                            table.push([set, words.len() as u32]);
                            pack(&numbers, log2_ids_per_word, &mut words);
                        }
                    }
                }
                (table, words)
            })
            .collect();
        let mut table = Vec::with_capacity(dims.iter().product());
        let mut words =
            Vec::with_capacity(layers.iter().map(|l| l.1.len()).sum::<usize>().max(words_per_brick));
        for (layer, layer_words) in layers {
            let base = words.len() as u32;
            table.extend(
                layer.into_iter().map(|[set, at]| [set, if at & UNIFORM != 0 { at } else { base + at }]),
            );
            words.extend(layer_words);
        }
        if words.is_empty() {
            words.resize(words_per_brick, 0);
        }
        Self { dims, table, words, log2_ids_per_word }
    }
}

fn fill(volume: &RegionVolume, brick: [usize; 3], numbers: &mut [u32; SIDE * SIDE * SIDE]) {
    let grid = volume.grid();
    let dims = grid.dims();
    numbers.fill(0);
    let first = brick.map(|b| b * SIDE);
    let count: [usize; 3] = std::array::from_fn(|a| SIDE.min(dims[a] - first[a]));
    for z in 0..count[2] {
        for y in 0..count[1] {
            let line = grid.linear([first[0], first[1] + y, first[2] + z]);
            for x in 0..count[0] {
                numbers[(z * SIDE + y) * SIDE + x] = volume.id(line + x);
            }
        }
    }
}

fn pack(numbers: &[u32], log2_ids_per_word: u32, words: &mut Vec<u32>) {
    let bits = 32 >> log2_ids_per_word;
    words.extend(numbers.chunks_exact(1 << log2_ids_per_word).map(|chunk| {
        chunk.iter().zip(0u32..).fold(0, |word, (&n, i)| word | n.checked_shl(i * bits).unwrap_or(0))
    }));
}
