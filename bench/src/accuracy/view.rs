//! The light of a view, along the path of its presets and beside it, against Monte Carlo at some of its
//! pixels.

use std::{sync::Arc, time::Duration};

use glam::{DVec2, DVec3};

use super::{
    AccuracyError, Axis, Bench, Curve, Family, Point, context,
    measure::{Errors, delta_e_of, displayed},
    scenes,
    sweep::Sweep,
};
use crate::{
    ContextRenderer, ContextScene, ContextVolume, Lighting, Preset, Quality, Shading, TransferPreset,
    context::{Field, Tables},
    dos::Variant,
    occlusion::{Filter, OpticalVolume, Table},
    reference::{
        medium::Medium,
        monte_carlo::{Estimate, Phase, radiance},
        random::Random,
    },
};

/// The image as a medium for Monte Carlo: the same stored values, the same table.
fn medium(scene: &ContextScene) -> Option<OpticalVolume> {
    let volume = scene.volume.as_ref()?;
    let field = Field::fitting(volume, 1 << 32)?;
    let tables = Tables::of(&scene.transfer, volume.scale(), &field.ranges());
    let linear = |c: f32| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    let entry = |[r, g, b, a]: &[f32; 4]| [linear(*r), linear(*g), linear(*b), -(1.0 - a).max(1e-30).ln()];
    let entries: Vec<[f32; 4]> = tables.colors.iter().map(entry).collect();
    let (scale, offset) = tables.color_place;
    let last = (entries.len() - 1) as f64;
    let table = Table::new((-offset / scale) as f32, ((last - offset) / scale) as f32, &entries)?;
    OpticalVolume::new(field.grid, field.values, table, Filter::Linear, None)
}

/// A picture of linear radiance and opacity, drawn at a size for another one.
struct Drawn {
    size: [u32; 2],
    pixels: Vec<[f64; 4]>,
}

impl Drawn {
    /// What is shown at a pixel of the asked size: between the drawn ones.
    fn at(&self, pixel: [u32; 2], asked: [u32; 2]) -> [f64; 4] {
        let place: [f64; 2] = std::array::from_fn(|a| {
            let x = (f64::from(pixel[a]) + 0.5) / f64::from(asked[a]) * f64::from(self.size[a]) - 0.5;
            x.clamp(0.0, f64::from(self.size[a] - 1))
        });
        let mut out = [0.0; 4];
        for corner in 0..4u32 {
            let mut weight = 1.0;
            let at: [u32; 2] = std::array::from_fn(|a| {
                let up = corner >> a & 1;
                weight *= if up == 1 { place[a].fract() } else { 1.0 - place[a].fract() };
                (place[a] as u32 + up).min(self.size[a] - 1)
            });
            let found = self.pixels.get((at[1] * self.size[0] + at[0]) as usize).copied().unwrap_or_default();
            out.iter_mut().zip(found).for_each(|(o, f)| *o += weight * f);
        }
        out
    }
}

/// Pixels to look at, always the same, and what Monte Carlo finds there.
struct Truth {
    pixels: Vec<([u32; 2], Estimate)>,
    standard_error: f64,
}

fn truth(
    scene: &ContextScene,
    medium: &OpticalVolume,
    size: [u32; 2],
    count: usize,
    samples: u32,
    aperture_deg: f64,
) -> Truth {
    use rayon::prelude::*;
    let size_px = DVec2::new(f64::from(size[0]), f64::from(size[1]));
    let ray_of = |[x, y]: [u32; 2]| scene.camera.ray(DVec2::new(f64::from(x), f64::from(y)) + 0.5, size_px);
    let mut random = Random::new(11, 0);
    let mut chosen = Vec::new();
    for _ in 0..50 * count {
        let pixel = size.map(|s| ((random.unit() * f64::from(s)) as u32).min(s - 1));
        // Pixels that nothing is in would water the error down.
        if medium.thickness(&ray_of(pixel), f64::INFINITY) > 0.02 {
            chosen.push(pixel);
        }
        if chosen.len() == count {
            break;
        }
    }
    let phase = Phase::Cone { aperture_deg };
    let pixels: Vec<([u32; 2], Estimate)> = chosen
        .into_par_iter()
        .enumerate()
        .map(|(i, pixel)| {
            let mut random = Random::new(5, i as u64);
            (pixel, radiance(medium, &ray_of(pixel), phase, DVec3::ZERO, samples, &mut random))
        })
        .collect();
    let mut errors = Errors::default();
    for (_, e) in &pixels {
        e.standard_error.to_array().iter().for_each(|s| errors.add(*s));
    }
    Truth { pixels, standard_error: errors.rms() }
}

/// A way of light with knobs of its own beside the path: what the path was chosen from.
fn beside(shading: Shading, effort: super::Effort) -> Vec<(String, Quality)> {
    let balanced = Quality::preset(shading, Preset::Balanced);
    let mut out = Vec::new();
    let mut with = |of: Quality, name: String, change: &dyn Fn(&mut Lighting)| {
        let mut quality = of;
        change(&mut quality.lighting);
        out.push((name, quality));
    };
    // Pixels against what takes the most time besides.
    for &scale in effort.of(&[][..], &[0.5][..], &[0.4, 1.0][..]) {
        let of = Quality { resolution_scale: scale, ..balanced };
        match shading {
            Shading::ScreenSpace => {}
            Shading::Slices => {
                for mm in effort.of(&[][..], &[4.0][..], &[4.0, 2.0, 1.4, 1.0, 0.7, 0.5][..]) {
                    with(of, format!("pixels {scale}, {mm} mm"), &|l| l.slice_mm = *mm);
                }
            }
            Shading::Cones => {
                for mm in effort.of(&[][..], &[8.0][..], &[12.0, 8.0, 4.0, 2.0][..]) {
                    with(of, format!("pixels {scale}, cells of {mm} mm"), &|l| l.cell_mm = *mm);
                }
            }
        }
    }
    if effort < super::Effort::Whole {
        return out;
    }
    // One knob of a preset changed.
    for preset in [Preset::Draft, Preset::Balanced] {
        let (of, name) = (Quality::preset(shading, preset), preset.name());
        let is_draft = preset == Preset::Draft;
        match shading {
            Shading::ScreenSpace => {}
            Shading::Slices => {
                for grid in [3, 5] {
                    with(of, format!("{name}, footprint {grid}x{grid}"), &|l| l.slice_grid = grid);
                }
                for mm in [1.0, 1.7].into_iter().filter(|_| is_draft) {
                    with(of, format!("{name}, {mm} mm"), &|l| l.slice_mm = mm);
                }
            }
            Shading::Cones => {
                for cones in if is_draft { vec![2, 4] } else { vec![2, 4, 16, 32] } {
                    with(of, format!("{name}, {cones} sub-cones"), &|l| l.sub_cones = cones);
                }
                for level in if is_draft { vec![2, 5] } else { vec![1, 2, 5] } {
                    with(of, format!("{name}, levels to {level}"), &|l| l.coarsest_level = level);
                }
                for step in [1.0, 2.0, 3.0] {
                    with(of, format!("{name}, steps of {step}"), &|l| l.cone_step = step);
                }
                for mm in [5.6, 8.0].into_iter().filter(|_| is_draft) {
                    with(of, format!("{name}, cells of {mm} mm"), &|l| l.cell_mm = mm);
                }
            }
        }
    }
    out
}

/// The preset that `quality` is here, where nothing is solid, wherever it was found.
fn preset_of(quality: &Quality) -> Option<Preset> {
    let is_same = |preset: &Preset| {
        let mut same = Quality { cost: quality.cost, ..Quality::preset(quality.lighting.shading, *preset) };
        same.lighting.vicinity_samples = quality.lighting.vicinity_samples;
        same == *quality
    };
    Preset::ALL.into_iter().find(is_same)
}

/// Settings by name, with their cost on the path where they are on it.
type Settings = Vec<(String, (f64, Quality))>;

/// What is drawn, by kernel and knob.
fn settings(effort: super::Effort) -> Vec<(String, &'static str, Settings)> {
    let costs_of = |shading: Shading| -> Vec<f64> {
        let most = Quality::most_cost(shading);
        let costs = effort.of(
            &[0.03][..],
            &[0.03, 0.125, 1.0][..],
            &[0.004, 0.015, 0.03, 0.06, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0][..],
        );
        // The reference by cones is for those who have the time.
        let last = if shading == Shading::Cones { effort.of(2.0, 4.0, most) } else { most };
        costs.iter().copied().filter(|c| *c < last).chain([last]).collect()
    };
    let mut out = Vec::new();
    for shading in [Shading::Cones, Shading::Slices] {
        let on_path = |cost: f64| {
            let quality = Quality::at_cost(shading, cost);
            let name = preset_of(&quality).map(|preset| preset.name().to_owned());
            (name.unwrap_or_else(|| format!("cost {cost}")), (cost, quality))
        };
        let path = costs_of(shading).into_iter().map(on_path).collect();
        out.push((shading.name().to_owned(), "Quality::at_cost", path));
        // What is a preset already is measured once.
        let others: Settings = beside(shading, effort)
            .into_iter()
            .filter(|(_, q)| preset_of(q).is_none())
            .map(|(n, q)| (n, (f64::NAN, q)))
            .collect();
        if !others.is_empty() {
            out.push((format!("{}, beside the path", shading.name()), "Lighting", others));
        }
    }
    if effort > super::Effort::Quick {
        let paper = [8.0, 4.0, 2.0, 1.0]
            .map(|mm| {
                let mut quality = Quality::preset(Shading::Slices, Preset::Balanced);
                quality.lighting.slice_mm = mm;
                quality.lighting.variant = Variant::PaperApproximate;
                (format!("{mm} mm"), (mm, quality))
            })
            .to_vec();
        out.push(("slices, the paper's".to_owned(), "Lighting::slice_mm", paper));
    }
    out
}

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    let size = bench.effort.of([48, 48], [96, 96], [256, 256]);
    let (count, samples) = bench.effort.of((40, 48), (150, 128), (700, 768));
    let presets: &[TransferPreset] = bench.effort.of(
        &[TransferPreset::MrSurface],
        &[TransferPreset::MrSurface],
        &[TransferPreset::MrSurface, TransferPreset::MrTissue],
    );
    let volume = Arc::new(ContextVolume::new(scenes::image(scenes::phantom()?, "T1c")?));
    let aperture_deg = Lighting::DEFAULT.aperture_deg;
    let mut out = Vec::new();
    for preset in presets {
        let scene = context::scene(&volume, *preset);
        bench.begin("view: Monte Carlo", preset.name())?;
        let refused = || AccuracyError::Scene("an image that is no medium".to_owned());
        let medium = medium(&scene).ok_or_else(refused)?;
        let truth = truth(&scene, &medium, size, count, samples, aperture_deg);
        drop(medium);
        for (kernel, knob, settings) in settings(bench.effort) {
            let sweep = Sweep {
                what: &format!("view: {kernel}"),
                rounds: bench.effort.of(1, 1, 4),
                patience: Duration::from_millis(5000),
                on_device: true,
            };
            // The model itself: what no light reaches is black.
            let model = |quality: &Quality| Quality { occlusion_strength: 1.0, ..*quality };
            let run = |renderer: &mut ContextRenderer, (_, quality): &(f64, Quality)| {
                renderer.render(bench.gpu, &scene, &model(quality), size)?;
                Ok(bench.wait()?)
            };
            let look = |renderer: &mut ContextRenderer, (value, quality): &(f64, Quality)| {
                let frame = renderer.frame().ok_or_else(|| AccuracyError::of(&"no picture"))?;
                let pixels = frame.marched(bench.gpu)?.iter().map(|m| m.rgba()).collect();
                let drawn = Drawn { size: frame.size_px, pixels };
                let mut errors = Errors::default();
                let mut pairs = Vec::new();
                for (pixel, estimate) in &truth.pixels {
                    let found = drawn.at(*pixel, size);
                    (0..3).for_each(|c| errors.add(found[c] - estimate.mean[c]));
                    let found = DVec3::new(found[0], found[1], found[2]);
                    pairs.push((displayed(found), displayed(estimate.mean)));
                }
                Ok(Point {
                    is_default: preset_of(quality).is_some(),
                    delta_e: Some(delta_e_of(pairs.into_iter())),
                    pixel_share: quality.resolution_scale * quality.resolution_scale,
                    ..Point::new(*value, &errors)
                })
            };
            let points = bench.sweep(&sweep, &mut ContextRenderer::new(bench.gpu)?, &settings, run, look)?;
            out.push(Curve {
                family: Family::View,
                kernel,
                scene: format!(
                    "head phantom T1c, {}, {}x{} pixels asked for, {} of them looked at",
                    preset.name(),
                    size[0],
                    size[1],
                    truth.pixels.len()
                ),
                knob,
                truth: format!("Monte Carlo, cone of {aperture_deg} degrees, {samples} samples a pixel"),
                truth_error: Some(truth.standard_error),
                unit: "linear radiance, 0 to 1",
                axis: Axis::Time,
                points,
            });
        }
    }
    Ok(out)
}
