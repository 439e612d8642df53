//! How much work a picture may be: the knobs, and the points on them that have names.

use serde::{Deserialize, Serialize};

use crate::lighting::{Lighting, Shading};

/// Cost of [`Preset::Draft`], of balanced's.
const DRAFT_COST: f64 = 1.0 / 8.0;
/// Cost of the reference by slices: thinner ones than its 0.7 mm gain nothing.
const MOST_SLICES_COST: f64 = 1.0 / 0.7;

/// Cost on the path, and errors on opaque surfaces and in tissue: `accuracy --only view` on 2026-11-26, head
/// phantom T1c, transfer functions MR surface and MR tissue.
type Measured = [(f64, [f64; 2])];
const MEASURED_SLICES: &Measured = &[
    (0.004, [0.0926, 0.0436]),
    (0.015, [0.0220, 0.0337]),
    (0.03, [0.0156, 0.0342]),
    (0.06, [0.0140, 0.0330]),
    (0.125, [0.0128, 0.0336]),
    (0.25, [0.0123, 0.0329]),
    (0.5, [0.0113, 0.0305]),
    (1.0, [0.0113, 0.0310]),
    (MOST_SLICES_COST, [0.0107, 0.0307]),
];
const MEASURED_CONES: &Measured = &[
    (0.004, [0.0442, 0.0811]),
    (0.015, [0.0466, 0.0762]),
    (0.03, [0.0398, 0.0673]),
    (0.06, [0.0358, 0.0599]),
    (0.125, [0.0270, 0.0574]),
    (0.25, [0.0265, 0.0569]),
    (0.5, [0.0248, 0.0582]),
    (1.0, [0.0229, 0.0561]),
    (2.0, [0.0194, 0.0411]),
    (4.0, [0.0201, 0.0398]),
    (8.0, [0.0178, 0.0215]),
    (16.0, [0.0160, 0.0202]),
];

/// Points on the measured front of error against time (docs/accuracy.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// For slow machines and moving pictures.
    Draft,
    /// Where more time gains little.
    Balanced,
    /// For figures.
    Reference,
}

impl Preset {
    /// From fast to exact.
    pub const ALL: [Self; 3] = [Self::Draft, Self::Balanced, Self::Reference];

    /// What the command line calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Balanced => "balanced",
            Self::Reference => "reference",
        }
    }
}

/// How much work a frame may be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Point pairs that ambient occlusion tests a pixel, 1 to [`Quality::MOST_SAMPLES`].
    pub occlusion_samples: u32,
    /// How far it reaches.
    pub occlusion_radius_mm: f64,
    /// 0 (none) to 1 (hidden places black).
    pub occlusion_strength: f64,
    /// How much hidden places take on the colour of what hides them, 0 to 1.
    pub color_bleeding: f64,
    /// Distance between samples of the context image along a ray, millimetres; where its finest
    /// spacing is above 1 mm, that many times as much. Above 0; anything else
    /// is taken for the finest step there is, as are steps that would need more than
    /// [`Quality::MOST_CONTEXT_STEPS`] for the image's diagonal.
    pub context_step_mm: f64,
    /// Pixels drawn to pixels asked for, along each side; above 0, at most 1.
    pub resolution_scale: f64,
    /// Which way light is found, and how well.
    pub lighting: Lighting,
    /// Where on the path of [`Quality::at_cost`] this is; `None` beside it, and for screen-space light.
    pub cost: Option<f64>,
}

impl Quality {
    /// The most point pairs of ambient occlusion.
    pub const MOST_SAMPLES: u32 = 32;
    /// The most samples of the context image along a ray.
    pub const MOST_CONTEXT_STEPS: u32 = 8192;

    /// At rest, and for files: screen-space light.
    pub const FULL: Self = Self {
        occlusion_samples: 12,
        occlusion_radius_mm: 6.0,
        occlusion_strength: 0.75,
        color_bleeding: 0.35,
        context_step_mm: 0.5,
        resolution_scale: 1.0,
        lighting: Lighting::DEFAULT,
        cost: None,
    };

    /// While dragging: half the resolution, fewer samples.
    pub const DRAFT: Self =
        Self { occlusion_samples: 6, context_step_mm: 1.0, resolution_scale: 0.5, ..Self::FULL };

    /// How dark what no light reaches is, 0 to 1.
    pub(crate) fn strength(&self) -> f32 {
        self.occlusion_strength.clamp(0.0, 1.0) as f32
    }

    /// A fixed preset of this way of finding light.
    pub fn preset(shading: Shading, preset: Preset) -> Self {
        match preset {
            Preset::Draft => Self::at_cost(shading, DRAFT_COST),
            Preset::Balanced => Self::at_cost(shading, 1.0),
            Preset::Reference => Self::at_cost(shading, Self::most_cost(shading)),
        }
    }

    /// Cost of [`Preset::Reference`], of balanced's.
    pub fn most_cost(shading: Shading) -> f64 {
        if shading == Shading::Slices { MOST_SLICES_COST } else { 16.0 }
    }

    /// The quality that takes about `cost` times as long as [`Preset::Balanced`], within what there is: one path
    /// through the knobs, along which error falls as time rises (docs/accuracy.md). By cones, costs above 4 take up
    /// to three times that.
    pub fn at_cost(shading: Shading, cost: f64) -> Self {
        let cost = if cost.is_finite() { cost.clamp(1e-3, Self::most_cost(shading)) } else { 1.0 };
        // Down from balanced, up from it.
        let (less, more) = (cost.min(1.0), cost.max(1.0));
        let pixels = if shading == Shading::Slices { 0.4 } else { 0.3 };
        let resolution_scale = less.powf(pixels).max(0.2);
        let finer = |balanced: f64, down: f64, up: f64| balanced * less.powf(-down) * more.powf(-up);
        let mut lighting = Lighting { shading, ..Lighting::DEFAULT };
        let mut quality = Self { resolution_scale, ..Self::FULL };
        match shading {
            // At balanced there is nothing to gain any more: what is left is bias.
            Shading::ScreenSpace => {
                quality.occlusion_samples = if cost < 1.0 { 6 } else { 12 };
                quality.context_step_mm = finer(0.5, 0.3, 0.0).min(2.0);
            }
            // Thicker slices lose opaque surfaces: as long as there are pixels to spare, these go first. More
            // points in a footprint bring nothing.
            Shading::Slices => {
                let without_pixels = (less / 0.018).min(1.0);
                lighting.slice_mm = (less.powf(-0.13) * without_pixels.powf(-0.53)).min(6.0) / more;
                lighting.vicinity_samples =
                    (64.0 * less.powf(0.4) * more.powf(1.72)).round().clamp(12.0, 118.0) as u32;
            }
            Shading::Cones => {
                quality.context_step_mm = finer(0.75, 0.3, 0.15).clamp(0.5, 2.0);
                lighting.cell_mm = finer(4.0, 0.25, 0.25).clamp(1.0, 12.0);
                // Down to the draft, longer steps are as right.
                lighting.cone_step = less.powf(-1.0 / 3.0).min(2.0);
                lighting.sub_cones = (6.0 * less.powf(0.3) * more.powf(0.25)).round().max(3.0) as u32;
                lighting.coarsest_level = match cost {
                    c if c > 6.0 => 1,
                    c if c > 1.5 => 2,
                    _ => 3,
                };
            }
        }
        quality.lighting = lighting;
        quality.cost = (shading != Shading::ScreenSpace).then_some(cost);
        quality
    }

    /// What the light of a view is off by, on the head phantom's opaque surfaces and in its tissue: root mean
    /// square of linear radiance against Monte Carlo, between what was measured along the path
    /// (docs/accuracy.md). `None` for screen-space light, which is another model, and where knobs were set by hand.
    pub fn expected_error(&self) -> Option<[f64; 2]> {
        let cost = self.cost.filter(|_| self.lighting.aperture_deg == Lighting::DEFAULT.aperture_deg)?;
        let measured = match self.lighting.shading {
            Shading::ScreenSpace => return None,
            Shading::Slices => MEASURED_SLICES,
            Shading::Cones => MEASURED_CONES,
        };
        let after = measured.iter().position(|(c, _)| *c >= cost).unwrap_or(measured.len() - 1);
        let [(c0, e0), (c1, e1)] = [after.saturating_sub(1), after].map(|i| measured[i]);
        let share = if c1 > c0 { ((cost / c0).ln() / (c1 / c0).ln()).clamp(0.0, 1.0) } else { 1.0 };
        Some(std::array::from_fn(|scene| e0[scene] * (e1[scene] / e0[scene]).powf(share)))
    }

    /// Pixels to draw for a place of `asked_px`; 0 stays 0.
    pub(crate) fn drawn_px(&self, asked_px: [u32; 2]) -> [u32; 2] {
        let scale = if self.resolution_scale > 0.0 { self.resolution_scale.min(1.0) } else { 1.0 };
        asked_px.map(|p| if p == 0 { 0 } else { ((f64::from(p) * scale).ceil() as u32).max(1) })
    }
}

impl Default for Quality {
    fn default() -> Self {
        Self::FULL
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_on_the_path_and_the_expected_error_falls() {
        for shading in [Shading::Slices, Shading::Cones] {
            let errors = Preset::ALL.map(|p| Quality::preset(shading, p).expected_error().unwrap());
            for scene in [0, 1] {
                let [draft, balanced, reference] = errors.map(|e| e[scene]);
                assert!(draft > balanced && balanced > reference, "{errors:?}");
            }
            assert_eq!(Quality::preset(shading, Preset::Balanced), Quality::at_cost(shading, 1.0));
            // Knobs of one's own have no place on the path.
            let mut own = Quality::preset(shading, Preset::Balanced);
            own.lighting.aperture_deg = 30.0;
            assert_eq!(own.expected_error(), None);
        }
        let screen = Quality::preset(Shading::ScreenSpace, Preset::Reference);
        assert_eq!((screen, screen.expected_error()), (Quality::FULL, None));
    }

    #[test]
    fn every_cost_has_knobs_within_their_ranges() {
        for shading in Shading::ALL {
            for cost in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e-9, 0.01, 0.3, 1.0, 3.0, 5.0, 1e9] {
                let Quality { resolution_scale, context_step_mm, lighting: l, .. } =
                    Quality::at_cost(shading, cost);
                assert!((0.2..=1.0).contains(&resolution_scale), "{shading:?} {cost}: {resolution_scale}");
                assert!((0.25..=4.0).contains(&context_step_mm) && (0.4..=8.0).contains(&l.slice_mm));
                assert!((1..=Lighting::MOST_SUB_CONES).contains(&l.sub_cones) && l.cell_mm >= 1.0);
                assert!((1..=Lighting::MOST_VICINITY).contains(&l.vicinity_samples));
            }
        }
    }
}
