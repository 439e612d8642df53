//! The uniform with the memory layout of the shaders. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

/// The most boxes of a pixel.
pub(crate) const MOST_BOXES: usize = 8;

/// `Summed` of lib/summed.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Summed {
    pub nearest: f32,
    pub per_mm: f32,
    pub most: f32,
    pub boxes: u32,
    pub widest_px: f32,
    pub unused_a: u32,
    pub unused_b: u32,
    pub unused_c: u32,
    pub halves: [[f32; 4]; MOST_BOXES],
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[crate::layouts::layout!(
    Summed, "Summed": nearest, per_mm, most, boxes, widest_px, unused_a, unused_b, unused_c, halves
)];
