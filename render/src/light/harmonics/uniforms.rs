//! Uniforms with the memory layout of the shaders. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

/// `ProjectPart` of harmonics/project and harmonics/open.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct ProjectPart {
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
    pub bleeding: f32,
    pub unused_b: u32,
    pub factors: [[f32; 4]; 9],
}

/// Directions in the open pass, and values of functions in the projection.
pub(crate) const MOST_DIRECTIONS: usize = 128;
const MOST_FUNCTIONS: usize = 36;

/// `Directions` of harmonics/open.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Directions {
    pub axes: [[f32; 4]; MOST_DIRECTIONS],
}

/// `Basis` of harmonics/project.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Basis {
    pub values: [[f32; 4]; MOST_DIRECTIONS * MOST_FUNCTIONS / 4],
}

/// `SkyRays` of harmonics/opaque.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct SkyRays {
    pub count: u32,
    pub begins: u32,
    pub ends: u32,
    pub unused: u32,
    pub towards: [[f32; 4]; 15],
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(ProjectPart, "ProjectPart": first, direction, directions, functions),
    crate::layouts::layout!(Directions, "Directions": axes),
    crate::layouts::layout!(Basis, "Basis": values),
    crate::layouts::layout!(Sky, "Sky": functions, sets, bleeding, unused_b, factors),
    crate::layouts::layout!(SkyRays, "SkyRays": count, begins, ends, unused, towards),
];
