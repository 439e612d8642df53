//! The slices through an analytic medium, on the CPU in `f64`.

use glam::DVec3;
use glioscope_core::optics::{
    Sight,
    cone::through_slice,
    medium::{Medium, thickness_of},
};
use rayon::prelude::*;

use crate::{
    light::slices::plan::{Kernel, SlicePlan, Step, disc_points},
    scene::SliceVariant,
};

/// One pixel: accumulated radiance, and remaining transmittance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Linear radiance in front of the background.
    pub radiance: DVec3,
    /// Transmittance to the background.
    pub transmittance: f64,
}

/// Runs a plan. Rows from the top.
pub fn render(medium: &dyn Medium, sight: &Sight, plan: &SlicePlan) -> Vec<Eye> {
    run(medium, sight, plan).0
}

/// Eye and occlusion buffers.
fn run(medium: &dyn Medium, sight: &Sight, plan: &SlicePlan) -> (Vec<Eye>, Vec<f64>) {
    let pixels = sight.size[0] as usize * sight.size[1] as usize;
    let mut eyes = vec![Eye { radiance: DVec3::ZERO, transmittance: 1.0 }; pixels];
    let mut before = vec![1.0; pixels];
    for step in &plan.steps {
        let mut after = vec![0.0; pixels];
        let width = sight.size[0] as usize;
        eyes.par_chunks_mut(width).zip(after.par_chunks_mut(width)).enumerate().for_each(
            |(y, (eyes, after))| {
                for (x, (eye, after)) in eyes.iter_mut().zip(after).enumerate() {
                    let pixel = [x as u32, y as u32];
                    *after = match plan.variant {
                        SliceVariant::Mended => mended(medium, sight, plan, step, &before, pixel, eye),
                        _ => paper(medium, sight, plan, step, &before, pixel, eye),
                    };
                }
            },
        );
        before = after;
    }
    (eyes, before)
}

fn texel(before: &[f64], size: [u32; 2], x: i64, y: i64) -> f64 {
    let x = x.clamp(0, i64::from(size[0]) - 1) as usize;
    let y = y.clamp(0, i64::from(size[1]) - 1) as usize;
    before.get(y * size[0] as usize + x).copied().unwrap_or(1.0)
}

/// Bilinear at a position in pixels from the top left, pixel centres at halves; clamped to the edge.
fn bilinear(before: &[f64], size: [u32; 2], x: f64, y: f64) -> f64 {
    let (x, y) = (x - 0.5, y - 0.5);
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let (x, y) = (x.floor() as i64, y.floor() as i64);
    let line = |y| texel(before, size, x, y) * (1.0 - fx) + texel(before, size, x + 1, y) * fx;
    line(y) * (1.0 - fy) + line(y + 1) * fy
}

fn paper(
    medium: &dyn Medium,
    sight: &Sight,
    plan: &SlicePlan,
    step: &Step,
    before: &[f64],
    pixel: [u32; 2],
    eye: &mut Eye,
) -> f64 {
    let d = plan.slice_mm;
    let size = sight.size;
    let [x, y] = pixel;
    let optics = if step.empty {
        Default::default()
    } else {
        medium.optics(sight.at_mm(pixel, step.depth_mm + 0.5 * d))
    };
    let occlusion = texel(before, size, i64::from(x), i64::from(y));
    let alpha = 1.0 - (-thickness_of(optics.extinction_per_mm, d)).exp();
    eye.radiance += optics.color * (occlusion * alpha * eye.transmittance);
    eye.transmittance *= 1.0 - alpha;
    let Kernel::Disc { grid, radius_px, radius_mm } = step.kernel else { return occlusion };
    let points = disc_points(grid);
    let sum: f64 = points
        .iter()
        .map(|p| {
            let at = bilinear(
                before,
                size,
                f64::from(x) + 0.5 + p[0] * radius_px,
                f64::from(y) + 0.5 + p[1] * radius_px,
            );
            let distance = match plan.variant {
                SliceVariant::PaperExact => {
                    (d * d + (p[0] * p[0] + p[1] * p[1]) * radius_mm * radius_mm).sqrt()
                }
                _ => d,
            };
            at * (-thickness_of(optics.extinction_per_mm, distance)).exp()
        })
        .sum();
    sum / points.len() as f64
}

fn mended(
    medium: &dyn Medium,
    sight: &Sight,
    plan: &SlicePlan,
    step: &Step,
    before: &[f64],
    pixel: [u32; 2],
    eye: &mut Eye,
) -> f64 {
    let [x, y] = pixel.map(i64::from);
    let Kernel::Lattice { side, stride_px, center } = step.kernel else { return 1.0 };
    let (side, stride) = (i64::from(side), i64::from(stride_px));
    let at = |i: i64| (2 * i - (side - 1)) * stride / 2;
    let sum: f64 = (0..side)
        .flat_map(|j| (0..side).map(move |i| (i, j)))
        .map(|(i, j)| texel(before, sight.size, x + at(i), y + at(j)))
        .sum();
    let mut light = center * texel(before, sight.size, x, y) + (1.0 - center) * sum / (side * side) as f64;
    if step.empty {
        return light;
    }
    let Some(decay) = &plan.decay else { return light };
    let d = plan.slice_mm;
    let length = d * sight.slant(pixel);
    for slice in 0..step.slices {
        let depth = step.depth_mm + (f64::from(slice) + 0.5) * d;
        let optics = medium.optics(sight.at_mm(pixel, depth));
        if optics.extinction_per_mm <= 0.0 {
            continue;
        }
        if optics.extinction_per_mm == f64::INFINITY {
            eye.radiance += optics.color * (light * eye.transmittance);
            *eye = Eye { radiance: eye.radiance, transmittance: 0.0 };
            light = 0.0;
            continue;
        }
        let thickness = optics.extinction_per_mm * length;
        let (gathered, behind) = through_slice(decay, light, thickness);
        eye.radiance += optics.color * (gathered * eye.transmittance);
        eye.transmittance *= (-thickness).exp();
        light = behind;
    }
    light
}

/// The occlusion buffer `behind_mm` behind the first slice's front.
#[cfg(test)]
pub(crate) fn light_behind(medium: &dyn Medium, sight: &Sight, plan: &SlicePlan, behind_mm: f64) -> Vec<f64> {
    let front = plan.steps.first().map_or(0.0, |s| s.depth_mm);
    let mut cut = plan.clone();
    cut.steps.retain(|s| s.depth_mm + 1e-9 < front + behind_mm);
    run(medium, sight, &cut).1
}
