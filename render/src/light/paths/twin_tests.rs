//! Paths of light against their twin in `f64`, which draws the same random numbers.

use glam::DVec3;
use glioscope_core::{
    Grid,
    optics::{Projection, Sight, srgb},
};
use rayon::prelude::*;

use super::{
    majorants::majorants,
    tests::{lit, pixels},
    twin::{PathTwin, pixel_of},
    uniforms::{Step, paths_of_half},
};
use crate::{
    ClipPlane, CloseupRenderer, ContextRenderer, ContextScene,
    image::buffers::ImageBuffers,
    light::{
        half_angle::plan::turned,
        horizon::twin::{Surface, worst_byte},
        suite::{SIZE, scene},
    },
    scene::{Lamp, PathSettings, Quality},
    solid::{SURFACE, view::FAR},
    testing::{GPU, noise, scene_of, volume},
    views::context::reference::visible_interval,
};

/// Few paths: more only add pixels that rounding decides.
const PATHS: PathSettings =
    PathSettings { most: 4, bounces: 3, anisotropy: 0.4, lamp_share: 0.5, lamp_radius_deg: 20.0 };

fn step_of(quality: &Quality, camera: &glioscope_core::optics::Camera) -> Step {
    Step::of(&quality.lighting.paths, turned(camera, Lamp::DEFAULT.direction(camera)))
}

/// Largest difference of a pixel's mean light from the image; pixels compared, and pixels that the image is in.
fn image_error(scene: &ContextScene, size: [u32; 2], paths: PathSettings) -> (f64, usize, usize) {
    let quality = Quality { occlusion_strength: 0.8, ..lit(paths) };
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, scene, &quality, size).unwrap();
    let has_opaque = frame.plan.has(SURFACE);
    let far = vec![FAR; (size[0] * size[1]) as usize];
    let depths = if has_opaque { frame.read_depths(&GPU) } else { far };
    let reference_mm = frame.reference_mm;
    let found = pixels(&renderer);
    let sight = Sight::new(&scene.camera, size);
    let (volume, mut cached) = (scene.volume.as_ref().unwrap(), None);
    let buffers = ImageBuffers::reuse(&mut cached, &GPU, volume, &scene.transfer).unwrap();
    let tumor = scene.tumor.as_deref();
    let colors: Vec<[u8; 3]> =
        tumor.iter().flat_map(|t| t.bits_of_id()).map(|bits| scene.colors.region(*bits)).collect();
    let twin = PathTwin {
        scene,
        sight: &sight,
        majorants: &majorants(buffers.tables(), buffers.ranges(), 40.0),
        brick_dims: buffers.shape().brick_dims,
        masks: tumor.filter(|_| has_opaque).map(|t| (t, &scene.selection)),
        colors: &colors,
        lens: None,
        step: step_of(&quality, &scene.camera),
        strength: quality.occlusion_strength,
    };
    let half = paths_of_half(&paths);
    let of_pixel = |number: usize| {
        let pixel = pixel_of(number, size);
        let slant = sight.slant(pixel);
        let origin_mm = sight.at_mm(pixel, 0.0);
        let direction = (sight.at_mm(pixel, 1.0) - origin_mm) / slant;
        let (near, far) = visible_interval(scene, &glioscope_core::optics::Ray { origin_mm, direction })?;
        let opaque = match depths[number] < FAR {
            true => (reference_mm + f64::from(depths[number])) * slant,
            false => f64::INFINITY,
        };
        Some(twin.in_image(pixel, (near, far.min(opaque)), half))
    };
    let expected: Vec<_> = (0..found.len()).into_par_iter().map(of_pixel).collect();
    let (mut worst, mut compared, mut shown) = (0.0f64, 0, 0);
    for (pixel, expected) in found.iter().zip(&expected) {
        let Some(expected) = expected else { continue };
        shown += usize::from(pixel.even[3] + pixel.odd[3] > 0.0);
        let Some(halves) = expected else { continue };
        compared += usize::from(pixel.even[3] + pixel.odd[3] > 0.0);
        for ((sum, count), found) in halves.iter().zip([pixel.even, pixel.odd]) {
            worst = worst.max((f64::from(found[3]) - f64::from(*count)).abs());
            let off = DVec3::new(found[0].into(), found[1].into(), found[2].into()) - *sum;
            worst = worst.max(off.abs().max_element() / f64::from((*count).max(1)));
        }
    }
    println!("image: {worst:.2e} in {compared} of {shown} pixels");
    (worst, compared, shown)
}

/// Of stored light on masks alone.
fn surface_error(lens: Option<f64>) -> (f64, usize, usize) {
    let grid = Grid::axis_aligned([12; 3], DVec3::new(1.0, 0.9, 1.6), DVec3::new(-5.5, -5.0, -8.8)).unwrap();
    let mut region = scene_of(volume(&grid, 2, |k, p| noise(p, 4 + k as u32) > 0.5).unwrap(), 2, lens);
    region.selection.set(0b10, false);
    let (size, quality) = ([60, 50], lit(PathSettings { bounces: 2, ..PATHS }));
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, &region, &quality, size).unwrap();
    let surface = Surface::of(frame);
    let blurred = frame.read_blurred(&GPU);
    let sight = Sight::new(&region.camera, size);
    let tumor = region.tumor.as_deref().unwrap();
    let alone = ContextScene { volume: None, tumor: None, ..scene(false, false, Projection::Perspective) };
    let colors: Vec<[u8; 3]> = tumor.bits_of_id().iter().map(|bits| region.colors.region(*bits)).collect();
    let twin = PathTwin {
        scene: &alone,
        sight: &sight,
        majorants: &[],
        brick_dims: [0; 3],
        masks: Some((tumor, &region.selection)),
        colors: &colors,
        lens: region.lens,
        step: step_of(&quality, &region.camera),
        strength: 1.0,
    };
    let half = paths_of_half(&quality.lighting.paths);
    let of_pixel = |number: usize| {
        let depth_mm = surface.depths_mm[number];
        let is_hit = depth_mm.is_finite();
        is_hit.then(|| twin.on_surface(pixel_of(number, size), depth_mm, surface.normals[number], half))
    };
    let expected: Vec<_> = (0..blurred.len()).into_par_iter().map(of_pixel).collect();
    let shown = expected.iter().flatten().count();
    let mut worst = 0.0f64;
    for channel in 0..3 {
        let stored: Vec<u32> = blurred.iter().map(|b| (b >> (8 * channel)) << 24).collect();
        let light = |e: &Option<Option<DVec3>>| {
            e.flatten().map(|light| 255.0 * srgb::encode(light[channel as usize].min(1.0)))
        };
        worst = worst.max(worst_byte(&stored, &expected.iter().map(light).collect::<Vec<_>>()).0);
    }
    let compared = expected.iter().flatten().flatten().count();
    println!("masks, lens {lens:?}: {worst:.2e} in {compared} of {shown} pixels");
    (worst, compared, shown)
}

/// For the suite: largest difference where rounding decides nothing. Most pixels must be compared.
pub(super) fn max_twin_error() -> f64 {
    let mut worst = 0.0f64;
    let mut with_mask = scene(false, true, Projection::Perspective);
    with_mask.clip = vec![ClipPlane { normal: DVec3::new(1.0, 0.4, -0.2), offset_mm: 9.0 }];
    let flat = scene(false, false, Projection::Orthographic);
    for (scene, paths) in
        [(&with_mask, PATHS), (&flat, PathSettings { bounces: 1, anisotropy: -0.3, ..PATHS })]
    {
        let (off, compared, shown) = image_error(scene, SIZE, paths);
        assert!(shown > 200 && compared * 10 > shown * 6, "{compared} of {shown}");
        worst = worst.max(off);
    }
    for lens in [None, Some(0.6)] {
        let (off, compared, shown) = surface_error(lens);
        // Paths begin in the faces between voxels where a wall is flat: rounding decides the first voxel.
        assert!(shown > 300 && compared * 10 > shown * 3, "{compared} of {shown}");
        worst = worst.max(off);
    }
    worst
}
