//! Uniforms with the memory layout of the shaders. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

pub(crate) const VICINITY: u32 = 1;
pub(crate) const PARTIAL: u32 = 2;

/// `Vicinity` of lib/vicinity.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Vicinity {
    pub radius_mm: f32,
    pub slope: f32,
    pub count: u32,
    pub flags: u32,
    pub deepest_mm: f32,
    pub unused_a: u32,
    pub unused_b: u32,
    pub unused_c: u32,
    pub points: [[f32; 4]; 118],
}
