//! The corners that decide a component's enclosing ellipsoid.
//!
//! An ellipsoid that holds all voxel cubes holds all their corners, and one that holds a convex
//! polygon's corners holds the polygon. So of each plane of corners only the vertices of its convex
//! hull are kept, and those come from the first and last voxel of each x-line. Everything is in whole
//! numbers, so nothing is lost to rounding.

use glam::DVec3;

use crate::components::Run;

/// A point of a plane of corners: y, and the smallest or largest x there.
type Side = Vec<(i64, i64)>;

/// The two sides of a polygon, each with y ascending.
#[derive(Default)]
struct Polygon {
    left: Side,
    right: Side,
}

/// Corners of voxels, among them every vertex of the convex hull of the voxel cubes, for runs in
/// raster order. Corner `k` lies between voxels `start + k - 1` and `start + k` of its axis, so its
/// voxel index is `start + k - 0.5`. Points of one component never lie in one plane: a voxel has
/// eight corners. Empty for no run.
pub fn hull_corners(runs: &[Run], start: [usize; 3]) -> Vec<DVec3> {
    let mut corners = Vec::new();
    let mut before = Polygon::default();
    let mut plane = 0;
    for slice in runs.chunk_by(|a, b| a.z == b.z) {
        let z = i64::from(slice[0].z) - start[2] as i64;
        let here = polygon(slice, start);
        if z > plane {
            // A component has voxels in every slice of its box, but any list of runs is served.
            emit(&before, plane, &mut corners);
            emit(&here, z, &mut corners);
        } else {
            emit(&merged(&before, &here), z, &mut corners);
        }
        before = here;
        plane = z + 1;
    }
    emit(&before, plane, &mut corners);
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

fn widen(side: &mut Side, y: i64, x: i64, better: fn(i64, i64) -> i64) {
    match side.last_mut() {
        Some((at, best)) if *at == y => *best = better(*best, x),
        _ => side.push((y, x)),
    }
}

/// Hull of two polygons of one plane.
fn merged(a: &Polygon, b: &Polygon) -> Polygon {
    let side = |a: &Side, b: &Side, better: fn(i64, i64) -> i64| {
        let mut both: Side = Vec::with_capacity(a.len() + b.len());
        let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
        while let Some(&(y, x)) = match (a.peek(), b.peek()) {
            (Some(p), Some(q)) if p.0 <= q.0 => a.next(),
            (Some(_), None) => a.next(),
            _ => b.next(),
        } {
            widen(&mut both, y, x, better);
        }
        both
    };
    Polygon {
        left: convex(&side(&a.left, &b.left, i64::min), 1),
        right: convex(&side(&a.right, &b.right, i64::max), -1),
    }
}

/// Drops the points of a side that are no vertex of the hull (Andrew 1979). `sign` 1 for the left.
fn convex(side: &[(i64, i64)], sign: i64) -> Side {
    let mut kept: Side = Vec::with_capacity(side.len());
    for &(y, x) in side {
        while let [.., (ay, ax), (by, bx)] = kept[..] {
            if sign * ((by - ay) * (x - ax) - (bx - ax) * (y - ay)) > 0 {
                break;
            }
            kept.pop();
        }
        kept.push((y, x));
    }
    kept
}
