//! The context view's rays on the CPU in `f64`, straight from the definitions: world space, the image's
//! own values, the transfer function itself instead of a table, no bricks, no early ray termination.

use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid, Volume,
    optics::{
        Ray, srgb,
        volume::{Filter, OpticalVolume, Table},
    },
};
use rayon::prelude::*;

use super::ContextScene;
use crate::{
    image::{
        Shade, TransferFunction,
        tables::Tables,
        uniforms::{AMBIENT, SPECULAR, jitter},
        volume::Field,
    },
    light::frame_error::FrameImage,
};

/// Sampling along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Length of a cell, millimetres along the ray.
    pub step_mm: f64,
    /// Whether the first cell is shortened by the pixel's jitter, as on the device.
    pub jitter: bool,
}

/// The context image in each pixel of a frame of `size`, rows from the top: premultiplied red, green,
/// blue, and opacity. The tumour hides nothing, but the image is omitted in and in front of its box.
pub fn march(scene: &ContextScene, size: [u32; 2], sampling: Sampling) -> Vec<[f64; 4]> {
    march_shaded(scene, size, sampling, &Shade::HEADLIGHT)
}

/// The same with any shading.
pub(crate) fn march_shaded(
    scene: &ContextScene,
    size: [u32; 2],
    sampling: Sampling,
    shade: &Shade,
) -> Vec<[f64; 4]> {
    let pixels: Vec<[u32; 2]> = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y])).collect();
    pixels.into_par_iter().map(|pixel| march_one(scene, size, pixel, (sampling, shade))).collect()
}

/// Interval of a ray in a grid's box, in millimetres along it; empty if the first is not less.
pub(crate) fn box_interval(grid: &Grid, ray: &Ray) -> (f64, f64) {
    let (o, d) = in_index_space(grid, ray);
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let (low, high) = (-0.5, grid.dims()[axis] as f64 - 0.5);
        if d[axis].abs() < 1e-12 {
            if !(o[axis] >= low && o[axis] < high) {
                return (0.0, 0.0);
            }
        } else {
            let (a, b) = ((low - o[axis]) / d[axis], (high - o[axis]) / d[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
    }
    (near, far)
}

/// A ray's origin and direction in index space, with voxel centres at integers.
pub(crate) fn in_index_space(grid: &Grid, ray: &Ray) -> (DVec3, DVec3) {
    let world = grid.world_from_voxel();
    let inverse: DMat3 = world.matrix3.inverse();
    (inverse * (ray.origin_mm - world.translation), inverse * ray.direction)
}

/// Trilinear value; NaN where a voxel with weight is not finite. Clamped to the edge voxels past the
/// outermost centres.
pub(super) fn value_at(image: &Volume, q: DVec3) -> f64 {
    let dims = image.grid().dims();
    let mut sum = 0.0;
    for corner in 0..8usize {
        let mut weight = 1.0;
        let mut ijk = [0; 3];
        for axis in 0..3 {
            let x = q[axis].clamp(0.0, (dims[axis] - 1) as f64);
            let up = corner >> axis & 1;
            weight *= if up == 1 { x.fract() } else { 1.0 - x.fract() };
            ijk[axis] = (x as usize + up).min(dims[axis] - 1);
        }
        if weight > 0.0 {
            let value = image.value(image.grid().linear(ijk));
            sum += weight * if value.is_finite() { value } else { f64::NAN };
        }
    }
    sum
}

/// Gradient per millimetre, world axes: central differences of one voxel.
fn gradient_at(image: &Volume, q: DVec3) -> DVec3 {
    let dims = image.grid().dims();
    let last = DVec3::from_array(dims.map(|d| (d - 1) as f64));
    let q = q.clamp(DVec3::ZERO, last);
    let along = |axis: DVec3| 0.5 * (value_at(image, q + axis) - value_at(image, q - axis));
    let per_voxel = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
    image.grid().world_from_voxel().matrix3.inverse().transpose() * per_voxel
}

/// The interval of a ray, in millimetres along it, where the image is visible: in its box, not clipped, not in
/// the bounding box of the masks and not in front of that. `None` if there is none.
pub(crate) fn visible_interval(scene: &ContextScene, ray: &Ray) -> Option<(f64, f64)> {
    let (near, mut far) = box_interval(scene.volume.as_ref()?.grid(), ray);
    let mut near = near.max(0.0);
    for plane in &scene.clip {
        let room = plane.offset_mm - plane.normal.dot(ray.origin_mm);
        let rate = plane.normal.dot(ray.direction);
        if rate > 0.0 {
            far = far.min(room / rate);
        } else if rate < 0.0 {
            near = near.max(room / rate);
        } else if room < 0.0 {
            return None;
        }
    }
    if let Some(tumor) = &scene.tumor {
        let (enter, leave) = box_interval(tumor.grid(), ray);
        if enter.max(0.0) < leave {
            near = near.max(leave);
        }
    }
    (near < far).then_some((near, far))
}

#[cfg(test)]
/// Encoded colour and opacity of 1 mm at voxel coordinates `q`; transparent where the image isn't
/// finite, and without an image.
pub(crate) fn sample(scene: &ContextScene, q: DVec3) -> ([f64; 3], f64) {
    let Some(volume) = &scene.volume else { return ([0.0; 3], 0.0) };
    let value = value_at(volume.image(), q);
    let steepness =
        if scene.transfer.uses_gradient() { gradient_at(volume.image(), q).length() } else { 0.0 };
    scene.transfer.sample(value, steepness)
}

fn march_one(
    scene: &ContextScene,
    size: [u32; 2],
    pixel: [u32; 2],
    (sampling, shade): (Sampling, &Shade),
) -> [f64; 4] {
    let Some(volume) = &scene.volume else { return [0.0; 4] };
    let image = volume.image();
    let center = DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
    let ray = scene.camera.ray(center, DVec2::new(f64::from(size[0]), f64::from(size[1])));
    let Some((near, far)) = visible_interval(scene, &ray) else { return [0.0; 4] };
    let (o, d) = in_index_space(image.grid(), &ray);
    let mut out = [0.0; 4];
    let mut begin = near;
    let mut end = near + sampling.step_mm * if sampling.jitter { jitter(pixel) } else { 1.0 };
    let mut cell = 0.0;
    let first = end;
    while begin < far {
        end = end.min(far);
        let q = o + d * (0.5 * (begin + end));
        let value = value_at(image, q);
        let gradient = gradient_at(image, q);
        let (color, per_mm) = scene.transfer.sample(value, gradient.length());
        let opacity = TransferFunction::opacity_over(per_mm, end - begin);
        let through = 1.0 - out[3];
        let inside = (0.5 * (begin + end) - near) / volume.cut_fade_mm();
        let color = shaded(color, gradient, ray.direction, (volume.half_shaded(), inside), shade);
        for i in 0..3 {
            out[i] += through * opacity * color[i];
        }
        out[3] += through * opacity;
        begin = end;
        // Not summed up, so that rounding errors don't accumulate.
        cell += 1.0;
        end = first + sampling.step_mm * cell;
    }
    out
}

/// Phong's shading of a surface whose normal is the gradient, turned to the eye.
fn shaded(
    color: [f64; 3],
    gradient: DVec3,
    ray: DVec3,
    (half_shaded, inside): (f64, f64),
    shade: &Shade,
) -> [f64; 3] {
    let steepness = gradient.length();
    if !steepness.is_finite() || steepness == 0.0 {
        return color;
    }
    let strength = inside.min(1.0) * steepness.powi(2) / (steepness.powi(2) + half_shaded.powi(2));
    let strength = strength * shade.share;
    let normal = gradient / steepness * -gradient.dot(ray).signum();
    let towards = shade.lamp.unwrap_or(-ray);
    let facing = normal.dot(towards).max(0.0);
    let highlight = if facing > 0.0 { normal.dot((towards - ray).normalize_or_zero()).max(0.0) } else { 0.0 };
    let light = AMBIENT + (1.0 - AMBIENT) * facing;
    color.map(|c| {
        (c * (1.0 - strength + strength * light) + strength * SPECULAR * highlight.powi(16)).min(1.0)
    })
}

impl FrameImage for ContextScene {
    fn medium(&self) -> Option<OpticalVolume> {
        ContextScene::medium(self)
    }

    fn shown_mm(&self, sight: &Ray) -> Option<(f64, f64)> {
        visible_interval(self, sight)
    }
}

impl ContextScene {
    /// The image as a participating medium: the values and tables of the device, colours in linear light. Clipping
    /// planes and the tumour's box are ignored. `None` without an image, with one over 4 GiB at an eighth of its
    /// resolution, and with a transfer function that uses gradients, which a medium doesn't have.
    pub fn medium(&self) -> Option<OpticalVolume> {
        let volume = self.volume.as_ref().filter(|_| !self.transfer.uses_gradient())?;
        let field = Field::fitting(volume, 1 << 32)?;
        let tables = Tables::of(&self.transfer, volume.scale(), &field.ranges());
        let linear = |c: f32| srgb::decode(f64::from(c)) as f32;
        let entry =
            |[r, g, b, a]: &[f32; 4]| [linear(*r), linear(*g), linear(*b), -(1.0 - a).max(1e-30).ln()];
        let entries: Vec<[f32; 4]> = tables.colors.iter().map(entry).collect();
        let (scale, offset) = tables.color_place;
        let last = (entries.len() - 1) as f64;
        let table = Table::new((-offset / scale) as f32, ((last - offset) / scale) as f32, &entries)?;
        OpticalVolume::new(field.grid, field.values, table, Filter::Linear, None)
    }
}
