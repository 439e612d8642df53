//! The slices of a frame, their grouping into steps, and the steps' footprints. Pure: no device is touched.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::optics::{
    Sight,
    cone::{Decay, clamped_aperture, tangent_variance},
};

use super::lamp::{LampCone, cases, mixture_note};
pub(crate) use crate::light::kernel::{Kernel, disc_points};
use crate::{light::kernel::MOST_REACH_PX, scene::SliceVariant};

/// Maximum number of slices; a smaller slice distance is enlarged to fit, with a note in the plan.
pub(crate) const MOST_SLICES: u32 = 8192;
/// Maximum number of slices per step.
const MOST_PER_STEP: u32 = 32;
/// Blur, variance along an axis in square pixels, at which a step ends: that of a disc of one pixel's
/// radius. Slices with less are combined into one step.
const BLUR_PER_STEP_PX2: f64 = 0.25;

/// Settings of directional occlusion by slices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SliceSettings {
    /// One of the paper's or the mended one.
    pub variant: SliceVariant,
    /// Half the cone's opening, degrees; clamped to 0 to 85.
    pub aperture_deg: f64,
    /// Samples along a side of the footprint; clamped to 1 to 13. In the mended variant the maximum:
    /// a step takes fewer where they cover its footprint.
    pub grid: u32,
    /// Slice distance along the view axis; at most the volume's depth, at least the distance that gives
    /// [`MOST_SLICES`].
    pub slice_mm: f64,
    /// Distance of an occluder whose penumbra has the true cone's width; mended variant only. Penumbrae
    /// of nearer occluders are too wide, of farther ones too narrow.
    pub reference_mm: f64,
    /// Direction towards the lamp that the cone is about (unit length; right, up, away from the eye); `None`: about that to the
    /// eye.
    pub lamp: Option<DVec3>,
}

impl SliceSettings {
    /// The runs over the slices that a frame is mixed of, each with its share: see [`cases`].
    pub fn cases(&self) -> Vec<(Self, f64)> {
        let Some(towards) = self.lamp else { return vec![(*self, 1.0)] };
        cases(towards).into_iter().map(|(lamp, share)| (Self { lamp: Some(lamp), ..*self }, share)).collect()
    }

    /// What is said of a mixture.
    pub fn mixture_note(&self) -> Option<String> {
        self.lamp.and_then(mixture_note)
    }
}

/// Consecutive slices: the light is sampled once, through the kernel, before them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// View depth of the front of the first slice.
    pub depth_mm: f64,
    /// Slices, at least one.
    pub slices: u32,
    /// The footprint.
    pub kernel: Kernel,
    /// Whether nothing is visible in these slices.
    pub empty: bool,
}

/// The slices of one frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SlicePlan {
    /// The variant used.
    pub variant: SliceVariant,
    /// The aperture used.
    pub aperture_deg: f64,
    /// The cone towards a lamp.
    pub lamp: Option<LampCone>,
    /// The slice distance used.
    pub slice_mm: f64,
    /// In the light's order: front to back, or back to front if the lamp is behind the scene.
    pub steps: Vec<Step>,
    /// Decay of light through a slice; mended variant only.
    pub decay: Option<Arc<Decay>>,
    /// Notes on changed settings and omitted slices.
    pub notes: Vec<String>,
}

fn usable_reference_mm(settings: &SliceSettings) -> f64 {
    let reference_mm = settings.reference_mm;
    if reference_mm.is_finite() && reference_mm > 0.0 { reference_mm } else { 0.0 }
}

impl SlicePlan {
    /// Slices through the view depths `depths_mm`, nearest and farthest, in front of the eye; none for
    /// `None`. Slices that touch none of the `occupied_mm` ranges (in order) are marked as empty; those
    /// before the first and behind the last are omitted.
    pub fn new(
        settings: &SliceSettings,
        sight: &Sight,
        depths_mm: Option<(f64, f64)>,
        occupied_mm: &[(f64, f64)],
    ) -> Self {
        let mut notes = Vec::new();
        let (aperture_deg, is_clamped) = clamped_aperture(settings.aperture_deg);
        if is_clamped {
            notes.push(format!("aperture {} degrees: {aperture_deg} is used", settings.aperture_deg));
        }
        let grid = settings.grid.clamp(1, 13);
        if grid != settings.grid {
            notes.push(format!("grid {0}x{0}: {grid}x{grid} is used", settings.grid));
        }
        let mended = settings.variant == SliceVariant::Mended;
        let lamp = settings.lamp.map(|towards| LampCone::new(towards, aperture_deg, !mended, &mut notes));
        let aperture_deg = lamp.map_or(aperture_deg, |cone| cone.aperture_deg);
        let decay = mended.then(|| Decay::tilted(aperture_deg, lamp.map_or(0.0, |cone| cone.tilt_deg)));
        let mut plan = Self {
            variant: settings.variant,
            aperture_deg,
            lamp,
            slice_mm: settings.slice_mm,
            steps: Vec::new(),
            decay,
            notes,
        };
        let (Some((near, far)), Some(first), Some(last)) =
            (depths_mm, occupied_mm.first(), occupied_mm.last())
        else {
            plan.notes.push("no slices: nothing that light can meet is before the eye".to_owned());
            return plan;
        };
        let span = far - near;
        let least = span / f64::from(MOST_SLICES);
        let requested = settings.slice_mm;
        plan.slice_mm = if !(requested.is_finite() && requested > 0.0) {
            span / 256.0
        } else if requested > span && span > 0.0 {
            // A slice is sampled at its middle, which must lie in the volume.
            span
        } else {
            requested.max(least)
        };
        if plan.slice_mm != requested {
            plan.notes.push(format!("slice distance {requested} mm: {} mm is used", plan.slice_mm));
        }
        let d = plan.slice_mm;
        let count = ((span / d) - 1e-9).ceil().max(1.0) as u32;
        let from = ((first.0 - near) / d).floor().max(0.0) as u32;
        let until = (((last.1 - near) / d).ceil() as u32).clamp(from, count);
        if until - from < count {
            plan.notes
                .push(format!("{} empty slices before and behind are left out", count - (until - from)));
        }
        let mut ranges = occupied_mm.iter().copied().peekable();
        let mut is_empty = |slice: u32| {
            let (front, back) = (near + f64::from(slice) * d, near + f64::from(slice + 1) * d);
            while ranges.next_if(|r| r.1 < front).is_some() {}
            ranges.peek().is_none_or(|r| r.0 > back)
        };
        if let Some(cone) = lamp {
            plan.lamp_steps(&cone, (settings, grid), sight, near, from..until, &mut is_empty);
        } else if mended {
            plan.mended_steps(settings, grid, sight, near, from..until, &mut is_empty);
        } else {
            let radius_mm = d * aperture_deg.to_radians().tan();
            for slice in from..until {
                let depth_mm = near + f64::from(slice) * d;
                // At the middle of the slice: at the eye itself a pixel has no size.
                let pixel_mm = sight.pixel_mm(depth_mm + 0.5 * d);
                let radius_px = (radius_mm / pixel_mm).min(MOST_REACH_PX);
                let kernel = Kernel::Disc { grid, radius_px, radius_mm };
                plan.steps.push(Step { depth_mm, slices: 1, kernel, empty: is_empty(slice) });
            }
        }
        let far_px = plan.steps.iter().map(|s| s.kernel.reach_px()).max().unwrap_or(0);
        if f64::from(far_px) >= MOST_REACH_PX {
            plan.notes.push(format!("footprints reach {MOST_REACH_PX} pixels at most"));
        }
        if grid == 1 && aperture_deg > 0.0 {
            plan.notes.push("grid 1x1: occlusion is carried straight back, without a penumbra".to_owned());
        }
        plan
    }

    fn mended_steps(
        &mut self,
        settings: &SliceSettings,
        grid: u32,
        sight: &Sight,
        near: f64,
        slices: std::ops::Range<u32>,
        is_empty: &mut dyn FnMut(u32) -> bool,
    ) {
        let d = self.slice_mm;
        let reference_mm = usable_reference_mm(settings);
        let variance_mm2 = tangent_variance(self.aperture_deg) * d * reference_mm;
        // Half of a step's blur is applied before it, half behind it: second order in the step.
        let mut blur_before = 0.0;
        let mut step: Option<(Step, f64)> = None;
        for slice in slices {
            let depth_mm = near + f64::from(slice) * d;
            let blur = variance_mm2 / sight.pixel_mm(depth_mm + 0.5 * d).powi(2);
            let blur = blur.min(MOST_REACH_PX * MOST_REACH_PX);
            let empty = is_empty(slice);
            match &mut step {
                Some((s, total))
                    if s.empty == empty && s.slices < MOST_PER_STEP && *total < BLUR_PER_STEP_PX2 =>
                {
                    s.slices += 1;
                    *total += blur;
                }
                _ => {
                    if let Some((mut s, total)) = step.take() {
                        s.kernel = Kernel::lattice(grid, blur_before + 0.5 * total);
                        blur_before = 0.5 * total;
                        self.steps.push(s);
                    }
                    let kernel = Kernel::lattice(1, 0.0);
                    step = Some((Step { depth_mm, slices: 1, kernel, empty }, blur));
                }
            }
        }
        if let Some((mut s, total)) = step {
            s.kernel = Kernel::lattice(grid, blur_before + 0.5 * total);
            self.steps.push(s);
        }
    }

    /// Steps whose light comes from a lamp: they end where it moves sideways by a pixel, too.
    fn lamp_steps(
        &mut self,
        cone: &LampCone,
        (settings, grid): (&SliceSettings, u32),
        sight: &Sight,
        near: f64,
        slices: std::ops::Range<u32>,
        is_empty: &mut dyn FnMut(u32) -> bool,
    ) {
        let d = self.slice_mm;
        let mended = settings.variant == SliceVariant::Mended;
        let reference_mm = usable_reference_mm(settings);
        let no_kernel = Kernel::lattice(1, 0.0);
        // Front to back, as what is empty is found in this order.
        let mut all: Vec<(f64, bool)> =
            slices.map(|slice| (near + f64::from(slice) * d, is_empty(slice))).collect();
        if cone.from_behind {
            all.reverse();
        }
        let mut steps: Vec<Step> = Vec::new();
        for (depth_mm, empty) in all {
            let joins = steps.last_mut().filter(|step| {
                let length_mm = d * f64::from(step.slices);
                let ends_mm = if cone.from_behind {
                    [step.depth_mm + length_mm, depth_mm.max(0.5 * d)]
                } else {
                    [step.depth_mm.max(0.5 * d), depth_mm + d]
                };
                let pixel_mm = sight.pixel_mm(step.depth_mm + 0.5 * d);
                let blur = cone.variance() * reference_mm * length_mm / (pixel_mm * pixel_mm);
                let is_short =
                    blur < BLUR_PER_STEP_PX2 && (step.empty || cone.moved_px(sight, ends_mm) < 1.0);
                mended && step.empty == empty && step.slices < MOST_PER_STEP && is_short
            });
            match joins {
                Some(step) => {
                    (step.slices, step.depth_mm) = (step.slices + 1, step.depth_mm.min(depth_mm));
                }
                None => steps.push(Step { depth_mm, slices: 1, kernel: no_kernel, empty }),
            }
        }
        // From the middle of a step to that of the one before; half of its length for the first, which meets full light.
        let mut before_mm = None;
        for step in &mut steps {
            let length_mm = d * f64::from(step.slices);
            let middle_mm = step.depth_mm + 0.5 * length_mm;
            let from_mm = before_mm.unwrap_or(if cone.from_behind {
                step.depth_mm + length_mm
            } else {
                step.depth_mm.max(0.5 * middle_mm)
            });
            step.kernel = if mended {
                cone.blurred(sight, [from_mm, middle_mm], grid, reference_mm)
            } else {
                cone.ellipse(sight, [from_mm, middle_mm], grid)
            };
            before_mm = Some(middle_mm);
        }
        self.steps = steps;
    }

    /// Whether light crosses the slices from back to front.
    pub fn is_lit_from_behind(&self) -> bool {
        self.lamp.is_some_and(|cone| cone.from_behind)
    }

    /// View depth of the nearest slice's front.
    pub fn front_mm(&self) -> f64 {
        self.steps.iter().map(|step| step.depth_mm).fold(f64::INFINITY, f64::min)
    }

    /// Total number of slices.
    pub fn slices(&self) -> u32 {
        self.steps.iter().map(|s| s.slices).sum()
    }
}
