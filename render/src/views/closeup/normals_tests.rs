//! Normals of the closeup's surface and the light at the eye.

use glam::{DVec2, DVec3};
use glioscope_core::{Grid, optics::voxels::OpaqueVoxels};

use crate::{
    CloseupRenderer,
    light::horizon::twin::Surface,
    scene::{Quality, RegionScene},
    testing::{GPU, noise, scene_of, volume},
};

const SIZE: [u32; 2] = [120, 120];

fn ball(lens_mm: Option<f64>) -> RegionScene {
    let grid = Grid::axis_aligned([32; 3], DVec3::ONE, DVec3::splat(-15.5)).unwrap();
    let inside = |_: usize, p: [usize; 3]| DVec3::from_array(p.map(|c| c as f64 - 15.5)).length() < 14.0;
    scene_of(volume(&grid, 1, inside).unwrap(), 1, lens_mm)
}

/// The pass against `OpaqueVoxels::normal` in `f64`, on voxels of unequal sides.
#[test]
fn normals_equal_those_of_the_smoothed_voxels() {
    let grid =
        Grid::axis_aligned([14, 12, 8], DVec3::new(0.8, 1.0, 2.1), DVec3::new(90.0, -5.0, 7.0)).unwrap();
    let lumps = |k: usize, p: [usize; 3]| noise(p.map(|c| c / 3), 3 + k as u32) > 0.45;
    let mut scene = scene_of(volume(&grid, 2, lumps).unwrap(), 2, None);
    scene.selection.set(0b01, false);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let surface = Surface::of(renderer.render(&GPU, &scene, &Quality::FULL, SIZE).unwrap());
    let tumor = scene.tumor.as_ref().unwrap();
    let voxels = OpaqueVoxels::new(grid, |l| scene.selection.shows(tumor.bits_of_id()[tumor.id(l) as usize]));
    let (mut compared, mut worst) = (0, 0.0f64);
    for i in (0..surface.depths_mm.len()).filter(|&i| surface.depths_mm[i].is_finite()) {
        let [x, y] = surface.pixel(i);
        let at_mm = surface.sight.at_mm([x as u32, y as u32], surface.depths_mm[i]);
        let Some(expected) = voxels.normal(at_mm) else { continue };
        // Normals that face away are turned towards the eye.
        if expected.dot(surface.in_world(surface.direction([x, y]))) < -0.03 {
            compared += 1;
            worst = worst.max((surface.in_world(surface.normals[i]) - expected).length());
        }
    }
    println!("{compared} normals, at most {worst:.1e} off");
    assert!(compared > 2000 && worst < 2e-3, "{compared}: {worst}");
}

fn linear(byte: u8) -> f64 {
    glioscope_core::optics::srgb::decode(f64::from(byte) / 255.0)
}

/// A ball reads as a ball: its rim has at most 0.85 of the middle's light, as displayed; without relief it is flat.
#[test]
fn a_ball_is_darker_at_its_rim() {
    let scene = ball(None);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let mut red_at = |quality: &Quality, share: f64| {
        let rgba = renderer.render(&GPU, &scene, quality, SIZE).unwrap().read_rgba(&GPU).unwrap();
        let middle = scene.camera.project(DVec3::ZERO, DVec2::splat(120.0)).unwrap();
        let edge = scene.camera.project(scene.camera.axes()[0] * 14.0, DVec2::splat(120.0)).unwrap();
        // The brighter pixels of a ring, so that no line between voxels counts.
        let mut ring: Vec<u8> = (0..64)
            .map(|k| {
                let turn = DVec2::from_angle(f64::from(k) / 64.0 * std::f64::consts::TAU);
                let at = middle + turn * (share * (edge - middle).length());
                rgba[4 * (at.y as usize * 120 + at.x as usize)]
            })
            .collect();
        ring.sort_unstable();
        ring[60]
    };
    for mode in [Quality::FULL.lighting.mode, crate::scene::LightingMode::Traced] {
        let quality = crate::light::suite::lit(mode);
        let [middle, rim] = [0.05, 0.95].map(|share| red_at(&quality, share));
        println!("{mode:?}: middle {middle}, rim {rim}");
        assert!(f64::from(rim) < 0.85 * f64::from(middle) && middle > 230, "{mode:?}: {middle} {rim}");
        assert!(linear(rim) > 0.44 * linear(middle), "at least the rim's light");
    }
    let flat = Quality { relief: 0.0, occlusion_strength: 0.0, ..Quality::FULL };
    assert_eq!(red_at(&flat, 0.05), red_at(&flat, 0.9));
}

/// The cut of the lens has one light, with lines; surfaces beside it have none.
#[test]
fn the_cut_of_the_lens_is_hatched() {
    let mut scene = ball(Some(0.5));
    let size = [300, 300];
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let quality = Quality { occlusion_strength: 0.0, ..Quality::FULL };
    let mut levels = |scene: &RegionScene| {
        let frame = renderer.render(&GPU, scene, &quality, size).unwrap();
        let (faces, rgba) = (frame.read_surfaces(&GPU), frame.read_rgba(&GPU).unwrap());
        let mut reds: Vec<u8> =
            faces.iter().zip(rgba.chunks(4)).filter(|(f, _)| f[1] == 3).map(|(_, p)| p[0]).collect();
        reds.sort_unstable();
        reds
    };
    let cut = levels(&scene);
    assert!(cut.len() > 5000, "{} pixels of the cut", cut.len());
    let [dark, light] = [cut[cut.len() / 20], cut[cut.len() / 2]];
    assert!(light > dark + 20, "lines {dark} in {light}");
    assert!(
        cut.iter().filter(|r| r.abs_diff(light) < 3).count() * 3 > cut.len(),
        "one light between the lines"
    );
    scene.lens = None;
    assert!(levels(&scene).is_empty(), "no cut without a lens");
}
