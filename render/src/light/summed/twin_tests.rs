//! Darkness by the summed-area table against brute force over boxes, and against the Gaussian that the boxes stand for, in
//! `f64`.

use glam::DVec3;
use glioscope_core::{
    Grid,
    optics::{Camera, Projection, srgb},
};
use rayon::prelude::*;

use super::{boxes, halves};
use crate::{
    CloseupRenderer,
    light::{
        horizon::twin::{Surface, worst_byte},
        suite::lit,
    },
    scene::{LightingMode, Quality, RegionScene},
    testing::{GPU, noise, scene_of, volume},
};

const SIZE: [u32; 2] = [84, 66];

/// Pits and towers of voxels.
fn rugged() -> RegionScene {
    let grid = Grid::axis_aligned([12; 3], DVec3::ONE, DVec3::splat(-5.5)).unwrap();
    scene_of(volume(&grid, 2, |k, p| noise(p, 4 + k as u32) > 0.4).unwrap(), 2, None)
}

/// A weighted mean of the depths around a pixel, surfaces alone: sum and weight, where `weigh` gives each offset's.
fn around(surface: &Surface, [x, y]: [usize; 2], reach: i64, weigh: &dyn Fn(i64, i64) -> f64) -> [f64; 2] {
    let [width, height] = surface.size.map(|s| s as i64);
    let mut out = [0.0; 2];
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let (u, v) = (x as i64 + dx, y as i64 + dy);
            if u >= 0 && v >= 0 && u < width && v < height {
                let depth = surface.depths_mm[(v * width + u) as usize];
                let weight = weigh(dx, dy);
                if depth.is_finite() && weight > 0.0 {
                    out = [out[0] + weight * depth, out[1] + weight];
                }
            }
        }
    }
    out
}

/// A box of half this side: whole pixels, of the next larger box as much as its area says; per pixel of its area.
fn box_mean(surface: &Surface, at: [usize; 2], half: f64) -> [f64; 2] {
    let inner = (half - 0.5).floor().max(0.0);
    let side = 2.0 * inner + 1.0;
    let share = ((4.0 * half * half - side * side) / ((side + 2.0).powi(2) - side * side)).clamp(0.0, 1.0);
    let inner = inner as i64;
    let weigh = |dx: i64, dy: i64| if dx.abs().max(dy.abs()) <= inner { 1.0 } else { share };
    around(surface, at, inner + 1, &weigh).map(|sum| sum / (4.0 * half * half).max(1.0))
}

/// Darkness of a pixel, 0 to 1; `means`: sums of the depths compared with, how much of the whole has depths, and the radii that
/// they are compared over. A mean of which half or more is missing says nothing.
fn darkness(surface: &Surface, at: [usize; 2], means: &[([f64; 2], f64)]) -> f64 {
    let depth = surface.depths_mm[at[1] * surface.size[0] + at[0]];
    let bias = 0.75 * surface.sight.pixel_mm(depth);
    let dark = |([sum, covered], radius_mm): &([f64; 2], f64)| {
        let behind = depth - bias - sum / covered;
        (2.0 * behind * (2.0 * covered - 1.0).max(0.0).powi(2) / radius_mm).clamp(0.0, 1.0)
    };
    means.iter().map(dark).sum::<f64>() / means.len() as f64
}

/// summed/darken: darkness 0 to 1; `None` on the background.
fn expected(surface: &Surface, mode: LightingMode, quality: &Quality) -> Vec<Option<f64>> {
    let radius_mm = quality.occlusion_radius_mm;
    let halves = halves(mode, boxes(mode, quality.occlusion_samples));
    let of_pixel = |i: usize| {
        let depth = surface.depths_mm[i];
        if !depth.is_finite() {
            return None;
        }
        let at = surface.pixel(i);
        let px = |half: f64| (half * radius_mm / surface.sight.pixel_mm(depth)).min(255.0);
        let means: Vec<[f64; 2]> = halves.iter().map(|half| box_mean(surface, at, px(*half))).collect();
        if mode == LightingMode::VicinityMap {
            let means = means.iter().zip(&halves).map(|(mean, half)| (*mean, half * radius_mm));
            return Some(darkness(surface, at, &means.collect::<Vec<_>>()));
        }
        let sum = means.iter().fold([0.0; 2], |sum, m| [sum[0] + m[0], sum[1] + m[1]]);
        Some(darkness(surface, at, &[(sum.map(|s| s / means.len() as f64), radius_mm)]))
    };
    (0..surface.depths_mm.len()).into_par_iter().map(of_pixel).collect()
}

fn byte(dark: f64) -> f64 {
    255.0 * (1.0 - srgb::encode(1.0 - dark))
}

/// For the suite: largest difference beyond the rounding to 8 bits.
pub(super) fn max_twin_error(mode: LightingMode) -> f64 {
    let scene = rugged();
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let mut worst = 0.0f64;
    for (occlusion_samples, occlusion_radius_mm) in [(3, 5.0), (12, 4.0), (24, 2.5)] {
        let quality =
            Quality { occlusion_samples, occlusion_radius_mm, occlusion_strength: 1.0, ..lit(mode) };
        let frame = renderer.render(&GPU, &scene, &quality, SIZE).unwrap();
        let surface = Surface::of(frame);
        let bytes: Vec<Option<f64>> =
            expected(&surface, mode, &quality).into_iter().map(|dark| dark.map(byte)).collect();
        let (off, compared) = worst_byte(&frame.read_blurred(&GPU), &bytes);
        println!("{mode:?}, {occlusion_samples} pairs, {occlusion_radius_mm} mm: {off:.1e} of {compared}");
        assert!(compared > 500, "{compared} dark pixels");
        worst = worst.max(off);
    }
    worst
}

/// More boxes are nearer to the Gaussian: root mean square of linear light. Table in docs/studies.md.
#[test]
fn boxes_approach_the_gaussian_of_depth_darkening() {
    let (mode, scene) = (LightingMode::DepthDarkening, rugged());
    let base = Quality { occlusion_radius_mm: 4.0, occlusion_strength: 1.0, ..lit(mode) };
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let mut truth: Vec<Option<f64>> = Vec::new();
    let errors = [1u32, 2, 3, 4, 8].map(|boxes| {
        let quality = Quality { occlusion_samples: 3 * boxes, ..base };
        let frame = renderer.render(&GPU, &scene, &quality, SIZE).unwrap();
        let surface = Surface::of(frame);
        if truth.is_empty() {
            let gaussian = |i: usize| {
                let depth = surface.depths_mm[i];
                let radius_px = quality.occlusion_radius_mm / surface.sight.pixel_mm(depth);
                depth.is_finite().then(|| {
                    let weigh = |dx: i64, dy: i64| {
                        let share2 = (dx * dx + dy * dy) as f64 / (radius_px * radius_px);
                        if share2 <= 1.0 { (-0.5 * 2.5f64 * 2.5 * share2).exp() } else { 0.0 }
                    };
                    let (at, reach) = (surface.pixel(i), radius_px.ceil() as i64);
                    let sum = around(&surface, at, reach, &weigh);
                    let all: f64 =
                        (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| weigh(dx, dy))).sum();
                    darkness(&surface, at, &[(sum.map(|s| s / all), quality.occlusion_radius_mm)])
                })
            };
            truth = (0..surface.depths_mm.len()).into_par_iter().map(gaussian).collect();
        }
        let found = frame.read_blurred(&GPU);
        let light = |packed: &u32| srgb::decode(1.0 - f64::from(packed >> 24) / 255.0);
        let offs = found.iter().zip(&truth).filter_map(|(f, e)| e.map(|dark| light(f) - (1.0 - dark)));
        let (sum, count) = offs.fold((0.0, 0.0), |(sum, n), off| (sum + off * off, n + 1.0));
        assert!(count > 1000.0, "{count}");
        f64::sqrt(sum / count)
    });
    println!("RMS by 1, 2, 3, 4, 8 boxes: {errors:.4?}");
    assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
    assert!(errors[3] < 0.01, "{errors:?}");
}

/// A Gaussian's second moment is that of its boxes, but for what their number can't show.
#[test]
fn boxes_have_the_gaussians_variance() {
    // Of a Gaussian that ends at the radius, along an axis, in squared radii.
    let n = 2000;
    let rings = (0..n).map(|i| (f64::from(i) + 0.5) / f64::from(n));
    let (mut weight, mut sum) = (0.0, 0.0);
    for r in rings {
        let w = r * (-0.5 * 6.25 * r * r).exp();
        (weight, sum) = (weight + w, sum + w * r * r / 2.0);
    }
    let halves = halves(LightingMode::DepthDarkening, 8);
    // Squares of the discs' areas have a slightly larger variance: pi / 3 of it.
    let found = halves.iter().map(|h| h * h / 3.0).sum::<f64>() / 8.0 / (std::f64::consts::PI / 3.0);
    assert!((found / (sum / weight) - 1.0).abs() < 0.02, "{found} {}", sum / weight);
    assert!(halves.windows(2).all(|pair| pair[0] < pair[1]) && halves[7] < 0.9, "{halves:?}");
}

/// Nothing is in front of a plate: its far edges are not dark, however it slants, nor where the frame ends.
#[test]
fn a_plate_alone_is_not_dark_at_its_far_edges() {
    let grid = Grid::axis_aligned([48, 48, 1], DVec3::ONE, DVec3::new(-23.5, -23.5, 0.0)).unwrap();
    let mut scene = scene_of(volume(&grid, 1, |_, _| true).unwrap(), 1, None);
    for mode in [LightingMode::DepthDarkening, LightingMode::VicinityMap] {
        for (tilt_deg, height_mm) in [(30.0, 60.0), (60.0, 60.0), (60.0, 20.0)] {
            scene.camera =
                Camera::fit(DVec3::ZERO, 30.0, Camera::orientation(25.0, tilt_deg), Projection::Orthographic);
            scene.camera.height_mm = height_mm;
            let quality = Quality {
                occlusion_samples: 12,
                occlusion_radius_mm: 8.0,
                occlusion_strength: 1.0,
                ..lit(mode)
            };
            let mut renderer = CloseupRenderer::new(&GPU).unwrap();
            let found = renderer.render(&GPU, &scene, &quality, SIZE).unwrap().read_blurred(&GPU);
            let darkest =
                found.iter().map(|packed| 1.0 - srgb::decode(1.0 - f64::from(packed >> 24) / 255.0));
            let darkest = darkest.fold(0.0, f64::max);
            println!("{mode:?}, {tilt_deg} degrees, {height_mm} mm: {darkest:.3}");
            assert!(darkest < 0.15, "{mode:?}, {tilt_deg} degrees, {height_mm} mm: {darkest}");
        }
    }
}
