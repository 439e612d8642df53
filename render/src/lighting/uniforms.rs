//! What the shaders of light read, laid out as they read it. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

/// `Level` of lib/light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Level {
    pub dims: [u32; 3],
    pub start: u32,
    pub scale: [f32; 3],
    pub pad: u32,
}

/// Levels that the shaders know: 2^15 voxels a side are past any buffer.
pub(crate) const LEVELS: usize = 16;

/// `Light` of lib/light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Light {
    pub right: [f32; 3],
    pub tangent: f32,
    pub up: [f32; 3],
    pub cone_step: f32,
    pub forward: [f32; 3],
    pub coarsest: f32,
    pub corner: [f32; 3],
    pub voxel_mm: f32,
    pub dims: [u32; 3],
    pub count: u32,
    pub dark: f32,
    pub rounds: u32,
    pub unused_a: u32,
    pub unused_b: u32,
    pub levels: [Level; LEVELS],
    pub axes: [[f32; 4]; 128],
}

/// `LightGrid` of lib/light_grid.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct LightGrid {
    pub cells: [u32; 3],
    pub needed: u32,
    pub scale: [f32; 3],
    pub strength: f32,
    pub corner: [f32; 3],
    pub pad1: u32,
    pub right: [f32; 3],
    pub pad2: u32,
    pub up: [f32; 3],
    pub pad3: u32,
    pub forward: [f32; 3],
    pub pad4: u32,
    pub right_from_index: [f32; 4],
    pub up_from_index: [f32; 4],
    pub depth_from_index: [f32; 4],
}

/// `LightPart` of context_light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct LightPart {
    pub first: u32,
    pub unused_a: u32,
    pub unused_b: u32,
    pub unused_c: u32,
}

pub(crate) const VOLUME_ON_VOLUME: u32 = 1;

/// `Slices` of lib/slices.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Slices {
    pub slice_mm: f32,
    pub flags: u32,
    pub strength: f32,
    pub pad: u32,
    pub decay: [[f32; 4]; 257],
}

/// `Part` of lib/slices.wgsl.
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
    pub origin: [u32; 2],
}

pub(crate) const VICINITY: u32 = 1;
pub(crate) const PARTIAL: u32 = 2;

/// `Vicinity` of solid_vicinity.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Vicinity {
    pub radius_mm: f32,
    pub slope: f32,
    pub count: u32,
    pub flags: u32,
    pub points: [[f32; 4]; 118],
}
