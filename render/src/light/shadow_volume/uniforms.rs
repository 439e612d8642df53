//! Uniform with the memory layout of the shader. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

/// `Slice` of shadow_volume/sweep.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Slice {
    pub light: [f32; 3],
    pub segment_mm: f32,
    pub shift: [f32; 2],
    pub size: [u32; 2],
    pub strides: [u32; 2],
    pub start: u32,
    pub before: u32,
    pub samples: u32,
    pub own: u32,
    pub unused_b: u32,
    pub unused_c: u32,
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[crate::layouts::layout!(
    Slice, "Slice": light, segment_mm, shift, size, strides, start, before, samples, own, unused_b, unused_c
)];
