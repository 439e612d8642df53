//! Paths of light against closed forms, and properties of their frames.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{
    Grid, Selection,
    optics::{Camera, Projection},
};

use super::uniforms::Pixel;
use crate::{
    CloseupRenderer, ContextRenderer, ContextScene,
    image::{ControlPoint, TransferFunction},
    light::suite::{cubic, image_of, scene},
    scene::{Lamp, LampFrame, LightSettings, LightingMode, MaskColors, Palette, PathSettings, Quality},
    testing::{GPU, noise, scene_of, volume},
};

pub(super) fn lit(paths: PathSettings) -> Quality {
    let lighting = LightSettings { mode: LightingMode::PathTraced, paths, ..LightSettings::DEFAULT };
    Quality { lighting, occlusion_strength: 1.0, context_step_mm: 0.2, ..Quality::FULL }
}

/// Only a sky.
pub(super) const SKY: PathSettings = PathSettings { lamp_share: 0.0, ..PathSettings::DEFAULT };

/// What each pixel's paths found in the last pass of the frame.
pub(super) fn pixels(renderer: &ContextRenderer) -> Vec<Pixel> {
    let buffer = renderer.lights().probe().pixels.unwrap();
    bytemuck::pod_collect_to_vec(&GPU.read_buffers(&[(buffer, 0, buffer.size())]).unwrap()[0])
}

/// A homogeneous box of this colour and opacity per millimetre, seen along z.
fn slab(size_mm: DVec3, color: [u8; 3], opacity: f64) -> ContextScene {
    let dims = (size_mm / 2.0).round().as_uvec3().max(glam::UVec3::ONE);
    let spacing = size_mm / dims.as_dvec3();
    let dims = dims.to_array().map(|d| d as usize);
    let origin = -spacing * (DVec3::from_array(dims.map(|d| d as f64)) - 1.0) / 2.0;
    let grid = Grid::axis_aligned(dims, spacing, origin).unwrap();
    let values = vec![1.0; grid.voxel_count()];
    let points = [0.0, 2.0].map(|value| ControlPoint { value, color, opacity });
    ContextScene {
        projection: None,
        camera: Camera {
            height_mm: 8.0,
            ..Camera::fit(DVec3::ZERO, 40.0, Camera::orientation(0.0, 90.0), Projection::Orthographic)
        },
        volume: Some(image_of(&grid, values)),
        transfer: Arc::new(TransferFunction::new(points.to_vec(), None).unwrap()),
        clip: Vec::new(),
        tumor: None,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 1]),
        lens: None,
        tubes: Vec::new(),
        background: [255; 3],
        silhouette: [0; 3],
    }
}

/// In a white sky, what absorbs nothing looks like the sky: through any scattering, from any side, at any anisotropy.
#[test]
fn a_white_furnace_is_white() {
    let settings = PathSettings { most: 8, bounces: 64, ..SKY };
    for (projection, anisotropy) in
        [(Projection::Orthographic, 0.0), (Projection::Perspective, 0.8), (Projection::Perspective, -0.5)]
    {
        let mut furnace = scene(false, false, projection);
        let points = [(15.0, 0.0), (50.0, 0.1), (90.0, 0.2)].map(|(value, opacity)| ControlPoint {
            value,
            color: [255; 3],
            opacity,
        });
        furnace.transfer = Arc::new(TransferFunction::new(points.to_vec(), None).unwrap());
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        let quality = lit(PathSettings { anisotropy, ..settings });
        let frame = renderer.render(&GPU, &furnace, &quality, [40, 34]).unwrap();
        let marched: Vec<[f64; 4]> = frame.read_marched(&GPU).iter().map(|m| m.rgba()).collect();
        let mut seen = 0;
        for ([r, g, b, opacity], pixel) in marched.iter().zip(pixels(&renderer)) {
            // Pixels so thin that no path collided are dark by as little.
            let counts = pixel.even[3] + pixel.odd[3] > 0.0;
            for radiance in [r, g, b] {
                assert!(!counts || (radiance - opacity).abs() < 1e-4, "{radiance} of {opacity}");
            }
            seen += usize::from(counts && *opacity > 0.5);
        }
        assert!(seen > 150, "{seen}");
    }
}

/// Single scattering of a lamp in a slab, seen and lit from the same side (Chandrasekhar 1960): closed form.
#[test]
fn a_lamp_on_a_slab_has_its_closed_form() {
    let (depth_mm, per_mm) = (10.0, 0.12f64);
    let scene = slab(DVec3::new(160.0, 160.0, depth_mm), [255; 3], 1.0 - (-per_mm).exp());
    for (elevation_deg, anisotropy) in [(0.0f64, 0.0), (50.0, 0.0), (50.0, 0.6), (30.0, -0.4)] {
        let paths = PathSettings { most: 512, bounces: 1, lamp_share: 1.0, lamp_radius_deg: 0.0, anisotropy };
        let mut quality = lit(paths);
        quality.lighting.lamp = Lamp { frame: LampFrame::Viewer, azimuth_deg: 0.0, elevation_deg };
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        let frame = renderer.render(&GPU, &scene, &quality, [16, 12]).unwrap();
        let found = frame.read_marched(&GPU).iter().map(|m| m.rgba()[0]).collect::<Vec<_>>();
        let measured = renderer.standard_error(&GPU).unwrap().unwrap().tissue.unwrap();
        let thickness = per_mm * depth_mm;
        let cosine = elevation_deg.to_radians().cos();
        // Towards the eye and towards the lamp: light turns by 180 degrees less the elevation.
        let spread = 1.0 + anisotropy * anisotropy + 2.0 * anisotropy * cosine;
        let phase = (1.0 - anisotropy * anisotropy) / spread.powf(1.5) / 4.0;
        let slant = 1.0 + 1.0 / cosine;
        let expected = phase * (1.0 - (-thickness * slant).exp()) / slant;
        let n = found.len() as f64;
        let mean = found.iter().sum::<f64>() / n;
        let rms = (found.iter().map(|f| (f - expected).powi(2)).sum::<f64>() / n).sqrt();
        let se = rms / n.sqrt();
        println!(
            "{elevation_deg} {anisotropy}: {mean:.5}, {expected:.5} ± {se:.5}, RMS {rms:.5}, said {measured:.5}"
        );
        assert!((mean - expected).abs() < 3.0 * se + 2e-5, "{mean} {expected} {se}");
        assert!(rms < 0.02 && (0.8..1.25).contains(&(measured / rms)), "{measured} {rms}");
    }
}

/// Masks that absorb nothing in a white sky, too: hollows are bright when light bounces often enough, but for what begins in a
/// voxel, which counts as hidden.
#[test]
fn masks_darken_by_what_they_hide_and_brighten_with_bounces() {
    let grid = cubic(12, DVec3::ONE);
    let mut scene = scene_of(volume(&grid, 1, |_, p| noise(p, 4) > 0.4).unwrap(), 1, None);
    scene.colors = MaskColors::new(Palette::Thesis, &[Some([255; 3])]);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let mut light = |bounces: u32| {
        let quality = lit(PathSettings { most: 64, bounces, ..SKY });
        let frame = renderer.render(&GPU, &scene, &quality, [60, 50]).unwrap();
        let blurred = frame.read_blurred(&GPU);
        let lit: Vec<f64> =
            blurred.iter().filter(|b| **b != 0).map(|b| f64::from(b & 0xff) / 255.0).collect();
        assert!(lit.len() > 500, "{}", lit.len());
        lit.iter().sum::<f64>() / lit.len() as f64
    };
    let [once, often] = [1, 64].map(&mut light);
    println!("encoded light: {once:.4}, with bounces {often:.4}");
    assert!(once < 0.99 && often > 0.99 && often > once + 0.004, "{once} {often}");
}

/// A frame is the same in one call, in parts, and after frames of another quality.
#[test]
fn a_frame_doesn_t_depend_on_how_it_was_reached() {
    let scene = scene(false, true, Projection::Perspective);
    let size = [40, 32];
    let quality = lit(PathSettings { most: 18, ..PathSettings::DEFAULT });
    let draft = Quality { resolution_scale: 0.5, ..lit(PathSettings { most: 4, ..PathSettings::DEFAULT }) };
    let once =
        ContextRenderer::new(&GPU).unwrap().render(&GPU, &scene, &quality, size).unwrap().read_rgba(&GPU);
    let once = once.unwrap();
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let moving = renderer.render(&GPU, &scene, &draft, size).unwrap().read_rgba(&GPU).unwrap();
    renderer.begin(&GPU, &scene, &quality, size).unwrap();
    assert_eq!(renderer.standard_error(&GPU).unwrap(), None, "another frame is drawn");
    let mut parts = 1;
    while !renderer.resume(&GPU, 0.01).unwrap() {
        parts += 1;
    }
    assert!(renderer.frame().unwrap().read_rgba(&GPU).unwrap() == once && once != moving);
    assert!(parts > 15, "{parts} parts");
}

/// Tiles end where their error is small enough.
#[test]
fn paths_end_at_a_standard_error_of_a_hundredth() {
    let scene = slab(DVec3::new(160.0, 160.0, 4.0), [255; 3], 0.05);
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let quality = lit(PathSettings { most: 4096, bounces: 2, ..PathSettings::DEFAULT });
    renderer.render(&GPU, &scene, &quality, [16, 16]).unwrap();
    let said = renderer.standard_error(&GPU).unwrap().unwrap();
    let most = pixels(&renderer).iter().map(|p| p.even[3] + p.odd[3]).fold(0.0, f32::max);
    println!("{most} paths, {said:?}");
    assert!(most < 2000.0 && (0.003..0.012).contains(&said.tissue.unwrap()), "{most} {said:?}");
    assert_eq!(said.surfaces, None);
}
