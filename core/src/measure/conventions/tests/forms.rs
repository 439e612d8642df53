//! Closed forms, empty masks, grids.

use crate::Sides;
use glam::{DAffine3, DMat3};
use strum::VariantArray;

use super::{
    super::{CONVENTIONS, METRICS, NoDistances, Unequal},
    *,
};

const ALL: &[Convention] = Convention::VARIANTS;

#[test]
fn every_convention_has_its_row_and_name() {
    for (convention, row) in ALL.iter().zip(CONVENTIONS) {
        assert_eq!((convention.row().convention, row.convention), (*convention, *convention));
        assert_eq!(Convention::of_name(convention.name()), Some(*convention));
        assert_eq!(serde_json::to_string(convention).unwrap(), format!("\"{}\"", convention.name()));
    }
    assert_eq!(CONVENTIONS.len(), ALL.len());
    assert_eq!(
        ALL.iter().map(|c| c.name()).collect::<Vec<_>>(),
        ["deepmind", "metrics-reloaded", "medpy", "brats", "panoptica"]
    );
    assert_eq!((Convention::default(), Convention::of_name("itk")), (Convention::Deepmind, None));
}

/// A box moved along an axis: the far side is as far from the other box as it was moved.
#[test]
fn a_moved_box_is_as_far_as_it_was_moved() {
    let (dims, spacing_mm) = ([40, 30, 16], [0.5, 0.5, 6.0]);
    let at = |lo| boxes(dims, &[(lo, [12, 10, 5])]);
    for (lo, shift_mm) in
        [([10, 6, 4], 0.0), ([15, 6, 4], 2.5), ([10, 9, 4], 1.5), ([10, 6, 7], 18.0), ([14, 9, 4], 2.5)]
    {
        for &convention in ALL {
            let found = compared(&at([10, 6, 4]), &at(lo), spacing_mm, &by(convention));
            assert_eq!(found.value("hd_mm"), Some(shift_mm), "{convention:?} {lo:?}");
        }
    }
}

/// By hand: 12 × 10 × 5 voxels, 5 of 12 moved out.
#[test]
fn overlaps_are_counted() {
    let dims = [40, 30, 16];
    let [a, b] = [[10, 6, 4], [15, 6, 4]].map(|lo| boxes(dims, &[(lo, [12, 10, 5])]));
    let c = boxes(dims, &[([10, 6, 4], [12, 10, 2])]);
    let found = compared(&a, &b, [1.0; 3], &by(Convention::Deepmind));
    for (key, expected) in [
        ("dice", 7.0 / 12.0),
        ("jaccard", 7.0 / 17.0),
        ("volume_similarity", 1.0),
        ("sensitivity", 7.0 / 12.0),
    ] {
        assert_near(found.value(key), Some(expected), key);
    }
    let found = compared(&a, &c, [1.0; 3], &by(Convention::Deepmind));
    for (key, expected) in [
        ("relative_volume_difference", -0.6),
        ("volume_similarity", 1.0 - 360.0 / 840.0),
        ("sensitivity", 0.4),
        ("precision", 1.0),
        // Of 19,200 voxels 18,840 agree; by chance 600·240 + 18,600·18,960 of 19,200².
        (
            "kappa",
            (18_840.0 / 19_200.0 - 352_800_000.0 / 368_640_000.0) / (1.0 - 352_800_000.0 / 368_640_000.0),
        ),
    ] {
        assert_near(found.value(key), Some(expected), key);
    }
    assert_eq!((found.overlap.reference, found.overlap.compared, found.overlap.both), (600, 240, 240));
}

/// Balls of 6 and 10 mm about one voxel: surfaces are 4 mm apart, up to the size of a voxel (0.5 mm).
#[test]
fn concentric_balls_are_apart_by_their_radii() {
    let dims = [51, 51, 51];
    let ball = |radius_mm: f64| {
        MaskBits::from_fn(dims, |linear| {
            let v = crate::grid::ijk(dims, linear).map(|x| (x as f64 - 25.0) * 0.5);
            v.iter().map(|x| x * x).sum::<f64>() <= radius_mm * radius_mm
        })
    };
    let (small, large) = (ball(6.0), ball(10.0));
    for &convention in ALL {
        let found = compared(&small, &large, [0.5; 3], &by(convention));
        for key in ["hd_mm", "hd95_mm", "assd_mm", "masd_mm"] {
            let value = found.value(key);
            assert!(value.is_none_or(|mm| (mm - 4.0).abs() < 0.5), "{convention:?} {key} {value:?}");
        }
        assert!(found.value("hd_mm").is_some() && found.value("hd95_mm").is_some());
        for (tolerance_mm, expected) in [(3.2, 0.0), (4.8, 1.0)] {
            let found = compared(&small, &large, [0.5; 3], &Settings { tolerance_mm, ..by(convention) });
            assert!(found.value("nsd").is_none_or(|nsd| nsd == expected), "{convention:?}");
        }
    }
}

#[test]
fn a_mask_is_itself_and_distances_have_no_direction() {
    let (dims, spacing_mm) = ([17, 9, 7], [0.5, 0.7, 3.0]);
    let [a, b] = [noise(5, dims, 20), noise(6, dims, 35)];
    for &convention in ALL {
        let same = compared(&a, &a, spacing_mm, &by(convention));
        for (key, value) in &same.values {
            let expected = if key.ends_with("_mm") || key.contains("difference") { 0.0 } else { 1.0 };
            assert!(value.is_none_or(|value| (value - expected).abs() < 1e-12), "{convention:?} {key}");
        }
        assert_eq!(same.value("hd_mm"), Some(0.0));
        let [there, back] =
            [compared(&a, &b, spacing_mm, &by(convention)), compared(&b, &a, spacing_mm, &by(convention))];
        for key in
            ["dice", "jaccard", "volume_similarity", "kappa", "hd_mm", "hd95_mm", "assd_mm", "masd_mm", "nsd"]
        {
            assert_near(there.value(key), back.value(key), key);
        }
        assert_eq!(there.value("sensitivity"), back.value("precision"));
        let lesions = there.lesions.map(|l| l.found + l.missed + l.ignored + l.false_positives);
        assert_eq!(lesions.is_some(), matches!(convention, Convention::Brats | Convention::Panoptica));
    }
}

/// Empty masks as the packages have them; both, only the reference, only the other.
#[test]
fn empty_masks_give_what_the_packages_give() {
    const INF: Option<f64> = Some(f64::INFINITY);
    const ONE: Option<f64> = Some(1.0);
    const ZERO: Option<f64> = Some(0.0);
    const FAR: Option<f64> = Some(374.0);
    let dims = [6, 5, 4];
    let [empty, full] = [MaskBits::empty(dims), boxes(dims, &[([1, 1, 1], [3, 2, 2])])];
    let keys = [
        "dice",
        "jaccard",
        "relative_volume_difference",
        "sensitivity",
        "precision",
        "hd_mm",
        "hd95_mm",
        "assd_mm",
        "masd_mm",
        "nsd",
    ];
    let n = None;
    for (convention, expected) in [
        (
            Convention::Deepmind,
            [
                [n, n, n, n, n, INF, INF, n, n, n],
                [ZERO, ZERO, n, n, ZERO, INF, INF, INF, n, ZERO],
                [ZERO, ZERO, Some(-1.0), ZERO, n, INF, INF, INF, n, ZERO],
            ],
        ),
        (
            Convention::MetricsReloaded,
            [
                [ONE, n, ZERO, n, n, ZERO, ZERO, ZERO, ZERO, n],
                [ZERO, ZERO, ONE, n, ZERO, n, n, n, n, n],
                [ZERO, ZERO, Some(-1.0), ZERO, ZERO, n, n, n, n, n],
            ],
        ),
        (
            Convention::Medpy,
            [
                [ONE, ONE, n, ZERO, ZERO, n, n, n, n, n],
                [ZERO, ZERO, n, ZERO, ZERO, n, n, n, n, n],
                [ZERO, ZERO, Some(-1.0), ZERO, ZERO, n, n, n, n, n],
            ],
        ),
        (
            Convention::Brats,
            [
                [ONE, n, n, ONE, n, ZERO, ZERO, n, n, n],
                [ZERO, ZERO, n, ZERO, ZERO, FAR, FAR, n, n, n],
                [ZERO, ZERO, Some(-1.0), ZERO, n, FAR, FAR, n, n, n],
            ],
        ),
        (
            Convention::Panoptica,
            [
                [n; 10],
                [ZERO, ZERO, n, n, ZERO, INF, INF, INF, n, ZERO],
                [ZERO, ZERO, n, ZERO, n, INF, INF, INF, n, ZERO],
            ],
        ),
    ] {
        for (pair, expected) in [[&empty, &empty], [&empty, &full], [&full, &empty]].into_iter().zip(expected)
        {
            let found = compared(pair[0], pair[1], [1.0; 3], &by(convention));
            let values = keys.map(|key| found.value(key));
            assert_eq!(values, expected, "{convention:?} {} {}", pair[0].count(), pair[1].count());
            assert_eq!((found.hausdorff, found.no_distances), (None, None));
        }
    }
}

#[test]
fn lesions_of_empty_masks() {
    let dims = [9, 5, 4];
    let [empty, two] =
        [MaskBits::empty(dims), boxes(dims, &[([0, 0, 0], [2, 5, 2]), ([6, 0, 0], [3, 5, 4])])];
    let report =
        |convention, a: &MaskBits, b: &MaskBits| compared(a, b, [2.0; 3], &by(convention)).lesions.unwrap();
    let counts = |convention, a, b| {
        let l = report(convention, a, b);
        ([l.found, l.missed, l.false_positives], l.f1, l.dice, l.hd_percentile_mm)
    };
    let far = f64::INFINITY;
    assert_eq!(counts(Convention::Brats, &empty, &empty), ([0; 3], None, Some(1.0), Some(0.0)));
    assert_eq!(counts(Convention::Brats, &empty, &two), ([0, 0, 2], Some(0.0), Some(0.0), Some(374.0)));
    // Dilated three times, both are one lesion.
    assert_eq!(counts(Convention::Brats, &two, &empty), ([0, 1, 0], Some(0.0), Some(0.0), Some(374.0)));
    assert_eq!(counts(Convention::Panoptica, &empty, &empty), ([0; 3], None, None, None));
    assert_eq!(counts(Convention::Panoptica, &empty, &two), ([0, 0, 2], Some(0.0), Some(0.0), Some(far)));
    assert_eq!(counts(Convention::Panoptica, &two, &empty), ([0, 2, 0], Some(0.0), Some(0.0), Some(far)));
    let same = report(Convention::Panoptica, &two, &two);
    assert_eq!((same.found, same.f1, same.sq, same.pq), (2, Some(1.0), Some(1.0), Some(1.0)));
}

#[test]
fn values_are_written_by_key_and_infinity_as_text() {
    let dims = [6, 5, 4];
    let [empty, full] = [MaskBits::empty(dims), MaskBits::full(dims)];
    let settings = Settings { percentile: 90.0, ..by(Convention::Deepmind) };
    let json = serde_json::to_value(compared(&full, &empty, [1.0; 3], &settings)).unwrap();
    assert_eq!(json["convention"], "deepmind");
    assert_eq!((&json["hd90_mm"], &json["dice"]), (&"infinity".into(), &0.0.into()));
    assert!(json["masd_mm"].is_null() && json["hausdorff"].is_null());
    let keys = json.as_object().unwrap();
    let robust = |key: &str| if key == "hd95_mm" { "hd90_mm".to_owned() } else { key.to_owned() };
    assert!(METRICS.iter().all(|metric| keys.contains_key(&robust(metric.key))), "{keys:?}");
    let json = serde_json::to_value(compared(&full, &empty, [1.0; 3], &by(Convention::Panoptica))).unwrap();
    assert_eq!(json["lesions"]["hd_percentile_mm"], "infinity");
}

/// Turned and mirrored grids have the distances of their spacing, and points in the world.
#[test]
fn points_lie_in_the_world() {
    let dims = [12, 10, 8];
    let [a, b] = [[2, 2, 2], [5, 2, 2]].map(|lo| boxes(dims, &[(lo, [4, 5, 3])]));
    let turned = DMat3::from_rotation_z(0.4) * DMat3::from_diagonal(DVec3::new(-0.5, 0.8, 3.0));
    let world_from_voxel = DAffine3 { matrix3: turned, translation: DVec3::new(100.0, -50.0, 20.0) };
    let grid = Grid::new(dims, world_from_voxel, Sides::Known).unwrap();
    for &convention in ALL {
        let found = compare(&a, &b, &grid, &by(convention)).unwrap();
        assert_near(found.value("hd_mm"), Some(1.5), "three voxels of 0.5 mm");
        let points = found.hausdorff.unwrap();
        let step = turned.x_axis * 3.0;
        let moved = points.on_compared_mm - points.on_reference_mm;
        assert!((moved - step).length() < 1e-9 || (moved + step).length() < 1e-9, "{convention:?} {moved}");
    }
}

#[test]
fn sheared_grids_have_overlaps_only() {
    let dims = [6, 5, 4];
    let sheared = DMat3::from_cols(DVec3::X, DVec3::new(0.2, 1.0, 0.0), DVec3::Z);
    let grid =
        Grid::new(dims, DAffine3 { matrix3: sheared, translation: DVec3::ZERO }, Sides::Known).unwrap();
    let [a, b] = [noise(1, dims, 40), noise(2, dims, 40)];
    for &convention in ALL {
        let found = compare(&a, &b, &grid, &by(convention)).unwrap();
        assert!(found.value("dice").is_some());
        assert_eq!([found.value("hd_mm"), found.value("hd95_mm"), found.value("nsd")], [None; 3]);
        assert!(
            matches!(found.no_distances, Some(NoDistances::Sheared(cosine)) if (cosine - 0.2 / 1.04_f64.sqrt()).abs() < 1e-12)
        );
        assert!(found.hausdorff.is_none() && found.lesions.is_none());
    }
    let other = Unequal { reference: dims, compared: [6, 5, 3], grid: dims };
    assert_eq!(compare(&a, &MaskBits::empty([6, 5, 3]), &grid, &Settings::default()), Err(other));
}

/// A lesion of two voxels found by one of them, another of three found by one: Jaccard 1/2 and 1/3.
#[test]
fn lesions_match_from_a_jaccard_of_a_half() {
    let dims = [9, 5, 1];
    let a = boxes(dims, &[([0, 0, 0], [2, 1, 1]), ([5, 3, 0], [3, 1, 1])]);
    let b = boxes(dims, &[([1, 0, 0], [1, 1, 1]), ([5, 3, 0], [1, 1, 1])]);
    let report = compared(&a, &b, [1.0; 3], &by(Convention::Panoptica)).lesions.unwrap();
    assert_eq!((report.found, report.missed, report.false_positives), (1, 1, 1));
    assert_eq!((report.f1, report.sq, report.pq), (Some(0.5), Some(0.5), Some(0.25)));
    assert_eq!((report.dice, report.hd_percentile_mm.map(|mm| mm.round())), (Some(2.0 / 3.0), Some(1.0)));
}
