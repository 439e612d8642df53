//! `Context` of lib/image, and `Marched` of lib/context.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, DVec4};
use glioscope_core::optics::Camera;

use super::{
    ImageLook, MOST_CLIP_PLANES,
    tables::Tables,
    volume::{ContextVolume, Field},
};
use crate::{scene::Quality, solid::view::index_axes};

pub(crate) const JITTER: u32 = 1;
pub(crate) const TWO_D: u32 = 2;
pub(crate) const FROM_LAMP: u32 = 4;

/// Brightness of a surface seen edge-on, of 1.
pub(crate) const AMBIENT: f64 = 0.35;
/// Specular term of a surface seen face-on.
pub(crate) const SPECULAR: f64 = 0.12;

/// See lib/image.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Context {
    pub corner: [f32; 3],
    pub step_mm: f32,
    pub right: [f32; 3],
    pub table_scale: f32,
    pub up: [f32; 3],
    pub table_offset: f32,
    pub forward: [f32; 3],
    pub factor_scale: f32,
    pub dims: [u32; 3],
    pub factor_offset: f32,
    pub bricks: [u32; 3],
    pub flags: u32,
    pub half_shaded: f32,
    pub ambient: f32,
    pub specular: f32,
    pub pad: u32,
    pub clips: [[f32; 4]; MOST_CLIP_PLANES],
    pub cut_fade_mm: f32,
    pub table_last: u32,
    pub factor_last: u32,
    pub shading: f32,
    pub lamp: [f32; 3],
    pub unused: u32,
}

/// See lib/context.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Marched {
    pub red_green: u32,
    pub blue_opacity: u32,
    pub depth: f32,
    pub unused: u32,
}

/// The ray step for `wanted_mm`, bounded by the most samples of a ray.
pub(crate) fn step_mm(volume: &ContextVolume, wanted_mm: f64) -> f64 {
    let corners = volume.grid().corners_mm();
    let diagonal = corners[0].distance(corners[7]).max(corners[1].distance(corners[6]));
    let least = diagonal / f64::from(Quality::MOST_CONTEXT_STEPS);
    // Voxels above 1 mm get as many samples per voxel as those of 1 mm.
    let wanted = wanted_mm * volume.grid().spacing_mm().min_element().max(1.0);
    // NaN gives the smallest step.
    if wanted > least { wanted.min(1e6) } else { least }
}

/// Where an image whose values are `field` on the device lies; nothing of its look.
pub(crate) fn geometry(camera: &Camera, reference_mm: f64, field: &FieldShape) -> Context {
    let [corner, right, up, forward] = index_axes(camera, reference_mm, &field.grid);
    Context {
        corner,
        right,
        up,
        forward,
        dims: field.grid.dims().map(|d| d as u32),
        bricks: field.brick_dims.map(|d| d as u32),
        ..Context::default()
    }
}

/// The uniform of an image whose values are `field` on the device.
pub(crate) fn context(
    look: &ImageLook<'_>,
    volume: &ContextVolume,
    field: &FieldShape,
    tables: &Tables,
) -> Context {
    let ImageLook { camera, reference_mm, .. } = *look;
    let [world_right, world_up, world_back] = camera.axes();
    let (_, width) = volume.scale();
    let mut clips = [[0.0; 4]; MOST_CLIP_PLANES];
    let origin_mm = camera.eye_mm() - world_back * reference_mm;
    for (to, plane) in clips.iter_mut().zip(look.clip) {
        let length = plane.normal.length();
        let normal = plane.normal / length;
        let distance_mm = plane.offset_mm / length - normal.dot(origin_mm);
        *to = DVec4::new(normal.dot(world_right), normal.dot(world_up), -normal.dot(world_back), distance_mm)
            .as_vec4()
            .to_array();
    }
    let flag = |on: bool, flag: u32| if on { flag } else { 0 };
    let shade = look.shade;
    let lamp = shade.lamp.map(|l| DVec3::new(l.dot(world_right), l.dot(world_up), -l.dot(world_back)));
    Context {
        step_mm: step_mm(volume, look.step_mm) as f32,
        table_scale: tables.color_place.0 as f32,
        table_offset: tables.color_place.1 as f32,
        factor_scale: tables.factor_place.0 as f32,
        factor_offset: tables.factor_place.1 as f32,
        flags: flag(look.jitter, JITTER) | flag(look.by_gradient, TWO_D) | flag(lamp.is_some(), FROM_LAMP),
        half_shaded: (volume.half_shaded() / width) as f32,
        ambient: AMBIENT as f32,
        specular: SPECULAR as f32,
        clips,
        cut_fade_mm: volume.cut_fade_mm() as f32,
        table_last: tables.columns as u32 - 1,
        factor_last: tables.rows as u32 - 1,
        shading: if shade.share.is_nan() { 0.0 } else { shade.share.clamp(0.0, 1.0) as f32 },
        lamp: lamp.unwrap_or_default().as_vec3().to_array(),
        ..geometry(camera, reference_mm, field)
    }
}

/// The part of a [`Field`] that is kept when its values are on the device.
pub(crate) struct FieldShape {
    pub grid: glioscope_core::Grid,
    pub brick_dims: [usize; 3],
    pub halvings: u32,
}

impl FieldShape {
    pub fn of(field: &Field) -> Self {
        Self { grid: field.grid.clone(), brick_dims: field.brick_dims(), halvings: field.halvings }
    }

    /// Warning where the image is drawn at reduced resolution.
    pub fn warning(&self, volume: &ContextVolume) -> Option<String> {
        let [x, y, z] = volume.grid().dims();
        (self.halvings > 0).then(|| {
            format!(
                "The context image ({x}x{y}x{z} voxels) is too large for this graphics device and is shown at \
                 1/{} of its resolution along each axis.",
                1 << self.halvings
            )
        })
    }
}

/// A number in 0..1 from a pixel, as `hash` of lib/image_march.
pub(crate) fn jitter(pixel: [u32; 2]) -> f64 {
    let mut h = pixel[0].wrapping_mul(0x8da6_b343).wrapping_add(pixel[1].wrapping_mul(0xd816_3841));
    h = (h ^ h >> 16).wrapping_mul(0x7feb_352d);
    h = (h ^ h >> 15).wrapping_mul(0x846c_a68b);
    f64::from((h ^ h >> 16) >> 8) / 16_777_216.0
}

impl Marched {
    /// Premultiplied red, green, blue, and opacity.
    pub fn rgba(&self) -> [f64; 4] {
        let halves = |word: u32| [word & 0xffff, word >> 16].map(|h| f64::from(h) / 65535.0);
        let ([r, g], [b, a]) = (halves(self.red_green), halves(self.blue_opacity));
        [r, g, b, a]
    }
}

/// For the layout test.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(
        Context, "Context": corner, step_mm, right, table_scale, up, table_offset, forward, factor_scale, dims,
        factor_offset, bricks, flags, half_shaded, ambient, specular, pad, clips, cut_fade_mm, table_last,
        factor_last, shading, lamp, unused
    ),
    crate::layouts::layout!(Marched, "Marched": red_green, blue_opacity, depth, unused),
];
