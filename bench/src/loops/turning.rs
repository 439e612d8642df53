//! The automatic quality on a real case: frame times while the camera rotates, then of the still view; and the cost of
//! the lighting passes. See docs/performance.md.

use std::{path::PathBuf, sync::Arc, time::Instant};

use clap::{Args, builder::PossibleValuesParser};
use glam::DQuat;
use glioscope_core::{
    RegionVolume, Selection,
    optics::{Camera, Projection},
};
use glioscope_render::{
    ContextRenderer, ContextScene, ContextVolume, Gpu, LightingMode, MaskColors, Palette, Preset, Quality,
    TransferPreset,
    light::{self, Auto, BUDGET_MS},
};
use strum::{VariantArray, VariantNames};

use super::open_case;
use crate::{
    Outcome,
    clock::{load_average, median, ms_since, timed},
    open_gpu, print_line,
};

/// Arguments of `turning`.
#[derive(Debug, Args)]
pub struct TurningArguments {
    /// Folder with glioma-5-algorithms
    #[arg(default_value = "../shared/data")]
    data: PathBuf,
    /// Width in pixels
    #[arg(long, default_value_t = 700)]
    width: u32,
    /// Height in pixels
    #[arg(long, default_value_t = 600)]
    height: u32,
    /// Frames of the rotation
    #[arg(long, default_value_t = 60)]
    pictures: usize,
    /// Only this lighting mode
    #[arg(long, value_parser = PossibleValuesParser::new(<LightingMode as VariantNames>::VARIANTS))]
    only: Option<String>,
    /// Use only the software graphics adapter
    #[arg(long)]
    software: bool,
}

fn scene(arguments: &TurningArguments) -> Outcome<ContextScene> {
    let masks = ["hnfnetv1-20", "isen-20", "scan-20"]
        .map(|name| format!("{name}=glioma-5-algorithms/{name}.nii.gz:1,2,4"));
    let case = open_case(
        &arguments.data,
        &masks.each_ref().map(String::as_str),
        &["T1c=glioma-5-algorithms/t1c.nii.gz"],
    )?;
    let time = case.time_points.first().ok_or("no date")?;
    let image = time.contexts.first().ok_or("no image")?;
    let volume = Arc::new(ContextVolume::new(Arc::clone(&image.volume)));
    let (low, high) = volume.grid().bounds_mm();
    let preset = TransferPreset::first_for(volume.statistics(), "T1c");
    Ok(ContextScene {
        projection: None,
        transfer: Arc::new(preset.transfer(volume.statistics())),
        volume: Some(volume),
        clip: Vec::new(),
        tumor: RegionVolume::of(&time.index, &time.regions).map(Arc::new),
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 3]),
        lens: None,
        tubes: Vec::new(),
        camera: Camera::fit(
            (low + high) / 2.0,
            (high - low).length() * 0.36,
            Camera::orientation(30.0, 20.0),
            Projection::Perspective,
        ),
        background: [244, 244, 242],
        silhouette: [0, 0, 0],
    })
}

/// Milliseconds of a copy between two buffers that moves `bytes`, half of them read and half written: median of five
/// copies. Above 1 GiB, extrapolated from a copy of 1 GiB.
fn copy_ms(gpu: &Gpu, bytes: u64) -> Outcome<f64> {
    let size = (bytes / 2).clamp(4, 1 << 29) / 4 * 4;
    let [from, to] = [wgpu::BufferUsages::COPY_SRC, wgpu::BufferUsages::COPY_DST].map(|usage| {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("copy"),
            size,
            usage,
            mapped_at_creation: false,
        })
    });
    // Batched: on a GPU one copy takes less time than its submission.
    let copies = ((1 << 28) / size).clamp(1, 1000);
    let mut times = Vec::new();
    for _ in 0..6 {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for _ in 0..copies {
            encoder.copy_buffer_to_buffer(&from, 0, &to, 0, size);
        }
        let (ms, _, done) = timed(|| {
            gpu.queue.submit([encoder.finish()]);
            gpu.wait()
        });
        done?;
        times.push(ms / copies as f64);
    }
    Ok(median(&times[1..]) * bytes as f64 / (2 * size) as f64)
}

/// The passes that compute the image's lighting.
const LIGHT_PASSES: [&str; 2] = ["slices", "light_grid"];

/// Prints the time of the lighting passes alone, one row per preset: per slice, per sample, and relative to a copy of
/// as many bytes as they move at least.
fn print_light_cost(gpu: &Gpu, scene: &ContextScene, size: [u32; 2]) -> Outcome<()> {
    print_line(
        "\n| lighting mode | preset | frame ms | until submitted, ms | lighting passes, ms | slices | ms per slice | samples, millions | \
         ns per sample | least MB moved | copy of as many MB, ms | lighting / copy |\n\
         |---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    )?;
    // The others don't affect the image.
    let modes = <LightingMode as VariantArray>::VARIANTS.iter().filter(|m| light::row(**m).has_aperture);
    for &mode in modes {
        for preset in <Preset as VariantArray>::VARIANTS {
            let mut renderer = ContextRenderer::new(gpu)?;
            let quality = light::preset(mode, *preset);
            let (mut frames, mut submits, mut passes) = (Vec::new(), Vec::new(), Vec::new());
            for _ in 0..4 {
                let (ms, _, done) = timed(|| -> Outcome<f64> {
                    let start = Instant::now();
                    renderer.render(gpu, scene, &quality, size)?;
                    let submitted_ms = ms_since(start);
                    gpu.wait()?;
                    Ok(submitted_ms)
                });
                submits.push(done?);
                frames.push(ms);
                let light_passes = renderer
                    .pass_times(gpu)?
                    .into_iter()
                    .filter(|(pass, _)| LIGHT_PASSES.contains(&pass.name()));
                passes.push(light_passes.map(|t| t.1).sum::<f64>());
            }
            // The first frame compiles the pipelines.
            let (frame, pass_ms) = (median(&frames[1..]), median(&passes[1..]));
            let submitted = median(&submits[1..]);
            let work = renderer.light_work().ok_or("the image is not lit")?;
            let copy = copy_ms(gpu, work.bytes)?;
            let slices = match work.slices {
                0 => "– | –".to_owned(),
                n => format!("{n} | {:.3}", pass_ms / f64::from(n)),
            };
            print_line(format!(
                "| {} | {} | {frame:.1} | {submitted:.2} | {pass_ms:.2} | {slices} | {:.2} | {:.2} | {:.1} | {copy:.3} | {:.1} |",
                mode.name(),
                preset.name(),
                work.samples as f64 * 1e-6,
                pass_ms * 1e6 / work.samples as f64,
                work.bytes as f64 * 1e-6,
                pass_ms / copy,
            ))?;
        }
    }
    Ok(())
}

/// Prints the tables.
///
/// # Errors
/// When the case can't be read, or a frame can't be drawn.
pub fn run(arguments: &TurningArguments) -> Outcome<()> {
    let size = [arguments.width, arguments.height];
    let gpu = open_gpu(arguments.software)?;
    let mut scene = scene(arguments)?;
    let start = scene.camera.world_from_camera;
    let load = load_average().map_or("unknown".to_owned(), |l| format!("{l:.1}"));
    print_line(format!(
        "{}; {}x{} pixels; budget {BUDGET_MS} ms; load {load}",
        gpu.describe(),
        size[0],
        size[1]
    ))?;
    print_line(
        "| lighting mode | median ms, from the 9th frame on | fastest to slowest | within 120 ms | cost | \
         pixels drawn | still: balanced, reference ms | equal to the reference |\n|---|---:|---:|---:|---:|---:|---:|---|",
    )?;
    let is_selected = |mode: &&LightingMode| arguments.only.as_deref().is_none_or(|name| mode.name() == name);
    for &mode in <LightingMode as VariantArray>::VARIANTS.iter().filter(is_selected) {
        time_rotation(&gpu, &mut scene, mode, arguments.pictures, size)?;
        scene.camera.world_from_camera = start;
    }
    if arguments.only.is_none() {
        print_light_cost(&gpu, &scene, size)?;
    }
    Ok(())
}

/// Prints the frame times of one lighting mode: rotating with automatic quality, then still at fixed presets.
fn time_rotation(
    gpu: &Gpu,
    scene: &mut ContextScene,
    mode: LightingMode,
    frames: usize,
    size: [u32; 2],
) -> Outcome<()> {
    let start = scene.camera.world_from_camera;
    let mut renderer = ContextRenderer::new(gpu)?;
    let mut auto = Auto::of(mode);
    let mut draw = |scene: &ContextScene, quality: &Quality| -> Outcome<(f64, [u32; 2], Vec<u8>)> {
        let (ms, _, drawn) = timed(|| -> Outcome<_> {
            let frame = renderer.render(gpu, scene, quality, size)?.clone();
            gpu.wait()?;
            Ok(frame)
        });
        let frame = drawn?;
        Ok((ms, frame.size_px, frame.read_rgba(gpu)?))
    };
    // The first frame compiles and uploads.
    draw(scene, &light::at_cost(mode, auto.cost()))?;
    let mut times = Vec::new();
    let mut drawn = [0; 2];
    for n in 0..frames {
        scene.camera.world_from_camera = start * DQuat::from_rotation_y(0.05 * n as f64);
        let (frame_ms, size_px, _) = draw(scene, &light::at_cost(mode, auto.cost()))?;
        drawn = size_px;
        auto.adapt(frame_ms);
        times.push(frame_ms);
    }
    let steady_ms = times.split_off(8.min(times.len()));
    let within_budget = steady_ms.iter().filter(|t| **t <= 1.2 * BUDGET_MS).count();
    let fastest = steady_ms.iter().copied().fold(f64::INFINITY, f64::min);
    let slowest = steady_ms.iter().copied().fold(0.0, f64::max);
    let (balanced, ..) = draw(scene, &light::preset(mode, Preset::Balanced))?;
    let (reference, _, still) = draw(scene, &light::preset(mode, Preset::Reference))?;
    let mut fresh = ContextRenderer::new(gpu)?;
    let expected = fresh.render(gpu, scene, &light::preset(mode, Preset::Reference), size)?;
    let equality = if expected.read_rgba(gpu)? == still { "yes" } else { "NO" };
    print_line(format!(
        "| {} | {:.0} | {fastest:.0} to {slowest:.0} | {within_budget} of {} | {:.4} | {}x{} | {balanced:.0}, \
         {reference:.0} | {equality} |",
        mode.name(),
        median(&steady_ms),
        steady_ms.len(),
        auto.cost(),
        drawn[0],
        drawn[1],
    ))
}
