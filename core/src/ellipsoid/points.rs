//! The corners that determine a component's enclosing ellipsoid.
//!
//! An ellipsoid that contains all voxel cubes contains all their corners, and one that contains a
//! convex polygon's corners contains the polygon. So of each plane of corners only the vertices of its
//! convex hull are kept, and those come from the first and last voxel of each x-line. All coordinates
//! are integers, so nothing is rounded.

use glam::DVec3;

use crate::components::Run;

/// One side of a polygon in a plane of corners: y, and the smallest or largest x there.
type Side = Vec<(i64, i64)>;

/// The two sides of a polygon, each with y ascending.
#[derive(Default)]
struct Polygon {
    left: Side,
    right: Side,
}

/// Corners of voxels that include every vertex of the convex hull of the voxel cubes, for runs in
/// raster order. Corner `k` lies between voxels `start + k - 1` and `start + k` of its axis, so its
/// voxel index is `start + k - 0.5`. Points of one component never lie in one plane: a voxel has
/// eight corners. Empty without runs.
pub fn hull_corners(runs: &[Run], start: [usize; 3]) -> Vec<DVec3> {
    let mut corners = Vec::new();
    let mut previous = Polygon::default();
    let mut plane = 0;
    for slice in runs.chunk_by(|a, b| a.z == b.z) {
        let z = i64::from(slice[0].z) - start[2] as i64;
        let current = polygon(slice, start);
        if z > plane {
            // A component has voxels in every slice of its box, but any list of runs is accepted.
            emit(&previous, plane, &mut corners);
            emit(&current, z, &mut corners);
        } else {
            emit(&merged(&previous, &current), z, &mut corners);
        }
        previous = current;
        plane = z + 1;
    }
    emit(&previous, plane, &mut corners);
    corners
}

fn emit(polygon: &Polygon, z: i64, corners: &mut Vec<DVec3>) {
    let point = |&(y, x): &(i64, i64)| DVec3::new(x as f64, y as f64, z as f64);
    corners.extend(polygon.left.iter().map(point));
    corners.extend(polygon.right.iter().map(point));
}

/// Hull of the corners of one slice's voxels.
fn polygon(slice: &[Run], start: [usize; 3]) -> Polygon {
    let mut out = Polygon::default();
    for line in slice.chunk_by(|a, b| a.y == b.y) {
        let y = i64::from(line[0].y) - start[1] as i64;
        let first = i64::from(line[0].first) - start[0] as i64;
        let last = i64::from(line[line.len() - 1].last) - start[0] as i64 + 1;
        for y in [y, y + 1] {
            widen(&mut out.left, y, first, i64::min);
            widen(&mut out.right, y, last, i64::max);
        }
    }
    Polygon { left: convex(&out.left, 1), right: convex(&out.right, -1) }
}

fn widen(side: &mut Side, y: i64, x: i64, extreme: fn(i64, i64) -> i64) {
    match side.last_mut() {
        Some((at, best)) if *at == y => *best = extreme(*best, x),
        _ => side.push((y, x)),
    }
}

/// Hull of two polygons of one plane.
fn merged(a: &Polygon, b: &Polygon) -> Polygon {
    let side = |a: &Side, b: &Side, extreme: fn(i64, i64) -> i64| {
        let mut both: Side = Vec::with_capacity(a.len() + b.len());
        let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
        while let Some(&(y, x)) = match (a.peek(), b.peek()) {
            (Some(p), Some(q)) if p.0 <= q.0 => a.next(),
            (Some(_), None) => a.next(),
            _ => b.next(),
        } {
            widen(&mut both, y, x, extreme);
        }
        both
    };
    Polygon {
        left: convex(&side(&a.left, &b.left, i64::min), 1),
        right: convex(&side(&a.right, &b.right, i64::max), -1),
    }
}

/// Drops the points of a side that aren't vertices of the hull (Andrew 1979). `sign` 1 for the left.
fn convex(side: &[(i64, i64)], sign: i64) -> Side {
    let mut hull_side: Side = Vec::with_capacity(side.len());
    for &(y, x) in side {
        while let [.., (ay, ax), (by, bx)] = hull_side[..] {
            if sign * ((by - ay) * (x - ax) - (bx - ax) * (y - ay)) > 0 {
                break;
            }
            hull_side.pop();
        }
        hull_side.push((y, x));
    }
    hull_side
}
