//! Every lighting mode on the sample, in one table: time, memory, and the error along its presets. See docs/lights.md.

use clap::Args;
use glioscope_render::{
    ContextRenderer, ContextScene, LightingMode, MaskColors, Palette, Preset, Quality, TransferPreset,
    light::{expected_error, preset, row},
};
use strum::VariantArray;

use super::scenes;
use crate::{
    Outcome,
    clock::{load_average, machine, median, peak_bytes, reset_peak, timed},
    open_gpu, print_line,
};

/// Arguments of `lights`.
#[derive(Debug, Args)]
pub struct LightsArguments {
    /// Frames of each mode and preset after the first; medians are reported
    #[arg(long, default_value_t = 3)]
    frames: usize,
    /// Pixels along each side
    #[arg(long, default_value_t = 400)]
    size: u32,
    /// Use only the software graphics adapter
    #[arg(long)]
    software: bool,
}

/// The head's surface with the tumour in it, as the window opens the sample.
fn scene() -> Outcome<ContextScene> {
    let closeup = scenes::phantom_closeup()?;
    Ok(ContextScene {
        tumor: closeup.tumor,
        colors: MaskColors::new(Palette::default(), &[None; 3]),
        ..scenes::head(&scenes::phantom_image()?, TransferPreset::MrSurface)
    })
}

/// Prints the table.
///
/// # Errors
/// When a frame can't be drawn.
pub fn run(arguments: &LightsArguments) -> Outcome<()> {
    let gpu = open_gpu(arguments.software)?;
    let (scene, size) = (scene()?, [arguments.size; 2]);
    let load = load_average().map_or("unknown".to_owned(), |l| format!("{l:.1}"));
    print_line(format!("{}; {}; {size:?} pixels; load {load}\n", machine(), gpu.describe()))?;
    print_line(
        "| lighting mode | preset | first frame, ms | frame, ms | CPU ms | memory above the first mode's, MiB | pixels | error: \
         surfaces, tissue |\n|---|---|---:|---:|---:|---:|---:|---|",
    )?;
    let mut least_bytes = None;
    for mode in LightingMode::VARIANTS {
        for of in Preset::VARIANTS {
            let quality = Quality { occlusion_strength: 1.0, ..preset(*mode, *of) };
            let mut renderer = ContextRenderer::new(&gpu)?;
            reset_peak();
            let mut frames = Vec::new();
            for _ in 0..=arguments.frames {
                let (ms, cpu_ms, drawn) = timed(|| -> Outcome<()> {
                    renderer.render(&gpu, &scene, &quality, size)?;
                    Ok(gpu.wait()?)
                });
                drawn?;
                frames.push((ms, cpu_ms.unwrap_or(f64::NAN)));
            }
            let bytes = peak_bytes().unwrap_or_default();
            let least = *least_bytes.get_or_insert(bytes);
            let [walls, cpus]: [Vec<f64>; 2] =
                [frames.iter().skip(1).map(|f| f.0).collect(), frames.iter().skip(1).map(|f| f.1).collect()];
            let [width, height] = renderer.frame().ok_or("no frame was drawn")?.size_px;
            let error = expected_error(&quality).map_or("–".to_owned(), |[a, b]| format!("{a:.4}, {b:.4}"));
            print_line(format!(
                "| {} | {} | {:.0} | {:.0} | {:.0} | {:.0} | {width}x{height} | {error} |",
                row(*mode).title,
                of.name(),
                frames.first().map_or(f64::NAN, |f| f.0),
                median(&walls),
                median(&cpus),
                (bytes as f64 - least as f64) / f64::from(1 << 20),
            ))?;
        }
    }
    Ok(())
}
