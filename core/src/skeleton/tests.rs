use super::*;
use crate::grid::ijk;
use glam::DMat3;

/// A shape with a known medial axis, in millimetres: `axis` gives the distance to it.
struct Shape {
    name: &'static str,
    inside: Box<dyn Fn(DVec3) -> bool>,
    axis: Box<dyn Fn(DVec3) -> f64>,
    half_mm: DVec3,
}

fn to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a.lerp(b, t))
}

fn capsule(r: f64, rotation: DMat3) -> Shape {
    let (a, b) = (rotation * DVec3::new(-2.5 * r, 0.0, 0.0), rotation * DVec3::new(2.5 * r, 0.0, 0.0));
    Shape {
        name: "capsule",
        inside: Box::new(move |p| to_segment(p, a, b) <= r),
        axis: Box::new(move |p| to_segment(p, a, b)),
        half_mm: DVec3::splat(3.6 * r),
    }
}

fn cylinder(r: f64, rotation: DMat3) -> Shape {
    let back = rotation.transpose();
    let end = 3.0 * r;
    let (a, b) = (rotation * DVec3::new(-end, 0.0, 0.0), rotation * DVec3::new(end, 0.0, 0.0));
    Shape {
        name: "cylinder",
        inside: Box::new(move |p| {
            let q = back * p;
            q.x.abs() <= end && q.y.hypot(q.z) <= r
        }),
        axis: Box::new(move |p| to_segment(p, a, b)),
        half_mm: DVec3::splat(3.7 * r),
    }
}

fn torus(r: f64, rotation: DMat3) -> Shape {
    let back = rotation.transpose();
    let ring = move |p: DVec3| {
        let q = back * p;
        (q.x.hypot(q.y) - 3.0 * r).hypot(q.z)
    };
    Shape {
        name: "torus",
        inside: Box::new(move |p| ring(p) <= r),
        axis: Box::new(ring),
        half_mm: DVec3::splat(4.2 * r),
    }
}

fn y_shape(r: f64, rotation: DMat3) -> Shape {
    let arms = [(0.0, 1.0), (0.866, -0.5), (-0.866, -0.5)]
        .map(|(x, y)| rotation * (DVec3::new(x, y, 0.0) * (4.0 * r)));
    let axis =
        move |p: DVec3| arms.iter().map(|&a| to_segment(p, DVec3::ZERO, a)).fold(f64::INFINITY, f64::min);
    Shape {
        name: "Y",
        inside: Box::new(move |p| axis(p) <= r),
        axis: Box::new(axis),
        half_mm: DVec3::splat(5.2 * r),
    }
}

fn voxelised(shape: &Shape, spacing_mm: DVec3) -> (MaskBits, Grid) {
    let dims: [usize; 3] = (shape.half_mm / spacing_mm).to_array().map(|n| 2 * n.ceil() as usize + 3);
    // Shifted off the voxel grid, as symmetry would make the test too easy.
    let shift = DVec3::new(0.13, 0.29, -0.21) * spacing_mm;
    let origin = DVec3::from_array(dims.map(|n| -((n - 1) as f64) / 2.0)) * spacing_mm + shift;
    let grid = Grid::axis_aligned(dims, spacing_mm, origin).unwrap();
    let bits = MaskBits::from_fn(dims, |l| {
        let ijk = ijk(dims, l);
        (shape.inside)(grid.center_of_voxel_mm(ijk))
    });
    (bits, grid)
}

fn of(bits: &MaskBits, grid: &Grid, level: Level) -> Skeleton {
    let options = SkeletonOptions { level, ..SkeletonOptions::default() };
    skeleton(bits, grid, &options, &Progress::new()).unwrap()
}

/// Number of connected pieces of the skeleton.
fn pieces(s: &Skeleton) -> usize {
    let mut root: Vec<usize> = (0..s.points.len()).collect();
    fn find(root: &mut [usize], mut i: usize) -> usize {
        while root[i] != i {
            root[i] = root[root[i]];
            i = root[i];
        }
        i
    }
    for w in s.lines.iter().flat_map(|l| l.windows(2)) {
        let (a, b) = (find(&mut root, w[0] as usize), find(&mut root, w[1] as usize));
        root[a.max(b)] = a.min(b);
    }
    (0..root.len()).filter(|&i| root[i] == i).count()
}

fn rotations() -> [(&'static str, DMat3); 3] {
    [
        ("straight", DMat3::IDENTITY),
        ("upright", DMat3::from_rotation_y(std::f64::consts::FRAC_PI_2)),
        ("oblique", DMat3::from_rotation_z(0.5) * DMat3::from_rotation_y(0.7)),
    ]
}

#[test]
fn skeletons_lie_on_the_true_axis_and_are_connected() {
    for spacing in [DVec3::ONE, DVec3::new(1.0, 1.0, 3.0)] {
        for radius in [3.0, 4.5, 6.0, 9.0] {
            for (rotation_name, rotation) in rotations() {
                for make in [capsule, cylinder, torus, y_shape] {
                    let shape = make(radius, rotation);
                    let (bits, grid) = voxelised(&shape, spacing);
                    let s = of(&bits, &grid, Level::Core);
                    let distances: Vec<f64> = s.points.iter().map(|p| (shape.axis)(p.position_mm)).collect();
                    let mean = distances.iter().sum::<f64>() / distances.len() as f64;
                    let max = distances.iter().fold(0.0, |a: f64, &b| a.max(b));
                    let summary = format!(
                        "{} r {radius} {rotation_name} at {spacing}: mean {mean:.2} max {max:.2} {} {:?}",
                        shape.name,
                        s.points.len(),
                        s.counts
                    );
                    println!("{summary}");
                    assert!(mean <= spacing.min_element(), "{summary}");
                    assert!(max <= spacing.length(), "{summary}");
                    assert_eq!(pieces(&s), 1, "{summary}");
                    assert_eq!(s.counts.stopped, 0, "{summary}");
                }
            }
        }
    }
}

#[test]
fn the_skeleton_of_a_torus_goes_all_around() {
    for radius in [3.0, 6.0] {
        let (bits, grid) = voxelised(&torus(radius, DMat3::IDENTITY), DVec3::ONE);
        let s = of(&bits, &grid, Level::Divergence);
        let mut covered = [false; 36];
        for p in &s.points {
            let turn_fraction = p.position_mm.y.atan2(p.position_mm.x) / std::f64::consts::TAU + 0.5;
            covered[((turn_fraction * 36.0) as usize).min(35)] = true;
        }
        // One gap is allowed: pieces are joined into a tree, which needn't close the ring.
        assert!(covered.iter().filter(|s| !**s).count() <= 6, "{radius}: {covered:?}");
    }
}

/// Directed Hausdorff distance: the largest distance of a point of `a` from the nearest of `b`.
fn directed_hausdorff(a: &[DVec3], b: &[DVec3]) -> f64 {
    let near = |p: DVec3| b.iter().map(|q| q.distance(p)).fold(f64::INFINITY, f64::min);
    a.iter().map(|&p| near(p)).fold(0.0, f64::max)
}

#[test]
fn mirrored_swapped_and_shifted_masks_have_the_same_skeleton() {
    let rotation = rotations()[2].1;
    let cases =
        [(0.0, Level::Core), (0.25, Level::Core), (0.0, Level::Divergence), (0.25, Level::Divergence)];
    for (opening, level) in cases {
        let options = SkeletonOptions { level, opening, ..SkeletonOptions::default() };
        let of = |bits: &MaskBits, grid: &Grid, _| skeleton(bits, grid, &options, &Progress::new()).unwrap();
        // The exact sum is isotropic; the tree's splits aren't.
        let most = if opening == 0.0 { 0.5 } else { 3_f64.sqrt() };
        let (bits, grid) = voxelised(&y_shape(5.0, rotation), DVec3::ONE);
        let dims = bits.dims();
        let of_dims = |dims: [usize; 3]| Grid::axis_aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap();
        let places = |s: &Skeleton| s.points.iter().map(|p| p.voxel).collect::<Vec<_>>();
        let first = places(&of(&bits, &grid, level));
        let voxel = |l: usize, d: [usize; 3]| ijk(d, l);

        let mirrored = MaskBits::from_fn(dims, |l| {
            let v = voxel(l, dims);
            bits.get([dims[0] - 1 - v[0], v[1], v[2]])
        });
        let back: Vec<DVec3> = places(&of(&mirrored, &of_dims(dims), level))
            .iter()
            .map(|p| DVec3::new((dims[0] - 1) as f64 - p.x, p.y, p.z))
            .collect();
        let swapped = MaskBits::from_fn([dims[2], dims[0], dims[1]], |l| {
            let v = voxel(l, [dims[2], dims[0], dims[1]]);
            bits.get([v[1], v[2], v[0]])
        });
        let swapped = of(&swapped, &of_dims([dims[2], dims[0], dims[1]]), level);
        let unswapped: Vec<DVec3> = places(&swapped).iter().map(|p| DVec3::new(p.y, p.z, p.x)).collect();
        for (name, other) in [("mirror", &back), ("swap", &unswapped)] {
            let (there, here) = (directed_hausdorff(&first, other), directed_hausdorff(other, &first));
            println!("{level:?} {opening} {name}: {there:.3} {here:.3} voxels");
            assert!(there.max(here) <= most, "{level:?} {opening} {name}: {there} {here}");
        }
        let wide = [dims[0] + 70, dims[1] + 3, dims[2] + 5];
        let shifted = MaskBits::from_fn(wide, |l| {
            let v = voxel(l, wide);
            let w: [usize; 3] = std::array::from_fn(|a| v[a].wrapping_sub([67, 2, 5][a]));
            (0..3).all(|a| w[a] < dims[a]) && bits.get(w)
        });
        let moved = places(&of(&shifted, &of_dims(wide), level));
        let step = DVec3::new(67.0, 2.0, 5.0);
        assert_eq!(first.len(), moved.len());
        assert!(first.iter().zip(&moved).all(|(a, b)| (*a + step).distance(*b) < 1e-9), "{level:?}");
    }
}

/// A mask of the voxels with `inside(x, y, z)`, in a box of `dims`.
fn mask_from(dims: [usize; 3], inside: impl Fn(usize, usize, usize) -> bool) -> (MaskBits, Grid) {
    let grid = Grid::axis_aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap();
    let bits = MaskBits::from_fn(dims, |l| {
        let [x, y, z] = ijk(dims, l);
        inside(x, y, z)
    });
    (bits, grid)
}

#[test]
fn thin_masks_even_thickness_and_full_images_have_connected_skeletons() {
    let box_at = |lo: [usize; 3], n: [usize; 3]| {
        move |x: usize, y: usize, z: usize| {
            [x, y, z].iter().zip(lo).zip(n).all(|((&v, lo), n)| (lo..lo + n).contains(&v))
        }
    };
    // One voxel, a line, a sheet, boxes of even thickness, and a mask that fills the image.
    for (dims, lo, n) in [
        ([3, 3, 3], [1, 1, 1], [1, 1, 1]),
        ([1, 1, 1], [0, 0, 0], [1, 1, 1]),
        ([40, 3, 3], [5, 1, 1], [30, 1, 1]),
        ([20, 20, 1], [0, 0, 0], [20, 20, 1]),
        ([6, 6, 64], [1, 1, 2], [4, 4, 60]),
        ([4, 4, 40], [1, 1, 2], [2, 2, 36]),
        ([10, 10, 10], [2, 2, 2], [6, 6, 6]),
        ([24, 24, 24], [0, 0, 0], [20, 20, 20]),
        ([20, 20, 20], [0, 0, 0], [20, 20, 20]),
    ] {
        let (bits, grid) = mask_from(dims, box_at(lo, n));
        for level in [Level::Core, Level::Divergence, Level::Boundary] {
            let s = of(&bits, &grid, level);
            assert!(!s.points.is_empty(), "{n:?}");
            assert_eq!(pieces(&s), 1, "{n:?} {level:?} {:?}", s.counts);
            assert_eq!(s.counts.stopped, 0, "{n:?} {level:?} {:?}", s.counts);
            assert!(
                s.points.iter().all(|p| grid.voxel_at(p.position_mm).is_some_and(|v| bits.get(v))),
                "{n:?}"
            );
        }
    }
    let (line, grid) = mask_from([40, 3, 3], box_at([5, 1, 1], [30, 1, 1]));
    assert_eq!(of(&line, &grid, Level::Core).points.len(), 30);
    let (tube, grid) = mask_from([6, 6, 64], box_at([1, 1, 2], [4, 4, 60]));
    let s = of(&tube, &grid, Level::Core);
    let off = |p: &SkeletonPoint| (p.voxel.x - 2.5).hypot(p.voxel.y - 2.5);
    assert!(s.points.iter().all(|p| off(p) <= 0.75), "{:?}", s.counts);
}

#[test]
fn a_ball_reduces_to_its_center_and_every_component_has_a_point() {
    let ball = |c: [f64; 3], r: f64| {
        move |x: usize, y: usize, z: usize| {
            DVec3::new(x as f64, y as f64, z as f64).distance(DVec3::from_array(c)) <= r
        }
    };
    let a = ball([12.0, 12.0, 12.0], 9.0);
    let (bits, grid) = mask_from([25, 25, 25], a);
    let s = of(&bits, &grid, Level::Core);
    let middle = DVec3::splat(12.0);
    assert!(s.points.iter().all(|p| p.voxel.distance(middle) < 1.5), "{:?}", s.counts);
    // A cavity doesn't change the skeleton.
    let (hollow, _) =
        mask_from([25, 25, 25], |x, y, z| a(x, y, z) && !ball([13.0, 11.0, 12.0], 3.0)(x, y, z));
    let hollow = of(&hollow, &grid, Level::Core);
    assert_eq!(hollow.points, s.points);
    assert!(hollow.counts.filled_voxels > 100);
    let (two, grid) = mask_from([60, 25, 25], |x, y, z| {
        a(x, y, z) || ball([40.0, 12.5, 11.0], 7.0)(x, y, z) || [x, y, z] == [58, 3, 3]
    });
    let s = of(&two, &grid, Level::Core);
    assert_eq!(pieces(&s), 3);
    assert_eq!(
        of(&MaskBits::empty([4, 4, 4]), &mask_from([4, 4, 4], |_, _, _| false).1, Level::Core).points,
        []
    );
}

#[test]
fn results_are_independent_of_thread_count_and_cancelling_stops() {
    let (bits, grid) = voxelised(&torus(5.0, rotations()[2].1), DVec3::ONE);
    let many = of(&bits, &grid, Level::Boundary);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one.install(|| of(&bits, &grid, Level::Boundary)), many);
    let progress = Progress::new();
    progress.cancel();
    let stopped = skeleton(&bits, &grid, &SkeletonOptions::default(), &progress);
    assert_eq!(stopped, Err(SkeletonError::Cancelled(Cancelled)));
}

#[test]
fn the_force_is_the_negative_potential_gradient_and_the_tree_approximates_the_sum() {
    let (bits, grid) = voxelised(&y_shape(6.0, rotations()[2].1), DVec3::new(1.0, 1.0, 2.5));
    let filled = FilledMask::new(&bits, &grid).unwrap().unwrap();
    let all = force::boundary_charges(&filled);
    let tree = Charges::new(all.clone());
    let mut list = Vec::new();
    for exponent in 4..=9 {
        let law = PowerLaw::new(exponent);
        for voxel in [[20, 20, 8], [31, 31, 13], [30, 32, 12]] {
            if !filled.bits.get(voxel) {
                continue;
            }
            let at = filled.center(voxel) + DVec3::new(0.1, 0.2, 0.3);
            let brute = all.iter().fold((DVec3::ZERO, 0.0), |(f, u), c| {
                let d = at - c.at;
                let r = d.length();
                (
                    f + d * (c.weight / r.powi(exponent as i32 + 1)),
                    u + c.weight * r.powi(1 - exponent as i32) / f64::from(exponent - 1),
                )
            });
            tree.gather(at, 0.0, 0.0, &mut list);
            assert_eq!(list.len(), all.len());
            let exact = law.sample(&list, at);
            assert!(exact.force.distance(brute.0) <= 1e-12 * brute.0.length());
            assert!((exact.potential - brute.1).abs() <= 1e-12 * brute.1);
            let h = 1e-5;
            let jacobian = law.jacobian(&list, at);
            for (a, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
                let (after, before) = (law.sample(&list, at + axis * h), law.sample(&list, at - axis * h));
                let slope = (after.potential - before.potential) / (2.0 * h);
                assert!((slope + exact.force[a]).abs() <= 1e-6 * exact.force.length(), "{exponent}");
                let bend = (after.force - before.force) / (2.0 * h);
                assert!(bend.distance(jacobian.col(a)) <= 1e-6 * jacobian.col(a).length(), "{exponent}");
            }
            tree.gather(at, 0.0, 0.25, &mut list);
            assert!(list.len() < all.len());
            let near = law.sample(&list, at);
            let error = near.force.distance(exact.force) / exact.force.length();
            assert!(error <= 2e-2, "{exponent}: {error}");
            let error = (near.potential - exact.potential) / exact.potential;
            assert!(error.abs() <= 2e-2, "{exponent}: {error}");
        }
    }
}
