//! `Context` of context_march.wgsl, and `Marched` of lib/context.wgsl.

use bytemuck::{Pod, Zeroable};
use glam::DVec4;

use super::{
    scene::{ContextScene, MOST_CLIP_PLANES},
    volume::{ContextVolume, Field, Tables},
};
use crate::{
    plan::{PassName, Plan},
    quality::Quality,
    uniforms::index_axes,
};

pub(crate) const JITTER: u32 = 1;
pub(crate) const TWO_D: u32 = 2;

/// Light that a face gets that is seen edge-on, of 1.
pub(crate) const AMBIENT: f64 = 0.35;
/// What is added where a face is seen straight on.
pub(crate) const SPECULAR: f64 = 0.12;

/// See context_march.wgsl.
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
    pub unused: u32,
}

/// See lib/context.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Marched {
    pub red_green: u32,
    pub blue_opacity: u32,
    pub depth: f32,
    pub unused: u32,
}

/// The step that `quality` asks for, within what a ray may have.
pub(crate) fn step_mm(volume: &ContextVolume, quality: &Quality) -> f64 {
    let corners = volume.grid().corners_mm();
    let diagonal = corners[0].distance(corners[7]).max(corners[1].distance(corners[6]));
    let least = diagonal / f64::from(Quality::MOST_CONTEXT_STEPS);
    // Voxels of more than a millimetre are sampled as often as those of one.
    let wanted = quality.context_step_mm * volume.grid().spacing_mm().min_element().max(1.0);
    // NaN is no step.
    if wanted > least { wanted.min(1e6) } else { least }
}

/// The uniform of a scene with `volume`, whose values are `field` on the card.
pub(crate) fn context(
    scene: &ContextScene,
    volume: &ContextVolume,
    field: &FieldShape,
    tables: &Tables,
    quality: &Quality,
    plan: &Plan,
) -> Context {
    let camera = &scene.camera;
    let reference_mm = scene.reference_mm();
    let [corner, right, up, forward] = index_axes(camera, reference_mm, &field.grid);
    let [world_right, world_up, world_back] = camera.axes();
    let (_, width) = volume.scale();
    let mut clips = [[0.0; 4]; MOST_CLIP_PLANES];
    let origin_mm = camera.eye_mm() - world_back * reference_mm;
    for (to, plane) in clips.iter_mut().zip(&scene.clip) {
        let length = plane.normal.length();
        let normal = plane.normal / length;
        let room = plane.offset_mm / length - normal.dot(origin_mm);
        *to = DVec4::new(normal.dot(world_right), normal.dot(world_up), -normal.dot(world_back), room)
            .as_vec4()
            .to_array();
    }
    Context {
        corner,
        right,
        up,
        forward,
        step_mm: step_mm(volume, quality) as f32,
        table_scale: tables.color_place.0 as f32,
        table_offset: tables.color_place.1 as f32,
        factor_scale: tables.factor_place.0 as f32,
        factor_offset: tables.factor_place.1 as f32,
        dims: field.grid.dims().map(|d| d as u32),
        bricks: field.brick_dims.map(|d| d as u32),
        flags: JITTER | if plan.has(PassName::GradientOpacity) { TWO_D } else { 0 },
        half_shaded: (volume.half_shaded() / width) as f32,
        ambient: AMBIENT as f32,
        specular: SPECULAR as f32,
        clips,
        pad: 0,
        cut_fade_mm: volume.cut_fade_mm() as f32,
        table_last: tables.colors.len() as u32 - 1,
        factor_last: tables.factors.len() as u32 - 1,
        unused: 0,
    }
}

/// What of a [`Field`] is kept when its values are on the card.
pub(crate) struct FieldShape {
    pub grid: glioscope_core::Grid,
    pub brick_dims: [usize; 3],
    pub halvings: u32,
}

impl FieldShape {
    pub fn of(field: &Field) -> Self {
        Self { grid: field.grid.clone(), brick_dims: field.brick_dims(), halvings: field.halvings }
    }

    /// What the picture lacks of the image, if anything.
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

/// A number in 0..1 from a pixel, as `hash` of context_march.wgsl.
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
