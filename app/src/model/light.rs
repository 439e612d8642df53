//! Lighting settings of the 3D views.

use glioscope_render::{LightSettings, LightingMode, Preset, Quality, light};
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
    /// Custom settings instead of the preset's.
    #[serde(default)]
    pub own: Option<LightSettings>,
}

impl Default for LightChoice {
    fn default() -> Self {
        let aperture_deg = LightSettings::DEFAULT.aperture_deg;
        Self { mode: LightingMode::default(), preset: None, aperture_deg, own: None }
    }
}

impl LightChoice {
    /// `quality`, which must be for this lighting mode, with this choice's aperture or custom settings.
    pub fn at(&self, quality: Quality) -> Quality {
        let lighting =
            self.own.unwrap_or(LightSettings { aperture_deg: self.aperture_deg, ..quality.lighting });
        Quality { lighting, cost: quality.cost.filter(|_| self.own.is_none()), ..quality }
    }

    /// The quality of views at rest and of exported files: the preset, or the reference without one.
    pub fn at_rest(&self) -> Quality {
        self.at(light::preset(self.mode, self.preset.unwrap_or(Preset::Reference)))
    }
}
