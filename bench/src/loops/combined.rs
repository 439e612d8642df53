//! Times of directional light on geometry alone, on an image alone and on both, by slices, in the form of table 1 of Schott et
//! al. 2012: what each adds to a frame without light.

use std::time::Instant;

use clap::Args;
use glioscope_render::{ContextRenderer, ContextScene, Gpu, LightingMode, Preset, Quality, light::preset};

use crate::{
    Outcome,
    accuracy::lit_solids,
    clock::{load_average, median, ms_since},
    open_gpu, print_line,
};

/// Arguments of `combined`.
#[derive(Debug, Args)]
pub struct CombinedArguments {
    /// Pixels along each side
    #[arg(long, value_delimiter = ',', default_value = "512,1024")]
    sizes: Vec<u32>,
    /// Frames of each kind, in turns; medians are reported
    #[arg(long, default_value_t = 7)]
    frames: usize,
    /// Use only the software graphics adapter
    #[arg(long)]
    software: bool,
}

/// A scene's parts: without light, its geometry in light, its image in light, both.
fn kinds(scene: &ContextScene) -> Vec<Option<(ContextScene, Quality)>> {
    let lit = preset(LightingMode::Slices, Preset::Balanced);
    let unlit = Quality { occlusion_strength: 0.0, ..preset(LightingMode::ScreenSpace, Preset::Balanced) };
    let geometry = ContextScene { volume: None, ..scene.clone() };
    let image = ContextScene { tubes: Vec::new(), tumor: None, ..scene.clone() };
    let has_geometry = !scene.tubes.is_empty() || scene.tumor.is_some();
    let has_image = scene.volume.is_some();
    vec![
        Some((scene.clone(), unlit)),
        has_geometry.then_some((geometry, lit)),
        has_image.then_some((image, lit)),
        (has_geometry && has_image).then_some((scene.clone(), lit)),
    ]
}

/// Median milliseconds of each kind, and slices of the last that has any.
fn times(gpu: &Gpu, scene: &ContextScene, size: [u32; 2], frames: usize) -> Outcome<(Vec<Option<f64>>, u32)> {
    let kinds = kinds(scene);
    let mut renderers = Vec::new();
    for _ in &kinds {
        renderers.push(ContextRenderer::new(gpu)?);
    }
    let mut ms = vec![Vec::new(); kinds.len()];
    let mut slices = 0;
    // The first frame compiles and uploads.
    for frame in 0..=frames.max(1) {
        for ((renderer, kind), ms) in renderers.iter_mut().zip(&kinds).zip(&mut ms) {
            let Some((scene, quality)) = kind else { continue };
            let start = Instant::now();
            renderer.render(gpu, scene, quality, size)?;
            gpu.wait()?;
            if frame > 0 {
                ms.push(ms_since(start));
            }
            slices = renderer.light_work().map_or(slices, |work| work.slices);
        }
    }
    let of = |ms: &Vec<f64>| (!ms.is_empty()).then(|| median(ms));
    Ok((ms.iter().map(of).collect(), slices))
}

/// Prints the table.
///
/// # Errors
/// When a scene can't be made or a frame can't be drawn.
pub fn run(arguments: &CombinedArguments) -> Outcome<()> {
    let gpu = open_gpu(arguments.software)?;
    let load = load_average().map_or("unknown".to_owned(), |l| format!("{l:.1}"));
    let light = preset(LightingMode::Slices, Preset::Balanced).lighting;
    print_line(format!("{}; load {load}", gpu.describe()))?;
    print_line(format!(
        "Slices, balanced: cone of {} degrees, {}x{} points, {} vicinity samples\n",
        light.aperture_deg, light.slice_grid, light.slice_grid, light.vicinity_samples
    ))?;
    print_line(
        "| scene | image, geometry | slices | pixels | without light, ms | geometry alone | image alone | combined |\n\
         |---|---|---:|---:|---:|---:|---:|---:|",
    )?;
    for (name, what, scene) in lit_solids()? {
        for size in &arguments.sizes {
            let (ms, slices) = times(&gpu, &scene, [*size; 2], arguments.frames)?;
            let cell = |ms: &Option<f64>| ms.map_or("–".to_owned(), |ms| format!("{ms:.0}"));
            let cells: Vec<String> = ms.iter().map(cell).collect();
            let slices = if slices > 0 { slices.to_string() } else { "–".to_owned() };
            print_line(format!("| {name} | {what} | {slices} | {size}² | {} |", cells.join(" | ")))?;
        }
    }
    Ok(())
}
