//! Uniforms with the memory layout of the shaders. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use glioscope_core::{Grid, optics::Camera};

use super::grid::Cells;
use crate::solid::view::{in_camera_space, index_axes};

/// `Level` of lib/cones.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Level {
    pub dims: [u32; 3],
    pub start: u32,
    pub scale: [f32; 3],
    pub pad: u32,
}

/// Levels in the shaders' uniform: 2^15 voxels per side exceed any buffer.
pub(crate) const LEVELS: usize = 16;

/// `Cones` of lib/cones.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Cones {
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
    /// Where colours begin among the prefiltered cells.
    pub colors: u32,
    pub unused_b: u32,
    pub levels: [Level; LEVELS],
    pub axes: [[f32; 4]; 128],
}

/// `LightGrid` of lib/light_grid.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct LightGrid {
    pub cells: [u32; 3],
    pub needed: u32,
    pub scale: [f32; 3],
    pub strength: f32,
    pub corner: [f32; 3],
    pub ring: f32,
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

impl LightGrid {
    /// Cells of an image's grid, seen by a camera; no strength, and no cell is needed.
    pub fn of(grid: &Grid, cells: &Cells, camera: &Camera, reference_mm: f64) -> Self {
        let [corner, right, up, forward] = index_axes(camera, reference_mm, grid);
        // In camera space: the origin of index space, and one voxel along each axis.
        let world = grid.world_from_voxel();
        let at = |index: DVec3| in_camera_space(camera, reference_mm, world.transform_point3(index - 0.5));
        let zero = at(DVec3::ZERO);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| at(axis) - zero);
        let row = |n: usize| [axes[0][n] as f32, axes[1][n] as f32, axes[2][n] as f32, zero[n] as f32];
        Self {
            cells: cells.dims.map(|d| d as u32),
            scale: cells.voxels.recip().as_vec3().to_array(),
            corner,
            ring: cells.ring as f32,
            right,
            up,
            forward,
            right_from_index: row(0),
            up_from_index: row(1),
            depth_from_index: row(2),
            ..Self::default()
        }
    }
}

/// `LightPart` of cones/image.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct LightPart {
    pub first: u32,
    pub unused_a: u32,
    pub unused_b: u32,
    pub unused_c: u32,
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(Level, "Level": dims, start, scale, pad),
    crate::layouts::layout!(
        Cones, "Cones": right, tangent, up, cone_step, forward, coarsest, corner, voxel_mm, dims, count, dark, rounds,
        colors, unused_b, levels, axes
    ),
    crate::layouts::layout!(
        LightGrid, "LightGrid": cells, needed, scale, strength, corner, ring, right, pad2, up, pad3, forward, pad4,
        right_from_index, up_from_index, depth_from_index
    ),
    crate::layouts::layout!(LightPart, "LightPart": first, unused_a, unused_b, unused_c),
];
