//! Smoothing of voxel faces: Taubin's low-pass filter within limits, and the volume of each part restored.

use glam::DVec3;

use super::faces::{Faces, corners_of, point, quad_of, vertex_normals};
use crate::{Cancelled, Progress};

/// Steps of smoothing, each inwards by [`SHRINK`], then outwards by [`GROW`] of the distance to the neighbours'
/// mean.
const STEPS: u64 = 20;
const SHRINK: f64 = 0.5;
/// Passes what varies over many voxels: 1/GROW + 1/SHRINK is about 0.1 (Taubin, 1995).
const GROW: f64 = -0.53;
/// Largest movement along an axis in voxels while smoothing.
const MAX_SHIFT: f64 = 0.4;
/// Largest movement along the normals that restores a part's volume, in voxels.
const MAX_OFFSET: f64 = 1.0;

/// The corners of `faces`, smoothed, in voxel units. `mirrored`: triangles are turned round.
pub(super) fn smoothed(faces: &Faces, mirrored: bool, progress: &Progress) -> Result<Vec<DVec3>, Cancelled> {
    progress.expect(2 * STEPS + 1);
    let mut positions: Vec<DVec3> = faces.corners.iter().map(|&corner| point(corner)).collect();
    let mut sums = vec![(DVec3::ZERO, 0.0_f64); positions.len()];
    for _ in 0..STEPS {
        for share in [SHRINK, GROW] {
            move_to_neighbors(faces, share, &mut positions, &mut sums);
            progress.advance(1)?;
        }
    }
    drop(sums);
    restore_volumes(faces, mirrored, &mut positions);
    progress.advance(1)?;
    Ok(positions)
}

/// Moves each vertex by a share of the way to the mean of its neighbours across edges of faces.
fn move_to_neighbors(faces: &Faces, share: f64, positions: &mut [DVec3], sums: &mut [(DVec3, f64)]) {
    sums.fill((DVec3::ZERO, 0.0));
    for pair in faces.triangles.as_chunks::<2>().0 {
        let quad = quad_of(pair);
        for (i, &at) in quad.iter().enumerate() {
            let sum = &mut sums[at];
            sum.0 += positions[quad[(i + 1) % 4]] + positions[quad[(i + 3) % 4]];
            sum.1 += 2.0;
        }
    }
    for ((position, (sum, count)), &corner) in positions.iter_mut().zip(sums).zip(&faces.corners) {
        let moved = *position + (*sum / *count - *position) * share;
        *position = moved.clamp(point(corner) - MAX_SHIFT, point(corner) + MAX_SHIFT);
    }
}

/// What a part of the surface encloses when its vertices move along their normals by `t`: coefficients of 1, t,
/// t², t³ of six times the volume; and that of its voxels.
#[derive(Clone, Copy, Default)]
struct Part {
    origin: DVec3,
    coefficients: [f64; 4],
    target: f64,
}

impl Part {
    /// The movement that gives the part its voxels' volume, by Newton's method; zero where that would be too
    /// far.
    fn offset(&self) -> f64 {
        let [c0, c1, c2, c3] = self.coefficients;
        let mut t = 0.0_f64;
        for _ in 0..20 {
            let value = c0 - self.target + t * (c1 + t * (c2 + t * c3));
            let slope = c1 + t * (2.0 * c2 + t * 3.0 * c3);
            t -= value / slope;
        }
        if t.abs() <= MAX_OFFSET { t } else { 0.0 }
    }
}

/// Moves each connected part of the surface along its normals until it has the volume of its voxel faces. The
/// outer surface of a part and that of a cavity are two parts.
fn restore_volumes(faces: &Faces, mirrored: bool, positions: &mut [DVec3]) {
    let part_of = parts_of(faces);
    let mut normals = vertex_normals(positions, &faces.triangles);
    if mirrored {
        normals.iter_mut().for_each(|n| *n = -*n);
    }
    let count = part_of.iter().max().map_or(0, |&last| last as usize + 1);
    let mut parts = vec![Part::default(); count];
    for (&part, &corner) in part_of.iter().zip(&faces.corners) {
        parts[part as usize].origin = point(corner);
    }
    for &triangle in &faces.triangles {
        let part = &mut parts[part_of[triangle[0] as usize] as usize];
        let [a, b, c] = corners_of(positions, triangle).map(|p| p - part.origin);
        let [l, m, n] = corners_of(&normals, triangle);
        let [p, q, r] = triangle.map(|vertex| point(faces.corners[vertex as usize]) - part.origin);
        let added = [
            a.dot(b.cross(c)),
            l.dot(b.cross(c)) + m.dot(c.cross(a)) + n.dot(a.cross(b)),
            a.dot(m.cross(n)) + b.dot(n.cross(l)) + c.dot(l.cross(m)),
            l.dot(m.cross(n)),
        ];
        part.coefficients.iter_mut().zip(added).for_each(|(sum, x)| *sum += x);
        part.target += p.dot(q.cross(r));
    }
    let offsets: Vec<f64> = parts.iter().map(Part::offset).collect();
    for ((position, normal), part) in positions.iter_mut().zip(normals).zip(part_of) {
        *position += normal * offsets[part as usize];
    }
}

/// The connected part of each vertex, numbered from 0 in the order of their first vertices.
fn parts_of(faces: &Faces) -> Vec<u32> {
    // Union-find whose roots are the lowest vertices.
    let mut parent: Vec<u32> = (0..faces.corners.len() as u32).collect();
    fn root(parent: &mut [u32], mut at: u32) -> u32 {
        while parent[at as usize] != at {
            parent[at as usize] = parent[parent[at as usize] as usize];
            at = parent[at as usize];
        }
        at
    }
    for &[a, b, c] in &faces.triangles {
        for other in [b, c] {
            let (x, y) = (root(&mut parent, a), root(&mut parent, other));
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    // A parent is never above its child: by now it holds its part's number.
    let mut count = 0;
    for at in 0..parent.len() {
        let above = parent[at];
        parent[at] = if above as usize == at {
            count += 1;
            count - 1
        } else {
            parent[above as usize]
        };
    }
    parent
}
