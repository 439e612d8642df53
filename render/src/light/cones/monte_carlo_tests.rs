//! Cones converge to Monte Carlo of the same integral, in the image and on masks.

use glam::DVec3;
use glioscope_core::optics::{
    Camera, Projection,
    monte_carlo::{self, Estimate, Phase},
    srgb,
    volume::{Filter, OpticalVolume, Table},
};

use crate::{
    CloseupRenderer, ContextRenderer,
    light::suite::{cubic, scene},
    scene::{Lamp, LightSettings, LightingMode, Quality},
    testing::{GPU, volume},
};

/// Root mean square, over pixels with opacity above 0.01, of the error and of the standard error.
fn errors(found: &[[f64; 4]], truth: &[Estimate]) -> (f64, f64) {
    let (mut error, mut se, mut n) = (0.0, 0.0, 0.0);
    for (f, e) in found.iter().zip(truth).filter(|(f, _)| f[3] > 0.01) {
        for (c, value) in f.iter().enumerate().take(3) {
            error += (value - e.mean[c]).powi(2);
            se += e.standard_error[c].powi(2);
            n += 1.0;
        }
    }
    assert!(n > 80.0, "{n}");
    ((error / n).sqrt(), (se / n).sqrt())
}

/// With more sub-cones, finer levels and smaller cells the error falls to within two standard errors of
/// Monte Carlo.
#[test]
fn cones_in_the_image_converge_to_monte_carlo() {
    check_image(LightSettings { aperture_deg: 60.0, ..LightSettings::DEFAULT });
}

/// So they do about the direction to a lamp, here behind the scene.
#[test]
fn cones_to_a_lamp_converge_to_monte_carlo() {
    let lamp = Lamp { azimuth_deg: 130.0, elevation_deg: 10.0, ..Lamp::DEFAULT };
    check_image(LightSettings { aperture_deg: 40.0, lamp, towards_lamp: true, ..LightSettings::DEFAULT });
}

fn phase_of(lighting: &LightSettings, camera: &Camera) -> Phase {
    let aperture_deg = lighting.aperture_deg;
    if lighting.towards_lamp {
        Phase::Lamp { towards: lighting.lamp.direction(camera), aperture_deg }
    } else {
        Phase::Cone { aperture_deg }
    }
}

fn check_image(lighting: LightSettings) {
    let size = [12, 11];
    let scene = scene(false, false, Projection::Perspective);
    let phase = phase_of(&lighting, &scene.camera);
    let truth =
        monte_carlo::picture(&scene.medium().unwrap(), &scene.camera, size, phase, DVec3::ZERO, 3000, 7);
    let base = LightSettings { mode: LightingMode::Cones, ..lighting };
    let coarse = LightSettings { sub_cones: 1, cell_mm: 8.0, coarsest_level: 4, ..base };
    let middle = LightSettings { sub_cones: 8, cell_mm: 3.0, ..base };
    let fine = LightSettings { sub_cones: 128, cell_mm: 0.5, coarsest_level: 0, cone_step: 0.5, ..base };
    let results = [coarse, middle, fine].map(|lighting| {
        let quality = Quality { lighting, occlusion_strength: 1.0, context_step_mm: 0.2, ..Quality::FULL };
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        let frame = renderer.render(&GPU, &scene, &quality, size).unwrap();
        let found: Vec<[f64; 4]> = frame.read_marched(&GPU).iter().map(|m| m.rgba()).collect();
        errors(&found, &truth)
    });
    println!("view by cones, {phase:?}: {results:?}");
    assert!(results[0].0 > results[1].0 && results[1].0 > results[2].0, "{results:?}");
    // A lamp's light crosses all of the image: what interpolation between cells adds is seen above the noise.
    let between_cells = if lighting.towards_lamp { 5e-4 } else { 0.0 };
    assert!(results[2].0 <= 2.0 * results[2].1 + between_cells, "{results:?}");
}

/// Light on masks alone, in the closeup, compared with Monte Carlo of opaque labels.
#[test]
fn cones_on_masks_converge_to_monte_carlo() {
    check_masks(LightSettings { aperture_deg: 70.0, ..LightSettings::DEFAULT });
}

#[test]
fn cones_to_a_lamp_on_masks_converge_to_monte_carlo() {
    let lamp = Lamp { azimuth_deg: -50.0, elevation_deg: 30.0, ..Lamp::DEFAULT };
    check_masks(LightSettings { aperture_deg: 30.0, lamp, towards_lamp: true, ..LightSettings::DEFAULT });
}

fn check_masks(lighting: LightSettings) {
    let size = [26, 24];
    let grid = cubic(20, DVec3::new(1.0, 1.0, 1.5));
    let inside = |p: [usize; 3]| {
        let at = DVec3::from_array(p.map(|c| c as f64 - 9.5));
        (at - DVec3::new(-2.0, 0.0, 0.0)).length() < 6.2 || (at - DVec3::new(4.0, 3.0, 3.0)).length() < 4.0
    };
    let tumor = volume(&grid, 1, |_, p| inside(p)).unwrap();
    let mut scene = crate::testing::scene_of(tumor, 1, None);
    scene.camera.height_mm *= 0.6;
    let values = (0..grid.voxel_count())
        .map(|l| f32::from(u8::from(inside([l % 20, l / 20 % 20, l / 400]))))
        .collect();
    let table = Table::of_labels(&[[0.0; 4], [1.0, 1.0, 1.0, f32::INFINITY]]).unwrap();
    let labels = OpticalVolume::new(grid, values, table, Filter::Nearest, None).unwrap();
    let phase = phase_of(&lighting, &scene.camera);
    let truth = monte_carlo::picture(&labels, &scene.camera, size, phase, DVec3::ZERO, 1500, 3);
    let errors = [(1, 3, 1.0), (16, 2, 1.0), (128, 0, 1.0)].map(|(sub_cones, coarsest_level, cone_step)| {
        let lighting =
            LightSettings { mode: LightingMode::Cones, sub_cones, coarsest_level, cone_step, ..lighting };
        let quality = Quality { lighting, occlusion_strength: 1.0, ..Quality::FULL };
        let mut renderer = CloseupRenderer::new(&GPU).unwrap();
        let frame = renderer.render(&GPU, &scene, &quality, size).unwrap();
        let blurred = frame.read_blurred(&GPU);
        let (mut sum, mut se, mut n) = (0.0, 0.0, 0);
        // Where the pixel's ray hits the surface.
        for (dark, e) in blurred.iter().zip(&truth).filter(|(_, e)| e.mean.x > 0.0) {
            let encoded = 1.0 - f64::from(dark >> 24) / 255.0;
            let light = srgb::decode(encoded);
            sum += (light - e.mean.x).powi(2);
            se += e.standard_error.x.powi(2);
            n += 1;
        }
        assert!(n > 100, "{n}");
        ((sum / f64::from(n)).sqrt(), (se / f64::from(n)).sqrt())
    });
    println!("masks by cones, {phase:?}: {errors:?}");
    assert!(errors[0].0 > errors[1].0 && errors[1].0 > errors[2].0, "{errors:?}");
    // Plus the rounding to 8 bits.
    assert!(errors[2].0 <= 2.0 * errors[2].1 + 0.004, "{errors:?}");
}
