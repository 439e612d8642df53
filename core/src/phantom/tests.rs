use std::sync::LazyLock;

use super::*;
use crate::{Regions, TumorIndex, mask::Mask};

static PHANTOM_FILES: LazyLock<Vec<PhantomFile>> = LazyLock::new(phantom);
static TRUTH: LazyLock<Truth> = LazyLock::new(truth);

/// The volume measured along lines equals 4/3 π a b c, and that of a union of disjoint parts their sum.
#[test]
fn measured_volumes_equal_the_closed_form() {
    for time in 0..2 {
        for id in MARK_IDS {
            for part in mark(id, time).unwrap().parts {
                let alone = Mark { id: "alone", parts: vec![part] };
                let error_ml = truth::measured_ml(&[alone], truth::STEP_MM)[1] - part.volume_ml();
                assert!(error_ml.abs() < 5e-4, "{id}: {error_ml} ml");
            }
        }
        let t2 = mark("T2", time).unwrap();
        let sum: f64 = t2.parts.iter().map(Ellipsoid::volume_ml).sum();
        assert!((truth::measured_ml(&[t2], truth::STEP_MM)[1] - sum).abs() < 5e-4);
    }
}

/// Two balls of radius r, d apart, overlap in π (2r - d)² (d² + 4dr) / 12d.
#[test]
fn measured_overlap_equals_the_closed_form() {
    let ball = |x: f64| Mark {
        id: "ball",
        parts: vec![Ellipsoid::new(DVec3::new(x, 1.0, 2.0), DVec3::splat(10.0))],
    };
    let (r, d) = (10.0_f64, 7.0_f64);
    let lens_ml = std::f64::consts::PI * (2.0 * r - d).powi(2) * (d * d + 4.0 * d * r) / (12.0 * d) / 1000.0;
    let measured = truth::measured_ml(&[ball(0.0), ball(d)], truth::STEP_MM);
    let ball_ml = 4.0 / 3.0 * std::f64::consts::PI * r.powi(3) / 1000.0;
    for (found, expected) in measured.iter().zip([0.0, ball_ml - lens_ml, ball_ml - lens_ml, lens_ml]) {
        assert!((found - expected).abs() < 5e-4, "{found} {expected}");
    }
}

#[test]
fn faces_move_by_the_stated_millimetres() {
    let growth = &TRUTH.growth;
    let at = |id: &str| growth.iter().find(|g| g.id == id).unwrap();
    assert_eq!(at("T1").right_anterior_superior_mm, DVec3::new(-3.0, 5.0, 0.0));
    assert_eq!(at("T2").left_posterior_inferior_mm, DVec3::new(-4.0, 6.0, 0.0));
    assert_eq!(at("PET").left_posterior_inferior_mm, DVec3::new(3.0, 0.0, 0.0));
    assert_eq!(at("PET").right_anterior_superior_mm, DVec3::new(0.0, 0.0, -4.0));
}

/// Allowed error of a voxel count: on a randomly placed lattice, the volume of a smooth body of surface
/// S has an error of about 0.26 sqrt(S) h² (one standard deviation, h the cube root of the voxel
/// volume); four of them are allowed.
fn voxel_error_ml(mark: &Mark, grid: &Grid) -> f64 {
    let surface_mm2: f64 = mark
        .parts
        .iter()
        .map(|e| {
            // Thomsen's formula, within 1.1 %.
            let [a, b, c] = e.semi_axes_mm.to_array().map(|s| s.powf(1.6075));
            4.0 * std::f64::consts::PI * ((a * b + a * c + b * c) / 3.0).powf(1.0 / 1.6075)
        })
        .sum();
    4.0 * 0.26 * surface_mm2.sqrt() * grid.voxel_volume_mm3().powf(2.0 / 3.0) / 1000.0
}

#[test]
fn masks_have_the_true_volumes() {
    let files = &*PHANTOM_FILES;
    assert_eq!(files.len(), FILES.len());
    let truth = &*TRUTH;
    for file in files.iter().filter(|f| f.is_mask) {
        let time = TIMES.iter().position(|t| *t == file.time).unwrap();
        let Samples::U8(voxels) = file.volume.samples() else { panic!("{} is not u8", file.name) };
        let count = voxels.iter().filter(|&&v| v == 1).count() as u64;
        assert_eq!(count, voxels.iter().filter(|&&v| v != 0).count() as u64);
        let found_ml = file.volume.grid().volume_ml(count);
        let true_ml = truth.time_points[time].masks.iter().find(|m| m.id == file.id).unwrap().volume_ml;
        let allowed_ml = voxel_error_ml(&mark(file.id, time).unwrap(), file.volume.grid());
        assert!(allowed_ml < 0.05 * true_ml);
        assert!((found_ml - true_ml).abs() < allowed_ml, "{}: {found_ml} {true_ml} {allowed_ml}", file.name);
    }
}

/// Regions on one fine grid, rasterised from the shapes, compared with the true ones.
#[test]
fn all_seven_regions_have_their_true_volumes() {
    let grid = Grid::axis_aligned([56, 106, 60], DVec3::ONE, DVec3::new(-60.3, -45.4, -10.2)).unwrap();
    for time in 0..2 {
        let masks: Vec<Mask> = MARK_IDS
            .iter()
            .map(|id| Mask::new(*id, grid.clone(), mark_on(&mark(id, time).unwrap(), &grid)).unwrap())
            .collect();
        let index = TumorIndex::new(grid.clone(), &masks.iter().collect::<Vec<_>>()).unwrap();
        let regions = Regions::of(&index);
        let truth = &TRUTH.time_points[time];
        assert_eq!(truth.regions.len(), 7);
        for region in &truth.regions {
            let bits = (0..3).filter(|&k| region.masks.contains(&MARK_IDS[k])).fold(0, |b, k| b | 1 << k);
            let found = regions.get(bits).unwrap();
            assert!(region.volume_ml > 1.0, "a region too small to see: {region:?}");
            assert!((found.volume_ml - region.volume_ml).abs() < 0.1, "{region:?} {}", found.volume_ml);
        }
    }
}

#[test]
fn the_case_loads_with_a_left_frontal_tumor() {
    let case = phantom_case().unwrap();
    assert_eq!(case.time_points.len(), 2);
    for time in &case.time_points {
        assert_eq!(time.regions.mask_ids(), MARK_IDS);
        assert_eq!(time.contexts.len(), 3);
        assert_eq!(time.regions.list().len(), 7);
        let center = time.regions.centroid_mm().unwrap();
        assert!(center.x < -20.0 && center.y > 5.0 && center.z > 5.0, "{center}");
    }
    assert!(case.checks.iter().all(|c| c.severity == crate::Severity::Note), "{:?}", case.checks);
    assert_eq!(case.grid.sides(), Sides::Known);
}

/// Landmarks of the sides must be in the image: the marker capsule on the right, the bright tumour on
/// the left, the nose in front, the neck below.
#[test]
fn images_show_landmarks_of_each_side() {
    let files = &*PHANTOM_FILES;
    let t1c = &files.iter().find(|f| f.id == "T1c").unwrap().volume;
    let at = |x: f64, y: f64, z: f64| {
        t1c.value(t1c.grid().linear(t1c.grid().voxel_at(DVec3::new(x, y, z)).unwrap()))
    };
    assert!(at(51.0, 66.5, 22.0) > 180.0 && at(-54.0, 70.0, 22.0) < 10.0, "capsule");
    assert!(at(-45.0, 30.0, 20.0) > 180.0 && at(45.0, 30.0, 20.0) < 160.0, "tumour");
    assert!(at(0.0, 104.0, -26.0) > 50.0 && at(0.0, -97.0, -26.0) < 10.0, "nose");
    assert!(at(0.0, -18.0, -86.0) > 50.0, "neck");
    assert_eq!(t1c.grid().axis_codes(), ['L', 'P', 'S']);
}
