use std::collections::HashMap;
use std::f64::consts::PI;

use super::super::faces::{MeshError, corners_of, faces_of};
use super::*;
use crate::surface::surface_elements;

const KINDS: [SurfaceKind; 2] = [SurfaceKind::VoxelFaces, SurfaceKind::Smoothed];

/// How often each edge is used, from its lower vertex to the higher and back; fails where these differ.
fn uses_of_edges(mesh: &Mesh) -> Vec<u32> {
    let mut uses = HashMap::<[u32; 2], [u32; 2]>::new();
    for &[a, b, c] in mesh.triangles() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            uses.entry([from.min(to), from.max(to)]).or_default()[usize::from(from < to)] += 1;
        }
    }
    assert!(uses.values().all(|[down, up]| down == up), "not closed");
    uses.into_values().map(|[_, up]| 2 * up).collect()
}

fn volume_mm3(mask: &Mask) -> f64 {
    mask.voxels() as f64 * mask.grid().voxel_volume_mm3()
}

#[test]
fn one_voxel_is_a_box_of_12_triangles() {
    for grid in grids([3, 4, 5]) {
        let mask = at_voxels(&grid, &[[1, 0, 4]]);
        for kind in KINDS {
            let mesh = surface(&mask, kind);
            assert_eq!((mesh.positions_mm().len(), mesh.triangles().len()), (8, 12));
            assert!(uses_of_edges(&mesh).iter().all(|&n| n == 2));
            assert!((mesh.volume_mm3() / volume_mm3(&mask) - 1.0).abs() < 1e-12);
            // Its smoothed corners have returned by the same way.
            let mut expected = grid.crop([1, 0, 4], [1; 3]).unwrap().corners_mm().to_vec();
            for p in mesh.positions_mm() {
                expected.retain(|corner| corner.distance(*p) > 1e-9);
            }
            assert!(expected.is_empty(), "{kind:?}: {expected:?}");
        }
    }
}

#[test]
fn every_mask_is_closed_and_has_the_volume_of_its_voxels() {
    for (seed, dims) in [[1, 1, 1], [7, 6, 5], [66, 3, 4], [130, 2, 1]].into_iter().enumerate() {
        for percent in [4, 30, 50, 80, 98, 100] {
            let bits = random(dims, percent, seed as u64 + percent);
            for grid in grids(dims) {
                let mask = mask_of(&grid, bits.clone());
                if mask.voxels() == 0 {
                    continue;
                }
                for kind in KINDS {
                    let mesh = surface(&mask, kind);
                    uses_of_edges(&mesh);
                    assert_eq!(mesh.triangles().len(), 2 * surface_elements(&bits, &grid).len());
                    let error = mesh.volume_mm3() / volume_mm3(&mask) - 1.0;
                    assert!(error.abs() < 1e-12, "{dims:?} {percent} % {kind:?}: {error}");
                }
            }
        }
    }
}

/// On each triangle's inner side is an active voxel, on its outer side none.
#[test]
fn triangles_face_outwards_on_any_grid() {
    let dims = [9, 8, 7];
    let bits = random(dims, 60, 3);
    for grid in grids(dims) {
        let mask = mask_of(&grid, bits.clone());
        let mesh = surface(&mask, SurfaceKind::VoxelFaces);
        for &triangle in mesh.triangles() {
            let [a, b, c] = corners_of(mesh.positions_mm(), triangle);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let active = |side: f64| {
                let at = (a + b + c) / 3.0 + normal * (1e-3 * side);
                grid.voxel_at(at).is_some_and(|voxel| bits.get(voxel))
            };
            assert!(active(-1.0) && !active(1.0), "{grid:?}");
        }
    }
}

#[test]
fn a_full_block_has_the_counted_triangles() {
    let grid = Grid::axis_aligned([64; 3], DVec3::new(1.0, 1.0, 12.0), DVec3::ZERO).unwrap();
    let mask = mask_of(&grid, MaskBits::full([64; 3]));
    for kind in KINDS {
        let mesh = surface(&mask, kind);
        assert_eq!((mesh.positions_mm().len(), mesh.triangles().len()), (6 * 64 * 64 + 2, 12 * 64 * 64));
        assert!(uses_of_edges(&mesh).iter().all(|&n| n == 2));
        assert!((mesh.volume_mm3() / volume_mm3(&mask) - 1.0).abs() < 1e-12);
    }
}

/// At a shared edge four triangles meet, two in either direction; a shared corner is one vertex.
#[test]
fn voxels_that_touch_at_an_edge_or_a_corner_are_closed() {
    for grid in grids([4; 3]) {
        for (other, vertices, edges_of_four) in [([2, 2, 1], 14, 1), ([2, 2, 2], 15, 0), ([3, 1, 1], 16, 0)] {
            let mask = at_voxels(&grid, &[[1, 1, 1], other]);
            for kind in KINDS {
                let mesh = surface(&mask, kind);
                assert_eq!(mesh.positions_mm().len(), vertices);
                let uses = uses_of_edges(&mesh);
                assert_eq!(uses.iter().filter(|&&n| n == 4).count(), edges_of_four);
                assert!((mesh.volume_mm3() / volume_mm3(&mask) - 1.0).abs() < 1e-12, "{other:?} {kind:?}");
            }
        }
    }
}

/// 1 km away a millimetre has 33 bits: coordinates are rounded by up to 1e-10 mm.
#[test]
fn a_distant_grid_costs_no_more_than_the_digits_of_its_coordinates() {
    let far = DVec3::new(1e6, -1e6, 1e6);
    let grid = Grid::axis_aligned([9, 8, 7], DVec3::new(0.7, 0.9, 3.1), far).unwrap();
    let mask = mask_of(&grid, random([9, 8, 7], 70, 5));
    for kind in KINDS {
        let mesh = surface(&mask, kind);
        uses_of_edges(&mesh);
        assert!((mesh.volume_mm3() / volume_mm3(&mask) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn empty_too_large_and_cancelled_are_errors() {
    let grid = Grid::axis_aligned([3; 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let empty = mask_of(&grid, MaskBits::empty([3; 3]));
    let one = at_voxels(&grid, &[[1; 3]]);
    let cancelled = Progress::new();
    cancelled.cancel();
    for kind in KINDS {
        assert_eq!(mesh(&empty, kind, &Progress::new()), Err(MeshError::Empty));
        assert_eq!(mesh(&one, kind, &cancelled), Err(MeshError::Cancelled(crate::Cancelled)));
    }
    let faces = |max| faces_of(one.bits(), false, max, &Progress::new()).map(|faces| faces.corners.len());
    assert_eq!((faces(8), faces(7)), (Ok(8), Err(MeshError::TooLarge { max_vertices: 7 })));
    let progress = Progress::new();
    mesh(&one, SurfaceKind::Smoothed, &progress).unwrap();
    assert_eq!(progress.fraction(), Some(1.0));
}

/// The voxels whose centres are in a ball about the origin, off every symmetry of the grid.
fn ball(radius_mm: f64, spacing_mm: DVec3) -> Mask {
    let dims = spacing_mm.to_array().map(|mm| (2.0 * radius_mm / mm) as usize + 6);
    let half = DVec3::from_array(dims.map(|n| n as f64 * 0.5));
    let origin = (DVec3::new(0.37, 0.21, 0.44) - half) * spacing_mm;
    let grid = Grid::axis_aligned(dims, spacing_mm, origin).unwrap();
    let inside = |linear| grid.center_of_voxel_mm(grid.ijk(linear)).length() <= radius_mm;
    mask_of(&grid, MaskBits::from_fn(dims, inside))
}

/// Mean distance from the sphere over the area, and the area over the sphere's.
fn error_of(mesh: &Mesh, radius_mm: f64) -> (f64, f64) {
    let (mut area, mut distance) = (0.0, 0.0);
    for &triangle in mesh.triangles() {
        let [a, b, c] = corners_of(mesh.positions_mm(), triangle);
        let mm2 = (b - a).cross(c - a).length() / 2.0;
        let points = [[1.0, 1.0, 1.0], [2.0, 0.5, 0.5], [0.5, 2.0, 0.5], [0.5, 0.5, 2.0]];
        let off = points.map(|[l, m, n]| (((a * l + b * m + c * n) / 3.0).length() - radius_mm).abs());
        area += mm2;
        distance += mm2 * off.iter().sum::<f64>() / 4.0;
    }
    (distance / area, area / (4.0 * PI * radius_mm * radius_mm))
}

/// The numbers in the documentation of [`mesh`].
#[test]
fn smoothed_balls_are_near_their_spheres() {
    for radius in [5.0, 10.0, 20.0, 40.0] {
        let mask = ball(radius, DVec3::ONE);
        let (faces, faces_area) = error_of(&surface(&mask, SurfaceKind::VoxelFaces), radius);
        assert!((0.22..0.24).contains(&faces) && (1.48..1.52).contains(&faces_area), "{faces} {faces_area}");
        let smooth = surface(&mask, SurfaceKind::Smoothed);
        let (distance, area) = error_of(&smooth, radius);
        assert!(distance < 0.097 && (1.0..1.03).contains(&area), "{radius}: {distance} {area}");
        assert!((smooth.volume_mm3() / (4.0 / 3.0 * PI * radius.powi(3)) - 1.0).abs() < 0.009);
        // Slices of 4 mm.
        let mask = ball(radius, DVec3::new(1.0, 1.0, 4.0));
        let (distance, area) = error_of(&surface(&mask, SurfaceKind::Smoothed), radius);
        assert!(distance < 0.34 && area < 1.12, "{radius}: {distance} {area}");
    }
}

/// A sheet and a line one voxel thin, at least one voxel from their rims.
#[test]
fn what_is_one_voxel_thin_stays() {
    let grid = Grid::axis_aligned([30, 30, 5], DVec3::ONE, DVec3::ZERO).unwrap();
    let in_sheet = |v: [usize; 3]| v[2] == 2 && v[0] > 1 && v[0] < 28 && v[1] > 1 && v[1] < 28;
    let sheet = mask_of(&grid, MaskBits::from_fn([30, 30, 5], |l| in_sheet(grid.ijk(l))));
    let mesh = surface(&sheet, SurfaceKind::Smoothed);
    let middle = |p: &&DVec3| p.x > 10.0 && p.x < 19.0 && p.y > 10.0 && p.y < 19.0;
    let off = |p: &DVec3| ((p.z - 2.0).abs() - 0.5).abs();
    let farthest = mesh.positions_mm().iter().filter(middle).map(off).fold(0.0, f64::max);
    assert!(farthest < 0.02, "{farthest}");

    // A line beside a block, which decides how far its part of the surface is moved.
    let in_both = |v: [usize; 3]| (v[0] < 12 && v[1] < 12) || (v[1] == 5 && v[2] == 2 && v[0] < 28);
    let both = mask_of(&grid, MaskBits::from_fn([30, 30, 5], |l| in_both(grid.ijk(l))));
    let mesh = surface(&both, SurfaceKind::Smoothed);
    let line = mesh.positions_mm().iter().filter(|p| p.x > 14.0);
    for p in line {
        assert!((p.y - 5.0).abs() > 0.09 && (p.z - 2.0).abs() > 0.09, "{p}");
    }
    assert!((mesh.volume_mm3() / volume_mm3(&both) - 1.0).abs() < 1e-12);
}

/// A cavity of 27 voxels in a block of 11³ is a part of its own: 27 mm³ are enclosed by the triangles near it.
#[test]
fn a_cavity_keeps_its_volume() {
    let grid = Grid::axis_aligned([11; 3], DVec3::ONE, DVec3::splat(-5.0)).unwrap();
    let hollow = |linear: usize| ijk([11; 3], linear).iter().any(|&v| v.abs_diff(5) > 1);
    let mask = mask_of(&grid, MaskBits::from_fn([11; 3], hollow));
    let mesh = surface(&mask, SurfaceKind::Smoothed);
    uses_of_edges(&mesh);
    let inner = mesh.triangles().iter().map(|&t| corners_of(mesh.positions_mm(), t));
    let inner = inner.filter(|[a, _, _]| a.abs().max_element() < 3.0);
    let volume = inner.map(|[a, b, c]| a.dot(b.cross(c))).sum::<f64>() / 6.0;
    assert!((volume + 27.0).abs() < 1e-10, "{volume}");
}
