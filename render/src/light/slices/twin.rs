//! Combined surface and volumetric occlusion by slices (Schott et al. 2012, Algorithms 1 to 4) on the CPU
//! in `f64`: the context view's image, opaque surfaces at given depths, both lights.
//!
//! Two lights are carried from slice to slice: one that the image attenuates, received by opaque surfaces, which block it in
//! the paper's variants alone, and one that opaque surfaces block, received by the image.

use glam::DVec3;
use glioscope_core::optics::{Ray, Sight, cone::through_slice, srgb};
use rayon::prelude::*;

use super::{
    lamp::ellipse_points,
    medium_twin::Eye,
    plan::{Kernel, SlicePlan, Step, disc_points},
};
use crate::{
    scene::{MutualOcclusion, SliceVariant},
    views::context::{
        ContextScene,
        reference::{in_index_space, sample, visible_interval},
    },
};

/// One pixel: the image, and the share of light that reaches the opaque surface there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Combined {
    /// Of the image, in linear light.
    pub eye: Eye,
    /// Light on the opaque surface, attenuated by the image alone; 1 in front of all slices.
    pub on_opaque: f64,
}

/// Light for opaque surfaces, and for the image.
type Lights = [f64; 2];

/// Runs `plan` through the image of `scene`. `opaque_mm` are view depths from the eye, infinite where
/// there is no opaque surface; where no light arrives, `strength` of it is lost. Rows from the top.
pub fn slices(
    scene: &ContextScene,
    sight: &Sight,
    plan: &SlicePlan,
    opaque_mm: &[f64],
    mutual: &MutualOcclusion,
    strength: f64,
) -> Vec<Combined> {
    slices_with_ray_ends(scene, sight, plan, [opaque_mm; 2], mutual, strength)
}

/// As [`slices`] where the eye's rays end at or behind the opaque surfaces: at the second of `opaque_mm`,
/// none in front of the first.
pub fn slices_with_ray_ends(
    scene: &ContextScene,
    sight: &Sight,
    plan: &SlicePlan,
    opaque_mm: [&[f64]; 2],
    mutual: &MutualOcclusion,
    strength: f64,
) -> Vec<Combined> {
    let [width, height] = sight.size.map(|s| s as usize);
    let initial = Combined { eye: Eye { radiance: DVec3::ZERO, transmittance: 1.0 }, on_opaque: 1.0 };
    let mut out = vec![initial; width * height];
    let mut before = vec![[1.0; 2]; width * height];
    for step in &plan.steps {
        let pass = Pass { scene, sight, plan, step, before: &before, mutual, strength };
        let mut after = vec![[1.0; 2]; width * height];
        out.par_iter_mut().zip(after.par_iter_mut()).enumerate().for_each(|(i, (out, after))| {
            let pixel = [(i % width) as u32, (i / width) as u32];
            let depths = opaque_mm.map(|mm| mm.get(i).copied().unwrap_or(f64::INFINITY));
            *after = pass.pixel(pixel, depths, out);
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

fn add_weighted(a: Lights, b: Lights, weight: f64) -> Lights {
    [a[0] + weight * b[0], a[1] + weight * b[1]]
}

/// Light scattered to the eye in a slice that light crosses towards it, falling from `first` to `last` exponentially, by
/// quadrature; `seen` is the slice's optical thickness along the eye's ray.
fn onwards(first: f64, last: f64, seen: f64) -> f64 {
    if seen <= 0.0 || first <= 0.0 {
        return 0.0;
    }
    // Midpoints, denser towards the eye, where a thick slice is seen.
    let n = 4000;
    let faded = (first.max(1e-30) / last.max(1e-30)).ln();
    let at = |k: i32| (f64::from(k) / f64::from(n)).powi(3);
    (0..n)
        .map(|k| {
            let (from, to) = (at(k), at(k + 1));
            let before_eye = 0.5 * (from + to);
            (to - from) * seen * (-seen * before_eye).exp() * first * (-faded * (1.0 - before_eye)).exp()
        })
        .sum()
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
        corners.iter().fold([0.0; 2], |sum, (i, j, w)| add_weighted(sum, self.texel(x + i, y + j), *w))
    }

    /// A point of the ellipse that the lamp's light comes from, pixels from the pixel itself.
    fn towards(&self, pixel: [u32; 2], p: [f64; 2]) -> [f64; 2] {
        let Kernel::Ellipse { scale, shift_px, axes_px: [along, across], .. } = self.step.kernel else {
            return [0.0; 2];
        };
        let middle = self.sight.size.map(|s| 0.5 * f64::from(s));
        std::array::from_fn(|a| {
            scale * (f64::from(pixel[a]) + 0.5 - middle[a]) + shift_px[a] + p[0] * along[a] + p[1] * across[a]
        })
    }

    fn pixel_mm(&self) -> f64 {
        if let Kernel::Ellipse { pixel_mm, .. } = self.step.kernel { pixel_mm } else { 0.0 }
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

    fn pixel(&self, pixel: [u32; 2], [opaque, ray_end]: [f64; 2], out: &mut Combined) -> Lights {
        let slant = self.sight.slant(pixel);
        let origin_mm = self.sight.at_mm(pixel, 0.0);
        let direction = (self.sight.at_mm(pixel, 1.0) - origin_mm) / slant;
        let ray = Ray { origin_mm, direction };
        let (near, far) =
            visible_interval(self.scene, &ray).map_or((0.0, 0.0), |(a, b)| (a / slant, b / slant));
        let d = self.plan.slice_mm;
        let opaque_occludes = self.mutual.opaque_on_image;
        let image_occludes = self.mutual.image_on_image;
        let Step { depth_mm, kernel, .. } = *self.step;
        let from_behind = self.plan.is_lit_from_behind();
        // A lamp behind the scene is hidden from surfaces by all that is behind them, but for so much.
        let lag_mm = self.plan.lamp.map_or(0.0, |cone| cone.lag_px()) * self.sight.pixel_mm(opaque.min(1e9));
        let is_hidden = |front: f64| self.mutual.opaque_on_opaque && front > opaque + lag_mm;
        let [x, y] = pixel.map(i64::from);
        if self.plan.variant != SliceVariant::Mended {
            let before = self.texel(x, y);
            let (begin, end) = (depth_mm.max(near), (depth_mm + d).min(far));
            let (color, extinction) = self.material(&ray, slant, begin, end);
            let sampled = (end - begin).min(ray_end - depth_mm).max(0.0);
            let alpha = -(-extinction * sampled).exp_m1();
            let lit = 1.0 + self.strength * (before[1] - 1.0);
            let own = color * (lit * alpha);
            out.eye.radiance = if from_behind {
                out.eye.radiance * (1.0 - alpha) + own
            } else {
                out.eye.radiance + own * out.eye.transmittance
            };
            out.eye.transmittance *= 1.0 - alpha;
            let meets = (depth_mm..depth_mm + d).contains(&opaque);
            let hides = if from_behind { meets } else { opaque < depth_mm + d };
            let of_both = match (hides && opaque_occludes, image_occludes) {
                (true, _) => f64::INFINITY,
                (false, true) => extinction,
                (false, false) => 0.0,
            };
            let grid = match kernel {
                Kernel::Disc { grid, .. } | Kernel::Ellipse { grid, .. } => grid,
                Kernel::Lattice { .. } => return before,
            };
            let points = disc_points(grid);
            let after = points.iter().fold([0.0; 2], |sum, p| {
                // In pixels, and in millimetres.
                let (off, off_mm2) = match kernel {
                    Kernel::Disc { radius_px, radius_mm, .. } => {
                        (p.map(|c| c * radius_px), (p[0] * p[0] + p[1] * p[1]) * radius_mm * radius_mm)
                    }
                    _ => {
                        let off = self.towards(pixel, *p);
                        (off, (off[0] * off[0] + off[1] * off[1]) * self.pixel_mm().powi(2))
                    }
                };
                let distance = match self.plan.variant {
                    SliceVariant::PaperExact => (d * d + off_mm2).sqrt(),
                    _ => d,
                };
                let at = self.bilinear(x as f64 + 0.5 + off[0], y as f64 + 0.5 + off[1]);
                let through = [extinction, of_both].map(|e| (-e * distance).exp());
                add_weighted(sum, [at[0] * through[0], at[1] * through[1]], 1.0 / points.len() as f64)
            });
            let from_front = (opaque - depth_mm) / d;
            if meets {
                let share = if from_behind { 1.0 - from_front } else { from_front };
                out.on_opaque = before[0] + (after[0] - before[0]) * share;
            } else if (opaque < depth_mm) == from_behind {
                out.on_opaque = after[0];
            }
            let gone = if from_behind { is_hidden(depth_mm) } else { hides && self.mutual.opaque_on_opaque };
            return [if gone { 0.0 } else { after[0] }, after[1]];
        }
        let has_lamp = self.plan.lamp.is_some();
        let mut light = match kernel {
            Kernel::Lattice { side, stride_px, center } => {
                let (side, stride) = (i64::from(side), i64::from(stride_px));
                let at = |i: i64| (2 * i - (side - 1)) * stride / 2;
                let share = (1.0 - center) / (side * side) as f64;
                let own = add_weighted([0.0; 2], self.texel(x, y), center);
                (0..side)
                    .flat_map(|j| (0..side).map(move |i| (i, j)))
                    .fold(own, |light, (i, j)| add_weighted(light, self.texel(x + at(i), y + at(j)), share))
            }
            Kernel::Ellipse { grid, .. } => {
                let points = ellipse_points(grid, false);
                points.iter().fold([0.0; 2], |light, p| {
                    let off = self.towards(pixel, *p);
                    let at = self.bilinear(x as f64 + 0.5 + off[0], y as f64 + 0.5 + off[1]);
                    add_weighted(light, at, 1.0 / points.len() as f64)
                })
            }
            Kernel::Disc { .. } => return [1.0; 2],
        };
        for slice in 0..self.step.slices {
            let slice = if from_behind { self.step.slices - 1 - slice } else { slice };
            let front = depth_mm + f64::from(slice) * d;
            let (begin, end) = (front.max(near), (front + d).min(far));
            let (color, extinction) = self.material(&ray, slant, begin, end);
            let end = end.max(begin);
            let to_opaque = opaque.clamp(begin, end);
            let to_ray_end = ray_end.clamp(to_opaque, end);
            let Some(decay) = &self.plan.decay else { return light };
            if from_behind {
                let seen = extinction * slant * (to_ray_end - begin);
                let meets = (front..front + d).contains(&opaque);
                let through = light.map(|l| through_slice(decay, l, extinction * (end - begin)).1);
                let shaded = if image_occludes { through[1] } else { light[1] };
                let blocked = if meets && opaque_occludes { 0.0 } else { f64::INFINITY };
                let [first, last] = [light[1], shaded].map(|l| l.min(blocked));
                let lit =
                    onwards(first, last, seen) * self.strength - (1.0 - self.strength) * (-seen).exp_m1();
                out.eye.radiance = out.eye.radiance * (-seen).exp() + color * lit;
                out.eye.transmittance *= (-seen).exp();
                if meets {
                    let share = if end > begin { (end - to_opaque) / (end - begin) } else { 1.0 };
                    out.on_opaque = light[0] * (through[0].max(1e-30) / light[0].max(1e-30)).powf(share);
                } else if opaque < front {
                    out.on_opaque = through[0];
                }
                light = [if is_hidden(front) { 0.0 } else { through[0] }, shaded.min(blocked)];
                continue;
            }
            // Optical thickness up to the opaque surface, up to the end of the eye's ray, and of the whole slice.
            let [in_front, visible, whole] = [to_opaque, to_ray_end, end]
                .map(|to| extinction * if has_lamp { 1.0 } else { slant } * (to - begin));
            let (mut gathered, attenuated) = through_slice(decay, light[1], visible);
            let mut seen = visible;
            if has_lamp {
                seen = visible * slant;
                gathered *= if visible > 1e-6 { (-seen).exp_m1() / (-visible).exp_m1() } else { slant };
            }
            let lit = gathered * self.strength - (1.0 - self.strength) * (-seen).exp_m1();
            out.eye.radiance += color * (lit * out.eye.transmittance);
            out.eye.transmittance *= (-seen).exp();
            let after = through_slice(decay, light[0], whole).1;
            let hides = opaque < front + d;
            if !hides {
                out.on_opaque = after;
            } else if opaque >= front {
                // Between the light in front of and behind the slice (Algorithm 4), along its decay.
                let share = if whole > 0.0 { in_front / whole } else { 1.0 };
                out.on_opaque = light[0] * (after.max(1e-30) / light[0].max(1e-30)).powf(share);
            }
            let blocked = if hides && opaque_occludes { 0.0 } else { f64::INFINITY };
            let behind = if opaque_occludes { attenuated } else { through_slice(decay, light[1], whole).1 };
            light = [after, (if image_occludes { behind } else { light[1] }).min(blocked)];
        }
        light
    }
}
