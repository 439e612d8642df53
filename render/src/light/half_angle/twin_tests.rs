//! Half-angle slicing against its twin in `f64`.

use glam::DVec3;
use glioscope_core::{
    Grid, Selection,
    optics::{Projection, Sight, srgb, voxels::OpaqueVoxels},
};

use super::{
    plan::{HalfAnglePlan, Requested, turned},
    twin::LampTwin,
};
use crate::{
    ClipPlane, CloseupRenderer, ContextRenderer, ContextScene,
    image::buffers::ImageBuffers,
    light::{
        horizon::twin::{Surface, worst_byte},
        suite::{SIZE, scene, shaped},
    },
    scene::{Lamp, LampFrame, LightSettings, LightingMode, Quality, RegionScene},
    solid::{SURFACE, view::in_camera_space},
    testing::{GPU, noise, scene_of, volume},
};

pub(super) fn lamp(azimuth_deg: f64, elevation_deg: f64) -> Lamp {
    Lamp { frame: LampFrame::Viewer, azimuth_deg, elevation_deg }
}

pub(super) fn lit(lamp: Lamp, slice_mm: f64, lamp_texel_mm: f64) -> Quality {
    let lighting = LightSettings {
        mode: LightingMode::HalfAngle,
        lamp,
        slice_mm,
        lamp_texel_mm,
        ..LightSettings::DEFAULT
    };
    Quality { lighting, ..Quality::FULL }
}

/// The plan of a scene's frame.
pub(super) fn plan_of(scene: &ContextScene, quality: &Quality, size: [u32; 2]) -> HalfAnglePlan {
    let (camera, reference_mm) = (&scene.camera, scene.reference_mm());
    let volume = scene.volume.as_ref().unwrap();
    let requested = Requested {
        light: -turned(camera, quality.lighting.lamp.direction(camera)),
        center: in_camera_space(camera, reference_mm, volume.grid().center_mm()),
        slab_mm: quality.lighting.slice_mm,
        texel_mm: quality.lighting.lamp_texel_mm,
        voxel_mm: scene.volume.as_ref().unwrap().grid().spacing_mm().min_element(),
    };
    let mut cached = None;
    let buffers = ImageBuffers::reuse(&mut cached, &GPU, volume, &scene.transfer).unwrap();
    let bricks: Vec<_> = buffers.visible_bricks().collect();
    let world_from_voxel = buffers.shape().grid.world_from_voxel();
    HalfAnglePlan::new(&requested, (camera, reference_mm, size), &world_from_voxel, &bricks)
}

fn shown(tumor: &glioscope_core::RegionVolume, selection: &Selection) -> OpaqueVoxels {
    OpaqueVoxels::new(tumor.grid().clone(), |l| selection.shows(tumor.bits_of_id()[tumor.id(l) as usize]))
}

/// Largest difference in a frame from the twin, of radiance and transmittance and of stored darkness; share of the pixels
/// that weren't compared because rounding decides them; pixels in the masks' shadow.
fn twin_error(renderer: &mut ContextRenderer, scene: &ContextScene, quality: &Quality) -> (f64, f64, usize) {
    let frame = renderer.render(&GPU, scene, quality, SIZE).unwrap();
    let has_opaque = frame.plan.has(SURFACE);
    let surface = has_opaque.then(|| Surface::of(frame));
    let blurred = has_opaque.then(|| frame.read_blurred(&GPU));
    let eye = renderer.lights().probe().eye.unwrap();
    let found: Vec<[f32; 4]> =
        bytemuck::pod_collect_to_vec(&GPU.read_buffers(&[(eye, 0, eye.size())]).unwrap()[0]);
    let plan = plan_of(scene, quality, SIZE);
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    // Both cases mixed, as half_angle/finish does.
    let weight = plan.cases.get(1).map_or(0.0, |case| case.weight);
    assert_eq!(found.len(), pixels * plan.cases.len());
    let found = |i: usize, c: usize| {
        let second = found.get(pixels + i).map_or(0.0, |p| f64::from(p[c]));
        (1.0 - weight) * f64::from(found[i][c]) + weight * second
    };
    let sight = Sight::new(&scene.camera, SIZE);
    let opaque_mm = surface.as_ref().map_or_else(|| vec![f64::INFINITY; pixels], |s| s.depths_mm.clone());
    let twin = |shift_mm: f64| LampTwin {
        scene,
        sight: &sight,
        reference_mm: scene.reference_mm(),
        light: -turned(&scene.camera, quality.lighting.lamp.direction(&scene.camera)),
        voxels: scene.tumor.as_ref().map(|tumor| shown(tumor, &scene.selection)),
        shift_mm,
    };
    let strength = quality.occlusion_strength;
    let [here, moved] = [0.0, 2e-3].map(|shift| twin(shift).slabs(&plan, &opaque_mm, strength));
    let (mut worst, mut excused) = (0.0f64, 0);
    for i in 0..pixels {
        let spread = (0..4).map(|c| (here[i][c] - moved[i][c]).abs()).fold(0.0, f64::max);
        if spread > 2e-4 {
            excused += 1;
            continue;
        }
        worst = (0..4).map(|c| (found(i, c) - here[i][c]).abs()).fold(worst, f64::max);
    }
    assert!(here.iter().filter(|e| e[3] < 0.8).count() > 100, "the image is visible");
    let mut dark = 0;
    if let (Some(surface), Some(blurred)) = (&surface, &blurred) {
        let of_pixel = |i: usize| {
            let mm = surface.depths_mm[i];
            let c = surface.point(surface.pixel(i)) - DVec3::Z * scene.reference_mm();
            let [a, b, e] = [-2e-3, 0.0, 2e-3].map(|shift| {
                let moved = c + DVec3::new(0.3, 0.8, 0.5) * shift;
                twin(shift).on_opaque(moved, surface.normals[i], f64::INFINITY, plan.slab_mm)
            });
            let is_clear = mm.is_finite() && (a - b).abs().max((e - b).abs()) < 1e-2;
            is_clear.then(|| 255.0 * (1.0 - srgb::encode(1.0 + strength * (b - 1.0))))
        };
        let expected: Vec<Option<f64>> =
            (0..pixels).map(|i| if opaque_mm[i].is_finite() { of_pixel(i) } else { None }).collect();
        let (off, some) = worst_byte(blurred, &expected);
        let opaque = opaque_mm.iter().filter(|mm| mm.is_finite()).count();
        let known = expected.iter().flatten().count();
        assert!(known * 10 > opaque * 8, "{known} of {opaque} pixels of masks");
        worst = worst.max(off);
        dark = some;
    }
    (worst, f64::from(excused) / pixels as f64, dark)
}

/// For the suite: both cases and their mixture, with and without tumour, gradients, shapes, clipping planes.
pub(super) fn max_twin_error() -> f64 {
    let mut worst = masks_error();
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    for (two_d, by_shapes, with_tumor, projection, lamp) in [
        (false, false, false, Projection::Perspective, lamp(-45.0, 45.0)),
        (false, false, true, Projection::Perspective, lamp(-45.0, 45.0)),
        (true, false, true, Projection::Orthographic, lamp(140.0, 20.0)),
        (true, true, true, Projection::Perspective, lamp(60.0, -10.0)),
        (false, false, true, Projection::Perspective, lamp(91.0, 0.0)),
        (
            false,
            false,
            true,
            Projection::Orthographic,
            Lamp { frame: LampFrame::Patient, ..lamp(-70.0, 30.0) },
        ),
    ] {
        let mut scene = scene(two_d, with_tumor, projection);
        if by_shapes {
            scene.transfer = shaped();
        }
        for (slice_mm, texel_mm) in [(0.9, 0.7), (2.1, 1.6)] {
            scene.clip = if slice_mm > 2.0 {
                vec![ClipPlane { normal: DVec3::new(0.3, -0.8, 0.5), offset_mm: 5.0 }]
            } else {
                Vec::new()
            };
            let (off, excused, dark) = twin_error(&mut renderer, &scene, &lit(lamp, slice_mm, texel_mm));
            println!(
                "{two_d} {by_shapes} {with_tumor} {projection:?} {lamp:?} {slice_mm}: {off:.2e}, {:.1} % excused, {dark} dark",
                100.0 * excused
            );
            assert!(excused < 0.1, "{excused}");
            assert_eq!(dark > 20, with_tumor, "{dark}");
            worst = worst.max(off);
        }
    }
    worst
}

/// The closeup: masks alone.
fn masks_error() -> f64 {
    let spacing = DVec3::new(1.0, 1.0, 1.4);
    let grid = Grid::axis_aligned([22, 20, 16], spacing, -spacing * DVec3::new(10.5, 9.5, 7.5)).unwrap();
    // A corner of two walls, ragged, with a post on the floor.
    let tumor = volume(&grid, 2, |k, p| {
        let wall = (p[2] as f64) < 4.0 + noise(p, 4) || p[0] < 3;
        wall || (k == 1 && (9..13).contains(&p[0]) && (7..11).contains(&p[1]) && p[2] < 13)
    })
    .unwrap();
    let (mut worst, mut all_shadowed) = (0.0f64, 0);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    for (lens, lamp) in [(None, lamp(-45.0, 45.0)), (Some(0.8), lamp(70.0, 10.0)), (None, lamp(120.0, -30.0))]
    {
        let region: RegionScene = scene_of(tumor.clone(), 2, lens);
        let size = [70, 60];
        let quality = lit(lamp, 1.0, 1.0);
        let frame = renderer.render(&GPU, &region, &quality, size).unwrap();
        let surface = Surface::of(frame);
        let blurred = frame.read_blurred(&GPU);
        let image = ContextScene { volume: None, ..scene(false, false, Projection::Perspective) };
        let sight = Sight::new(&region.camera, size);
        let twin = LampTwin {
            scene: &image,
            sight: &sight,
            reference_mm: frame.reference_mm,
            light: -turned(&region.camera, lamp.direction(&region.camera)),
            voxels: Some(shown(&tumor, &region.selection)),
            shift_mm: 0.0,
        };
        let of_pixel = |i: usize| {
            let c = surface.point(surface.pixel(i)) - DVec3::Z * frame.reference_mm;
            let n = surface.normals[i];
            let outwards = surface.in_world(n);
            let at_mm = sight.at_mm(surface.pixel(i).map(|p| p as u32), surface.depths_mm[i])
                + outwards * twin.voxels.as_ref().unwrap().step_height_mm(outwards);
            let far_mm = region.lens.as_ref().map_or(f64::INFINITY, |lens| {
                let (from, w) = (at_mm - lens.center_mm, lamp.direction(&region.camera));
                let (b, inside) = (from.dot(w), lens.radius_mm.powi(2) - from.length_squared());
                if inside > 0.0 { (b * b + inside).sqrt() - b } else { 0.0 }
            });
            let light = |off: DVec3, far: f64| twin.on_opaque(c + off, n, (far_mm + far).max(0.0), 1.0);
            let here = light(DVec3::ZERO, 0.0);
            let moved = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
            let clear = moved.map(|axis| light(axis * 3e-4, 0.0)).chain([light(DVec3::ZERO, 3e-4)]);
            clear.into_iter().all(|other| (other - here).abs() < 1e-2).then_some(here)
        };
        let expected: Vec<Option<f64>> = (0..blurred.len())
            .map(|i| surface.depths_mm[i].is_finite().then(|| of_pixel(i)).flatten())
            .collect();
        let shadowed = (0..expected.len()).filter(|i| {
            expected[*i] == Some(0.0)
                && surface.in_world(surface.normals[*i]).dot(lamp.direction(&region.camera)) > 0.1
        });
        let shadowed = shadowed.count();
        let strength = quality.occlusion_strength;
        let expected: Vec<Option<f64>> = expected
            .iter()
            .map(|l| l.map(|l| 255.0 * (1.0 - srgb::encode(1.0 + strength * (l - 1.0)))))
            .collect();
        let (off, dark) = worst_byte(&blurred, &expected);
        let known = expected.iter().flatten().count();
        let hit = surface.depths_mm.iter().filter(|mm| mm.is_finite()).count();
        println!(
            "masks, lens {lens:?}, {lamp:?}: {off:.2e}, {known} of {hit} known, {dark} dark, {shadowed} in cast shadow"
        );
        // Rays start in the faces between voxels where a wall is flat: rounding decides the first voxel.
        assert!(known * 10 > hit * 6 && dark > 200, "{known} {hit} {dark}");
        all_shadowed += shadowed;
        worst = worst.max(off);
    }
    assert!(all_shadowed > 100, "{all_shadowed}");
    worst
}
