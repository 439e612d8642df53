//! The transform of [`super::envelope`] where all squared distances are whole multiples of one unit
//! (equal spacings such as 1 mm, or 0.5 × 0.5 × 6 mm): nothing is rounded, so parabolas begin
//! at whole voxels and ties are exact.
//!
//! Columns are processed in tiles, so that strided reads and writes move whole cache lines.

use rayon::prelude::*;

use super::Crop;
use crate::MaskBits;

/// Columns of a tile: its rows are whole cache lines.
const TILE: usize = 16;

/// Squared spacings as whole multiples of one unit, if every sum of squares in the crop is then
/// exact in `f64` and every product of the envelope fits an `i32`. Weights must be normal numbers (not subnormal).
pub(super) fn whole_weights(crop: Crop, weights: [f64; 3]) -> Option<[i32; 3]> {
    // Exponent of the lowest bit set.
    let lowest = |w: f64| {
        let bits = w.to_bits();
        let mantissa = (bits & ((1 << 52) - 1)) | 1 << 52;
        (bits >> 52) as i32 + mantissa.trailing_zeros() as i32 - 1075
    };
    let unit = weights.iter().map(|&w| lowest(w)).min()?;
    let scale = 2.0_f64.powi(-unit);
    let (mut common, mut whole) = (0_u64, [0_u64; 3]);
    for (w, &weight) in whole.iter_mut().zip(&weights) {
        let scaled = weight * scale;
        if scaled >= (1_u64 << 53) as f64 {
            return None;
        }
        *w = scaled as u64;
        common = gcd(common, *w);
    }
    // Sums in `f64` need all bits of the weights, the envelope only their ratio.
    let sum = |w: [u64; 3]| (0..3).map(|a| u128::from(w[a]) * (crop.dims[a] as u128).pow(2)).sum::<u128>();
    if sum(whole) >= 1 << 53 {
        return None;
    }
    let whole = whole.map(|w| w / common);
    if 4 * sum(whole) >= 1 << 31 {
        return None;
    }
    Some(whole.map(|w| w as i32))
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// As [`super::envelope::nearest_sites`], with weights of [`whole_weights`].
pub(super) fn nearest_sites(sites: &MaskBits, crop: Crop, weights: [i32; 3]) -> Vec<u32> {
    let [nx, ny, nz] = crop.dims;
    // Nearest within the slice, as `x | y << 16`: whole_weights keeps axes shorter than 2^16.
    let mut by_slice = vec![0_u32; nx * ny * nz];
    let along_y = Axis::new(ny, weights[1]);
    let filled: Vec<bool> = by_slice
        .par_chunks_mut(nx * ny)
        .enumerate()
        .map_init(Tile::default, |tile, (z, slab)| {
            tile.rows.clear();
            tile.nearest_x.clear();
            for y in 0..ny {
                let start = [crop.start[0], crop.start[1] + y, crop.start[2] + z];
                if scan_row(sites, start, nx, &mut tile.nearest_x) {
                    tile.rows.push(y as i32);
                }
            }
            if tile.rows.is_empty() {
                return false;
            }
            for first in (0..nx).step_by(TILE) {
                let width = TILE.min(nx - first);
                tile.heights.clear();
                tile.sites.clear();
                for (row, &y) in tile.nearest_x.chunks_exact(nx).zip(&tile.rows) {
                    let (mut height, mut site) = ([0; TILE], [0; TILE]);
                    let raised = weights[1] * y * y;
                    for (c, &x) in row[first..first + width].iter().enumerate() {
                        let d = (first + c) as i32 - x as i32;
                        height[c] = weights[0] * d * d + raised;
                        site[c] = x | (y as u32) << 16;
                    }
                    tile.heights.push(height);
                    tile.sites.push(site);
                }
                tile.lower_envelopes(&along_y, width);
                tile.write(slab, nx, first, width);
            }
            true
        })
        .collect();
    let planes: Vec<i32> = (0..nz as i32).filter(|&z| filled[z as usize]).collect();
    let along_z = Axis::new(nz, weights[2]);
    let mut by_row = vec![0_u32; nx * ny * nz];
    by_row.par_chunks_mut(nx * nz).enumerate().for_each_init(
        || Tile { rows: planes.clone(), ..Tile::default() },
        |tile, (y, plane)| {
            for first in (0..nx).step_by(TILE) {
                let width = TILE.min(nx - first);
                tile.heights.clear();
                tile.sites.clear();
                for &z in &tile.rows {
                    let from = (z as usize * ny + y) * nx + first;
                    let (mut height, mut site) = ([0; TILE], [0; TILE]);
                    let raised = weights[2] * z * z;
                    let slice = (z as usize * ny * nx) as u32;
                    for (c, &packed) in by_slice[from..from + width].iter().enumerate() {
                        let (x, row) = (packed & 0xffff, packed >> 16);
                        let dx = (first + c) as i32 - x as i32;
                        let dy = y as i32 - row as i32;
                        height[c] = weights[0] * dx * dx + weights[1] * dy * dy + raised;
                        site[c] = slice + row * nx as u32 + x;
                    }
                    tile.heights.push(height);
                    tile.sites.push(site);
                }
                tile.lower_envelopes(&along_z, width);
                tile.write(plane, nx, first, width);
            }
        },
    );
    by_row
}

/// Appends the x of each voxel's nearest site in the row, the smaller one on ties. Appends nothing and
/// returns `false` when the row has no site.
pub(super) fn scan_row(sites: &MaskBits, start: [usize; 3], nx: usize, nearest: &mut Vec<u32>) -> bool {
    let per_line = sites.words_per_line();
    let line = (start[2] * sites.dims()[1] + start[1]) * per_line;
    let begin = nearest.len();
    let mut last = None;
    for (w, &word) in sites.words()[line..line + per_line].iter().enumerate() {
        let mut rest = word;
        while rest != 0 {
            let x = w * 64 + rest.trailing_zeros() as usize - start[0];
            rest &= rest - 1;
            // Up to the midpoint, inclusive, the site before is nearest.
            let past_midpoint = last.map_or(0, |before| (before + x) / 2 + 1);
            if let Some(before) = last {
                nearest.resize(begin + past_midpoint, before as u32);
            }
            nearest.resize(begin + x + 1, x as u32);
            last = Some(x);
        }
    }
    let Some(last) = last else { return false };
    nearest.resize(begin + nx, last as u32);
    true
}

/// A line's length and weight, and values derived from them once.
struct Axis {
    n: usize,
    twice_weight: i32,
    /// `1 / (twice_weight·d)` for each difference of rows `d`.
    inverse: Vec<f64>,
}

impl Axis {
    /// `⌊rise / (twice_weight·d)⌋ + 1`. The quotient is shifted off whole numbers by half a unit of
    /// its numerator, far more than the rounding error; adding 1.5·2⁵² rounds it to a whole number.
    #[inline]
    fn first_lower(&self, rise: i32, d: i32) -> i32 {
        const ROUND: f64 = 1.5 * (1_u64 << 52) as f64;
        let above = (f64::from(rise) + 0.5) * self.inverse[d as usize] + 0.5;
        (above + ROUND).to_bits() as i32
    }

    fn new(n: usize, weight: i32) -> Self {
        let inverse = (0..=n).map(|d| 1.0 / (2.0 * f64::from(weight) * d as f64)).collect();
        Self { n, twice_weight: 2 * weight, inverse }
    }
}

/// A parabola on the envelope.
#[derive(Clone, Copy, Default)]
struct Arc {
    row: i32,
    /// First voxel at which it is lower than all before it.
    begin: i32,
    height: i32,
    /// Position in the tile's rows.
    index: u32,
}

#[derive(Default)]
struct Tile {
    nearest_x: Vec<u32>,
    /// Rows that have parabolas, ascending.
    rows: Vec<i32>,
    /// By row: height of each column's parabola at voxel 0, and its site.
    heights: Vec<[i32; TILE]>,
    sites: Vec<[u32; TILE]>,
    arcs: Vec<Arc>,
    /// By voxel: the site whose parabola begins to be lowest here, else 0.
    begins: Vec<[u32; TILE]>,
}

impl Tile {
    /// Fills `begins` with the lower envelopes of the first `width` columns.
    fn lower_envelopes(&mut self, axis: &Axis, width: usize) {
        let Self { rows, heights, sites, arcs, begins, .. } = self;
        begins.resize(axis.n, [0; TILE]);
        arcs.resize(rows.len() + 1, Arc::default());
        for c in 0..width.min(TILE) {
            // A sentinel far below all parabolas: never popped.
            let mut top = Arc { row: -1, begin: 0, height: -(1 << 30), index: 0 };
            let mut depth = 0;
            for (index, (&row, heights)) in rows.iter().zip(heights.iter()).enumerate() {
                let height = heights[c];
                let mut d = row - top.row;
                let mut rise = height - top.height;
                // At voxel p the new one is lower where rise < 2·weight·d·p.
                while rise < axis.twice_weight * d * top.begin {
                    depth -= 1;
                    top = arcs[depth];
                    d = row - top.row;
                    rise = height - top.height;
                }
                let begin = if depth == 0 { 0 } else { axis.first_lower(rise, d) };
                if begin < axis.n as i32 {
                    arcs[depth] = top;
                    depth += 1;
                    top = Arc { row, begin, height, index: index as u32 };
                }
            }
            begins[top.begin as usize][c] = sites[top.index as usize][c];
            for arc in &arcs[1..depth] {
                begins[arc.begin as usize][c] = sites[arc.index as usize][c];
            }
        }
    }

    /// Writes the sites to `plane`. They ascend with their parabolas' rows: the current one is the
    /// largest so far.
    fn write(&mut self, plane: &mut [u32], nx: usize, first: usize, width: usize) {
        let mut site = [0; TILE];
        for (row, begins) in plane.chunks_exact_mut(nx).zip(&mut self.begins) {
            for (site, begin) in site.iter_mut().zip(begins.iter_mut()) {
                *site = (*site).max(*begin);
                *begin = 0;
            }
            row[first..first + width].copy_from_slice(&site[..width]);
        }
    }
}
