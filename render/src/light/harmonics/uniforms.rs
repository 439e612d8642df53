//! Uniforms with the memory layout of the shaders. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

/// `Part` of harmonics/project.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Part {
    pub first: u32,
    pub direction: u32,
    pub directions: u32,
    pub functions: u32,
}

/// `Sky` of harmonics/light.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Sky {
    pub functions: u32,
    pub sets: u32,
    pub unused_a: u32,
    pub unused_b: u32,
    pub factors: [[f32; 4]; 9],
}

/// `Rays` of harmonics/opaque.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Rays {
    pub count: u32,
    pub begins: u32,
    pub ends: u32,
    pub unused: u32,
    pub towards: [[f32; 4]; 15],
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(Part, "Part": first, direction, directions, functions),
    crate::layouts::layout!(Sky, "Sky": functions, sets, unused_a, unused_b, factors),
    crate::layouts::layout!(Rays, "Rays": count, begins, ends, unused, towards),
];
