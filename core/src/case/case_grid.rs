//! The case grid: chosen among the masks' and images' grids, and extended so that no mask loses a voxel.

use std::cmp::Ordering;

use glam::{DAffine3, DVec3};

use super::{CaseError, CaseGridChoice, CaseSpec, native::NativeMask};
use crate::{Grid, Sides, resample};

/// Spacings and volumes of voxels are compared with six digits: affines are rounded in files.
const DIGITS: i32 = 6;

/// Part of a voxel by which a face may be off without needing another layer of voxels.
const SAME_FACE_VOXELS: f64 = 1e-3;

/// Bytes that the tumour index takes per voxel and time point.
const INDEX_BYTES: u64 = 4;

/// The finer grid first: the one with the smaller largest spacing, as thick slices lose what lies between them, however
/// small their voxels are; then by the voxels' volume, then the one with more voxels. The order doesn't depend on where
/// grids are listed.
fn canonical(a: &Grid, b: &Grid) -> Ordering {
    let numbers = |grid: &Grid| grid.world_from_voxel().to_cols_array();
    let by_place = || {
        let pairs = numbers(a).into_iter().zip(numbers(b));
        pairs.map(|(x, y)| x.total_cmp(&y)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    };
    by_size(a, b)
        .then_with(|| b.voxel_count().cmp(&a.voxel_count()))
        .then_with(|| a.dims().cmp(&b.dims()))
        .then_with(by_place)
}

/// By the largest spacing, then by the voxels' volume.
fn by_size(a: &Grid, b: &Grid) -> Ordering {
    let rounded = |value: f64| {
        let scale = 10_f64.powi(DIGITS - 1 - value.abs().log10().floor() as i32);
        if scale.is_normal() { (value * scale).round() / scale } else { value }
    };
    let by = |measure: &dyn Fn(&Grid) -> f64| rounded(measure(a)).total_cmp(&rounded(measure(b)));
    let by_spacing = by(&|grid| grid.spacing_mm().max_element());
    by_spacing.then_with(|| by(&|grid| grid.voxel_volume_mm3()))
}

/// As [`canonical`]; of grids equally fine first one that no transform moved, whose masks then keep their voxels.
fn finer(a: &NativeMask, b: &NativeMask) -> Ordering {
    let (at, bt) = (a.mask.grid(), b.mask.grid());
    by_size(at, bt)
        .then_with(|| a.aligned.is_some().cmp(&b.aligned.is_some()))
        .then_with(|| canonical(at, bt))
}

/// The grid that is chosen, and the id of the mask or image it comes from: the finest by [`canonical`]; the result
/// doesn't depend on the order of the masks. `images`: time, id, grid.
pub(super) fn choose(
    spec: &CaseSpec,
    choice: &CaseGridChoice,
    masks: &[NativeMask],
    images: &[(usize, &str, &Grid)],
) -> Result<(Grid, String), CaseError> {
    let of_mask = |m: &NativeMask| (m.mask.grid().clone(), spec.masks[m.spec].id.clone());
    let of_image = |(_, id, grid): &(usize, &str, &Grid)| ((*grid).clone(), (*id).to_owned());
    let none = || CaseError::wrong(&spec.name, "no image and no mask", "at least one");
    let (grid, id) = match choice {
        CaseGridChoice::FinestMask => {
            let finest = masks.iter().min_by(|a, b| finer(a, b));
            finest.map(of_mask).or_else(|| images.first().map(of_image)).ok_or_else(none)?
        }
        CaseGridChoice::Of(id) => {
            // One id may have several grids, one a time.
            let mask = masks.iter().filter(|m| spec.masks[m.spec].id == *id);
            let mask = mask.min_by(|a, b| canonical(a.mask.grid(), b.mask.grid())).map(of_mask);
            let image = || {
                let of_id = images.iter().filter(|(_, image, _)| image == id);
                of_id.min_by(|a, b| canonical(a.2, b.2)).map(of_image)
            };
            mask.or_else(image).ok_or_else(|| {
                let ids = spec.masks.iter().map(|m| &m.id).chain(spec.contexts.iter().map(|c| &c.id));
                let mut known: Vec<&str> = Vec::new();
                for id in ids {
                    if !known.contains(&id.as_str()) {
                        known.push(id);
                    }
                }
                CaseError::wrong(
                    &spec.name,
                    format!("case grid of {id}"),
                    format!("one of {}", known.join(", ")),
                )
            })?
        }
    };
    // One mask with unknown sides makes the sides of the index unknown: overlaying it is a guess.
    let unknown = masks.iter().any(|m| m.mask.grid().sides() == Sides::Unknown);
    let sides = if unknown { Sides::Unknown } else { grid.sides() };
    let grid = Grid::new(grid.dims(), grid.world_from_voxel(), sides)
        .map_err(|e| CaseError::wrong(&spec.name, e.to_string(), "a usable case grid"))?;
    Ok((grid, id))
}

/// First and last voxel of the box of a mask's active voxels, on another grid; may lie outside it. `None` when empty.
fn voxels_on(grid: &Grid, mask: &NativeMask) -> Option<[DVec3; 2]> {
    let (start, dims) = mask.mask.bits().bounds()?;
    let (low, high) = resample::box_on(mask.mask.grid(), grid, start, dims);
    Some([(low + 0.5 + SAME_FACE_VOXELS).floor(), (high - 0.5 - SAME_FACE_VOXELS).ceil()])
}

/// `grid`, extended by whole voxels where active voxels of a mask lie outside it.
///
/// # Errors
/// [`CaseError::Wrong`] where the index of the extended grid would take more than `max_bytes`.
pub(super) fn covering(
    case: &str,
    grid: &Grid,
    masks: &[NativeMask],
    max_bytes: u64,
) -> Result<Grid, CaseError> {
    let dims = DVec3::from_array(grid.dims().map(|d| d as f64));
    let boxes = masks.iter().filter_map(|mask| voxels_on(grid, mask));
    let [first, last] =
        boxes.fold([DVec3::ZERO, dims - 1.0], |[first, last], [low, high]| [first.min(low), last.max(high)]);
    if first == DVec3::ZERO && last == dims - 1.0 {
        return Ok(grid.clone());
    }
    let extent = last - first + 1.0;
    let bytes = extent.x * extent.y * extent.z * INDEX_BYTES as f64;
    if bytes > max_bytes as f64 {
        let found = format!(
            "masks whose common grid has {:.0}x{:.0}x{:.0} voxels ({:.1} GiB for each time)",
            extent.x,
            extent.y,
            extent.z,
            bytes / f64::from(1 << 30)
        );
        return Err(CaseError::wrong(
            case,
            found,
            format!("at most {max_bytes} bytes (the limit, which can be raised)"),
        ));
    }
    let affine = grid.world_from_voxel();
    let shifted = DAffine3 { matrix3: affine.matrix3, translation: affine.transform_point3(first) };
    Grid::new(extent.to_array().map(|d| d as usize), shifted, grid.sides())
        .map_err(|e| CaseError::wrong(case, e.to_string(), "a usable case grid"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(voxels: usize, spacing_mm: f64) -> Grid {
        Grid::axis_aligned([voxels; 3], DVec3::splat(spacing_mm), DVec3::ZERO).unwrap()
    }

    /// Whatever the unit of length; equally fine, the grid with more voxels goes first.
    #[test]
    fn grids_are_as_fine_as_six_digits_of_their_spacing_say() {
        for spacing_mm in [0.0011, 1.1, 110.0] {
            let large = cube(9, spacing_mm);
            for (part, expected) in
                [(1.0, Ordering::Less), (1.0 - 6e-7, Ordering::Less), (1.0 - 1e-4, Ordering::Greater)]
            {
                let small = cube(8, spacing_mm * part);
                assert_eq!(canonical(&large, &small), expected, "{spacing_mm} {part}");
                assert_eq!(canonical(&small, &large), expected.reverse(), "{spacing_mm} {part}");
            }
            // Also with another number of digits before the point.
            assert_eq!(canonical(&cube(2, spacing_mm * 0.9), &large), Ordering::Less);
            assert_eq!(canonical(&large, &large), Ordering::Equal);
        }
    }
}
