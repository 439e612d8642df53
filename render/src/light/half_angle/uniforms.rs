//! Uniforms with the memory layout of the shaders. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

/// `Slab` of lib/half_angle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Slab {
    pub normal: [f32; 3],
    pub front: f32,
    pub light: [f32; 3],
    pub slab_mm: f32,
    pub across: [f32; 3],
    pub per_mm: f32,
    pub down: [f32; 3],
    pub strength: f32,
    pub origin: [f32; 2],
    pub texels: [u32; 2],
    pub first: [u32; 2],
    pub layer: u32,
    pub pad: u32,
}

/// `Texel` of lib/half_angle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Texel {
    pub light: f32,
    pub near: f32,
    pub far: f32,
    pub hit: f32,
}

/// `Finish` of half_angle/finish.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Finish {
    pub weight: f32,
    pub step_mm: f32,
    pub unused_a: u32,
    pub unused_b: u32,
}

/// `Lamp` of half_angle/lamp.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Lamp {
    pub light: [f32; 3],
    pub step_mm: f32,
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(
        Slab, "Slab": normal, front, light, slab_mm, across, per_mm, down, strength, origin, texels, first, layer, pad
    ),
    crate::layouts::layout!(Texel, "Texel": light, near, far, hit),
    crate::layouts::layout!(Finish, "Finish": weight, step_mm, unused_a, unused_b),
    crate::layouts::layout!(Lamp, "Lamp": light, step_mm),
];
