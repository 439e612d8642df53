//! Context views of real cases: pictures, times, error against the step.
//! `context DATA_FOLDER OUT_FOLDER [size=512] [frames=5] [real] [curve] [only=NAME]`.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::needless_pass_by_value,
    reason = "an example: it ends at the first error, and prints"
)]

use std::{path::Path, sync::Arc, time::Instant};

use glam::DVec3;
use glioscope_core::{
    Progress, RegionVolume, Selection,
    case::{Case, CaseSpec, LoadOptions, load},
};
use glioscope_render::{
    AdapterPreference, Camera, ClipPlane, ContextRenderer, ContextScene, ContextVolume, Gpu, Lens,
    MaskColors, Palette, Projection, Quality, TransferPreset,
};

/// CPU time of this process, milliseconds in steps of 10; what a busy machine leaves comparable.
fn cpu_ms() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    fields.get(11..13).map_or(0.0, |t| t.iter().filter_map(|v| v.parse::<f64>().ok()).sum::<f64>() * 10.0)
}

fn median(mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    v[v.len() / 2]
}

fn open(data: &Path, masks: &[(&str, &str)], contexts: &[(&str, &str)]) -> Case {
    let written = |list: &[(&str, &str)]| -> Vec<String> {
        list.iter().map(|(id, file)| format!("{id}={}/{file}", data.display())).collect()
    };
    let spec = CaseSpec::from_arguments(&written(masks), &written(contexts)).unwrap();
    load(&spec, &LoadOptions::default(), &Progress::new()).unwrap()
}

fn scene(case: &Case, context: &str, preset: TransferPreset, zoom: f64) -> ContextScene {
    let time = &case.time_points[0];
    let image = &time.contexts.iter().find(|c| c.id == context).unwrap().volume;
    let start = Instant::now();
    let volume = Arc::new(ContextVolume::new(Arc::clone(image)));
    println!(
        "{context}: {:?}, prepared in {:.0} ms",
        image.grid().dims(),
        start.elapsed().as_secs_f64() * 1e3
    );
    let tumor = RegionVolume::of(&time.index, &time.regions).map(Arc::new);
    let center_mm = image.grid().center_mm();
    let radius_mm = zoom * image.grid().corners_mm()[0].distance(center_mm);
    ContextScene {
        transfer: Arc::new(preset.transfer(volume.statistics())),
        volume: Some(volume),
        clip: Vec::new(),
        tubes: Vec::new(),
        lens: tumor.as_ref().map(|t| Lens { center_mm: t.grid().center_mm(), radius_mm: 25.0 }),
        tumor,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &vec![None; time.masks.len()]),
        camera: Camera::fit(
            center_mm,
            radius_mm * 1.3,
            Camera::orientation(50.0, 20.0),
            Projection::Perspective,
        ),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    }
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let value = |key: &str| args.iter().find_map(|a| a.strip_prefix(key)).map(str::to_owned);
    let (data, out) = (Path::new(&args[0]), &args[1]);
    let size: u32 = value("size=").map_or(512, |s| s.parse().unwrap());
    let frames: usize = value("frames=").map_or(5, |s| s.parse().unwrap());
    let only = value("only=");
    let real = args.iter().any(|a| a == "real");
    let gpu =
        Gpu::headless(if real { AdapterPreference::RealFirst } else { AdapterPreference::SoftwareOnly })
            .unwrap();
    let mut renderer = ContextRenderer::new(&gpu).unwrap();
    println!("{}; times from {}", gpu.describe(), renderer.time_source().describe());

    let glioma = open(
        &data.join("glioma-5-algorithms"),
        &[("A", "isen-20.nii.gz"), ("B", "sanet0-20.nii.gz"), ("C", "scan-20.nii.gz")],
        &[("t1c", "t1c.nii.gz"), ("fla", "fla.nii.gz")],
    );
    let sarcoma = open(
        &data.join("sarcoma-ct-mr-pet"),
        &[("CT", "CT_mask.nii.gz"), ("MR", "MR_T1_mask.nii.gz"), ("PET", "PET_mask.nii.gz")],
        &[("ct", "CT_image.nii.gz"), ("mr", "MR_T1_image.nii.gz"), ("pet", "PET_image.nii.gz")],
    );
    let surface = scene(&glioma, "t1c", TransferPreset::MrSurface, 0.55);
    let mut cut = surface.clone();
    let tumor_mm = surface.tumor.as_ref().unwrap().grid().center_mm();
    cut.clip = vec![ClipPlane { normal: DVec3::Z, offset_mm: tumor_mm.z }];
    cut.camera.world_from_camera = Camera::orientation(20.0, 50.0);
    let mut near = surface.clone();
    near.camera.height_mm *= 0.4;
    near.camera.focus_mm = tumor_mm;
    let with = |scene: &ContextScene, preset: TransferPreset| ContextScene {
        transfer: Arc::new(preset.transfer(scene.volume.as_ref().unwrap().statistics())),
        ..scene.clone()
    };
    let skin = scene(&sarcoma, "ct", TransferPreset::CtSkin, 0.9);
    let scenes = [
        ("mr_tissue", with(&surface, TransferPreset::MrTissue)),
        ("mr_borders", with(&surface, TransferPreset::MrBorders)),
        ("mr_surface", surface),
        ("mr_cut", cut),
        ("mr_near", near),
        ("flair", scene(&glioma, "fla", TransferPreset::MrSurface, 0.55)),
        ("ct_soft", with(&skin, TransferPreset::CtSoft)),
        ("ct_bone", with(&skin, TransferPreset::CtBone)),
        ("ct_skin", skin),
        ("sarcoma_mr", scene(&sarcoma, "mr", TransferPreset::MrSurface, 0.9)),
        ("pet_hot", scene(&sarcoma, "pet", TransferPreset::PetHot, 0.9)),
        ("pet_body", scene(&sarcoma, "pet", TransferPreset::PetBody, 0.9)),
    ];
    for (name, light) in scenes.iter().filter(|s| only.as_deref().is_none_or(|o| s.0.starts_with(o))) {
        let dark = ContextScene { background: [24, 26, 30], silhouette: [235, 235, 235], ..light.clone() };
        for (shade, scene) in [("", light), ("_dark", &dark)] {
            renderer.render(&gpu, scene, &Quality::FULL, [size; 2]).unwrap();
            let frame = renderer.frame().unwrap();
            let rgba = frame.read_rgba(&gpu).unwrap();
            let path = format!("{out}/{name}{shade}.png");
            image::RgbaImage::from_raw(frame.size_px[0], frame.size_px[1], rgba).unwrap().save(path).unwrap();
        }
        for (kind, quality) in [("full", Quality::FULL), ("draft", Quality::DRAFT)] {
            let (mut whole, mut cpu) = (Vec::new(), Vec::new());
            let mut rows: Vec<Vec<f64>> = Vec::new();
            let mut names = Vec::new();
            for _ in 0..frames {
                let (start, cpu_before) = (Instant::now(), cpu_ms());
                renderer.render(&gpu, light, &quality, [size; 2]).unwrap();
                gpu.wait().unwrap();
                whole.push(start.elapsed().as_secs_f64() * 1e3);
                cpu.push(cpu_ms() - cpu_before);
                let times = renderer.pass_times(&gpu).unwrap();
                names = times.iter().map(|t| t.0.name()).collect();
                rows.push(times.iter().map(|t| t.1).collect());
            }
            if frames > 0 {
                print!(
                    "{name:12} {size} {kind:5} whole {:7.1} ms, CPU {:5.0} ms ",
                    median(whole),
                    median(cpu)
                );
                for (column, pass) in names.iter().enumerate() {
                    print!(" {pass} {:6.1}", median(rows.iter().map(|r| r[column]).collect()));
                }
                println!();
            }
        }
        if args.iter().any(|a| a == "curve") {
            curve(&gpu, &mut renderer, name, light, size);
        }
    }
}

/// Median time of the march at `size`, and error of a picture of 128x128 against the `f64` reference at
/// 1/16 mm, by step.
fn curve(gpu: &Gpu, renderer: &mut ContextRenderer, name: &str, scene: &ContextScene, size: u32) {
    use glioscope_render::reference::emission::{Sampling, march};
    // Without tumour, the picture is the march over the background.
    let alone = ContextScene { tumor: None, lens: None, ..scene.clone() };
    let small = [128; 2];
    let truth = march(&alone, small, Sampling { step_mm: 1.0 / 16.0, jitter: false });
    for step_mm in [0.125, 0.25, 0.5, 1.0, 2.0, 4.0] {
        let quality = Quality { context_step_mm: step_mm, ..Quality::FULL };
        let rgba = renderer.render(gpu, &alone, &quality, small).unwrap().read_rgba(gpu).unwrap();
        let (mut square, mut worst, mut n) = (0.0, 0.0_f64, 0.0);
        for (found, truth) in rgba.chunks(4).zip(&truth) {
            for c in 0..3 {
                let expected = 255.0 * (truth[c] + (1.0 - truth[3]) * f64::from(scene.background[c]) / 255.0);
                let off = (f64::from(found[c]) - expected).abs();
                square += off * off;
                worst = worst.max(off);
                n += 1.0;
            }
        }
        let (mut times, mut cpu) = (Vec::new(), Vec::new());
        for _ in 0..5 {
            let cpu_before = cpu_ms();
            renderer.render(gpu, &alone, &quality, [size; 2]).unwrap();
            gpu.wait().unwrap();
            cpu.push(cpu_ms() - cpu_before);
            let passes = renderer.pass_times(gpu).unwrap();
            times.extend(passes.iter().filter(|p| p.0 == glioscope_render::PassName::Context).map(|p| p.1));
        }
        println!(
            "{name} step {step_mm} mm: march {:.1} ms (frame CPU {:.0} ms), RMS {:.2}/255, worst {worst:.0}/255",
            median(times),
            median(cpu),
            (square / n).sqrt()
        );
    }
}
