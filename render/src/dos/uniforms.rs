//! What the slices' shaders read, laid out as they read it. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

use super::{
    folded::{DIRECT, VECTORS, fold},
    plan::{DosPlan, Kernel, Step, Variant, disc_points},
};
use crate::occlusion::cone::Decay;

/// `Dos` of lib/dos.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Dos {
    pub slice_mm: f32,
    pub pad: u32,
    pub tiles: [u32; 2],
    pub decay: [[f32; 4]; 257],
}

/// `Step` of lib/dos.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct DosStep {
    pub depth: f32,
    pub slices: u32,
    pub side: u32,
    pub stride: i32,
    pub center: f32,
    pub radius: f32,
    pub radius_mm: f32,
    pub share: f32,
    pub is_empty: u32,
    pub states: u32,
    pub stops: u32,
    pub pad: u32,
    pub folded: [[f32; 4]; VECTORS],
}

/// Which pipeline a step needs: constants of lib/dos.wgsl.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Footing {
    pub reach: u32,
    pub rings: u32,
}

/// Pixels along a tile's side.
pub(crate) const TILE: u32 = 16;

pub(crate) fn dos(plan: &DosPlan, size: [u32; 2]) -> Dos {
    let decay = plan.decay.as_deref().map_or([[0.0; 4]; 257], Decay::packed);
    Dos { slice_mm: plan.slice_mm as f32, pad: 0, tiles: size.map(|s| s.div_ceil(TILE)), decay }
}

/// `number` counts the steps; `skipping` lets empty slices and saturated tiles be left out.
pub(crate) fn step(
    plan: &DosPlan,
    step: &Step,
    number: usize,
    front_mm: f64,
    skipping: bool,
) -> (DosStep, Footing) {
    let mut out = DosStep {
        depth: (step.depth_mm - front_mm) as f32,
        slices: step.slices,
        side: 1,
        stride: 1,
        share: 1.0,
        is_empty: u32::from(step.empty && skipping),
        states: (number % 3) as u32,
        stops: u32::from(skipping && step.kernel.reach_px() <= TILE),
        ..DosStep::zeroed()
    };
    let mut footing = Footing { reach: DIRECT, rings: 1 };
    match step.kernel {
        Kernel::Disc { grid, radius_px, radius_mm } => {
            out.side = grid;
            out.radius = radius_px as f32;
            out.radius_mm = radius_mm as f32;
            out.share = 1.0 / disc_points(grid).len() as f32;
            let exact = plan.variant == Variant::PaperExact;
            if let Some(folded) = fold(grid, radius_px, radius_mm, plan.slice_mm, exact) {
                out.folded = folded.vectors;
                footing = Footing { reach: folded.reach, rings: folded.rings };
            }
        }
        Kernel::Lattice { side, stride_px, center } => {
            out.side = side;
            out.stride = stride_px as i32;
            out.center = center as f32;
            out.share = 1.0 / (side * side) as f32;
        }
    }
    (out, footing)
}
