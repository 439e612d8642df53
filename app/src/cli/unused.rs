//! Options of `render` that change nothing in the view drawn.

use glioscope_render::{Knob, LightingMode, light};

use super::{
    arguments::{LightArguments, RenderArguments},
    parse::View,
};
use crate::model::{LightChoice, PaneId};

/// The options given that have no effect on the view, as they are typed.
pub(super) fn without_effect(arguments: &RenderArguments) -> Vec<&'static str> {
    use PaneId::{Axial, Change, Closeup, Context, Coronal, Dates, Ellipsoids, Sagittal, Transfer};
    let View::Pane(pane) = arguments.view else { return Vec::new() };
    let a = arguments;
    let light = &a.light;
    let views_3d: &[PaneId] = &[Closeup, Context, Ellipsoids, Change];
    // Slices of light are left out where no image is drawn.
    let with_image: &[PaneId] = &[Context, Change];
    // Slices take a lamp's light through the image, cones to masks, too; geometry known by its depths alone keeps the eye's. A
    // headlight's gradients are the image's.
    let with_lamp: &[PaneId] = match light.light {
        Some(LightingMode::Slices) => with_image,
        Some(mode) if light::row(mode).is_headlight() => with_image,
        Some(LightingMode::Cones) => &[Closeup, Context, Change],
        _ => views_3d,
    };
    let slices: &[PaneId] = &[Axial, Coronal, Sagittal];
    let compared: &[PaneId] =
        if a.changed_rim { &[Change, Dates, Axial, Coronal, Sagittal] } else { &[Change, Dates] };
    let table = [
        ("--camera", a.camera.is_some(), views_3d),
        ("--orthographic", a.orthographic, views_3d),
        ("--zoom", a.zoom.is_some(), views_3d),
        ("--light", light.light.is_some(), views_3d),
        ("--quality", light.quality.is_some(), views_3d),
        ("--aperture", light.aperture.is_some(), views_3d),
        ("--lamp", light.lamp.is_some(), with_lamp),
        ("--lamp-frame", light.lamp_frame.is_some(), with_lamp),
        ("--lamp-share", light.lamp_share.is_some(), views_3d),
        ("--lamp-radius", light.lamp_radius.is_some(), views_3d),
        ("--paths", light.paths.is_some(), views_3d),
        ("--bounces", light.bounces.is_some(), views_3d),
        ("--anisotropy", light.anisotropy.is_some(), with_image),
        ("--slices", light.slices.is_some(), with_image),
        ("--footprint", light.footprint.is_some(), with_image),
        ("--slice-mm", light.slice_mm.is_some(), with_image),
        ("--tissue-bleeding", light.tissue_bleeding.is_some(), with_image),
        ("--tissue-shading", light.tissue_shading.is_some(), with_image),
        ("--darkens", light.darkens.is_some(), views_3d),
        ("--occlusion-mm", light.occlusion_mm.is_some(), views_3d),
        ("--ambient", light.ambient.is_some(), views_3d),
        ("--relief", light.relief.is_some(), &[Closeup]),
        ("--smooth", light.smooth, &[Closeup]),
        ("--vicinity-mm", light.vicinity_mm.is_some(), views_3d),
        ("--vicinity-samples", light.vicinity_samples.is_some(), views_3d),
        ("--slice-plane", a.slice_plane, &[Closeup, Ellipsoids]),
        ("--plain", a.plain, &[Closeup]),
        ("--transfer", a.transfer.is_some(), &[Context, Transfer]),
        ("--clip", !a.clips.is_empty(), &[Context]),
        ("--fibre-colour", a.fibre_colour.is_some(), &[Context]),
        ("--fibre-radius", a.fibre_radius.is_some(), &[Context]),
        ("--fibre-smooth", a.fibre_smooth.is_some(), &[Context]),
        ("--moment", a.moment, &[Ellipsoids]),
        ("--ellipsoid-opacity", a.ellipsoid_opacity.is_some(), &[Ellipsoids]),
        ("--hide-below", a.hide_below.is_some(), &[Ellipsoids]),
        ("--style", a.style.is_some(), &[Change]),
        ("--threshold", a.threshold.is_some(), &[Change]),
        ("--scale-mm", a.scale_mm.is_some(), &[Change]),
        ("--earlier-outline", a.earlier_outline, &[Change]),
        ("--of", a.of.is_some(), compared),
        ("--from", a.from.is_some(), compared),
        ("--to", a.to.is_some(), compared),
        ("--changed-rim", a.changed_rim, slices),
        ("--neurological", a.neurological, slices),
        ("--slice-axes", a.slice_axes.is_some(), slices),
        (
            "--second",
            a.second.is_some(),
            if a.second_in_context { &[Axial, Coronal, Sagittal, Context] } else { slices },
        ),
        ("--second-in-context", a.second_in_context, &[Context]),
        ("--overlay", a.overlay.is_some(), slices),
        ("--outline-patterns", a.outline_patterns, slices),
    ];
    let unused = table.into_iter().filter(|(_, given, of)| *given && !of.contains(&pane));
    unused.map(|(option, ..)| option).collect()
}

/// The options of light given that have no effect in the lighting mode of `choice`, as they are typed.
pub(super) fn without_effect_on_light(arguments: &LightArguments, choice: &LightChoice) -> Vec<&'static str> {
    let a = arguments;
    let row = light::row(choice.mode);
    let has = |knob: Knob| row.knobs.contains(&knob);
    let table = [
        ("--aperture", a.aperture.is_some(), row.has_aperture),
        ("--lamp", a.lamp.is_some(), row.has_lamp || row.turns_to_lamp()),
        ("--lamp-frame", a.lamp_frame.is_some(), row.has_lamp || row.turns_to_lamp()),
        ("--lamp-share", a.lamp_share.is_some(), has(Knob::LampShare)),
        ("--lamp-radius", a.lamp_radius.is_some(), has(Knob::LampRadiusDeg)),
        ("--paths", a.paths.is_some(), has(Knob::Paths)),
        ("--bounces", a.bounces.is_some(), has(Knob::Bounces)),
        ("--anisotropy", a.anisotropy.is_some(), has(Knob::Anisotropy)),
        ("--occlusion-mm", a.occlusion_mm.is_some(), choice.has_ambient_occlusion()),
        ("--smooth", a.smooth, row.lights_smooth),
        ("--vicinity-mm", a.vicinity_mm.is_some(), choice.has_vicinity()),
        ("--vicinity-samples", a.vicinity_samples.is_some(), choice.has_vicinity()),
        ("--slices", a.slices.is_some(), choice.mode == LightingMode::Slices),
        ("--footprint", a.footprint.is_some(), choice.mode == LightingMode::Slices),
        ("--slice-mm", a.slice_mm.is_some(), has(Knob::SliceMm)),
        ("--sky-order", a.sky_order.is_some(), has(Knob::SkyOrder)),
        ("--sky-directions", a.sky_directions.is_some(), has(Knob::SkyDirections)),
        ("--sky-share", a.sky_share.is_some(), has(Knob::SkyShare)),
        ("--clusters", a.clusters.is_some(), has(Knob::Clusters)),
        ("--tissue-bleeding", a.tissue_bleeding.is_some(), has(Knob::TissueBleeding)),
        ("--tissue-shading", a.tissue_shading.is_some(), has(Knob::TissueShading)),
        ("--cell-mm", a.cell_mm.is_some(), has(Knob::CellMm)),
        ("--sub-cones", a.sub_cones.is_some(), has(Knob::SubCones)),
    ];
    let unused = table.into_iter().filter(|(_, given, has_effect)| *given && !has_effect);
    unused.map(|(option, ..)| option).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Task};
    use clap::Parser;

    fn unused(view: &str, options: &[&str]) -> Vec<&'static str> {
        let words = ["glioscope", "render", "--view", view].into_iter().chain(options.iter().copied());
        let Some(Task::Render(arguments)) = Cli::try_parse_from(words).unwrap().task else { panic!() };
        without_effect(&arguments)
    }

    #[test]
    fn options_are_unused_where_their_view_is_not_drawn() {
        let options = ["--camera", "30,10", "--light", "cones", "--overlay", "fill", "--moment"];
        assert_eq!(unused("axial", &options), ["--camera", "--light", "--moment"]);
        assert_eq!(unused("ellipsoids", &options), ["--overlay"]);
        assert_eq!(unused("closeup", &["--light", "slices", "--footprint", "3"]), ["--footprint"]);
        assert_eq!(unused("window", &options), [""; 0]);
        let lamp = |mode| ["--light", mode, "--lamp", "30,10"];
        assert_eq!(unused("closeup", &lamp("slices")), ["--lamp"]);
        assert_eq!(unused("ellipsoids", &lamp("cones")), ["--lamp"]);
        assert_eq!(unused("closeup", &lamp("cones")), [""; 0]);
        assert_eq!(unused("ellipsoids", &lamp("half-angle")), [""; 0]);
        let dates = ["--from", "a", "--to", "b"];
        assert_eq!(unused("axial", &dates), ["--from", "--to"]);
        assert_eq!(unused("dates", &dates), [""; 0]);
        assert_eq!(unused("axial", &["--from", "a", "--changed-rim"]), [""; 0]);
        assert_eq!(unused("overlap", &["--changed-rim"]), ["--changed-rim"]);
    }
    #[test]
    fn options_of_light_are_unused_in_other_lighting_modes() {
        let unused = |mode, arguments: &LightArguments| {
            without_effect_on_light(arguments, &LightChoice { mode, ..LightChoice::default() })
        };
        let aperture =
            LightArguments { aperture: Some(20.0), vicinity_mm: Some(2.0), ..LightArguments::default() };
        assert_eq!(unused(LightingMode::Traced, &aperture), ["--aperture", "--vicinity-mm"]);
        assert_eq!(unused(LightingMode::Cones, &aperture), ["--vicinity-mm"]);
        assert_eq!(unused(LightingMode::Slices, &aperture), [""; 0]);
        let occlusion = LightArguments { occlusion_mm: Some(5.0), smooth: true, ..LightArguments::default() };
        assert_eq!(unused(LightingMode::Cones, &occlusion), ["--occlusion-mm", "--smooth"]);
        assert_eq!(unused(LightingMode::Horizon, &occlusion), [""; 0]);
        let lamp = LightArguments {
            lamp: Some([10.0, 20.0]),
            slice_mm: Some(1.0),
            aperture: Some(20.0),
            occlusion_mm: Some(3.0),
            smooth: true,
            ..LightArguments::default()
        };
        assert_eq!(unused(LightingMode::HalfAngle, &lamp), ["--aperture", "--occlusion-mm"]);
        // A headlight may be at a lamp's place.
        assert_eq!(unused(LightingMode::Traced, &lamp), ["--aperture", "--slice-mm"]);
        assert_eq!(unused(LightingMode::Cones, &lamp), ["--occlusion-mm", "--smooth", "--slice-mm"]);
        assert_eq!(unused(LightingMode::Slices, &lamp), ["--occlusion-mm"]);
        let cells = LightArguments {
            cell_mm: Some(3.0),
            sky_order: Some(2),
            clusters: Some(9),
            sub_cones: Some(4),
            slice_mm: None,
            smooth: false,
            occlusion_mm: None,
            ..lamp
        };
        let rest = ["--sky-order", "--clusters", "--cell-mm", "--sub-cones"];
        assert_eq!(unused(LightingMode::HalfAngle, &cells), [&["--aperture"], &rest[..]].concat());
        assert_eq!(
            unused(LightingMode::ShadowVolume, &cells),
            ["--aperture", "--sky-order", "--clusters", "--sub-cones"]
        );
        assert_eq!(unused(LightingMode::SphericalHarmonics, &cells), ["--clusters", "--sub-cones"]);
        let dynamic = ["--aperture", "--lamp", "--sky-order", "--sub-cones"];
        assert_eq!(unused(LightingMode::DynamicAmbient, &cells), dynamic);
        assert_eq!(unused(LightingMode::Cones, &cells), ["--sky-order", "--clusters"]);
        let paths = LightArguments {
            paths: Some(64),
            lamp_share: Some(0.5),
            lamp: Some([0.0; 2]),
            ..LightArguments::default()
        };
        assert_eq!(unused(LightingMode::PathTraced, &paths), [""; 0]);
        assert_eq!(unused(LightingMode::HalfAngle, &paths), ["--lamp-share", "--paths"]);
    }
}
