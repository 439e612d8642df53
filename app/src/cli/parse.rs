//! Parsers of option values. Their errors state what was expected; [`super::one_line`] adds the rest of the message.

use std::{
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use glam::DVec3;
use glioscope_core::files::absolute;
use glioscope_render::{ClipPlane, Lens, MutualOcclusion, TransferPreset};
use strum::VariantArray;

use crate::{model::PaneId, views::transfer::SIDES};

/// A variant of an enum, by its strum name.
pub fn keyword<T>() -> impl TypedValueParser<Value = T>
where
    T: VariantArray + Into<&'static str> + Copy + Send + Sync + 'static,
{
    let names = T::VARIANTS.iter().map(|value| -> &'static str { (*value).into() });
    PossibleValuesParser::new(names).try_map(|text| {
        let has_name = |value: &&T| -> bool { Into::<&'static str>::into(**value) == text };
        T::VARIANTS.iter().find(has_name).copied().ok_or("a word of the list")
    })
}

/// The value of `--view`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// One pane.
    Pane(PaneId),
    /// The whole window.
    Window,
}

impl View {
    /// The pane; `None` for the whole window.
    pub fn pane(self) -> Option<PaneId> {
        match self {
            Self::Pane(pane) => Some(pane),
            Self::Window => None,
        }
    }
}

/// A pane that can be exported as a picture, or the window.
pub fn view() -> impl TypedValueParser<Value = View> {
    let panes = || PaneId::all().filter_map(|pane| Some((pane.row().cli?, View::Pane(pane))));
    let views = move || panes().chain([("window", View::Window)]);
    PossibleValuesParser::new(views().map(|(name, _)| name)).try_map(move |text| {
        views().find(|(name, _)| *name == text).map(|(_, view)| view).ok_or("a view of the list")
    })
}

/// `WIDTHxHEIGHT`, each from 16 to 8192.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let side = |s: &str| s.trim().parse::<u32>().ok().filter(|n| (16..=8192).contains(n));
    let sides = text.split_once(['x', 'X', '×']);
    sides
        .and_then(|(width, height)| Some([side(width)?, side(height)?]))
        .ok_or_else(|| "WIDTHxHEIGHT, each from 16 to 8192".into())
}

/// A number within a range.
pub fn within(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let number = text.trim().parse::<f64>().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("{} to {}", range.start(), range.end()))
    }
}

/// A number above 0 and at most `max`.
pub fn above_zero(max: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let number = text.trim().parse::<f64>().ok().filter(|number| *number > 0.0 && *number <= max);
        number.ok_or_else(|| format!("above 0, at most {max}"))
    }
}

/// Exactly `N` finite numbers separated by commas.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let parsed: Option<Vec<f64>> =
        text.split(',').map(|s| s.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect();
    <[f64; N]>::try_from(parsed?).ok()
}

/// Azimuth and elevation, degrees.
pub fn camera(text: &str) -> Result<[f64; 2], String> {
    numbers(text).ok_or_else(|| "AZIMUTH,ELEVATION in degrees".into())
}

/// Where a lamp stands.
pub fn lamp(text: &str) -> Result<[f64; 2], String> {
    let within = |[azimuth, elevation]: &[f64; 2]| azimuth.abs() <= 360.0 && elevation.abs() <= 90.0;
    numbers(text)
        .filter(within)
        .ok_or_else(|| "AZIMUTH,ELEVATION in degrees, -360 to 360 and -90 to 90".into())
}

/// A derived data set of BIDS: one word is its name, anything else its path, made absolute.
pub fn derived(text: &str) -> Result<PathBuf, String> {
    let path = Path::new(text);
    match path.components().count() {
        0 => Err("a name in derivatives/, a path with a /, or none".into()),
        1 if !path.is_absolute() => Ok(path.to_owned()),
        _ => Ok(absolute(path)),
    }
}

/// A point, world millimetres.
pub fn point(text: &str) -> Result<DVec3, String> {
    numbers(text).map(DVec3::from_array).ok_or_else(|| "X,Y,Z in millimetres".into())
}

/// The limits of a window: low, high.
pub fn low_high(text: &str) -> Result<[f64; 2], String> {
    numbers(text).ok_or_else(|| "LOW,HIGH".into())
}

/// The value of `--transfer`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TransferArgument {
    /// For the image's own percentiles.
    Preset(TransferPreset),
    /// A file as the editor saves it.
    File(PathBuf),
}

/// Names of the presets of transfer functions.
fn presets() -> String {
    TransferPreset::VARIANTS.iter().map(|preset| preset.into()).collect::<Vec<&str>>().join(", ")
}

/// Help of `--transfer`.
pub fn transfer_help() -> String {
    format!(
        "The context view's transfer function: a preset ({}), or a file (.json) saved from the editor or written as \
         docs/json.md has it",
        presets()
    )
}

/// A preset of transfer functions, by its strum name, or a file whose name ends in .json.
pub fn transfer(text: &str) -> Result<TransferArgument, String> {
    if let Ok(preset) = text.parse() {
        return Ok(TransferArgument::Preset(preset));
    }
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
        return Ok(TransferArgument::File(path));
    }
    Err(format!("{} or a file .json", presets()))
}

/// The value of `--lens`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LensArgument {
    /// No lens.
    Off,
    /// A lens.
    At(Lens),
}

/// A lens or `off`.
pub fn lens(text: &str) -> Result<LensArgument, String> {
    if text == "off" {
        return Ok(LensArgument::Off);
    }
    let [x, y, z, radius_mm] =
        numbers(text).ok_or_else(|| "X,Y,Z,RADIUS in millimetres, or off".to_owned())?;
    if radius_mm <= 0.0 {
        return Err("a radius above 0".into());
    }
    Ok(LensArgument::At(Lens { center_mm: DVec3::new(x, y, z), radius_mm }))
}

/// A clipping plane of the image.
pub fn clip(text: &str) -> Result<ClipPlane, String> {
    let expected = || format!("SIDE=MM with {}", SIDES.map(|(side, _)| side).join(", "));
    let (side, mm) = text.split_once('=').ok_or_else(expected)?;
    let (_, normal) = SIDES.into_iter().find(|(name, _)| *name == side).ok_or_else(expected)?;
    let [mm] = numbers(mm).ok_or_else(expected)?;
    Ok(ClipPlane { normal, offset_mm: mm * normal.element_sum() })
}

/// Pairs A-B where A occludes B, separated by commas, or `none`.
pub fn darkens(text: &str) -> Result<MutualOcclusion, String> {
    let mut out = MutualOcclusion::NONE;
    for name in text.split(',').map(str::trim).filter(|name| *name != "none") {
        // Opaque geometry was formerly called solid.
        match name.replace("solid", "opaque").as_str() {
            "image-image" => out.image_on_image = true,
            "opaque-image" => out.opaque_on_image = true,
            "image-opaque" => out.image_on_opaque = true,
            "opaque-opaque" => out.opaque_on_opaque = true,
            _ => return Err("image-image, opaque-image, image-opaque, opaque-opaque or none".into()),
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_numbers_are_validated() {
        assert_eq!(size("512x256").unwrap(), [512, 256]);
        for bad in ["512", "0x5", "512x", "9999x512", "axb"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        assert_eq!(camera("-30, 20").unwrap(), [-30.0, 20.0]);
        for bad in ["1", "1,2,3", "1,x", "1,nan", "1,,2"] {
            assert!(camera(bad).is_err(), "{bad}");
        }
        assert_eq!(lens("off"), Ok(LensArgument::Off));
        for bad in ["1,2,3", "1,2,3,-4", "1,2,3,0", "on"] {
            assert!(lens(bad).is_err(), "{bad}");
        }
        for bad in ["nan", "-1", "86", ""] {
            assert_eq!(within(0.0..=85.0)(bad), Err("0 to 85".into()), "{bad}");
        }
        assert!(above_zero(100.0)("0").is_err() && above_zero(100.0)("0.5").is_ok());
        assert!(clip("sideways=3").unwrap_err().contains("right"));
        assert_eq!(clip("left=3").unwrap().offset_mm, -3.0);
    }

    #[test]
    fn transfer_functions_are_presets_or_files() {
        for preset in TransferPreset::VARIANTS {
            assert_eq!(transfer(preset.into()), Ok(TransferArgument::Preset(*preset)));
        }
        assert_eq!(transfer("a/b.JSON"), Ok(TransferArgument::File("a/b.JSON".into())));
        for bad in ["", "mr", "a.toml", "json"] {
            let expected = transfer(bad).unwrap_err();
            assert!(expected.contains("ct-vessel-shapes, pet-shapes or a file .json"), "{expected}");
        }
    }

    #[test]
    fn darkens_parses_pairs() {
        let found = darkens("image-image, opaque-opaque").unwrap();
        assert!(found.image_on_image && found.opaque_on_opaque);
        assert!(!found.opaque_on_image && !found.image_on_opaque);
        assert_eq!(darkens("solid-image").unwrap(), darkens("opaque-image").unwrap());
        assert_eq!(darkens("none").unwrap(), MutualOcclusion::NONE);
        assert!(darkens("tube-image").is_err());
    }
}
