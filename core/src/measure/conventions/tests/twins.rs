//! Every surface definition, percentile and average again by brute force, on small random masks.

use crate::{Components, Connectivity, distance::Crop, grid::ijk};
use proptest::prelude::*;
use strum::VariantArray;

use super::{super::bits, *};

/// Points in lattice steps with weights: what [`super::super::Surface`] says, one by one.
fn surface(mask: &MaskBits, corners: bool, spacing_mm: [f64; 3]) -> Vec<([i64; 3], f64)> {
    let dims = mask.dims().map(|n| n as i64);
    let active =
        |v: [i64; 3]| (0..3).all(|a| (0..dims[a]).contains(&v[a])) && mask.get(v.map(|x| x as usize));
    let mut points = Vec::new();
    for z in 0..=dims[2] {
        for y in 0..=dims[1] {
            for x in 0..=dims[0] {
                if corners {
                    let around: Vec<bool> = (0..8)
                        .map(|k| active([x - 1 + (k >> 2), y - 1 + (k >> 1 & 1), z - 1 + (k & 1)]))
                        .collect();
                    if around.contains(&true) && around.contains(&false) {
                        points.push(([x, y, z], area_mm2(&around, spacing_mm)));
                    }
                } else {
                    let near = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
                    let outside = near.iter().any(|s| !active([x + s[0], y + s[1], z + s[2]]));
                    if active([x, y, z]) && outside {
                        points.push(([x, y, z], 1.0));
                    }
                }
            }
        }
    }
    points
}

/// The area around a corner. Its figures come from the package, which `stored.rs` compares.
fn area_mm2(around: &[bool], spacing_mm: [f64; 3]) -> f64 {
    let code =
        around.iter().enumerate().fold(0, |code, (place, active)| code | usize::from(*active) << place);
    super::super::surfels::areas_mm2(spacing_mm)[code]
}

fn directed(from: &[([i64; 3], f64)], to: &[([i64; 3], f64)], spacing_mm: [f64; 3]) -> Vec<(f64, f64)> {
    let distance = |p: [i64; 3], q: [i64; 3]| {
        (0..3).map(|a| ((p[a] - q[a]) as f64 * spacing_mm[a]).powi(2)).sum::<f64>().sqrt()
    };
    from.iter().map(|p| (to.iter().map(|q| distance(p.0, q.0)).fold(f64::INFINITY, f64::min), p.1)).collect()
}

/// By the definition of linear interpolation between order statistics.
fn linear(mut values: Vec<f64>, percent: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = percent / 100.0 * (values.len() - 1) as f64;
    let (low, part) = (at as usize, at.fract());
    if part == 0.0 { values[low] } else { values[low] * (1.0 - part) + values[low + 1] * part }
}

/// The smallest distance within which the part of the area lies; rounding is left to both sides.
fn weighted(values: &[(f64, f64)], percent: f64, slack: f64) -> f64 {
    let all: f64 = values.iter().map(|v| v.1).sum();
    let within = |d: f64| values.iter().filter(|v| v.0 <= d).map(|v| v.1).sum::<f64>();
    let enough = values.iter().map(|v| v.0).filter(|&d| within(d) >= all * (percent / 100.0 + slack));
    enough.fold(f64::INFINITY, f64::min)
}

fn mean(values: &[(f64, f64)]) -> f64 {
    values.iter().map(|v| v.0 * v.1).sum::<f64>() / values.iter().map(|v| v.1).sum::<f64>()
}

fn part_within(values: &[(f64, f64)], tolerance_mm: f64) -> f64 {
    let part: f64 = values.iter().filter(|v| v.0 <= tolerance_mm).map(|v| v.1).sum();
    part / values.iter().map(|v| v.1).sum::<f64>()
}

#[track_caller]
fn close(found: Option<f64>, expected: f64, what: &str) {
    let found = found.unwrap_or(f64::NAN);
    assert!(
        (found - expected).abs() <= 1e-9 * (1.0 + expected),
        "{what}: found {found}, expected {expected}"
    );
}

fn check(a: &MaskBits, b: &MaskBits, spacing_mm: [f64; 3], percentile: f64, tolerance_mm: f64) {
    for &convention in Convention::VARIANTS {
        let settings = Settings { percentile, tolerance_mm, ..by(convention) };
        let found = compared(a, b, spacing_mm, &settings);
        let corners = matches!(convention, Convention::Deepmind | Convention::Brats);
        let [of_a, of_b] = [a, b].map(|mask| surface(mask, corners, spacing_mm));
        let [to_b, to_a] = [directed(&of_a, &of_b, spacing_mm), directed(&of_b, &of_a, spacing_mm)];
        let both: Vec<_> = to_b.iter().chain(&to_a).copied().collect();
        let most = both.iter().map(|v| v.0).fold(0.0, f64::max);
        let lengths = |values: &[(f64, f64)]| values.iter().map(|v| v.0).collect::<Vec<_>>();
        let value = |key: &str| found.value(key);
        let name = |key: &str| format!("{} {key} {spacing_mm:?}", convention.name());
        close(value("hd_mm"), most, &name("hd_mm"));
        let robust = value(&format!("hd{percentile}_mm"));
        match convention {
            Convention::Deepmind | Convention::Brats => {
                let bounds = [-1e-9, 1e-9]
                    .map(|slack| weighted(&to_b, percentile, slack).max(weighted(&to_a, percentile, slack)));
                let robust = robust.unwrap();
                assert!(robust >= bounds[0] - 1e-9 && robust <= bounds[1] + 1e-9, "{robust} of {bounds:?}");
            }
            Convention::MetricsReloaded => close(
                robust,
                linear(lengths(&to_b), percentile).max(linear(lengths(&to_a), percentile)),
                &name("robust"),
            ),
            Convention::Medpy | Convention::Panoptica => {
                close(robust, linear(lengths(&both), percentile), &name("robust"));
            }
        }
        let means = (mean(&to_b) + mean(&to_a)) / 2.0;
        match convention {
            Convention::Deepmind | Convention::MetricsReloaded => {
                close(value("assd_mm"), mean(&both), &name("assd_mm"));
                close(value("masd_mm"), means, &name("masd_mm"));
                close(value("nsd"), part_within(&both, tolerance_mm), &name("nsd"));
            }
            Convention::Medpy => close(value("assd_mm"), mean(&both), &name("assd_mm")),
            Convention::Panoptica => {
                close(value("assd_mm"), means, &name("assd_mm"));
                let parts = [&to_b, &to_a].map(|d| part_within(d, tolerance_mm));
                close(value("nsd"), (parts[0] + parts[1]) / 2.0, &name("nsd"));
            }
            Convention::Brats => assert_eq!([value("assd_mm"), value("masd_mm"), value("nsd")], [None; 3]),
        }
        let points = found.hausdorff.unwrap();
        close(Some(points.on_reference_mm.distance(points.on_compared_mm)), most, "points");
        let on_surface = |mm: DVec3, points: &[([i64; 3], f64)]| {
            let lattice = grid(a.dims(), spacing_mm).voxel_from_world().transform_point3(mm);
            let shifted = if corners { lattice + 0.5 } else { lattice };
            points.iter().any(|p| DVec3::from_array(p.0.map(|x| x as f64)).distance(shifted) < 1e-9)
        };
        assert!(on_surface(points.on_reference_mm, &of_a) && on_surface(points.on_compared_mm, &of_b));
    }
}

fn spacing() -> impl Strategy<Value = [f64; 3]> {
    prop_oneof![Just([1.0; 3]), Just([0.5, 0.5, 6.0]), Just([0.7, 1.3, 0.9]), Just([4.0, 0.25, 1.0])]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn values_are_those_of_the_definitions(
        dims in [1_usize..9, 1_usize..7, 1_usize..6],
        seed in any::<u64>(),
        percents in [1_u64..100, 1_u64..100],
        spacing_mm in spacing(),
        percentile in prop_oneof![Just(95.0), Just(50.0), Just(99.0), Just(100.0)],
    ) {
        let [mut a, mut b] = [noise(seed, dims, percents[0]), noise(seed ^ 77, dims, percents[1])];
        a.set([0; 3]);
        b.set([dims[0] - 1, 0, 0]);
        check(&a, &b, spacing_mm, percentile, 1.1);
    }

    #[test]
    fn parts_and_dilations_are_those_of_the_definitions(
        dims in [1_usize..150, 1_usize..6, 1_usize..5],
        seed in any::<u64>(),
        at in any::<[prop::sample::Index; 6]>(),
    ) {
        let mask = noise(seed, dims, 20);
        let start = [0, 1, 2].map(|a| at[a].index(dims[a]));
        let crop = Crop { start, dims: [0, 1, 2].map(|a| 1 + at[3 + a].index(dims[a] - start[a])) };
        let part = MaskBits::from_fn(crop.dims, |linear| {
            let v = ijk(crop.dims, linear);
            mask.get([0, 1, 2].map(|a| v[a] + start[a]))
        });
        prop_assert_eq!(crop.part_of(&mask), part);
        let sparse = noise(seed, dims, 2);
        let once = |mask: &MaskBits| MaskBits::from_fn(dims, |linear| {
            let v = ijk(dims, linear);
            (0..27).any(|k| {
                let step = [k % 3, k / 3 % 3, k / 9];
                let axes = step.iter().filter(|s| **s != 1).count();
                let near = [0, 1, 2].map(|a| (v[a] + step[a]).wrapping_sub(1));
                axes < 3 && (0..3).all(|a| near[a] < dims[a]) && mask.get(near)
            })
        });
        prop_assert_eq!(bits::dilated(&sparse, 2), once(&once(&sparse)));
    }

    /// Lesions by labelling everything again for each.
    #[test]
    fn lesions_are_those_of_the_script(seed in any::<u64>(), percents in [1_u64..12, 1_u64..12]) {
        let (dims, spacing_mm) = ([14, 11, 8], [1.0, 2.0, 3.0]);
        let [a, b] = [noise(seed, dims, percents[0]), noise(!seed, dims, percents[1])];
        let rule = super::super::LesionRule { dilations: 1, ignored_mm3: 6.0 };
        let found = compared(&a, &b, spacing_mm, &Settings { lesion_rule: rule, ..by(Convention::Brats) });
        let near = Components::of_mask(&bits::dilated(&a, 1), Connectivity::TwentySix).unwrap().labels(dims);
        let lesions = Components::of_mask(&b, Connectivity::TwentySix).unwrap().labels(dims);
        let (mut dice, mut distance, mut n) = (0.0, 0.0, 0.0);
        let mut hit = std::collections::BTreeSet::<u32>::new();
        for label in 1..=near.iter().copied().max().unwrap_or(0) {
            let voxels = 0..near.len();
            let theirs: std::collections::BTreeSet<u32> =
                voxels.filter(|&l| near[l] == label && lesions[l] > 0).map(|l| lesions[l]).collect();
            hit.extend(&theirs);
            let one = MaskBits::from_fn(dims, |l| near[l] == label && a.get(ijk(dims, l)));
            let other = MaskBits::from_fn(dims, |l| theirs.contains(&lesions[l]));
            if one.count() as f64 * 6.0 > 6.0 {
                let pair = compared(&one, &other, spacing_mm, &by(Convention::Deepmind));
                dice += pair.value("dice").unwrap();
                distance += pair.value("hd95_mm").filter(|d| d.is_finite()).unwrap_or(374.0);
                n += 1.0;
            }
        }
        let false_positives = f64::from(lesions.iter().copied().max().unwrap_or(0)) - hit.len() as f64;
        let report = found.lesions.unwrap();
        prop_assert_eq!(report.false_positives as f64, false_positives);
        prop_assert_eq!((report.found + report.missed) as f64, n);
        let all = n + false_positives;
        close(report.dice, if all > 0.0 { dice / all } else { 1.0 }, "dice");
        let mm = (distance + 374.0 * false_positives) / all;
        close(report.hd_percentile_mm, if all > 0.0 { mm } else { 0.0 }, "distance");
    }
}

/// The three ways to the nearest point: looking around, the whole lattice, the tree.
#[test]
fn near_and_far_points_are_found() {
    let dims = [70, 50, 40];
    let one = boxes(dims, &[([3, 4, 5], [6, 5, 4])]);
    let far = boxes(dims, &[([60, 40, 30], [1, 1, 2])]);
    check(&one, &far, [0.9, 1.1, 2.0], 95.0, 1.0);
    let wide = boxes(dims, &[([0, 0, 0], [70, 50, 1])]);
    let below = boxes(dims, &[([0, 0, 12], [70, 20, 1]), ([30, 10, 2], [5, 5, 2])]);
    check(&wide, &below, [1.0, 1.0, 1.0], 95.0, 1.0);
}
