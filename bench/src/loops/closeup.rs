//! Draws synthetic blobs and times the passes: `closeup [OUT_FOLDER] [real] [quick]`.
//! Prints adapter, adapter's time source, and per pass the median of several frames.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::needless_pass_by_value,
    reason = "an example: it ends at the first error, and prints"
)]

use std::time::Instant;

use glam::DVec3;
use glioscope_render::{
    AdapterPreference, Camera, Gpu, Lens, MaskColors, Palette, Projection, Quality, Renderer, Scene,
};

#[path = "../src/testing.rs"]
mod testing;

fn save(frame: &glioscope_render::Frame, gpu: &Gpu, path: String) {
    let rgba = frame.read_rgba(gpu).unwrap();
    image::RgbaImage::from_raw(frame.size_px[0], frame.size_px[1], rgba).unwrap().save(path).unwrap();
}

fn median(mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    v[v.len() / 2]
}

/// CPU time of this process, milliseconds in steps of 10; what a busy machine leaves comparable.
fn cpu_ms() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    fields.get(11..13).map_or(0.0, |t| t.iter().filter_map(|v| v.parse::<f64>().ok()).sum::<f64>() * 10.0)
}

fn main() {
    let mut args = std::env::args().skip(1);
    let folder = args.next();
    let rest: Vec<String> = args.collect();
    let preference = if rest.iter().any(|a| a == "real") {
        AdapterPreference::RealFirst
    } else {
        AdapterPreference::SoftwareOnly
    };
    let quick = rest.iter().any(|a| a == "quick");
    let only = rest.iter().find_map(|a| a.strip_prefix("only=")).map(str::to_owned);
    let gpu = Gpu::headless(preference).unwrap();
    let mut renderer = Renderer::new(&gpu).unwrap();
    println!("{}; times from {}", gpu.describe(), renderer.time_source().describe());
    let tumor = testing::blobs(84, DVec3::ONE);
    let on = testing::scene_of(tumor.clone(), 3, Some(0.55));
    let off = testing::scene_of(tumor, 3, None);
    let mut deselected = off.clone();
    deselected.selection.set(0b010, false);
    let mut lens_deselected = on.clone();
    lens_deselected.selection.set(0b010, false);
    let mut dark = lens_deselected.clone();
    dark.background = [24, 26, 30];
    dark.silhouette = [0, 0, 0];
    let mut safe = deselected.clone();
    safe.colors = MaskColors::new(Palette::ColorBlindSafe, &[None; 3]);
    safe.camera.projection = Projection::Orthographic;
    let mut near = lens_deselected.clone();
    near.camera.height_mm *= 0.35;
    let mut thick = testing::scene_of(testing::blobs(60, DVec3::new(1.0, 1.0, 4.0)), 3, Some(0.5));
    thick.selection.set(0b010, false);
    let scenes = [
        ("on", on),
        ("off", off),
        ("deselected", deselected),
        ("lens_deselected", lens_deselected),
        ("dark", dark),
        ("safe", safe),
        ("near", near),
        ("thick", thick),
    ];
    for (name, scene) in scenes.iter().filter(|s| only.as_deref().is_none_or(|o| o == s.0)) {
        for size in [512, 1024] {
            let mut rows: Vec<Vec<f64>> = Vec::new();
            let mut whole = Vec::new();
            let mut cpu = Vec::new();
            let mut names = Vec::new();
            for _ in 0..if quick { 1 } else { 7 } {
                let (start, cpu_before) = (Instant::now(), cpu_ms());
                renderer.render(&gpu, scene, &Quality::FULL, [size, size]).unwrap();
                gpu.wait().unwrap();
                whole.push(start.elapsed().as_secs_f64() * 1e3);
                cpu.push(cpu_ms() - cpu_before);
                if quick {
                    continue;
                }
                let times = renderer.pass_times(&gpu).unwrap();
                names = times.iter().map(|t| t.0.name()).collect();
                rows.push(times.iter().map(|t| t.1).collect());
            }
            print!("{name:16} {size:5}  whole {:7.1} ms, CPU {:5.0} ms ", median(whole), median(cpu));
            for (column, pass) in names.iter().enumerate() {
                print!(" {pass} {:6.1}", median(rows.iter().map(|r| r[column]).collect()));
            }
            println!();
            if let (Some(folder), Some(frame)) = (&folder, renderer.frame()) {
                save(frame, &gpu, format!("{folder}/{name}_{size}.png"));
            }
        }
    }
}
