//! Arrows on the device: instances once per surface and threshold, never once per frame.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::surface::ChangeSurface;
use crate::device::{Gpu, RenderError};

/// Bits of `what`, as in change/compose; the low bits are the arrow's number, from 1.
const GROWS: u32 = 0x100_0000;
const FAINT: u32 = 0x200_0000;
/// Bit of those that moved with the tissue around them.
const TISSUE_MOVED: u32 = 0x80_0000;
const MOST: usize = 0x7f_ffff;

/// `Arrow` of change/arrows.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct GpuArrow {
    pub start: [f32; 3],
    pub what: u32,
    pub along: [f32; 3],
    pub unused: u32,
}

/// Instances of the arrows that are drawn.
pub(super) struct ArrowBuffers {
    surface: Arc<ChangeSurface>,
    threshold_mm: f64,
    pub instances: wgpu::Buffer,
    /// Which of the change's vectors each instance is.
    pub vectors: Arc<Vec<u32>>,
}

impl ArrowBuffers {
    /// The instances of `surface` at `threshold_mm`: the cached ones if they match, else new ones.
    ///
    /// # Errors
    /// [`RenderError::Buffer`] past the device's limits; [`RenderError::Scene`] past 8,388,607 arrows;
    /// nothing is cached then.
    pub fn reuse<'a>(
        cached: &'a mut Option<Self>,
        gpu: &Gpu,
        surface: &Arc<ChangeSurface>,
        threshold_mm: f64,
    ) -> Result<&'a Self, RenderError> {
        let matches = |b: &Self| Arc::ptr_eq(&b.surface, surface) && b.threshold_mm == threshold_mm;
        let made = match cached.take().filter(matches) {
            Some(buffers) => buffers,
            None => Self::new(gpu, surface, threshold_mm)?,
        };
        Ok(cached.insert(made))
    }

    fn new(gpu: &Gpu, surface: &Arc<ChangeSurface>, threshold_mm: f64) -> Result<Self, RenderError> {
        let vectors: Vec<u32> = surface.arrows(threshold_mm).map(|i| i as u32).collect();
        if vectors.len() > MOST {
            return Err(RenderError::Scene(format!("{} arrows (at most {MOST})", vectors.len())));
        }
        gpu.check_size("the arrows", (vectors.len() * size_of::<GpuArrow>()) as u64)?;
        let middle_mm = surface.middle_mm();
        let list = &surface.change().vectors;
        let mut packed: Vec<GpuArrow> = vectors
            .iter()
            .zip(1u32..)
            .filter_map(|(&i, number)| {
                let v = list.get(i as usize)?;
                let grows = if v.signed_mm > 0.0 { GROWS } else { 0 };
                let faint = if v.flags.within_uncertainty { FAINT } else { 0 };
                let moved = if surface.is_displaced(i as usize) { TISSUE_MOVED } else { 0 };
                Some(GpuArrow {
                    // Differences in f64, so that an offset of 1e6 mm costs no precision.
                    start: (v.from_mm - middle_mm).as_vec3().to_array(),
                    what: number | grows | faint | moved,
                    along: (v.to_mm - v.from_mm).as_vec3().to_array(),
                    unused: 0,
                })
            })
            .collect();
        if packed.is_empty() {
            packed.push(GpuArrow::default());
        }
        Ok(Self {
            surface: Arc::clone(surface),
            threshold_mm,
            instances: gpu.storage("ArrowBuffers::instances", bytemuck::cast_slice(&packed)),
            vectors: Arc::new(vectors),
        })
    }
}

/// Sides of shaft and head, `SIDES` of change/arrows.
const SIDES: u16 = 6;

/// Triangles over the vertices that change/arrows generates, clockwise as seen from outside.
pub(super) fn triangles() -> Vec<u16> {
    let mut out = Vec::new();
    let next = |i: u16| (i + 1) % SIDES;
    for i in 0..SIDES {
        let j = next(i);
        let [start, end, rim, point] = [0, SIDES, 2 * SIDES, 3 * SIDES];
        out.extend([start + i, start + j, end + i, end + i, start + j, end + j]);
        out.extend([end + i, end + j, rim + i, rim + i, end + j, rim + j]);
        out.extend([rim + i, rim + j, point]);
        if (1..SIDES - 1).contains(&i) {
            out.extend([start, start + j, start + i]);
        }
    }
    out
}
