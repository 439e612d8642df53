//! `Change` of lib/change.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::{
    ARROWS, ARROWS_MERGE, ChangeLook, ChangeScene, ChangeStyle, EARLIER, HEIGHTS, surface::ChangeSurface,
};
use crate::{
    scene::Plan,
    solid::{
        OUTSIDE,
        view::{View, in_camera_space, rgba},
    },
};

pub(crate) const STYLE_HEIGHT: u32 = 1;
pub(crate) const STYLE_ARROWS: u32 = 2;
pub(crate) const HAS_HEIGHTS: u32 = 4;
pub(crate) const HAS_ARROWS: u32 = 8;
pub(crate) const HAS_HULL: u32 = 16;
pub(crate) const LIT_ARROWS: u32 = 32;
pub(crate) const HAS_EARLIER: u32 = 64;

/// See lib/change.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Change {
    pub right: [f32; 3],
    pub full_mm: f32,
    pub up: [f32; 3],
    pub smooth_mm: f32,
    pub away: [f32; 3],
    pub gap_mm: f32,
    pub origin: [f32; 3],
    pub radius_mm: f32,
    pub base: [f32; 3],
    pub head_radius_mm: f32,
    pub grow: [f32; 3],
    pub head_length_mm: f32,
    pub shrink: [f32; 3],
    pub log2_slots: u32,
    pub clip_offset: f32,
    pub clip_scale: f32,
    pub samples: u32,
    pub flags: u32,
    pub kinds: [[u32; 4]; 2],
    pub outline: [f32; 4],
    pub displaced: [f32; 4],
}

/// Step in depth between neighbouring pixels that the filter doesn't cross: that at which silhouettes are
/// drawn, but at least a step of the coarsest voxels.
pub(crate) fn gap_mm(surface: &ChangeSurface) -> f64 {
    let spacing = surface.volume().grid().spacing_mm();
    (3.0 * spacing.min_element()).max(1.5 * spacing.max_element())
}

/// Clip depths for view depths from `near` to `far`: offset and scale for homogeneous coordinates
/// whose weight is the footprint of a pixel.
fn clip_depths(view: &View, near: f64, far: f64) -> [f32; 2] {
    let footprint = |depth: f64| f64::from(view.mm_per_pixel) + depth * f64::from(view.mm_per_pixel_per_mm);
    // Everything is behind the viewer or has no size: clip all of it.
    if far <= near || footprint(far) <= 0.0 {
        return [-1.0, 0.0];
    }
    let scale = footprint(far) / (far - near);
    [(-scale * near) as f32, scale as f32]
}

/// The uniform of a scene; `log2_slots` of its table of lengths.
pub(crate) fn change(
    scene: &ChangeScene,
    surface: &ChangeSurface,
    plan: &Plan,
    view: &View,
    reference_mm: f64,
    log2_slots: u32,
    samples: u32,
) -> Change {
    let grid = surface.volume().grid();
    let [right, up, back] = scene.camera.axes();
    let single = |v: DVec3| v.as_vec3().to_array();
    let rgb = |c| {
        let [r, g, b, _] = rgba(c);
        [r, g, b]
    };
    // Edge of a cube of a voxel's volume.
    let size_mm = grid.voxel_volume_mm3().cbrt();
    let head_length_mm = 1.5 * size_mm;
    let depths = grid.corners_mm().map(|c| in_camera_space(&scene.camera, reference_mm, c).z);
    let low = depths.into_iter().fold(f64::INFINITY, f64::min) - head_length_mm;
    let high = depths.into_iter().fold(f64::NEG_INFINITY, f64::max) + head_length_mm;
    let near = low.max(f64::from(view.nearest_mm) + 1e-4 * (high - low));
    let [clip_offset, clip_scale] = clip_depths(view, near, high);
    let mut kinds = [[0; 4]; 2];
    for (kind, &bits) in kinds.as_flattened_mut().iter_mut().zip(surface.volume().bits_of_id()) {
        *kind = bits;
    }
    let mut flags = match scene.look.style {
        ChangeStyle::Height => STYLE_HEIGHT,
        ChangeStyle::Arrows => STYLE_ARROWS,
    };
    for (pass, style, flag) in [
        (HEIGHTS, ChangeStyle::Height, HAS_HEIGHTS),
        (ARROWS, ChangeStyle::Arrows, HAS_ARROWS),
        (OUTSIDE, ChangeStyle::Arrows, HAS_HULL),
        (ARROWS_MERGE, ChangeStyle::Arrows, LIT_ARROWS),
    ] {
        if plan.has(pass) && scene.look.style == style {
            flags |= flag;
        }
    }
    flags |= if plan.has(EARLIER) { HAS_EARLIER } else { 0 };
    Change {
        right: single(right),
        full_mm: scene.look.full_mm as f32,
        up: single(up),
        smooth_mm: scene.look.smooth_mm as f32,
        away: single(-back),
        gap_mm: gap_mm(surface) as f32,
        origin: single(in_camera_space(&scene.camera, reference_mm, surface.middle_mm())),
        radius_mm: (0.15 * size_mm) as f32,
        base: rgb(scene.base),
        head_radius_mm: (0.42 * size_mm) as f32,
        grow: rgb(scene.look.grow),
        head_length_mm: head_length_mm as f32,
        shrink: rgb(scene.look.shrink),
        log2_slots,
        clip_offset,
        clip_scale,
        samples,
        flags,
        kinds,
        outline: rgba(ChangeLook::OUTLINE),
        displaced: rgba(ChangeLook::DISPLACED),
    }
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(
        Change, "Change": right, full_mm, up, smooth_mm, away, gap_mm, origin, radius_mm, base, head_radius_mm, grow,
        head_length_mm, shrink, log2_slots, clip_offset, clip_scale, samples, flags, kinds, outline, displaced
    ),
    crate::layouts::layout!(super::surface::Length, "Length": key, signed_mm, sure),
    crate::layouts::layout!(super::arrows::GpuArrow, "Arrow": start, what, along, unused),
];
