//! The solver on points.

use glam::DVec3;

use super::{blob, random};
use crate::{
    Connectivity,
    components::Components,
    ellipsoid::{Enclosing, Method, Options, enclose, enclosing_of, hull_corners},
    grid::ijk,
};

const METHODS: [Method; 3] = [Method::Exchange, Method::AwaySteps, Method::Khachiyan];

fn box_corners(size: DVec3) -> Vec<DVec3> {
    (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * size).collect()
}

fn highest_level(points: &[DVec3], e: &Enclosing) -> f64 {
    let inverse = e.shape.inverse();
    points.iter().map(|&p| (inverse * (p - e.center)).length_squared()).fold(0.0, f64::max)
}

#[test]
fn boxes_have_the_closed_form_with_every_method() {
    for (a, b, c) in
        [(1.0, 1.0, 1.0), (1.0, 1.0, 40.0), (40.0, 1.0, 30.0), (0.5, 7.0, 3.0), (512.0, 1.0, 1.0)]
    {
        let size = DVec3::new(a, b, c);
        for method in METHODS {
            // The corners, and many points that must not matter.
            let mut points = box_corners(size);
            let mut state = 3;
            let mut part = || f64::from(random(&mut state) % 1000) / 1000.0;
            points.extend((0..200).map(|_| DVec3::new(part(), part(), part()) * size));
            points.extend(box_corners(size));
            let options = Options { method, tolerance: 1e-10, ..Options::default() };
            let found = enclose(&points, &options).unwrap();
            let expected = size * (3_f64.sqrt() / 2.0);
            for axis in 0..3 {
                assert!(
                    (found.shape.col(axis)[axis] / expected[axis] - 1.0).abs() < 1e-9,
                    "{method:?} {size}"
                );
            }
            assert!(found.center.distance(size * 0.5) < 1e-9 * size.length());
            assert!(found.volume_bound <= 1.0 + 1e-10);
        }
    }
}

#[test]
fn methods_agree_and_bounds_hold_on_random_blobs() {
    let dims = [40, 30, 25];
    let mut state = 11;
    let mut checked = 0;
    for round in 0..12 {
        let bits = blob(dims, &mut state, 1 + round % 4);
        let components = Components::of_mask(&bits, Connectivity::default()).unwrap();
        for component in components.list() {
            let points = hull_corners(components.runs(component), component.start);
            let best = enclose(&points, &Options { tolerance: 1e-12, ..Options::default() }).unwrap();
            assert!(best.volume_bound <= 1.0 + 1e-12);
            for method in METHODS {
                let tolerance = if method == Method::Khachiyan { 1e-3 } else { 1e-7 };
                let found = enclose(&points, &Options { method, tolerance, ..Options::default() }).unwrap();
                let ratio = found.volume() / best.volume();
                assert!(found.volume_bound <= 1.0 + tolerance, "{method:?} {}", found.volume_bound);
                assert!(ratio >= 1.0 - 1e-11 && ratio <= found.volume_bound + 1e-11, "{method:?} {ratio}");
                assert!(highest_level(&points, &found) <= 1.0 + 1e-11);
                checked += 1;
            }
        }
    }
    assert!(checked > 40, "{checked}");
}

#[test]
fn stopping_early_gives_a_larger_valid_bound() {
    let bits = blob([40, 40, 40], &mut 5, 3);
    let components = Components::of_mask(&bits, Connectivity::default()).unwrap();
    let component = components.list().iter().max_by_key(|c| c.voxels).unwrap();
    let points = hull_corners(components.runs(component), component.start);
    let best = enclose(&points, &Options { tolerance: 1e-12, ..Options::default() }).unwrap();
    for method in METHODS {
        let mut least_bound = f64::INFINITY;
        for max_iterations in [0, 1, 3, 10] {
            let options = Options { method, tolerance: 1e-12, max_iterations };
            let found = enclose(&points, &options).unwrap();
            let ratio = found.volume() / best.volume();
            assert!(found.volume_bound > 1.0 + 1e-7 && ratio <= found.volume_bound, "{method:?} {ratio}");
            assert!(highest_level(&points, &found) <= 1.0 + 1e-11);
            assert_eq!(found.iterations, max_iterations);
            least_bound = least_bound.min(found.volume_bound);
        }
        assert!(least_bound < 3.0);
    }
}

#[test]
fn a_ball_of_voxels_has_a_certified_ball() {
    for radius in [1.0, 2.5, 6.0, 20.0] {
        let n = 45;
        let center = DVec3::splat(22.0);
        let bits = crate::MaskBits::from_fn([n; 3], |l| {
            let p = DVec3::new((l % n) as f64, (l / n % n) as f64, (l / (n * n)) as f64);
            p.distance(center) <= radius
        });
        let components = Components::of_mask(&bits, Connectivity::default()).unwrap();
        let component = &components.list()[0];
        let runs = components.runs(component);
        let found = enclosing_of(component, runs, &Options::default());
        assert!(found.volume_bound <= 1.0 + 1e-7);
        // By symmetry the optimum is a ball about the centre, through the farthest corner.
        let corners = hull_corners(runs, component.start);
        let center_of_box = DVec3::from(component.dims.map(|d| d as f64 / 2.0));
        let farthest = corners.iter().map(|c| c.distance(center_of_box)).fold(0.0, f64::max);
        let truth = 4.0 / 3.0 * std::f64::consts::PI * farthest.powi(3);
        assert!((found.volume() / truth - 1.0).abs() < 1e-7, "{radius}");
        assert!(found.center.distance(center_of_box) < 1e-3);
    }
}

#[test]
fn a_simplex_has_the_closed_form() {
    // Any tetrahedron is an affine image of the regular one: volume 4/3 π 3^{3/2} times sqrt(det of
    // the covariance of its four equally weighted corners).
    let mut state = 8;
    let mut next = || f64::from(random(&mut state) % 4001) / 1000.0 - 2.0;
    for _ in 0..50 {
        let corners: Vec<DVec3> = (0..4).map(|_| DVec3::new(next(), next(), next())).collect();
        let edges =
            glam::DMat3::from_cols(corners[1] - corners[0], corners[2] - corners[0], corners[3] - corners[0]);
        let mean = corners.iter().sum::<DVec3>() / 4.0;
        // det of that covariance = det(edges)² / 4⁴.
        let truth = 4.0 / 3.0 * std::f64::consts::PI * 27_f64.sqrt() * edges.determinant().abs() / 16.0;
        for method in METHODS {
            let found =
                enclose(&corners, &Options { method, tolerance: 1e-9, ..Options::default() }).unwrap();
            assert!((found.volume() / truth - 1.0).abs() < 2e-9, "{} {truth}", found.volume());
            assert!(found.center.distance(mean) < 1e-4);
        }
    }
}

#[test]
fn coplanar_points_have_no_ellipsoid() {
    let options = Options::default();
    assert_eq!(enclose(&[], &options), None);
    assert_eq!(enclose(&[DVec3::ONE; 9], &options), None);
    let line: Vec<DVec3> = (0..9).map(|i| DVec3::new(f64::from(i), f64::from(2 * i), 1.0)).collect();
    assert_eq!(enclose(&line, &options), None);
    let flat: Vec<DVec3> = (0..9).map(|i| DVec3::new(f64::from(i % 3), f64::from(i / 3), 1.0)).collect();
    assert_eq!(enclose(&flat, &options), None);
}

#[test]
fn hull_corners_include_every_extreme_corner() {
    let mut state = 21;
    for round in 0..40 {
        let dims = [9, 7, 6];
        let percent = 10 + round;
        let bits = crate::MaskBits::from_fn(dims, |_| random(&mut state) % 100 < percent);
        let components = Components::of_mask(&bits, Connectivity::default()).unwrap();
        let labels = components.labels(dims);
        for (label, component) in (1..).zip(components.list()) {
            let hull = hull_corners(components.runs(component), component.start);
            let mut every = Vec::new();
            for (l, _) in labels.iter().enumerate().filter(|(_, at)| **at == label) {
                let voxel = ijk(dims, l);
                for corner in 0..8 {
                    let at =
                        |axis: usize| (voxel[axis] - component.start[axis] + (corner >> axis & 1)) as f64;
                    every.push(DVec3::new(at(0), at(1), at(2)));
                }
            }
            // Each is a voxel corner, and no voxel corner is farther in any direction.
            assert!(hull.iter().all(|corner| every.contains(corner)));
            for _ in 0..60 {
                let mut part = || f64::from(random(&mut state) % 21) - 10.0;
                let d = DVec3::new(part(), part(), part());
                let reach = |points: &[DVec3]| points.iter().map(|p| p.dot(d)).fold(f64::MIN, f64::max);
                assert_eq!(reach(&hull), reach(&every));
            }
        }
    }
}
