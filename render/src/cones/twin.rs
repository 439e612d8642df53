//! Cone-traced occlusion on the CPU in `f64`.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::{
    pyramid::{Level, Pyramid},
    settings::{ConeSettings, sub_cones},
};
use crate::{
    camera::Ray,
    dos::twin::Eye,
    occlusion::{
        Filter, OpticalVolume, Sight,
        cone::{Decay, through_slice},
    },
    reference::medium::{Medium, box_interval},
};

/// Optical thickness past which a sub-cone or a ray ends.
pub(crate) const ENOUGH: f64 = 12.0;
/// Steps thicker than this take their light from their front, see `render`.
pub(crate) const THICK: f64 = 1.0;
/// Depth before a step's front where its light is taken, voxels.
pub(crate) const SLIP_VOXELS: f64 = 1e-4;

/// What a picture is traced with.
pub(crate) struct Tracer<'a> {
    pub volume: &'a OpticalVolume,
    pub pyramid: &'a Pyramid,
    pub settings: ConeSettings,
    pub axes: Vec<[f64; 3]>,
    pub decay: Arc<Decay>,
}

impl Level {
    /// Trilinear at an index space place of the volume.
    fn at(&self, p: DVec3) -> f64 {
        let at: [f64; 3] = std::array::from_fn(|a| {
            (p[a] / f64::from(self.voxels[a]) - 0.5).clamp(0.0, (self.dims[a] - 1) as f64)
        });
        let low: [usize; 3] = std::array::from_fn(|a| (at[a] as usize).min(self.dims[a].saturating_sub(2)));
        (0..8)
            .map(|i| {
                let mut weight = 1.0;
                let cell: [usize; 3] = std::array::from_fn(|a| {
                    let f = at[a] - low[a] as f64;
                    weight *= if i >> a & 1 == 1 { f } else { 1.0 - f };
                    (low[a] + (i >> a & 1)).min(self.dims[a] - 1)
                });
                let l = (cell[2] * self.dims[1] + cell[1]) * self.dims[0] + cell[0];
                weight * self.extinction.get(l).copied().map_or(0.0, f64::from)
            })
            .sum()
    }
}

impl Tracer<'_> {
    /// Extinction for a cone as wide as 2^`level` of the finest voxels at an index space place.
    fn extinction(&self, p: DVec3, level: f64) -> f64 {
        let own = || self.volume.optics_at_index(p).extinction_per_mm;
        if level <= 0.0 {
            return own();
        }
        let finest = &self.pyramid.levels[0];
        let low = level.floor();
        let of = |i: usize| match self.pyramid.levels.get(i) {
            Some(level) if i > 0 => level.at(p),
            _ => own().min(40.0 / finest.cell_mm),
        };
        let (a, f) = (of(low as usize), level - low);
        if f > 0.0 { a + (of(low as usize + 1) - a) * f } else { a }
    }

    /// Share of the light of one sub-cone that reaches a place.
    fn through(&self, at_mm: DVec3, direction: DVec3, tangent: f64) -> f64 {
        let coarsest = f64::from(self.settings.coarsest_level).min((self.pyramid.levels.len() - 1) as f64);
        let ray = Ray { origin_mm: at_mm, direction };
        if coarsest == 0.0 && self.volume.filter() == Filter::Nearest {
            return (-self.volume.thickness(&ray, f64::INFINITY)).exp();
        }
        let o = self.volume.index_of(at_mm);
        let d = self.volume.voxel_from_mm() * direction;
        let [x, y, z] = self.volume.grid().dims().map(|d| d as f64);
        let Some((_, far)) = box_interval(o, d, DVec3::new(x, y, z)) else { return 1.0 };
        let voxel = self.pyramid.levels[0].cell_mm;
        let widest = voxel * coarsest.exp2();
        let (normal, offset) = self.volume.index_plane();
        let (mut t, mut thickness) = (0.0, 0.0);
        while t < far && thickness < ENOUGH {
            let width = (2.0 * t * tangent).clamp(voxel, widest);
            let step = (self.settings.cone_step * width).min(far - t);
            let p = o + d * (t + 0.5 * step);
            // The width in the middle of the step.
            let width = (2.0 * (t + 0.5 * step) * tangent).clamp(voxel, widest);
            if normal.dot(p) <= offset {
                thickness += self.extinction(p, (width / voxel).log2()) * step;
            }
            t += step;
        }
        (-thickness).exp()
    }

    /// Equation 10 by sub-cones about the way back along a ray.
    fn light(&self, at_mm: DVec3, frame: [DVec3; 3]) -> f64 {
        let tangent = self.settings.sub_tangent();
        let [u, v, axis] = frame;
        let sum: f64 =
            self.axes.iter().map(|a| self.through(at_mm, u * a[0] + v * a[1] + axis * a[2], tangent)).sum();
        sum / self.axes.len() as f64
    }

    fn pixel(&self, sight: &Sight, pixel: [u32; 2]) -> Eye {
        let mut eye = Eye { radiance: DVec3::ZERO, transmittance: 1.0 };
        let front = sight.at_mm(pixel, 0.0);
        let slant = sight.slant(pixel);
        let direction = (sight.at_mm(pixel, 1.0) - front) / slant;
        // Right in the picture, at right angles to the ray.
        let axis = -direction;
        let u = (sight.right - axis * axis.dot(sight.right)).normalize_or(sight.right);
        let frame = [u, axis.cross(u), axis];
        let voxel = self.pyramid.levels[0].cell_mm;
        let most = self.settings.ray_step * voxel;
        let ray = Ray { origin_mm: front, direction };
        self.volume.pieces(&ray, most, |from, to| {
            let middle = front + direction * (0.5 * (from + to));
            let optics = self.volume.optics(middle);
            if optics.extinction_per_mm <= 0.0 {
                return true;
            }
            let thickness = optics.extinction_per_mm * (to - from);
            if thickness < THICK {
                let light = self.light(middle, frame);
                eye.radiance += optics.color * (-(-thickness).exp_m1() * light * eye.transmittance);
                eye.transmittance *= (-thickness).exp();
            } else {
                let light = self.light(front + direction * (from - SLIP_VOXELS * voxel), frame);
                // What is opaque is a surface; else light falls within the step as in a slab lit from all
                // of the cone.
                let gathered = if thickness.is_infinite() {
                    light
                } else {
                    light * through_slice(&self.decay, 1.0, thickness).0
                };
                eye.radiance += optics.color * (gathered * eye.transmittance);
                eye.transmittance *= (-thickness).exp();
            }
            eye.transmittance > (-ENOUGH).exp()
        });
        eye
    }
}

/// Draws a picture, rows from the top.
pub fn render(volume: &OpticalVolume, pyramid: &Pyramid, sight: &Sight, settings: &ConeSettings) -> Vec<Eye> {
    let settings = settings.used().settings;
    let axes = sub_cones(&settings);
    let decay = Decay::of(settings.aperture_deg);
    let tracer = Tracer { volume, pyramid, settings, axes, decay };
    let width = sight.size[0];
    (0..width * sight.size[1]).into_par_iter().map(|i| tracer.pixel(sight, [i % width, i / width])).collect()
}
