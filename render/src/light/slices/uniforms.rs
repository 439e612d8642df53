//! Uniforms with the memory layout of the shaders. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

pub(crate) const IMAGE_ON_IMAGE: u32 = 1;

/// `Slices` of lib/slices.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Slices {
    pub slice_mm: f32,
    pub flags: u32,
    pub strength: f32,
    pub lag_px: f32,
    pub decay: [[f32; 4]; 257],
}

/// `Area` of lib/slices.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Area {
    pub origin: [u32; 2],
    pub first: u32,
    pub per_row: f32,
}

/// `Part` of lib/slices.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Part {
    pub depth: f32,
    pub slices: u32,
    pub side: u32,
    pub stride: i32,
    pub center: f32,
    pub radius: f32,
    pub radius_mm: f32,
    pub share: f32,
    pub turn: u32,
    pub is_last: u32,
    pub columns: u32,
    pub pad: u32,
    pub shift: [f32; 2],
    pub scale: f32,
    pub pixel_mm: f32,
    pub along: [f32; 2],
    pub across: [f32; 2],
    pub areas: [Area; 5],
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(Slices, "Slices": slice_mm, flags, strength, lag_px, decay),
    crate::layouts::layout!(Area, "Area": origin, first, per_row),
    crate::layouts::layout!(
        Part, "Part": depth, slices, side, stride, center, radius, radius_mm, share, turn, is_last, columns, pad, shift,
        scale, pixel_mm, along, across, areas
    ),
    crate::layouts::layout!(
        super::super::vicinity::uniforms::Vicinity,
        "Vicinity": radius_mm, slope, count, flags, deepest_mm, unused_a, unused_b, unused_c, points
    ),
    super::super::layers::LAYOUTS[0],
    super::super::layers::LAYOUTS[1],
];
