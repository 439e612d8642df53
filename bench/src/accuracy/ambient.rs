//! Ambient occlusion of the closeup: against the hemisphere of each first hit, which it stands for, and
//! against its own integral, which its samples come to.

use std::time::Duration;

use glam::{DVec2, DVec3};
use glioscope_core::{RegionVolume, Selection};
use rayon::prelude::*;

use super::{AccuracyError, Axis, Bench, Curve, Family, Point, measure::Errors, scenes, sweep::Sweep};
use crate::{
    MaskColors, Palette, Quality, Renderer, Scene,
    camera::FIELD_OF_VIEW_DEG,
    reference::{
        hemisphere::{DepthScene, Weight, openness},
        random::Random,
    },
    uniforms::FAR,
};

/// First hits of the closeup, and what its occlusion is made of.
struct Hits {
    size: [u32; 2],
    scene: DepthScene,
    /// From the eye; infinite where nothing is.
    depths: Vec<f64>,
    radius_mm: f64,
    /// Millimetres of a pixel per millimetre of depth.
    growth: f64,
}

impl Hits {
    fn depth(&self, x: i64, y: i64) -> f64 {
        let [w, h] = self.size.map(i64::from);
        let at = y.clamp(0, h - 1) * w + x.clamp(0, w - 1);
        self.depths.get(at as usize).copied().unwrap_or(f64::INFINITY)
    }

    /// Unit normal of the face under a pixel, towards the eye: from its nearer neighbours.
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

    /// Share of the hemisphere that is hidden, with its standard error, at every `stride`-th pixel.
    fn hemisphere(&self, stride: u32, samples: u32) -> Vec<(usize, f64, f64)> {
        let places: Vec<[u32; 2]> = (0..self.size[1])
            .step_by(stride as usize)
            .flat_map(|y| (0..self.size[0]).step_by(stride as usize).map(move |x| [x, y]))
            .collect();
        places
            .into_par_iter()
            .filter_map(|pixel| {
                let number = (pixel[1] * self.size[0] + pixel[0]) as usize;
                let (at, normal) = (self.scene.point_mm(pixel)?, self.normal(pixel)?);
                let footprint = self.growth * self.depths.get(number)?;
                let hidden = |ray: &crate::Ray, radius: f64| {
                    self.scene.hidden(ray, radius, 0.5 * footprint, 0.75 * footprint)
                };
                let from = at + normal * footprint;
                let mut random = Random::new(2, number as u64);
                let (open, error) =
                    openness(&hidden, from, normal, self.radius_mm, Weight::Cosine, samples, &mut random);
                Some((number, 1.0 - open, error))
            })
            .collect()
    }

    /// What the pass comes to with ever more samples: closeup_occlusion.wgsl in `f64`, point pairs drawn
    /// at random from what its spiral is even in.
    fn own_integral(&self, pairs: u32) -> Vec<f64> {
        let [w, h] = self.size.map(f64::from);
        (0..self.depths.len())
            .into_par_iter()
            .map(|number| {
                let (Some(&depth), size) = (self.depths.get(number), self.size[0] as usize) else {
                    return 0.0;
                };
                if !depth.is_finite() {
                    return 0.0;
                }
                let here = DVec2::new((number % size) as f64, (number / size) as f64);
                let footprint = self.growth * depth;
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
                        hidden += if occluder < depth + sign * z * radius * self.radius_mm - 0.75 * footprint
                        {
                            0.5 + 0.5 * sure
                        } else if occluder < depth {
                            0.5 - 0.5 * sure
                        } else {
                            0.0
                        };
                    }
                }
                (2.0 * (hidden / f64::from(pairs) - 1.0)).clamp(0.0, 1.0)
            })
            .collect()
    }

    /// closeup_occlusion_blur.wgsl in `f64`.
    fn blurred(&self, dark: &[f64]) -> Vec<f64> {
        let [w, h] = self.size.map(i64::from);
        (0..w * h)
            .map(|number| {
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
            })
            .collect()
    }
}

fn scene() -> Result<Scene, AccuracyError> {
    let time = scenes::phantom()?;
    let tumor = RegionVolume::of(&time.index, &time.regions).map(std::sync::Arc::new);
    let grid = tumor.as_ref().map(|t| t.grid().clone());
    let grid = grid.ok_or_else(|| AccuracyError::Scene("a phantom without a tumour".to_owned()))?;
    let center_mm = grid.center_mm();
    Ok(Scene {
        tumor,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 3]),
        lens: None,
        camera: scenes::camera(center_mm, 0.75 * grid.corners_mm()[0].distance(center_mm)),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
        plane: None,
    })
}

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    let size = bench.effort.of([48, 48], [128, 128], [256, 256]);
    let counts: &[u32] =
        bench.effort.of(&[2, 12, 32], &[2, 6, 12, 32], &[1, 2, 3, 4, 6, 8, 12, 16, 20, 24, 28, 32]);
    let (stride, samples) = bench.effort.of((3, 64), (3, 256), (3, 1024));
    let pairs = bench.effort.of(256, 512, 2048);
    let sweep = Sweep {
        what: "ambient occlusion: samples",
        rounds: bench.effort.of(1, 5, 25),
        patience: Duration::from_millis(4000),
        on_device: true,
    };
    let named = |&pairs: &u32| {
        let word = if pairs == Quality::DRAFT.occlusion_samples { " (draft)" } else { "" };
        (format!("{pairs} pairs{word}"), pairs)
    };
    let settings: Vec<(String, u32)> = counts.iter().map(named).collect();
    bench.progress.say("making the head phantom");
    let scene = scene()?;
    let mut truths = None;
    let mut against_own = Vec::new();
    let run = |renderer: &mut Renderer, &occlusion_samples: &u32| {
        let quality = Quality { occlusion_samples, ..Quality::FULL };
        renderer.render(bench.gpu, &scene, &quality, size)?;
        Ok(bench.wait()?)
    };
    let look = |renderer: &mut Renderer, &samples_asked: &u32| {
        let frame = renderer.frame().ok_or_else(|| AccuracyError::of(&"no picture"))?;
        let found = frame.occlusion(bench.gpu)?;
        let (hits, hemisphere, own) = truths.get_or_insert_with(|| {
            let depth = |d: &f32| if *d < FAR { frame.reference_mm + f64::from(*d) } else { f64::INFINITY };
            let depths: Vec<f64> = found.depths.iter().map(depth).collect();
            let radius_mm = Quality::FULL.occlusion_radius_mm;
            let growth = 2.0 * (0.5 * FIELD_OF_VIEW_DEG).to_radians().tan() / f64::from(size[1]);
            let scene = DepthScene {
                camera: scene.camera,
                size,
                depths_mm: depths.clone(),
                thickness_mm: 3.0 * radius_mm,
            };
            let hits = Hits { size, scene, depths, radius_mm, growth };
            let hemisphere = hits.hemisphere(stride, samples);
            let own = hits.blurred(&hits.own_integral(pairs));
            (hits, hemisphere, own)
        });
        let mut errors = Errors::default();
        for ((f, t), depth) in found.blurred.iter().zip(own.iter()).zip(&hits.depths) {
            if depth.is_finite() {
                errors.add(f - t);
            }
        }
        against_own.push(errors);
        let mut errors = Errors::default();
        for (number, hidden, _) in hemisphere.iter() {
            errors.add(found.blurred.get(*number).map_or(f64::NAN, |f| f - hidden));
        }
        let is_default = samples_asked == Quality::FULL.occlusion_samples;
        Ok(Point { is_default, ..Point::new(f64::from(samples_asked), &errors) })
    };
    let of_hemisphere = bench.sweep(&sweep, &mut Renderer::new(bench.gpu)?, &settings, run, look)?;
    let own = |(point, errors): (&Point, &Errors)| Point {
        error_rms: errors.rms(),
        error_max: errors.max(),
        ..point.clone()
    };
    let of_own = of_hemisphere.iter().zip(&against_own).map(own).collect();
    let mut standard_error = Errors::default();
    let hemisphere = truths.map(|t| t.1).unwrap_or_default();
    hemisphere.iter().for_each(|(_, _, e)| standard_error.add(*e));
    let radius_mm = Quality::FULL.occlusion_radius_mm;
    let pixels = format!("head phantom's tumour, {}x{} pixels", size[0], size[1]);
    let curve = |scene: &str, truth: String, truth_error, points| Curve {
        family: Family::Ambient,
        kernel: "point pairs in the depth buffer".to_owned(),
        scene: format!("{pixels}, against {scene}"),
        knob: "Quality::occlusion_samples",
        truth,
        truth_error,
        unit: "share of light taken, 0 to 1",
        axis: Axis::Time,
        points,
    };
    Ok(vec![
        curve(
            "the hemisphere",
            format!(
                "hidden share of the hemisphere within {radius_mm} mm, cosine-weighted, on the same first hits; \
                 {samples} rays in each of {} pixels",
                hemisphere.len()
            ),
            Some(standard_error.rms()),
            of_hemisphere,
        ),
        curve(
            "its own integral",
            format!("the pass's own integral and blur in f64, {pairs} random pairs a pixel"),
            None,
            of_own,
        ),
    ])
}
