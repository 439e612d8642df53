//! Light from a cone towards the eye at places of a context image, by sub-cones through prefiltered
//! extinction, on the CPU in `f64`: what cones of a view keep in their grid of light. World space, the
//! transfer function itself, no bricks.

use glam::{DMat3, DVec3};
use glioscope_core::optics::{Projection, Ray, Sight};

use super::{
    pyramid::{self, Level},
    settings::{ConeSettings, sub_cones},
};
use crate::{
    scene::LightSettings,
    views::context::{
        ContextScene,
        reference::{box_interval, sample},
    },
};

/// No voxel's optical thickness counts for more.
const DARK: f64 = 40.0;
/// Optical thickness past which a sub-cone ends.
const ENOUGH: f64 = 12.0;
/// A verdict that this many millimetres, or pixels, would turn may be another in single precision.
const DOUBT: f64 = 1e-3;

/// Light at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lit {
    /// Share that the image lets through.
    pub through: f64,
    /// Share that solid surfaces let through besides.
    pub past_solid: f64,
    /// Whether rounding may decide what was kept or hidden.
    pub in_doubt: bool,
}

/// Finds light in the image of a scene.
pub struct LitImage<'a> {
    scene: &'a ContextScene,
    sight: &'a Sight,
    solid_mm: &'a [f64],
    settings: ConeSettings,
    axes: Vec<[f64; 3]>,
    levels: Vec<Level>,
    voxel_from_world: glam::DAffine3,
    voxel_from_mm: DMat3,
    dims: DVec3,
    voxel_mm: f64,
}

impl<'a> LitImage<'a> {
    /// `solid_mm` are view depths from the eye, rows from the top, infinite where there is nothing solid;
    /// `None` without an image.
    pub fn new(
        scene: &'a ContextScene,
        sight: &'a Sight,
        solid_mm: &'a [f64],
        lighting: &LightSettings,
    ) -> Option<Self> {
        let grid = scene.volume.as_ref()?.grid();
        let levels = pyramid::levels(grid.dims(), grid.spacing_mm(), |cell| {
            extinction(scene, DVec3::from_array(cell.map(|c| c as f64)))
        });
        let settings = ConeSettings {
            aperture_deg: lighting.aperture_deg,
            sub_cones: lighting.sub_cones,
            coarsest_level: lighting.coarsest_level.min(levels.len() as u32),
            cone_step: lighting.cone_step,
        };
        Some(Self {
            scene,
            sight,
            solid_mm,
            settings,
            axes: sub_cones(&settings),
            levels,
            voxel_from_world: grid.voxel_from_world(),
            voxel_from_mm: grid.world_from_voxel().matrix3.inverse(),
            dims: DVec3::from_array(grid.dims().map(|d| d as f64)),
            voxel_mm: grid.spacing_mm().min_element(),
        })
    }

    /// At a place in the world, millimetres.
    pub fn at(&self, at_mm: DVec3) -> Lit {
        let axis = -self.sight_through(at_mm).direction;
        let right = self.sight.right;
        let u = right - axis * axis.dot(right);
        let u = u / u.length();
        // The card's axes are right, up and away from the eye, a left-handed frame: its cross product.
        let v = u.cross(axis);
        let mut out = Lit { through: 0.0, past_solid: 0.0, in_doubt: false };
        for a in &self.axes {
            let one = self.sub_cone(at_mm, u * a[0] + v * a[1] + axis * a[2]);
            out.through += one.through / self.axes.len() as f64;
            out.past_solid += one.past_solid / self.axes.len() as f64;
            out.in_doubt |= one.in_doubt;
        }
        out
    }

    /// The line of sight through a place, from the eye or its plane.
    fn sight_through(&self, at_mm: DVec3) -> Ray {
        match self.scene.camera.projection {
            Projection::Perspective => {
                let away = at_mm - self.sight.eye_mm;
                Ray { origin_mm: self.sight.eye_mm, direction: away / away.length() }
            }
            Projection::Orthographic => {
                let forward = self.sight.forward;
                Ray { origin_mm: at_mm - forward * self.sight.depth_mm(at_mm), direction: forward }
            }
        }
    }

    fn extinction(&self, index: DVec3, level: f64) -> f64 {
        let of = |n: usize| match n.checked_sub(1).map(|n| self.levels.get(n)) {
            None => extinction(self.scene, index - 0.5).min(DARK / self.voxel_mm),
            Some(level) => level.map_or(0.0, |level| between(level, index)),
        };
        let (low, share) = (level.floor(), level - level.floor());
        of(low as usize) * (1.0 - share) + if share > 0.0 { of(low as usize + 1) * share } else { 0.0 }
    }

    fn sub_cone(&self, at_mm: DVec3, w: DVec3) -> Lit {
        let o = self.voxel_from_world.transform_point3(at_mm) + 0.5;
        let d = self.voxel_from_mm * w;
        let (mut t, mut far) = (0.0f64, f64::INFINITY);
        for a in 0..3 {
            if d[a].abs() > 1e-12 {
                let (x, y) = (-o[a] / d[a], (self.dims[a] - o[a]) / d[a]);
                t = t.max(x.min(y));
                far = far.min(x.max(y));
            } else if o[a] < 0.0 || o[a] > self.dims[a] {
                far = -1.0;
            }
        }
        // Light starts at the eye's plane.
        let towards = w.dot(self.sight.forward);
        if towards < 0.0 {
            far = far.min(-self.sight.depth_mm(at_mm) / towards);
        }
        let tangent = self.settings.sub_tangent();
        let widest = self.voxel_mm * f64::from(self.settings.coarsest_level).exp2();
        let mut thickness = 0.0;
        let mut out = Lit { through: 1.0, past_solid: 1.0, in_doubt: false };
        while t < far && thickness < ENOUGH {
            let width = (2.0 * t * tangent).clamp(self.voxel_mm, widest);
            let step = (self.settings.cone_step * width).min(far - t);
            let middle = t + 0.5 * step;
            let width = (2.0 * middle * tangent).clamp(self.voxel_mm, widest);
            let there = at_mm + w * middle;
            let (kept, unsure) = self.is_kept(there);
            let (hidden, unclear) = self.is_hidden(there);
            out.in_doubt |= unsure || unclear;
            if kept {
                thickness += step * self.extinction(o + d * middle, (width / self.voxel_mm).log2());
            }
            if hidden {
                out.past_solid = 0.0;
            }
            t += step;
        }
        out.through = (-thickness).exp();
        out.past_solid *= out.through;
        out
    }

    /// Not cut away, not in the masks' box and not before that; and whether that is in doubt.
    fn is_kept(&self, at_mm: DVec3) -> (bool, bool) {
        let (mut kept, mut unsure) = (true, false);
        for plane in &self.scene.clip {
            let room = (plane.offset_mm - plane.normal.dot(at_mm)) / plane.normal.length();
            kept &= room >= 0.0;
            unsure |= room.abs() < DOUBT;
        }
        if let Some(tumor) = &self.scene.tumor {
            let ray = self.sight_through(at_mm);
            let (enter, leave) = box_interval(tumor.grid(), &ray);
            let along = (at_mm - ray.origin_mm).dot(ray.direction);
            let meets = enter.max(0.0) < leave;
            kept &= !(meets && along < leave);
            // At the box's end, or past its very edge.
            let corner = (enter.max(0.0) - leave).abs() < 30.0 * DOUBT;
            unsure |= corner || (meets && (along - leave).abs() < DOUBT);
        }
        (kept, unsure)
    }

    /// Behind what is solid at its pixel by more than a voxel; and whether that is in doubt.
    fn is_hidden(&self, at_mm: DVec3) -> (bool, bool) {
        let depth = self.sight.depth_mm(at_mm);
        let off = (at_mm - self.sight.eye_mm) / self.sight.pixel_mm(depth).max(1e-12);
        let [width, height] = self.sight.size.map(f64::from);
        let (x, y) = (off.dot(self.sight.right) + 0.5 * width, 0.5 * height - off.dot(self.sight.up));
        let verdict = |x: f64, y: f64, depth: f64| {
            let (x, y) = (x.floor(), y.floor());
            let inside = x >= 0.0 && y >= 0.0 && x < width && y < height;
            let solid = self.solid_mm.get((y.max(0.0) * width + x.max(0.0)) as usize).filter(|_| inside);
            solid.is_some_and(|solid| *solid < depth - self.voxel_mm)
        };
        let hidden = verdict(x, y, depth);
        let shifts = [(DOUBT, 0.0, 0.0), (0.0, DOUBT, 0.0), (0.0, 0.0, DOUBT)];
        let turned = shifts.iter().any(|(i, j, k)| {
            [1.0, -1.0].iter().any(|s| verdict(x + s * i, y + s * j, depth + s * k) != hidden)
        });
        (hidden, turned)
    }
}

/// Extinction per millimetre at a place among voxel centres.
fn extinction(scene: &ContextScene, q: DVec3) -> f64 {
    -(1.0 - sample(scene, q).1).max(1e-30).ln()
}

/// Trilinear between a level's cells; `index` counts voxel faces.
fn between(level: &Level, index: DVec3) -> f64 {
    let mut sum = 0.0;
    for corner in 0..8usize {
        let mut weight = 1.0;
        let mut cell = [0usize; 3];
        for a in 0..3 {
            let last = (level.dims[a] - 1) as f64;
            let x = (index[a] / f64::from(level.voxels[a]) - 0.5).clamp(0.0, last);
            let up = corner >> a & 1;
            weight *= if up == 1 { x.fract() } else { 1.0 - x.fract() };
            cell[a] = (x as usize + up).min(level.dims[a] - 1);
        }
        let l = (cell[2] * level.dims[1] + cell[1]) * level.dims[0] + cell[0];
        sum += weight * level.extinction.get(l).copied().map_or(0.0, f64::from);
    }
    sum
}
