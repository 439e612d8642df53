//! The error that is measured of a frame against that of every pixel, by many more rays of another seed.

use glam::DVec3;
use glioscope_core::{Grid, Progress, optics::srgb};

use super::{frame_error::LightSample, suite::lit};
use crate::{
    CloseupRenderer,
    scene::{Lens, LightingMode, Quality, RegionScene},
    testing::{GPU, noise, scene_of, volume},
    views::{View3d, closeup::Closeup},
};

const SIZE: [u32; 2] = [96, 76];

fn sampled(scene: &RegionScene, quality: &Quality) -> Option<LightSample> {
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, scene, quality, SIZE).unwrap();
    Closeup::light_sample(frame, &GPU, scene, quality).unwrap()
}

/// Masks of other form than those that docs/accuracy.md was measured on.
fn scenes() -> Vec<(&'static str, RegionScene)> {
    let fine = Grid::axis_aligned([28; 3], DVec3::ONE, DVec3::splat(-13.5)).unwrap();
    let thick =
        Grid::axis_aligned([24, 24, 6], DVec3::new(1.0, 1.0, 6.0), DVec3::new(-11.5, -11.5, -15.0)).unwrap();
    let of = |grid: &Grid, inside: &dyn Fn(DVec3) -> bool| {
        scene_of(volume(grid, 1, |_, ijk| inside(grid.center_of_voxel_mm(ijk))).unwrap(), 1, None)
    };
    let rods = |p: DVec3| (p.x / 6.0 - (p.x / 6.0).round()).hypot(p.z / 6.0 - (p.z / 6.0).round()) < 0.3;
    vec![
        ("balls", of(&fine, &|p| (p.x.abs() - 6.5).hypot(p.y).hypot(p.z) < 7.0)),
        ("bowl", of(&fine, &|p| (8.0..11.0).contains(&p.length()) && p.y < 3.0)),
        ("rods", of(&fine, &rods)),
        ("noise", of(&fine, &|p| noise((p / 4.0 + 10.0).floor().as_usizevec3().to_array(), 5) > 0.45)),
        ("thick slices", of(&thick, &|p| p.length() < 13.0 && p.x.hypot(p.y) > 4.0)),
    ]
}

/// Of every pixel, by more rays.
fn whole(sample: &LightSample) -> f64 {
    sample.measure_by(&Progress::new(), (usize::MAX, 400, 99)).unwrap().unwrap().rms
}

#[test]
fn the_error_that_is_told_is_within_a_fifth_of_that_of_all_pixels() {
    let mut told = Vec::new();
    for (at, (name, scene)) in scenes().into_iter().enumerate() {
        // While something moves, and at rest with the window's ambient light.
        let (rays, strength) = if at % 2 == 0 { (4, 1.0) } else { (256, 0.75) };
        let quality =
            Quality { occlusion_rays: rays, occlusion_strength: strength, ..lit(LightingMode::Traced) };
        let sample = sampled(&scene, &quality).unwrap();
        let found = sample.measure_by(&Progress::new(), (1500, 128, 17)).unwrap().unwrap();
        let truth = whole(&sample);
        told.push(format!("{name}, {rays} rays: {found:?}, of all {truth:.4}"));
        assert!((found.rms / truth - 1.0).abs() < 0.2, "{}", told.join("\n"));
    }
    println!("{}", told.join("\n"));
}

/// Light of a whole surface in the truth: a convex mask whose pixels are darkened by a known share has that error.
#[test]
fn a_known_error_is_found() {
    let grid = Grid::axis_aligned([12, 12, 4], DVec3::ONE, DVec3::new(-5.5, -5.5, -1.5)).unwrap();
    let mut scene = scene_of(volume(&grid, 1, |_, _| true).unwrap(), 1, None);
    scene.camera.world_from_camera = glioscope_core::optics::Camera::orientation(0.0, 90.0);
    let quality = Quality { occlusion_strength: 1.0, ..lit(LightingMode::Traced) };
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, &scene, &quality, SIZE).unwrap();
    let depths_mm = frame.occlusion(&GPU).unwrap().depths_mm;
    // From above one sees a plane, which nothing darkens, and at its rim normals that face sideways.
    let dark = vec![1.0 - srgb::encode(0.7); depths_mm.len()];
    let sample = LightSample::of(&scene, &quality, SIZE, (depths_mm, dark)).unwrap();
    let found = sample.measure(&Progress::new()).unwrap().unwrap();
    assert!((found.rms - 0.3).abs() < 1e-6 && found.rms_uncertainty < 1e-6, "{found:?}");
}

#[test]
fn light_without_a_reference_is_not_measured() {
    let (_, scene) = scenes().remove(0);
    let traced = lit(LightingMode::Traced);
    let lens = RegionScene { lens: Some(Lens { center_mm: DVec3::ZERO, radius_mm: 9.0 }), ..scene.clone() };
    assert!(sampled(&lens, &traced).is_some());
    for (scene, quality) in [
        (&scene, Quality { smooth: true, ..traced }),
        (&scene, lit(LightingMode::ScreenSpace)),
        (&scene, lit(LightingMode::HalfAngle)),
        (&lens, lit(LightingMode::Cones)),
    ] {
        assert!(sampled(scene, &quality).is_none(), "{:?}", quality.lighting.mode);
    }
    // The cone's light of a convex mask is whole, and cones find that.
    let cones = sampled(&scene, &Quality { occlusion_strength: 1.0, ..lit(LightingMode::Cones) }).unwrap();
    let stopped = Progress::new();
    stopped.cancel();
    assert!(cones.measure(&stopped).is_err());
}
