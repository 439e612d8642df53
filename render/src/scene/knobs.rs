//! Settings of light that lighting modes let be changed one by one, over whatever preset is drawn: their table, and values given.

use std::{collections::BTreeMap, ops::RangeInclusive};

use serde::{Deserialize, Serialize};
use strum::VariantArray;

use super::{
    keywords::keywords,
    quality::{LightSettings, LightingMode, PathSettings},
};

keywords! {
    /// A setting of light.
    #[derive(PartialOrd, Ord)]
    pub enum Knob {
        /// Distance between slices.
        SliceMm,
        /// Side of the cells of the image in which light is kept.
        CellMm,
        /// Sub-cones.
        SubCones,
        /// Order of spherical harmonics.
        SkyOrder,
        /// Directions in which spherical harmonics look.
        SkyDirections,
        /// Share of the light from everywhere.
        SkyShare,
        /// Clusters of surroundings.
        Clusters,
        /// How much of its colour tissue gives to what it darkens.
        TissueBleeding,
        /// The most paths of a pixel.
        Paths,
        /// The most scatterings of a path.
        Bounces,
        /// Where the image scatters light to.
        Anisotropy,
        /// Share of the lamp in the light.
        LampShare,
        /// Angular radius of the lamp.
        LampRadiusDeg,
        /// How much tissue is shaded by its gradients.
        TissueShading,
    }
}

/// A setting as menus show it.
#[derive(Clone, Debug)]
pub struct KnobRow {
    /// Its label.
    pub label: &'static str,
    /// What it does, for tooltips.
    pub tip: &'static str,
    /// Behind its value.
    pub unit: &'static str,
    /// Values that it takes.
    pub limits: RangeInclusive<f64>,
    /// Those that a slider shows.
    pub range: RangeInclusive<f64>,
    /// Digits behind the point; whole numbers have none.
    pub decimals: usize,
    /// Whether it is finer at higher quality: what is given is that of the picture at rest, and a draft stays as much coarser.
    pub by_quality: bool,
}

impl Knob {
    /// How menus show it.
    pub fn row(self) -> KnobRow {
        let of = |label, tip, range: RangeInclusive<f64>, decimals| KnobRow {
            label,
            tip,
            unit: "",
            limits: range.clone(),
            range,
            decimals,
            by_quality: false,
        };
        let share = |label, tip| of(label, tip, 0.0..=1.0, 2);
        let whole = |label, tip, least: f64, most: u32| of(label, tip, least..=f64::from(most), 0);
        let finer = |row: KnobRow| KnobRow { by_quality: true, ..row };
        let in_mm = |row: KnobRow| KnobRow { unit: " mm", limits: 0.01..=100.0, ..row };
        match self {
            Self::SliceMm => {
                let tip = "Thinner slices are more accurate, and slower";
                finer(in_mm(of("Distance between slices", tip, 0.25..=8.0, 2)))
            }
            Self::CellMm => {
                let tip = "Light in the image is kept in cells of this size: smaller ones show finer shadows, and are slower";
                finer(in_mm(of("Size of cells", tip, 1.0..=16.0, 1)))
            }
            Self::SubCones => {
                let tip = "Parts into which the cone of light is divided";
                finer(whole("Sub-cones", tip, 1.0, LightSettings::MOST_SUB_CONES))
            }
            Self::SkyOrder => {
                let tip = "Order of the harmonic functions: higher ones show narrower shadows, with more ringing beside them";
                whole("Order", tip, 0.0, LightSettings::MOST_SKY_ORDER)
            }
            Self::SkyDirections => {
                let tip = "Directions in which each place looks for light";
                finer(whole("Directions", tip, 1.0, LightSettings::MOST_SUB_CONES))
            }
            Self::SkyShare => {
                share("Light from everywhere", "Share of the light that doesn't come from around the lamp")
            }
            Self::Clusters => {
                let tip = "Kinds of surroundings that are told apart: more are nearer to each place's own";
                whole("Clusters", tip, 1.0, LightSettings::MOST_CLUSTERS)
            }
            Self::TissueBleeding => share(
                "Colour of shadows",
                "How much of its colour tissue gives to the tissue that it darkens",
            ),
            Self::Paths => {
                let tip = "The most paths of light of a pixel: more have less grain, and are slower";
                finer(whole("Paths", tip, 2.0, PathSettings::MOST))
            }
            Self::Bounces => {
                let tip = "The most times that light is scattered on its way; 1 leaves shadows without light in them";
                whole("Scatterings", tip, 1.0, PathSettings::MOST_BOUNCES)
            }
            Self::Anisotropy => {
                let tip = "Where tissue scatters light to: back (-1), everywhere (0) or onwards (1)";
                of("Scattering forwards", tip, -0.95..=0.95, 2)
            }
            Self::LampShare => {
                share("Light of the lamp", "Share of the lamp in the light; the rest is a white sky")
            }
            Self::LampRadiusDeg => {
                let tip = "Its angular radius: wide for soft shadows, 0 for hard ones";
                KnobRow { unit: "°", ..of("Size of the lamp", tip, 0.0..=60.0, 0) }
            }
            Self::TissueShading => share(
                "Shading of tissue",
                "How much steep places are shaded by their direction (Phong); 0: not at all",
            ),
        }
    }

    /// Its value in settings.
    pub fn of(self, settings: &LightSettings) -> f64 {
        let paths = &settings.paths;
        match self {
            Self::SliceMm => settings.slice_mm,
            Self::CellMm => settings.cell_mm,
            Self::SubCones => f64::from(settings.sub_cones),
            Self::SkyOrder => f64::from(settings.sky_order),
            Self::SkyDirections => f64::from(settings.sky_directions),
            Self::SkyShare => settings.sky_share,
            Self::Clusters => f64::from(settings.clusters),
            Self::TissueBleeding => settings.tissue_bleeding,
            Self::Paths => f64::from(paths.most),
            Self::Bounces => f64::from(paths.bounces),
            Self::Anisotropy => paths.anisotropy,
            Self::LampShare => paths.lamp_share,
            Self::LampRadiusDeg => paths.lamp_radius_deg,
            Self::TissueShading => settings.tissue_shading,
        }
    }

    /// Puts a value within its limits into settings.
    fn set(self, settings: &mut LightSettings, value: f64) {
        let limits = self.row().limits;
        let value = value.clamp(*limits.start(), *limits.end());
        let whole = value.round() as u32;
        let paths = &mut settings.paths;
        match self {
            Self::SliceMm => {
                settings.slice_mm = value;
                // The light's buffer is as fine as the slices, as in the presets.
                if settings.mode == LightingMode::HalfAngle {
                    settings.lamp_texel_mm = value;
                }
            }
            Self::CellMm => settings.cell_mm = value,
            Self::SubCones => settings.sub_cones = whole,
            Self::SkyOrder => settings.sky_order = whole,
            Self::SkyDirections => settings.sky_directions = whole,
            Self::SkyShare => settings.sky_share = value,
            Self::Clusters => settings.clusters = whole,
            Self::TissueBleeding => settings.tissue_bleeding = value,
            Self::Paths => paths.most = whole,
            Self::Bounces => paths.bounces = whole,
            Self::Anisotropy => paths.anisotropy = value,
            Self::LampShare => paths.lamp_share = value,
            Self::LampRadiusDeg => paths.lamp_radius_deg = value,
            Self::TissueShading => settings.tissue_shading = value,
        }
    }
}

/// Values given for settings; the others are the preset's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "BTreeMap<Knob, f64>", into = "BTreeMap<Knob, f64>")]
pub struct Knobs([Option<f64>; Knob::VARIANTS.len()]);

impl Knobs {
    /// Gives a value.
    pub fn set(&mut self, knob: Knob, value: f64) {
        if let Some(place) = self.0.get_mut(knob as usize) {
            *place = Some(value);
        }
    }

    /// The values given, in the order of knobs.
    pub fn given(&self) -> impl Iterator<Item = (Knob, f64)> {
        Knob::VARIANTS.iter().zip(self.0).filter_map(|(knob, value)| Some((*knob, value?)))
    }

    /// Settings of a mode with the values that are given for its `knobs`, where those at rest are `at_rest`.
    pub fn at(&self, knobs: &[Knob], settings: LightSettings, at_rest: &LightSettings) -> LightSettings {
        let mut out = settings;
        for (knob, value) in self.given().filter(|(knob, _)| knobs.contains(knob)) {
            let scale = if knob.row().by_quality { knob.of(&settings) / knob.of(at_rest) } else { 1.0 };
            knob.set(&mut out, value * if scale.is_finite() { scale } else { 1.0 });
        }
        out
    }
}

impl From<BTreeMap<Knob, f64>> for Knobs {
    fn from(given: BTreeMap<Knob, f64>) -> Self {
        let mut out = Self::default();
        given.into_iter().for_each(|(knob, value)| out.set(knob, value));
        out
    }
}

impl From<Knobs> for BTreeMap<Knob, f64> {
    fn from(knobs: Knobs) -> Self {
        knobs.given().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each changes a setting of its own, and every mode's draft stays coarser than its picture at rest.
    #[test]
    fn each_knob_sets_what_it_reads_and_nothing_else() {
        let plain = LightSettings::DEFAULT;
        for &knob in Knob::VARIANTS {
            let row = knob.row();
            let mut knobs = Knobs::default();
            assert!(row.limits.contains(row.range.start()) && row.limits.contains(row.range.end()));
            for value in [*row.range.start(), *row.range.end()] {
                knobs.set(knob, value);
                let set = knobs.at(&[knob], plain, &plain);
                assert_eq!(knob.of(&set), value, "{knob:?}");
                let others = Knob::VARIANTS.iter().filter(|other| **other != knob);
                assert!(others.into_iter().all(|other| other.of(&set) == other.of(&plain)), "{knob:?}");
                assert_eq!(knobs.at(&[], plain, &plain), plain, "a mode without it");
                let draft = LightSettings { cell_mm: 2.0 * plain.cell_mm, ..plain };
                let set = knobs.at(&[Knob::CellMm], draft, &plain);
                let expected = if knob == Knob::CellMm { 2.0 * value } else { draft.cell_mm };
                assert_eq!(set.cell_mm, expected);
            }
            knobs.set(knob, 1e9);
            assert_eq!(knob.of(&knobs.at(&[knob], plain, &plain)), *row.limits.end());
            assert_eq!(Knobs::from(BTreeMap::from(knobs)), knobs);
            assert!(!row.label.is_empty() && !row.tip.is_empty());
        }
    }
}
