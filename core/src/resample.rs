//! Resampling onto another grid: masks by nearest neighbour, images trilinearly.
//!
//! Both compose the affines in `f64` index space and subtract the grids' translations first, so that oblique, sheared
//! and mirrored grids and offsets of a kilometre are handled accurately. Only target voxels that can lie in the
//! source are visited.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::{Cancelled, Grid, Mask, MaskBits, Progress, Volume, grid::ijk, with_samples};

/// Grids whose corners agree within this distance, in voxels, count as the same: nothing is resampled.
pub const SAME_PLACE_VOXELS: f64 = 1e-3;

/// Positions this close to the border between two voxels count as on it, so that rounding in the affines can't decide
/// ties.
pub(crate) const TIE_VOXELS: f64 = 1e-6;

/// Maps voxel indices of `target` to voxel indices of `source`, both with centres at whole numbers. The translations
/// are subtracted before they are multiplied, so that a common offset cancels.
pub fn source_from_target(source: &Grid, target: &Grid) -> DAffine3 {
    let inverse = source.voxel_from_world().matrix3;
    let (from, to) = (source.world_from_voxel(), target.world_from_voxel());
    DAffine3 { matrix3: inverse * to.matrix3, translation: inverse * (to.translation - from.translation) }
}

/// Lowest and highest voxel index of `target`, with centres at whole numbers, that the faces of the box of `dims`
/// `source` voxels from `start` reach; may lie outside `target`.
pub(crate) fn box_on(source: &Grid, target: &Grid, start: [usize; 3], dims: [usize; 3]) -> (DVec3, DVec3) {
    let target_from_source = source_from_target(target, source);
    let corners = (0..8).map(|corner| {
        let side = |a: usize| start[a] as f64 - 0.5 + if corner >> a & 1 == 1 { dims[a] as f64 } else { 0.0 };
        target_from_source.transform_point3(DVec3::new(side(0), side(1), side(2)))
    });
    corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)))
}

/// First voxel and size of the box of `target` voxels whose centres can lie in the box of `dims` `source` voxels from
/// `start`; `None` when there are none.
fn target_box(
    source: &Grid,
    target: &Grid,
    start: [usize; 3],
    dims: [usize; 3],
) -> Option<([usize; 3], [usize; 3])> {
    let (lo, hi) = box_on(source, target, start, dims);
    let mut target_voxels = ([0; 3], [0; 3]);
    for axis in 0..3 {
        // Extended outward by more than any rounding error.
        let first = (lo[axis] - 1e-3).ceil().max(0.0);
        let last = (hi[axis] + 1e-3).floor().min(target.dims()[axis] as f64 - 1.0);
        if first > last {
            return None;
        }
        target_voxels.0[axis] = first as usize;
        target_voxels.1[axis] = (last - first) as usize + 1;
    }
    Some(target_voxels)
}

/// The voxel, of `n` along one axis, that contains position `v`. Centres lie at whole numbers; a position on the border
/// of two voxels belongs to the higher one; -1/2 is inside, n - 1/2 outside.
#[inline]
fn voxel_index(v: f64, n: usize) -> Option<usize> {
    let c = (v + (0.5 + TIE_VOXELS)).floor();
    (c >= 0.0 && c < n as f64).then_some(c as usize)
}

/// The voxel, of a grid of `dims`, that contains a place given as voxel indices; `None` outside.
pub(crate) fn source_voxel(place: DVec3, dims: [usize; 3]) -> Option<[usize; 3]> {
    let at = |axis: usize| voxel_index(place[axis], dims[axis]);
    Some([at(0)?, at(1)?, at(2)?])
}

/// `mask` resampled onto `target` by nearest neighbour: a voxel is active when its centre lies in an active voxel of
/// the mask, inactive outside the mask's grid. A centre on the border of two voxels (within 1e-6 voxel) belongs to
/// the one with the higher index. A mask already on `target` ([`Grid::same_place`], within [`SAME_PLACE_VOXELS`])
/// keeps its bits.
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
                let hit = match (voxel_index(p.x, sx), voxel_index(p.y, sy), voxel_index(p.z, sz)) {
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

/// Number of active voxels of `mask` whose centres lie outside all of `grids`.
pub fn voxels_outside(mask: &Mask, grids: &[&Grid]) -> u64 {
    let Some((start, dims)) = mask.bits().bounds() else { return 0 };
    let maps: Vec<(DAffine3, [usize; 3])> =
        grids.iter().map(|g| (source_from_target(g, mask.grid()), g.dims())).collect();
    let inside = |(map, n): &(DAffine3, [usize; 3]), ijk: [usize; 3]| {
        let p = map.transform_point3(DVec3::new(ijk[0] as f64, ijk[1] as f64, ijk[2] as f64));
        (0..3).all(|a| voxel_index(p[a], n[a]).is_some())
    };
    // Grids are convex: a box whose corners are inside is inside.
    let corner = |c: usize| std::array::from_fn(|a| start[a] + if c >> a & 1 == 1 { dims[a] - 1 } else { 0 });
    if maps.iter().any(|map| (0..8).all(|c| inside(map, corner(c)))) {
        return 0;
    }
    let dims = mask.bits().dims();
    let mut outside = 0;
    mask.bits().for_each(|linear| {
        let ijk = ijk(dims, linear);
        outside += u64::from(!maps.iter().any(|map| inside(map, ijk)));
    });
    outside
}

/// An image resampled onto another grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampled {
    /// Values, `x` fastest; 0 outside the image: see `inside`.
    pub values: Vec<f32>,
    /// The voxels whose centres lie in a voxel of the image.
    pub inside: MaskBits,
}

/// Trilinear stencil at one position: linear index of the lower neighbour, strides to the upper neighbours (0 at an
/// edge, where the edge's value is used), and fractions.
#[inline]
fn corner(p: DVec3, dims: [usize; 3]) -> Option<(usize, [usize; 3], [f64; 3])> {
    let (mut base, mut stride) = (0, 1);
    let (mut steps, mut fractions) = ([0; 3], [0.0; 3]);
    for axis in 0..3 {
        voxel_index(p[axis], dims[axis])?;
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
fn trilinear(
    at: impl Fn(usize) -> f64,
    (base, [sx, sy, sz], [fx, fy, fz]): (usize, [usize; 3], [f64; 3]),
) -> f64 {
    // A NaN neighbour with weight zero must not spread.
    let lerp = |a: f64, b: f64, f: f64| if f == 0.0 { a } else { a + (b - a) * f };
    let along_x = |i: usize| lerp(at(i), at(i + sx), fx);
    let along_y = |i: usize| lerp(along_x(i), along_x(i + sy), fy);
    lerp(along_y(base), along_y(base + sz), fz)
}

/// The scaled value of `volume` at fractional voxel indices, trilinear in `f64`; `None` outside its voxels. In the
/// outer half of the outermost voxels the value is extended from the edge. NaN where a voxel with non-zero weight is
/// NaN.
#[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
pub fn value_at(volume: &Volume, voxel: DVec3) -> Option<f64> {
    let corner = corner(voxel, volume.grid().dims())?;
    let stored = with_samples!(volume.samples(), v => trilinear(|i| v[i] as f64, corner));
    Some(volume.scaling().apply(stored))
}

/// `volume` resampled onto `target`, trilinear in `f64`: [`value_at`] at every voxel centre. An image already on
/// `target` keeps its values exactly.
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
                        values[y * nx + x] = scaling.apply(trilinear(|i| stored[i] as f64, corner)) as f32;
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
