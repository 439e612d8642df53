use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::{ConeRenderer, ConeSettings, Pyramid, sub_cones, twin};
use crate::{
    camera::{Camera, Projection},
    dos::tests::{GPU, camera, labels, soft},
    occlusion::{Filter, OpticalVolume, Plane, Sight, Table, cone},
    reference::monte_carlo::{Estimate, Phase, picture},
};

fn traced(volume: &Arc<OpticalVolume>, camera: &Camera, size: [u32; 2], s: &ConeSettings) -> Vec<[f32; 4]> {
    let mut renderer = ConeRenderer::new(&GPU).unwrap();
    renderer.render(&GPU, volume, camera, size, s, true).unwrap();
    let out = renderer.read(&GPU).unwrap();
    assert!(out.iter().flatten().all(|v| v.is_finite()), "a number in every pixel");
    out
}

#[test]
fn device_and_twin_agree() {
    let size = [14, 12];
    let plane = Plane { normal: DVec3::new(0.6, 0.64, 0.48), offset_mm: 6.3 };
    let c = camera(DVec3::ZERO, 26.0, Projection::Perspective);
    let flat = camera(DVec3::ZERO, 26.0, Projection::Orthographic);
    let thick = DVec3::new(1.0, 1.0, 3.0);
    let mut worst = 0.0f64;
    for (volume, c) in [
        (soft(48, DVec3::ZERO, None), &c),
        (soft(48, DVec3::ZERO, Some(plane)), &flat),
        (labels(32, DVec3::ONE, DVec3::ZERO, 0.3), &c),
        (labels(32, DVec3::ONE, DVec3::ZERO, f32::INFINITY), &c),
        (labels(32, thick, DVec3::ZERO, 0.3), &c),
    ] {
        let volume = Arc::new(volume);
        let pyramid = Pyramid::of(&volume);
        for s in [
            ConeSettings { sub_cones: 5, ..ConeSettings::default() },
            ConeSettings { sub_cones: 12, aperture_deg: 85.0, coarsest_level: 0, ..ConeSettings::default() },
            // More rounds than one dispatch may take.
            ConeSettings { sub_cones: 100, cone_step: 0.5, coarsest_level: 0, ..ConeSettings::default() },
        ] {
            let found = traced(&volume, c, size, &s);
            let expected = twin::render(&volume, &pyramid, &Sight::new(c, size), &s);
            for (f, e) in found.iter().zip(&expected) {
                let e = e.radiance.extend(e.transmittance);
                for i in 0..4 {
                    worst = worst.max((f64::from(f[i]) - e[i]).abs());
                }
            }
            assert!(worst <= 1e-3, "{s:?}: {worst}");
        }
    }
    println!("largest difference from the twin: {worst:.2e}");
}

/// Root mean square, over pixels that anything is in, of the error, and of the standard error.
fn errors(found: &[[f32; 4]], truth: &[Estimate]) -> (f64, f64) {
    let (mut error, mut se, mut n) = (0.0, 0.0, 0.0);
    for (f, e) in found.iter().zip(truth).filter(|(f, _)| f[3] < 0.99) {
        for (c, value) in f.iter().enumerate().take(3) {
            error += (f64::from(*value) - e.mean[c]).powi(2);
            se += e.standard_error[c].powi(2);
            n += 1.0;
        }
    }
    ((error / n).sqrt(), (se / n).sqrt())
}

/// The error falls with the knobs, to within two standard errors of Monte Carlo.
#[test]
fn comes_to_monte_carlo() {
    let size = [12, 11];
    let c = camera(DVec3::ZERO, 26.0, Projection::Perspective);
    for (name, volume) in [
        ("soft", soft(48, DVec3::ZERO, None)),
        ("labels", labels(32, DVec3::ONE, DVec3::ZERO, 0.3)),
        ("opaque labels", labels(32, DVec3::ONE, DVec3::ZERO, f32::INFINITY)),
    ] {
        let volume = Arc::new(volume);
        let aperture_deg = 70.0;
        let truth = picture(&*volume, &c, size, Phase::Cone { aperture_deg }, DVec3::ZERO, 2048, 1);
        let coarse = ConeSettings { aperture_deg, sub_cones: 1, ..ConeSettings::default() };
        let middle = ConeSettings { sub_cones: 12, ..coarse };
        let fine = ConeSettings { sub_cones: 96, coarsest_level: 0, ray_step: 0.5, cone_step: 0.5, ..coarse };
        let results = [coarse, middle, fine].map(|s| errors(&traced(&volume, &c, size, &s), &truth));
        println!("{name}: {results:?}");
        assert!(results[0].0 > results[1].0 && results[1].0 > results[2].0, "{name}: {results:?}");
        assert!(results[2].0 <= 2.0 * results[2].1, "{name}: {results:?}");
    }
}

/// Homogeneous voxels as a slab: its closed form.
#[test]
fn a_slab_has_its_closed_form() {
    let grid = glioscope_core::Grid::axis_aligned([128, 128, 8], DVec3::ONE, DVec3::new(-63.5, -63.5, -3.5))
        .unwrap();
    let table = Table::new(0.0, 1.0, &[[1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.2]]).unwrap();
    let volume =
        OpticalVolume::new(grid.clone(), vec![1.0; grid.voxel_count()], table, Filter::Linear, None).unwrap();
    let c = Camera {
        // The eye plane is 3.7 mm above it.
        focus_mm: DVec3::Z * 20.0,
        world_from_camera: DQuat::IDENTITY,
        height_mm: 2.0,
        projection: Projection::Orthographic,
    };
    let s = ConeSettings { sub_cones: 64, coarsest_level: 0, ray_step: 0.25, ..ConeSettings::default() };
    let volume = Arc::new(volume);
    let found = traced(&volume, &c, [2, 2], &s)[0][0];
    let truth = (0..4000)
        .map(|i| {
            let tau = 1.6 * (f64::from(i) + 0.5) / 4000.0;
            (-tau).exp() * cone::slab_visibility(60.0, tau) * 1.6 / 4000.0
        })
        .sum::<f64>();
    assert!((f64::from(found) - truth).abs() < 1e-3, "{found} {truth}");
}

#[test]
fn sub_cones_share_the_cone_evenly() {
    let s = ConeSettings { aperture_deg: 80.0, sub_cones: 200, ..ConeSettings::default() };
    let axes = sub_cones(&s);
    let mean_z = axes.iter().map(|a| a[2]).sum::<f64>() / 200.0;
    assert!((mean_z - 0.5 * (1.0 + 80f64.to_radians().cos())).abs() < 1e-3);
    assert!(axes.iter().map(|a| a[0]).sum::<f64>().abs() / 200.0 < 0.02);
    assert!(axes.iter().all(|a| (a[0].powi(2) + a[1].powi(2) + a[2].powi(2) - 1.0).abs() < 1e-12));
}

/// A level's cell lets through what its voxels do, and thick slices become cubes first.
#[test]
fn levels_keep_what_comes_through() {
    let volume = labels(32, DVec3::new(1.0, 1.0, 4.0), DVec3::ZERO, 0.05);
    let pyramid = Pyramid::of(&volume);
    assert_eq!(pyramid.levels[2].voxels, [4, 4, 1]);
    assert_eq!(pyramid.levels[3].voxels, [8, 8, 2]);
    assert_eq!(pyramid.levels.last().unwrap().dims, [1; 3]);
    for level in &pyramid.levels {
        assert!(level.extinction.iter().all(|e| e.is_finite() && (0.0..=0.0501).contains(e)));
        let cell: u32 = level.voxels.iter().product();
        let mass: f64 = level.extinction.iter().map(|e| f64::from(*e)).sum::<f64>() * f64::from(cell);
        let whole: f64 = pyramid.levels[0].extinction.iter().map(|e| f64::from(*e)).sum();
        // Thin as it is, filtering changes the mass by little, and never to more.
        assert!(mass < whole * 1.001 && mass > 0.6 * whole, "{} {mass} {whole}", level.cell_mm);
    }
    let opaque = Pyramid::of(&labels(32, DVec3::ONE, DVec3::ZERO, f32::INFINITY));
    assert!(opaque.levels.iter().all(|l| l.extinction.iter().all(|e| e.is_finite() && *e >= 0.0)));
}
