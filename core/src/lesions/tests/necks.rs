//! Necks of balls, whose cuts are known.

use std::f64::consts::{FRAC_PI_2, PI};

use super::{
    super::{neck::narrowest, split::at_neck},
    *,
};
use crate::{
    Components, Connectivity, MaskBits,
    components::Run,
    glam::DMat3,
    skeleton::{SkeletonOptions, skeleton},
};

const ML: f64 = DEFAULT_SMALLEST_ML;

/// A row of balls along x: radius of each, and of the bridge to the next (0 after the last). Balls of a bridge lie `GAP_MM`
/// apart, or overlap in a circle of the bridge's radius.
struct Row {
    balls: Vec<(f64, f64)>,
    bridge_mm: Vec<f64>,
    overlap: bool,
}

const GAP_MM: f64 = 8.0;

fn row(radii_mm: &[f64], bridge_mm: &[f64], overlap: bool) -> Row {
    let mut balls: Vec<(f64, f64)> = Vec::new();
    for (n, r) in radii_mm.iter().enumerate() {
        let x = balls.last().map_or(0.0, |(x, before)| {
            let half = |r: f64| if overlap { (r * r - bridge_mm[n - 1].powi(2)).sqrt() } else { r };
            x + half(*before) + half(*r) + if overlap { 0.0 } else { GAP_MM }
        });
        balls.push((x, *r));
    }
    let middle = (balls[0].0 - balls[0].1 + balls[balls.len() - 1].0 + balls[balls.len() - 1].1) / 2.0;
    balls.iter_mut().for_each(|ball| ball.0 -= middle);
    Row { balls, bridge_mm: bridge_mm.to_vec(), overlap }
}

impl Row {
    fn has(&self, p: DVec3) -> bool {
        let in_bridge = |(n, r): (usize, &f64)| {
            !self.overlap && p.y.hypot(p.z) <= *r && (self.balls[n].0..=self.balls[n + 1].0).contains(&p.x)
        };
        self.balls.iter().any(|(x, r)| p.distance(DVec3::X * *x) <= *r)
            || self.bridge_mm.iter().enumerate().any(in_bridge)
    }

    /// Where bridge `n` is all there is.
    fn bridge(&self, n: usize) -> [f64; 2] {
        let half = |r: f64| (r * r - self.bridge_mm[n].powi(2)).sqrt();
        let ((a, ra), (b, rb)) = (self.balls[n], self.balls[n + 1]);
        [a + half(ra), b - half(rb)]
    }

    fn half_mm(&self) -> f64 {
        self.balls[0].1 - self.balls[0].0 + 1.0
    }
}

fn voxelised(half_mm: f64, spacing_mm: DVec3, inside: impl Fn(DVec3) -> bool) -> (MaskBits, Grid) {
    let dims = spacing_mm.to_array().map(|mm| 2 * (half_mm / mm).ceil() as usize + 3);
    // Off the grid, as symmetry would make the test too easy.
    let shift = DVec3::new(0.13, 0.29, -0.21) * spacing_mm;
    let origin = DVec3::from_array(dims.map(|n| (n - 1) as f64 / -2.0)) * spacing_mm + shift;
    let grid = Grid::axis_aligned(dims, spacing_mm, origin).unwrap();
    let bits = MaskBits::from_fn(dims, |l| inside(grid.center_of_voxel_mm(grid.ijk(l))));
    (bits, grid)
}

fn runs_of(bits: &MaskBits) -> Vec<Run> {
    let components = Components::of_mask(bits, Connectivity::TwentySix).unwrap();
    assert_eq!(components.list().len(), 1);
    components.runs(&components.list()[0]).to_vec()
}

fn found(bits: &MaskBits, grid: &Grid, smallest_ml: f64) -> Result<Neck, String> {
    narrowest(&runs_of(bits), grid, smallest_ml, &Progress::new()).unwrap()
}

/// Centres of the voxels of both pieces.
fn pieces(bits: &MaskBits, grid: &Grid, neck: &Neck) -> [Vec<DVec3>; 2] {
    at_neck(&runs_of(bits), grid, neck.seeds_mm).unwrap().unwrap().map(|runs| {
        let at = |run: &Run, x: u32| grid.center_of_voxel_mm([x, run.y, run.z].map(|n| n as usize));
        runs.iter().flat_map(|run| (run.first..=run.last).map(|x| at(run, x)).collect::<Vec<_>>()).collect()
    })
}

fn rotations() -> [DMat3; 4] {
    [
        DMat3::IDENTITY,
        DMat3::from_rotation_y(FRAC_PI_2),
        DMat3::from_rotation_z(0.5) * DMat3::from_rotation_y(0.7),
        DMat3::from_rotation_z(2.2) * DMat3::from_rotation_y(1.84) * DMat3::from_rotation_x(0.8),
    ]
}

/// Cuts the row at its bridge `n`: pieces differ from the two sides by no more than the bridge, or by a voxel where balls
/// overlap.
fn cuts(row: &Row, n: usize, spacing_mm: DVec3, turn: DMat3) {
    let back = turn.transpose();
    let (bits, grid) = voxelised(row.half_mm(), spacing_mm, |p| row.has(back * p));
    let voxel_mm = spacing_mm.max_element();
    let case = format!("{:?} {:?} {n} at {spacing_mm} {turn}", row.balls, row.bridge_mm);
    let neck = found(&bits, &grid, ML).unwrap_or_else(|reason| panic!("{case}: {reason}"));
    assert!(neck.radius_mm <= WIDEST_NECK * neck.side_radii_mm[1], "{case}: {neck:?}");
    assert!(neck.radius_mm <= row.bridge_mm[n] + voxel_mm, "{case}: {neck:?}");
    assert!(neck.side_radii_mm[0] >= neck.side_radii_mm[1] - voxel_mm, "{case}: {neck:?}");
    let [from, to] = row.bridge(n);
    let x = (back * neck.at_mm).x;
    // Where balls overlap, the radius grows slowly beside the circle: a place whose radius is within a voxel of it.
    let radius_mm = row.bridge_mm[n];
    let slack_mm = if row.overlap { (voxel_mm * (2.0 * radius_mm + voxel_mm)).sqrt() } else { voxel_mm };
    assert!((from - slack_mm..=to + slack_mm).contains(&x), "{case}: {x} {from} {to}");
    let sides =
        pieces(&bits, &grid, &neck).map(|piece| piece.iter().map(|p| (back * *p).x).collect::<Vec<_>>());
    let mean = |side: &Vec<f64>| side.iter().sum::<f64>() / side.len() as f64;
    let (left, right) =
        if mean(&sides[0]) < mean(&sides[1]) { (&sides[0], &sides[1]) } else { (&sides[1], &sides[0]) };
    let all = || left.iter().chain(right.iter());
    assert_eq!(all().count() as u64, bits.count(), "{case}");
    let middle = (from + to) / 2.0;
    let off = (left.len() as f64 - all().filter(|x| **x < middle).count() as f64).abs();
    if row.overlap {
        // The mean distance of the cut from the plane of the circle.
        let mm = off * grid.voxel_volume_mm3() / (PI * row.bridge_mm[n].powi(2));
        assert!(mm <= voxel_mm, "{case}: {mm} mm");
    } else {
        assert!(off <= all().filter(|x| (from..to).contains(*x)).count() as f64, "{case}: {off}");
        assert!(left.iter().all(|x| *x <= to + voxel_mm), "{case}");
        assert!(right.iter().all(|x| *x >= from - voxel_mm), "{case}");
    }
}

#[test]
fn two_balls_are_cut_at_the_bridge_between() {
    for spacing_mm in [DVec3::ONE, DVec3::splat(0.7), DVec3::new(1.0, 1.0, 3.0)] {
        for turn in rotations() {
            for (a, b, bridge) in
                [(8.0, 8.0, 1.5), (8.0, 8.0, 3.0), (12.0, 7.0, 1.5), (12.0, 7.0, 3.0), (20.0, 6.5, 3.0)]
            {
                cuts(&row(&[a, b], &[bridge], false), 0, spacing_mm, turn);
            }
            cuts(&row(&[18.0, 18.0], &[9.0], true), 0, spacing_mm, turn);
        }
    }
    // Slices six times as thick as pixels are wide.
    for turn in rotations() {
        let spacing_mm = DVec3::new(1.0, 1.0, 6.0);
        cuts(&row(&[8.0, 8.0], &[3.0], false), 0, spacing_mm, turn);
        cuts(&row(&[18.0, 18.0], &[4.5], false), 0, spacing_mm, turn);
        cuts(&row(&[18.0, 14.0], &[4.0], false), 0, spacing_mm, turn);
        cuts(&row(&[24.0, 24.0], &[8.0], true), 0, spacing_mm, turn);
    }
}

#[test]
fn of_several_bridges_the_narrowest_is_cut() {
    for turn in rotations() {
        for spacing_mm in [DVec3::ONE, DVec3::new(1.0, 1.0, 2.0)] {
            cuts(&row(&[10.0, 10.0, 10.0], &[4.5, 2.0], false), 1, spacing_mm, turn);
            cuts(&row(&[10.0, 10.0, 10.0], &[2.0, 4.5], false), 0, spacing_mm, turn);
            // Beside larger balls than the narrowest bridge's: as a part of the thinner side it is the widest.
            cuts(&row(&[7.0, 16.0, 16.0], &[3.0, 4.0], false), 1, spacing_mm, turn);
        }
    }
}

/// The reason, which says what was found and what was expected.
fn reason(bits: &MaskBits, grid: &Grid, smallest_ml: f64) -> String {
    let reason = found(bits, grid, smallest_ml).unwrap_err();
    assert!(
        reason.starts_with("found ") && reason.contains(", expected ") && !reason.contains('\n'),
        "{reason}"
    );
    reason
}

#[test]
fn convex_components_have_no_neck() {
    for spacing_mm in [DVec3::ONE, DVec3::new(1.0, 1.0, 3.0)] {
        for turn in rotations() {
            let back = turn.transpose();
            for axes in [DVec3::splat(9.0), DVec3::new(20.0, 8.0, 8.0), DVec3::new(18.0, 11.0, 7.0)] {
                let (bits, grid) = voxelised(21.0, spacing_mm, |p| (back * p / axes).length() <= 1.0);
                reason(&bits, &grid, 0.0);
            }
            let ring = |p: DVec3| (p.x.hypot(p.y) - 14.0).hypot(p.z) <= 6.0;
            let (bits, grid) = voxelised(21.0, spacing_mm, |p| ring(back * p));
            assert!(reason(&bits, &grid, 0.0).contains(" times as wide as the thinner side"));
        }
    }
    for line in [1, 30] {
        let grid = Grid::axis_aligned([32, 3, 3], DVec3::ONE, DVec3::ZERO).unwrap();
        let mut bits = MaskBits::empty(grid.dims());
        (1..=line).for_each(|x| bits.set([x, 1, 1]));
        assert!(reason(&bits, &grid, 0.0).starts_with("found a skeleton that only gets thinner"));
    }
}

/// Bumps and flecks aren't lesions.
#[test]
fn what_is_smaller_than_the_smallest_lesion_is_not_parted() {
    let bump = row(&[12.0, 2.2], &[1.0], false);
    let (bits, grid) = voxelised(bump.half_mm(), DVec3::ONE, |p| bump.has(p));
    assert!(reason(&bits, &grid, ML).contains("largest ball is below 0.1 ml"));
    let neck = found(&bits, &grid, 0.001).unwrap();
    assert!(pieces(&bits, &grid, &neck).iter().any(|piece| piece.len() < 120));
}

/// Two balls joined by two bridges of different widths: both are cut, and the wider one is the neck's.
#[test]
fn a_ring_is_cut_at_all_its_necks() {
    let inside = |p: DVec3| {
        let bridge = |z: f64, r: f64| p.y.hypot(p.z - z) <= r && p.x.abs() <= 16.0;
        p.distance(DVec3::X * 18.0) <= 12.0
            || p.distance(DVec3::X * -18.0) <= 12.0
            || bridge(7.0, 3.0)
            || bridge(-7.0, 2.0)
    };
    let (bits, grid) = voxelised(32.0, DVec3::ONE, inside);
    let neck = found(&bits, &grid, ML).unwrap();
    assert!((2.5..=4.0).contains(&neck.radius_mm) && neck.at_mm.z > 4.0, "{neck:?}");
    let [a, b] = pieces(&bits, &grid, &neck);
    let left = if a[0].x < 0.0 { &a } else { &b };
    // Neither reaches past a bridge.
    assert!(left.iter().all(|p| p.x < 9.0) && left.len() * 3 > bits.count() as usize, "{}", left.len());
    assert!([&a, &b].iter().all(|piece| piece.len() * 2 > bits.count() as usize * 9 / 10));
}

/// Lesions that enhance at their rims alone: the neck is that of the outer surface, the pieces are connected.
#[test]
fn shells_are_cut_at_the_neck_of_their_outer_surface() {
    let balls = row(&[12.0, 12.0], &[5.0], true);
    for turn in rotations() {
        let back = turn.transpose();
        let hollow = |p: DVec3| balls.balls.iter().all(|(x, r)| p.distance(DVec3::X * *x) > *r - 3.0);
        let inside = |p: DVec3| balls.has(back * p) && hollow(back * p);
        let (bits, grid) = voxelised(balls.half_mm(), DVec3::ONE, inside);
        let neck = found(&bits, &grid, ML).unwrap();
        assert!(neck.radius_mm <= 6.0, "{neck:?}");
        let parts = at_neck(&runs_of(&bits), &grid, neck.seeds_mm).unwrap().unwrap();
        for part in &parts {
            let mut piece = MaskBits::empty(grid.dims());
            for run in part {
                (run.first..=run.last).for_each(|x| piece.set([x, run.y, run.z].map(|n| n as usize)));
            }
            assert_eq!(runs_of(&piece), *part);
        }
        let wrong = pieces(&bits, &grid, &neck).map(|piece| {
            let left = piece.iter().filter(|p| (back * **p).x < 0.0).count();
            left.min(piece.len() - left)
        });
        // A voxel's layer of the circle between.
        assert!(wrong[0] + wrong[1] <= (PI * 25.0) as usize, "{turn}: {wrong:?}");
    }
}

/// What the window does: the neck of a lesion, as an edit.
#[test]
fn a_neck_is_an_edit() {
    let joined = [cube(2, 2, 2), cube(14, 2, 2), ([8, 4, 4], [6, 2, 2])];
    let made = case(&[&joined, &[cube(2, 2, 2)]]);
    let found = find(&made, &options(), &Progress::new()).unwrap();
    let at = anchor(0, [4.0, 4.0, 4.0]);
    let proposed = neck(&found, &at, &Progress::new()).unwrap().unwrap();
    assert_eq!(neck(&found, &at, &Progress::new()).unwrap().as_ref(), Ok(&proposed));
    let edit = Edit::Split { at: at.clone(), seeds_mm: proposed.seeds_mm };
    let report = reported(&made, std::slice::from_ref(&edit));
    assert_eq!((report.edits_not_applied.len(), report.lesions.len()), (0, 2));
    // A piece has no neck: components are those after the splits before.
    let tracked = track(&found, &[edit], &Progress::new()).unwrap();
    assert!(neck(&tracked.found, &at, &Progress::new()).unwrap().is_err());
    for wrong in [anchor(1, [30.0, 30.0, 10.0]), Anchor { of: "N".into(), ..at.clone() }] {
        let reason = neck(&found, &wrong, &Progress::new()).unwrap().unwrap_err();
        let ignored = reported(&made, &[Edit::Ignore { at: wrong }]);
        assert_eq!(ignored.edits_not_applied[0].reason, reason);
    }
    let progress = Progress::new();
    progress.cancel();
    assert_eq!(neck(&found, &at, &progress), Err(LesionsError::Cancelled(crate::Cancelled)));
}

/// The neck is found on the skeleton that the program shows.
#[test]
fn seeds_are_points_of_the_skeleton() {
    let balls = row(&[10.0, 8.0], &[2.0], false);
    let (bits, grid) = voxelised(balls.half_mm(), DVec3::ONE, |p| balls.has(p));
    let neck = found(&bits, &grid, ML).unwrap();
    let all = skeleton(&bits, &grid, &SkeletonOptions::default(), &Progress::new()).unwrap().points;
    for place in [neck.at_mm, neck.seeds_mm[0], neck.seeds_mm[1]] {
        assert!(all.iter().any(|point| point.position_mm.distance(place) < 1e-9), "{place}");
    }
}
