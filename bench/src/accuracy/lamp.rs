//! The context view in the light of a placed lamp, compared with the exact integral of the same light.

use glam::DVec3;
use glioscope_core::optics::{Ray, march::converged, monte_carlo::Estimate};
use glioscope_render::{Lamp, LightSettings, LightingMode, Quality, TransferPreset, light};

use super::{
    Axis, Bench, Curve, Defaults, Family,
    light::{Settings, Truth, measure_points, preset_of},
    scenes,
};
use crate::Outcome;

pub(super) const FAMILY: Family = Family {
    name: "lamp",
    title: "Half-angle slices and shadow volume of the context view, and their presets",
    about: "The context view as the window draws it in the light of a lamp, unlit tissue fully black, compared at a sample \
            of its pixels with the integral of single scattering of the same light, by marches whose steps are halved until \
            nothing changes by more than 0.001. Slabs and texels of the light's buffer are equally fine along the path of \
            half-angle slicing, cells are along that of the shadow volume; towards lower cost the paths reduce the resolution, too.",
    defaults: Defaults::Presets,
    curves,
};

/// Where the lamp stands: at the upper left, beside the scene, behind it.
const LAMPS: [(&str, [f64; 2]); 3] = [
    ("upper left", [-45.0, 45.0]),
    ("right, 95 degrees", [95.0, 0.0]),
    ("behind, 140 degrees", [140.0, 0.0]),
];

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let size = bench.effort.of([48, 48], [96, 96], [256, 256]);
    let count = bench.effort.of(40, 150, 700);
    let presets: &[TransferPreset] = bench.effort.of(
        &[TransferPreset::MrSurface],
        &[TransferPreset::MrSurface],
        &[TransferPreset::MrSurface, TransferPreset::MrTissue],
    );
    let lamps = bench.effort.of(1, 1, LAMPS.len());
    let costs: &[f64] =
        bench.effort.of(&[0.03], &[0.03, 0.125, 1.0], &[0.015, 0.03, 0.06, 0.125, 0.25, 0.5, 1.0, 2.0]);
    let image = scenes::phantom_image()?;
    let mut out = Vec::new();
    for preset in presets {
        let scene = scenes::head(&image, *preset);
        for (place, [azimuth_deg, elevation_deg]) in LAMPS.into_iter().take(lamps) {
            let lamp = Lamp { azimuth_deg, elevation_deg, ..Lamp::DEFAULT };
            let towards = lamp.direction(&scene.camera);
            bench.begin("lamp: exact integral", place);
            let truth = Truth::of(&scene, size, count, |medium, ray, _| {
                let light = |at_mm: DVec3| {
                    let ray = Ray { origin_mm: at_mm, direction: towards };
                    (-medium.thickness(&ray, f64::INFINITY)).exp()
                };
                let mean = converged(medium, ray, 1.0, 1e-3, &light, DVec3::ZERO).radiance;
                Estimate { mean, standard_error: DVec3::ZERO }
            })?;
            for mode in [LightingMode::HalfAngle, LightingMode::ShadowVolume] {
                let on_path = |cost: f64| {
                    let quality = light::at_cost(mode, cost);
                    let name = preset_of(&quality).map(|preset| preset.name().to_owned());
                    (name.unwrap_or_else(|| format!("cost {cost}")), (cost, lit(quality, lamp)))
                };
                let most = light::row(mode).most_cost;
                let settings: Settings = costs.iter().copied().chain([most]).map(on_path).collect();
                let points = measure_points(bench, mode.name(), &settings, &scene, size, &truth)?;
                out.push(Curve {
                    family: FAMILY.name,
                    kernel: format!("{}, lamp {place}", mode.name()),
                    scene: format!(
                        "head phantom T1c, {}, {}x{} pixels requested, {} of them evaluated",
                        preset.name(),
                        size[0],
                        size[1],
                        truth.pixels.len()
                    ),
                    knob: "light::at_cost",
                    truth: "single scattering by marches with steps halved until they change nothing by more than 0.001"
                        .to_owned(),
                    truth_error: None,
                    unit: "linear radiance, 0 to 1",
                    axis: Axis::Time,
                    points,
                });
            }
        }
    }
    Ok(out)
}

fn lit(quality: Quality, lamp: Lamp) -> Quality {
    Quality { lighting: LightSettings { lamp, ..quality.lighting }, ..quality }
}
