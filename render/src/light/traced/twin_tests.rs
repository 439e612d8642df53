//! Traced occlusion against its twin in `f64`, which finds the voxels of a ray by sorting instead of stepping.

use glam::{DVec2, DVec3};
use glioscope_core::{
    Grid,
    optics::{Ray, voxels::OpaqueVoxels},
};
use rayon::prelude::*;

use super::{RAYS_PER_STEP, steps_of};
use crate::{
    CloseupRenderer,
    light::{
        horizon::twin::{Surface, filtered, worst_byte},
        suite::lit,
    },
    scene::{LightingMode, Quality, RegionScene},
    testing::{GPU, noise, scene_of, volume},
};

fn tangents(n: DVec3) -> [DVec3; 2] {
    let side = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    [DVec3::new(1.0 + side * n.x * n.x * a, side * b, -side * n.x), DVec3::new(b, side + n.y * n.y * a, -n.y)]
}

/// Point `k` of the sequence of directions.
fn point(k: u32) -> DVec2 {
    let part = |factor: u32| f64::from(k.wrapping_mul(factor).wrapping_add(1 << 31) >> 8) / 16_777_216.0;
    DVec2::new(part(3_242_174_889), part(2_447_445_414))
}

/// More than single precision resolves.
const SHIFT_MM: f64 = 2e-4;
const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];
/// As in the shader.
const NEARER: f64 = 0.02;

/// Whether a ray is blocked; `None` where a shift of it by less than single precision resolves changes that.
fn blocked(voxels: &OpaqueVoxels, ray: &Ray, far_mm: f64) -> Option<bool> {
    let hit = voxels.hidden(ray, far_mm);
    let shifted = AXES.into_iter().flat_map(|axis| [axis, -axis]).all(|axis| {
        let ray = Ray { origin_mm: ray.origin_mm + SHIFT_MM * axis, ..*ray };
        voxels.hidden(&ray, far_mm) == hit
    });
    let cut = [-SHIFT_MM, SHIFT_MM].iter().all(|off| voxels.hidden(ray, (far_mm + off).max(0.0)) == hit);
    (shifted && cut).then_some(hit)
}

/// Whether these rays are enough: standard error of the mean of twelve pixels below 0.01, one ray more of each kind assumed.
fn is_enough(hidden: u32, traced: u32) -> bool {
    let n = f64::from(traced);
    let p = (f64::from(hidden) + 1.0) / (n + 2.0);
    (p * (1.0 - p) / (12.0 * n)).sqrt() < 0.01
}

/// Darkness of every pixel, 0 to 255; `None` on the background and where rounding decides.
fn traced(surface: &Surface, scene: &RegionScene, radius_mm: f64, rays: u32) -> Vec<Option<f64>> {
    let tumor = scene.tumor.as_ref().unwrap();
    let voxels = OpaqueVoxels::new(tumor.grid().clone(), |l| {
        scene.selection.shows(tumor.bits_of_id()[tumor.id(l) as usize])
    });
    let spacing_mm = tumor.grid().spacing_mm();
    let finest_mm = spacing_mm.min_element();
    let of_pixel = |i: usize| {
        let depth = surface.depths_mm[i];
        if !depth.is_finite() {
            return None;
        }
        let [x, y] = surface.pixel(i);
        let n = surface.normals[i];
        let in_world = surface.in_world(n);
        let at_mm = surface.sight.at_mm([x as u32, y as u32], depth);
        let nearer_mm = surface.sight.at_mm([x as u32, y as u32], depth - NEARER * finest_mm);
        let origin_mm = voxels.ray_start_mm(at_mm, in_world, nearer_mm);
        // Where single precision decides whether there is room.
        let start_of = |off: DVec3| voxels.ray_start_mm(at_mm + off, in_world, nearer_mm + off) - off;
        let sure = |off: DVec3| start_of(off).distance(origin_mm) < SHIFT_MM;
        if !AXES.iter().all(|axis| sure(SHIFT_MM * *axis) && sure(-SHIFT_MM * *axis)) {
            return None;
        }
        let [a, b] = tangents(n);
        let (mut hidden, mut traced) = (0u32, 0u32);
        for ray in 0..rays {
            if ray > 0 && ray % RAYS_PER_STEP == 0 && is_enough(hidden, traced) {
                break;
            }
            let u = point(16 * ray + (x as u32 & 3) + 4 * (y as u32 & 3));
            let (sin, cos) = (std::f64::consts::TAU * u.y).sin_cos();
            let w = a * (u.x.sqrt() * cos) + b * (u.x.sqrt() * sin) + n * (1.0 - u.x).sqrt();
            let ray = Ray { origin_mm, direction: surface.in_world(w) };
            let far_mm = radius_mm.min(scene.lens.map_or(f64::INFINITY, |lens| lens.leaves_mm(&ray)));
            hidden += u32::from(blocked(&voxels, &ray, far_mm)?);
            traced += 1;
        }
        Some(255.0 * f64::from(hidden) / f64::from(traced))
    };
    (0..surface.depths_mm.len()).into_par_iter().map(of_pixel).collect()
}

fn ragged(lens_mm: Option<f64>) -> RegionScene {
    let grid = Grid::axis_aligned([12; 3], DVec3::new(1.0, 0.9, 1.6), DVec3::new(-5.5, -5.0, -8.8)).unwrap();
    let mut scene = scene_of(volume(&grid, 2, |k, p| noise(p, 4 + k as u32) > 0.4).unwrap(), 2, lens_mm);
    scene.selection.set(0b10, false);
    scene
}

/// For the suite: largest difference beyond the rounding to 8 bits, of occlusion and of its filter.
pub(super) fn max_twin_error() -> f64 {
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let mut worst = 0.0f64;
    for (scene, rays) in [(ragged(None), 4), (ragged(Some(0.6)), 4), (ragged(None), 48)] {
        let quality = Quality { occlusion_rays: rays, occlusion_strength: 1.0, ..lit(LightingMode::Traced) };
        let frame = renderer.render(&GPU, &scene, &quality, [150, 120]).unwrap();
        let surface = Surface::of(frame);
        let expected = traced(&surface, &scene, quality.occlusion_radius_mm, quality.occlusion_rays);
        let found = frame.read_occlusion(&GPU);
        let (off, compared) = worst_byte(&found, &expected);
        assert!(compared > 100, "{compared} dark pixels");
        let smooth = filtered(&surface, &found, quality.occlusion_radius_mm, rays);
        let (off_filter, compared) = worst_byte(&frame.read_blurred(&GPU), &smooth);
        assert!(compared > 300, "{compared} dark pixels after the filter");
        println!("{off:.1e}, filter {off_filter:.1e}");
        worst = worst.max(off).max(off_filter);
    }
    worst
}

#[test]
fn rays_are_the_first_of_one_sequence_however_they_are_divided() {
    for rays in [0, 1, 4, 16, 17, 100, 256, 1000] {
        let steps = steps_of(rays);
        assert_eq!(steps.iter().map(|s| s.count).sum::<u32>(), rays.clamp(1, Quality::MOST_RAYS));
        let firsts: Vec<u32> = steps.iter().map(|s| s.first).collect();
        assert_eq!(firsts, (0..steps.len() as u32).map(|n| n * RAYS_PER_STEP).collect::<Vec<_>>());
    }
}

/// A frame at rest is the same in one call, in parts, and after frames of another quality.
#[test]
fn a_frame_at_rest_doesn_t_depend_on_how_it_was_reached() {
    let scene = ragged(Some(0.6));
    let quality = Quality { occlusion_rays: 256, occlusion_strength: 1.0, ..lit(LightingMode::Traced) };
    let draft = Quality { occlusion_rays: 4, resolution_scale: 0.5, ..quality };
    let size = [90, 72];
    let once =
        CloseupRenderer::new(&GPU).unwrap().render(&GPU, &scene, &quality, size).unwrap().read_rgba(&GPU);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let moving = renderer.render(&GPU, &scene, &draft, size).unwrap().read_rgba(&GPU).unwrap();
    renderer.begin(&GPU, &scene, &quality, size).unwrap();
    let mut parts = 1;
    while !renderer.resume(&GPU, 0.01).unwrap() {
        parts += 1;
    }
    let whole = once.unwrap();
    assert!(renderer.frame().unwrap().read_rgba(&GPU).unwrap() == whole && whole != moving);
    assert!(parts > 5, "{parts} parts");
}
