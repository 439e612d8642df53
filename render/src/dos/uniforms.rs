//! What the slices' shaders read, laid out as they read it. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};

use super::{
    folded::{DIRECT, ROWS, VECTORS, fold, rows},
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
    pub together: u32,
    pub halo: i32,
    pub margin: i32,
    pub pad0: u32,
    pub pad1: u32,
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
/// Cells along the side of a tile's workgroup memory in dos_tiles.wgsl.
pub(crate) const MEMORY: u32 = 32;
/// How far the steps that go together may read, in pixels: half of the memory's side is left for the tile.
pub(crate) const WIDEST_HALO: u32 = MEMORY / 4;
/// The most steps that go together.
pub(crate) const MOST_TOGETHER: usize = 8;

/// Steps of one dispatch.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// Front to back; more than one goes through workgroup memory.
    pub steps: Vec<DosStep>,
    /// The same for all.
    pub footing: Footing,
}

impl Group {
    /// Groups of neighbouring steps, at most `together` of one footing and no wider than [`WIDEST_HALO`].
    /// The steps come with their reach in pixels; one that reaches too far stands
    /// alone.
    pub fn all(steps: Vec<(DosStep, Footing, u32)>, together: usize) -> Vec<Self> {
        let mut out: Vec<Self> = Vec::new();
        let mut halo = 0;
        for (mut step, footing, reach) in steps {
            let joins = out.last().is_some_and(|g| {
                g.steps.len() < together.min(MOST_TOGETHER)
                    && g.footing == footing
                    && reach.saturating_add(halo) <= WIDEST_HALO
            });
            step.halo = reach.min(WIDEST_HALO) as i32;
            match out.last_mut().filter(|_| joins) {
                Some(group) => {
                    halo += reach;
                    for earlier in &mut group.steps {
                        earlier.margin += reach as i32;
                    }
                    group.steps.push(step);
                    let count = group.steps.len() as u32;
                    if let Some(first) = group.steps.first_mut() {
                        (first.together, first.halo) = (count, halo as i32);
                    }
                }
                None => {
                    halo = reach;
                    out.push(Self { steps: vec![step], footing });
                }
            }
        }
        out
    }

    /// How far the whole group reads, pixels.
    pub fn halo(&self) -> u32 {
        self.steps.first().map_or(0, |s| s.halo.unsigned_abs())
    }
}

pub(crate) fn dos(plan: &DosPlan, size: [u32; 2]) -> Dos {
    let decay = plan.decay.as_deref().map_or([[0.0; 4]; 257], Decay::packed);
    Dos { slice_mm: plan.slice_mm as f32, pad: 0, tiles: size.map(|s| s.div_ceil(TILE)), decay }
}

/// `skipping` lets empty slices and saturated tiles be left out, `folding` reads each texel of a disc once
/// where that is less.
pub(crate) fn step(
    plan: &DosPlan,
    step: &Step,
    front_mm: f64,
    skipping: bool,
    folding: bool,
) -> (DosStep, Footing) {
    let mut out = DosStep {
        depth: (step.depth_mm - front_mm) as f32,
        slices: step.slices,
        side: 1,
        stride: 1,
        share: 1.0,
        is_empty: u32::from(step.empty && skipping),
        together: 1,
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
            let folded = folding.then(|| fold(grid, radius_px, radius_mm, plan.slice_mm, exact)).flatten();
            let rows = if folding && folded.is_none() { rows(grid, radius_px) } else { Vec::new() };
            if let Some(folded) = folded {
                out.folded = folded.vectors;
                footing = Footing { reach: folded.reach, rings: folded.rings };
            } else if !rows.is_empty() {
                footing = Footing { reach: ROWS, rings: rows.len() as u32 };
                // The four points of 2x2 are at one distance also in the exact variant.
                let off_mm2 = if exact && grid == 2 { 0.5 * radius_mm * radius_mm } else { 0.0 };
                let distance_mm = (plan.slice_mm * plan.slice_mm + off_mm2).sqrt();
                let rows = rows.into_iter().chain([[distance_mm as f32, 0.0, 0.0, 0.0]]);
                for (vector, row) in out.folded.iter_mut().zip(rows) {
                    *vector = row;
                }
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
