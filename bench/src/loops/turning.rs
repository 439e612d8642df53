//! The automatic mode on a real case: the camera turns about it, each picture is timed, then all is still.
//! `turning DATA_FOLDER [size=WxH] [pictures=N] [only=LIGHT]`; see docs/performance.md.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "an example: it ends at the first error, and prints"
)]

use std::{path::Path, sync::Arc, time::Instant};

use glam::DQuat;
use glioscope::views::still::{Auto, BUDGET_MS};
use glioscope_core::{
    Progress, RegionVolume, Selection,
    case::{CaseSpec, LoadOptions, load},
};
use glioscope_render::{
    AdapterPreference, Camera, ContextRenderer, ContextScene, ContextVolume, Gpu, MaskColors, Palette,
    PassName, Preset, Projection, Quality, Shading, TransferPreset,
};

fn scene(folder: &Path) -> ContextScene {
    let file = |name: &str| folder.join(format!("glioma-5-algorithms/{name}.nii.gz")).display().to_string();
    let masks = ["hnfnetv1-20", "isen-20", "scan-20"].map(|name| format!("{name}={}:1,2,4", file(name)));
    let spec = CaseSpec::from_arguments(&masks, &[format!("T1c={}", file("t1c"))]).unwrap();
    let case = load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
    let time = &case.time_points[0];
    let volume = Arc::new(ContextVolume::new(Arc::clone(&time.contexts[0].volume)));
    let (low, high) = volume.grid().bounds_mm();
    ContextScene {
        transfer: Arc::new(
            TransferPreset::first_for(volume.statistics(), "T1c").transfer(volume.statistics()),
        ),
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
    }
}

/// Milliseconds to move so many bytes from one buffer to another, half of them read and half written: median of
/// five copies. Of more than 1 GiB as much of a copy of that.
fn copy_ms(gpu: &Gpu, bytes: u64) -> f64 {
    let size = (bytes / 2).clamp(4, 1 << 29) / 4 * 4;
    let [from, to] = [wgpu::BufferUsages::COPY_SRC, wgpu::BufferUsages::COPY_DST].map(|usage| {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("copy"),
            size,
            usage,
            mapped_at_creation: false,
        })
    });
    let mut times: Vec<f64> = (0..6)
        .map(|_| {
            // Many at once: a graphics card's copy is shorter than handing it over.
            let times = ((1 << 28) / size).clamp(1, 1000);
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            for _ in 0..times {
                encoder.copy_buffer_to_buffer(&from, 0, &to, 0, size);
            }
            let begin = Instant::now();
            gpu.queue.submit([encoder.finish()]);
            gpu.wait().unwrap();
            begin.elapsed().as_secs_f64() * 1e3 / times as f64
        })
        .skip(1)
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2] * bytes as f64 / (2 * size) as f64
}

/// The pass of light alone at the presets, a row each: per slice, per sample, and against a copy of the bytes that it must
/// at least move.
fn per_sample(gpu: &Gpu, scene: &ContextScene, size: [u32; 2]) {
    println!(
        "\n| light | preset | frame ms | pass | pass ms | slices | ms a slice | samples, millions | ns a sample | MB that must move | copy of these ms | pass / copy |"
    );
    println!("|---|---|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|");
    for shading in [Shading::Slices, Shading::Cones] {
        for preset in Preset::ALL {
            let mut renderer = ContextRenderer::new(gpu).unwrap();
            let quality = Quality::preset(shading, preset);
            let pass = if shading == Shading::Slices { PassName::Slices } else { PassName::LightGrid };
            let (mut frames, mut passes) = (Vec::new(), Vec::new());
            for _ in 0..4 {
                let begin = Instant::now();
                renderer.render(gpu, scene, &quality, size).unwrap();
                gpu.wait().unwrap();
                frames.push(begin.elapsed().as_secs_f64() * 1e3);
                let times = renderer.pass_times(gpu).unwrap();
                passes.push(times.iter().filter(|t| t.0 == pass).map(|t| t.1).sum::<f64>());
            }
            // The first compiles.
            let median = |mut v: Vec<f64>| {
                v.remove(0);
                v.sort_by(f64::total_cmp);
                v[v.len() / 2]
            };
            let (frame, pass_ms) = (median(frames), median(passes));
            let work = renderer.light_work().unwrap();
            let copy = copy_ms(gpu, work.bytes);
            let slices = if work.slices > 0 {
                format!("{} | {:.3}", work.slices, pass_ms / f64::from(work.slices))
            } else {
                "– | –".to_owned()
            };
            println!(
                "| {} | {} | {frame:.1} | {} | {pass_ms:.2} | {slices} | {:.2} | {:.2} | {:.1} | {copy:.3} | {:.1} |",
                shading.name(),
                preset.name(),
                pass.name(),
                work.samples as f64 * 1e-6,
                pass_ms * 1e6 / work.samples as f64,
                work.bytes as f64 * 1e-6,
                pass_ms / copy,
            );
        }
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let option = |name: &str| arguments.iter().find_map(|a| a.strip_prefix(name)?.strip_prefix('='));
    let pictures: usize = option("pictures").map_or(60, |n| n.parse().unwrap());
    let (width, height) = option("size").unwrap_or("700x600").split_once('x').unwrap();
    let size: [u32; 2] = [width.parse().unwrap(), height.parse().unwrap()];
    let gpu = Gpu::headless(AdapterPreference::RealFirst).unwrap();
    let mut scene = scene(Path::new(&arguments[0]));
    let start = scene.camera.world_from_camera;
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("{}; {width}x{height} pixels; budget {BUDGET_MS} ms; load {}", gpu.describe(), load.trim());
    println!(
        "| light | median ms, pictures from the 9th on | fastest to slowest | within 120 ms | cost | pixels drawn | still: balanced, reference ms | equal to the reference |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---|");
    let only = option("only");
    for shading in Shading::ALL.into_iter().filter(|s| only.is_none_or(|name| s.name() == name)) {
        let mut renderer = ContextRenderer::new(&gpu).unwrap();
        let mut auto = Auto::of(shading);
        let mut draw = |scene: &ContextScene, quality: &Quality| {
            let begin = Instant::now();
            let frame = renderer.render(&gpu, scene, quality, size).unwrap();
            let a = begin.elapsed().as_secs_f64() * 1e3;
            gpu.wait().unwrap();
            let took = begin.elapsed().as_secs_f64() * 1e3;
            let out = (took, frame.size_px, frame.clone());
            if std::env::var("SPLIT").is_ok() {
                println!("{:?} at {:?}, begun after {a:.1} of {took:.1} ms", out.1, quality.cost);
                println!("{:?}", renderer.pass_times(&gpu).unwrap());
            }
            out
        };
        // Compiles and uploads.
        draw(&scene, &Quality::at_cost(shading, auto.cost()));
        let mut times = Vec::new();
        let mut drawn = [0; 2];
        for n in 0..pictures {
            scene.camera.world_from_camera = start * DQuat::from_rotation_y(0.05 * n as f64);
            let (took, size_px, _) = draw(&scene, &Quality::at_cost(shading, auto.cost()));
            drawn = size_px;
            if n >= 8 && took > 1.2 * BUDGET_MS {
                let (again, ..) = draw(&scene, &Quality::at_cost(shading, auto.cost()));
                println!("late: {took:.0} ms; the same picture again: {again:.0} ms");
            }
            auto.took(took);
            times.push(took);
        }
        let mut late = times.split_off(8.min(times.len()));
        let within = late.iter().filter(|t| **t <= 1.2 * BUDGET_MS).count();
        let count = late.len();
        late.sort_by(f64::total_cmp);
        let (balanced, ..) = draw(&scene, &Quality::preset(shading, Preset::Balanced));
        let (reference, _, frame) = draw(&scene, &Quality::preset(shading, Preset::Reference));
        let rested = frame.read_rgba(&gpu).unwrap();
        let mut fresh = ContextRenderer::new(&gpu).unwrap();
        let wanted = fresh.render(&gpu, &scene, &Quality::preset(shading, Preset::Reference), size).unwrap();
        let equal = wanted.read_rgba(&gpu).unwrap() == rested;
        println!(
            "| {} | {:.0} | {:.0} to {:.0} | {within} of {count} | {:.4} | {}x{} | {balanced:.0}, {reference:.0} | {} |",
            shading.name(),
            late.get(count / 2).copied().unwrap_or_default(),
            late.first().copied().unwrap_or_default(),
            late.last().copied().unwrap_or_default(),
            auto.cost(),
            drawn[0],
            drawn[1],
            if equal { "yes" } else { "NO" },
        );
        println!("first pictures: {:?}", times.iter().map(|t| t.round()).collect::<Vec<_>>());
    }
    scene.camera.world_from_camera = start;
    if only.is_none() {
        per_sample(&gpu, &scene, size);
    }
}
