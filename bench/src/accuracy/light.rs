//! Lighting of the context view, along the path of its presets and off it, compared with Monte Carlo at a sample of its
//! pixels.

use std::time::Duration;

use glam::{DVec2, DVec3};
use glioscope_core::optics::{
    Ray,
    medium::Medium,
    monte_carlo::{Estimate, Phase, radiance},
    random::Random,
};
use glioscope_render::{
    ContextRenderer, ContextScene, Gpu, LightSettings, LightingMode, Preset, Quality, SliceVariant,
    TransferPreset, light,
};
use rayon::prelude::*;
use strum::VariantArray;

use super::{
    Axis, Bench, Curve, Defaults, Effort, Family, Point,
    errors::{Errors, delta_e_of, displayed},
    scenes,
    sweep::Sweep,
};
use crate::Outcome;

pub(super) const FAMILY: Family = Family {
    name: "light",
    title: "Lighting of the context view and its presets",
    about: "The context view as the window draws it, but with unlit tissue fully black, compared with Monte Carlo at a \
            sample of its pixels. The path contains the presets draft, balanced and reference; the automatic quality \
            moves along it. Settings off the path (kernels \"beside the path\") combine resolutions with slice \
            thicknesses or cell sizes, from which the path was chosen, or change one parameter of draft or balanced. \
            Where surfaces are opaque, slices of 1 mm have half the error of 2 mm; slices of 0.7 mm, the reference, \
            reduce it by another twentieth; thinner slices don't reduce it further, nor do more than 2x2 points per \
            footprint. Towards lower cost the path first reduces the resolution, to a fifth along each side, and \
            makes slices slightly thicker. \
            Cones are faster and also light opaque geometry; slices are more accurate where surfaces are opaque. \
            The paper's own slices are plotted for comparison: their penumbra depends on the number of slices, so \
            more slices aren't more accurate. Screen-space light is a different model and isn't compared with Monte \
            Carlo.",
    defaults: Defaults::Presets,
    curves,
};

/// A frame of linear radiance and opacity, drawn at `size`, which may be smaller than requested.
struct DrawnFrame {
    size: [u32; 2],
    pixels: Vec<[f64; 4]>,
}

impl DrawnFrame {
    /// Value at a pixel of the requested size, bilinearly interpolated.
    fn at(&self, pixel: [u32; 2], requested: [u32; 2]) -> [f64; 4] {
        let position: [f64; 2] = std::array::from_fn(|a| {
            let x = (f64::from(pixel[a]) + 0.5) / f64::from(requested[a]) * f64::from(self.size[a]) - 0.5;
            x.clamp(0.0, f64::from(self.size[a] - 1))
        });
        let mut out = [0.0; 4];
        for corner in 0..4u32 {
            let mut weight = 1.0;
            let at: [u32; 2] = std::array::from_fn(|a| {
                let up = corner >> a & 1;
                weight *= if up == 1 { position[a].fract() } else { 1.0 - position[a].fract() };
                (position[a] as u32 + up).min(self.size[a] - 1)
            });
            let found = self.pixels.get((at[1] * self.size[0] + at[0]) as usize).copied().unwrap_or_default();
            out.iter_mut().zip(found).for_each(|(o, f)| *o += weight * f);
        }
        out
    }
}

/// A random but reproducible sample of pixels, with their Monte Carlo estimates.
pub(super) struct Truth {
    pub pixels: Vec<([u32; 2], Estimate)>,
    standard_error: f64,
}

impl Truth {
    /// `estimate` gives the radiance of a ray through the image, which has this number.
    pub fn of(
        scene: &ContextScene,
        size: [u32; 2],
        count: usize,
        estimate: impl Fn(&dyn Medium, &Ray, u64) -> Estimate + Sync,
    ) -> Outcome<Self> {
        let medium = scene.medium().ok_or("the image can't be converted to a medium")?;
        let size_px = DVec2::new(f64::from(size[0]), f64::from(size[1]));
        let ray_of =
            |[x, y]: [u32; 2]| scene.camera.ray(DVec2::new(f64::from(x), f64::from(y)) + 0.5, size_px);
        let mut random = Random::new(11, 0);
        let mut sampled = Vec::new();
        for _ in 0..50 * count {
            let pixel = size.map(|s| ((random.unit() * f64::from(s)) as u32).min(s - 1));
            // Empty pixels would dilute the error.
            if medium.thickness(&ray_of(pixel), f64::INFINITY) > 0.02 {
                sampled.push(pixel);
            }
            if sampled.len() == count {
                break;
            }
        }
        let of_pixel = |(i, pixel): (usize, [u32; 2])| (pixel, estimate(&medium, &ray_of(pixel), i as u64));
        let pixels: Vec<([u32; 2], Estimate)> = sampled.into_par_iter().enumerate().map(of_pixel).collect();
        let errors = pixels.iter().flat_map(|(_, e)| e.standard_error.to_array());
        let standard_error = Errors::of(errors).rms();
        Ok(Self { pixels, standard_error })
    }
}

/// Settings of a lighting mode off the path of its presets, from which the path was chosen.
fn off_path(mode: LightingMode, effort: Effort) -> Vec<(String, Quality)> {
    let balanced = light::preset(mode, Preset::Balanced);
    let mut out = Vec::new();
    let mut add = |base: Quality, name: String, change: &dyn Fn(&mut LightSettings)| {
        let mut quality = base;
        change(&mut quality.lighting);
        out.push((name, quality));
    };
    // Resolution combined with the other knob that most affects the time.
    for &scale in effort.of(&[][..], &[], &[0.4, 1.0]) {
        let base = Quality { resolution_scale: scale, ..balanced };
        match mode {
            LightingMode::ScreenSpace
            | LightingMode::Horizon
            | LightingMode::Traced
            | LightingMode::HalfAngle
            | LightingMode::ShadowVolume
            | LightingMode::SphericalHarmonics
            | LightingMode::DynamicAmbient
            | LightingMode::PathTraced
            | LightingMode::DepthDarkening
            | LightingMode::VicinityMap => {}
            LightingMode::Slices => {
                for mm in [4.0, 2.0, 1.4, 1.0, 0.7, 0.5] {
                    add(base, format!("pixels {scale}, {mm} mm"), &|l| l.slice_mm = mm);
                }
            }
            LightingMode::Cones => {
                for mm in [12.0, 8.0, 4.0, 2.0] {
                    add(base, format!("pixels {scale}, cells of {mm} mm"), &|l| l.cell_mm = mm);
                }
            }
        }
    }
    if effort < Effort::Whole {
        return out;
    }
    // Presets with one knob changed.
    for preset in [Preset::Draft, Preset::Balanced] {
        let (base, name) = (light::preset(mode, preset), preset.name());
        let is_draft = preset == Preset::Draft;
        match mode {
            LightingMode::ScreenSpace
            | LightingMode::Horizon
            | LightingMode::Traced
            | LightingMode::HalfAngle
            | LightingMode::ShadowVolume
            | LightingMode::SphericalHarmonics
            | LightingMode::DynamicAmbient
            | LightingMode::PathTraced
            | LightingMode::DepthDarkening
            | LightingMode::VicinityMap => {}
            LightingMode::Slices => {
                for grid in [3, 5] {
                    add(base, format!("{name}, footprint {grid}x{grid}"), &|l| l.slice_grid = grid);
                }
                for mm in [1.0, 1.7].into_iter().filter(|_| is_draft) {
                    add(base, format!("{name}, {mm} mm"), &|l| l.slice_mm = mm);
                }
            }
            LightingMode::Cones => {
                for cones in if is_draft { vec![2, 4] } else { vec![2, 4, 16, 32] } {
                    add(base, format!("{name}, {cones} sub-cones"), &|l| l.sub_cones = cones);
                }
                for level in if is_draft { vec![2, 5] } else { vec![1, 2, 5] } {
                    add(base, format!("{name}, levels to {level}"), &|l| l.coarsest_level = level);
                }
                for step in [1.0, 2.0, 3.0] {
                    add(base, format!("{name}, steps of {step}"), &|l| l.cone_step = step);
                }
                for mm in [5.6, 8.0].into_iter().filter(|_| is_draft) {
                    add(base, format!("{name}, cells of {mm} mm"), &|l| l.cell_mm = mm);
                }
            }
        }
    }
    out
}

/// The preset that equals `quality` in a scene without opaque geometry: cost, vicinity samples and lamp are ignored.
pub(super) fn preset_of(quality: &Quality) -> Option<Preset> {
    let is_same = |preset: &Preset| {
        let mut same = Quality { cost: quality.cost, ..light::preset(quality.lighting.mode, *preset) };
        same.lighting.vicinity_samples = quality.lighting.vicinity_samples;
        same.lighting.lamp = quality.lighting.lamp;
        same == *quality
    };
    Preset::VARIANTS.iter().copied().find(is_same)
}

/// Settings by name, with the knob's value.
pub(super) type Settings = Vec<(String, (f64, Quality))>;

/// Settings to measure, by kernel and knob.
fn settings(effort: Effort) -> Vec<(String, &'static str, Settings)> {
    let path_costs = |mode: LightingMode| -> Vec<f64> {
        let most = light::row(mode).most_cost;
        let costs: &[f64] = effort.of(
            &[0.03],
            &[0.03, 0.125, 1.0],
            &[0.004, 0.015, 0.03, 0.06, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0],
        );
        // The reference by cones is too slow for quick runs.
        let last = if mode == LightingMode::Cones { effort.of(2.0, 2.0, most) } else { most };
        costs.iter().copied().filter(|c| *c < last).chain([last]).collect()
    };
    let mut out = Vec::new();
    for mode in [LightingMode::Cones, LightingMode::Slices] {
        let on_path = |cost: f64| {
            let quality = light::at_cost(mode, cost);
            let name = preset_of(&quality).map(|preset| preset.name().to_owned());
            (name.unwrap_or_else(|| format!("cost {cost}")), (cost, quality))
        };
        let path = path_costs(mode).into_iter().map(on_path).collect();
        out.push((mode.name().to_owned(), "light::at_cost", path));
        // Settings that equal a preset are already measured on the path.
        let others: Settings = off_path(mode, effort)
            .into_iter()
            .filter(|(_, q)| preset_of(q).is_none())
            .map(|(n, q)| (n, (f64::NAN, q)))
            .collect();
        if !others.is_empty() {
            out.push((format!("{}, beside the path", mode.name()), "LightSettings", others));
        }
    }
    if effort == Effort::Whole {
        let paper = |mm: f64| {
            let mut quality = light::preset(LightingMode::Slices, Preset::Balanced);
            quality.lighting.slice_mm = mm;
            quality.lighting.variant = SliceVariant::PaperApproximate;
            (format!("{mm} mm"), (mm, quality))
        };
        let paper = [8.0, 4.0, 2.0, 1.0].map(paper).to_vec();
        out.push(("the paper's slices".to_owned(), "LightSettings::slice_mm", paper));
    }
    out
}

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let size = bench.effort.of([48, 48], [96, 96], [256, 256]);
    let (count, samples) = bench.effort.of((40, 48), (150, 128), (700, 768));
    let presets: &[TransferPreset] = bench.effort.of(
        &[TransferPreset::MrSurface],
        &[TransferPreset::MrSurface],
        &[TransferPreset::MrSurface, TransferPreset::MrTissue],
    );
    let image = scenes::phantom_image()?;
    let head = |preset: &TransferPreset| {
        (format!("head phantom T1c, {}", preset.name()), scenes::head(&image, *preset))
    };
    let mut scenes_by_name: Vec<(String, ContextScene)> = presets.iter().map(head).collect();
    if bench.effort == Effort::Whole {
        scenes_by_name.push(("soft balls, 48³ voxels of 1 mm".to_owned(), scenes::soft_balls(48)?));
    }
    let mut out = Vec::new();
    for (name, scene) in &scenes_by_name {
        bench.begin("light: Monte Carlo", name);
        let phase = Phase::Cone { aperture_deg: LightSettings::DEFAULT.aperture_deg };
        let truth = Truth::of(scene, size, count, |medium, ray, number| {
            radiance(medium, ray, phase, DVec3::ZERO, samples, &mut Random::new(5, number))
        })?;
        for (kernel, knob, settings) in settings(bench.effort) {
            let points = measure_points(bench, &kernel, &settings, scene, size, &truth)?;
            out.push(Curve {
                family: FAMILY.name,
                kernel,
                scene: format!(
                    "{name}, {}x{} pixels requested, {} of them evaluated",
                    size[0],
                    size[1],
                    truth.pixels.len()
                ),
                knob,
                truth: format!(
                    "Monte Carlo, cone of {} degrees, {} samples per pixel",
                    LightSettings::DEFAULT.aperture_deg,
                    samples
                ),
                truth_error: Some(truth.standard_error),
                unit: "linear radiance, 0 to 1",
                axis: Axis::Time,
                points,
            });
        }
    }
    Ok(out)
}

/// What the last frame, requested at `size`, shows at the pixels of a truth, and their estimates.
pub(super) fn found_of<'a>(
    gpu: &Gpu,
    renderer: &ContextRenderer,
    size: [u32; 2],
    truth: &'a Truth,
) -> Outcome<Vec<(DVec3, &'a Estimate)>> {
    let frame = renderer.frame().ok_or("no frame was drawn")?;
    let drawn = DrawnFrame { size: frame.size_px, pixels: frame.image_rgba(gpu)? };
    let found = |(pixel, estimate): &'a ([u32; 2], Estimate)| {
        let [r, g, b, _] = drawn.at(*pixel, size);
        (DVec3::new(r, g, b), estimate)
    };
    Ok(truth.pixels.iter().map(found).collect())
}

pub(super) fn measure_points(
    bench: &Bench<'_>,
    kernel: &str,
    settings: &Settings,
    scene: &ContextScene,
    size: [u32; 2],
    truth: &Truth,
) -> Outcome<Vec<Point>> {
    let sweep = Sweep {
        label: &format!("light: {kernel}"),
        rounds: bench.effort.of(1, 1, 2),
        time_budget: Duration::from_millis(4000),
        on_device: true,
    };
    let run = |renderer: &mut ContextRenderer, (_, quality): &(f64, Quality)| {
        // Full strength: unlit tissue is black, as in the truth.
        renderer.render(bench.gpu, scene, &Quality { occlusion_strength: 1.0, ..*quality }, size)?;
        Ok(bench.gpu.wait()?)
    };
    let evaluate = |renderer: &mut ContextRenderer, (value, quality): &(f64, Quality)| {
        let mut errors = Errors::default();
        let mut pairs = Vec::new();
        for (found, estimate) in found_of(bench.gpu, renderer, size, truth)? {
            (found - estimate.mean).to_array().into_iter().for_each(|e| errors.add(e));
            pairs.push((displayed(found), displayed(estimate.mean)));
        }
        Ok(Point {
            is_default: preset_of(quality).is_some(),
            delta_e: Some(delta_e_of(pairs.into_iter())),
            pixel_share: quality.resolution_scale * quality.resolution_scale,
            ..Point::new(*value, &errors)
        })
    };
    bench.sweep(&sweep, &mut ContextRenderer::new(bench.gpu)?, settings, run, evaluate)
}
