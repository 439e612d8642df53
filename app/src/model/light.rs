//! Lighting settings of the 3D views.

use glioscope_render::{Knobs, Lamp, LightSettings, LightingMode, Preset, Quality, light};
use serde::{Deserialize, Serialize};

/// Lighting mode, preset and settings of the 3D views.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightChoice {
    /// The lighting mode.
    pub mode: LightingMode,
    /// A fixed quality; `None`: automatic, within a time budget during interaction and the reference at rest.
    pub preset: Option<Preset>,
    /// Half the opening angle of the cone that light arrives through, degrees.
    pub aperture_deg: f64,
    /// Where the lamp stands in the modes that have one.
    #[serde(default)]
    pub lamp: Lamp,
    /// Whether the cone of light points to the lamp instead of to the eye, in the modes where it may.
    #[serde(default)]
    pub towards_lamp: bool,
    /// Custom settings instead of the preset's.
    #[serde(default)]
    pub own: Option<LightSettings>,
    /// Shading that differs from the mode's.
    #[serde(default)]
    pub shading: Shading,
}

/// Settings of shading that apply to every preset. `None`: the lighting mode's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Shading {
    /// Distance within which surfaces darken each other in the modes with ambient occlusion.
    pub occlusion_radius_mm: Option<f64>,
    /// Share of the light that hidden places receive, too: 0 to 1.
    pub ambient_share: Option<f64>,
    /// Light at the eye in the closeup: 0 (flat colours) to 1 (rims darkest).
    pub relief: Option<f64>,
    /// Whether the closeup shows a smooth surface instead of voxels: for the eye only.
    pub smooth: bool,
    /// Vicinity occlusion: virtual slice distance.
    pub vicinity_mm: Option<f64>,
    /// Vicinity occlusion: samples, 1 to [`LightSettings::MOST_VICINITY`].
    pub vicinity_samples: Option<u32>,
    /// Settings that only some lighting modes have.
    pub knobs: Knobs,
}

impl Shading {
    /// `quality` with these settings. Its error is known no more where they change what was measured.
    fn at(&self, quality: Quality) -> Quality {
        let lighting = LightSettings {
            vicinity_mm: self.vicinity_mm.unwrap_or(quality.lighting.vicinity_mm),
            vicinity_samples: self.vicinity_samples.unwrap_or(quality.lighting.vicinity_samples),
            ..quality.lighting
        };
        Quality {
            occlusion_radius_mm: self.occlusion_radius_mm.unwrap_or(quality.occlusion_radius_mm),
            occlusion_strength: self.ambient_share.map_or(quality.occlusion_strength, |share| 1.0 - share),
            relief: self.relief.unwrap_or(quality.relief),
            smooth: self.smooth,
            cost: quality.cost.filter(|_| lighting == quality.lighting),
            lighting,
            ..quality
        }
    }
}

impl Default for LightChoice {
    fn default() -> Self {
        let aperture_deg = LightSettings::DEFAULT.aperture_deg;
        let shading = Shading::default();
        Self {
            mode: LightingMode::default(),
            preset: None,
            aperture_deg,
            lamp: Lamp::DEFAULT,
            towards_lamp: false,
            own: None,
            shading,
        }
    }
}

impl LightChoice {
    /// `quality`, which must be for this lighting mode, with this choice's aperture or custom settings, its lamp, and
    /// its shading.
    pub fn at(&self, quality: Quality) -> Quality {
        let lighting =
            self.own.unwrap_or(LightSettings { aperture_deg: self.aperture_deg, ..quality.lighting });
        let towards_lamp = self.towards_lamp && light::row(self.mode).turns_to_lamp();
        let lighting = LightSettings { lamp: self.lamp, towards_lamp, ..lighting };
        let at_rest = self.own.unwrap_or_else(|| self.preset_at_rest().lighting);
        let with_knobs = self.shading.knobs.at(light::row(self.mode).knobs, lighting, &at_rest);
        let cost = quality.cost.filter(|_| self.own.is_none() && with_knobs == lighting);
        self.shading.at(Quality { lighting: with_knobs, cost, ..quality })
    }

    /// Whether where the lamp stands has an effect.
    pub fn has_lamp(&self) -> bool {
        let row = light::row(self.mode);
        row.has_lamp || (self.towards_lamp && row.turns_to_lamp())
    }

    /// Whether the mode has ambient occlusion within [`Shading::occlusion_radius_mm`].
    pub fn has_ambient_occlusion(&self) -> bool {
        let row = light::row(self.mode);
        !row.has_aperture && !row.has_lamp
    }

    /// Whether the mode has vicinity occlusion of opaque surfaces.
    pub fn has_vicinity(&self) -> bool {
        self.mode == LightingMode::Slices
    }

    /// The quality of views at rest and of exported files: the preset, or the reference without one.
    pub fn at_rest(&self) -> Quality {
        self.at(self.preset_at_rest())
    }

    fn preset_at_rest(&self) -> Quality {
        light::preset(self.mode, self.preset.unwrap_or(Preset::Reference))
    }
}

#[cfg(test)]
mod tests {
    use glioscope_render::Knob;

    use super::*;

    #[test]
    fn shading_changes_what_it_names_and_the_known_error_only_with_what_was_measured() {
        let mode = LightingMode::Slices;
        let plain = LightChoice { mode, ..LightChoice::default() };
        let at = |shading| LightChoice { shading, ..plain }.at_rest();
        assert_eq!(at(Shading::default()), plain.at_rest());
        let lit = at(Shading { ambient_share: Some(0.0), relief: Some(0.5), ..Shading::default() });
        assert_eq!(lit, Quality { occlusion_strength: 1.0, relief: 0.5, ..plain.at_rest() });
        let near = at(Shading { vicinity_mm: Some(1.0), vicinity_samples: Some(9), ..Shading::default() });
        assert_eq!((near.lighting.vicinity_mm, near.lighting.vicinity_samples), (1.0, 9));
        assert_eq!((near.cost, plain.at_rest().cost.is_some()), (None, true));
    }

    /// What a knob says is drawn at rest; drafts stay as much coarser as they are, and modes without the knob as they were.
    #[test]
    fn knobs_are_of_the_picture_at_rest() {
        let mut knobs = Knobs::default();
        knobs.set(Knob::CellMm, 3.0);
        knobs.set(Knob::SkyOrder, 1.0);
        let shading = Shading { knobs, ..Shading::default() };
        let mode = LightingMode::SphericalHarmonics;
        let plain = LightChoice { mode, ..LightChoice::default() };
        let set = LightChoice { shading, ..plain };
        let draft = light::preset(mode, Preset::Draft);
        let [at_rest, moving] = [set.at_rest(), set.at(draft)].map(|quality| quality.lighting);
        assert_eq!((at_rest.cell_mm, at_rest.sky_order, moving.sky_order), (3.0, 1, 1));
        let coarser = draft.lighting.cell_mm / plain.at_rest().lighting.cell_mm;
        assert!(coarser > 1.5 && (moving.cell_mm / 3.0 - coarser).abs() < 1e-9, "{coarser} {moving:?}");
        let elsewhere = LightChoice { mode: LightingMode::Slices, ..LightChoice::default() };
        assert_eq!(LightChoice { shading, ..elsewhere }.at_rest(), elsewhere.at_rest());
        let text = serde_json::to_string(&shading).unwrap();
        assert!(text.contains(r#""knobs":{"cell_mm":3.0,"sky_order":1.0}"#), "{text}");
        assert_eq!(serde_json::from_str::<Shading>(&text).unwrap(), shading);
    }
}
