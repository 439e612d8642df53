//! Every lighting mode on the sample, in one table: time, memory, and the error at its presets. See docs/lights.md.

use clap::Args;
use glam::DVec3;
use glioscope_core::{
    Progress,
    optics::{
        Ray,
        march::converged,
        medium::Medium,
        monte_carlo::{Estimate, Phase, radiance},
        random::Random,
        scattering::Scattering,
    },
};
use glioscope_render::{
    ContextRenderer, ContextScene, Frame, Gpu, LightingMode, MaskColors, Palette, Preset, Quality, Renderer,
    TransferPreset, View3d,
    light::{LightSample, preset, row},
};
use strum::VariantArray;

use super::{
    light::{Truth, found_of},
    scenes,
};
use crate::{
    Outcome,
    clock::{load_average, machine, median, timed},
    open_gpu, print_line,
};

/// Arguments of `lights`.
#[derive(Debug, Args)]
pub struct LightsArguments {
    /// Frames of each mode and preset after the first; medians are reported. Fewer where they take long
    #[arg(long, default_value_t = 3)]
    frames: usize,
    /// Pixels along each side
    #[arg(long, default_value_t = 400)]
    size: u32,
    /// Pixels whose tissue is compared with the reference
    #[arg(long, default_value_t = 400)]
    pixels: usize,
    /// Only these modes
    #[arg(long, value_name = "MODE,...", value_delimiter = ',')]
    only: Vec<String>,
    /// Use only the software graphics adapter
    #[arg(long)]
    software: bool,
}

/// No third frame is drawn after so many milliseconds of frames: the first compiles shaders, and says little of a second.
const ENOUGH_MS: f64 = 15_000.0;
/// Most pixels along each side of the pictures of tissue, whose cost is not measured.
const MOST_TISSUE_PX: u32 = 160;
/// Ways of light at each of its pixels.
const SAMPLES: u32 = 768;
/// Opaque and translucent tissue.
const TISSUES: [TransferPreset; 2] = [TransferPreset::MrSurface, TransferPreset::MrTissue];

/// The light that tissue receives in truth.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Reference {
    /// From a cone about the direction to the eye.
    Cone,
    /// From a lamp far away, a point.
    Lamp,
    /// From a cone about the lamp, a share of it from everywhere.
    Sky,
    /// From everywhere within a radius.
    Near,
    /// From sky and lamp, scattered several times.
    Scattered,
}

impl Reference {
    /// `None`: a headlight on gradients is no light that arrives.
    fn of(mode: LightingMode) -> Option<Self> {
        match mode {
            LightingMode::ScreenSpace
            | LightingMode::Horizon
            | LightingMode::Traced
            | LightingMode::DepthDarkening
            | LightingMode::VicinityMap => None,
            LightingMode::Slices | LightingMode::Cones => Some(Self::Cone),
            LightingMode::HalfAngle | LightingMode::ShadowVolume => Some(Self::Lamp),
            LightingMode::SphericalHarmonics => Some(Self::Sky),
            LightingMode::DynamicAmbient => Some(Self::Near),
            LightingMode::PathTraced => Some(Self::Scattered),
        }
    }

    /// Radiance of a ray through a medium in this light. `number` is the ray's.
    fn radiance(
        self,
        (medium, ray, number): (&dyn Medium, &Ray, u64),
        quality: &Quality,
        towards: DVec3,
    ) -> Estimate {
        let light = &quality.lighting;
        let by = |phase: Phase, seed: u64| {
            radiance(medium, ray, phase, DVec3::ZERO, SAMPLES, &mut Random::new(seed, number))
        };
        match self {
            Self::Cone => by(Phase::Cone { aperture_deg: light.aperture_deg }, 5),
            Self::Lamp => {
                let open = |origin_mm: DVec3| {
                    (-medium.thickness(&Ray { origin_mm, direction: towards }, f64::INFINITY)).exp()
                };
                let mean = converged(medium, ray, 1.0, 1e-3, &open, DVec3::ZERO).radiance;
                Estimate { mean, standard_error: DVec3::ZERO }
            }
            Self::Sky => {
                let about = by(Phase::Lamp { towards, aperture_deg: light.aperture_deg }, 5);
                let everywhere = by(Phase::Isotropic, 6);
                let share = light.sky_share;
                let [a, b] = [about, everywhere].map(|e| e.standard_error * e.standard_error);
                let variance = a * (1.0 - share).powi(2) + b * share.powi(2);
                Estimate {
                    mean: about.mean.lerp(everywhere.mean, share),
                    standard_error: DVec3::from_array(variance.to_array().map(f64::sqrt)),
                }
            }
            Self::Near => by(Phase::Near { radius_mm: quality.occlusion_radius_mm }, 5),
            Self::Scattered => {
                let paths = &light.paths;
                let scattering = Scattering {
                    sky: 1.0 - paths.lamp_share,
                    lamp_light: paths.lamp_share,
                    lamp: towards,
                    lamp_radius_deg: paths.lamp_radius_deg,
                    anisotropy: paths.anisotropy,
                    bounces: paths.bounces,
                };
                scattering.radiance(medium, ray, SAMPLES, &mut Random::new(5, number))
            }
        }
    }
}

/// The head's surface with the tumour in it, as the window opens the sample.
fn scene() -> Outcome<ContextScene> {
    let closeup = scenes::phantom_closeup()?;
    Ok(ContextScene {
        tumor: closeup.tumor,
        colors: MaskColors::new(Palette::default(), &[None; 3]),
        ..scenes::head(&scenes::phantom_image()?, TISSUES[0])
    })
}

/// A quality at which light that doesn't arrive is missed: unlit places are black.
fn measured(mode: LightingMode, of: Preset) -> Quality {
    Quality { occlusion_strength: 1.0, ..preset(mode, of) }
}

fn sample_of<V: View3d>(
    _: &Renderer<V>,
    frame: &Frame<V>,
    gpu: &Gpu,
    scene: &V::Scene,
    quality: &Quality,
) -> Outcome<Option<LightSample>> {
    Ok(V::light_sample(frame, gpu, scene, quality)?)
}

/// Pictures of tissue alone, and the references that were computed of them.
struct Tissue {
    scenes: Vec<ContextScene>,
    size: [u32; 2],
    pixels: usize,
    truths: Vec<(Reference, Vec<Truth>)>,
}

impl Tissue {
    fn new(size: u32, pixels: usize) -> Outcome<Self> {
        let image = scenes::phantom_image()?;
        let scenes = TISSUES.iter().map(|tissue| scenes::head(&image, *tissue)).collect();
        Ok(Self { scenes, size: [size.min(MOST_TISSUE_PX); 2], pixels, truths: Vec::new() })
    }

    /// The position of a light's references among those computed.
    fn truth(&mut self, reference: Reference, quality: &Quality) -> Outcome<usize> {
        if let Some(known) = self.truths.iter().position(|(known, _)| *known == reference) {
            return Ok(known);
        }
        let of_scene = |scene: &ContextScene| {
            let towards = quality.lighting.lamp.direction(&scene.camera);
            Truth::of(scene, self.size, self.pixels, |medium, ray, number| {
                reference.radiance((medium, ray, number), quality, towards)
            })
        };
        let truths = self.scenes.iter().map(of_scene).collect::<Outcome<Vec<_>>>()?;
        self.truths.push((reference, truths));
        Ok(self.truths.len() - 1)
    }

    /// Root mean square errors of linear radiance, the reference's noise taken out.
    fn errors(
        &mut self,
        gpu: &Gpu,
        renderer: &mut ContextRenderer,
        quality: &Quality,
    ) -> Outcome<Option<Vec<f64>>> {
        let Some(reference) = Reference::of(quality.lighting.mode) else { return Ok(None) };
        let known = self.truth(reference, quality)?;
        let Some((_, truths)) = self.truths.get(known) else { return Ok(None) };
        let mut out = Vec::new();
        for (scene, truth) in self.scenes.iter().zip(truths) {
            renderer.render(gpu, scene, quality, self.size)?;
            let found = found_of(gpu, renderer, self.size, truth)?;
            let squares: f64 = found
                .iter()
                .map(|(found, truth)| {
                    (*found - truth.mean).length_squared() - truth.standard_error.length_squared()
                })
                .sum();
            out.push((squares / (3.0 * found.len() as f64)).max(0.0).sqrt());
        }
        Ok(Some(out))
    }
}

/// A row of the table.
fn row_of(
    gpu: &Gpu,
    (scene, tissue): (&ContextScene, &mut Tissue),
    (mode, of): (LightingMode, Preset),
    (size, frames): (u32, usize),
) -> Outcome<String> {
    let quality = measured(mode, of);
    let before = gpu.memory_bytes();
    let mut renderer = ContextRenderer::new(gpu)?;
    let mut times: Vec<(f64, f64)> = Vec::new();
    while times.len() <= frames && (times.len() < 2 || times.iter().map(|t| t.0).sum::<f64>() < ENOUGH_MS) {
        let (ms, cpu_ms, drawn) = timed(|| -> Outcome<()> {
            renderer.render(gpu, scene, &quality, [size; 2])?;
            Ok(gpu.wait()?)
        });
        drawn?;
        times.push((ms, cpu_ms.unwrap_or(f64::NAN)));
    }
    let memory = before.zip(gpu.memory_bytes());
    let memory = memory.map_or("–".to_owned(), |(before, after)| {
        format!("{:.1}", after.saturating_sub(before) as f64 / f64::from(1 << 20))
    });
    // The first frame compiles shaders and computes what later ones use again.
    let (first, rest) = times.split_at(times.len().min(1));
    let next = |of: fn(&(f64, f64)) -> f64| {
        if rest.is_empty() {
            "–".to_owned()
        } else {
            format!("{:.0}", median(&rest.iter().map(of).collect::<Vec<_>>()))
        }
    };
    let frame = renderer.frame().ok_or("no frame was drawn")?;
    let [width, height] = frame.size_px;
    let sample = sample_of(&renderer, frame, gpu, scene, &quality)?;
    let of_masks = match sample {
        Some(sample) => sample.measure(&Progress::default())?.surfaces.map(|error| error.rms),
        None => renderer.standard_error(gpu)?.and_then(|error| error.surfaces),
    };
    let of_masks = of_masks.map_or("–".to_owned(), |rms| format!("{rms:.3}"));
    let of_tissue = tissue.errors(gpu, &mut renderer, &quality)?;
    let of_tissue = of_tissue.map_or(vec!["–".to_owned(); TISSUES.len()], |errors| {
        errors.into_iter().map(|rms| format!("{rms:.3}")).collect()
    });
    Ok(format!(
        "| `{}` | {} | {of_masks} | {} | {:.0} | {} | {} | {memory} | {width}x{height} |",
        row(mode).mode.name(),
        of.name(),
        of_tissue.join(" | "),
        first.first().map_or(f64::NAN, |t| t.0),
        next(|t| t.0),
        next(|t| t.1),
    ))
}

/// Prints the table.
///
/// # Errors
/// When a frame can't be drawn, or a reference not be computed.
pub fn run(arguments: &LightsArguments) -> Outcome<()> {
    let gpu = open_gpu(arguments.software)?;
    let (scene, mut tissue) = (scene()?, Tissue::new(arguments.size, arguments.pixels)?);
    let load = || load_average().map_or("unknown".to_owned(), |l| format!("{l:.1}"));
    let size = arguments.size;
    print_line(format!(
        "{}; {}; {size}x{size} pixels; load {} at the start\n",
        machine(),
        gpu.describe(),
        load()
    ))?;
    print_line(
        "| `--light` | preset | error: masks | opaque tissue | translucent tissue | first frame, ms | frame, ms | CPU ms | \
         MiB | drawn pixels |\n|---|---|---:|---:|---:|---:|---:|---:|---:|---|",
    )?;
    let is_asked =
        |mode: &&LightingMode| arguments.only.is_empty() || arguments.only.iter().any(|n| n == mode.name());
    for mode in LightingMode::VARIANTS.iter().filter(is_asked) {
        for of in Preset::VARIANTS {
            print_line(row_of(
                &gpu,
                (&scene, &mut tissue),
                (*mode, *of),
                (arguments.size, arguments.frames),
            )?)?;
        }
    }
    print_line(format!("\nload {} at the end", load()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A light with a reference gets near it, at a preset with which it should.
    #[test]
    fn a_row_has_times_memory_and_errors() {
        let gpu = open_gpu(true).unwrap();
        let (scene, mut tissue) = (scene().unwrap(), Tissue::new(32, 12).unwrap());
        let found =
            row_of(&gpu, (&scene, &mut tissue), (LightingMode::ShadowVolume, Preset::Balanced), (32, 1))
                .unwrap();
        println!("{found}");
        let cells: Vec<&str> = found.split('|').map(str::trim).collect();
        let number = |i: usize| cells[i].parse::<f64>().unwrap();
        assert_eq!((cells[1], cells[2], cells[3]), ("`shadow-volume`", "balanced", "–"));
        assert!((1e-4..0.1).contains(&number(4)) && (1e-4..0.1).contains(&number(5)), "{found}");
        assert!((6..=8).all(|i| number(i) > 0.0) && number(9) > 0.1, "{found}");
    }
}
