//! The fast end of ambient occlusion, by one summed-area table of the depths: depth darkening (Luft et al. 2006) and vicinity
//! maps (Díaz et al. 2010; thesis 3.4). The time doesn't depend on the radius.
//!
//! The table is of whole numbers modulo 2^32: sums of boxes are exact, where single precision is off by a hundredth of a
//! radius in large frames, and needn't have the mean subtracted.
//!
//! Lifetimes: the table, 8 bytes per pixel, once per size.

#[cfg(test)]
mod twin_tests;
pub(crate) mod uniforms;

use glioscope_core::optics::Sight;

use self::uniforms::{MOST_BOXES, Summed};
use super::{
    lit::{Light, LightRow, LitScene, no_occlusion},
    screen,
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        runner::{PassRunner, Shader, workgroups_of},
    },
    scene::{LightingMode, Plan, Quality},
    solid::view::HAS_OCCLUSION,
};

/// Running sums of the depths along rows.
pub(crate) const ROWS: PassName = PassName::new("depth_sums_in_rows");
/// Running sums of these down the columns.
pub(crate) const COLUMNS: PassName = PassName::new("depth_sums");
/// Darkness behind the mean depth around each pixel.
pub(crate) const DARKEN: PassName = PassName::new("depth_darkening");

/// Depth darkening.
pub(super) const DEPTH_DARKENING: LightRow = LightRow {
    mode: LightingMode::DepthDarkening,
    title: "Headlight and depth darkening",
    summary: "Fast: what lies behind its surroundings is darker, as beside every contour",
    passes: |_| &[ROWS, COLUMNS, DARKEN],
    omission_reason: |pass, quality, no_opaque, _| match pass {
        ROWS | COLUMNS | DARKEN => no_opaque.or_else(|| no_occlusion(quality)),
        _ => None,
    },
    flags: &[(DARKEN, HAS_OCCLUSION)],
    at_cost,
    #[cfg(test)]
    suite: super::lit::Suite {
        layouts: uniforms::LAYOUTS,
        max_twin_error: || twin_tests::max_twin_error(LightingMode::DepthDarkening),
        ..screen::ROW.suite
    },
    start: |_| Box::new(SummedLight { table: None, uniform: None }),
    ..screen::ROW
};

/// Vicinity maps.
pub(super) const VICINITY_MAP: LightRow = LightRow {
    mode: LightingMode::VicinityMap,
    title: "Headlight and vicinity map",
    summary: "Fast: hollows of several sizes darker, from mean depths of squares",
    #[cfg(test)]
    suite: super::lit::Suite {
        max_twin_error: || twin_tests::max_twin_error(LightingMode::VicinityMap),
        ..DEPTH_DARKENING.suite
    },
    ..DEPTH_DARKENING
};

fn at_cost(cost: f64) -> Quality {
    Quality { occlusion_strength: 1.0, occlusion_radius_mm: 10.0, ..screen::at_cost(cost) }
}

/// Largest half side of a box in pixels: larger ones are cut, so that their sums stay below 2^32.
const WIDEST_PX: u32 = 255;
/// Whole numbers that depths are rounded to: times the pixels of the largest box, below 2^32.
const DEPTHS: u32 = (u32::MAX / ((2 * WIDEST_PX + 3) * (2 * WIDEST_PX + 3))) - 1;

/// Boxes for a number of sample pairs.
fn boxes(mode: LightingMode, pairs: u32) -> u32 {
    let boxes = if mode == LightingMode::VicinityMap { pairs.div_ceil(4) } else { pairs.div_ceil(3) };
    boxes.clamp(1, MOST_BOXES as u32)
}

/// Half the sides of this many boxes, in radii. Vicinity maps: each box half as wide as the one before. Depth darkening: boxes
/// whose mean is near a Gaussian that ends at the radius, 2.5 standard deviations.
fn halves(mode: LightingMode, boxes: u32) -> Vec<f64> {
    let n = f64::from(boxes);
    if mode == LightingMode::VicinityMap {
        return (0..boxes).map(|i| 0.5f64.powi(i as i32)).collect();
    }
    // A Gaussian is a pile of discs, whose squared radii u (in units of twice the variance) have the density u e^-u of their
    // shares; the largest has what is cut off at the rim, too. Boxes of the discs' areas have equal shares of the whole.
    let end = 0.5 * 2.5f64 * 2.5;
    let below = |u: f64| 1.0 - (1.0 + u) * (-u).exp();
    let whole = -(-end).exp_m1();
    (0..boxes)
        .map(|i| {
            let share = (f64::from(i) + 0.5) / n * whole;
            let (mut low, mut high) = (0.0, end);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if below(middle) < share {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            (2.0 * low).sqrt() / 2.5 * std::f64::consts::PI.sqrt() / 2.0
        })
        .collect()
}

/// The passes on the device.
struct SummedLight {
    table: Option<([u32; 2], wgpu::Buffer)>,
    uniform: Option<wgpu::Buffer>,
}

impl Light for SummedLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        if !plan.has(DARKEN) {
            self.table = None;
            return Ok(Vec::new());
        }
        if self.table.as_ref().is_none_or(|(size, _)| *size != scene.size) {
            self.table = None;
            let bytes = 8 * u64::from(scene.size[0]) * u64::from(scene.size[1]);
            self.table = Some((scene.size, gpu.buffer("SummedLight::table", bytes, WRITTEN)));
            gpu.check()?;
        }
        let uniform =
            self.uniform.get_or_insert_with(|| gpu.uniform::<Summed>("SummedLight::uniform")).clone();
        let data = summed(scene);
        gpu.queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&data));
        let Some((_, table)) = &self.table else { return Ok(Vec::new()) };
        let view = (0, scene.view.as_entire_binding());
        let depths = (4, scene.depths.as_entire_binding());
        let table = (33, table.as_entire_binding());
        let uniform = (36, uniform.as_entire_binding());
        let entries = [view.clone(), depths.clone(), table.clone(), uniform.clone()];
        passes.bind(gpu, ROWS, "summed/rows", &entries, [scene.size[1], 1, 1])?;
        let entries = [view.clone(), table.clone()];
        passes.bind(gpu, COLUMNS, "summed/columns", &entries, [scene.size[0].div_ceil(64), 1, 1])?;
        let is_map = scene.quality.lighting.mode == LightingMode::VicinityMap;
        let constants = [("one_by_one", f64::from(u8::from(is_map)))];
        let shader = Shader { file: "summed/darken", constants: &constants };
        let entries = [view, depths, (8, scene.blurred.as_entire_binding()), table, uniform];
        passes.bind(gpu, DARKEN, shader, &entries, workgroups_of(scene.size))?;
        let sight = Sight::new(scene.camera, scene.size);
        let radius_px = scene.quality.occlusion_radius_mm / sight.pixel_mm(scene.reference_mm.max(0.0));
        Ok(if radius_px > f64::from(WIDEST_PX) {
            vec![format!("occlusion reaches {WIDEST_PX} pixels at most")]
        } else {
            Vec::new()
        })
    }
}

/// The uniform of a frame. Depths between those of the opaque geometry's boxes have numbers of their own.
fn summed(scene: &LitScene<'_>) -> Summed {
    let sight = Sight::new(scene.camera, scene.size);
    // Boxes may be a little too small.
    let radius_mm = scene.quality.occlusion_radius_mm;
    let margin_mm = if radius_mm.is_finite() { radius_mm.clamp(0.0, 100.0) } else { 0.0 };
    let depths = scene.solid_corners_mm.iter().map(|at| sight.depth_mm(*at) - scene.reference_mm);
    let (near, far) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
    let nearest = (near - margin_mm).max(-scene.reference_mm);
    let span = far + margin_mm - nearest;
    let (nearest, span) = if span.is_finite() && span > 0.0 { (nearest, span) } else { (-500.0, 1000.0) };
    let mode = scene.quality.lighting.mode;
    let boxes = boxes(mode, scene.quality.occlusion_samples.clamp(1, Quality::MOST_SAMPLES));
    let mut all = [[0.0; 4]; MOST_BOXES];
    for (to, half) in all.iter_mut().zip(halves(mode, boxes)) {
        to[0] = half as f32;
    }
    Summed {
        nearest: nearest as f32,
        per_mm: (f64::from(DEPTHS) / span) as f32,
        most: DEPTHS as f32,
        boxes,
        widest_px: WIDEST_PX as f32,
        halves: all,
        ..Summed::default()
    }
}
