//! Masks and images brought onto another grid: masks to the nearest voxel, images trilinearly.
//!
//! Both go through the affines in `f64` index space, differences of the grids' places first, so
//! oblique, sheared and mirrored grids and offsets of a kilometre are right. Only the target's
//! voxels that can meet the source are visited.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::{Cancelled, Grid, Mask, MaskBits, Progress, Volume, with_samples};

/// Grids whose corners are this close, in voxels, are one grid: nothing is resampled.
pub const SAME_PLACE_VOXELS: f64 = 1e-3;

/// Positions this close to the border of two voxels count as on it, so that rounding in the
/// affines can't decide a tie.
const TIE_VOXELS: f64 = 1e-6;

/// Maps voxel indices of `target` to voxel indices of `source`, both with centres at whole
/// numbers. The translations are subtracted before anything is multiplied: an offset that both
/// share cancels.
pub fn source_from_target(source: &Grid, target: &Grid) -> DAffine3 {
    let inverse = source.voxel_from_world().matrix3;
    let (from, to) = (source.world_from_voxel(), target.world_from_voxel());
    DAffine3 { matrix3: inverse * to.matrix3, translation: inverse * (to.translation - from.translation) }
}

/// First voxel and size of the box of `target` voxels whose centres can lie in the box of `source`
/// cells from `start`, `dims` long; `None` when there are none.
fn target_box(
    source: &Grid,
    target: &Grid,
    start: [usize; 3],
    dims: [usize; 3],
) -> Option<([usize; 3], [usize; 3])> {
    let target_from_source = source_from_target(target, source);
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in 0..8 {
        let side = |a: usize| start[a] as f64 - 0.5 + if corner >> a & 1 == 1 { dims[a] as f64 } else { 0.0 };
        let p = target_from_source.transform_point3(DVec3::new(side(0), side(1), side(2)));
        (lo, hi) = (lo.min(p), hi.max(p));
    }
    let mut found = ([0; 3], [0; 3]);
    for axis in 0..3 {
        // Rounded outward by more than any rounding error.
        let first = (lo[axis] - 1e-3).ceil().max(0.0);
        let last = (hi[axis] + 1e-3).floor().min(target.dims()[axis] as f64 - 1.0);
        if first > last {
            return None;
        }
        found.0[axis] = first as usize;
        found.1[axis] = (last - first) as usize + 1;
    }
    Some(found)
}

/// The cell along one axis that holds position `v`, below `n`. A centre lies at a whole number; a
/// position on the border of two cells belongs to the higher one; -1/2 is inside, n - 1/2 outside.
#[inline]
fn cell(v: f64, n: usize) -> Option<usize> {
    let c = (v + (0.5 + TIE_VOXELS)).floor();
    (c >= 0.0 && c < n as f64).then_some(c as usize)
}

/// `mask` on `target`: a voxel is active when its centre lies in an active cell of the mask.
/// Outside the mask's grid it is inactive. A centre on the border of two cells (within 1e-6 voxel)
/// belongs to the cell with the higher index. A mask that is already there
/// ([`Grid::same_place`], within [`SAME_PLACE_VOXELS`]) keeps its bits.
///
/// # Errors
/// [`Cancelled`].
pub fn mask_onto(mask: &Mask, target: &Grid, progress: &Progress) -> Result<MaskBits, Cancelled> {
    if target.same_place(mask.grid(), SAME_PLACE_VOXELS) {
        return Ok(mask.bits().clone());
    }
    let mut out = MaskBits::empty(target.dims());
    let Some((start, dims)) = mask.bits().bounds() else { return Ok(out) };
    let Some((first, size)) = target_box(mask.grid(), target, start, dims) else { return Ok(out) };
    let map = source_from_target(mask.grid(), target);
    let source = mask.bits();
    let [sx, sy, sz] = source.dims();
    let (per_line, ny) = (out.words_per_line(), target.dims()[1]);
    let slices = out.words_mut().par_chunks_mut(per_line * ny).enumerate();
    slices.skip(first[2]).take(size[2]).try_for_each(|(z, words)| {
        progress.check()?;
        for y in first[1]..first[1] + size[1] {
            let line_start = map.transform_point3(DVec3::new(0.0, y as f64, z as f64));
            let line = &mut words[y * per_line..][..per_line];
            for x in first[0]..first[0] + size[0] {
                let p = line_start + map.matrix3.x_axis * x as f64;
                let hit = match (cell(p.x, sx), cell(p.y, sy), cell(p.z, sz)) {
                    (Some(i), Some(j), Some(k)) => source.get([i, j, k]),
                    _ => false,
                };
                line[x / 64] |= u64::from(hit) << (x % 64);
            }
        }
        Ok(())
    })?;
    Ok(out)
}

/// Active voxels of `mask` whose centres lie outside every one of `grids`.
pub fn voxels_outside(mask: &Mask, grids: &[&Grid]) -> u64 {
    let Some((start, dims)) = mask.bits().bounds() else { return 0 };
    let maps: Vec<(DAffine3, [usize; 3])> =
        grids.iter().map(|g| (source_from_target(g, mask.grid()), g.dims())).collect();
    let inside = |(map, n): &(DAffine3, [usize; 3]), ijk: [usize; 3]| {
        let p = map.transform_point3(DVec3::new(ijk[0] as f64, ijk[1] as f64, ijk[2] as f64));
        (0..3).all(|a| cell(p[a], n[a]).is_some())
    };
    // A grid is convex: a box with its corners inside is inside.
    let corner = |c: usize| std::array::from_fn(|a| start[a] + if c >> a & 1 == 1 { dims[a] - 1 } else { 0 });
    if maps.iter().any(|map| (0..8).all(|c| inside(map, corner(c)))) {
        return 0;
    }
    let [nx, ny, _] = mask.bits().dims();
    let mut outside = 0;
    mask.bits().for_each(|linear| {
        let ijk = [linear % nx, linear / nx % ny, linear / nx / ny];
        outside += u64::from(!maps.iter().any(|map| inside(map, ijk)));
    });
    outside
}

/// An image on another grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampled {
    /// Values, `x` fastest; 0 where the image says nothing: see `inside`.
    pub values: Vec<f32>,
    /// The voxels whose centres lie in a cell of the image.
    pub inside: MaskBits,
}

/// Trilinear weights at one position: the lower cell's linear index, the steps to the upper
/// neighbours (0 at an edge, where the value stays the edge's), and the fractions.
#[inline]
fn corner(p: DVec3, dims: [usize; 3]) -> Option<(usize, [usize; 3], [f64; 3])> {
    let (mut base, mut stride) = (0, 1);
    let (mut steps, mut fractions) = ([0; 3], [0.0; 3]);
    for axis in 0..3 {
        cell(p[axis], dims[axis])?;
        let v = p[axis].clamp(0.0, (dims[axis] - 1) as f64);
        let low = v.floor();
        base += low as usize * stride;
        fractions[axis] = v - low;
        steps[axis] = if fractions[axis] > 0.0 { stride } else { 0 };
        stride *= dims[axis];
    }
    Some((base, steps, fractions))
}

#[inline]
fn blend(
    at: impl Fn(usize) -> f64,
    (base, [sx, sy, sz], [fx, fy, fz]): (usize, [usize; 3], [f64; 3]),
) -> f64 {
    // A weight of zero must not let a NaN neighbour in.
    let mix = |a: f64, b: f64, f: f64| if f == 0.0 { a } else { a + (b - a) * f };
    let along_x = |i: usize| mix(at(i), at(i + sx), fx);
    let along_y = |i: usize| mix(along_x(i), along_x(i + sy), fy);
    mix(along_y(base), along_y(base + sz), fz)
}

/// The scaled value of `volume` at a position in its voxel indices, trilinear in `f64`; `None`
/// outside its cells. In the outer half of the outermost cells the edge's value holds. NaN where a
/// voxel that counts is NaN.
#[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
pub fn value_at(volume: &Volume, voxel: DVec3) -> Option<f64> {
    let corner = corner(voxel, volume.grid().dims())?;
    let stored = with_samples!(volume.samples(), v => blend(|i| v[i] as f64, corner));
    Some(volume.scaling().apply(stored))
}

/// `volume` on `target`, trilinear in `f64`, as [`value_at`] at every voxel centre. An image that
/// is already there keeps its values to the bit.
///
/// # Errors
/// [`Cancelled`].
#[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
pub fn image_onto(volume: &Volume, target: &Grid, progress: &Progress) -> Result<Resampled, Cancelled> {
    let source = volume.grid();
    if target.same_place(source, SAME_PLACE_VOXELS) {
        return Ok(Resampled { values: volume.to_f32(), inside: MaskBits::full(target.dims()) });
    }
    let mut out =
        Resampled { values: vec![0.0; target.voxel_count()], inside: MaskBits::empty(target.dims()) };
    let Some((first, size)) = target_box(source, target, [0; 3], source.dims()) else { return Ok(out) };
    let map = source_from_target(source, target);
    let [nx, ny, _] = target.dims();
    let per_line = out.inside.words_per_line();
    let scaling = volume.scaling();
    with_samples!(volume.samples(), stored => {
        let values = out.values.par_chunks_mut(nx * ny);
        let words = out.inside.words_mut().par_chunks_mut(per_line * ny);
        values.zip(words).enumerate().skip(first[2]).take(size[2]).try_for_each(|(z, (values, words))| {
            progress.check()?;
            for y in first[1]..first[1] + size[1] {
                let line_start = map.transform_point3(DVec3::new(0.0, y as f64, z as f64));
                for x in first[0]..first[0] + size[0] {
                    let p = line_start + map.matrix3.x_axis * x as f64;
                    if let Some(corner) = corner(p, source.dims()) {
                        values[y * nx + x] = scaling.apply(blend(|i| stored[i] as f64, corner)) as f32;
                        words[y * per_line + x / 64] |= 1 << (x % 64);
                    }
                }
            }
            Ok(())
        })
    })?;
    Ok(out)
}

#[cfg(test)]
mod tests;
