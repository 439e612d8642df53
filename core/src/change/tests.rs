use super::*;
use glam::{DAffine3, DMat3};

use crate::{Mask, Sides, distance::KdTree, grid::ijk, phantom, resample, surface::without_cavities};

/// Masks of two shapes given by their inside tests, on a grid around the origin.
fn masks(
    half_mm: f64,
    spacing: DVec3,
    before: impl Fn(DVec3) -> bool,
    after: impl Fn(DVec3) -> bool,
) -> (MaskBits, MaskBits, Grid) {
    let dims: [usize; 3] = spacing.to_array().map(|s| 2 * (half_mm / s).ceil() as usize + 3);
    let shift = DVec3::new(0.17, -0.31, 0.23) * spacing;
    let origin = DVec3::from_array(dims.map(|n| -((n - 1) as f64) / 2.0)) * spacing + shift;
    let grid = Grid::axis_aligned(dims, spacing, origin).unwrap();
    let bits = |inside: &dyn Fn(DVec3) -> bool| {
        MaskBits::from_fn(dims, |l| {
            let v = ijk(dims, l);
            inside(grid.center_of_voxel_mm(v))
        })
    };
    (bits(&before), bits(&after), grid)
}

fn of(case: &(MaskBits, MaskBits, Grid)) -> Change {
    let change = change(&case.0, &case.1, &case.2, &ChangeOptions::default(), &Progress::new()).unwrap();
    assert_consistent(&change, case);
    change
}

/// Invariants of any change.
fn assert_consistent(c: &Change, (before, after, grid): &(MaskBits, MaskBits, Grid)) {
    let filled = [before, after].map(|mask| without_cavities(mask).unwrap());
    let surfaces = filled.each_ref().map(crate::surface::surface_of);
    let trees = surfaces.each_ref().map(|surface| {
        let mut points = Vec::new();
        surface.for_each(|l| points.push(grid.center_of_voxel_mm(ijk(grid.dims(), l))));
        KdTree::new(&points).unwrap()
    });
    let mm = grid.world_from_voxel().matrix3;
    let edges_mm = [mm.x_axis, mm.y_axis, mm.z_axis].map(DVec3::length);
    let reach_mm = edges_mm.into_iter().fold(0.0, f64::max) + 0.5 * edges_mm.iter().sum::<f64>();
    for v in &c.vectors {
        let [here, other] = if v.signed_mm > 0.0 { [after, before] } else { [before, after] };
        assert!(here.get(v.voxel) && !other.get(v.voxel));
        let length = v.from_mm.distance(v.to_mm);
        assert!((length - v.signed_mm.abs()).abs() <= 1e-9 * (1.0 + v.from_mm.length()), "{v:?}");
        assert!(v.nearest_mm <= v.signed_mm.abs() + 1e-9, "{v:?}");
        // Each end lies on the surface of its date: a step to a neighbour from a voxel of it, and half a voxel along it.
        for (place, tree) in [(v.from_mm, &trees[0]), (v.to_mm, &trees[1])] {
            let (_, off_mm) = tree.as_ref().unwrap().nearest(place).unwrap();
            assert!(off_mm <= reach_mm, "{off_mm} {reach_mm} {v:?}");
        }
    }
    let outer = |mine: usize, other: &MaskBits| {
        let mut n = 0;
        let dims = other.dims();
        surfaces[mine].for_each(|l| n += usize::from(!other.get(ijk(dims, l))));
        n
    };
    let compared = !c.flags.contains(&Flag::NoOverlap);
    let outer = if compared { outer(0, &filled[1]) + outer(1, &filled[0]) } else { 0 };
    assert_eq!(c.vectors.len() + c.unpartnered.len(), outer);
}

const SPACINGS: [DVec3; 2] = [DVec3::ONE, DVec3::new(0.5, 0.5, 5.0)];

fn ball(center: DVec3, radius: f64) -> impl Fn(DVec3) -> bool {
    move |p| p.distance(center) <= radius
}

#[test]
fn concentric_balls_change_by_the_difference_of_their_radii() {
    for spacing in SPACINGS {
        for (r0, r1) in [(12.0, 18.0), (18.0, 12.0), (15.0, 17.5)] {
            let c = of(&masks(20.0, spacing, ball(DVec3::ZERO, r0), ball(DVec3::ZERO, r1)));
            let error = c.vectors.iter().map(|v| (v.signed_mm - (r1 - r0)).abs()).sum::<f64>()
                / c.vectors.len() as f64;
            println!("ball {r0} to {r1} at {spacing}: {} vectors, mean error {error:.3} mm", c.vectors.len());
            assert!(error <= spacing.length() / 2.0, "{r0} {r1} {spacing}: {error}");
            assert!(c.vectors.len() > 100 && c.unpartnered.is_empty());
            assert!(c.vectors.iter().all(|v| (v.signed_mm > 0.0) == (r1 > r0)));
        }
    }
}

/// Mean movement of the whole surface against the truth, over places of the shape on the voxels: also far below a voxel.
#[test]
fn small_movements_are_measured_as_they_are() {
    let thick = DVec3::new(1.0, 1.0, 3.0);
    for (spacing, moves_mm, off) in [
        (DVec3::ONE, [-2.0, -1.0, -0.5, 0.25, 0.5, 1.0, 2.0].as_slice(), 0.06),
        (thick, [-4.0, -2.0, -1.0, 1.0, 2.0, 4.0].as_slice(), 0.15),
    ] {
        for &by_mm in moves_mm {
            let (mut sum, mut count) = (0.0, 0.0);
            for at in [[0.0, 0.0, 0.0], [0.3, 0.6, 0.2], [0.8, 0.1, 0.5], [0.5, 0.4, 0.9]] {
                let center = DVec3::from_array(at) * spacing;
                let case = masks(18.0, spacing, ball(center, 11.0), ball(center, 11.0 + by_mm));
                let options = ChangeOptions { by_skeleton: false, ..ChangeOptions::default() };
                let c = change(&case.0, &case.1, &case.2, &options, &Progress::new()).unwrap();
                for length in [mean_move_mm(&c, |v| v.signed_mm.abs()), mean_move_mm(&c, |v| v.nearest_mm)] {
                    sum += length.unwrap() / by_mm;
                    count += 1.0;
                }
            }
            let share = sum / count;
            println!("{by_mm} mm at {spacing}: {share:.3}");
            assert!((share - 1.0).abs() < off, "{by_mm} mm at {spacing}: {share}");
        }
    }
}

/// Of faces across (1, 1, 1) the voxels lie in layers 0.58 apart, but the nearest centre of the next layer is a whole voxel away.
#[test]
fn small_movements_of_slanted_faces_are_measured_as_they_are() {
    let octahedron = |size: f64| move |p: DVec3| p.abs().dot(DVec3::ONE) <= size * 3_f64.sqrt();
    for by_mm in [0.2, 0.5, 1.0] {
        let shares = [10.0, 10.1, 10.23, 10.37].map(|size| {
            let case = masks(21.0, DVec3::ONE, octahedron(size), octahedron(size + by_mm));
            mean_move_mm(&of(&case), |v| v.signed_mm.abs()).unwrap() / by_mm
        });
        let share = shares.iter().sum::<f64>() / 4.0;
        println!("{by_mm} mm: {share:.3} {shares:?}");
        assert!((share - 1.0).abs() < 0.08, "{by_mm}: {share}");
    }
}

/// A surface that moves by whole voxels, and one voxel that grows: exact.
#[test]
fn boxes_and_a_single_voxel_are_exact() {
    let up_to = |x: f64| move |p: DVec3| p.y.abs().max(p.z.abs()) <= 8.0 && (-8.0..=x).contains(&p.x);
    let (a, b, grid) = masks(14.0, DVec3::ONE, up_to(8.0), up_to(10.0));
    let options = ChangeOptions { by_skeleton: false, ..ChangeOptions::default() };
    let c = change(&a, &b, &grid, &options, &Progress::new()).unwrap();
    let flat = c.vectors.iter().filter(|v| v.to_mm.y.abs().max(v.to_mm.z.abs()) < 5.0 && v.to_mm.x > 9.0);
    let lengths: Vec<f64> = flat.map(|v| v.signed_mm).collect();
    assert!(lengths.len() > 50 && lengths.iter().all(|mm| (mm - 2.0).abs() < 1e-9), "{lengths:?}");
    let (a, b, grid) =
        masks(6.0, DVec3::ONE, ball(DVec3::new(0.17, -0.31, 0.23), 0.4), ball(DVec3::ZERO, 4.2));
    assert_eq!(a.count(), 1);
    let c = change(&a, &b, &grid, &ChangeOptions::default(), &Progress::new()).unwrap();
    // From the voxel to the ball of the same volume: half the voxel's mean width, 3/4 of an edge, less than its radius.
    let radius = (b.count() as f64 * 0.75 / std::f64::consts::PI).cbrt();
    let mean = c.vectors.iter().map(|v| v.signed_mm).sum::<f64>() / c.vectors.len() as f64;
    assert!((mean - (radius - 0.75)).abs() < 0.15, "{mean} {radius}");
}

/// Distance from `p` to the nearest point of the ellipsoid with semi-axes `a` about the origin (bisection on the
/// Lagrange multiplier).
fn ellipsoid_distance_mm(p: DVec3, a: DVec3) -> f64 {
    let f = |t: f64| -> f64 { (0..3).map(|i| (a[i] * p[i] / (t + a[i] * a[i])).powi(2)).sum::<f64>() - 1.0 };
    let (mut lo, mut hi) = (-a.min_element().powi(2) + 1e-9, 1e6);
    for _ in 0..200 {
        let middle = (lo + hi) / 2.0;
        if f(middle) > 0.0 { lo = middle } else { hi = middle }
    }
    let q = DVec3::from_array(std::array::from_fn(|i| a[i] * a[i] * p[i] / (lo + a[i] * a[i])));
    p.distance(q)
}

#[test]
fn an_ellipsoid_scaled_along_one_axis_grows_there_and_nowhere_else() {
    for spacing in SPACINGS {
        let (a, b) = (DVec3::new(12.0, 14.0, 13.0), DVec3::new(20.0, 14.0, 13.0));
        let inside = |s: DVec3| move |p: DVec3| (p / s).length() <= 1.0;
        let c = of(&masks(22.0, spacing, inside(a), inside(b)));
        assert!(c.vectors.iter().all(|v| v.signed_mm > 0.0));
        // Ground truth on the axis: the tip moved by 8 mm.
        let tip = c.vectors.iter().filter(|v| {
            let p = v.to_mm;
            p.x.abs() > 19.0 && p.y.hypot(p.z) < 5.0
        });
        let (n, mean) = tip.fold((0, 0.0), |(n, sum), v| (n + 1, sum + v.signed_mm));
        let mean = mean / f64::from(n);
        assert!(n > 0 && (mean - 8.0).abs() <= spacing.length() / 2.0, "{spacing}: {mean} of {n}");
        // No vector is shorter than the true distance between the surfaces, within a voxel's size.
        for v in &c.vectors {
            let true_mm = ellipsoid_distance_mm(v.to_mm, a);
            assert!(v.signed_mm >= true_mm - spacing.length(), "{v:?} {true_mm}");
        }
    }
}

#[test]
fn a_ball_that_moves_grows_ahead_and_recedes_behind() {
    for spacing in SPACINGS {
        let step = DVec3::new(8.0, 6.0, 0.0);
        let c = of(&masks(26.0, spacing, ball(DVec3::ZERO, 14.0), ball(step, 14.0)));
        // Sign of the true change at the voxel: positive where it is nearer to the second ball than to the first.
        let (mut correct, mut all) = (0, 0);
        for v in &c.vectors {
            let p = if v.signed_mm > 0.0 { v.to_mm } else { v.from_mm };
            let truth = p.length() - p.distance(step);
            if truth.abs() > spacing.length() {
                all += 1;
                correct += usize::from((truth > 0.0) == (v.signed_mm > 0.0));
            }
        }
        assert!(all > 50 && correct as f64 >= 0.999 * f64::from(all), "{spacing}: {correct} of {all}");
        let along = step.normalize_or_zero();
        let ahead: Vec<f64> = (c.vectors.iter())
            .filter(|v| v.signed_mm > 0.0 && (v.to_mm - step).normalize_or_zero().dot(along) > 0.98)
            .map(|v| v.signed_mm)
            .collect();
        let mean = ahead.iter().sum::<f64>() / ahead.len() as f64;
        assert!((mean - 10.0).abs() <= spacing.length() / 2.0, "{spacing}: {mean}");
    }
}

#[test]
fn a_lobe_grown_on_one_side_changes_that_side_only() {
    for spacing in SPACINGS {
        let old = ball(DVec3::ZERO, 14.0);
        let lobe = ball(DVec3::new(14.0, 0.0, 0.0), 7.0);
        let c = of(&masks(24.0, spacing, &old, |p| old(p) || lobe(p)));
        assert!(c.vectors.iter().all(|v| v.signed_mm > 0.0 && v.to_mm.x > 5.0));
        let longest = c.vectors.iter().map(|v| v.signed_mm).fold(0.0, f64::max);
        assert!((longest - 7.0).abs() <= spacing.length() / 2.0 + 1.0, "{spacing}: {longest}");
    }
}

#[test]
fn split_merged_vanished_and_appeared_components_are_reported_without_spurious_vectors() {
    let (left, right) = (DVec3::new(-12.0, 0.0, 0.0), DVec3::new(12.0, 0.0, 0.0));
    let bar = |p: DVec3| p.x.abs() <= 12.0 && p.y.hypot(p.z) <= 4.0;
    let dumbbell = move |p: DVec3| ball(left, 7.0)(p) || ball(right, 7.0)(p) || bar(p);
    let parts = move |p: DVec3| ball(left, 7.0)(p) || ball(right, 7.0)(p);
    let speck = ball(DVec3::new(0.0, 18.0, 0.0), 3.0);
    for spacing in SPACINGS {
        let split = of(&masks(24.0, spacing, |p| dumbbell(p) || speck(p), parts));
        assert!(split.flags.contains(&Flag::Split) && split.flags.contains(&Flag::Vanished));
        let fates: Vec<Fate> = split.groups.iter().map(|g| g.fate).collect();
        assert!(fates.contains(&Fate::Split) && fates.contains(&Fate::Vanished) && fates.len() == 2);
        assert!(split.vectors.iter().all(|v| v.signed_mm < 0.0));
        // The vanished speck has no vector; all its outer voxels are listed.
        assert!(split.vectors.iter().all(|v| v.from_mm.y < 14.0));
        assert!(!split.unpartnered.is_empty());
        assert!(
            split.unpartnered.iter().all(|v| !v.appeared && v.position_mm.y > 14.0 && v.nearest_mm.is_some())
        );
        let merged = of(&masks(24.0, spacing, parts, |p| dumbbell(p) || speck(p)));
        assert!(merged.flags.contains(&Flag::Merged) && merged.flags.contains(&Flag::Appeared));
        assert_eq!(merged.counts.appeared_voxels, split.counts.vanished_voxels);
    }
}

/// Flecks of a segmentation's edge are no events: 0.1 ml is a ball of 5.8 mm across.
#[test]
fn small_components_make_no_flag_and_keep_their_vectors() {
    let (left, right) = (DVec3::new(-12.0, 0.0, 0.0), DVec3::new(12.0, 0.0, 0.0));
    let of_size = |radius_mm: f64, smallest_ml: f64| {
        let fleck = ball(right, radius_mm);
        let (before, after, grid) =
            masks(24.0, DVec3::ONE, ball(left, 8.0), |p| ball(left, 7.0)(p) || fleck(p));
        let options = ChangeOptions { smallest_ml, ..ChangeOptions::default() };
        change(&before, &after, &grid, &options, &Progress::new()).unwrap()
    };
    let new = of_size(2.0, DEFAULT_SMALLEST_ML);
    assert_eq!(new.flags, []);
    assert!(new.groups.iter().any(|g| g.fate == Fate::Appeared && g.is_small));
    assert!(new.counts.appeared_voxels > 0, "drawn and counted all the same");
    assert_eq!(of_size(2.0, 0.0).flags, [Flag::Appeared]);
    assert_eq!(of_size(4.0, DEFAULT_SMALLEST_ML).flags, [Flag::Appeared]);
    // One that breaks into a large piece and flecks did not split; into flecks alone it is still there.
    let pieces = |left_mm: f64| {
        let near = move |p: DVec3| ball(left, left_mm)(p) || ball(left + DVec3::X * 9.0, 2.0)(p);
        let (before, after, grid) = masks(24.0, DVec3::ONE, ball(left, 12.0), near);
        change(&before, &after, &grid, &ChangeOptions::default(), &Progress::new()).unwrap()
    };
    for left_mm in [6.0, 2.0] {
        let of = pieces(left_mm);
        assert_eq!(of.groups.iter().map(|g| g.fate).collect::<Vec<_>>(), [Fate::Matched], "{left_mm}");
        assert_eq!(of.flags, []);
    }
    let nan = ChangeOptions { smallest_ml: f64::NAN, ..ChangeOptions::default() };
    let (a, b, grid) = masks(4.0, DVec3::ONE, ball(DVec3::ZERO, 2.0), ball(DVec3::ZERO, 3.0));
    let error = change(&a, &b, &grid, &nan, &Progress::new());
    assert!(matches!(error, Err(ChangeError::Smallest(_))), "{error:?}");
}

/// Two dates that share no place may not be aligned: a lesion that "vanished" would be a claim.
#[test]
fn masks_without_a_common_voxel_are_compared_by_volume_only() {
    let (left, right) = (DVec3::new(-12.0, 0.0, 0.0), DVec3::new(12.0, 0.0, 0.0));
    let case = masks(24.0, DVec3::ONE, ball(left, 7.0), ball(right, 7.0));
    let apart = change(&case.0, &case.1, &case.2, &ChangeOptions::default(), &Progress::new()).unwrap();
    assert_eq!(apart.flags, [Flag::NoOverlap]);
    assert_eq!(apart.kept_voxels, 0);
    assert_eq!([apart.gone_voxels, apart.new_voxels], [case.0.count(), case.1.count()]);
    assert!(apart.vectors.is_empty() && apart.unpartnered.is_empty() && apart.groups.is_empty());
    assert_eq!((apart.skeleton, apart.counts), (Skeleton::default(), ChangeCounts::default()));
}

/// A necrotic core that widens moves no outer surface: what recedes is the inner wall.
#[test]
fn walls_of_cavities_are_reported_apart_from_the_outer_surface() {
    let shell = |outer: f64, hole: f64| move |p: DVec3| (hole..=outer).contains(&p.length());
    for (from, to) in [(4.0, 8.0), (8.0, 4.0)] {
        let c = of(&masks(20.0, DVec3::ONE, shell(15.0, from), shell(15.0, to)));
        assert_eq!(c.flags, [Flag::InsideOnly]);
        assert!(c.vectors.is_empty() && c.unpartnered.is_empty());
        let sphere = |radius: f64| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        for (voxels, radius) in [(c.cavities.from_voxels, from), (c.cavities.to_voxels, to)] {
            assert!((voxels as f64 / sphere(radius) - 1.0).abs() < 0.05, "{voxels} {radius}");
        }
        let moved = &c.cavities.signed_mm;
        let mean = moved.iter().sum::<f64>() / moved.len() as f64;
        assert!(moved.len() > 150 && (mean - (to - from)).abs() < 0.5, "{} {mean}", moved.len());
    }
    // Grown outside as well: each is told apart.
    let c = of(&masks(20.0, DVec3::ONE, shell(12.0, 4.0), shell(15.0, 8.0)));
    let mean = c.vectors.iter().map(|v| v.signed_mm).sum::<f64>() / c.vectors.len() as f64;
    assert!(c.vectors.iter().all(|v| v.signed_mm > 0.0) && (mean - 3.0).abs() < 0.5, "{mean}");
    assert!(c.cavities.signed_mm.iter().all(|mm| *mm > 0.0));
    // A nodule within a ring is no wall of it: its growth is growth.
    let ring = shell(15.0, 12.0);
    let nodule = |radius: f64| move |p: DVec3| (12.0..=15.0).contains(&p.length()) || p.length() <= radius;
    let grids = masks(20.0, DVec3::ONE, nodule(4.0), nodule(9.0));
    let c = change(&grids.0, &grids.1, &grids.2, &ChangeOptions::default(), &Progress::new()).unwrap();
    let mean = c.vectors.iter().map(|v| v.signed_mm).sum::<f64>() / c.vectors.len() as f64;
    assert!(c.vectors.len() > 500 && (mean - 5.0).abs() < 0.5, "{} {mean}", c.vectors.len());
    assert!(c.cavities.signed_mm.is_empty() && c.cavities.to_voxels < c.cavities.from_voxels);
    // A solid nodule that fills the ring's cavity isn't outside it; one that is new there is.
    let c = of(&masks(20.0, DVec3::ONE, ring, nodule(0.0)));
    assert_eq!(c.flags, [Flag::NoChange]);
    // A cavity that opens has volume but no wall to compare with.
    let c = of(&masks(20.0, DVec3::ONE, shell(15.0, 0.0), shell(15.0, 6.0)));
    assert!(c.cavities.from_voxels == 0 && c.cavities.to_voxels > 800 && c.cavities.signed_mm.is_empty());
    assert!(c.vectors.is_empty());
}

/// One body, twice in slices of 5 mm, half a slice apart: nothing moved, and nothing is said to have.
#[test]
fn one_body_in_two_slicings_has_not_changed() {
    let grid = |slices: usize, step: f64, first: f64| {
        let spacing = DVec3::new(1.0, 1.0, step);
        Grid::axis_aligned([61, 61, slices], spacing, DVec3::new(-30.0, -30.0, first)).unwrap()
    };
    let slicings = [grid(13, 5.0, -30.0), grid(12, 5.0, -27.5)];
    for radius in [12.0, 18.0] {
        let native = slicings.each_ref().map(|grid| {
            let inside = |l| grid.center_of_voxel_mm(grid.ijk(l)).length() <= radius;
            Mask::new("FLAIR", grid.clone(), MaskBits::from_fn(grid.dims(), inside)).unwrap()
        });
        for case in [&slicings[0], &slicings[1], &grid(61, 1.0, -30.0)] {
            let bits =
                native.each_ref().map(|mask| resample::mask_onto(mask, case, &Progress::new()).unwrap());
            let samplings = slicings.each_ref().map(|grid| Sampling::new(grid, case));
            let options = ChangeOptions::default();
            let c = change_with(&bits[0], &bits[1], case, samplings, &options, None, &Progress::new());
            let c = c.unwrap();
            let along_z = c.uncertainty.along(DVec3::Z);
            assert!((along_z - 1.96 * (25.0_f64 / 6.0 + 0.25).sqrt()).abs() < 1e-9, "{along_z}");
            let beyond = c.vectors.iter().filter(|v| !v.flags.within_uncertainty).count();
            assert!(c.vectors.len() > 100 && beyond == 0, "{radius} mm: {beyond} of {}", c.vectors.len());
        }
        // It is no blindness: one that grew by 8 mm has.
        let inside = |l| slicings[1].center_of_voxel_mm(slicings[1].ijk(l)).length() <= radius + 8.0;
        let grown = MaskBits::from_fn(slicings[1].dims(), inside);
        let grown = Mask::new("FLAIR", slicings[1].clone(), grown).unwrap();
        let grown = resample::mask_onto(&grown, &slicings[0], &Progress::new()).unwrap();
        let samplings = slicings.each_ref().map(|grid| Sampling::new(grid, &slicings[0]));
        let options = ChangeOptions::default();
        let before = native[0].bits();
        let c = change_with(before, &grown, &slicings[0], samplings, &options, None, &Progress::new());
        let c = c.unwrap();
        let beyond = c.vectors.iter().filter(|v| !v.flags.within_uncertainty).count();
        assert!(beyond as f64 > 0.9 * c.vectors.len() as f64, "{beyond} of {}", c.vectors.len());
    }
}

#[test]
fn identical_masks_need_no_skeleton() {
    let same = |p: DVec3| (p / DVec3::new(15.0, 9.0, 7.0)).length() <= 1.0;
    let c = of(&masks(18.0, DVec3::ONE, same, same));
    assert_eq!(c.flags, [Flag::NoChange]);
    assert_eq!(c.skeleton.counts, crate::skeleton::SkeletonCounts::default());
    assert!(c.vectors.is_empty() && c.kept_voxels > 1000 && c.gone_voxels + c.new_voxels == 0);
    // With a change, the counters aren't 0: the skeleton is computed.
    let grown = |p: DVec3| (p / DVec3::new(15.0, 11.0, 7.0)).length() <= 1.0;
    let c = of(&masks(18.0, DVec3::new(1.0, 1.0, 1.0), same, grown));
    assert!(c.skeleton.counts.samples > 0 && c.skeleton_voxels > 0);
    // A filled cavity is a change without outer surface voxels.
    let hollow = move |p: DVec3| same(p) && p.length() > 3.0;
    let c = of(&masks(18.0, DVec3::ONE, hollow, same));
    assert_eq!(c.flags, [Flag::InsideOnly]);
    assert!(c.new_voxels > 50 && c.vectors.is_empty());
}

#[test]
fn statistics_of_lengths() {
    let l = Lengths::of(vec![4.0, 1.0, 3.0, 2.0]);
    assert_eq!((l.p50_mm, l.max_mm, l.mean_mm, l.count), (Some(2.5), Some(4.0), Some(2.5), 4));
    assert_eq!(Lengths::of(vec![]).p95_mm, None);
    let h = Histogram::of([-1.5, -0.2, 0.1, 0.2, 3.0].into_iter()).unwrap();
    assert_eq!((h.bin_mm, h.first_mm, h.counts.iter().sum::<u64>()), (0.2, -1.6, 5));
    assert_eq!(Histogram::of(std::iter::empty()), None);
}

/// First-order signed distance to a union of the phantom's ellipsoids.
fn signed_distance_mm(parts: &[phantom::Ellipsoid], p: DVec3) -> f64 {
    let one = |e: &phantom::Ellipsoid| {
        let q = (p - e.center_mm) / e.semi_axes_mm;
        let slope = (q / e.semi_axes_mm).length();
        (q.length() - 1.0) * q.length() / slope
    };
    parts.iter().map(one).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_sample_changes_match_its_analytic_shapes() {
    let spec = crate::sample::sample_spec();
    let case = crate::case::load(&spec, &Default::default(), &Progress::new()).unwrap();
    let truth = phantom::truth();
    for id in ["T1", "T2", "PET"] {
        let options = ChangeOptions::default();
        let choice = Choice::resolve(&case, Some(id), None, None).unwrap();
        let (report, change) = between(&case, &choice, &options, None, &Progress::new()).unwrap();
        let parts = |time: usize| &truth.time_points[time].masks.iter().find(|m| m.id == id).unwrap().parts;
        let voxel = case.grid.spacing_mm().length();
        let (mut correct, mut all) = (0, 0);
        for v in &change.vectors {
            // True distance of the surface voxel outside (growth) or inside (recession) the other time point's shape.
            let (place, other) = if v.signed_mm > 0.0 { (v.to_mm, 0) } else { (v.from_mm, 1) };
            let true_mm = signed_distance_mm(parts(other), place) * v.signed_mm.signum();
            if true_mm.abs() > voxel {
                all += 1;
                correct += usize::from((true_mm > 0.0) == (v.signed_mm > 0.0));
            }
            assert!(v.signed_mm.abs() >= true_mm.abs() - 1.5 * voxel, "{id} {v:?} {true_mm}");
        }
        println!("{id}: {correct} of {all}, {:?} {:?}", report.growth, report.recession);
        assert!(all > 100 && correct as f64 >= 0.999 * f64::from(all), "{id}: {correct} of {all}");
        let [kept, gone] = [report.kept_ml, report.gone_ml].map(Option::unwrap);
        assert!((kept + gone - report.from_ml).abs() < 1e-9);
        assert!(
            (report.to_ml - truth.time_points[1].masks.iter().find(|m| m.id == id).unwrap().volume_ml).abs()
                < 0.5
        );
        // The faces of the main body moved by known distances.
        let growth = truth.growth.iter().find(|g| g.id == id).unwrap();
        let most = growth.left_posterior_inferior_mm.max(growth.right_anterior_superior_mm).max_element();
        assert!(report.growth.p95_mm.unwrap() <= most.max(9.0) + 2.0 * voxel, "{id} {:?}", report.growth);
    }
    // T1 has a new satellite.
    let choice = Choice::resolve(&case, None, None, None).unwrap();
    assert_eq!(choice, Choice { id: "T1".into(), dates: [0, 1] });
    let (report, change) =
        between(&case, &choice, &ChangeOptions::default(), None, &Progress::new()).unwrap();
    assert!(report.flags.contains(&Flag::Appeared));
    let satellite = DVec3::new(-16.0, 56.0, -4.0);
    assert!(change.unpartnered.iter().all(|v| v.appeared && v.position_mm.distance(satellite) < 6.5));
    let lines = String::from_utf8(csv(&change, None)).unwrap().lines().count();
    assert_eq!(lines, 1 + change.vectors.len() + change.unpartnered.len());
    // Invalid choices.
    for (of, from, to) in [
        (Some("T9"), None, None),
        (Some("T1"), Some("2020"), None),
        (None, Some("2024-04-15"), Some("2024-01-15")),
        (None, None, Some("2024-01-15")),
    ] {
        let wrong = Choice::resolve(&case, of, from, to);
        assert!(matches!(wrong, Err(ChangeError::Choice { .. })), "{of:?}");
    }
}

#[test]
fn degenerate_masks_and_matrices_give_finite_results() {
    let small = |dims: [usize; 3], affine: DAffine3, seed: u64, per_mille: u64| {
        let grid = Grid::new(dims, affine, Sides::Known).unwrap();
        let mask = |mut state: u64| {
            MaskBits::from_fn(dims, |_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) % 1000 < per_mille
            })
        };
        (mask(seed), mask(seed + 77), grid)
    };
    let id = DAffine3::IDENTITY;
    let dims = [12, 11, 10];
    let (empty, full) = (MaskBits::empty(dims), MaskBits::full(dims));
    let one = MaskBits::from_fn(dims, |l| l == 700);
    let slice = MaskBits::from_fn(dims, |l| l / 132 == 4);
    let plain = || Grid::new(dims, id, Sides::Known).unwrap();
    let all = [("empty", &empty), ("full", &full), ("one voxel", &one), ("one slice", &slice)];
    for (name, a) in all {
        for (other, b) in all {
            let c = of(&(a.clone(), b.clone(), plain()));
            assert_eq!(c.flags.contains(&Flag::NoChange), name == other, "{name} {other} {:?}", c.flags);
            let none = a.count() == 0 || b.count() == 0;
            assert!(!none || c.vectors.is_empty(), "{name} {other}");
        }
    }
    // 31,000 components.
    let specks = small([128, 128, 128], id, 5, 20);
    let c = of(&specks);
    assert!(c.groups.len() > 31_000, "{}", c.groups.len());
    // Lengths don't depend on the grid's position: far away, mirrored. Anisotropic, sheared and tiny voxels and
    // the worst conditioned matrix that a grid accepts give finite results.
    let lobes = |p: DVec3| ball(DVec3::ZERO, 6.0)(p) || ball(DVec3::new(6.0, 2.0, 1.0), 4.0)(p);
    let (a, b, _) = masks(12.0, DVec3::ONE, lobes, |p| lobes(p) && p.x < 5.0 || ball(DVec3::Y * 5.0, 4.0)(p));
    let with = |m: DMat3, t: f64| {
        let affine = DAffine3 { matrix3: m, translation: DVec3::splat(t) };
        of(&(a.clone(), b.clone(), Grid::new(a.dims(), affine, Sides::Known).unwrap()))
    };
    let here = with(DMat3::IDENTITY, 0.0);
    let far = with(DMat3::IDENTITY, 1e6);
    let lengths = |c: &Change| c.vectors.iter().map(|v| v.signed_mm).collect::<Vec<_>>();
    assert_eq!(lengths(&here), lengths(&far));
    let mirrored = with(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), 0.0);
    assert_eq!(mirrored.vectors.len(), here.vectors.len());
    for m in [
        DMat3::from_diagonal(DVec3::new(0.5, 0.5, 6.0)),
        DMat3::from_cols(DVec3::X, DVec3::new(0.4, 1.0, 0.0), DVec3::new(0.0, 0.3, 2.0)),
        DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.99e8)),
        DMat3::from_diagonal(DVec3::splat(1e-30)),
        DMat3::from_cols(DVec3::X, DVec3::new(1.0, 2.5e-8, 0.0), DVec3::Z),
    ] {
        let c = with(m, 0.0);
        assert_eq!(c.vectors.len(), here.vectors.len(), "{m:?}");
        assert!(c.vectors.iter().all(|v| v.signed_mm.is_finite() && v.signed_mm != 0.0), "{m:?} finite");
        assert!(!c.skeleton.points.is_empty(), "{m:?}");
        // Only voxels 1e8 steps long reach the limit on steps.
        let limited = m.z_axis.z > 1e6;
        assert!(limited || c.skeleton.counts.stopped == 0, "{m:?} {:?}", c.skeleton.counts);
    }
    let error = change(&a, &b, &plain(), &ChangeOptions::default(), &Progress::new());
    assert!(matches!(error, Err(ChangeError::Dims { .. })));
    let nan = ChangeOptions { registration_mm: f64::NAN, ..ChangeOptions::default() };
    assert!(matches!(
        change(&full, &one, &plain(), &nan, &Progress::new()),
        Err(ChangeError::Registration(_))
    ));
    let stop = Progress::new();
    stop.cancel();
    assert!(change(&full, &one, &plain(), &ChangeOptions::default(), &stop).is_err());
}
