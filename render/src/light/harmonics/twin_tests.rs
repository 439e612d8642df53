//! Light by spherical harmonics against its twin in `f64`, against Monte Carlo of the same light, and what is computed again.

use std::f64::consts::PI;

use glam::DVec3;
use glioscope_core::{
    Grid,
    optics::{
        Projection, Ray, Sight,
        monte_carlo::{Phase, visibility},
        random::Random,
        srgb,
        voxels::OpaqueVoxels,
    },
};
use rayon::prelude::*;

use super::{
    Clamped, PROJECT,
    basis::{sky, spread, values},
};
use crate::{
    ClipPlane, CloseupRenderer, ContextRenderer, ContextScene,
    image::{buffers::ImageBuffers, volume::BRICK},
    light::{
        cones::{grid::Cells, twin::ConeTwin},
        horizon::twin::{Surface, worst_byte},
        suite::{SIZE, scene, shaped},
    },
    scene::{Lamp, LampFrame, LightSettings, LightingMode, Quality},
    testing::{GPU, noise, scene_of, volume},
    views::context::context_plan,
};

fn lamp(azimuth_deg: f64, elevation_deg: f64) -> Lamp {
    Lamp { frame: LampFrame::Viewer, azimuth_deg, elevation_deg }
}

fn lit(lamp: Lamp, order: u32, directions: u32, cell_mm: f64) -> Quality {
    let lighting = LightSettings {
        mode: LightingMode::SphericalHarmonics,
        lamp,
        cell_mm,
        sky_order: order,
        sky_directions: directions,
        ..LightSettings::DEFAULT
    };
    Quality { lighting, ..Quality::FULL }
}

/// The cells that a frame looks up, with their middles.
fn needed(scene: &ContextScene, cell_mm: f64) -> Vec<(usize, DVec3)> {
    let image = scene.volume.as_ref().unwrap();
    let grid = image.grid();
    let cells = Cells::new(grid, cell_mm);
    let visible =
        ImageBuffers::reuse(&mut None, &GPU, image, &scene.transfer).unwrap().visible_bits().to_vec();
    let bricks = grid.dims().map(|d| (d - 1).div_ceil(BRICK));
    let needed = cells.needed(grid, BRICK, bricks, &visible, scene.tumor.as_deref());
    let middle = |n: usize| grid.world_from_voxel().transform_point3(cells.middle(n));
    needed.into_iter().map(|n| (n as usize, middle(n as usize))).collect()
}

/// Light of all cells.
fn found(renderer: &ContextRenderer) -> Vec<[f32; 2]> {
    let [light, _] = renderer.lights().probe().grid.unwrap();
    bytemuck::pod_collect_to_vec(&GPU.read_buffers(&[(light, 0, light.size())]).unwrap()[0])
}

fn shown(scene: &ContextScene) -> Option<OpaqueVoxels> {
    let tumor = scene.tumor.as_ref()?;
    let shows = |l: usize| scene.selection.shows(tumor.bits_of_id()[tumor.id(l) as usize]);
    Some(OpaqueVoxels::new(tumor.grid().clone(), shows))
}

/// Largest difference of a cell from the twin; shares of cells that weren't compared because rounding decides them, and that masks
/// shade.
fn twin_error(renderer: &mut ContextRenderer, scene: &ContextScene, quality: &Quality) -> [f64; 3] {
    renderer.render(&GPU, scene, quality, SIZE).unwrap();
    let (found, tints) = (found(renderer), renderer.lights().probe().read_tints());
    let settings = Clamped::of(&quality.lighting);
    let sight = Sight::new(&scene.camera, SIZE);
    // Sub-cones that share the sphere.
    let lighting = LightSettings {
        aperture_deg: 180.0,
        sub_cones: settings.directions,
        coarsest_level: super::COARSEST,
        cone_step: super::CONE_STEP,
        ..quality.lighting
    };
    let twin = ConeTwin::new(scene, &sight, &[], &lighting).unwrap();
    let twin = if settings.bleeding > 0.0 { twin.with_colors() } else { twin };
    let voxels = shown(scene);
    let directions = spread(settings.directions, 180.0);
    let towards = quality.lighting.lamp.direction(&scene.camera);
    let factors = sky(settings.order, towards, settings.half_angle_deg, settings.everywhere);
    let each = 4.0 * PI / f64::from(settings.directions);
    let cells = needed(scene, quality.lighting.cell_mm);
    let grid = scene.volume.as_ref().unwrap().grid();
    let all = Cells::new(grid, quality.lighting.cell_mm);
    let results: Vec<(f64, bool, bool)> = cells
        .par_iter()
        .map(|&(n, at_mm)| {
            let is_open = |from: DVec3, w: DVec3| {
                let rate = w.dot(sight.forward);
                let to_eye = if rate < 0.0 { sight.depth_mm(from) / -rate } else { f64::INFINITY };
                voxels.as_ref().is_none_or(|voxels| {
                    !voxels.hidden(&Ray { origin_mm: from, direction: w }, to_eye.clamp(0.0, 120.0))
                })
            };
            let light = |shift: f64| {
                let moved = at_mm + DVec3::new(0.3, 0.8, 0.5) * shift;
                let (mut sums, mut ambiguous) = ([vec![0.0; factors.len()], vec![0.0; factors.len()]], false);
                let mut colors = DVec3::ZERO;
                for &w in &directions {
                    let begin = all.middle_for(grid, n, w);
                    let one = twin.along(grid.world_from_voxel().transform_point3(begin), w);
                    ambiguous |= one.is_ambiguous;
                    let past_masks = is_open(moved, w);
                    let past = if past_masks { one.image_only } else { 0.0 };
                    for (k, value) in values(settings.order, w).into_iter().enumerate() {
                        colors +=
                            if past_masks { one.color } else { DVec3::ZERO } * value * each * factors[k];
                        sums[0][k] += one.image_only * value * each;
                        sums[1][k] += past * value * each;
                    }
                }
                let raw = sums.map(|sum| sum.iter().zip(&factors).map(|(v, f)| v * f).sum::<f64>());
                let [image, both] = raw.map(|light| light.clamp(0.0, 1.0));
                let tint = colors.max(DVec3::ZERO) * settings.bleeding + raw[1];
                ([image, both.min(image)], tint.clamp(DVec3::ZERO, DVec3::ONE), ambiguous)
            };
            let ((here, tint, ambiguous), (moved, ..)) = (light(0.0), light(2e-3));
            let off = (0..2).map(|c| (f64::from(found[n][c]) - here[c]).abs()).fold(0.0, f64::max);
            let off = tints.get(n).map_or(off, |found| off.max((*found - tint).abs().max_element()));
            let is_unsure = (here[1] - moved[1]).abs() > 2e-4 || (ambiguous && off > 1e-3);
            (off, is_unsure, here[1] < here[0] - 0.01)
        })
        .collect();
    let share = |of: &dyn Fn(&(f64, bool, bool)) -> bool| {
        results.iter().filter(|r| of(r)).count() as f64 / results.len() as f64
    };
    let worst = results.iter().filter(|r| !r.1).map(|r| r.0).fold(0.0, f64::max);
    // Of the cells inside the image: masks seldom shade those outside.
    let dims = grid.dims();
    let is_inside = |at: DVec3| (0..3).all(|a| (-0.5..dims[a] as f64 - 0.5).contains(&at[a]));
    let inside = cells.iter().zip(&results).filter(|((n, _), _)| is_inside(all.middle(*n)));
    let (masked, count) =
        inside.fold((0.0, 0.0), |(sum, n), (_, r)| (sum + f64::from(u8::from(r.2)), n + 1.0));
    [worst, share(&|r| r.1), masked / count]
}

/// For the suite: orders, directions, with and without tumour, gradients, shapes, clipping planes.
pub(super) fn max_twin_error() -> f64 {
    let mut worst = masks_error();
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    // With masks: the least share of cells that they are to shade.
    for (two_d, by_shapes, masks, projection, lamp, order, directions, cut) in [
        (false, false, None, Projection::Perspective, lamp(-45.0, 45.0), 3, 64, false),
        (false, false, Some(0.1), Projection::Perspective, lamp(30.0, -20.0), 2, 24, true),
        (true, false, Some(0.02), Projection::Orthographic, lamp(140.0, 20.0), 5, 33, false),
        (true, true, Some(0.04), Projection::Perspective, lamp(0.0, 90.0), 0, 7, false),
    ] {
        let mut scene = scene(two_d, masks.is_some(), projection);
        if by_shapes {
            scene.transfer = shaped();
        }
        if cut {
            scene.clip = vec![ClipPlane { normal: DVec3::new(0.6, -1.6, 1.0), offset_mm: 10.0 }];
        }
        let mut quality = lit(lamp, order, directions, 5.0);
        // Colours of what takes light away.
        quality.lighting.tissue_bleeding = if by_shapes || cut { 0.8 } else { 0.0 };
        let [off, unsure, masked] = twin_error(&mut renderer, &scene, &quality);
        println!(
            "{two_d} {by_shapes} {masks:?} {projection:?} {lamp:?} order {order}, {directions} directions: {off:.2e}, {:.1} % \
             unsure, {:.1} % shaded by masks",
            100.0 * unsure,
            100.0 * masked
        );
        assert!(unsure < 0.25, "{unsure}");
        assert!(masks.map_or(masked == 0.0, |least| masked > least), "{masks:?}: {masked}");
        worst = worst.max(off);
    }
    worst
}

/// The closeup: masks alone.
fn masks_error() -> f64 {
    let spacing = DVec3::new(1.0, 1.0, 1.4);
    let grid = Grid::axis_aligned([22, 20, 16], spacing, -spacing * DVec3::new(10.5, 9.5, 7.5)).unwrap();
    let tumor = volume(&grid, 1, |_, p| {
        (p[2] as f64) < 4.0 + noise(p, 4) || p[0] < 3 || ((9..13).contains(&p[0]) && (7..11).contains(&p[1]))
    })
    .unwrap();
    let mut worst = 0.0f64;
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    for (lens, lamp) in [(None, lamp(-45.0, 45.0)), (Some(0.8), lamp(70.0, 10.0))] {
        let region = scene_of(tumor.clone(), 1, lens);
        let size = [60, 50];
        let quality = lit(lamp, 3, 9, 4.0);
        let frame = renderer.render(&GPU, &region, &quality, size).unwrap();
        let surface = Surface::of(frame);
        let blurred = frame.read_blurred(&GPU);
        let sight = Sight::new(&region.camera, size);
        let voxels = OpaqueVoxels::new(grid.clone(), |l| {
            region.selection.shows(tumor.bits_of_id()[tumor.id(l) as usize])
        });
        let rays = Clamped::of(&quality.lighting).rays(lamp.direction(&region.camera));
        assert_eq!(rays.len(), 18);
        let of_pixel = |i: usize| {
            let n = surface.in_world(surface.normals[i]);
            let above_mm = sight.at_mm(surface.pixel(i).map(|p| p as u32), surface.depths_mm[i])
                + n * voxels.step_height_mm(n);
            let light = |off: DVec3| {
                let from = above_mm + off;
                let of_ray = |(w, share): &(DVec3, f64)| {
                    let lens_mm = region.lens.as_ref().map_or(200.0, |lens| {
                        let to = from - lens.center_mm;
                        let (b, inside) = (to.dot(*w), lens.radius_mm.powi(2) - to.length_squared());
                        if inside > 0.0 { (b * b + inside).sqrt() - b } else { 0.0 }
                    });
                    let rate = w.dot(sight.forward);
                    let to_eye = if rate < 0.0 { sight.depth_mm(from) / -rate } else { 200.0 };
                    let facing = n.dot(*w).max(0.0) * share;
                    let far_mm = lens_mm.min(to_eye).clamp(0.0, 200.0);
                    let hidden =
                        facing > 0.0 && voxels.hidden(&Ray { origin_mm: from, direction: *w }, far_mm);
                    if hidden { 0.0 } else { facing }
                };
                rays.iter().map(of_ray).sum::<f64>().min(1.0)
            };
            let here = light(DVec3::ZERO);
            let moved = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
            moved.into_iter().all(|axis| (light(axis * 3e-4) - here).abs() < 1e-2).then_some(here)
        };
        let strength = quality.occlusion_strength;
        let expected: Vec<Option<f64>> = (0..blurred.len())
            .into_par_iter()
            .map(|i| surface.depths_mm[i].is_finite().then(|| of_pixel(i)).flatten())
            .map(|light| light.map(|l| 255.0 * (1.0 - srgb::encode(1.0 + strength * (l - 1.0)))))
            .collect();
        let (off, dark) = worst_byte(&blurred, &expected);
        let known = expected.iter().flatten().count();
        let hit = surface.depths_mm.iter().filter(|mm| mm.is_finite()).count();
        println!("masks, lens {lens:?}, {lamp:?}: {off:.2e}, {known} of {hit} known, {dark} dark");
        assert!(known * 10 > hit * 4 && dark > 200, "{known} {hit} {dark}");
        worst = worst.max(off);
    }
    worst
}

/// Root mean square difference of the cells' light from Monte Carlo of the same light, by order and directions. In docs/studies.md.
#[test]
fn higher_orders_come_nearer_to_monte_carlo() {
    let scene = scene(false, false, Projection::Perspective);
    let medium = scene.medium().unwrap();
    let towards = lamp(-45.0, 45.0).direction(&scene.camera);
    // Those outside the image have the light of its faces instead, and are in the open.
    let grid = scene.volume.as_ref().unwrap().grid();
    let (all, dims) = (Cells::new(grid, 5.0), grid.dims());
    let is_inside = |n: usize| (0..3).all(|a| (-0.5..dims[a] as f64 - 0.5).contains(&all.middle(n)[a]));
    let cells: Vec<(usize, DVec3)> = needed(&scene, 5.0).into_iter().filter(|(n, _)| is_inside(*n)).collect();
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    for aperture_deg in [60.0, 25.0] {
        let truth: Vec<(f64, f64)> = cells
            .par_iter()
            .map(|(n, at_mm)| {
                let mut random = Random::new(11, *n as u64);
                let phase = Phase::Cone { aperture_deg };
                let light = visibility(&medium, *at_mm, towards, phase, 300, &mut random);
                (light.mean.x, light.standard_error.x)
            })
            .collect();
        let se = (truth.iter().map(|t| t.1 * t.1).sum::<f64>() / truth.len() as f64).sqrt();
        let mut error = |order: u32, directions: u32| {
            let mut quality = lit(lamp(-45.0, 45.0), order, directions, 5.0);
            quality.lighting.sky_share = 0.0;
            quality.lighting.aperture_deg = aperture_deg;
            renderer.render(&GPU, &scene, &quality, SIZE).unwrap();
            let found = found(&renderer);
            let squares = cells.iter().zip(&truth).map(|((n, _), t)| (f64::from(found[*n][0]) - t.0).powi(2));
            (squares.sum::<f64>() / cells.len() as f64).sqrt()
        };
        let by_order = [0, 1, 2, 3, 5].map(|order| error(order, 128));
        let by_directions = [8, 16, 32, 64, 128].map(|directions| error(3, directions));
        println!(
            "{aperture_deg} degrees, {} cells, standard error {se:.4}: orders 0, 1, 2, 3, 5 by 128 directions {by_order:.4?}; \
             8, 16, 32, 64, 128 directions to order 3 {by_directions:.4?}",
            cells.len()
        );
        assert!(by_order.windows(2).all(|pair| pair[1] < pair[0]), "{by_order:?}");
        assert!(
            by_order[3] < 0.05 && by_order[3] < 0.3 * by_order[0] && by_directions[0] > by_directions[3],
            "{by_order:?} {by_directions:?}"
        );
    }
}

/// Turning the light projects nothing again, and gives the frame of a renderer that began with it; a frame in parts that was dropped
/// leaves nothing half done.
#[test]
fn turning_the_light_projects_nothing_again() {
    let scene = scene(false, true, Projection::Perspective);
    let rgba = |renderer: &mut ContextRenderer, lamp: Lamp| {
        let quality = lit(lamp, 3, 24, 4.0);
        let frame = renderer.render(&GPU, &scene, &quality, SIZE).unwrap();
        assert!(frame.plan.has(PROJECT));
        frame.read_rgba(&GPU).unwrap()
    };
    let mut first = ContextRenderer::new(&GPU).unwrap();
    let before = rgba(&mut first, lamp(-45.0, 45.0));
    assert!(first.light_work().unwrap().samples > 1000);
    let turned = rgba(&mut first, lamp(60.0, 10.0));
    assert_eq!(first.light_work().unwrap().samples, 0);
    assert!(before != turned);
    let mut fresh = ContextRenderer::new(&GPU).unwrap();
    assert!(turned == rgba(&mut fresh, lamp(60.0, 10.0)));
    // Dropped before anything of it ran.
    let mut dropped = ContextRenderer::new(&GPU).unwrap();
    dropped.begin(&GPU, &scene, &lit(lamp(0.0, 0.0), 3, 24, 4.0), SIZE).unwrap();
    assert!(turned == rgba(&mut dropped, lamp(60.0, 10.0)));
    assert!(dropped.light_work().unwrap().samples > 1000);
    // Masks and opacity count.
    let mut hidden = scene.clone();
    hidden.selection.set(1, false);
    assert!(context_plan(&hidden, &lit(lamp(0.0, 0.0), 3, 24, 4.0)).has(PROJECT));
    first.render(&GPU, &hidden, &lit(lamp(60.0, 10.0), 3, 24, 4.0), SIZE).unwrap();
    assert!(first.light_work().unwrap().samples > 1000);
}

#[test]
fn settings_out_of_range_are_clamped_with_notes() {
    let requested = LightSettings {
        aperture_deg: 99.0,
        sky_order: 9,
        sky_directions: 0,
        sky_share: f64::NAN,
        tissue_bleeding: 2.0,
        ..LightSettings::DEFAULT
    };
    let Clamped { half_angle_deg, order, directions, everywhere, bleeding, notes } = Clamped::of(&requested);
    assert_eq!((half_angle_deg, order, directions, everywhere, bleeding), (85.0, 5, 1, 0.0, 1.0));
    assert_eq!(notes.len(), 5, "{notes:?}");
    assert!(Clamped::of(&LightSettings::DEFAULT).notes.is_empty());
    // A surface that faces the lamp gets all of a narrow sky, and one in the open all of an even one.
    let lit = |aperture_deg, sky_share, normal: DVec3| {
        let settings = LightSettings { aperture_deg, sky_share, ..LightSettings::DEFAULT };
        let rays = Clamped::of(&settings).rays(DVec3::Y);
        rays.iter().map(|(d, share)| d.dot(normal).max(0.0) * share).sum::<f64>()
    };
    assert!((lit(20.0, 0.0, DVec3::Y) - 1.0).abs() < 1e-12);
    assert!((lit(60.0, 1.0, DVec3::X) - 1.0).abs() < 0.02, "{}", lit(60.0, 1.0, DVec3::X));
    assert!(lit(20.0, 0.0, DVec3::X) < 0.2);
}
