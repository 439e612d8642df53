//! Directional occlusion, by slices and by cones, against Monte Carlo of the same integral.

use std::{sync::Arc, time::Duration};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    AccuracyError, Axis, Bench, Curve, Effort, Family, Point,
    measure::{Errors, delta_e_of, displayed},
    scenes,
    sweep::Sweep,
};
use crate::{
    camera::Camera,
    cones::{ConeRenderer, ConeSettings},
    dos::{DosRenderer, DosSettings, Form, Variant},
    occlusion::{Filter, OpticalVolume},
    reference::{
        monte_carlo::{Estimate, Phase, radiance},
        random::Random,
    },
};

/// Both backends' default.
const APERTURE_DEG: f64 = 60.0;

/// A picture's every `stride`-th pixel by Monte Carlo: those that something is in.
struct Truth {
    pixels: Vec<(usize, Estimate)>,
}

impl Truth {
    fn of(volume: &OpticalVolume, camera: &Camera, size: [u32; 2], stride: u32, samples: u32) -> Self {
        let size_px = DVec2::new(f64::from(size[0]), f64::from(size[1]));
        let middle = stride / 2;
        let places: Vec<[u32; 2]> = (middle..size[1])
            .step_by(stride as usize)
            .flat_map(|y| (middle..size[0]).step_by(stride as usize).map(move |x| [x, y]))
            .collect();
        let phase = Phase::Cone { aperture_deg: APERTURE_DEG };
        let pixels = places
            .into_par_iter()
            .map(|[x, y]| {
                let ray = camera.ray(DVec2::new(f64::from(x), f64::from(y)) + 0.5, size_px);
                let number = y as usize * size[0] as usize + x as usize;
                let mut random = Random::new(1, number as u64);
                (number, radiance(volume, &ray, phase, DVec3::ZERO, samples, &mut random))
            })
            // Empty rays have no error in either.
            .filter(|(_, e)| e.mean != DVec3::ZERO || e.standard_error != DVec3::ZERO)
            .collect();
        Self { pixels }
    }

    fn standard_error(&self) -> f64 {
        let mut errors = Errors::default();
        self.pixels.iter().for_each(|(_, e)| e.standard_error.to_array().iter().for_each(|s| errors.add(*s)));
        errors.rms()
    }

    fn against(&self, found: &[[f32; 4]]) -> (Errors, [f64; 2]) {
        let mut errors = Errors::default();
        let pairs = || {
            self.pixels.iter().filter_map(|(number, e)| {
                let f = found.get(*number)?;
                Some((DVec3::new(f64::from(f[0]), f64::from(f[1]), f64::from(f[2])), e.mean))
            })
        };
        pairs().for_each(|(f, t)| (f - t).to_array().iter().for_each(|e| errors.add(*e)));
        (errors, delta_e_of(pairs().map(|(f, t)| (displayed(f), displayed(t)))))
    }
}

struct Stage<'a> {
    bench: &'a Bench<'a>,
    volume: Arc<OpticalVolume>,
    camera: Camera,
    size: [u32; 2],
    truth: Truth,
    scene: String,
    truth_name: String,
}

impl Stage<'_> {
    fn curve(&self, kernel: &str, knob: &'static str, points: Vec<Point>) -> Curve {
        Curve {
            family: Family::Occlusion,
            kernel: kernel.to_owned(),
            scene: self.scene.clone(),
            knob,
            truth: self.truth_name.clone(),
            truth_error: Some(self.truth.standard_error()),
            unit: "linear radiance, 0 to 1",
            axis: Axis::Time,
            points,
        }
    }

    fn sweep<'w>(&self, what: &'w str) -> Sweep<'w> {
        let rounds = self.bench.effort.of(1, 3, 4);
        Sweep { what, rounds, patience: Duration::from_millis(1500), on_device: true }
    }

    fn slices(
        &self,
        renderer: &mut DosRenderer,
        variant: Variant,
        settings: &[DosSettings],
    ) -> Result<Curve, AccuracyError> {
        let gpu = self.bench.gpu;
        let named = |asked: &DosSettings| {
            let DosSettings { slice_mm, grid, reference_mm, .. } = *asked;
            // Only the mended variant has a reference.
            let reference = match variant {
                Variant::Mended => format!(", reference {reference_mm} mm"),
                _ => String::new(),
            };
            (format!("{slice_mm} mm, {grid}x{grid}{reference}"), *asked)
        };
        let settings: Vec<(String, DosSettings)> = settings.iter().map(named).collect();
        let form = Form::fastest(gpu, self.size);
        let points = self.bench.sweep(
            &self.sweep(variant.name()),
            &mut (renderer, 0),
            &settings,
            |(renderer, slices), asked| {
                let drawn = renderer.render(gpu, &self.volume, &self.camera, self.size, asked, form, true)?;
                *slices = drawn.slices();
                Ok(self.bench.wait()?)
            },
            |(renderer, slices), asked| {
                let (errors, delta_e) = self.truth.against(&renderer.read(gpu)?);
                Ok(Point {
                    setting: format!(", {slices} slices"),
                    delta_e: Some(delta_e),
                    is_default: *asked == DosSettings::default(),
                    ..Point::new(asked.slice_mm, &errors)
                })
            },
        )?;
        Ok(self.curve(
            &format!("slices, {}", variant.name()),
            "DosSettings::slice_mm, grid and reference_mm",
            points,
        ))
    }

    fn cones(&self, settings: &[ConeSettings]) -> Result<Curve, AccuracyError> {
        let gpu = self.bench.gpu;
        let named = |asked: &ConeSettings| {
            let level = match asked.coarsest_level {
                0 => "the volume itself".to_owned(),
                n => format!("levels to {n}"),
            };
            (format!("{} sub-cones, {level}, steps of {}", asked.sub_cones, asked.cone_step), *asked)
        };
        let settings: Vec<(String, ConeSettings)> = settings.iter().map(named).collect();
        let points = self.bench.sweep(
            &self.sweep("cones"),
            &mut ConeRenderer::new(gpu)?,
            &settings,
            |renderer, asked| {
                renderer.render(gpu, &self.volume, &self.camera, self.size, asked, true)?;
                Ok(self.bench.wait()?)
            },
            |renderer, asked| {
                let (errors, delta_e) = self.truth.against(&renderer.read(gpu)?);
                Ok(Point {
                    delta_e: Some(delta_e),
                    is_default: *asked == ConeSettings::of(self.volume.filter()),
                    ..Point::new(f64::from(asked.sub_cones), &errors)
                })
            },
        )?;
        Ok(self.curve("cones", "ConeSettings::sub_cones, coarsest_level and steps", points))
    }
}

/// Slice distances by grids, at the default's reference.
fn product(variant: Variant, distances: &[f64], grids: &[u32]) -> Vec<DosSettings> {
    let base = DosSettings { variant, aperture_deg: APERTURE_DEG, ..DosSettings::default() };
    grids
        .iter()
        .flat_map(|&grid| distances.iter().map(move |&slice_mm| DosSettings { grid, slice_mm, ..base }))
        .collect()
}

fn slice_settings(effort: Effort, variant: Variant) -> Vec<DosSettings> {
    match (effort, variant) {
        (Effort::Tiny, Variant::PaperExact) => Vec::new(),
        (Effort::Tiny, _) => product(variant, &[4.0, 2.0, 1.0], &[DosSettings::default().grid]),
        (Effort::Quick, Variant::PaperExact) => product(variant, &[2.0], &[5]),
        (Effort::Quick, Variant::PaperApproximate) => product(variant, &[4.0, 2.0, 1.0], &[5]),
        (Effort::Quick, Variant::Mended) => {
            with_references(variant, product(variant, &[4.0, 2.0, 1.0], &[DosSettings::default().grid]))
        }
        (Effort::Whole, Variant::PaperExact) => product(variant, &[4.0, 2.0, 1.0, 0.5, 0.25], &[5]),
        (Effort::Whole, Variant::PaperApproximate) => {
            product(variant, &[4.0, 2.0, 1.0, 0.5, 0.25, 0.125], &[2, 5, 9, 13])
        }
        (Effort::Whole, Variant::Mended) => {
            with_references(variant, product(variant, &[4.0, 2.0, 1.0, 0.5, 0.25, 0.125], &[2, 3, 5, 9, 13]))
        }
    }
}

/// More settings: the default with other references.
fn with_references(variant: Variant, mut settings: Vec<DosSettings>) -> Vec<DosSettings> {
    let base = DosSettings { variant, aperture_deg: APERTURE_DEG, ..DosSettings::default() };
    let other = [1.25, 2.5, 5.0, 10.0, 20.0].into_iter().filter(|r| *r != base.reference_mm);
    settings.extend(other.map(|reference_mm| DosSettings { reference_mm, ..base }));
    settings
}

fn cone_settings(effort: Effort, filter: Filter) -> Vec<ConeSettings> {
    let base = ConeSettings { aperture_deg: APERTURE_DEG, ..ConeSettings::of(filter) };
    let with = |sub_cones, coarsest_level, step: f64| ConeSettings {
        sub_cones,
        coarsest_level,
        ray_step: step,
        cone_step: step,
        ..base
    };
    match effort {
        Effort::Tiny => vec![with(1, 8, 1.0), with(8, 1, 1.0), with(32, 0, 0.5)],
        Effort::Quick => {
            vec![with(1, 8, 1.0), with(8, 2, 1.0), with(8, 1, 1.0), with(4, 1, 1.0), with(16, 0, 1.0)]
        }
        Effort::Whole => {
            let mut all = Vec::new();
            for n in [1, 2, 4, 8, 16, 32] {
                all.extend([8, 4, 3, 2, 1, 0].map(|level| with(n, level, 1.0)));
            }
            all.extend([8, base.coarsest_level].into_iter().flat_map(|level| {
                [(4, 2.0), (8, 2.0), (8, 0.5)].map(|(sub_cones, step)| with(sub_cones, level, step))
            }));
            all.extend([with(16, 0, 0.5), with(32, 0, 0.5)]);
            all
        }
    }
}

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    let size = bench.effort.of([24, 22], [80, 72], [128, 112]);
    let stride = bench.effort.of(2, 4, 4);
    let samples = bench.effort.of(256, 1024, 4096);
    let n = bench.effort.of(24, 48, 48);
    let all = [Variant::PaperExact, Variant::PaperApproximate, Variant::Mended];
    let mut out = Vec::new();
    let mut slices = DosRenderer::new(bench.gpu)?;
    for (name, volume) in [("soft balls", scenes::soft(n)?), ("labels", scenes::labels(n)?)] {
        if bench.effort < Effort::Whole && name == "labels" {
            continue;
        }
        bench.begin("occlusion: Monte Carlo of", name)?;
        let camera = scenes::camera(DVec3::ZERO, 0.54 * n as f64);
        let truth = Truth::of(&volume, &camera, size, stride, samples);
        let stage = Stage {
            bench,
            scene: format!("{name}, {n}³ voxels of 1 mm, {}x{} pixels", size[0], size[1]),
            truth_name: format!(
                "Monte Carlo of equation 7, cone of {APERTURE_DEG}°, {samples} samples in each of {} pixels",
                truth.pixels.len()
            ),
            volume,
            camera,
            size,
            truth,
        };
        for variant in all {
            let settings = slice_settings(bench.effort, variant);
            if settings.is_empty() {
                continue;
            }
            out.push(stage.slices(&mut slices, variant, &settings)?);
        }
        out.push(stage.cones(&cone_settings(bench.effort, stage.volume.filter()))?);
    }
    Ok(out)
}
