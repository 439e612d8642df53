//! Combined surface and volumetric occlusion by slices (Schott et al. 2012, Algorithms 1 to 4) on the CPU
//! in `f64`: the context view's image, solid surfaces at given depths, both lights.
//!
//! Two lights go from slice to slice: one that only the image weakens, which solid surfaces receive, and
//! one that solid surfaces stop as well, which the image receives.

use glam::DVec3;
use glioscope_core::optics::{Ray, Sight, cone::through_slice, srgb};
use rayon::prelude::*;

use super::{
    medium_twin::Eye,
    plan::{Kernel, SlicePlan, Step, disc_points},
};
use crate::{
    scene::{MutualOcclusion, SliceVariant},
    views::context::{
        ContextScene,
        reference::{in_index_space, sample, seen},
    },
};

/// A pixel's picture of the image, and the share of light that reaches what is solid there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Combined {
    /// Of the image, in linear light.
    pub eye: Eye,
    /// Light on the solid surface, of the image alone; 1 before all slices.
    pub on_solid: f64,
}

type Lights = [f64; 2];

/// Runs `plan` through the image of `scene`. `solid_mm` are view depths from the eye, infinite where
/// there is nothing solid; what no light reaches is darker by `strength` of its light. Rows from the top.
pub fn slices(
    scene: &ContextScene,
    sight: &Sight,
    plan: &SlicePlan,
    solid_mm: &[f64],
    mutual: &MutualOcclusion,
    strength: f64,
) -> Vec<Combined> {
    slices_apart(scene, sight, plan, [solid_mm; 2], mutual, strength)
}

/// As [`slices`] where the eye sees the image past what is solid, up to depths of their own: second of
/// `solid_mm`, none before the first.
pub fn slices_apart(
    scene: &ContextScene,
    sight: &Sight,
    plan: &SlicePlan,
    solid_mm: [&[f64]; 2],
    mutual: &MutualOcclusion,
    strength: f64,
) -> Vec<Combined> {
    let [width, height] = sight.size.map(|s| s as usize);
    let fresh = Combined { eye: Eye { radiance: DVec3::ZERO, transmittance: 1.0 }, on_solid: 1.0 };
    let mut out = vec![fresh; width * height];
    let mut before = vec![[1.0; 2]; width * height];
    for step in &plan.steps {
        let pass = Pass { scene, sight, plan, step, before: &before, mutual, strength };
        let mut after = vec![[1.0; 2]; width * height];
        out.par_iter_mut().zip(after.par_iter_mut()).enumerate().for_each(|(i, (out, after))| {
            let pixel = [(i % width) as u32, (i / width) as u32];
            let solid = solid_mm.map(|mm| mm.get(i).copied().unwrap_or(f64::INFINITY));
            *after = pass.pixel(pixel, solid, out);
        });
        before = after;
    }
    out
}

struct Pass<'a> {
    scene: &'a ContextScene,
    sight: &'a Sight,
    plan: &'a SlicePlan,
    step: &'a Step,
    before: &'a [Lights],
    mutual: &'a MutualOcclusion,
    strength: f64,
}

fn plus(a: Lights, b: Lights, weight: f64) -> Lights {
    [a[0] + weight * b[0], a[1] + weight * b[1]]
}

impl Pass<'_> {
    fn texel(&self, x: i64, y: i64) -> Lights {
        let [width, height] = self.sight.size.map(i64::from);
        let (x, y) = (x.clamp(0, width - 1), y.clamp(0, height - 1));
        self.before.get((y * width + x) as usize).copied().unwrap_or([1.0; 2])
    }

    fn bilinear(&self, x: f64, y: f64) -> Lights {
        let (x, y) = (x - 0.5, y - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let (x, y) = (x.floor() as i64, y.floor() as i64);
        let corners = [
            (0, 0, (1.0 - fx) * (1.0 - fy)),
            (1, 0, fx * (1.0 - fy)),
            (0, 1, (1.0 - fx) * fy),
            (1, 1, fx * fy),
        ];
        corners.iter().fold([0.0; 2], |sum, (i, j, w)| plus(sum, self.texel(x + i, y + j), *w))
    }

    /// Linear colour and extinction per millimetre halfway between two depths.
    fn material(&self, ray: &Ray, slant: f64, begin: f64, end: f64) -> (DVec3, f64) {
        let Some(volume) = self.scene.volume.as_ref().filter(|_| begin < end && !self.step.empty) else {
            return (DVec3::ZERO, 0.0);
        };
        let (o, d) = in_index_space(volume.grid(), ray);
        let (color, per_mm) = sample(self.scene, o + d * (0.5 * (begin + end) * slant));
        (DVec3::from_array(color.map(srgb::decode)), -(1.0 - per_mm).max(1e-30).ln())
    }

    fn pixel(&self, pixel: [u32; 2], [solid, last]: [f64; 2], out: &mut Combined) -> Lights {
        let slant = self.sight.slant(pixel);
        let origin_mm = self.sight.at_mm(pixel, 0.0);
        let direction = (self.sight.at_mm(pixel, 1.0) - origin_mm) / slant;
        let ray = Ray { origin_mm, direction };
        let (near, far) = seen(self.scene, &ray).map_or((0.0, 0.0), |(a, b)| (a / slant, b / slant));
        let d = self.plan.slice_mm;
        let casts = self.mutual.opaque_on_image;
        let shades = self.mutual.image_on_image;
        let Step { depth_mm, kernel, .. } = *self.step;
        let [x, y] = pixel.map(i64::from);
        if self.plan.variant != SliceVariant::Mended {
            let before = self.texel(x, y);
            let (begin, end) = (depth_mm.max(near), (depth_mm + d).min(far));
            let (color, extinction) = self.material(&ray, slant, begin, end);
            let sampled = (end - begin).min(last - depth_mm).max(0.0);
            let alpha = -(-extinction * sampled).exp_m1();
            let lit = 1.0 + self.strength * (before[1] - 1.0);
            out.eye.radiance += color * (lit * alpha * out.eye.transmittance);
            out.eye.transmittance *= 1.0 - alpha;
            let hides = solid < depth_mm + d;
            let of_both = match (hides && casts, shades) {
                (true, _) => f64::INFINITY,
                (false, true) => extinction,
                (false, false) => 0.0,
            };
            let Kernel::Disc { grid, radius_px, radius_mm } = kernel else { return before };
            let points = disc_points(grid);
            let after = points.iter().fold([0.0; 2], |sum, p| {
                let off2 = p[0] * p[0] + p[1] * p[1];
                let distance = match self.plan.variant {
                    SliceVariant::PaperExact => (d * d + off2 * radius_mm * radius_mm).sqrt(),
                    _ => d,
                };
                let at = self.bilinear(x as f64 + 0.5 + p[0] * radius_px, y as f64 + 0.5 + p[1] * radius_px);
                let through = [extinction, of_both].map(|e| (-e * distance).exp());
                plus(sum, [at[0] * through[0], at[1] * through[1]], 1.0 / points.len() as f64)
            });
            if !hides {
                out.on_solid = after[0];
            } else if solid >= depth_mm {
                out.on_solid = before[0] + (after[0] - before[0]) * ((solid - depth_mm) / d);
            }
            return after;
        }
        let Kernel::Lattice { side, stride_px, center } = kernel else { return [1.0; 2] };
        let (side, stride) = (i64::from(side), i64::from(stride_px));
        let at = |i: i64| (2 * i - (side - 1)) * stride / 2;
        let share = (1.0 - center) / (side * side) as f64;
        let mut light = plus([0.0; 2], self.texel(x, y), center);
        for (i, j) in (0..side).flat_map(|j| (0..side).map(move |i| (i, j))) {
            light = plus(light, self.texel(x + at(i), y + at(j)), share);
        }
        for slice in 0..self.step.slices {
            let front = depth_mm + f64::from(slice) * d;
            let (begin, end) = (front.max(near), (front + d).min(far));
            let (color, extinction) = self.material(&ray, slant, begin, end);
            let end = end.max(begin);
            let until = solid.clamp(begin, end);
            let ends = last.clamp(until, end);
            let Some(decay) = &self.plan.decay else { return light };
            // Up to what is solid; up to where the eye's ray ends; all of the slice.
            let [seen, shown, whole] = [until, ends, end].map(|to| extinction * slant * (to - begin));
            let (gathered, weaker) = through_slice(decay, light[1], shown);
            let lit = gathered * self.strength - (1.0 - self.strength) * (-shown).exp_m1();
            out.eye.radiance += color * (lit * out.eye.transmittance);
            out.eye.transmittance *= (-shown).exp();
            let after = through_slice(decay, light[0], whole).1;
            let hides = solid < front + d;
            if !hides {
                out.on_solid = after;
            } else if solid >= front {
                // Between before and behind the slice (Algorithm 4), as light falls.
                let share = if whole > 0.0 { seen / whole } else { 1.0 };
                out.on_solid = light[0] * (after.max(1e-30) / light[0].max(1e-30)).powf(share);
            }
            let stopped = if hides && casts { 0.0 } else { f64::INFINITY };
            let behind = if casts { weaker } else { through_slice(decay, light[1], whole).1 };
            light = [after, (if shades { behind } else { light[1] }).min(stopped)];
        }
        light
    }
}
