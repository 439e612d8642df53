//! The passes of ambient occlusion against their twin in `f64`.

use glam::DVec3;
use glioscope_core::{Grid, optics::Sight};

use super::occlusion_kernel;
use crate::{
    CloseupRenderer,
    scene::Quality,
    solid::view::{FAR, reference_mm},
    testing::{GPU, noise, scene_of, volume},
};

/// Comparisons decided by less than this may differ in single precision.
const AMBIGUOUS_MM: f64 = 1e-4;
const AMBIGUOUS_PX: f64 = 3e-5;

/// screen/occlusion: darkness before the blur, 0 to 255, and whether it depends on rounding.
fn occlusion(
    depths: &[f64],
    size: [usize; 2],
    footprint: impl Fn(f64) -> f64,
    q: &Quality,
) -> Vec<(f64, bool)> {
    let kernel = occlusion_kernel(q.occlusion_samples);
    let radius_mm = q.occlusion_radius_mm;
    let of_pixel = |i: usize| {
        let (x, y, depth) = (i % size[0], i / size[0], depths[i]);
        if !depth.is_finite() {
            return (0.0, false);
        }
        let (px_mm, tile) = (footprint(depth), (x & 3) + 4 * (y & 3));
        let turn = ((tile * 7 + (tile >> 2) * 5) & 15) as f64 * std::f64::consts::TAU / 16.0;
        let (s, c) = turn.sin_cos();
        let (mut hidden, mut ambiguous) = (0.0, false);
        for k in kernel.iter().take(q.occlusion_samples as usize).map(|k| k.map(f64::from)) {
            for sign in [1.0, -1.0] {
                let offset = [c * k[0] - s * k[1], s * k[0] + c * k[1]].map(|o| sign * o * radius_mm / px_mm);
                let to: [f64; 2] = std::array::from_fn(|a| {
                    ([x, y][a] as f64 + offset[a]).clamp(0.0, size[a] as f64 - 1.0) + 0.5
                });
                ambiguous |= to.iter().any(|t| (t - t.round()).abs() < AMBIGUOUS_PX && t.fract() != 0.5);
                let occluder = depths[to[1] as usize * size[0] + to[0] as usize];
                let confidence = (3.0 * radius_mm / (depth - occluder).max(1e-6)).min(1.0);
                let limit = depth + sign * k[2] * radius_mm - 0.75 * px_mm;
                ambiguous |= (occluder - limit).abs() < AMBIGUOUS_MM;
                hidden += if occluder < limit {
                    0.5 + 0.5 * confidence
                } else if occluder < depth {
                    0.5 - 0.5 * confidence
                } else {
                    0.0
                };
            }
        }
        let dark = (2.0 * (hidden / f64::from(q.occlusion_samples) - 1.0)).clamp(0.0, 1.0);
        ((dark * 255.0).round(), ambiguous)
    };
    (0..depths.len()).map(of_pixel).collect()
}

/// screen/blur.
fn blurred(dark: &[(f64, bool)], depths: &[f64], size: [usize; 2], reach_mm: f64) -> Vec<(f64, bool)> {
    let of_pixel = |i: usize| {
        if !depths[i].is_finite() {
            return (0.0, false);
        }
        let (mut sum, mut weight, mut ambiguous) = (0.0, 0.0, false);
        for (dx, dy) in (-2..2).flat_map(|dy: i64| (-2..2).map(move |dx: i64| (dx, dy))) {
            let at = |c: usize, d: i64, n: usize| (c as i64 + d).clamp(0, n as i64 - 1) as usize;
            let there = at(i / size[0], dy, size[1]) * size[0] + at(i % size[0], dx, size[0]);
            let step = (depths[there] - depths[i]).abs();
            ambiguous |= (step - reach_mm).abs() < AMBIGUOUS_MM;
            if step < reach_mm {
                sum += dark[there].0;
                weight += 1.0;
                ambiguous |= dark[there].1;
            }
        }
        (sum / weight, ambiguous)
    };
    (0..depths.len()).map(of_pixel).collect()
}

/// For the suite: largest difference beyond the rounding to 8 bits.
pub(super) fn max_twin_error() -> f64 {
    // Pits and towers of voxels.
    let grid = Grid::axis_aligned([12; 3], DVec3::ONE, DVec3::splat(-5.5)).unwrap();
    let scene = scene_of(volume(&grid, 2, |k, p| noise(p, 4 + k as u32) > 0.4).unwrap(), 2, None);
    let (quality, size) = (Quality { occlusion_strength: 1.0, ..Quality::FULL }, [150, 120]);
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, &scene, &quality, size).unwrap();
    let reference = reference_mm(&scene);
    let from_eye = |d: &f32| if *d < FAR { reference + f64::from(*d) } else { f64::INFINITY };
    let depths: Vec<f64> = frame.read_depths(&GPU).iter().map(from_eye).collect();
    let sight = Sight::new(&scene.camera, size);
    let size = size.map(|s| s as usize);
    let dark = occlusion(&depths, size, |depth| sight.pixel_mm(depth), &quality);
    let expected = blurred(&dark, &depths, size, 0.5 * quality.occlusion_radius_mm);
    let (mut worst, mut compared, mut darkest) = (0.0f64, 0, 0.0f64);
    for (found, (expected, ambiguous)) in frame.read_blurred(&GPU).iter().zip(&expected) {
        if !ambiguous {
            let off = (f64::from(found >> 24) - expected).abs();
            // Rounded once more, and a tie in either rounding may be broken differently.
            worst = worst.max((off - 1.0).max(0.0) / 255.0);
            compared += usize::from(*expected > 0.0);
            darkest = darkest.max(*expected);
        }
    }
    assert!(compared > 500 && darkest > 60.0, "{compared} dark pixels, up to {darkest}");
    worst
}
