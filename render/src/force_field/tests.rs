//! The force on Mesa's software adapter, compared with core's exact sum in f64. A missing adapter fails.

use glam::{DMat3, DVec3};
use glioscope_core::{
    Grid, MaskBits, Progress,
    grid::ijk,
    skeleton::{
        Charge, ForceSource, ForceTask, Level, Refused, Skeleton, SkeletonOptions, force_field,
        force_field_with, skeleton, skeleton_with,
    },
};

use crate::{
    ForceField,
    testing::{GPU, small_device},
};

const EXACT: SkeletonOptions =
    SkeletonOptions { level: Level::Core, exponent: 5, opening: 0.0, coarse: 1, divergence_part: 0.3 };

fn device() -> ForceField {
    ForceField::new(&GPU).unwrap()
}

/// Voxels within `radius_mm` of a segment along x of the given half length, around the grid's centre.
fn capsule(
    radius_mm: f64,
    half_mm: f64,
    spacing_mm: DVec3,
    turn: DMat3,
    origin_mm: DVec3,
) -> (MaskBits, Grid) {
    let size = DVec3::new(radius_mm + half_mm, radius_mm, radius_mm);
    let reach = if turn == DMat3::IDENTITY { size } else { DVec3::splat(size.length()) };
    let dims = (reach * 2.0 / spacing_mm).to_array().map(|n| n.ceil() as usize + 3);
    let affine = glam::DAffine3 { matrix3: turn * DMat3::from_diagonal(spacing_mm), translation: origin_mm };
    let grid = Grid::new(dims, affine, glioscope_core::Sides::Unknown).unwrap();
    let middle = (grid.center_of_voxel_mm([0; 3]) + grid.center_of_voxel_mm(dims.map(|n| n - 1))) * 0.5
        + DVec3::new(0.13, 0.29, -0.21);
    let bits = MaskBits::from_fn(dims, |l| {
        let p = grid.center_of_voxel_mm(ijk(dims, l)) - middle;
        p.distance(DVec3::new(p.x.clamp(-half_mm, half_mm), 0.0, 0.0)) <= radius_mm
    });
    (bits, grid)
}

fn shapes() -> Vec<(&'static str, MaskBits, Grid)> {
    let oblique = DMat3::from_rotation_z(0.5) * DMat3::from_rotation_y(0.7);
    let straight = DMat3::IDENTITY;
    let made = [
        ("ball", capsule(9.0, 0.0, DVec3::ONE, straight, DVec3::ZERO)),
        ("capsule", capsule(5.0, 9.0, DVec3::ONE, straight, DVec3::ZERO)),
        ("oblique capsule", capsule(5.0, 9.0, DVec3::ONE, oblique, DVec3::ZERO)),
        ("1:12", capsule(10.0, 14.0, DVec3::new(0.5, 0.5, 6.0), straight, DVec3::ZERO)),
        ("at 1e6 mm", capsule(5.0, 9.0, DVec3::ONE, oblique, DVec3::new(1e6, -1e6, 1e6))),
    ];
    made.map(|(name, (bits, grid))| (name, bits, grid)).to_vec()
}

/// Sorted angles in degrees, and the largest difference relative to the largest force.
fn difference(exact: &[DVec3], found: &[DVec3]) -> (Vec<f64>, f64) {
    assert_eq!(exact.len(), found.len());
    // A vanishing force has no direction.
    let mut angles: Vec<f64> = (exact.iter().zip(found))
        .filter(|(e, _)| e.length() > 1e-6)
        .map(|(e, f)| e.cross(*f).length().atan2(e.dot(*f)).to_degrees())
        .collect();
    angles.sort_by(f64::total_cmp);
    let largest = exact.iter().map(|e| e.length()).fold(0.0, f64::max);
    let worst = exact.iter().zip(found).map(|(e, f)| e.distance(*f)).fold(0.0, f64::max);
    (angles, worst / largest)
}

#[test]
fn the_device_s_force_equals_the_exact_sum() {
    let device = device();
    for (name, bits, grid) in shapes() {
        // Every exponent on one shape, the default on all.
        for exponent in if name == "capsule" { 4..=9 } else { 5..=5 } {
            let options = SkeletonOptions { exponent, ..EXACT };
            let exact = force_field(&bits, &grid, &options, &Progress::new()).unwrap();
            let found = force_field_with(&bits, &grid, &options, Some(&device), &Progress::new()).unwrap();
            assert!(
                found.used.to_string().starts_with("graphics device, exact sum"),
                "{name}: {}",
                found.used
            );
            let (angles, worst) = difference(&exact.forces, &found.forces);
            let at = |part: usize| angles[(angles.len() - 1) * part / 100];
            println!(
                "{name}, m = {exponent}: {} places, angle {:.1e}° {:.1e}° {:.1e}°, {worst:.1e} of the greatest",
                angles.len(),
                at(50),
                at(95),
                at(100)
            );
            assert!(angles.len() > 1000, "{name}: {} places", angles.len());
            assert!(at(95) < 1e-4 && at(100) < 5e-3 && worst < 1e-5, "{name}, m = {exponent}");
        }
    }
}

fn farthest(from: &Skeleton, to: &Skeleton) -> f64 {
    let nearest =
        |p: DVec3| to.points.iter().map(|q| q.position_mm.distance(p)).fold(f64::INFINITY, f64::min);
    from.points.iter().map(|p| nearest(p.position_mm)).fold(0.0, f64::max)
}

#[test]
fn the_skeleton_equals_that_of_the_exact_sum() {
    let device = device();
    for (name, bits, grid) in shapes() {
        // Lines too, not only centres.
        let options = SkeletonOptions { level: Level::Divergence, ..EXACT };
        let exact = skeleton(&bits, &grid, &options, &Progress::new()).unwrap();
        let found = skeleton_with(&bits, &grid, &options, Some(&device), &Progress::new()).unwrap();
        let off = farthest(&found, &exact).max(farthest(&exact, &found));
        println!("{name}: {} and {} points, {off:.4} mm", exact.points.len(), found.points.len());
        assert!(off <= 0.5 * grid.spacing_mm().min_element(), "{name}: {off} mm");
    }
}

#[test]
fn tasks_past_the_device_s_limits_are_left_to_the_tree_with_a_reason() {
    let (bits, grid) = capsule(9.0, 0.0, DVec3::ONE, DMat3::IDENTITY, DVec3::ZERO);
    let options = SkeletonOptions::default();
    let tree = skeleton(&bits, &grid, &options, &Progress::new()).unwrap();
    let small = skeleton_with(
        &bits,
        &grid,
        &options,
        Some(&ForceField::new(&small_device(10_000)).unwrap()),
        &Progress::new(),
    )
    .unwrap();
    assert_eq!(small.points, tree.points);
    let source = small.force.to_string();
    assert!(
        source.starts_with("tree, θ 0.25 (") && source.contains("charges") && source.contains("10000"),
        "{source}"
    );

    let device = device();
    let why = |charges: &[Charge], places: &[DVec3], exponent: u32| {
        let task = ForceTask { charges, places, exponent };
        match device.forces(&task, &Progress::new()) {
            Err(Refused::Because(why)) => why,
            other => panic!("{other:?}"),
        }
    };
    let charge = |at: DVec3| Charge { at, weight: 1.0 };
    let many = why(&vec![charge(DVec3::ZERO); 200_000], &vec![DVec3::ONE; 100_000], 5);
    assert!(many.contains("20000000000 pairs"), "{many}");
    let long = why(&[charge(DVec3::ZERO)], &[DVec3::new(1e5, 0.0, 0.0)], 5);
    assert!(long.contains("100000 finest spacings long"), "{long}");
    let deep = why(&[charge(DVec3::ZERO)], &[DVec3::splat(4000.0)], 9);
    assert!(deep.contains("deep") && deep.contains("exponent 9"), "{deep}");
    let bad = why(&[charge(DVec3::ZERO)], &[DVec3::splat(f64::NAN); 2], 5);
    assert!(bad.contains("no numbers"), "{bad}");
    let none = why(&[charge(DVec3::ZERO)], &[], 5);
    assert!(none.contains("no place"), "{none}");
    let progress = Progress::new();
    progress.cancel();
    let stopped = device.forces(
        &ForceTask { charges: &[charge(DVec3::ZERO)], places: &[DVec3::ONE], exponent: 5 },
        &progress,
    );
    assert!(matches!(stopped, Err(Refused::Cancelled(_))), "{stopped:?}");
}

#[test]
fn parts_of_the_work_sum_to_the_whole() {
    // More places and more charges than one dispatch takes.
    let at = |n: usize, of: f64| {
        let n = n as f64;
        DVec3::new((n * 0.618_034).fract(), (n * 0.414_214).fract(), (n * 0.732_051).fract()) * of
    };
    let charges: Vec<Charge> = (0..5000).map(|n| Charge { at: at(n, 4.0) + 10.0, weight: 0.5 }).collect();
    let places: Vec<DVec3> = (0..(1 << 16) + 300).map(|n| at(n, 8.0)).collect();
    let task = ForceTask { charges: &charges, places: &places, exponent: 5 };
    let found = device().forces(&task, &Progress::new()).unwrap();
    assert_eq!(found.len(), places.len());
    for n in [0, 1, 127, 128, 65_535, 65_536, 65_700, places.len() - 1] {
        let x = places[n];
        let sum: DVec3 = charges.iter().map(|c| (x - c.at) * 0.5 / x.distance(c.at).powi(6)).sum();
        let nearest = charges.iter().map(|c| x.distance(c.at)).fold(f64::INFINITY, f64::min);
        let exact = sum * nearest.powi(5);
        assert!(found[n].distance(exact) < 1e-5 * exact.length(), "{n}: {} {exact}", found[n]);
    }
}
