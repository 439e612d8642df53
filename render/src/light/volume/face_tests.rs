//! Light kept in cells where tissue reaches the image's faces, against Monte Carlo and the integral of the same light.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::optics::{
    Projection,
    monte_carlo::{self, Phase},
};

use crate::{
    ContextRenderer, ContextScene,
    image::{ControlPoint, TransferFunction},
    light::{
        half_angle::twin::exact,
        suite::{cubic, image_of, scene},
    },
    scene::{Lamp, LampFrame, LightSettings, LightingMode, Quality},
    testing::GPU,
};

const SIZE: [u32; 2] = [28, 26];
const APERTURE_DEG: f64 = 40.0;

/// A cube of one tissue that fills its image, seen from beside; three of its faces are lit.
fn cube(opacity_per_mm: f64) -> ContextScene {
    // Not a whole number of cells.
    let grid = cubic(23, DVec3::ONE);
    let points =
        [0.0, 1e6].map(|value| ControlPoint { value, color: [255; 3], opacity: opacity_per_mm }).to_vec();
    ContextScene {
        volume: Some(image_of(&grid, vec![50.0; grid.voxel_count()])),
        transfer: Arc::new(TransferFunction::new(points, None).unwrap()),
        ..scene(false, false, Projection::Orthographic)
    }
}

fn lit(mode: LightingMode, cell_mm: f64) -> Quality {
    let lamp = Lamp { frame: LampFrame::Viewer, azimuth_deg: -30.0, elevation_deg: 30.0 };
    let lighting = LightSettings {
        mode,
        lamp,
        cell_mm,
        aperture_deg: APERTURE_DEG,
        sub_cones: 32,
        coarsest_level: 1,
        sky_share: 0.0,
        sky_order: 5,
        sky_directions: 128,
        ..LightSettings::DEFAULT
    };
    Quality { lighting, occlusion_strength: 1.0, context_step_mm: 0.1, ..Quality::FULL }
}

/// Linear radiance of each pixel, unlit tissue black.
fn truth(scene: &ContextScene, lighting: &LightSettings) -> Vec<f64> {
    let towards = lighting.lamp.direction(&scene.camera);
    let phase = match lighting.mode {
        LightingMode::ShadowVolume => {
            return exact(scene, lighting.lamp, SIZE).into_iter().map(|light| light.x).collect();
        }
        LightingMode::Cones => Phase::Cone { aperture_deg: APERTURE_DEG },
        _ => Phase::Lamp { towards, aperture_deg: APERTURE_DEG },
    };
    let medium = scene.medium().unwrap();
    let found = monte_carlo::picture(&medium, &scene.camera, SIZE, phase, DVec3::ZERO, 600, 5);
    found.iter().map(|pixel| pixel.mean.x).collect()
}

/// Mean light of the pixels that see much of a cube, its truth, and the root mean square difference.
fn compared(scene: &ContextScene, quality: &Quality, truth: &[f64]) -> [f64; 3] {
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, scene, quality, SIZE).unwrap();
    let (mut sums, mut n) = ([0.0; 3], 0.0);
    for (pixel, truth) in frame.read_marched(&GPU).iter().zip(truth) {
        let [light, .., opacity] = pixel.rgba();
        if opacity > 0.3 {
            sums = [sums[0] + light, sums[1] + truth, sums[2] + (light - truth).powi(2)];
            n += 1.0;
        }
    }
    assert!(n > 150.0, "{n}");
    [sums[0] / n, sums[1] / n, (sums[2] / n).sqrt()]
}

const IN_CELLS: [LightingMode; 3] =
    [LightingMode::Cones, LightingMode::ShadowVolume, LightingMode::SphericalHarmonics];
const CELLS_MM: [f64; 3] = [2.0, 4.0, 8.0];

/// What `compared` finds, by cell size and mode.
fn of_all(opacity_per_mm: f64) -> [Vec<[f64; 3]>; 3] {
    let scene = cube(opacity_per_mm);
    let mut out = [const { Vec::new() }; 3];
    for mode in IN_CELLS {
        let truth = truth(&scene, &lit(mode, 1.0).lighting);
        for (cell_mm, out) in CELLS_MM.iter().zip(&mut out) {
            let found = compared(&scene, &lit(mode, *cell_mm), &truth);
            println!("{mode:?}, cells of {cell_mm} mm: mean light, truth, root mean square {found:.4?}");
            out.push(found);
        }
    }
    out
}

/// Opaque tissue that an image ends in has the light of its face, not that of a place half a cell below it, where there is none. It
/// falls off within half a cell of the face, which is more than in truth.
#[test]
fn opaque_tissue_on_the_images_faces_is_lit() {
    for (found, most) in of_all(0.9999).iter().zip([0.2, 0.35, 0.5]) {
        assert!(found.iter().all(|[found, truth, _]| (found / truth - 1.0).abs() < most), "{found:?}");
    }
}

/// Haze that an image ends in is as dark as by the integral.
#[test]
fn haze_that_fills_the_image_is_lit_as_by_the_integral() {
    for (found, most) in of_all(0.05).iter().zip([0.02, 0.025, 0.04]) {
        assert!(found.iter().all(|[.., off]| *off < most), "{found:?}");
    }
}
