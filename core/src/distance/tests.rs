use glam::DAffine3;

use super::*;
use crate::{Sides, grid::ijk};

struct Random(u64);

impl Random {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }

    fn mask(&mut self, dims: [usize; 3], per_mille: u64) -> MaskBits {
        MaskBits::from_fn(dims, |_| self.below(1000) < per_mille)
    }
}

fn grid(dims: [usize; 3], spacing_mm: [f64; 3]) -> Grid {
    Grid::axis_aligned(dims, DVec3::from_array(spacing_mm), DVec3::new(1e6, -3.0, 7.0)).unwrap()
}

fn active(mask: &MaskBits) -> Vec<[usize; 3]> {
    let dims = mask.dims();
    let mut list = Vec::new();
    mask.for_each(|l| list.push(ijk(dims, l)));
    list
}

fn voxels(crop: Crop) -> impl Iterator<Item = [usize; 3]> {
    let [nx, ny, nz] = crop.dims;
    let s = crop.start;
    (0..nx * ny * nz).map(move |l| [s[0] + l % nx, s[1] + l / nx % ny, s[2] + l / (nx * ny)])
}

/// Smallest distance and the first site in memory at that distance, by brute force.
fn brute(sites: &[[usize; 3]], ijk: [usize; 3], distance_mm: impl Fn([f64; 3]) -> f64) -> (f64, [usize; 3]) {
    sites.iter().fold((f64::INFINITY, [usize::MAX; 3]), |best, &site| {
        let d = distance_mm(std::array::from_fn(|a| ijk[a] as f64 - site[a] as f64));
        if d < best.0 { (d, site) } else { best }
    })
}

/// Compares all voxels of the crop with brute force, bit for bit; the site too if `exact`: all
/// squares are then exact in `f64`, and so are ties.
fn equals_brute_force(mask: &MaskBits, grid: &Grid, crop: Crop, exact: bool) {
    let s = grid.spacing_mm();
    let formula = |d: [f64; 3]| {
        (((s.x * s.x) * (d[0] * d[0]) + (s.y * s.y) * (d[1] * d[1])) + (s.z * s.z) * (d[2] * d[2])).sqrt()
    };
    let sites = active(mask);
    let transform = FeatureTransform::of(mask, grid, crop).unwrap().unwrap();
    for ijk in voxels(crop) {
        let (distance, site) = brute(&sites, ijk, formula);
        let context = format!("{ijk:?} of {:?} at {s}, {} sites", grid.dims(), sites.len());
        assert_eq!(transform.distance_mm(ijk).unwrap().to_bits(), distance.to_bits(), "{context}");
        let found = transform.nearest(ijk).unwrap();
        assert!(mask.get(found), "{context}");
        if exact {
            assert_eq!(found, site, "{context}");
        }
    }
}

const SPACINGS: [([f64; 3], bool); 8] = [
    ([1.0, 1.0, 1.0], true),
    ([0.5, 0.5, 6.0], true),
    ([1.0, 1.0, 12.0], true),
    ([12.0, 0.5, 1.0], true),
    ([std::f64::consts::SQRT_2, std::f64::consts::PI, 1.732_050_807_568_877_2], false),
    ([0.1, 0.3, 0.7], false),
    ([0.937_5, 0.937_5, 1.2], false),
    ([1e-4, 3.1, 1e3], false),
];

#[test]
fn random_masks_equal_brute_force_bit_for_bit() {
    let mut random = Random(1);
    for dims in [[1, 1, 1], [1, 9, 8], [9, 1, 8], [9, 8, 1], [1, 1, 30], [40, 1, 1], [13, 11, 9], [66, 7, 5]]
    {
        for (spacing, exact) in SPACINGS {
            for per_mille in [3, 30, 300] {
                let mut mask = random.mask(dims, per_mille);
                mask.set(dims.map(|n| random.below(n as u64) as usize));
                let grid = grid(dims, spacing);
                equals_brute_force(&mask, &grid, Crop::whole(&grid), exact);
            }
        }
    }
}

#[test]
fn all_sizes_spacings_and_threads_equal_brute_force() {
    let mut random = Random(29);
    // Widths about a tile of columns and a word of the mask; whole, nearly whole and odd spacings.
    let spacings = [
        ([0.7; 3], false),
        ([1.0, 1.0, 1.2], false),
        ([0.488_281_25, 0.488_281_25, 5.0], true),
        ([3.0, 2.0, 1.0], true),
        ([1e-3, 1e-3, 1.0], false),
        ([1.0, 4096.0, 1.0], true),
        ([1e80; 3], false),
        ([0.699_999_988_079_071; 3], false),
    ];
    for trial in 0..160 {
        let (spacing, exact) = if trial % 2 == 0 { spacings[trial / 2 % 8] } else { SPACINGS[trial / 2 % 8] };
        let longest = [3, 18, 12, 70][trial / 16 % 4];
        let mut dims: [usize; 3] = std::array::from_fn(|_| 1 + random.below(12) as usize);
        dims[trial % 3] = 1 + random.below(longest) as usize;
        let mut mask = random.mask(dims, [0, 8, 60, 500, 900][trial % 5]);
        mask.set(dims.map(|n| random.below(n as u64) as usize));
        let grid = grid(dims, spacing);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1 + trial % 3).build().unwrap();
        pool.install(|| equals_brute_force(&mask, &grid, Crop::whole(&grid), exact));
    }
}

#[test]
fn whole_weights_are_found_and_refused() {
    let found = |dims: [usize; 3], spacing: [f64; 3]| {
        integers::whole_weights(Crop { start: [0; 3], dims }, spacing.map(|s| s * s))
    };
    assert_eq!(found([9; 3], [1.0; 3]), Some([1; 3]));
    assert_eq!(found([9; 3], [0.9375; 3]), Some([1; 3]));
    assert_eq!(found([240, 240, 155], [0.5, 0.5, 6.0]), Some([1, 1, 144]));
    assert_eq!(found([9; 3], [1.0, 1.5, 2.0]), Some([4, 9, 16]));
    assert_eq!(found([9; 3], [2_f64.powi(-300), 2_f64.powi(-300), 2_f64.powi(-299)]), Some([1, 1, 4]));
    // Squares that `f64` rounds; sums that would leave `i32`.
    assert_eq!(found([9; 3], [0.7; 3]), None);
    assert_eq!(found([9; 3], [1e-100, 1e100, 1.0]), None);
    assert_eq!(found([23_169, 100, 1], [1.0; 3]), Some([1; 3]));
    assert_eq!(found([23_171, 1, 1], [1.0; 3]), None);
}

#[test]
fn lines_too_long_for_integer_weights_equal_brute_force() {
    for n in [23_000, 70_000] {
        for axis in 0..3 {
            let mut dims = [1; 3];
            dims[axis] = n;
            let mut mask = MaskBits::empty(dims);
            let at = |v: usize| std::array::from_fn(|a| if a == axis { v } else { 0 });
            for v in [7, n / 2, n - 1] {
                mask.set(at(v));
            }
            let grid = grid(dims, [1.0; 3]);
            equals_brute_force(&mask, &grid, Crop::whole(&grid), true);
        }
    }
}

#[test]
fn distances_mm_equals_distance_mm_of_each_voxel() {
    let dims = [33, 21, 14];
    let mut mask = MaskBits::empty(dims);
    let mut random = Random(31);
    for _ in 0..12 {
        mask.set([9, 6, 3].map(|lo| lo + random.below(7) as usize));
    }
    let grid = grid(dims, [0.7, 0.8, 2.5]);
    let transform = FeatureTransform::of(&mask, &grid, Crop::around(&[&mask], 5).unwrap()).unwrap().unwrap();
    let all = transform.distances_mm();
    let single: Vec<f32> =
        voxels(transform.crop()).map(|ijk| transform.distance_mm(ijk).unwrap() as f32).collect();
    assert_eq!(all, single);
}

#[test]
fn sites_on_a_sphere_tie_and_equal_brute_force() {
    // Sites at nearly equal distance from the centre: the envelope's worst case.
    let dims = [19, 19, 19];
    for (spacing, exact) in SPACINGS {
        let mask = MaskBits::from_fn(dims, |l| {
            let d = [l % 19, l / 19 % 19, l / 361].map(|v| v as i64 - 9);
            let r2: i64 = d.iter().map(|v| v * v).sum();
            (79..=83).contains(&r2)
        });
        let grid = grid(dims, spacing);
        equals_brute_force(&mask, &grid, Crop::whole(&grid), exact);
    }
}

#[test]
fn empty_single_voxel_and_full_masks() {
    let dims = [7, 6, 5];
    let grid = grid(dims, [1.0, 2.0, 3.0]);
    let whole = Crop::whole(&grid);
    assert!(FeatureTransform::of(&MaskBits::empty(dims), &grid, whole).unwrap().is_none());
    let all = FeatureTransform::of(&MaskBits::full(dims), &grid, whole).unwrap().unwrap();
    for ijk in voxels(whole) {
        assert_eq!((all.nearest(ijk), all.distance_mm(ijk)), (Some(ijk), Some(0.0)));
    }
    let mut one = MaskBits::empty(dims);
    one.set([2, 3, 4]);
    equals_brute_force(&one, &grid, whole, true);
    let one = FeatureTransform::of(&one, &grid, whole).unwrap().unwrap();
    assert_eq!(one.distance_mm([4, 3, 0]), Some(148.0_f64.sqrt()));
    assert_eq!(one.nearest([7, 0, 0]), None);
    assert_eq!(one.distance_mm([0, 0, 5]), None);
}

#[test]
fn crops_use_grid_indices_and_have_no_distances_outside() {
    let dims = [30, 24, 20];
    let grid = grid(dims, [0.5, 0.5, 6.0]);
    let mut random = Random(5);
    let mut mask = MaskBits::empty(dims);
    for _ in 0..25 {
        mask.set([9, 6, 8].map(|lo| lo + random.below(7) as usize));
    }
    let crop = Crop::around(&[&mask, &MaskBits::empty(dims)], 4).unwrap();
    let (start, size) = mask.bounds().unwrap();
    assert_eq!(crop, Crop { start: start.map(|v| v - 4), dims: size.map(|v| v + 8) });
    equals_brute_force(&mask, &grid, crop, true);
    let transform = FeatureTransform::of(&mask, &grid, crop).unwrap().unwrap();
    assert_eq!(transform.crop(), crop);
    assert_eq!(transform.distance_mm([0, 0, 0]), None);
    // A margin past the border is clipped; without an active voxel there is no crop.
    assert_eq!(Crop::around(&[&mask], usize::MAX), Some(Crop::whole(&grid)));
    assert_eq!(Crop::around(&[&MaskBits::empty(dims)], 1), None);
    assert_eq!(Crop::around(&[], 1), None);
}

#[test]
fn invalid_input_gives_the_matching_error() {
    let dims = [6, 5, 4];
    let mask = MaskBits::full(dims);
    let here = grid(dims, [1.0; 3]);
    let other = MaskBits::full([6, 5, 3]);
    let whole = Crop::whole(&here);
    let error = |sites: &MaskBits, grid: &Grid, crop| FeatureTransform::of(sites, grid, crop).unwrap_err();
    assert!(matches!(error(&other, &here, whole), DistanceError::Dims { .. }));
    for crop in [
        Crop { start: [1, 0, 0], dims },
        Crop { start: [0; 3], dims: [6, 0, 4] },
        Crop { start: [usize::MAX, 0, 0], dims },
    ] {
        assert!(matches!(error(&mask, &here, crop), DistanceError::Crop { .. }));
    }
    let part = Crop { start: [0; 3], dims: [6, 5, 3] };
    assert_eq!(error(&mask, &here, part), DistanceError::SitesOutside(part));
    let tiny = grid(dims, [1e-200; 3]);
    assert!(matches!(error(&mask, &tiny, whole), DistanceError::Spacing(_)));
    let message = error(&other, &here, whole).to_string();
    assert_eq!(message, "found sites of [6, 5, 3] voxels, expected the grid's [6, 5, 4]");
}

#[test]
fn rotated_and_mirrored_axes_keep_millimetres() {
    let m = DMat3::from_rotation_x(0.4) * DMat3::from_rotation_z(1.1);
    let m = m * DMat3::from_diagonal(DVec3::new(-0.7, 0.9, 3.3));
    let dims = [11, 9, 7];
    let world_from_voxel = DAffine3 { matrix3: m, translation: DVec3::splat(40.0) };
    let grid = Grid::new(dims, world_from_voxel, Sides::Known).unwrap();
    let mask = Random(3).mask(dims, 20);
    assert!(mask.count() > 0);
    let transform = FeatureTransform::of(&mask, &grid, Crop::whole(&grid)).unwrap().unwrap();
    assert!(matches!(transform.metric, Metric::Spacing(_)));
    let sites = active(&mask);
    for ijk in voxels(Crop::whole(&grid)) {
        // In world space, independent of the transform's own formula.
        let (truth, _) = brute(&sites, ijk, |d| (m * DVec3::from_array(d)).length());
        assert!((transform.distance_mm(ijk).unwrap() - truth).abs() <= 1e-13 * truth);
    }
}

#[test]
fn sheared_grids_equal_brute_force_bit_for_bit() {
    let mut random = Random(11);
    let shear = |xy: f64, yz: f64| {
        DMat3::from_cols(DVec3::new(0.9, 0.0, 0.0), DVec3::new(xy, 1.1, 0.0), DVec3::new(0.2, yz, 3.0))
    };
    for m in
        [shear(0.5, 0.0), shear(-0.3, 1.7), shear(1e-5, 0.0), DMat3::from_rotation_y(0.3) * shear(2.0, -1.0)]
    {
        for (dims, per_mille) in [([12, 10, 8], 30), ([1, 9, 9], 100), ([15, 1, 1], 200), ([10, 9, 7], 600)] {
            let world_from_voxel = DAffine3 { matrix3: m, translation: DVec3::splat(1e6) };
            let grid = Grid::new(dims, world_from_voxel, Sides::Known).unwrap();
            let mut mask = random.mask(dims, per_mille);
            mask.set([0, 0, 0]);
            let whole = Crop::whole(&grid);
            let transform = FeatureTransform::of(&mask, &grid, whole).unwrap().unwrap();
            assert!(matches!(transform.metric, Metric::Sheared(_)));
            let sites = active(&mask);
            let at = |ijk: [usize; 3]| {
                m.x_axis * ijk[0] as f64 + m.y_axis * ijk[1] as f64 + m.z_axis * ijk[2] as f64
            };
            for ijk in voxels(whole) {
                let all = sites.iter().map(|&s| ((at(s) - at(ijk)).length_squared(), s));
                let (d2, site) = all.fold((f64::INFINITY, [0; 3]), |a, b| if b.0 < a.0 { b } else { a });
                assert_eq!(transform.distance_mm(ijk).unwrap().to_bits(), d2.sqrt().to_bits());
                assert_eq!(transform.nearest(ijk), Some(site));
            }
            let none = FeatureTransform::of(&MaskBits::empty(dims), &grid, whole).unwrap();
            assert!(none.is_none());
        }
    }
}

#[test]
fn kd_tree_equals_brute_force_with_duplicate_collinear_and_distant_points() {
    let mut random = Random(17);
    for n in [1, 2, 15, 16, 17, 33, 200, 1500] {
        // On lattices of these steps points repeat and tie; 0 puts all at one position.
        for (steps, offset) in [([0, 0, 0], 0.0), ([4, 4, 4], 1e6), ([100, 0, 0], -3.0), ([9, 1000, 30], 0.1)]
        {
            let mut point = || DVec3::from_array(steps.map(|s| offset + 0.3 * random.below(s + 1) as f64));
            let points: Vec<_> = (0..n).map(|_| point()).collect();
            let tree = KdTree::new(&points).unwrap().unwrap();
            assert_eq!(tree.len(), n);
            for q in 0..150 {
                let p = point() + if q % 3 == 0 { DVec3::ZERO } else { DVec3::new(0.15, -7.0, f64::from(q)) };
                let all = points.iter().map(|&s| (s - p).length_squared()).enumerate();
                let (index, d2) = all.fold((0, f64::INFINITY), |a, b| if b.1 < a.1 { b } else { a });
                let (found, distance) = tree.nearest(p).unwrap();
                assert_eq!((found, distance.to_bits()), (index, d2.sqrt().to_bits()));
            }
        }
    }
}

#[test]
fn kd_tree_rejects_non_finite_points() {
    assert!(KdTree::new(&[]).unwrap().is_none());
    let bad = [DVec3::ZERO, DVec3::new(0.0, f64::NAN, 0.0)];
    assert_eq!(KdTree::new(&bad).unwrap_err(), DistanceError::NotFinite(1));
    let tree = KdTree::new(&[DVec3::splat(1e308), DVec3::splat(-1e308)]).unwrap().unwrap();
    assert_eq!(tree.nearest(DVec3::splat(f64::INFINITY)), None);
    assert_eq!(tree.nearest(DVec3::splat(f64::NAN)), None);
    assert_eq!(tree.nearest(DVec3::ZERO), Some((0, f64::INFINITY)));
}

#[test]
fn thread_count_does_not_change_the_result() {
    let dims = [40, 37, 29];
    let grid = grid(dims, [0.1, 0.3, 0.7]);
    let mask = Random(23).mask(dims, 2);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| FeatureTransform::of(&mask, &grid, Crop::whole(&grid)).unwrap().unwrap().sites)
    };
    assert_eq!(with(1), with(5));
}

#[test]
#[ignore = "prints times; run with --release --nocapture"]
fn time_of_a_brain_sized_image() {
    let dims = [240, 240, 155];
    let grid = grid(dims, [1.0; 3]);
    let ball = MaskBits::from_fn(dims, |l| {
        let d = [(l % 240) as f64 - 140.0, (l / 240 % 240) as f64 - 100.0, (l / 57_600) as f64 - 80.0];
        d.iter().map(|v| v * v).sum::<f64>() < 32.0 * 32.0
    });
    let surface = crate::surface::surface_of(&ball);
    let time = |what: &str, run: &dyn Fn()| {
        let mut ms: Vec<f64> = (0..7)
            .map(|_| {
                let start = std::time::Instant::now();
                run();
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        ms.sort_by(f64::total_cmp);
        println!("{what}: median {:.1} ms, {:.1} to {:.1}", ms[3], ms[0], ms[6]);
    };
    println!("ball of {} voxels, {} of surface", ball.count(), surface.count());
    time("surface", &|| drop(std::hint::black_box(crate::surface::surface_voxels(&ball))));
    for (what, crop) in
        [("whole image", Crop::whole(&grid)), ("crop + 5", Crop::around(&[&ball], 5).unwrap())]
    {
        time(what, &|| drop(std::hint::black_box(FeatureTransform::of(&surface, &grid, crop).unwrap())));
    }
    let centers_mm: Vec<_> = active(&surface).into_iter().map(|v| grid.center_of_voxel_mm(v)).collect();
    time("k-d tree", &|| drop(std::hint::black_box(KdTree::new(&centers_mm).unwrap())));
    let tree = KdTree::new(&centers_mm).unwrap().unwrap();
    time("queries 4 mm off its surface, one by one", &|| {
        for &p in &centers_mm {
            std::hint::black_box(tree.nearest(p + DVec3::new(4.0, 0.0, 0.0)));
        }
    });
}
