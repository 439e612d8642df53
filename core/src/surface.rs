//! Surface voxels and surface elements of a mask.

use glam::DVec3;

use crate::{Components, Connectivity, Grid, Mask, MaskBits, components::TooLarge, grid::ijk};

/// The surface of `mask`: its active voxels with at least one inactive neighbour across a face
/// (6-neighbourhood). Voxels outside the image count as inactive, so a mask that touches the
/// image's border has surface there. Same size as `mask`; exact; an empty mask gives an empty one.
///
/// A part one or two voxels thick is all surface. Processes 64 voxels at once, inside the mask's
/// bounding box only.
pub fn surface_of(mask: &MaskBits) -> MaskBits {
    let dims = mask.dims();
    let mut surface = MaskBits::empty(dims);
    let Some((start, size)) = mask.bounds() else { return surface };
    let per_line = mask.words_per_line();
    let words = mask.words();
    let (first, last) = (start[0] / 64, (start[0] + size[0] - 1) / 64);
    let out = surface.words_mut();
    for z in start[2]..start[2] + size[2] {
        for y in start[1]..start[1] + size[1] {
            let line = (z * dims[1] + y) * per_line;
            let next_slice = dims[1] * per_line;
            for w in first..=last {
                let at = line + w;
                let here = words[at];
                if here == 0 {
                    continue;
                }
                // Bits past a line's end are zero: outside is inactive without a special case.
                let before = if w > 0 { words[at - 1] >> 63 } else { 0 };
                let after = if w + 1 < per_line { words[at + 1] << 63 } else { 0 };
                let other = |inside: bool, at: usize| if inside { words[at] } else { 0 };
                let inner = (here << 1 | before)
                    & (here >> 1 | after)
                    & other(y > 0, at.wrapping_sub(per_line))
                    & other(y + 1 < dims[1], at + per_line)
                    & other(z > 0, at.wrapping_sub(next_slice))
                    & other(z + 1 < dims[2], at + next_slice);
                out[at] = here & !inner;
            }
        }
    }
    surface
}

/// `mask` with its cavities active: the inactive voxels from which no path across faces leads out of the mask's
/// bounding box. Its surface is the outer surface of `mask`.
///
/// # Errors
/// [`TooLarge`] where the background can't be numbered in 32 bits.
pub fn without_cavities(mask: &MaskBits) -> Result<MaskBits, TooLarge> {
    let mut filled = mask.clone();
    let Some((start, size)) = mask.bounds() else { return Ok(filled) };
    // With a margin of one voxel, all that is outside is one component.
    let dims = size.map(|n| n + 2);
    let mut boxed = MaskBits::empty(dims);
    mask.for_each(|linear| {
        let v = ijk(mask.dims(), linear);
        boxed.set(std::array::from_fn(|a| v[a] + 1 - start[a]));
    });
    let background = Components::of_mask(&boxed.inverted(), Connectivity::Six)?;
    // Raster order: the first component holds the margin.
    for cavity in background.list().iter().skip(1) {
        for run in background.runs(cavity) {
            for x in run.first..=run.last {
                let v = [x as usize, run.y as usize, run.z as usize];
                filled.set(std::array::from_fn(|a| v[a] + start[a] - 1));
            }
        }
    }
    Ok(filled)
}

/// The voxels of [`surface_of`] as indices `[i, j, k]` of the mask's grid, in memory order (`i`
/// fastest). Empty for an empty mask.
pub fn surface_voxels(mask: &MaskBits) -> Vec<[usize; 3]> {
    let dims = mask.dims();
    let mut voxels = Vec::new();
    surface_of(mask).for_each(|l| voxels.push(ijk(dims, l)));
    voxels
}

/// A piece of a mask's surface: one voxel face between an active and an inactive voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceElement {
    /// The active voxel.
    pub voxel: [usize; 3],
    /// Centre of the face, world millimetres.
    pub center_mm: DVec3,
    /// Outward normal, as long as the face's area in mm².
    pub area_mm2: DVec3,
}

/// Centres of surface voxels of several masks, in RAS mm, evenly thinned to at most `most`; each mask on its own grid. Empty for
/// empty masks.
pub fn points_mm(masks: &[&Mask], most: usize) -> Vec<DVec3> {
    let of = |mask: &&Mask| {
        let voxels = surface_voxels(mask.bits());
        voxels.into_iter().map(|voxel| mask.grid().center_of_voxel_mm(voxel)).collect::<Vec<_>>()
    };
    let all: Vec<DVec3> = masks.iter().flat_map(of).collect();
    let step = all.len().div_ceil(most.max(1)).max(1);
    all.into_iter().step_by(step).collect()
}

/// The faces of `mask` towards inactive voxels or out of the image, in memory order of their voxels,
/// lower x face first. Exact on any grid: on a sheared one faces are parallelograms. Their area vectors
/// sum to zero, as those of every closed surface do. Empty for an empty mask.
///
/// A staircase: the sum of areas is that of the voxels' faces, which exceeds the area of the smooth surface
/// that they approximate (on a ball by half, on a slanted plane by up to √3 times).
pub fn surface_elements(mask: &MaskBits, grid: &Grid) -> Vec<SurfaceElement> {
    let dims = mask.dims();
    let world_from_voxel = grid.world_from_voxel();
    let m = world_from_voxel.matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    // A mirrored grid turns the cross products inwards.
    let sign = m.determinant().signum();
    let upper = [0, 1, 2].map(|a| sign * columns[(a + 1) % 3].cross(columns[(a + 2) % 3]));
    let mut elements = Vec::new();
    for voxel in surface_voxels(mask) {
        let center = DVec3::new(voxel[0] as f64, voxel[1] as f64, voxel[2] as f64);
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let mut neighbor = voxel;
                let inside = if side < 0.0 { voxel[axis] > 0 } else { voxel[axis] + 1 < dims[axis] };
                if inside {
                    neighbor[axis] = if side < 0.0 { voxel[axis] - 1 } else { voxel[axis] + 1 };
                    if mask.get(neighbor) {
                        continue;
                    }
                }
                let center_mm = world_from_voxel.transform_point3(center) + columns[axis] * (0.5 * side);
                elements.push(SurfaceElement { voxel, center_mm, area_mm2: upper[axis] * side });
            }
        }
    }
    elements
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, voxel by voxel.
    fn by_definition(mask: &MaskBits) -> Vec<[usize; 3]> {
        let dims = mask.dims();
        let active = |ijk: [i64; 3]| {
            (0..3).all(|a| ijk[a] >= 0 && ijk[a] < dims[a] as i64) && mask.get(ijk.map(|v| v as usize))
        };
        let mut found = Vec::new();
        for k in 0..dims[2] as i64 {
            for j in 0..dims[1] as i64 {
                for i in 0..dims[0] as i64 {
                    let sides = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
                    if active([i, j, k]) && sides.iter().any(|s| !active([i + s[0], j + s[1], k + s[2]])) {
                        found.push([i, j, k].map(|v| v as usize));
                    }
                }
            }
        }
        found
    }

    #[test]
    fn cavities_are_what_a_flood_from_outside_does_not_reach() {
        let dims = [7, 6, 5];
        let mut cavities = 0;
        for seed in 0..40_u64 {
            let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) + 1;
            let mask = MaskBits::from_fn(dims, |_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) % 100 < 70
            });
            // Outside spreads until nothing changes.
            let at = |v: [usize; 3], side: usize| -> Option<[usize; 3]> {
                let mut to = v;
                let axis = side / 2;
                to[axis] = if side.is_multiple_of(2) { v[axis].checked_sub(1)? } else { v[axis] + 1 };
                (to[axis] < dims[axis]).then_some(to)
            };
            let mut outside = MaskBits::empty(dims);
            loop {
                let before = outside.count();
                for linear in 0..dims.iter().product() {
                    let v = ijk(dims, linear);
                    let reached = (0..6).any(|side| at(v, side).is_none_or(|n| outside.get(n)));
                    if !mask.get(v) && reached {
                        outside.set(v);
                    }
                }
                if outside.count() == before {
                    break;
                }
            }
            assert_eq!(without_cavities(&mask).unwrap(), outside.inverted(), "seed {seed}");
            cavities += outside.inverted().count() - mask.count();
        }
        assert!(cavities > 20);
        let empty = MaskBits::empty(dims);
        assert_eq!(without_cavities(&empty).unwrap(), empty);
    }

    #[test]
    fn surface_equals_its_definition_on_random_masks() {
        for (seed, dims) in [[1, 1, 1], [1, 7, 5], [63, 4, 3], [64, 5, 4], [65, 5, 4], [130, 3, 6], [9, 1, 8]]
            .into_iter()
            .enumerate()
        {
            for percent in [3, 50, 90, 98, 100] {
                let mut state = seed as u64 * 1_000 + percent + 1;
                let mask = MaskBits::from_fn(dims, |_| {
                    state =
                        state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 33) % 100 < percent
                });
                assert_eq!(surface_voxels(&mask), by_definition(&mask), "{dims:?} {percent} %");
            }
        }
    }

    #[test]
    fn a_box_has_the_counted_surface_voxels() {
        let inside = |v: usize, lo: usize, n: usize| (lo..lo + n).contains(&v);
        let dims = [80, 12, 9];
        let mask = MaskBits::from_fn(dims, |l| {
            inside(l % 80, 60, 10) && inside(l / 80 % 12, 2, 6) && inside(l / 960, 3, 5)
        });
        assert_eq!(surface_of(&mask).count(), 10 * 6 * 5 - 8 * 4 * 3);
        assert_eq!(surface_of(&MaskBits::full([70, 5, 4])).count(), 70 * 5 * 4 - 68 * 3 * 2);
        assert_eq!(surface_of(&MaskBits::empty(dims)), MaskBits::empty(dims));
        assert!(surface_voxels(&MaskBits::empty(dims)).is_empty());
    }

    #[test]
    fn elements_of_a_box_have_its_area_and_close_on_any_grid() {
        use crate::Sides;
        use glam::{DAffine3, DMat3};
        let dims = [9, 8, 7];
        let inside = |v: usize, lo: usize, n: usize| (lo..lo + n).contains(&v);
        let mask = MaskBits::from_fn(dims, |l| {
            inside(l % 9, 2, 4) && inside(l / 9 % 8, 0, 3) && inside(l / 72, 5, 2)
        });
        for matrix in [
            DMat3::from_diagonal(DVec3::new(0.5, 0.7, 3.0)),
            DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 2.0)),
            DMat3::from_cols(
                DVec3::new(1.0, 0.1, 0.0),
                DVec3::new(0.3, 0.9, 0.2),
                DVec3::new(0.0, -0.4, 2.5),
            ),
        ] {
            let offset = DVec3::new(1e6, -3.0, 8.0);
            let world_from_voxel = DAffine3 { matrix3: matrix, translation: offset };
            let grid = Grid::new(dims, world_from_voxel, Sides::Known).unwrap();
            let elements = surface_elements(&mask, &grid);
            assert_eq!(elements.len(), 2 * (4 * 3 + 3 * 2 + 2 * 4));
            let [x, y, z] = [matrix.x_axis * 4.0, matrix.y_axis * 3.0, matrix.z_axis * 2.0];
            let expected = 2.0 * (x.cross(y).length() + y.cross(z).length() + z.cross(x).length());
            let area: f64 = elements.iter().map(|e| e.area_mm2.length()).sum();
            assert!((area - expected).abs() < 1e-9 * expected, "{area} of {expected}");
            let sum: DVec3 = elements.iter().map(|e| e.area_mm2).sum();
            assert!(sum.length() < 1e-9 * expected, "a closed surface");
            // Divergence theorem: outward areas give the volume (relative to the box: 1e6 mm cost no precision).
            let middle = elements.iter().map(|e| e.center_mm - offset).sum::<DVec3>() / elements.len() as f64;
            let volume: f64 =
                elements.iter().map(|e| (e.center_mm - offset - middle).dot(e.area_mm2)).sum::<f64>() / 3.0;
            let voxels = matrix.determinant().abs() * 24.0;
            assert!((volume - voxels).abs() < 1e-6 * voxels, "{volume} of {voxels}");
        }
        assert!(
            surface_elements(
                &MaskBits::empty(dims),
                &Grid::axis_aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap()
            )
            .is_empty()
        );
    }
}
