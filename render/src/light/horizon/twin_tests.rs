//! Horizon occlusion against its twin in `f64`.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3};
use glioscope_core::{Grid, optics::Projection};

use super::{
    planes_and_samples,
    twin::{Surface, filtered, worst_byte},
};
use crate::{
    CloseupRenderer, ContextRenderer, ContextScene,
    light::suite::{self, lit},
    scene::{LightingMode, Quality},
    testing::{GPU, noise, scene_of, volume},
};

fn arc(horizon: f64, angle: f64) -> f64 {
    0.25 * (angle.cos() + 2.0 * horizon * angle.sin() - (2.0 * horizon - angle).cos())
}

/// Darkness of a pixel, 0 to 255; `None` where rounding decides what is read.
fn dark_at(surface: &Surface, pixel: [usize; 2], quality: &Quality, voxel_mm: f64) -> Option<f64> {
    let radius_mm = quality.occlusion_radius_mm;
    let [planes, samples] = planes_and_samples(quality.occlusion_samples);
    let i = pixel[1] * surface.size[0] + pixel[0];
    let (n, to_eye) = (surface.normals[i], -surface.direction(pixel));
    let footprint = surface.sight.pixel_mm(surface.depths_mm[i]);
    let c = surface.point(pixel) + n * footprint.max(voxel_mm);
    let tile = (pixel[0] & 3) + 4 * (pixel[1] & 3);
    let turn = ((tile * 7 + (tile >> 2) * 5) & 15) as f64 / 16.0;
    let jitter = ((tile * 5 + (tile >> 2) * 3) & 3) as f64 / 4.0;
    let (mut open, mut whole) = (0.0, 0.0);
    for k in 0..planes {
        let azimuth = PI * (f64::from(k) + turn) / f64::from(planes);
        let across = DVec3::new(azimuth.cos(), azimuth.sin(), 0.0);
        let sideways = (across - to_eye * across.dot(to_eye)).normalize_or_zero();
        let axis = sideways.cross(to_eye);
        let in_plane = n - axis * n.dot(axis);
        let share = in_plane.length();
        let angle = in_plane.dot(sideways).signum() * (in_plane.dot(to_eye) / share).clamp(-1.0, 1.0).acos();
        for way in [-1.0, 1.0] {
            let mut highest = (angle + way * FRAC_PI_2).clamp(-PI, PI).cos();
            for s in 0..samples {
                let q = (f64::from(s) + 0.25 + 0.5 * jitter) / f64::from(samples);
                let off = DVec2::new(across.x, -across.y) * (way * radius_mm / footprint * q * q);
                if (off - off.floor() - 0.5).abs().min_element() < 1e-4 {
                    return None;
                }
                let off = [off.x.round() as i64, off.y.round() as i64];
                let to = [pixel[0] as i64 + off[0], pixel[1] as i64 + off[1]];
                if off == [0, 0] || (0..2).any(|a| to[a] < 0 || to[a] >= surface.size[a] as i64) {
                    continue;
                }
                let step = surface.point(to.map(|v| v as usize)) - c;
                if (step.length() - radius_mm).abs() < 1e-4 {
                    return None;
                }
                if step.length() < radius_mm {
                    highest = highest.max(step.dot(to_eye) / step.length());
                }
            }
            let horizon = way * highest.clamp(-1.0, 1.0).acos();
            open += share * arc(angle + (horizon - angle).clamp(-FRAC_PI_2, FRAC_PI_2), angle);
            whole += share * arc(angle + way * FRAC_PI_2, angle);
        }
    }
    Some(255.0 * (1.0 - open / whole).clamp(0.0, 1.0))
}

/// For the suite: largest difference beyond the rounding to 8 bits, of occlusion and of its filter.
pub(super) fn max_twin_error() -> f64 {
    let grid = Grid::axis_aligned([12; 3], DVec3::ONE, DVec3::splat(-5.5)).unwrap();
    let scene = scene_of(volume(&grid, 2, |k, p| noise(p, 4 + k as u32) > 0.4).unwrap(), 2, None);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let mut worst = 0.0f64;
    for occlusion_samples in [6, 12] {
        let quality = Quality { occlusion_samples, occlusion_strength: 1.0, ..lit(LightingMode::Horizon) };
        let frame = renderer.render(&GPU, &scene, &quality, [150, 120]).unwrap();
        let surface = Surface::of(frame);
        let dark = |i: usize| {
            let is_surface = surface.depths_mm[i].is_finite();
            is_surface.then(|| dark_at(&surface, surface.pixel(i), &quality, 1.0)).flatten()
        };
        let expected: Vec<Option<f64>> = (0..surface.depths_mm.len()).map(dark).collect();
        let found = frame.read_occlusion(&GPU);
        let (off, compared) = worst_byte(&found, &expected);
        assert!(compared > 2000, "{compared} dark pixels");
        let smooth = filtered(&surface, &found, quality.occlusion_radius_mm, 0);
        let (off_filter, compared) = worst_byte(&frame.read_blurred(&GPU), &smooth);
        assert!(compared > 2000, "{compared} dark pixels after the filter");
        println!("{occlusion_samples} pairs: {off:.1e}, filter {off_filter:.1e}");
        worst = worst.max(off).max(off_filter);
    }
    worst
}

/// Views without stored normals find them from depths: on a ball of voxels they are near its radii, and no step between
/// voxels darkens it.
#[test]
fn normals_from_depths_follow_a_ball_of_voxels() {
    let grid = Grid::axis_aligned([32; 3], DVec3::ONE, DVec3::splat(-15.5)).unwrap();
    let inside = |_: usize, p: [usize; 3]| DVec3::from_array(p.map(|c| c as f64 - 15.5)).length() < 14.0;
    let scene = ContextScene {
        tumor: volume(&grid, 1, inside),
        volume: None,
        ..suite::scene(false, true, Projection::Perspective)
    };
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, &scene, &lit(LightingMode::Horizon), [240, 240]).unwrap();
    let surface = Surface::of(frame);
    let dark = frame.read_blurred(&GPU);
    let (mut off_deg, mut darkness) = (Vec::new(), 0.0);
    for i in (0..surface.depths_mm.len()).filter(|&i| surface.depths_mm[i].is_finite()) {
        let [x, y] = surface.pixel(i);
        let radial = surface.sight.at_mm([x as u32, y as u32], surface.depths_mm[i]).normalize_or_zero();
        let ray = surface.in_world(surface.direction([x, y]));
        // Near the rim, what is beside a pixel lies far behind it.
        if radial.dot(ray) < -0.4 {
            off_deg.push(surface.in_world(surface.normals[i]).dot(radial).min(1.0).acos().to_degrees());
            darkness += f64::from(dark[i] >> 24) / 255.0;
        }
    }
    off_deg.sort_by(f64::total_cmp);
    let (count, darkness) = (off_deg.len(), darkness / off_deg.len() as f64);
    let [half, most] = [off_deg[count / 2], off_deg[count * 19 / 20]];
    println!("{count} normals: median {half:.1} degrees off, 95 % within {most:.1}; darkness {darkness:.3}");
    assert!(
        count > 8000 && half < 15.0 && most < 40.0 && darkness < 0.05,
        "{count}: {half} {most} {darkness}"
    );
}
