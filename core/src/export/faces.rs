//! The voxel faces of a mask as triangles between voxel corners.

use glam::DVec3;

use crate::{Cancelled, MaskBits, Progress, surface::surface_of};

/// Why a mask has no surface.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// No voxel is active.
    #[error("found no active voxel, expected at least one")]
    Empty,
    /// Its vertices can't be numbered in 32 bits, or its triangles don't fit into memory.
    #[error(
        "found a surface too large, expected at most {max_vertices} vertices and triangles that fit into memory"
    )]
    TooLarge {
        /// Largest number of vertices.
        max_vertices: usize,
    },
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The faces between active and inactive voxels, the outside of the image being inactive.
pub(super) struct Faces {
    /// The corners used, each once. Corner `[i, j, k]` is the lowest of voxel `[i, j, k]`.
    pub corners: Vec<[u32; 3]>,
    /// Two for each face: of a quad `a b c d`, first `a b c`, then `a c d`; counterclockwise seen from outside
    /// where voxel axes are right-handed, clockwise with `mirrored`.
    pub triangles: Vec<[u32; 3]>,
}

/// No vertex yet.
const NONE: u32 = u32::MAX;

/// Number of faces: six of each voxel but those between two active ones.
fn count_faces(mask: &MaskBits) -> u64 {
    let (per_line, words) = (mask.words_per_line(), mask.words());
    let lines_per_slice = mask.dims()[1];
    let mut pairs = 0;
    let mut add = |both: u64| pairs += u64::from(both.count_ones());
    for (at, &here) in words.iter().enumerate().filter(|(_, here)| **here != 0) {
        let (line, word) = (at / per_line, at % per_line);
        add(here & (here << 1 | if word > 0 { words[at - 1] >> 63 } else { 0 }));
        if line % lines_per_slice > 0 {
            add(here & words[at - per_line]);
        }
        if line >= lines_per_slice {
            add(here & words[at - per_line * lines_per_slice]);
        }
    }
    6 * mask.count() - 2 * pairs
}

/// The faces of `mask`, in memory order of their voxels, with at most `max_vertices` vertices. `mirrored` turns
/// all triangles round, for grids with left-handed axes.
///
/// # Errors
/// As [`super::mesh`].
pub(super) fn faces_of(
    mask: &MaskBits,
    mirrored: bool,
    max_vertices: usize,
    progress: &Progress,
) -> Result<Faces, MeshError> {
    let (start, size) = mask.bounds().ok_or(MeshError::Empty)?;
    let too_large = MeshError::TooLarge { max_vertices };
    if mask.dims().iter().any(|&d| u32::try_from(d).is_err()) {
        return Err(too_large);
    }
    let triangles = usize::try_from(2 * count_faces(mask)).map_err(|_| too_large.clone())?;
    let mut faces = Faces { corners: Vec::new(), triangles: Vec::new() };
    faces.triangles.try_reserve_exact(triangles).map_err(|_| too_large.clone())?;

    let surface = surface_of(mask);
    // The vertices of the corners below and above a slice: what a sweep must remember.
    let row = size[0] + 1;
    let mut planes = [vec![NONE; row * (size[1] + 1)], vec![NONE; row * (size[1] + 1)]];
    progress.expect(size[2] as u64);
    for z in start[2]..start[2] + size[2] {
        for y in start[1]..start[1] + size[1] {
            for x in active_in_line(&surface, y, z) {
                let voxel = [x, y, z];
                for axis in 0..3 {
                    for upper in [false, true] {
                        if is_active_beside(mask, voxel, axis, upper) {
                            continue;
                        }
                        let mut quad = [NONE; 4];
                        for (vertex, corner) in quad.iter_mut().zip(face_corners(voxel, axis, upper)) {
                            let plane = &mut planes[corner[2] - z];
                            let slot = &mut plane[(corner[1] - start[1]) * row + corner[0] - start[0]];
                            if *slot == NONE {
                                if faces.corners.len() >= max_vertices {
                                    return Err(too_large);
                                }
                                // Both fit: the dimensions and the number of vertices were checked.
                                *slot = faces.corners.len() as u32;
                                faces.corners.push(corner.map(|c| c as u32));
                            }
                            *vertex = *slot;
                        }
                        let [a, b, c, d] = quad;
                        let [b, d] = if upper == mirrored { [d, b] } else { [b, d] };
                        faces.triangles.extend([[a, b, c], [a, c, d]]);
                    }
                }
            }
        }
        planes.swap(0, 1);
        planes[1].fill(NONE);
        progress.advance(1)?;
    }
    Ok(faces)
}

/// The active voxels of an x-line.
fn active_in_line(mask: &MaskBits, y: usize, z: usize) -> impl Iterator<Item = usize> {
    let per_line = mask.words_per_line();
    let line = (z * mask.dims()[1] + y) * per_line;
    mask.words()[line..line + per_line].iter().enumerate().flat_map(|(w, &word)| {
        let mut remaining = word;
        std::iter::from_fn(move || {
            let x = (remaining != 0).then(|| w * 64 + remaining.trailing_zeros() as usize)?;
            remaining &= remaining - 1;
            Some(x)
        })
    })
}

fn is_active_beside(mask: &MaskBits, mut voxel: [usize; 3], axis: usize, upper: bool) -> bool {
    let neighbor = if upper { Some(voxel[axis] + 1) } else { voxel[axis].checked_sub(1) };
    neighbor.filter(|&n| n < mask.dims()[axis]).is_some_and(|n| {
        voxel[axis] = n;
        mask.get(voxel)
    })
}

/// The corners of a voxel's face, counterclockwise seen from higher indices of `axis`.
fn face_corners(voxel: [usize; 3], axis: usize, upper: bool) -> [[usize; 3]; 4] {
    [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[b, c]| {
        let mut corner = voxel;
        corner[axis] += usize::from(upper);
        corner[(axis + 1) % 3] += b;
        corner[(axis + 2) % 3] += c;
        corner
    })
}

/// A corner as a vector.
pub(super) fn point(corner: [u32; 3]) -> DVec3 {
    DVec3::from_array(corner.map(f64::from))
}

/// The corners of a triangle.
pub(super) fn corners_of(positions: &[DVec3], triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|vertex| positions[vertex as usize])
}

/// Unit normals of vertices: of the sum of the area vectors of their voxel faces, so that they don't depend on
/// how faces are divided into triangles; zero where that sum is zero.
pub(super) fn vertex_normals(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for pair in triangles.as_chunks::<2>().0 {
        let quad = quad_of(pair);
        let [a, b, c, d] = quad.map(|vertex| positions[vertex]);
        let area = (c - a).cross(d - b);
        quad.iter().for_each(|&vertex| normals[vertex] += area);
    }
    normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    normals
}

/// The corners of the face that two triangles of [`Faces`] make.
pub(super) fn quad_of(&[first, second]: &[[u32; 3]; 2]) -> [usize; 4] {
    [first[0], first[1], first[2], second[2]].map(|vertex| vertex as usize)
}
