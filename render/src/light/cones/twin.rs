//! Light from a cone towards the eye at points of a context image, by sub-cones through prefiltered
//! extinction, on the CPU in `f64`: what the light grid holds. In world space, with the transfer function
//! itself and without bricks.

use glam::{DMat3, DVec3};
use glioscope_core::optics::{Sight, srgb};

use super::{
    pyramid::{self, Level},
    settings::{ConeSettings, sub_cones, sub_cones_about},
};
use crate::{
    scene::LightSettings,
    views::context::{
        ContextScene,
        reference::{box_interval, sample},
    },
};

/// Maximum optical thickness of a voxel.
const OPAQUE_THICKNESS: f64 = 40.0;
/// Optical thickness past which a sub-cone ends.
const END_THICKNESS: f64 = 12.0;
/// A comparison decided by less than this many millimetres or pixels may differ in single precision.
const AMBIGUOUS: f64 = 1e-3;

/// Light at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Share that the image transmits.
    pub image_only: f64,
    /// Share that both image and opaque surfaces transmit.
    pub with_opaque: f64,
    /// Colour of what takes light away along a sub-cone, linear, by how much each takes.
    pub color: DVec3,
    /// Whether rounding may decide what was clipped or hidden.
    pub is_ambiguous: bool,
}

/// Computes light in the image of a scene.
pub struct ConeTwin<'a> {
    scene: &'a ContextScene,
    sight: &'a Sight,
    opaque_mm: &'a [f64],
    settings: ConeSettings,
    axes: Vec<[f64; 3]>,
    /// Towards a lamp: sub-cones in world space.
    to_lamp: Option<Vec<DVec3>>,
    levels: Vec<Level>,
    colors: Vec<Vec<DVec3>>,
    voxel_from_world: glam::DAffine3,
    voxel_from_mm: DMat3,
    dims: DVec3,
    voxel_mm: f64,
}

impl<'a> ConeTwin<'a> {
    /// `opaque_mm` are view depths from the eye, rows from the top, infinite where there is no opaque
    /// surface; `None` without an image.
    pub fn new(
        scene: &'a ContextScene,
        sight: &'a Sight,
        opaque_mm: &'a [f64],
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
            opaque_mm,
            settings,
            axes: sub_cones(&settings),
            to_lamp: lighting.towards_lamp.then(|| {
                let world = DMat3::from_cols(sight.right, sight.up, sight.forward);
                let towards = world.transpose() * lighting.lamp.direction(&scene.camera);
                sub_cones_about(towards, &settings).into_iter().map(|w| world * w).collect()
            }),
            colors: Vec::new(),
            levels,
            voxel_from_world: grid.voxel_from_world(),
            voxel_from_mm: grid.world_from_voxel().matrix3.inverse(),
            dims: DVec3::from_array(grid.dims().map(|d| d as f64)),
            voxel_mm: grid.spacing_mm().min_element(),
        })
    }

    /// The same, which gathers colours.
    pub fn with_colors(mut self) -> Self {
        let scene = self.scene;
        let at = |cell: [usize; 3]| sample(scene, DVec3::from_array(cell.map(|c| c as f64)));
        self.colors = pyramid::colors(
            self.dims.to_array().map(|d| d as usize),
            &self.levels,
            |cell| -(1.0 - at(cell).1).max(1e-30).ln(),
            |cell| DVec3::from_array(at(cell).0.map(srgb::decode)),
        );
        self
    }

    /// At a point in the world, millimetres; light from a direction is looked for at `begin_of` it.
    pub fn at(&self, at_mm: DVec3, begin_of: impl Fn(DVec3) -> DVec3) -> Light {
        let axis = -self.sight.line_through(at_mm).direction;
        let right = self.sight.right;
        let u = right - axis * axis.dot(right);
        let u = u / u.length();
        // The device's axes are right, up and away from the eye, a left-handed frame: its cross product.
        let v = u.cross(axis);
        let mut out = Light { image_only: 0.0, with_opaque: 0.0, color: DVec3::ZERO, is_ambiguous: false };
        let to_eye = || self.axes.iter().map(|a| u * a[0] + v * a[1] + axis * a[2]).collect();
        for w in self.to_lamp.clone().unwrap_or_else(to_eye) {
            let one = self.sub_cone(begin_of(w), w);
            out.image_only += one.image_only / self.axes.len() as f64;
            out.with_opaque += one.with_opaque / self.axes.len() as f64;
            out.is_ambiguous |= one.is_ambiguous;
        }
        out
    }

    /// Along one sub-cone from a direction of the world (unit length).
    pub fn along(&self, at_mm: DVec3, from: DVec3) -> Light {
        self.sub_cone(at_mm, from)
    }

    fn extinction(&self, index: DVec3, level: f64) -> f64 {
        let of = |n: usize| match n.checked_sub(1).map(|n| self.levels.get(n)) {
            None => extinction(self.scene, index - 0.5).min(OPAQUE_THICKNESS / self.voxel_mm),
            Some(level) => level.map_or(0.0, |level| trilinear(level, index)),
        };
        let (low, share) = (level.floor(), level - level.floor());
        of(low as usize) * (1.0 - share) + if share > 0.0 { of(low as usize + 1) * share } else { 0.0 }
    }

    /// Mean linear colour by extinction.
    fn color(&self, index: DVec3, level: f64) -> DVec3 {
        let of = |n: usize| match n.checked_sub(1) {
            None => {
                let (color, per_mm) = sample(self.scene, index - 0.5);
                let extinction = -(1.0 - per_mm).max(1e-30).ln();
                let extinction = extinction.min(OPAQUE_THICKNESS / self.voxel_mm);
                (DVec3::from_array(color.map(srgb::decode)) * extinction, extinction)
            }
            Some(n) => {
                let Some((level, colors)) = self.levels.get(n).zip(self.colors.get(n)) else {
                    return (DVec3::ZERO, 0.0);
                };
                corners(level, index).fold((DVec3::ZERO, 0.0), |(sum, all), (cell, weight)| {
                    let extinction = weight * f64::from(level.extinction[cell]);
                    (sum + colors[cell] * extinction, all + extinction)
                })
            }
        };
        let (low, share) = (level.floor(), level - level.floor());
        let (a, b) = (of(low as usize), of(low as usize + 1));
        let all = a.1 * (1.0 - share) + b.1 * share;
        (a.0 * (1.0 - share) + b.0 * share) / all.max(1e-30)
    }

    fn sub_cone(&self, at_mm: DVec3, w: DVec3) -> Light {
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
        let mut out = Light { image_only: 1.0, with_opaque: 1.0, color: DVec3::ZERO, is_ambiguous: false };
        while t < far && thickness < END_THICKNESS {
            let width = (2.0 * t * tangent).clamp(self.voxel_mm, widest);
            let step = (self.settings.cone_step * width).min(far - t);
            let middle = t + 0.5 * step;
            let width = (2.0 * middle * tangent).clamp(self.voxel_mm, widest);
            let there = at_mm + w * middle;
            let (in_image, ambiguous_image) = self.is_in_image(there);
            let (hidden, ambiguous_hidden) = self.is_hidden(there);
            out.is_ambiguous |= ambiguous_image || ambiguous_hidden;
            if in_image {
                let level = (width / self.voxel_mm).log2();
                let here = step * self.extinction(o + d * middle, level);
                if !self.colors.is_empty() {
                    let taken = (-thickness).exp() - (-thickness - here).exp();
                    out.color += self.color(o + d * middle, level) * taken;
                }
                thickness += here;
            }
            if hidden {
                out.with_opaque = 0.0;
            }
            t += step;
        }
        out.image_only = (-thickness).exp();
        out.with_opaque *= out.image_only;
        out
    }

    /// Not clipped, not in the masks' bounding box and not in front of that; and whether that is ambiguous.
    fn is_in_image(&self, at_mm: DVec3) -> (bool, bool) {
        let (mut in_image, mut ambiguous) = (true, false);
        for plane in &self.scene.clip {
            let inside_mm = (plane.offset_mm - plane.normal.dot(at_mm)) / plane.normal.length();
            in_image &= inside_mm >= 0.0;
            ambiguous |= inside_mm.abs() < AMBIGUOUS;
        }
        if let Some(tumor) = &self.scene.tumor {
            let ray = self.sight.line_through(at_mm);
            let (enter, leave) = box_interval(tumor.grid(), &ray);
            let along = (at_mm - ray.origin_mm).dot(ray.direction);
            let meets = enter.max(0.0) < leave;
            in_image &= !(meets && along < leave);
            // At the far side of the box, or grazing its edge.
            let grazes = (enter.max(0.0) - leave).abs() < 30.0 * AMBIGUOUS;
            ambiguous |= grazes || (meets && (along - leave).abs() < AMBIGUOUS);
        }
        (in_image, ambiguous)
    }

    /// Behind its pixel's opaque surface by more than a voxel; and whether that is ambiguous.
    fn is_hidden(&self, at_mm: DVec3) -> (bool, bool) {
        let depth = self.sight.depth_mm(at_mm);
        let off = (at_mm - self.sight.eye_mm) / self.sight.pixel_mm(depth).max(1e-12);
        let [width, height] = self.sight.size.map(f64::from);
        let (x, y) = (off.dot(self.sight.right) + 0.5 * width, 0.5 * height - off.dot(self.sight.up));
        let is_behind = |x: f64, y: f64, depth: f64| {
            let (x, y) = (x.floor(), y.floor());
            let inside = x >= 0.0 && y >= 0.0 && x < width && y < height;
            let opaque = self.opaque_mm.get((y.max(0.0) * width + x.max(0.0)) as usize).filter(|_| inside);
            opaque.is_some_and(|opaque| *opaque < depth - self.voxel_mm)
        };
        let hidden = is_behind(x, y, depth);
        let shifts = [(AMBIGUOUS, 0.0, 0.0), (0.0, AMBIGUOUS, 0.0), (0.0, 0.0, AMBIGUOUS)];
        let ambiguous = shifts.iter().any(|(i, j, k)| {
            [1.0, -1.0].iter().any(|s| is_behind(x + s * i, y + s * j, depth + s * k) != hidden)
        });
        (hidden, ambiguous)
    }
}

/// Extinction per millimetre at voxel coordinates `q`.
fn extinction(scene: &ContextScene, q: DVec3) -> f64 {
    -(1.0 - sample(scene, q).1).max(1e-30).ln()
}

/// Trilinear between a level's cells; `index` counts from voxel faces.
fn trilinear(level: &Level, index: DVec3) -> f64 {
    corners(level, index)
        .map(|(l, weight)| weight * level.extinction.get(l).copied().map_or(0.0, f64::from))
        .sum()
}

/// A level's cells about a place, and the weight of each.
fn corners(level: &Level, index: DVec3) -> impl Iterator<Item = (usize, f64)> {
    (0..8usize).map(move |corner| {
        let mut weight = 1.0;
        let mut cell = [0usize; 3];
        for a in 0..3 {
            let last = (level.dims[a] - 1) as f64;
            let x = (index[a] / f64::from(level.voxels[a]) - 0.5).clamp(0.0, last);
            let up = corner >> a & 1;
            weight *= if up == 1 { x.fract() } else { 1.0 - x.fract() };
            cell[a] = (x as usize + up).min(level.dims[a] - 1);
        }
        ((cell[2] * level.dims[1] + cell[1]) * level.dims[0] + cell[0], weight)
    })
}
