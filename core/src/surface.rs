//! Which voxels of a mask are its surface.

use crate::MaskBits;

/// The surface of `mask`: its active voxels with at least one inactive neighbour across a face
/// (6-neighbourhood). What lies outside the image counts as inactive, so a mask that touches the
/// image's border has surface there. Same size as `mask`; exact; an empty mask gives an empty one.
///
/// A part one or two voxels thick is all surface. Works on 64 voxels at once, inside the mask's
/// bounds only.
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

/// The voxels of [`surface_of`] as indices `[i, j, k]` of the mask's grid, in memory order (`i`
/// fastest). Empty for an empty mask.
pub fn surface_voxels(mask: &MaskBits) -> Vec<[usize; 3]> {
    let [nx, ny, _] = mask.dims();
    let mut voxels = Vec::new();
    surface_of(mask).for_each(|l| voxels.push([l % nx, l / nx % ny, l / (nx * ny)]));
    voxels
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
    fn equals_the_definition_on_speckle_blocks_and_word_borders() {
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
    fn a_box_has_the_surface_that_counting_gives() {
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
}
