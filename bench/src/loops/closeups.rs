//! The closeup on real and made cases beside a peer: error of the occlusion against the hemisphere, times of frames while
//! turning, and everything that a peer needs to draw the same masks from the same camera (`bench/peer_ssao.py`). See
//! docs/performance.md.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::Args;
use glam::DVec3;
use glioscope_core::{
    Grid, Mask, MaskBits, RegionVolume, Regions, Selection, TumorIndex,
    case::TimePoint,
    files::write_whole,
    optics::{Camera, Projection, srgb},
    phantom,
};
use glioscope_render::{
    CloseupRenderer, Gpu, LightingMode, MaskColors, Palette, Preset, Quality, RegionScene, light::preset,
};
use serde_json::json;

use super::{open_case, views};
use crate::{
    Outcome,
    clock::{load_average, median, ms_since},
    hemisphere::{HemisphereTruth, radius_mm, through_voxels},
    open_gpu, print_line,
};

/// Arguments of `closeups`.
#[derive(Debug, Args)]
pub struct CloseupsArguments {
    /// Folder with glioma-5-algorithms and sarcoma-ct-mr-pet
    #[arg(default_value = "../shared/data")]
    data: PathBuf,
    /// Folder for the frames as PNG files, and for masks, cameras and truths as the peer reads them
    #[arg(long)]
    out: PathBuf,
    /// Pixels along each side
    #[arg(long, default_value_t = 512)]
    size: u32,
    /// Frames of each kind while turning; medians are reported
    #[arg(long, default_value_t = 7)]
    frames: usize,
    /// Directions at each pixel that is evaluated
    #[arg(long, default_value_t = 1024)]
    samples: u32,
    /// Only the passes' times, the fastest of the frames, at 4 rays as while moving
    #[arg(long)]
    passes: bool,
    /// Only scenes whose name starts with this
    #[arg(long)]
    only: Option<String>,
    /// Use only the software graphics adapter
    #[arg(long)]
    software: bool,
}

/// Degrees that the camera turns between two frames, as the peer's.
const TURN_DEG: f64 = 7.0;

/// What is measured: name, quality.
fn kinds() -> [(&'static str, Quality); 4] {
    let traced = preset(LightingMode::Traced, Preset::Balanced);
    let of = |rays| Quality { occlusion_rays: rays, ..traced };
    [
        ("point pairs", preset(LightingMode::ScreenSpace, Preset::Balanced)),
        ("horizons", preset(LightingMode::Horizon, Preset::Balanced)),
        ("rays, moving", of(4)),
        ("rays, still", of(Quality::MOST_RAYS)),
    ]
}

fn scene(tumor: RegionVolume, masks: usize) -> RegionScene {
    let center_mm = tumor.grid().center_mm();
    let radius_mm = 0.75 * tumor.grid().corners_mm()[0].distance(center_mm);
    RegionScene {
        tumor: Some(Arc::new(tumor)),
        selection: Selection::all(),
        colors: MaskColors::new(Palette::default(), &vec![None; masks]),
        lens: None,
        camera: Camera::fit(center_mm, radius_mm, Camera::orientation(35.0, 20.0), Projection::Perspective),
        background: [255, 255, 255],
        silhouette: [40, 40, 40],
        plane: None,
    }
}

fn of_date(time: &TimePoint) -> Outcome<RegionScene> {
    let tumor = RegionVolume::of(&time.index, &time.regions).ok_or("the masks are empty")?;
    Ok(scene(tumor, time.masks.len()))
}

fn of_mask(mask: &Mask) -> Outcome<RegionScene> {
    let index = TumorIndex::new(mask.grid().clone(), &[mask])?;
    Ok(scene(RegionVolume::of(&index, &Regions::of(&index)).ok_or("the mask is empty")?, 1))
}

/// Every sixth slice of a mask, 6 mm thick.
fn thick_slices(mask: &Mask) -> Outcome<Mask> {
    let fine = mask.grid();
    let [nx, ny, nz] = fine.dims();
    let mut world_from_voxel = fine.world_from_voxel();
    world_from_voxel.matrix3.z_axis *= 6.0;
    let grid = Grid::new([nx, ny, nz / 6], world_from_voxel, fine.sides())?;
    let bits = MaskBits::from_fn(grid.dims(), |linear| {
        let [i, j, k] = grid.ijk(linear);
        mask.bits().get([i, j, 6 * k])
    });
    Ok(Mask::new("thick".to_owned(), grid, bits).ok_or("bits that don't fit their grid")?)
}

fn scenes(data: &Path) -> Outcome<Vec<(&'static str, RegionScene)>> {
    let phantom = phantom::phantom_case()?;
    let first = phantom.time_points.first().ok_or("no date")?;
    let later = phantom.time_points.last().and_then(|t| t.masks.first()).ok_or("no later mask")?;
    let three = views::glioma(data)?;
    let five = ["hnfnetv1-20", "isen-20", "sanet0-20", "scan-20", "yixinmpl-20"]
        .map(|name| format!("{name}=glioma-5-algorithms/{name}.nii.gz:1,2,4"));
    let five = open_case(data, &five.each_ref().map(String::as_str), &[])?;
    let sarcoma = ["CT", "MR_T1", "PET"].map(|m| format!("{m}=sarcoma-ct-mr-pet/{m}_mask.nii.gz"));
    let sarcoma = open_case(data, &sarcoma.each_ref().map(String::as_str), &[])?;
    let date = |case: &glioscope_core::case::Case| -> Outcome<RegionScene> {
        of_date(case.time_points.first().ok_or("no date")?)
    };
    let thick = three.time_points.first().and_then(|t| t.masks.first()).ok_or("no mask")?;
    Ok(vec![
        ("head-phantom", of_date(first)?),
        ("glioma-three", date(&three)?),
        ("glioma-five", date(&five)?),
        ("sarcoma", date(&sarcoma)?),
        ("follow-up", of_mask(&later.mask)?),
        ("slices-6-mm", of_mask(&thick_slices(&thick.mask)?)?),
    ])
}

/// Root mean square of the share of light that is lost, found less true; the truth's own noise is taken out.
fn rms(found: &[f64], truth: &HemisphereTruth) -> f64 {
    let squares = truth.pixels.iter().map(|(at, hidden, _)| {
        let dark = found.get(*at).copied().unwrap_or(f64::NAN);
        (dark - hidden).powi(2)
    });
    (squares.sum::<f64>() / truth.pixels.len().max(1) as f64 - truth.variance()).max(0.0).sqrt()
}

/// The light lost at each pixel, as the frame has it.
fn dark(renderer: &CloseupRenderer, gpu: &Gpu, quality: &Quality) -> Outcome<(Vec<f64>, Vec<f64>)> {
    let found = renderer.frame().ok_or("no frame was drawn")?.occlusion(gpu)?;
    let is_encoded = quality.lighting.mode != LightingMode::ScreenSpace;
    let linear = |d: &f64| if is_encoded { 1.0 - srgb::decode(1.0 - d) } else { *d };
    Ok((found.depths_mm.clone(), found.dark.iter().map(linear).collect()))
}

fn write_peer(
    out: &Path,
    name: &str,
    scene: &RegionScene,
    size: [u32; 2],
    truth: &HemisphereTruth,
    still: &[f64],
) -> Outcome<()> {
    let tumor = scene.tumor.as_ref().ok_or("no masks")?;
    let grid = tumor.grid();
    let ids: Vec<u8> = (0..grid.voxel_count()).map(|l| tumor.id(l).min(255) as u8).collect();
    let colors: Vec<[u8; 3]> = tumor.bits_of_id().iter().map(|b| scene.colors.region(*b)).collect();
    let [_, up, _] = scene.camera.axes();
    let rows: Vec<[f64; 4]> = (0..3)
        .map(|r| {
            let a = grid.world_from_voxel();
            [a.matrix3.col(0)[r], a.matrix3.col(1)[r], a.matrix3.col(2)[r], a.translation[r]]
        })
        .collect();
    let eye: DVec3 = scene.camera.eye_mm();
    let value = json!({
        "dims": grid.dims(),
        "world_from_voxel": rows,
        "colors": colors,
        "size": size,
        "eye_mm": eye.to_array(),
        "focus_mm": scene.camera.focus_mm.to_array(),
        "up": up.to_array(),
        "field_of_view_deg": 2.0 * (0.5 * scene.camera.height_mm / scene.camera.distance_mm()).atan().to_degrees(),
        "radius_mm": radius_mm(),
        "still_rms": rms(still, truth),
        "variance": truth.variance(),
        "still": truth.pixels.iter().map(|(at, _, _)| still.get(*at)).collect::<Vec<_>>(),
        "pixels": truth.pixels.iter().map(|(at, _, _)| at).collect::<Vec<_>>(),
        "hidden": truth.pixels.iter().map(|(_, h, _)| h).collect::<Vec<_>>(),
    });
    write_whole(&out.join(format!("{name}.raw")), &ids)?;
    Ok(write_whole(&out.join(format!("{name}.json")), &serde_json::to_vec(&value)?)?)
}

/// Frames while the camera turns, each drawn and read back, the kinds in turns.
fn times(gpu: &Gpu, scene: &RegionScene, size: [u32; 2], frames: usize) -> Outcome<Vec<Vec<f64>>> {
    let kinds = kinds();
    let mut renderers = Vec::new();
    for _ in &kinds {
        renderers.push(CloseupRenderer::new(gpu)?);
    }
    let mut ms = vec![Vec::new(); kinds.len()];
    for frame in 0..=frames {
        let mut turned = scene.clone();
        let [_, up, _] = scene.camera.axes();
        let by = glam::DQuat::from_axis_angle(up, (TURN_DEG * frame as f64).to_radians());
        turned.camera.world_from_camera = by * scene.camera.world_from_camera;
        for ((renderer, (_, quality)), ms) in renderers.iter_mut().zip(&kinds).zip(&mut ms) {
            let start = std::time::Instant::now();
            renderer.render(gpu, &turned, quality, size)?;
            renderer.frame().ok_or("no frame was drawn")?.read_rgba(gpu)?;
            // The first compiles and uploads.
            if frame > 0 {
                ms.push(ms_since(start));
            }
        }
    }
    Ok(ms)
}

/// The passes of a moving frame with the fastest time of each, milliseconds: on a shared machine the least disturbed.
fn fastest_passes(
    gpu: &Gpu,
    scene: &RegionScene,
    size: [u32; 2],
    frames: usize,
) -> Outcome<Vec<(&'static str, f64)>> {
    let mut renderer = CloseupRenderer::new(gpu)?;
    let [.., (_, moving), _] = kinds();
    renderer.render(gpu, scene, &moving, size)?;
    let mut fastest: Vec<(&'static str, f64)> = Vec::new();
    for _ in 0..frames.max(1) {
        let times = renderer.pass_times(gpu)?;
        if fastest.is_empty() {
            fastest = times.iter().map(|(pass, _)| (pass.name(), f64::INFINITY)).collect();
        }
        for ((_, least), (_, ms)) in fastest.iter_mut().zip(times) {
            *least = least.min(ms);
        }
    }
    Ok(fastest)
}

/// Prints the tables.
///
/// # Errors
/// When a case can't be read, or a frame can't be drawn or written.
pub fn run(arguments: &CloseupsArguments) -> Outcome<()> {
    let gpu = open_gpu(arguments.software)?;
    std::fs::create_dir_all(&arguments.out)?;
    let size = [arguments.size; 2];
    let load = load_average().map_or("unknown".to_owned(), |l| format!("{l:.1}"));
    print_line(format!("{}; {size:?} pixels, load {load}\n", gpu.describe()))?;
    if arguments.passes {
        print_line("| scene | pass | ms |\n|---|---|---:|")?;
        for (name, scene) in scenes(&arguments.data)? {
            if arguments.only.as_deref().is_some_and(|only| !name.starts_with(only)) {
                continue;
            }
            let passes = fastest_passes(&gpu, &scene, size, arguments.frames)?;
            for (pass, ms) in &passes {
                print_line(format!("| {name} | {pass} | {ms:.2} |"))?;
            }
            print_line(format!("| {name} | all | {:.2} |", passes.iter().map(|(_, ms)| ms).sum::<f64>()))?;
        }
        return Ok(());
    }
    print_line(
        "| scene | light | mean lost | RMS error | ms | of point pairs |\n|---|---|---:|---:|---:|---:|",
    )?;
    for (name, scene) in scenes(&arguments.data)? {
        if arguments.only.as_deref().is_some_and(|only| !name.starts_with(only)) {
            continue;
        }
        let ms = times(&gpu, &scene, size, arguments.frames)?;
        let mut renderer = CloseupRenderer::new(&gpu)?;
        let mut truth: Option<HemisphereTruth> = None;
        let mut still = Vec::new();
        for ((kind, quality), times) in kinds().iter().zip(&ms) {
            // Without ambient light, as the truth has none.
            let whole = Quality { occlusion_strength: 1.0, occlusion_radius_mm: radius_mm(), ..*quality };
            renderer.render(&gpu, &scene, &whole, size)?;
            let (depths, dark) = dark(&renderer, &gpu, &whole)?;
            if truth.is_none() {
                truth =
                    Some(through_voxels(&scene, size, &depths, (arguments.size / 128, arguments.samples))?);
            }
            let Some(truth) = &truth else { continue };
            print_line(format!(
                "| {name} | {kind} | {:.3} | {:.4} | {:.1} | {:.2} |",
                truth.mean(),
                rms(&dark, truth),
                median(times),
                median(times) / median(&ms[0]),
            ))?;
            still = dark;
        }
        for (theme, background) in [("light", [255, 255, 255]), ("dark", [24, 24, 27])] {
            let themed = RegionScene { background, ..scene.clone() };
            for (kind, quality) in [("before", kinds()[0].1), ("now", kinds()[3].1)] {
                renderer.render(&gpu, &themed, &quality, size)?;
                let frame = renderer.frame().ok_or("no frame was drawn")?;
                let image = image::RgbaImage::from_raw(size[0], size[1], frame.read_rgba(&gpu)?);
                let file = arguments.out.join(format!("{name}-{theme}-{kind}.png"));
                image.ok_or("fewer bytes than pixels")?.save(file)?;
            }
        }
        if let Some(truth) = &truth {
            write_peer(&arguments.out, name, &scene, size, truth, &still)?;
        }
    }
    Ok(())
}
