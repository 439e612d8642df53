use glam::{DAffine3, DMat3, DVec3};

use super::{Approach, CellBox, Metric, Nearness, SelectedCells, boxes, segment};
use crate::{Grid, MaskBits, Progress, Sides, Tracts, grid::ijk};

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vec(&mut self, size: f64) -> DVec3 {
        DVec3::new(self.next() - 0.5, self.next() - 0.5, self.next() - 0.5) * size
    }
}

fn grid(dims: [usize; 3], matrix: DMat3, origin_mm: DVec3) -> Grid {
    Grid::new(dims, DAffine3 { matrix3: matrix, translation: origin_mm }, Sides::Known).unwrap()
}

fn rotated() -> DMat3 {
    DMat3::from_rotation_z(0.4)
        * DMat3::from_rotation_x(-0.7)
        * DMat3::from_diagonal(DVec3::new(-0.8, 1.0, 2.5))
}

fn sheared() -> DMat3 {
    rotated() * DMat3::from_cols(DVec3::X, DVec3::new(0.2, 1.0, 0.0), DVec3::new(-0.1, 0.3, 1.0))
}

/// Distance from a world point to a voxel's cell on perpendicular axes.
fn to_cell(grid: &Grid, p_mm: DVec3, ijk: [usize; 3]) -> f64 {
    let v = grid.voxel_from_world().transform_point3(p_mm);
    let center = DVec3::from_array(ijk.map(|i| i as f64));
    (((v - center).abs() - 0.5).max(DVec3::ZERO) * grid.spacing_mm()).length()
}

/// The definition, up to the step: points along every segment compared with every active voxel.
fn sampled(grid: &Grid, mask: &MaskBits, fiber: &[[f32; 3]], steps: usize) -> f64 {
    let points: Vec<DVec3> = fiber.iter().map(|&p| DVec3::from_array(p.map(f64::from))).collect();
    let dims = mask.dims();
    let mut least = f64::INFINITY;
    for ends in points.windows(2) {
        for step in 0..=steps {
            let p = ends[0].lerp(ends[1], step as f64 / steps as f64);
            mask.for_each(|l| least = least.min(to_cell(grid, p, ijk(dims, l))));
        }
    }
    least
}

/// Every segment compared with every active voxel by the method for any axes: no runs, tree or chunks.
fn brute(grid: &Grid, mask: &MaskBits, fiber: &[[f32; 3]]) -> f64 {
    let metric = Metric { perpendicular: false, ..Metric::of(grid) };
    let voxel = |p: [f32; 3]| grid.voxel_from_world().transform_point3(DVec3::from_array(p.map(f64::from)));
    let dims = mask.dims();
    let mut least = f64::INFINITY;
    for ends in fiber.windows(2) {
        mask.for_each(|l| {
            let center = DVec3::from_array(ijk(dims, l).map(|v| v as f64));
            let cell = CellBox { lo: center - 0.5, hi: center + 0.5 };
            let found = segment::to_box(voxel(ends[0]), voxel(ends[1]), &cell, &metric);
            least = least.min(found.squared_mm2.sqrt());
        });
    }
    least
}

fn fiber(random: &mut Random, points: usize, step_mm: f64, around: DVec3) -> Vec<[f32; 3]> {
    let mut p = around + random.vec(40.0);
    (0..points)
        .map(|_| {
            p += random.vec(step_mm);
            p.as_vec3().to_array()
        })
        .collect()
}

fn speckle(random: &mut Random, dims: [usize; 3], share: f64) -> MaskBits {
    MaskBits::from_fn(dims, |_| random.next() < share)
}

#[test]
fn closed_forms_on_one_box() {
    // Voxels 2..=4 along each axis of a grid of 2 mm voxels: the box from 3 to 9 mm.
    let g = Grid::axis_aligned([8; 3], DVec3::splat(2.0), DVec3::ZERO).unwrap();
    let mask = MaskBits::from_fn([8; 3], |l| [l % 8, l / 8 % 8, l / 64].iter().all(|v| (2..=4).contains(v)));
    let cells = SelectedCells::new(&g, &mask).unwrap();
    let at = |points: &[[f32; 3]]| cells.nearest(points).unwrap();
    // Beside a face, across a face, past an edge at 45°, past a corner along its tangent plane.
    let beside = at(&[[0.0, 4.0, 11.5], [20.0, 4.0, 11.5]]);
    assert_eq!((beside.distance_mm, beside.fiber_mm.z, beside.selection_mm.z), (2.5, 11.5, 9.0));
    assert!((3.0..=9.0).contains(&beside.fiber_mm.x));
    assert_eq!(at(&[[6.0, 5.0, -20.0], [6.0, 5.0, 40.0]]).distance_mm, 0.0);
    let edge = at(&[[9.0, 5.0, 13.0], [13.0, 5.0, 9.0]]);
    assert!((edge.distance_mm - 8.0_f64.sqrt()).abs() < 1e-12, "{edge:?}");
    assert!(edge.fiber_mm.distance(DVec3::new(11.0, 5.0, 11.0)) < 1e-12, "{edge:?}");
    let corner = at(&[[12.0, 10.0, 11.0], [10.0, 12.0, 11.0]]);
    assert!((corner.distance_mm - 12.0_f64.sqrt()).abs() < 1e-12, "{corner:?}");
    assert!(corner.selection_mm.distance(DVec3::splat(9.0)) < 1e-12);
    // One point; a repeated point; inside; no point.
    assert_eq!(at(&[[6.0, 12.0, 6.0]]).distance_mm, 3.0);
    assert_eq!(at(&[[6.0, 12.0, 6.0], [6.0, 12.0, 6.0]]).distance_mm, 3.0);
    let inside = at(&[[5.0, 5.0, 5.0], [6.0, 5.0, 5.0]]);
    assert_eq!((inside.distance_mm, inside.fiber_mm), (0.0, DVec3::splat(5.0)));
    assert_eq!(cells.nearest(&[]), None);
    assert!(SelectedCells::new(&g, &MaskBits::empty([8; 3])).is_none());
    assert!(SelectedCells::new(&g, &MaskBits::full([7, 8, 8])).is_none());
}

#[test]
fn a_hole_and_the_gap_between_runs_are_not_selected() {
    let g = Grid::axis_aligned([9, 9, 9], DVec3::ONE, DVec3::ZERO).unwrap();
    let full_but_the_middle = MaskBits::from_fn([9; 3], |l| l != 4 * 91);
    let cells = SelectedCells::new(&g, &full_but_the_middle).unwrap();
    let found = cells.nearest(&[[4.0, 4.0, 4.25], [4.125, 4.0, 4.25]]).unwrap();
    assert_eq!((found.distance_mm, found.selection_mm.z), (0.25, 4.5));
    // A line that ends in an active voxel and a next line that starts with one are two runs.
    let ends = MaskBits::from_fn([3, 2, 1], |l| l == 2 || l == 3);
    assert_eq!(boxes::runs(&ends).len(), 2);
    assert_eq!(boxes::runs(&MaskBits::full([130, 2, 3])).len(), 6);
}

#[test]
fn both_methods_for_a_segment_and_a_box_agree() {
    let mut random = Random(3);
    let metric = Metric::of(&grid([4; 3], rotated(), DVec3::ZERO));
    assert!(metric.perpendicular);
    for n in 0..20_000 {
        let mut a = random.vec(8.0);
        let mut b = if n % 5 == 0 { a } else { random.vec(8.0) };
        if n % 3 == 0 {
            // Along axes and on faces, where both have special cases.
            (a, b) = ((a * 2.0).round() / 2.0, (b * 2.0).round() / 2.0);
        }
        let lo = random.vec(2.0).round() - 0.5;
        let cells = CellBox { lo, hi: lo + DVec3::new(1.0 + f64::from(n % 4), 1.0, 1.0) };
        let one = segment::along_axes(a, b, &cells, &metric);
        let other = segment::any_axes(a, b, &cells, &metric);
        let (d1, d2) = (one.squared_mm2.sqrt(), other.squared_mm2.sqrt());
        assert!((d1 - d2).abs() < 1e-7, "{n}: {d1} {d2} {a} {b} {cells:?}");
        // The points that each returns are that far apart.
        for (found, d) in [(one, d1), (other, d2)] {
            let apart = (metric.mm * (a.lerp(b, found.along) - found.voxel)).length();
            assert!((apart - d).abs() < 1e-9, "{n}: {apart} {d}");
        }
    }
}

#[test]
fn nearest_equals_brute_force_on_every_kind_of_grid() {
    let mut random = Random(11);
    let far = DVec3::new(1000.0, -2000.0, 500.0);
    for (matrix, origin) in
        [(rotated(), DVec3::ZERO), (rotated(), far), (sheared(), DVec3::ZERO), (sheared(), far)]
    {
        let g = grid([12, 9, 7], matrix, origin);
        for share in [0.003, 0.05, 0.6] {
            let mask = speckle(&mut random, [12, 9, 7], share);
            let Some(cells) = SelectedCells::new(&g, &mask) else { continue };
            for points in [2, 3, 9, 40] {
                let f = fiber(&mut random, points, 6.0, g.center_mm());
                let found = cells.nearest(&f).unwrap();
                let expected = brute(&g, &mask, &f);
                assert!((found.distance_mm - expected).abs() < 1e-7, "{found:?} {expected}");
                let apart = found.fiber_mm.distance(found.selection_mm);
                assert!((apart - found.distance_mm).abs() < 1e-7, "{found:?}");
            }
        }
    }
}

#[test]
fn exact_distance_is_just_below_the_sampled_one() {
    let mut random = Random(5);
    let g = grid([6, 5, 4], rotated(), DVec3::new(10.0, 20.0, -5.0));
    for _ in 0..20 {
        let mask = speckle(&mut random, [6, 5, 4], 0.1);
        let Some(cells) = SelectedCells::new(&g, &mask) else { continue };
        let f = fiber(&mut random, 5, 10.0, g.center_mm());
        let exact = cells.nearest(&f).unwrap().distance_mm;
        let least = sampled(&g, &mask, &f, 400);
        // Half a step of segments up to 8.7 mm long.
        assert!(exact <= least + 1e-9 && least - exact < 0.011, "{exact} {least}");
    }
}

#[test]
fn nearest_of_all_keeps_the_order_and_nearness_counts() {
    let g = Grid::axis_aligned([5; 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let mask = MaskBits::from_fn([5; 3], |l| l == 62);
    let cells = SelectedCells::new(&g, &mask).unwrap();
    // The middle voxel's cell is 1.5 to 2.5 along each axis.
    let line = |z: f32| vec![[-5.0, 2.0, z], [9.0, 2.0, z]];
    let fibers = [line(5.0), vec![], line(2.25), line(2.0), line(3.5), line(-8.0)];
    let mut offsets = vec![0];
    fibers.iter().for_each(|f| offsets.push(offsets[offsets.len() - 1] + f.len() as u32));
    let tracts = Tracts::new(fibers.concat(), offsets, Sides::Known).unwrap();
    let found = cells.nearest_of_all(&tracts, &Progress::new()).unwrap();
    let distances: Vec<Option<f64>> = found.iter().map(|a| a.map(|a| a.distance_mm)).collect();
    assert_eq!(distances, [Some(2.5), None, Some(0.0), Some(0.0), Some(1.0), Some(9.5)]);
    let near = Nearness::of(&found, 2.5);
    assert_eq!((near.nearest.unwrap().0, near.through, near.within), (2, 2, 4));
    assert_eq!(Nearness::of(&found[4..], 0.5).nearest, Some((0, found[4].unwrap())));
    assert_eq!(Nearness::of(&[None], 1.0), Nearness { nearest: None, through: 0, within: 0 });
    let cancelled = Progress::new();
    cancelled.cancel();
    assert!(cells.nearest_of_all(&tracts, &cancelled).is_err());
    let Approach { fiber_mm, .. } = near.nearest.unwrap().1;
    assert!((1.5..=2.5).contains(&fiber_mm.x) && fiber_mm.z == 2.25);
}
