//! Normals of the closeup's surface, the light at the eye, and the smooth surface.

use glam::{DVec2, DVec3};
use glioscope_core::{Grid, optics::voxels::OpaqueVoxels};

use crate::{
    CloseupRenderer,
    light::{self, horizon::twin::Surface},
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
        let quality = light::suite::lit(mode);
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

const SMOOTH: Quality = Quality { smooth: true, ..Quality::FULL };

/// Each pixel's surface against the mean of the voxels in `f64`, on voxels of unequal sides, with the lens: it is where the
/// mean passes a half for the first time, and its region is that of a voxel beside it. Pixels that keep their voxel are cut by
/// the lens, or show one without a level set beside it; pixels that lose it pass no level set.
#[test]
fn the_smooth_surface_is_where_half_of_the_weights_are_shown() {
    let spacing_mm = DVec3::new(0.8, 1.0, 2.1);
    let grid = Grid::axis_aligned([14, 12, 8], spacing_mm, DVec3::new(90.0, -5.0, 7.0)).unwrap();
    let lumps = |k: usize, p: [usize; 3]| noise(p.map(|c| c / 3), 3 + k as u32) > 0.45 || p == [1, 10, 3];
    let mut scene = scene_of(volume(&grid, 2, lumps).unwrap(), 2, Some(0.7));
    scene.selection.set(0b01, false);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let bricks = Surface::of(renderer.render(&GPU, &scene, &Quality::FULL, SIZE).unwrap());
    let frame = renderer.render(&GPU, &scene, &SMOOTH, SIZE).unwrap();
    let (numbers, smooth) = (frame.read_surfaces(&GPU), Surface::of(frame));
    let tumor = scene.tumor.as_ref().unwrap();
    let shows = |l: usize| scene.selection.shows(tumor.bits_of_id()[tumor.id(l) as usize]);
    let voxels = OpaqueVoxels::new(grid.clone(), shows);
    let shown: Vec<(DVec3, u32)> = (0..grid.voxel_count())
        .filter(|&l| shows(l))
        .map(|l| (grid.center_of_voxel_mm(grid.ijk(l)), tumor.id(l)))
        .collect();
    let lens = scene.lens.unwrap();
    let (mut moved, mut kept, mut lost, mut off) = (0, 0, 0, 0);
    for i in (0..smooth.depths_mm.len()).filter(|&i| bricks.depths_mm[i].is_finite()) {
        let [x, y] = smooth.pixel(i);
        let at_mm = |depth_mm: f64| smooth.sight.at_mm([x as u32, y as u32], depth_mm);
        let [first_mm, depth_mm] = [bricks.depths_mm[i], smooth.depths_mm[i]];
        // One voxel of the axis that the ray passes fastest, in depth.
        let pace = (at_mm(first_mm + 1.0) - at_mm(first_mm)) / spacing_mm;
        let voxel_mm = 1.0 / pace.abs().max_element();
        let share = |voxels_on: f64| {
            let at_mm = at_mm(first_mm + voxel_mm * voxels_on);
            let inside = at_mm.distance(lens.center_mm) < lens.radius_mm;
            if inside { voxels.share(at_mm) } else { 0.0 }
        };
        if depth_mm == first_mm {
            let nearby = (-60..=60).map(|n| share(f64::from(n) / 20.0)).fold(0.0, f64::max);
            (kept, off) = (kept + 1, off + usize::from(share(0.01) < 0.49 && nearby > 0.52));
        } else if depth_mm.is_finite() {
            let here = voxels.share(at_mm(depth_mm));
            let before = (0..100).map(|n| (depth_mm - first_mm) / voxel_mm - 0.05 * f64::from(n));
            let earlier = before.filter(|on| *on > -2.0).skip(1).map(share).fold(0.0, f64::max);
            let near = |(center_mm, _): &&(DVec3, u32)| {
                ((*center_mm - at_mm(depth_mm)) / spacing_mm).abs().max_element() < 2.0
            };
            let is_beside = shown.iter().filter(near).any(|(_, number)| *number == numbers[i][0]);
            let is_right = (here - 0.5).abs() < 0.01 && earlier < 0.51 && is_beside;
            (moved, off) = (moved + 1, off + usize::from(!is_right));
        } else {
            let behind = (-20..400).map(|n| share(f64::from(n) / 10.0)).fold(0.0, f64::max);
            (lost, off) = (lost + 1, off + usize::from(behind > 0.52));
        }
    }
    println!("{moved} pixels moved, {kept} kept, {lost} lost, {off} off");
    assert!(moved > 1500 && kept > 100 && off * 100 < moved + kept, "{moved} {kept} {lost} {off}");
}

/// Depths against the true ball: voxels are half a voxel off, the smooth surface much less.
#[test]
fn a_smooth_ball_is_round() {
    let scene = ball(None);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let mut rms_mm = |quality: &Quality| {
        let surface = Surface::of(renderer.render(&GPU, &scene, quality, SIZE).unwrap());
        let (mut sum, mut count) = (0.0, 0);
        for i in (0..surface.depths_mm.len()).filter(|&i| surface.depths_mm[i].is_finite()) {
            let [x, y] = surface.pixel(i);
            let at_mm = surface.sight.at_mm([x as u32, y as u32], surface.depths_mm[i]);
            (sum, count) = (sum + (at_mm.length() - 14.0).powi(2), count + 1);
        }
        assert!(count > 2900, "{count}");
        (sum / f64::from(count)).sqrt()
    };
    let [bricks, smooth] = [Quality::FULL, SMOOTH].map(|quality| rms_mm(&quality));
    println!("voxels {bricks:.3} mm, smooth {smooth:.3} mm from the ball");
    assert!(bricks > 0.25 && smooth < 0.15, "{bricks} {smooth}");
}

/// Nothing vanishes: single voxels, and sheets and rods of one voxel, have no level set and stay.
#[test]
fn thin_parts_stay_in_the_smooth_surface() {
    let grid = Grid::axis_aligned([20; 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let thin = |_: usize, [x, y, z]: [usize; 3]| {
        [x, y, z] == [15, 15, 4] || z == 10 && x < 9 && y < 9 || y == 16 && x == 3 && z < 18
    };
    let scene = scene_of(volume(&grid, 1, thin).unwrap(), 1, None);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let mut depths =
        |quality: &Quality| Surface::of(renderer.render(&GPU, &scene, quality, SIZE).unwrap()).depths_mm;
    let (bricks, smooth) = (depths(&Quality::FULL), depths(&SMOOTH));
    assert!(bricks.iter().filter(|d| d.is_finite()).count() > 500);
    assert_eq!(bricks, smooth);
}

/// A ball darkens nothing of itself: neither do the voxels, of 1:6, that its smooth surface cuts.
#[test]
fn voxels_leave_no_spots_on_the_smooth_surface() {
    let spacing_mm = DVec3::new(1.0, 1.0, 6.0);
    let grid = Grid::axis_aligned([40, 40, 8], spacing_mm, DVec3::new(-19.5, -19.5, -21.0)).unwrap();
    let inside = |_: usize, p: [usize; 3]| {
        (DVec3::from_array(p.map(|c| c as f64)) * spacing_mm + DVec3::new(-19.5, -19.5, -21.0)).length()
            < 17.0
    };
    let scene = scene_of(volume(&grid, 1, inside).unwrap(), 1, None);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let traced = light::preset(crate::scene::LightingMode::Traced, crate::scene::Preset::Balanced);
    let frame = renderer.render(&GPU, &scene, &Quality { smooth: true, ..traced }, [160, 160]).unwrap();
    let found = frame.occlusion(&GPU).unwrap();
    let hit = || found.dark.iter().zip(&found.depths_mm).filter(|(_, depth)| depth.is_finite());
    let black = hit().filter(|(dark, _)| **dark > 0.5).count();
    println!("{black} of {} pixels are dark", hit().count());
    assert!(hit().count() > 5000 && black == 0, "{black}");
}
