//! Change views of two algorithms' masks that stand in for two dates: pictures and times.
//! `change DATA_FOLDER OUT_FOLDER [size=512] [frames=5] [real] [only=NAME] [large=VOXELS]`; `large`: balls on a
//! grid of so many voxels along each side, without an image, in place of the case.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::needless_pass_by_value,
    reason = "an example: it ends at the first error, and prints"
)]

use std::{path::Path, sync::Arc, time::Instant};

use glam::DVec3;
use glioscope_core::{
    Grid, MaskBits, Progress,
    case::{CaseSpec, LoadOptions, load},
    change::{ChangeOptions, change},
};
use glioscope_render::{
    AdapterPreference, Camera, ChangeContext, ChangeLook, ChangeRenderer, ChangeScene, ChangeStyle,
    ChangeSurface, ClipPlane, ContextVolume, Gpu, Projection, Quality, TransferPreset,
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

/// A ball that grew on one side and shrank on the other.
fn large_scene(n: usize, like: &ChangeScene) -> ChangeScene {
    let grid = Grid::axis_aligned([n; 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let ball = |shift: f64| {
        MaskBits::from_fn([n; 3], |l| {
            let v = DVec3::new((l % n) as f64, (l / n % n) as f64, (l / n / n) as f64) / n as f64;
            v.distance(DVec3::new(0.5 + shift, 0.5, 0.5)) < 0.4
        })
    };
    let surface = surface_of(&ball(-0.03), &ball(0.03), &grid);
    let center_mm = grid.center_mm();
    ChangeScene {
        surface: Some(surface),
        context: ChangeContext { volume: None, ..like.context.clone() },
        camera: Camera::fit(
            center_mm,
            0.5 * n as f64,
            Camera::orientation(50.0, 20.0),
            Projection::Perspective,
        ),
        ..like.clone()
    }
}

fn surface_of(before: &MaskBits, after: &MaskBits, grid: &Grid) -> Arc<ChangeSurface> {
    let start = Instant::now();
    let found = change(before, after, grid, &ChangeOptions::default(), &Progress::new()).unwrap();
    println!(
        "change {:.0} ms: {} vectors, {} unpartnered, {:?}",
        start.elapsed().as_secs_f64() * 1e3,
        found.vectors.len(),
        found.unpartnered.len(),
        found.flags
    );
    let start = Instant::now();
    let surface = Arc::new(ChangeSurface::new(before, after, grid, Arc::new(found)).unwrap());
    println!("surface {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
    surface
}

fn whole_scene(data: &Path) -> ChangeScene {
    let file = |name: &str| format!("{}/glioma-5-algorithms/{name}.nii.gz", data.display());
    let masks = [format!("before={}", file("hnfnetv1-20")), format!("after={}", file("isen-20"))];
    let spec = CaseSpec::from_arguments(&masks, &[format!("t1c={}", file("t1c"))]).unwrap();
    let case = load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
    let time = &case.time_points[0];
    let [before, after] = [0, 1].map(|k| time.masks[k].mask.bits());
    let grid = time.masks[0].mask.grid();
    let surface = surface_of(before, after, grid);
    let volume = Arc::new(ContextVolume::new(Arc::clone(&time.contexts[0].volume)));
    let center_mm = surface.volume().grid().center_mm();
    let radius_mm = 0.9 * surface.volume().grid().corners_mm()[0].distance(center_mm);
    ChangeScene {
        surface: Some(surface),
        look: ChangeLook::default(),
        base: ChangeLook::BASE,
        context: ChangeContext {
            transfer: Arc::new(TransferPreset::MrSurface.transfer(volume.statistics())),
            volume: Some(volume),
            clip: Vec::new(),
        },
        camera: Camera::fit(center_mm, radius_mm, Camera::orientation(50.0, 20.0), Projection::Perspective),
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
    let mut renderer = ChangeRenderer::new(&gpu).unwrap();
    println!("{}; times from {}", gpu.describe(), renderer.time_source().describe());
    let mut height = whole_scene(data);
    if let Some(n) = value("large=") {
        height = large_scene(n.parse().unwrap(), &height);
    }
    let mut arrows = height.clone();
    arrows.look.style = ChangeStyle::Arrows;
    let mut safe = height.clone();
    [safe.look.grow, safe.look.shrink] = ChangeLook::COLOR_BLIND_SAFE;
    let mut safe_arrows = arrows.clone();
    [safe_arrows.look.grow, safe_arrows.look.shrink] = ChangeLook::COLOR_BLIND_SAFE;
    let mut all_arrows = arrows.clone();
    all_arrows.look.threshold_mm = 0.0;
    let mut alone = arrows.clone();
    alone.context.volume = None;
    let mut raw = height.clone();
    raw.look.smooth_mm = 0.0;
    raw.context.volume = None;
    let mut head = height.clone();
    head.camera.height_mm *= 2.2;
    head.context.clip = vec![ClipPlane {
        normal: DVec3::Z,
        offset_mm: height.surface.as_ref().unwrap().volume().grid().center_mm().z,
    }];
    head.camera.world_from_camera = Camera::orientation(20.0, 50.0);
    let mut near = arrows.clone();
    near.camera.height_mm *= 0.3;
    let scenes = [
        ("height", height),
        ("arrows", arrows),
        ("height_safe", safe),
        ("arrows_safe", safe_arrows),
        ("arrows_all", all_arrows),
        ("arrows_alone", alone),
        ("arrows_near", near),
        ("height_raw", raw),
        ("height_head", head),
    ];
    for (name, light) in scenes.iter().filter(|s| only.as_deref().is_none_or(|o| s.0.starts_with(o))) {
        let dark = ChangeScene { background: [24, 26, 30], silhouette: [235, 235, 235], ..light.clone() };
        for (shade, scene) in [("_dark", &dark), ("", light)] {
            renderer.render(&gpu, scene, &Quality::FULL, [size; 2]).unwrap();
            let frame = renderer.frame().unwrap();
            let rgba = frame.read_rgba(&gpu).unwrap();
            let path = format!("{out}/{name}{shade}.png");
            image::RgbaImage::from_raw(frame.size_px[0], frame.size_px[1], rgba).unwrap().save(path).unwrap();
        }
        let arrows = renderer.frame().unwrap().arrows;
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
                    "{name:12} {size} {kind:5} {arrows} arrows, whole {:6.1} ms, CPU {:4.0} ms ",
                    median(whole),
                    median(cpu)
                );
                for (column, pass) in names.iter().enumerate() {
                    print!(" {pass} {:.1}", median(rows.iter().map(|r| r[column]).collect()));
                }
                println!();
            }
        }
    }
}
