//! Closed forms, and brute force that clips lines by every pixel.

use std::time::Instant;

use crate::{
    Components, Connectivity, MaskBits, Sides,
    glam::{DAffine3, DMat3},
    optics::random::Random,
};
use proptest::prelude::*;

use super::*;

fn grid(dims: [usize; 3], spacing_mm: [f64; 3]) -> Grid {
    Grid::axis_aligned(dims, DVec3::from_array(spacing_mm), DVec3::splat(-7.0)).unwrap()
}

/// All voxels as runs, whether connected or not.
fn runs_of(bits: &MaskBits) -> Vec<Run> {
    let components = Components::of_mask(bits, Connectivity::TwentySix).unwrap();
    components.list().iter().flat_map(|component| components.runs(component).to_vec()).collect()
}

fn measured(bits: &MaskBits, grid: &Grid, mode: DiameterMode) -> Diameters {
    diameters(grid, &runs_of(bits), 2, mode).unwrap()
}

fn of_rows(rows: &[&str]) -> MaskBits {
    let width = rows[0].len();
    MaskBits::from_fn([width, rows.len(), 1], |l| rows[l / width].as_bytes()[l % width] == b'#')
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * (1.0 + b.abs())
}

const BOTH: [DiameterMode; 2] = [DiameterMode::LongestThenPerpendicular, DiameterMode::LargestProduct];

#[test]
fn a_voxel_has_the_diagonals_of_its_square() {
    let bits = MaskBits::full([1, 1, 1]);
    let grid = grid([1, 1, 1], [1.0, 1.0, 3.0]);
    for mode in BOTH {
        let found = measured(&bits, &grid, mode);
        let diagonal = 2.0_f64.sqrt();
        assert!(close(found.d1.length_mm, diagonal) && close(found.d2.length_mm, diagonal), "{found:?}");
        assert!(close(found.product_mm2, 2.0) && found.crosses && !found.measurable());
        assert!(close(found.slice_thickness_mm, 3.0) && found.slices == 1 && found.slice == 0);
        // From corner to corner about the centre.
        let middle = (found.d1.from_mm + found.d1.to_mm) / 2.0;
        assert!(middle.distance(grid.center_of_voxel_mm([0, 0, 0])) < 1e-12);
        assert!(close(found.d1.from_mm.distance(found.d1.to_mm), diagonal));
    }
    assert_eq!(diameters(&grid, &[], 2, DiameterMode::default()), None);
    assert_eq!(diameters(&grid, &runs_of(&bits), 3, DiameterMode::default()), None);
}

/// A rectangle of a by b: the diagonal, and across it b·√(a²+b²)/a where that fits (a ≥ b). The largest product in a
/// rectangle longer than wide: the diagonal-like pair or side by side; the code's must not be below either.
#[test]
fn a_rectangle_has_its_diagonal_and_the_line_across() {
    for (nx, ny, spacing) in [(8, 3, [1.0, 1.0, 1.0]), (5, 5, [0.5, 0.7, 6.0]), (12, 1, [1.0, 2.0, 1.0])] {
        let bits = MaskBits::full([nx, ny, 1]);
        let grid = grid([nx, ny, 1], spacing);
        let (a, b) = (nx as f64 * spacing[0], ny as f64 * spacing[1]);
        let (long, short) = (a.max(b), a.min(b));
        let found = measured(&bits, &grid, DiameterMode::default());
        assert!(close(found.d1.length_mm, a.hypot(b)), "{found:?}");
        assert!(close(found.d2.length_mm, short * a.hypot(b) / long), "{found:?}");
        let product = measured(&bits, &grid, DiameterMode::LargestProduct).product_mm2;
        assert!(product >= found.product_mm2 * (1.0 - 1e-12) && product >= long * short, "{product}");
    }
}

/// An L of two arms of 10 by 2: from the end (0, 0) of an arm past the inner corner (2, 8) to (2.5, 10). The tips of both
/// arms are 11.3 apart or more, outside the L.
#[test]
fn chords_do_not_leave_an_l() {
    let rows = ["##........"; 8].into_iter().chain(["##########"; 2]).collect::<Vec<_>>();
    let bits = of_rows(&rows);
    let grid = grid(bits.dims(), [1.0; 3]);
    let found = measured(&bits, &grid, DiameterMode::default());
    assert!(close(found.d1.length_mm, 106.25_f64.sqrt()), "{found:?}");
    assert!(close(found.d1.length_mm, brute_longest(&bits, &grid)));
}

#[test]
fn chords_do_not_cross_the_hole_of_a_ring() {
    let n = 101;
    let (outer, inner) = (45.0_f64, 30.0_f64);
    let bits = MaskBits::from_fn([n, n, 1], |l| {
        let r = (l % n) as f64 - 50.0;
        let r = r.hypot((l / n) as f64 - 50.0);
        (inner..=outer).contains(&r)
    });
    let grid = grid([n, n, 1], [1.0; 3]);
    let found = measured(&bits, &grid, DiameterMode::default());
    let expected = 2.0 * (outer * outer - inner * inner).sqrt();
    assert!((found.d1.length_mm / expected - 1.0).abs() < 0.03, "{} {expected}", found.d1.length_mm);
    // No point of either chord lies in the hole.
    for chord in [found.d1, found.d2] {
        for step in 0..=1000 {
            let p = chord.from_mm.lerp(chord.to_mm, f64::from(step) / 1000.0);
            let v = grid.voxel_from_world().transform_point3(p);
            assert!((v.x - 50.0).hypot(v.y - 50.0) > inner - 1.0);
        }
    }
}

/// Pixels that touch at a corner are one piece, and a chord passes through the corner; others are apart.
#[test]
fn corners_connect_and_gaps_do_not() {
    let diagonal = of_rows(&["#...", ".#..", "..#.", "...#"]);
    let g = grid(diagonal.dims(), [1.0; 3]);
    let found = measured(&diagonal, &g, DiameterMode::default());
    assert!(
        close(found.d1.length_mm, 32.0_f64.sqrt()) && close(found.d2.length_mm, 2.0_f64.sqrt()),
        "{found:?}"
    );
    let apart = of_rows(&["###.##", "......", "#....."]);
    let found = measured(&apart, &grid(apart.dims(), [1.0; 3]), DiameterMode::default());
    assert!(close(found.d1.length_mm, 10.0_f64.sqrt()), "{found:?}");
}

/// Rows of the tables in `docs/lesions.md`: discs and ellipses at all angles and places between pixels.
#[test]
fn ellipses_at_all_angles_are_measured_within_a_pixel() {
    for (a, b) in [(10.0, 10.0), (15.0, 10.0), (20.0, 5.0)] {
        for pixel in [2.0, 1.0, 0.5, 0.25] {
            let mut errors = [(0.0_f64, 0.0_f64, 0.0_f64, 0); 2];
            for turn in 0..36 {
                let angle = f64::from(turn) * 5.0_f64.to_radians();
                let (sin, cos) = angle.sin_cos();
                let (ox, oy) =
                    ((f64::from(turn) * 0.37).fract() * pixel, (f64::from(turn) * 0.71).fract() * pixel);
                let n = (2.2 * 20.0 / pixel) as usize + 4;
                let bits = MaskBits::from_fn([n, n, 1], |l| {
                    let x = ((l % n) as f64 - n as f64 / 2.0) * pixel + ox;
                    let y = ((l / n) as f64 - n as f64 / 2.0) * pixel + oy;
                    let (x, y) = (x * cos + y * sin, y * cos - x * sin);
                    (x / a).powi(2) + (y / b).powi(2) <= 1.0
                });
                let grid = grid([n, n, 1], [pixel, pixel, 1.0]);
                let truth = [2.0 * a, 2.0 * b];
                let found = measured(&bits, &grid, DiameterMode::default());
                let product = measured(&bits, &grid, DiameterMode::LargestProduct);
                assert!(product.product_mm2 >= found.product_mm2 * (1.0 - 1e-9));
                for ((sum, worst, _, count), mm) in
                    errors.iter_mut().zip([found.d1.length_mm - truth[0], found.d2.length_mm - truth[1]])
                {
                    *sum += mm;
                    *worst = worst.max(mm.abs());
                    *count += 1;
                }
                errors[0].2 += found.product_mm2 / (truth[0] * truth[1]) - 1.0;
                errors[1].2 += product.product_mm2 / (truth[0] * truth[1]) - 1.0;
            }
            let mean = |e: &(f64, f64, f64, i32)| e.0 / f64::from(e.3);
            println!(
                "{a} x {b}, pixel {pixel}: d1 {:+.2} (worst {:.2}), d2 {:+.2} (worst {:.2}) mm, product {:+.1} %, largest {:+.1} %",
                mean(&errors[0]),
                errors[0].1,
                mean(&errors[1]),
                errors[1].1,
                100.0 * errors[0].2 / 36.0,
                100.0 * errors[1].2 / 36.0
            );
            // Each end lies at most a pixel's diagonal outside.
            assert!(errors[0].1 < 1.5 * pixel && errors[1].1 < 2.5 * pixel, "{a} {b} {pixel} {errors:?}");
        }
    }
}

/// The axial axis, thick slices and the number of slices decide what is measurable.
#[test]
fn measurable_needs_two_slices_and_ten_millimetres() {
    let of = |dims: [usize; 3], spacing: [f64; 3]| {
        measured(&MaskBits::full(dims), &grid(dims, spacing), DiameterMode::default())
    };
    assert!(of([10, 10, 2], [1.0, 1.0, 5.0]).measurable());
    assert!(!of([10, 10, 1], [1.0, 1.0, 5.0]).measurable());
    assert!(!of([7, 7, 2], [1.0, 1.0, 5.0]).measurable(), "diagonal 9.9");
    assert!(!of([8, 8, 2], [1.0, 1.0, 6.0]).measurable(), "11.3 below 12");
    assert!(of([9, 9, 2], [1.0, 1.0, 6.0]).measurable(), "12.7");
    let m = DMat3::from_cols(DVec3::Y, DVec3::Z * -5.0, DVec3::X);
    let turned = DAffine3 { matrix3: m, translation: DVec3::ZERO };
    let sagittal = Grid::new([4, 4, 4], turned, Sides::Known).unwrap();
    assert_eq!(axial_axis(&sagittal), 1);
    let found =
        diameters(&sagittal, &runs_of(&MaskBits::full([4, 3, 2])), 1, DiameterMode::default()).unwrap();
    assert!(close(found.slice_thickness_mm, 5.0) && found.slices == 3, "{found:?}");
    assert!(close(found.d1.length_mm, 20.0_f64.sqrt()), "4 by 2 voxels in the plane: {found:?}");
}

/// The parts of the line through `p` in direction `d` (in pixels) inside the closed pixels, by clipping with each.
fn inside(bits: &MaskBits, p: [f64; 2], d: [f64; 2]) -> Vec<[f64; 2]> {
    let [nx, ny, _] = bits.dims();
    let mut parts: Vec<[f64; 2]> = Vec::new();
    for l in (0..nx * ny).filter(|l| bits.get([l % nx, l / nx, 0])) {
        let pixel = [(l % nx) as f64, (l / nx) as f64];
        let (mut lo, mut hi) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..2 {
            if d[axis].abs() < 1e-12 {
                if p[axis] < pixel[axis] - 1e-9 || p[axis] > pixel[axis] + 1.0 + 1e-9 {
                    lo = f64::INFINITY;
                }
                continue;
            }
            let t = [(pixel[axis] - p[axis]) / d[axis], (pixel[axis] + 1.0 - p[axis]) / d[axis]];
            lo = lo.max(t[0].min(t[1]));
            hi = hi.min(t[0].max(t[1]));
        }
        if lo <= hi + 1e-9 {
            parts.push([lo, hi.max(lo)]);
        }
    }
    parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut joined: Vec<[f64; 2]> = Vec::new();
    for part in parts {
        match joined.last_mut() {
            Some(last) if part[0] <= last[1] + 1e-9 => last[1] = last[1].max(part[1]),
            _ => joined.push(part),
        }
    }
    joined
}

fn length(grid: &Grid, d: [f64; 2]) -> f64 {
    let m = grid.world_from_voxel().matrix3;
    (m.x_axis * d[0] + m.y_axis * d[1]).length()
}

fn brute_longest_in(bits: &MaskBits, grid: &Grid, p: [f64; 2], d: [f64; 2]) -> f64 {
    let parts = inside(bits, p, d);
    parts.iter().map(|part| part[1] - part[0]).fold(0.0, f64::max) * length(grid, d)
}

/// Every pair of lattice corners of the box, extended as far as the line stays inside.
fn brute_longest(bits: &MaskBits, grid: &Grid) -> f64 {
    let [nx, ny, _] = bits.dims();
    let corners: Vec<[f64; 2]> = (0..=ny).flat_map(|y| (0..=nx).map(move |x| [x as f64, y as f64])).collect();
    let mut best = 0.0_f64;
    for (n, p) in corners.iter().enumerate() {
        for q in &corners[..n] {
            best = best.max(brute_longest_in(bits, grid, *p, [q[0] - p[0], q[1] - p[1]]));
        }
    }
    best
}

/// The longest chord in direction `d`: through every corner of the box, and many places between.
fn brute_in_direction(bits: &MaskBits, grid: &Grid, d: [f64; 2], offsets: usize) -> f64 {
    let [nx, ny, _] = bits.dims();
    let mut best = 0.0_f64;
    for y in 0..=ny {
        for x in 0..=nx {
            best = best.max(brute_longest_in(bits, grid, [x as f64, y as f64], d));
        }
    }
    for at in 0..offsets {
        let t = (at as f64 + 0.5) / offsets as f64;
        let p = [t * nx as f64, if d[0] * d[1] > 0.0 { (1.0 - t) * ny as f64 } else { t * ny as f64 }];
        best = best.max(brute_longest_in(bits, grid, p, d));
    }
    best
}

fn random_piece(seed: u64, nx: usize, ny: usize, share: u64) -> MaskBits {
    let bits = MaskBits::from_fn([nx, ny, 1], |at| {
        (at as u64 + 1).wrapping_mul(seed | 1).rotate_left(23).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33 & 15
            < share
    });
    let components = Components::of_mask(&bits, Connectivity::TwentySix).unwrap();
    let mut out = MaskBits::empty([nx, ny, 1]);
    if let Some(largest) = components.list().iter().max_by_key(|c| c.voxels) {
        for run in components.runs(largest) {
            (run.first..=run.last).for_each(|x| out.set([x as usize, run.y as usize, 0]));
        }
    } else {
        out.set([0, 0, 0]);
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Pixels of any size, sheared too.
    #[test]
    fn random_pieces_agree_with_brute_force(
        seed in any::<u64>(), nx in 1_usize..8, ny in 1_usize..8, share in 4_u64..16,
        sy in 0.3_f64..3.0, shear in prop_oneof![Just(0.0), -0.5_f64..0.5],
    ) {
        let bits = random_piece(seed, nx, ny, share);
        let m = DMat3::from_cols(DVec3::X, DVec3::new(shear, sy, 0.0), DVec3::Z);
        let affine = DAffine3 { matrix3: m, translation: DVec3::splat(3.0) };
        let grid = Grid::new([nx, ny, 1], affine, Sides::Known).unwrap();
        let found = measured(&bits, &grid, DiameterMode::default());
        let brute = brute_longest(&bits, &grid);
        prop_assert!((found.d1.length_mm - brute).abs() < 1e-7, "{} {brute}", found.d1.length_mm);
        for diameters in [found, measured(&bits, &grid, DiameterMode::LargestProduct)] {
            let index = |p: DVec3| {
                let v = grid.voxel_from_world().transform_point3(p);
                [v.x + 0.5, v.y + 0.5]
            };
            // Both lie inside, at right angles, and have the stated length.
            let along = diameters.d1.to_mm - diameters.d1.from_mm;
            let across = diameters.d2.to_mm - diameters.d2.from_mm;
            prop_assert!(along.dot(across).abs() < 1e-7 * along.length() * across.length());
            for chord in [diameters.d1, diameters.d2] {
                prop_assert!((chord.from_mm.distance(chord.to_mm) - chord.length_mm).abs() < 1e-9);
                let (p, q) = (index(chord.from_mm), index(chord.to_mm));
                let parts = inside(&bits, p, [q[0] - p[0], q[1] - p[1]]);
                prop_assert!(parts.iter().any(|part| part[0] <= 1e-6 && part[1] >= 1.0 - 1e-6), "{parts:?}");
            }
            // Of its direction, the longest across.
            let (p, q) = (index(diameters.d2.from_mm), index(diameters.d2.to_mm));
            let d = [q[0] - p[0], q[1] - p[1]];
            let brute = brute_in_direction(&bits, &grid, d, 50);
            if diameters.mode == DiameterMode::LongestThenPerpendicular {
                prop_assert!((diameters.d2.length_mm - brute).abs() < 1e-6, "{} {brute}", diameters.d2.length_mm);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// No direction has a larger product of its longest chord and the longest across.
    #[test]
    fn no_direction_has_a_larger_product(
        seed in any::<u64>(), nx in 2_usize..7, ny in 2_usize..7, share in 6_u64..16, sy in 0.5_f64..2.0,
    ) {
        let bits = random_piece(seed, nx, ny, share);
        let grid = grid([nx, ny, 1], [1.0, sy, 1.0]);
        let found = measured(&bits, &grid, DiameterMode::LargestProduct);
        let metric = Metric { uu: 1.0, uv: 0.0, vv: sy * sy };
        let of = |d: [f64; 2]| {
            let [along, across] = [d, metric.perpendicular(d)].map(|d| brute_in_direction(&bits, &grid, d, 0));
            along * across
        };
        let turned = (0..90).map(|step| {
            let (sin, cos) = (f64::from(step).to_radians() * 2.0).sin_cos();
            of([cos, sin / sy])
        });
        let any = turned.fold(0.0, f64::max);
        prop_assert!(any <= found.product_mm2 * (1.0 + 1e-6), "{any} {}", found.product_mm2);
        // Directions from corner to corner.
        let (nx, ny) = (nx as i32, ny as i32);
        let critical = (-nx..=nx).flat_map(|a| (0..=ny).map(move |b| [f64::from(a), f64::from(b)]));
        let best = critical.filter(|d| *d != [0.0; 2]).map(of).fold(0.0, f64::max);
        prop_assert!(close(best, found.product_mm2), "{best} {}", found.product_mm2);
    }
}

/// Discs with pixels missing at random: what the ellipse around them leaves out changes no result.
#[test]
fn pruned_searches_find_what_full_ones_do() {
    let metric = Metric { uu: 1.0, uv: 0.2, vv: 1.69 };
    for seed in 0..60 {
        let n = 27_usize;
        let bits = MaskBits::from_fn([n, n, 1], |l| {
            let (x, y) = ((l % n) as f64 - 13.0, (l / n) as f64 - 13.0);
            x.hypot(1.3 * y) < 13.0 && Random::new(seed, l as u64).unit() < 0.9
        });
        let pieces = slices::pieces(&runs_of(&bits), 2);
        let piece = Piece::new(pieces[&0].iter().max_by_key(|pixels| pixels.len()).unwrap());
        let mut all = Vec::new();
        piece.critical_chords(&metric, 0.0, |chord| {
            all.push(chord.length_mm);
            0.0
        });
        let longest_mm = all.iter().copied().fold(0.0, f64::max);
        let longest = piece.longest(&metric, 0.0);
        assert!(close(longest[0].length_mm, longest_mm), "{seed}: {longest:?} {longest_mm}");
        // A least length just below the longest leaves it.
        let least_mm = longest_mm * (1.0 - 1e-9);
        let mut found = 0;
        piece.critical_chords(&metric, least_mm, |_| {
            found += 1;
            least_mm
        });
        let expected = all.iter().filter(|mm| **mm >= least_mm).count();
        assert!(found == expected && found > 0, "{seed}: {found} {expected}");
        let across = piece.longest_across([1.0, 0.3], &metric, 0.0).unwrap();
        let again = piece.longest_across([1.0, 0.3], &metric, across.length_mm * (1.0 - 1e-9)).unwrap();
        assert!(close(across.length_mm, again.length_mm));
    }
}

/// 100,000 voxels and more: a ball, a thin shell, a ball with a frayed edge, one with holes everywhere. The limit is loose:
/// tests run beside others.
#[test]
fn large_components_are_quick() {
    let n = 64;
    let radius = |l: usize| {
        let p = [l % n, l / n % n, l / n / n].map(|v| v as f64 - 31.5);
        (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt()
    };
    let noise = |l: usize| Random::new(1, l as u64).unit();
    let ball = MaskBits::from_fn([n; 3], |l| radius(l) <= 29.0);
    let shell = MaskBits::from_fn([n; 3], |l| (24.0..=31.0).contains(&radius(l)));
    let frayed = MaskBits::from_fn([n; 3], |l| radius(l) + 8.0 * noise(l) <= 33.0);
    let spongy = MaskBits::from_fn([n; 3], |l| radius(l) <= 31.0 && noise(l) < 0.85);
    let grid = grid([n; 3], [1.0; 3]);
    for (name, bits) in [("ball", ball), ("shell", shell), ("frayed", frayed), ("spongy", spongy)] {
        let runs = runs_of(&bits);
        for mode in BOTH {
            let started = Instant::now();
            let found = diameters(&grid, &runs, 2, mode).unwrap();
            let seconds = started.elapsed().as_secs_f64();
            println!(
                "{name}: {} voxels, {mode:?}: {:.1} ms, {:.2} x {:.2}",
                bits.count(),
                1e3 * seconds,
                found.d1.length_mm,
                found.d2.length_mm
            );
            assert!(seconds < if name == "ball" { 0.1 } else { 10.0 }, "{name} {mode:?}: {seconds}");
        }
    }
}
