//! Ambient occlusion of the closeup, compared with the occlusion of the hemisphere at each first hit, which it
//! approximates, and with its own integral, to which its samples converge.

use std::time::Duration;

use glam::{DVec2, DVec3};
use glioscope_core::optics::{
    Ray, Sight,
    hemisphere::{DepthScene, Weight, openness},
    random::Random,
    srgb,
};
use glioscope_render::{CloseupRenderer, LightSettings, LightingMode, Quality, RegionScene};
use rayon::prelude::*;

use super::{
    Axis, Bench, Curve, Defaults, Family, Point, TRACED_KERNEL, errors::Errors, scenes, sweep::Sweep,
};
use crate::{
    Outcome,
    hemisphere::{HemisphereTruth, radius_mm, through_voxels},
};

pub(super) const FAMILY: Family = Family {
    name: "ambient",
    title: "Ambient occlusion of the closeup",
    about: "What the closeup darkens, against the hemisphere about the smoothed normal, traced through the voxels in f64: \
            rays as on the device, horizons of depths and normals, and the thesis' point pairs. Rays have the noise of \
            their number alone, so few are enough while something moves and many at rest; the others have errors that \
            more samples can't remove, as depths don't show what is behind the first hit, and point pairs have no \
            normals and count half of the sampled sphere as unoccluded. Point pairs are also compared with the \
            hemisphere of the depth buffer and with their own integral, to which their samples converge. Time is that \
            of the whole frame. The defaults are rays: 4 while something moves, 256 at rest, where most pixels stop \
            before.",
    defaults: Defaults::One,
    curves,
};

/// First hits of the closeup and the parameters of its ambient occlusion.
struct Hits {
    size: [u32; 2],
    scene: DepthScene,
    sight: Sight,
    radius_mm: f64,
}

impl Hits {
    fn depth(&self, x: i64, y: i64) -> f64 {
        let [w, h] = self.size.map(i64::from);
        let at = y.clamp(0, h - 1) * w + x.clamp(0, w - 1);
        self.scene.depths_mm.get(at as usize).copied().unwrap_or(f64::INFINITY)
    }

    /// Unit normal of the surface at a pixel, facing the eye, from the nearer neighbour in x and in y; `None` where
    /// there is no surface.
    fn normal(&self, [x, y]: [u32; 2]) -> Option<DVec3> {
        let here = self.scene.point_mm([x, y])?;
        let side = |dx: u32, dy: u32| {
            let after = self.scene.point_mm([(x + dx).min(self.size[0] - 1), (y + dy).min(self.size[1] - 1)]);
            let before = self.scene.point_mm([x.saturating_sub(dx), y.saturating_sub(dy)]);
            let after = after.map(|p| p - here).filter(|d| d.length() > 0.0);
            let before = before.map(|p| here - p).filter(|d| d.length() > 0.0);
            match (after, before) {
                (Some(a), Some(b)) => Some(if a.length() < b.length() { a } else { b }),
                (a, b) => a.or(b),
            }
        };
        let normal = side(1, 0)?.cross(side(0, 1)?).try_normalize()?;
        let to_eye = self.scene.camera.eye_mm() - here;
        Some(if normal.dot(to_eye) < 0.0 { -normal } else { normal })
    }

    /// Occluded fraction of the hemisphere at every `stride`-th pixel: pixel index, fraction, standard error.
    fn hemisphere(&self, stride: u32, samples: u32) -> Vec<(usize, f64, f64)> {
        let pixels: Vec<[u32; 2]> = (0..self.size[1])
            .step_by(stride as usize)
            .flat_map(|y| (0..self.size[0]).step_by(stride as usize).map(move |x| [x, y]))
            .collect();
        pixels
            .into_par_iter()
            .filter_map(|pixel| {
                let number = (pixel[1] * self.size[0] + pixel[0]) as usize;
                let (at, normal) = (self.scene.point_mm(pixel)?, self.normal(pixel)?);
                let footprint = self.sight.pixel_mm(*self.scene.depths_mm.get(number)?);
                let is_hidden = |ray: &Ray, radius: f64| {
                    self.scene.hidden(ray, radius, 0.5 * footprint, 0.75 * footprint)
                };
                let from = at + normal * footprint;
                let mut random = Random::new(2, number as u64);
                let (open, error) =
                    openness(&is_hidden, from, normal, self.radius_mm, Weight::Cosine, samples, &mut random);
                Some((number, 1.0 - open, error))
            })
            .collect()
    }

    /// Limit of the pass for many samples: screen/occlusion.wgsl in `f64`, with random point pairs from the distribution
    /// that its spiral covers evenly.
    fn own_integral(&self, pairs: u32) -> Vec<f64> {
        let [w, h] = self.size.map(f64::from);
        let occluded = |(number, &depth): (usize, &f64)| {
            if !depth.is_finite() {
                return 0.0;
            }
            let width = self.size[0] as usize;
            let here = DVec2::new((number % width) as f64, (number / width) as f64);
            let footprint = self.sight.pixel_mm(depth);
            let mut random = Random::new(3, number as u64);
            let mut hidden = 0.0;
            for _ in 0..pairs {
                let z = random.unit();
                let radius = 0.2 + 0.8 * random.unit().powf(0.75);
                let (sin, cos) = (std::f64::consts::TAU * random.unit()).sin_cos();
                let ring = radius * (1.0 - z * z).max(0.0).sqrt() * self.radius_mm / footprint;
                for sign in [1.0, -1.0] {
                    let to = here + sign * DVec2::new(cos, sin) * ring;
                    let to = to.clamp(DVec2::ZERO, DVec2::new(w - 1.0, h - 1.0)) + 0.5;
                    let occluder = self.depth(to.x as i64, to.y as i64);
                    let sure = (3.0 * self.radius_mm / (depth - occluder).max(1e-6)).min(1.0);
                    hidden += if occluder < depth + sign * z * radius * self.radius_mm - 0.75 * footprint {
                        0.5 + 0.5 * sure
                    } else if occluder < depth {
                        0.5 - 0.5 * sure
                    } else {
                        0.0
                    };
                }
            }
            (2.0 * (hidden / f64::from(pairs) - 1.0)).clamp(0.0, 1.0)
        };
        self.scene.depths_mm.par_iter().enumerate().map(occluded).collect()
    }

    /// screen/blur.wgsl in `f64`.
    fn blurred(&self, dark: &[f64]) -> Vec<f64> {
        let [w, h] = self.size.map(i64::from);
        let average = |number: i64| {
            let (x, y) = (number % w, number / w);
            let depth = self.depth(x, y);
            let (mut sum, mut weight) = (0.0, 0.0);
            for (dx, dy) in (-2..2).flat_map(|dy| (-2..2).map(move |dx| (dx, dy))) {
                let (x, y) = ((x + dx).clamp(0, w - 1), (y + dy).clamp(0, h - 1));
                if (self.depth(x, y) - depth).abs() < 0.5 * self.radius_mm {
                    sum += dark.get((y * w + x) as usize).copied().unwrap_or(0.0);
                    weight += 1.0;
                }
            }
            sum / f64::max(weight, 1.0)
        };
        (0..w * h).map(average).collect()
    }
}

/// A kernel: its name, its knob, and qualities with the knob's value and whether it is a default.
type Kernel = (&'static str, &'static str, Vec<(String, (u32, bool, Quality))>);

fn kernels(bench: &Bench<'_>) -> [Kernel; 3] {
    let of = |mode| Quality {
        lighting: LightSettings { mode, ..LightSettings::DEFAULT },
        occlusion_radius_mm: radius_mm(),
        // Without ambient light: that of the window hides a part of the error.
        occlusion_strength: 1.0,
        ..Quality::FULL
    };
    let pairs: &[u32] = bench.effort.of(&[12], &[6, 12, 32], &[1, 2, 4, 6, 12, 24, 32]);
    let with_pairs = |mode| {
        let quality =
            |&n: &u32| (format!("{n} pairs"), (n, false, Quality { occlusion_samples: n, ..of(mode) }));
        pairs.iter().map(quality).collect()
    };
    let rays: &[u32] = bench.effort.of(&[4, 256], &[4, 16, 64, 256], &[1, 2, 4, 8, 16, 32, 64, 128, 256]);
    let with_rays = rays.iter().map(|&n| {
        let quality = Quality { occlusion_rays: n, ..of(LightingMode::Traced) };
        (format!("{n} rays"), (n, n == 4 || n == Quality::MOST_RAYS, quality))
    });
    [
        (TRACED_KERNEL, "Quality::occlusion_rays", with_rays.collect()),
        ("horizons of depths and normals", "Quality::occlusion_samples", with_pairs(LightingMode::Horizon)),
        (
            "point pairs in the depth buffer",
            "Quality::occlusion_samples",
            with_pairs(LightingMode::ScreenSpace),
        ),
    ]
}

/// All kernels against the hemisphere traced through the voxels.
fn against_voxels(
    bench: &Bench<'_>,
    (name, scene): (&str, &RegionScene),
    size: [u32; 2],
    (stride, samples): (u32, u32),
) -> Outcome<Vec<Curve>> {
    let mut truth: Option<HemisphereTruth> = None;
    let mut out = Vec::new();
    for (kernel, knob, settings) in kernels(bench) {
        let sweep = Sweep {
            label: &format!("ambient occlusion: {kernel}"),
            rounds: bench.effort.of(1, 5, 15),
            time_budget: Duration::from_millis(4000),
            on_device: true,
        };
        let run = |renderer: &mut CloseupRenderer, (_, _, quality): &(u32, bool, Quality)| {
            renderer.render(bench.gpu, scene, quality, size)?;
            Ok(bench.gpu.wait()?)
        };
        let evaluate = |renderer: &mut CloseupRenderer, (n, is_default, quality): &(u32, bool, Quality)| {
            let found = renderer.frame().ok_or("no frame was drawn")?.occlusion(bench.gpu)?;
            if truth.is_none() {
                truth = Some(through_voxels(scene, size, &found.depths_mm, (stride, samples))?);
            }
            let truth = truth.as_ref().ok_or("no truth")?;
            let is_encoded = quality.lighting.mode != LightingMode::ScreenSpace;
            let pairs: Vec<(f64, f64)> = truth
                .pixels
                .iter()
                .map(|(number, hidden, _)| {
                    let dark = found.dark.get(*number).copied().unwrap_or(f64::NAN);
                    (if is_encoded { 1.0 - srgb::decode(1.0 - dark) } else { dark }, *hidden)
                })
                .collect();
            let errors = Errors::of(pairs.iter().map(|(found, hidden)| found - hidden));
            let correlation = Some(correlation(&pairs));
            Ok(Point { is_default: *is_default, correlation, ..Point::new(f64::from(*n), &errors) })
        };
        let points = bench.sweep(&sweep, &mut CloseupRenderer::new(bench.gpu)?, &settings, run, evaluate)?;
        let measured = truth.as_ref().ok_or("no setting")?;
        out.push(Curve {
            family: FAMILY.name,
            kernel: kernel.to_owned(),
            scene: format!("{name}, {}x{} pixels, compared with rays through the voxels", size[0], size[1]),
            knob,
            truth: format!(
                "occluded fraction of the hemisphere within {} mm about the smoothed normal, cosine-weighted, by rays \
                 through the voxels in f64; {samples} rays at each of {} pixels, mean {:.3}",
                radius_mm(),
                measured.pixels.len(),
                measured.mean()
            ),
            truth_error: Some(Errors::of(measured.pixels.iter().map(|(_, _, e)| *e)).rms()),
            unit: "occluded fraction of light, 0 to 1",
            axis: Axis::Time,
            points,
        });
    }
    Ok(out)
}

/// Pearson's correlation of pairs.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (a, b) = (mean(|p| p.0), mean(|p| p.1));
    let products = pairs.iter().map(|(x, y)| [(x - a) * (y - b), (x - a).powi(2), (y - b).powi(2)]);
    let [both, first, second] = products.fold([0.0; 3], |s, p| [s[0] + p[0], s[1] + p[1], s[2] + p[2]]);
    both / (first * second).sqrt()
}

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let (stride, samples) = bench.effort.of((3, 64), (3, 512), (3, 2048));
    let size = bench.effort.of([48, 48], [128, 128], [256, 256]);
    let folds = ("a mask of deep folds", scenes::folds_closeup()?);
    let phantom = ("head phantom's tumour", scenes::phantom_closeup()?);
    let mut out = Vec::new();
    for (name, scene) in [folds, phantom] {
        out.extend(against_voxels(bench, (name, &scene), size, (stride, samples))?);
    }
    out.extend(against_depths(bench)?);
    Ok(out)
}

/// Point pairs against the hemisphere of the depth buffer, and against their own integral.
fn against_depths(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let size = bench.effort.of([48, 48], [128, 128], [256, 256]);
    let counts: &[u32] =
        bench.effort.of(&[2, 12, 32], &[2, 6, 12, 32], &[1, 2, 3, 4, 6, 8, 12, 16, 20, 24, 28, 32]);
    let (stride, samples) = bench.effort.of((3, 64), (3, 256), (3, 1024));
    let pairs = bench.effort.of(256, 512, 2048);
    let sweep = Sweep {
        label: "ambient occlusion: samples",
        rounds: bench.effort.of(1, 5, 25),
        time_budget: Duration::from_millis(4000),
        on_device: true,
    };
    let settings: Vec<(String, u32)> = counts.iter().map(|n| (format!("{n} pairs"), *n)).collect();
    let scene = scenes::phantom_closeup()?;
    let radius_mm = Quality::FULL.occlusion_radius_mm;
    let mut truths = None;
    let mut own_errors = Vec::new();
    let run = |renderer: &mut CloseupRenderer, &occlusion_samples: &u32| {
        let quality = Quality { occlusion_samples, occlusion_strength: 1.0, ..Quality::FULL };
        renderer.render(bench.gpu, &scene, &quality, size)?;
        Ok(bench.gpu.wait()?)
    };
    let evaluate = |renderer: &mut CloseupRenderer, &occlusion_samples: &u32| {
        let found = renderer.frame().ok_or("no frame was drawn")?.occlusion(bench.gpu)?;
        let (hits, hemisphere, own) = truths.get_or_insert_with(|| {
            let depths = DepthScene {
                camera: scene.camera,
                size,
                depths_mm: found.depths_mm.clone(),
                thickness_mm: 3.0 * radius_mm,
            };
            let hits = Hits { size, scene: depths, sight: Sight::new(&scene.camera, size), radius_mm };
            let hemisphere = hits.hemisphere(stride, samples);
            let own = hits.blurred(&hits.own_integral(pairs));
            (hits, hemisphere, own)
        });
        let surfaces = found.dark.iter().zip(own.iter()).zip(&hits.scene.depths_mm);
        own_errors.push(Errors::of(surfaces.filter(|(_, d)| d.is_finite()).map(|((f, t), _)| f - t)));
        let error = |(number, hidden, _): &(usize, f64, f64)| {
            found.dark.get(*number).map_or(f64::NAN, |found| found - hidden)
        };
        let errors = Errors::of(hemisphere.iter().map(error));
        Ok(Point::new(f64::from(occlusion_samples), &errors))
    };
    let of_hemisphere =
        bench.sweep(&sweep, &mut CloseupRenderer::new(bench.gpu)?, &settings, run, evaluate)?;
    let own = |(point, errors): (&Point, &Errors)| Point {
        error_rms: errors.rms(),
        error_max: errors.max(),
        ..point.clone()
    };
    let of_own = of_hemisphere.iter().zip(&own_errors).map(own).collect();
    let hemisphere = truths.map(|t| t.1).unwrap_or_default();
    let standard_error = Errors::of(hemisphere.iter().map(|(_, _, e)| *e));
    let curve = |scene: &str, truth: String, truth_error, points| Curve {
        family: FAMILY.name,
        kernel: "point pairs in the depth buffer".to_owned(),
        scene: format!("head phantom's tumour, {}x{} pixels, compared with {scene}", size[0], size[1]),
        knob: "Quality::occlusion_samples",
        truth,
        truth_error,
        unit: "occluded fraction of light, 0 to 1",
        axis: Axis::Time,
        points,
    };
    Ok(vec![
        curve(
            "the depth buffer's hemisphere",
            format!(
                "occluded fraction of the hemisphere within {radius_mm} mm, cosine-weighted, at the same first hits; \
                 {samples} rays at each of {} pixels",
                hemisphere.len()
            ),
            Some(standard_error.rms()),
            of_hemisphere,
        ),
        curve(
            "its own integral",
            format!("the pass's own integral and blur in f64, {pairs} random pairs per pixel"),
            None,
            of_own,
        ),
    ])
}
