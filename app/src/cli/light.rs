//! What was typed about light.

use glioscope_render::{Lighting, Mutual, Preset, Quality, Shading, dos::Variant};

use super::{Failure, arguments::LightArguments, render::wrong};
use crate::document::Light;

/// The one that a text names.
fn named<T: Copy>(option: &str, text: &str, all: &[(&str, T)]) -> Result<T, Failure> {
    let names: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
    let found = all.iter().find(|(name, _)| *name == text).map(|(_, value)| *value);
    found.ok_or_else(|| wrong(option, text, &format!("one of {}", names.join(", "))))
}

fn mutual(text: &str) -> Result<Mutual, Failure> {
    let mut out =
        Mutual { image_on_image: false, solid_on_image: false, image_on_solid: false, solid_on_solid: false };
    for name in text.split(',').map(str::trim).filter(|name| *name != "none") {
        match name {
            "image-image" => out.image_on_image = true,
            "solid-image" => out.solid_on_image = true,
            "image-solid" => out.image_on_solid = true,
            "solid-solid" => out.solid_on_solid = true,
            other => {
                let expected = "image-image, solid-image, image-solid, solid-solid or none";
                return Err(wrong("darkens", other, expected));
            }
        }
    }
    Ok(out)
}

/// The light that the arguments ask for.
///
/// # Errors
/// [`Failure`] that names option, found and expected.
pub(super) fn light(arguments: &LightArguments) -> Result<Light, Failure> {
    let mut light = Light::default();
    if let Some(text) = &arguments.light {
        light.shading = named("light", text, &Shading::ALL.map(|s| (s.name(), s)))?;
    }
    if let Some(text) = &arguments.quality {
        light.preset = Some(named("quality", text, &Preset::ALL.map(|p| (p.name(), p)))?);
    }
    if let Some(degrees) = arguments.aperture {
        if !(0.0..=85.0).contains(&degrees) {
            return Err(wrong("aperture", &degrees.to_string(), "0 to 85"));
        }
        light.aperture_deg = degrees;
    }
    let LightArguments { slices, footprint, slice_mm, darkens, .. } = arguments;
    if slices.is_none() && footprint.is_none() && slice_mm.is_none() && darkens.is_none() {
        return Ok(light);
    }
    let preset = light.preset.unwrap_or(Preset::Reference);
    let mut own =
        Lighting { aperture_deg: light.aperture_deg, ..Quality::preset(light.shading, preset).lighting };
    if let Some(text) = slices {
        let all = [
            ("mended", Variant::Mended),
            ("paper", Variant::PaperApproximate),
            ("paper-exact", Variant::PaperExact),
        ];
        own.variant = named("slices", text, &all)?;
    }
    if let Some(n) = *footprint {
        if !(1..=13).contains(&n) {
            return Err(wrong("footprint", &n.to_string(), "1 to 13"));
        }
        own.slice_grid = n;
    }
    if let Some(mm) = *slice_mm {
        if !(mm > 0.0 && mm <= 100.0) {
            return Err(wrong("slice-mm", &mm.to_string(), "above 0, at most 100"));
        }
        own.slice_mm = mm;
    }
    if let Some(text) = darkens {
        own.mutual = mutual(text)?;
    }
    light.own = Some(own);
    Ok(light)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_is_checked_and_kept() {
        let typed = |light: &str, darkens: Option<&str>| LightArguments {
            light: Some(light.into()),
            darkens: darkens.map(Into::into),
            ..LightArguments::default()
        };
        let found = light(&typed("slices", Some("image-image, solid-solid"))).unwrap();
        let own = found.own.unwrap();
        assert_eq!((found.shading, own.shading), (Shading::Slices, Shading::Slices));
        assert!(own.mutual.image_on_image && own.mutual.solid_on_solid);
        assert!(!own.mutual.solid_on_image && !own.mutual.image_on_solid);
        assert_eq!(light(&LightArguments::default()).unwrap(), Light::default());
        for bad in [typed("lamp", None), typed("slices", Some("tube-image"))] {
            assert!(light(&bad).is_err());
        }
        for aperture in [-1.0, 86.0, f64::NAN] {
            let e = light(&LightArguments { aperture: Some(aperture), ..LightArguments::default() });
            assert!(e.unwrap_err().0.contains("0 to 85"));
        }
    }
}
