//! Values of the packages for small masks: surface-distance 0.1, MedPy 0.5.2 and panoptica 2.1.7 (PyPI); MetricsReloaded
//! (commit 00219d0) and BraTS-2023-Metrics (commit 0c603fc), whose formulas were run from their stored sources. NumPy 1.26.4,
//! SciPy 1.17.1. Tolerance 1 mm, of panoptica its default: the smallest spacing.

use super::{
    super::{LesionRule, surfels},
    *,
};

type Values = &'static [(&'static str, Option<f64>)];

#[rustfmt::skip]
const STORED: &[(&str, &str, Values)] = &[
    ("noise", "deepmind", &[("dice", Some(0.44370860927152317)), ("hd_mm", Some(2.0)), ("hd95_mm", Some(0.7)), ("masd_mm", Some(0.0690337968113314)), ("assd_mm", Some(0.08179472774808841)), ("nsd", Some(0.9962643165277394))]),
    ("noise", "metrics-reloaded", &[("dice", Some(0.44370860927152317)), ("jaccard", Some(0.2851063829787234)), ("sensitivity", Some(0.6320754716981132)), ("precision", Some(0.34183672070503235)), ("relative_volume_difference", Some(0.8490566037735849)), ("kappa", Some(0.012281163857224244)), ("hd_mm", Some(2.0518284528683193)), ("assd_mm", Some(0.36938737988022147)), ("hd95_mm", Some(1.0)), ("masd_mm", Some(0.33242608605429314)), ("nsd", Some(0.9733333333333334))]),
    ("noise", "medpy", &[("dice", Some(0.44370860927152317)), ("jaccard", Some(0.2851063829787234)), ("sensitivity", Some(0.6320754716981132)), ("precision", Some(0.34183673469387754)), ("relative_volume_difference", Some(0.8490566037735849)), ("hd_mm", Some(2.0518284528683193)), ("hd95_mm", Some(1.0)), ("assd_mm", Some(0.36938737988022147))]),
    ("noise", "brats", &[("dice", Some(0.44370860927152317)), ("hd95_mm", Some(0.7)), ("sensitivity", Some(0.6320754716981132)), ("lesions.dice", Some(0.44370860927152317)), ("lesions.hd_percentile_mm", Some(0.7)), ("lesions.found", Some(1.0)), ("lesions.missed", Some(0.0)), ("lesions.false_positives", Some(0.0))]),
    ("noise", "panoptica", &[("lesions.found", Some(0.0)), ("lesions.missed", Some(1.0)), ("lesions.false_positives", Some(1.0)), ("lesions.f1", Some(0.0)), ("lesions.sq", Some(0.0)), ("lesions.pq", Some(0.0)), ("lesions.dice", Some(0.0)), ("lesions.hd_percentile_mm", Some(f64::INFINITY)), ("dice", Some(0.44370860927152317)), ("jaccard", Some(0.2851063829787234)), ("relative_volume_difference", Some(0.8490566037735849)), ("assd_mm", Some(0.33242608605429314)), ("hd_mm", Some(2.0518284528683193)), ("hd95_mm", Some(1.0)), ("nsd", Some(0.7994553588795954))]),
    ("sparse", "deepmind", &[("dice", Some(0.0)), ("hd_mm", Some(3.0)), ("hd95_mm", Some(2.23606797749979)), ("masd_mm", Some(1.0400940495706779)), ("assd_mm", Some(1.1557709310243447)), ("nsd", Some(0.5787090087880598))]),
    ("sparse", "metrics-reloaded", &[("dice", Some(0.0)), ("jaccard", Some(0.0)), ("sensitivity", Some(0.0)), ("precision", Some(0.0)), ("relative_volume_difference", Some(2.0)), ("kappa", Some(-0.039603898430814403)), ("hd_mm", Some(3.0)), ("assd_mm", Some(1.8195952839929346)), ("hd95_mm", Some(2.449489742783178)), ("masd_mm", Some(1.7276656531832244)), ("nsd", Some(0.1875))]),
    ("sparse", "medpy", &[("dice", Some(0.0)), ("jaccard", Some(0.0)), ("sensitivity", Some(0.0)), ("precision", Some(0.0)), ("relative_volume_difference", Some(2.0)), ("hd_mm", Some(3.0)), ("hd95_mm", Some(2.449489742783178)), ("assd_mm", Some(1.8195952839929346))]),
    ("sparse", "brats", &[("dice", Some(0.0)), ("hd95_mm", Some(2.23606797749979)), ("sensitivity", Some(0.0)), ("lesions.dice", Some(1.0)), ("lesions.hd_percentile_mm", Some(0.0)), ("lesions.found", Some(0.0)), ("lesions.missed", Some(0.0)), ("lesions.false_positives", Some(0.0))]),
    ("sparse", "panoptica", &[("lesions.found", Some(0.0)), ("lesions.missed", Some(6.0)), ("lesions.false_positives", Some(9.0)), ("lesions.f1", Some(0.0)), ("lesions.sq", Some(0.0)), ("lesions.pq", Some(0.0)), ("lesions.dice", Some(0.0)), ("lesions.hd_percentile_mm", Some(f64::INFINITY)), ("dice", Some(0.0)), ("jaccard", Some(0.0)), ("relative_volume_difference", Some(2.0)), ("assd_mm", Some(1.7276656531832244)), ("hd_mm", Some(3.0)), ("hd95_mm", Some(2.449489742783178)), ("nsd", Some(0.25))]),
    ("boxes", "deepmind", &[("dice", Some(0.6043956043956044)), ("hd_mm", Some(11.439405578962571)), ("hd95_mm", Some(9.0)), ("masd_mm", Some(1.5208102878214147)), ("assd_mm", Some(1.5448553441333361)), ("nsd", Some(0.7311879275832854))]),
    ("boxes", "metrics-reloaded", &[("dice", Some(0.6043956043956044)), ("jaccard", Some(0.4330708661417323)), ("sensitivity", Some(0.6358381502890174)), ("precision", Some(0.5759162306785583)), ("relative_volume_difference", Some(0.10404624277456648)), ("kappa", Some(0.5855857170853402)), ("hd_mm", Some(11.439405578962571)), ("assd_mm", Some(1.4206688155038383)), ("hd95_mm", Some(9.0)), ("masd_mm", Some(1.3948464392649378)), ("nsd", Some(0.7381370826010545))]),
    ("boxes", "medpy", &[("dice", Some(0.6043956043956044)), ("jaccard", Some(0.4330708661417323)), ("sensitivity", Some(0.6358381502890174)), ("precision", Some(0.5759162303664922)), ("relative_volume_difference", Some(0.10404624277456648)), ("hd_mm", Some(11.439405578962571)), ("hd95_mm", Some(8.0)), ("assd_mm", Some(1.4206688155038383))]),
    ("boxes", "brats", &[("dice", Some(0.6043956043956044)), ("hd95_mm", Some(9.0)), ("sensitivity", Some(0.6358381502890174)), ("lesions.dice", Some(0.22188603126575893)), ("lesions.hd_percentile_mm", Some(250.33333333333334)), ("lesions.found", Some(1.0)), ("lesions.missed", Some(0.0)), ("lesions.false_positives", Some(2.0))]),
    ("boxes", "panoptica", &[("lesions.found", Some(1.0)), ("lesions.missed", Some(3.0)), ("lesions.false_positives", Some(3.0)), ("lesions.f1", Some(0.25)), ("lesions.sq", Some(0.6666666666666666)), ("lesions.pq", Some(0.16666666666666666)), ("lesions.dice", Some(0.8)), ("lesions.hd_percentile_mm", Some(1.0)), ("dice", Some(0.6043956043956044)), ("jaccard", Some(0.4330708661417323)), ("relative_volume_difference", Some(0.10404624277456648)), ("assd_mm", Some(1.394846439264938)), ("hd_mm", Some(11.439405578962571)), ("hd95_mm", Some(8.0)), ("nsd", Some(0.5990957512696643))]),
];

fn masks(name: &str) -> ([MaskBits; 2], [f64; 3]) {
    let (small, large) = ([9, 7, 5], [40, 20, 10]);
    match name {
        "noise" => ([noise(1, small, 40), noise(2, small, 60)], [0.5, 0.7, 3.0]),
        "sparse" => ([noise(3, small, 3), noise(4, small, 8)], [1.0; 3]),
        _ => {
            let a = [
                ([2, 2, 2], [8, 6, 4]),
                ([20, 3, 2], [5, 5, 5]),
                ([13, 3, 3], [3, 3, 3]),
                ([35, 15, 8], [2, 1, 1]),
            ];
            let b = [
                ([4, 3, 2], [8, 6, 4]),
                ([30, 3, 2], [4, 4, 4]),
                ([21, 3, 2], [5, 5, 5]),
                ([1, 17, 1], [1, 1, 1]),
            ];
            ([boxes(large, &a), boxes(large, &b)], [1.0, 0.9, 2.5])
        }
    }
}

fn value(found: &Comparison, key: &str) -> Option<f64> {
    let Some(lesions) = key.strip_prefix("lesions.") else { return found.value(key) };
    let json = serde_json::to_value(found.lesions.as_ref()).unwrap();
    if json[lesions] == "infinity" { Some(f64::INFINITY) } else { json[lesions].as_f64() }
}

#[test]
fn values_are_those_of_the_packages() {
    for (name, convention, values) in STORED {
        let ([a, b], spacing_mm) = masks(name);
        let convention = Convention::of_name(convention).unwrap();
        let smallest = spacing_mm.into_iter().fold(f64::INFINITY, f64::min);
        let tolerance_mm = if convention == Convention::Panoptica { smallest } else { 1.0 };
        let found = compared(&a, &b, spacing_mm, &Settings { tolerance_mm, ..by(convention) });
        for (key, expected) in *values {
            if *key == "kappa" {
                // MetricsReloaded counts in 32 bits: its kappa has seven digits after the point.
                let difference =
                    value(&found, key).zip(*expected).map(|(found, expected)| (found - expected).abs());
                assert!(difference.is_some_and(|d| d < 2e-7), "{name} kappa {difference:?}");
                continue;
            }
            assert_near(value(&found, key), *expected, &format!("{name} {convention:?} {key}"));
        }
    }
}

#[test]
fn lesions_of_other_tumours_are_joined_and_left_out_by_their_rules() {
    let ([a, b], spacing_mm) = masks("boxes");
    for (lesion_rule, dice, mm, counts) in [
        (LesionRule::METASTASES, 0.2375, 249.833_333_333_333_34, [2, 2, 2]),
        (LesionRule::MENINGIOMA, 0.285, 225.0, [2, 1, 2]),
    ] {
        let found = compared(&a, &b, spacing_mm, &Settings { lesion_rule, ..by(Convention::Brats) });
        let report = found.lesions.unwrap();
        assert_eq!([report.found, report.missed, report.false_positives], counts);
        assert_near(report.dice, Some(dice), "dice");
        assert_near(report.hd_percentile_mm, Some(mm), "distance");
    }
}

/// Sums over the package's 256 areas, plain and by code.
#[test]
fn areas_are_those_of_the_package() {
    for (spacing_mm, sum, by_code) in [
        ([1.0; 3], 241.343_139_705_537_45, 30_771.250_312_456_017),
        ([0.5, 0.7, 3.0], 352.706_175_956_354_74, 44_970.037_434_435_23),
    ] {
        let areas = surfels::areas_mm2(spacing_mm);
        assert_near(Some(areas.iter().sum()), Some(sum), "sum");
        let weighted = areas.iter().enumerate().map(|(code, area)| code as f64 * area).sum();
        assert_near(Some(weighted), Some(by_code), "by code");
    }
    // One voxel has eight corners cut off, an eighth of the face's vector each.
    assert_near(Some(surfels::areas_mm2([1.0; 3])[1]), Some(3.0_f64.sqrt() / 8.0), "a cut corner");
    assert_near(Some(surfels::areas_mm2([0.5, 0.7, 3.0])[0b1111]), Some(0.7 * 3.0), "a face");
}
