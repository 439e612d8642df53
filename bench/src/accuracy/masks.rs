//! Directional light on masks in the closeup, by cones and by vicinity occlusion, compared with a Monte Carlo estimate
//! for the same cone among opaque voxels.

use std::time::Duration;

use glam::{DVec2, DVec3};
use glioscope_core::optics::{
    monte_carlo::{Estimate, Phase, radiance},
    random::Random,
    srgb,
    volume::{Filter, OpticalVolume, Table},
};
use glioscope_render::{
    CloseupRenderer, LightSettings, LightingMode, Preset, Quality, RegionScene, light::preset,
};
use rayon::prelude::*;
use strum::VariantArray;

use super::{Axis, Bench, Curve, Defaults, Effort, Family, Point, errors::Errors, scenes, sweep::Sweep};
use crate::Outcome;

pub(super) const FAMILY: Family = Family {
    name: "masks",
    title: "Directional light on masks",
    about: "Fraction of the light from the cone around the direction to the eye that reaches each voxel face of the \
            closeup. Cones are traced through the selected regions: with many of them the remaining error is the \
            8-bit rounding of the stored occlusion. Slices use vicinity occlusion nearby and layers from afar, as do \
            cones where a view has no medium for them: both read only the depth buffer, so more points can't remove \
            their error. Points of the presets of both modes are marked; masks had little weight \
            in the choice of the presets.",
    defaults: Defaults::Presets,
    curves,
};

/// The masks as a medium: every voxel of a region is opaque and white.
fn medium(scene: &RegionScene) -> Outcome<OpticalVolume> {
    let tumor = scene.tumor.as_ref().ok_or("a closeup without masks")?;
    let label = |linear| if tumor.id(linear) == 0 { 0.0 } else { 1.0 };
    let values = (0..tumor.grid().voxel_count()).map(label).collect();
    let table =
        Table::of_labels(&[[0.0; 4], [1.0, 1.0, 1.0, f32::INFINITY]]).ok_or("an invalid transfer table")?;
    let volume = OpticalVolume::new(tumor.grid().clone(), values, table, Filter::Nearest, None);
    Ok(volume.ok_or("labels that don't fit their grid")?)
}

/// Monte Carlo estimate of the light at every `stride`-th pixel that shows a mask, with the pixel's index.
fn truth(scene: &RegionScene, size: [u32; 2], stride: u32, samples: u32) -> Outcome<Vec<(usize, Estimate)>> {
    let medium = medium(scene)?;
    let phase = Phase::Cone { aperture_deg: LightSettings::DEFAULT.aperture_deg };
    let size_px = DVec2::new(f64::from(size[0]), f64::from(size[1]));
    let along = |length: u32| (stride / 2..length).step_by(stride as usize);
    let pixels: Vec<[u32; 2]> = along(size[1]).flat_map(|y| along(size[0]).map(move |x| [x, y])).collect();
    let estimate = |[x, y]: [u32; 2]| {
        let ray = scene.camera.ray(DVec2::new(f64::from(x), f64::from(y)) + 0.5, size_px);
        let number = y as usize * size[0] as usize + x as usize;
        let mut random = Random::new(4, number as u64);
        (number, radiance(&medium, &ray, phase, DVec3::ZERO, samples, &mut random))
    };
    // Voxels are white and opaque: the radiance is the light that reaches the first face.
    Ok(pixels.into_par_iter().map(estimate).filter(|(_, e)| e.mean.x > 0.0).collect())
}

/// Settings by name.
type Settings = Vec<(String, (f64, LightSettings))>;

/// Settings to measure, by kernel and knob.
fn settings(effort: Effort) -> Vec<(&'static str, &'static str, Settings)> {
    let cones = LightSettings { mode: LightingMode::Cones, ..LightSettings::DEFAULT };
    // With slices, masks without an image are lit by vicinity occlusion and layers.
    let vicinity = LightSettings { mode: LightingMode::Slices, ..LightSettings::DEFAULT };
    let counts: &[u32] = effort.of(&[1, 16], &[2, 8, 32], &[1, 2, 4, 6, 8, 16, 32, 64, 128]);
    let levels: &[u32] = effort.of(&[0], &[3, 1], &[5, 3, 2, 1, 0]);
    let mut out = Vec::new();
    let level_name = |level: u32| if level == 0 { "voxels".to_owned() } else { format!("levels to {level}") };
    let mut cone_settings: Settings = Vec::new();
    for &coarsest_level in levels {
        for &sub_cones in counts {
            let light = LightSettings { sub_cones, coarsest_level, ..cones };
            let name = format!("{sub_cones} sub-cones, {}", level_name(coarsest_level));
            cone_settings.push((name, (f64::from(sub_cones), light)));
        }
    }
    out.push(("cones", "LightSettings::sub_cones and coarsest_level", cone_settings));
    let points: &[u32] = effort.of(&[4, 64], &[8, 64], &[1, 2, 4, 8, 16, 32, 64, 118]);
    let reaches: &[f64] = effort.of(&[3.0][..], &[3.0], &[1.0, 3.0, 6.0]);
    let mut vicinity_settings: Settings = Vec::new();
    for &vicinity_mm in reaches {
        for &vicinity_samples in points {
            let light = LightSettings { vicinity_samples, vicinity_mm, ..vicinity };
            let name = format!("{vicinity_samples} points, {vicinity_mm} mm");
            vicinity_settings.push((name, (f64::from(vicinity_samples), light)));
        }
    }
    out.push(("vicinity", "LightSettings::vicinity_samples and vicinity_mm", vicinity_settings));
    let sides: &[f64] = effort.of(&[1.0, 4.0], &[1.0, 2.0, 4.0], &[1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0]);
    let thick_mm: &[f64] = effort.of(&[1.0][..], &[1.0], &[0.5, 1.0]);
    let mut layer_settings: Settings = Vec::new();
    for &slice_mm in thick_mm {
        for &layer_cell in sides {
            let light = LightSettings { layer_cell, slice_mm, ..vicinity };
            layer_settings.push((format!("cells {layer_cell}, layers {slice_mm} mm"), (layer_cell, light)));
        }
    }
    out.push(("layers", "LightSettings::layer_cell and slice_mm", layer_settings));
    // Presets replace equal settings, so that each is measured under the preset's name.
    for (at, mode) in [LightingMode::Cones, LightingMode::Slices].into_iter().enumerate() {
        for of in Preset::VARIANTS {
            let light = preset(mode, *of).lighting;
            let kernel_settings = &mut out[at].2;
            let value = f64::from(if at == 0 { light.sub_cones } else { light.vicinity_samples });
            kernel_settings.retain(|(_, (_, other))| !is_same(other, &light));
            kernel_settings.push((of.name().to_owned(), (value, light)));
        }
    }
    out
}

/// Whether two settings light masks without an image identically.
fn is_same(a: &LightSettings, b: &LightSettings) -> bool {
    let on_masks = |l: &LightSettings| match l.mode {
        LightingMode::Cones => (l.sub_cones, l.coarsest_level, l.cone_step, 0.0),
        // Layers are a third of the vicinity's distance thick at most.
        _ => (l.vicinity_samples, 0, l.vicinity_mm, l.slice_mm.min(l.vicinity_mm / 3.0)),
    };
    let cells = a.mode == LightingMode::Cones || a.layer_cell == b.layer_cell;
    a.mode == b.mode && cells && on_masks(a) == on_masks(b)
}

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let size = bench.effort.of([40, 40], [96, 96], [192, 192]);
    let (stride, samples) = bench.effort.of((2, 256), (3, 1024), (4, 4096));
    let scene = scenes::phantom_closeup()?;
    bench.begin("masks", "Monte Carlo");
    let truth = truth(&scene, size, stride, samples)?;
    let truth_error = Errors::of(truth.iter().map(|(_, e)| e.standard_error.x)).rms();
    let mut out = Vec::new();
    for (kernel, knob, settings) in settings(bench.effort) {
        let sweep = Sweep {
            label: &format!("masks: {kernel}"),
            rounds: bench.effort.of(1, 2, 5),
            time_budget: Duration::from_millis(2500),
            on_device: true,
        };
        let run = |renderer: &mut CloseupRenderer, (_, lighting): &(f64, LightSettings)| {
            // Full strength: unlit surfaces are black, as in the truth.
            let quality = Quality { lighting: *lighting, occlusion_strength: 1.0, ..Quality::FULL };
            renderer.render(bench.gpu, &scene, &quality, size)?;
            Ok(bench.gpu.wait()?)
        };
        let evaluate = |renderer: &mut CloseupRenderer, (value, lighting): &(f64, LightSettings)| {
            let found = renderer.frame().ok_or("no frame was drawn")?.occlusion(bench.gpu)?;
            let error = |(number, estimate): &(usize, Estimate)| {
                // Occlusion is stored gamma-encoded, as it is displayed.
                let light = found.dark.get(*number).map_or(f64::NAN, |dark| srgb::decode(1.0 - dark));
                light - estimate.mean.x
            };
            let errors = Errors::of(truth.iter().map(error));
            let of = |p: &&Preset| is_same(&preset(lighting.mode, **p).lighting, lighting);
            let is_default = Preset::VARIANTS.iter().any(|p| of(&p));
            Ok(Point { is_default, ..Point::new(*value, &errors) })
        };
        out.push(Curve {
            family: FAMILY.name,
            kernel: kernel.to_owned(),
            scene: format!("head phantom's tumour, {}x{} pixels", size[0], size[1]),
            knob,
            truth: format!(
                "Monte Carlo, cone of {} degrees among opaque voxels, {samples} samples at each of {} pixels",
                LightSettings::DEFAULT.aperture_deg,
                truth.len()
            ),
            truth_error: Some(truth_error),
            unit: "fraction of light, 0 to 1",
            axis: Axis::Time,
            points: bench.sweep(&sweep, &mut CloseupRenderer::new(bench.gpu)?, &settings, run, evaluate)?,
        });
    }
    Ok(out)
}
