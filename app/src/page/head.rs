//! A coarse outline of what an image shows: a head, or a brain without its skull.

use glioscope_core::{
    Components, Connectivity, Grid, Mask, MaskBits, Progress, Sides, Volume,
    glam::{DAffine3, DMat3, DVec3},
    surface::without_cavities,
};

use super::{
    PageError, Surface,
    slices::{percentile, trilinear},
};

/// Side of the outline's voxels where the image is no larger than a head.
const VOXEL_MM: f64 = 3.5;
/// Voxels along the longest side, at most.
const MOST_VOXELS: f64 = 96.0;
/// Share of the range from the 2nd to the 98th percentile above which a voxel isn't air (Smith, Fast robust automated brain
/// extraction, Human Brain Mapping 2002).
const THRESHOLD: f64 = 0.1;
/// The outline is for the eye.
const ERROR_MM: f64 = 0.35;
/// An outline of fewer voxels shows nothing.
const LEAST_VOXELS: u64 = 200;

/// The outer surface of the largest part of `image` that isn't air, cavities filled; `None` where there is none.
pub fn head(image: &Volume, progress: &Progress) -> Result<Option<Surface>, PageError> {
    let Some((grid, values)) = coarse(image) else { return Ok(None) };
    let dims = grid.dims();
    // Of the image alone: the margin would make the least value, often far below air, the second percentile.
    let mut finite: Vec<f32> = image.to_f32().into_iter().filter(|v| v.is_finite()).collect();
    let Some((low, high)) = percentile(&mut finite, 2).zip(percentile(&mut finite, 98)) else {
        return Ok(None);
    };
    let threshold = low + THRESHOLD * (high - low);
    progress.check()?;
    let above = MaskBits::from_fn(dims, |n| f64::from(values[n]) > threshold);
    let smooth = rounded(&above);
    let Some(part) = largest(&smooth) else { return Ok(None) };
    let Ok(filled) = without_cavities(&part) else { return Ok(None) };
    if filled.count() < LEAST_VOXELS {
        return Ok(None);
    }
    let Some(mask) = Mask::new("", grid, filled) else { return Ok(None) };
    Ok(Surface::of_mask(&mask, ERROR_MM, progress)?)
}

/// The image on coarse voxels along the world's axes with a margin of two, each the mean of eight places in it.
fn coarse(image: &Volume) -> Option<(Grid, Vec<f32>)> {
    let (lo, hi) = image.grid().bounds_mm();
    let side_mm = VOXEL_MM.max((hi - lo).max_element() / MOST_VOXELS);
    let dims = ((hi - lo) / side_mm).to_array().map(|n| n.ceil() as usize + 4);
    let first = lo - DVec3::splat(1.5 * side_mm);
    let world_from_voxel =
        DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::splat(side_mm)), first);
    let grid = Grid::new(dims, world_from_voxel, Sides::Known).ok()?;
    let to_voxel = image.grid().voxel_from_world();
    let outside =
        (0..image.samples().len()).map(|n| image.value(n)).filter(|v| v.is_finite()).fold(f64::MAX, f64::min);
    let value = |ijk: [usize; 3]| image.value(image.grid().linear(ijk));
    let mean = |n: usize| {
        let center = grid.center_of_voxel_mm(grid.ijk(n));
        let part = |k: usize| {
            let shift =
                DVec3::from_array([0, 1, 2].map(|axis| if k >> axis & 1 == 0 { -0.25 } else { 0.25 }));
            trilinear(
                image.grid().dims(),
                to_voxel.transform_point3(center + shift * side_mm),
                outside,
                &value,
            )
        };
        ((0..8).map(part).sum::<f64>() / 8.0) as f32
    };
    let values = (0..grid.voxel_count()).map(mean).collect();
    Some((grid, values))
}

/// Voxels most of whose neighbourhood of 3×3×3 is active: single voxels and gaps go.
fn rounded(bits: &MaskBits) -> MaskBits {
    let dims = bits.dims();
    MaskBits::from_fn(dims, |n| {
        let center = glioscope_core::grid::ijk(dims, n);
        let near = |k: usize| {
            let place: [Option<usize>; 3] = std::array::from_fn(|axis| {
                let shift = [k % 3, k / 3 % 3, k / 9][axis];
                (center[axis] + shift).checked_sub(1).filter(|v| *v < dims[axis])
            });
            matches!(place, [Some(x), Some(y), Some(z)] if bits.get([x, y, z]))
        };
        (0..27).filter(|k| near(*k)).count() >= 14
    })
}

/// The component with the most voxels, the first of equals; `None` where nothing is active.
fn largest(bits: &MaskBits) -> Option<MaskBits> {
    let components = Components::of_mask(bits, Connectivity::Six).ok()?;
    let sizes = components.list().iter().zip(1_u32..);
    let (_, label) = sizes.max_by_key(|(part, label)| (part.voxels, std::cmp::Reverse(*label)))?;
    let labels = components.labels(bits.dims());
    Some(MaskBits::from_fn(bits.dims(), |n| labels[n] == label))
}
