//! Lighting settings from the command line.

use glioscope_render::{Knob, Knobs, Lamp, LightSettings, Preset, light};

use super::arguments::LightArguments;
use crate::model::{LightChoice, Shading};

/// The lighting given by the arguments: the preset's, or custom settings based on it. What they leave open is as in `base`.
pub(super) fn light(arguments: &LightArguments, base: &LightChoice) -> LightChoice {
    let LightArguments { light: mode, quality, aperture, slices, footprint, darkens, .. } = *arguments;
    let is_open = mode.is_none() && quality.is_none() && aperture.is_none();
    let mut choice = LightChoice {
        mode: mode.unwrap_or(base.mode),
        preset: quality.or(base.preset),
        aperture_deg: aperture.unwrap_or(base.aperture_deg),
        lamp: {
            let [azimuth_deg, elevation_deg] =
                arguments.lamp.unwrap_or([base.lamp.azimuth_deg, base.lamp.elevation_deg]);
            Lamp { frame: arguments.lamp_frame.unwrap_or(base.lamp.frame), azimuth_deg, elevation_deg }
        },
        // Giving the lamp asks for its light.
        towards_lamp: base.towards_lamp || arguments.lamp.is_some() || arguments.lamp_frame.is_some(),
        own: base.own.filter(|_| is_open),
        shading: Shading {
            occlusion_radius_mm: arguments.occlusion_mm.or(base.shading.occlusion_radius_mm),
            ambient_share: arguments.ambient.or(base.shading.ambient_share),
            relief: arguments.relief.or(base.shading.relief),
            smooth: arguments.smooth || base.shading.smooth,
            vicinity_mm: arguments.vicinity_mm.or(base.shading.vicinity_mm),
            vicinity_samples: arguments.vicinity_samples.or(base.shading.vicinity_samples),
            knobs: knobs(arguments, base.shading.knobs),
        },
    };
    if slices.is_none() && footprint.is_none() && darkens.is_none() {
        return choice;
    }
    let preset = light::preset(choice.mode, choice.preset.unwrap_or(Preset::Reference)).lighting;
    choice.own = Some(LightSettings {
        aperture_deg: choice.aperture_deg,
        variant: slices.unwrap_or(preset.variant),
        slice_grid: footprint.unwrap_or(preset.slice_grid),
        mutual: darkens.unwrap_or(preset.mutual),
        ..preset
    });
    choice
}

/// The settings that only some modes have.
fn knobs(arguments: &LightArguments, base: Knobs) -> Knobs {
    let a = arguments;
    let mut out = base;
    let whole = |value: Option<u32>| value.map(f64::from);
    for (knob, value) in [
        (Knob::SliceMm, a.slice_mm),
        (Knob::CellMm, a.cell_mm),
        (Knob::SubCones, whole(a.sub_cones)),
        (Knob::SkyOrder, whole(a.sky_order)),
        (Knob::SkyDirections, whole(a.sky_directions)),
        (Knob::SkyShare, a.sky_share),
        (Knob::Clusters, whole(a.clusters)),
        (Knob::TissueBleeding, a.tissue_bleeding),
        (Knob::Paths, whole(a.paths)),
        (Knob::Bounces, whole(a.bounces)),
        (Knob::Anisotropy, a.anisotropy),
        (Knob::LampShare, a.lamp_share),
        (Knob::LampRadiusDeg, a.lamp_radius),
        (Knob::TissueShading, a.tissue_shading),
    ] {
        if let Some(value) = value {
            out.set(knob, value);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Task};
    use clap::Parser;
    use strum::VariantArray;

    use glioscope_render::{LampFrame, LightingMode, MutualOcclusion, PathSettings, SliceVariant};

    /// Each setting of the table has an option that sets it to what is given.
    #[test]
    fn every_knob_has_an_option() {
        let given = "--slice-mm 3 --cell-mm 5 --sub-cones 7 --sky-order 2 --sky-directions 9 --sky-share 0.25 --clusters 11 \
                     --tissue-bleeding 0.5 --paths 13 --bounces 15 --anisotropy -0.5 --lamp-share 0.75 --lamp-radius 17 \
                     --tissue-shading 0.125";
        let words = ["glioscope", "render"].into_iter().chain(given.split_whitespace());
        let Some(Task::Render(arguments)) = Cli::try_parse_from(words).unwrap().task else { panic!() };
        let expected: Vec<f64> = given.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let found: Vec<(Knob, f64)> = knobs(&arguments.light, Knobs::default()).given().collect();
        assert_eq!(found, Knob::VARIANTS.iter().copied().zip(expected).collect::<Vec<_>>());
    }

    #[test]
    fn custom_settings_start_from_the_preset() {
        assert_eq!(light(&LightArguments::default(), &LightChoice::default()), LightChoice::default());
        let arguments = LightArguments {
            light: Some(LightingMode::Slices),
            slices: Some(SliceVariant::PaperExact),
            darkens: Some(MutualOcclusion::NONE),
            ..LightArguments::default()
        };
        let choice = light(&arguments, &LightChoice::default());
        let own = choice.own.unwrap();
        assert_eq!((choice.mode, own.mode), (LightingMode::Slices, LightingMode::Slices));
        assert_eq!((own.variant, own.mutual), (SliceVariant::PaperExact, MutualOcclusion::NONE));
        assert_eq!(own.slice_mm, light::preset(LightingMode::Slices, Preset::Reference).lighting.slice_mm);
        let arguments = LightArguments {
            light: Some(LightingMode::HalfAngle),
            lamp: Some([30.0, 40.0]),
            slice_mm: Some(2.0),
            ..LightArguments::default()
        };
        let base = LightChoice {
            lamp: Lamp { frame: LampFrame::Patient, ..Lamp::DEFAULT },
            ..LightChoice::default()
        };
        let lighting = light(&arguments, &base).at_rest().lighting;
        let lamp = Lamp { frame: LampFrame::Patient, azimuth_deg: 30.0, elevation_deg: 40.0 };
        assert_eq!((lighting.lamp, lighting.slice_mm, lighting.lamp_texel_mm), (lamp, 2.0, 2.0));
        let arguments = LightArguments {
            light: Some(LightingMode::PathTraced),
            bounces: Some(1),
            lamp_share: Some(0.0),
            ..LightArguments::default()
        };
        let paths = light(&arguments, &base).at_rest().lighting.paths;
        let preset = light::preset(LightingMode::PathTraced, Preset::Reference).lighting.paths;
        assert_eq!(paths, PathSettings { bounces: 1, lamp_share: 0.0, ..preset });
        // The cone of light points to the lamp where one is given, in the modes where it may, and gradients are shaded by it.
        for (mode, towards) in [
            (LightingMode::Slices, true),
            (LightingMode::Cones, true),
            (LightingMode::Traced, true),
            (LightingMode::HalfAngle, false),
            (LightingMode::DynamicAmbient, false),
        ] {
            let arguments =
                LightArguments { light: Some(mode), lamp: Some([30.0, 40.0]), ..LightArguments::default() };
            let lit = light(&arguments, &base);
            assert_eq!(
                (lit.at_rest().lighting.towards_lamp, lit.has_lamp()),
                (towards, mode != LightingMode::DynamicAmbient)
            );
            let none = light(&LightArguments { lamp: None, ..arguments }, &base);
            assert!(
                !none.at_rest().lighting.towards_lamp && none.has_lamp() == (mode == LightingMode::HalfAngle)
            );
        }
    }
}
