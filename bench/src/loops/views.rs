//! Times of the passes of all 3D views, on real cases and on synthetic ellipsoids; optionally writes the frames.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::Args;
use glam::{DMat3, DQuat, DVec3};
use glioscope_core::{
    Progress, RegionVolume, Selection,
    case::{Case, TimePoint},
    change::{ChangeOptions, change},
    optics::{Camera, Projection, random::Random},
};
use glioscope_render::{
    ChangeContext, ChangeLook, ChangeScene, ChangeStyle, ChangeSurface, ClipPlane, ContextScene,
    ContextVolume, DrawnEllipsoid, EllipsoidScene, Gpu, Lens, LightingMode, MaskColors, Palette, Preset,
    Quality, RegionScene, Renderer, TransferPreset, View3d,
    light::preset,
    views::{change, closeup, context, ellipsoids},
};
use strum::VariantArray;

use super::open_case;
use crate::{
    Outcome,
    clock::{median, timed},
    open_gpu, print_line,
};

/// Arguments of `views`.
#[derive(Debug, Args)]
pub struct ViewsArguments {
    /// Folder with glioma-5-algorithms and sarcoma-ct-mr-pet
    #[arg(default_value = "../shared/data")]
    data: PathBuf,
    /// Folder for the frames, as PNG files
    #[arg(long)]
    out: Option<PathBuf>,
    /// Pixels along each side
    #[arg(long, default_value_t = 512)]
    size: u32,
    /// Frames per scene and preset; medians are reported
    #[arg(long, default_value_t = 5)]
    frames: usize,
    /// Only scenes whose name starts with this
    #[arg(long)]
    only: Option<String>,
    /// Lighting mode
    #[arg(long, value_name = "MODE", default_value = LightingMode::default().name())]
    light: LightingMode,
    /// Use only the software graphics adapter
    #[arg(long)]
    software: bool,
}

struct SceneTimer<'a> {
    gpu: &'a Gpu,
    arguments: &'a ViewsArguments,
}

impl SceneTimer<'_> {
    /// Draws the scenes with one renderer and prints one row per scene and preset.
    fn time_scenes<V: View3d>(&self, scenes: &[(&str, V::Scene)]) -> Outcome<()> {
        let mut renderer = Renderer::<V>::new(self.gpu)?;
        let is_selected =
            |name: &str| self.arguments.only.as_deref().is_none_or(|only| name.starts_with(only));
        let size = [self.arguments.size; 2];
        for (name, scene) in scenes.iter().filter(|(name, _)| is_selected(name)) {
            for quality_preset in Preset::VARIANTS {
                let quality = preset(self.arguments.light, *quality_preset);
                let (mut frame_ms, mut frame_cpu_ms) = (Vec::new(), Vec::new());
                let mut passes: Vec<(&str, Vec<f64>)> = Vec::new();
                for _ in 0..self.arguments.frames.max(1) {
                    let (ms, cpu_ms, drawn) = timed(|| draw(&mut renderer, self.gpu, scene, &quality, size));
                    drawn?;
                    frame_ms.push(ms);
                    frame_cpu_ms.extend(cpu_ms);
                    for (at, (pass, ms)) in renderer.pass_times(self.gpu)?.into_iter().enumerate() {
                        match passes.get_mut(at) {
                            Some((_, times)) => times.push(ms),
                            None => passes.push((pass.name(), vec![ms])),
                        }
                    }
                }
                let passes: Vec<String> =
                    passes.iter().map(|(pass, times)| format!("{pass} {:.1}", median(times))).collect();
                print_line(format!(
                    "| {name} | {} | {:.1} | {:.0} | {} |",
                    quality_preset.name(),
                    median(&frame_ms),
                    median(&frame_cpu_ms),
                    passes.join(", ")
                ))?;
            }
            if let (Some(folder), Some(frame)) = (&self.arguments.out, renderer.frame()) {
                let [width, height] = frame.size_px;
                let image = image::RgbaImage::from_raw(width, height, frame.read_rgba(self.gpu)?);
                image.ok_or("fewer bytes than pixels")?.save(folder.join(format!("{name}.png")))?;
            }
        }
        Ok(())
    }
}

fn draw<V: View3d>(
    renderer: &mut Renderer<V>,
    gpu: &Gpu,
    scene: &V::Scene,
    quality: &Quality,
    size: [u32; 2],
) -> Outcome<()> {
    renderer.render(gpu, scene, quality, size)?;
    Ok(gpu.wait()?)
}

/// Prints the table.
///
/// # Errors
/// When a case can't be read, or a frame can't be drawn or written.
pub fn run(arguments: &ViewsArguments) -> Outcome<()> {
    let gpu = open_gpu(arguments.software)?;
    let timer = SceneTimer { gpu: &gpu, arguments };
    let size = arguments.size;
    print_line(format!("{}; {size}x{size} pixels\n", gpu.describe()))?;
    print_line("| scene | preset | ms | CPU ms | passes, ms |\n|---|---|---:|---:|---|")?;
    let glioma = glioma(&arguments.data)?;
    let glioma = glioma.time_points.first().ok_or("no date")?;
    timer.time_scenes::<closeup::Closeup>(&closeups(glioma)?)?;
    timer.time_scenes::<context::Context>(&glioma_contexts(glioma)?)?;
    timer.time_scenes::<context::Context>(&sarcoma_contexts(&arguments.data)?)?;
    timer.time_scenes::<change::Change>(&change_scenes(glioma)?)?;
    timer.time_scenes::<ellipsoids::Ellipsoids>(&diagrams())
}

pub(super) fn glioma(data: &Path) -> Outcome<Case> {
    let file = |name: &str| format!("{name}=glioma-5-algorithms/{name}.nii.gz");
    let masks = ["isen-20", "sanet0-20", "scan-20"].map(file);
    let contexts = ["t1c", "fla"].map(file);
    open_case(data, &masks.each_ref().map(String::as_str), &contexts.each_ref().map(String::as_str))
}

fn view_from(center_mm: DVec3, radius_mm: f64) -> Camera {
    Camera::fit(center_mm, radius_mm, Camera::orientation(50.0, 20.0), Projection::Perspective)
}

fn tumor_of(time: &TimePoint) -> Outcome<Arc<RegionVolume>> {
    Ok(Arc::new(RegionVolume::of(&time.index, &time.regions).ok_or("the masks are empty")?))
}

fn closeups(time: &TimePoint) -> Outcome<Vec<(&'static str, RegionScene)>> {
    let tumor = tumor_of(time)?;
    let center_mm = tumor.grid().center_mm();
    let radius_mm = 0.8 * tumor.grid().corners_mm()[0].distance(center_mm);
    let plain = RegionScene {
        tumor: Some(tumor),
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 3]),
        lens: None,
        camera: view_from(center_mm, radius_mm),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
        plane: None,
    };
    let lens = RegionScene { lens: Some(Lens { center_mm, radius_mm: 0.5 * radius_mm }), ..plain.clone() };
    let mut deselected = lens.clone();
    deselected.selection.set(0b010, false);
    let mut close = deselected.clone();
    close.camera.height_mm *= 0.35;
    Ok(vec![
        ("closeup", plain),
        ("closeup_lens", lens),
        ("closeup_deselected", deselected),
        ("closeup_near", close),
    ])
}

/// The closeup of three masks with its lens.
pub(super) fn closeup_lens(time: &TimePoint) -> Outcome<RegionScene> {
    let lens = closeups(time)?.into_iter().find(|(name, _)| *name == "closeup_lens");
    Ok(lens.ok_or("no closeup")?.1)
}

/// The head's surface around the tumour.
pub(super) fn context_surface(time: &TimePoint) -> Outcome<ContextScene> {
    context(time, "t1c", TransferPreset::MrSurface, 0.55)
}

fn context(time: &TimePoint, id: &str, preset: TransferPreset, zoom: f64) -> Outcome<ContextScene> {
    let image = time.contexts.iter().find(|c| c.id == id).ok_or("no such image")?;
    let volume = Arc::new(ContextVolume::new(Arc::clone(&image.volume)));
    let tumor = tumor_of(time)?;
    let center_mm = volume.grid().center_mm();
    let radius_mm = 1.3 * zoom * volume.grid().corners_mm()[0].distance(center_mm);
    Ok(ContextScene {
        projection: None,
        transfer: Arc::new(preset.transfer(volume.statistics())),
        volume: Some(volume),
        clip: Vec::new(),
        tubes: Vec::new(),
        lens: Some(Lens { center_mm: tumor.grid().center_mm(), radius_mm: 25.0 }),
        tumor: Some(tumor),
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &vec![None; time.masks.len()]),
        camera: view_from(center_mm, radius_mm),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    })
}

fn glioma_contexts(time: &TimePoint) -> Outcome<Vec<(&'static str, ContextScene)>> {
    let tumor_mm = tumor_of(time)?.grid().center_mm();
    let surface = context_surface(time)?;
    let mut cut = surface.clone();
    cut.clip = vec![ClipPlane { normal: DVec3::Z, offset_mm: tumor_mm.z }];
    cut.camera.world_from_camera = Camera::orientation(20.0, 50.0);
    let mut near = surface.clone();
    near.camera.height_mm *= 0.4;
    near.camera.focus_mm = tumor_mm;
    Ok(vec![
        ("context_mr_tissue", context(time, "t1c", TransferPreset::MrTissue, 0.55)?),
        ("context_mr_borders", context(time, "t1c", TransferPreset::MrBorders, 0.55)?),
        ("context_mr_surface", surface),
        ("context_mr_cut", cut),
        ("context_mr_near", near),
        ("context_flair", context(time, "fla", TransferPreset::MrSurface, 0.55)?),
    ])
}

fn sarcoma_contexts(data: &Path) -> Outcome<Vec<(&'static str, ContextScene)>> {
    let masks = ["CT=sarcoma-ct-mr-pet/CT_mask.nii.gz", "PET=sarcoma-ct-mr-pet/PET_mask.nii.gz"];
    let contexts = ["ct=sarcoma-ct-mr-pet/CT_image.nii.gz", "pet=sarcoma-ct-mr-pet/PET_image.nii.gz"];
    let case = open_case(data, &masks, &contexts)?;
    let time = case.time_points.first().ok_or("no date")?;
    Ok(vec![
        ("context_ct_soft", context(time, "ct", TransferPreset::CtSoft, 0.9)?),
        ("context_ct_bone", context(time, "ct", TransferPreset::CtBone, 0.9)?),
        ("context_ct_skin", context(time, "ct", TransferPreset::CtSkin, 0.9)?),
        ("context_pet_hot", context(time, "pet", TransferPreset::PetHot, 0.9)?),
        ("context_pet_body", context(time, "pet", TransferPreset::PetBody, 0.9)?),
    ])
}

/// Two algorithms' masks stand in for two dates.
fn change_scenes(time: &TimePoint) -> Outcome<Vec<(&'static str, ChangeScene)>> {
    let [before, after, ..] = &time.masks[..] else { return Err("two masks are needed".into()) };
    let grid = before.mask.grid();
    let [before, after] = [before, after].map(|m| m.mask.bits());
    let found = change(before, after, grid, &ChangeOptions::default(), &Progress::new())?;
    let surface = ChangeSurface::new(before, after, grid, Arc::new(found)).ok_or("the masks are empty")?;
    let image = time.contexts.first().ok_or("no image")?;
    let volume = Arc::new(ContextVolume::new(Arc::clone(&image.volume)));
    let center_mm = surface.volume().grid().center_mm();
    let radius_mm = 0.9 * surface.volume().grid().corners_mm()[0].distance(center_mm);
    let height = ChangeScene {
        surface: Some(Arc::new(surface)),
        look: ChangeLook::default(),
        base: ChangeLook::BASE,
        context: ChangeContext {
            transfer: Arc::new(TransferPreset::MrSurface.transfer(volume.statistics())),
            volume: Some(volume),
            clip: Vec::new(),
        },
        camera: view_from(center_mm, radius_mm),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    };
    let mut arrows = height.clone();
    arrows.look.style = ChangeStyle::Arrows;
    let mut all_arrows = arrows.clone();
    all_arrows.look.threshold_mm = 0.0;
    let mut without_context = arrows.clone();
    without_context.context.volume = None;
    Ok(vec![
        ("change_height", height),
        ("change_arrows", arrows),
        ("change_arrows_all", all_arrows),
        ("change_arrows_alone", without_context),
    ])
}

/// A diagram of `count` ellipsoids: three masks, their overlaps, and small ones around them.
pub(super) fn diagram(count: u32) -> EllipsoidScene {
    let colors = MaskColors::new(Palette::Thesis, &[None; 3]);
    let mut random = Random::new(5, 0);
    let shapes = [
        (0b001, [-14.0, 2.0, 3.0], [20.0, 25.0, 19.0]),
        (0b010, [4.0, -2.0, 0.0], [34.0, 27.0, 24.0]),
        (0b100, [16.0, -6.0, 9.0], [17.0, 15.0, 20.0]),
        (0b011, [-8.0, 1.0, 2.0], [14.0, 19.0, 15.0]),
        (0b110, [14.0, -6.0, 6.0], [13.0, 11.0, 14.0]),
        (0b101, [3.0, -3.0, 7.0], [7.0, 9.0, 10.0]),
        (0b111, [2.0, -3.0, 6.0], [5.0, 7.0, 8.0]),
    ];
    let ellipsoids = (0..count).map(|id| {
        let rotation =
            DQuat::from_rotation_y(random.unit() * 0.8) * DQuat::from_rotation_z(random.unit() * 0.8);
        let (bits, center_mm, semi_axes_mm) = match shapes.get(id as usize) {
            Some((bits, center, axes)) => (*bits, DVec3::from_array(*center), DVec3::from_array(*axes)),
            None => {
                let mut three = || DVec3::new(random.unit(), random.unit(), random.unit());
                let (offset, axes) = (three() * 2.0 - 1.0, three() * 2.5 + 1.0);
                (1 + (random.unit() * 6.99) as u32, offset * DVec3::new(44.0, 36.0, 32.0), axes)
            }
        };
        DrawnEllipsoid {
            id,
            center_mm,
            semi_axes_mm,
            rotation: DMat3::from_quat(rotation),
            color: colors.region(bits),
            opacity: 0.35,
        }
    });
    EllipsoidScene {
        ellipsoids: Arc::new(ellipsoids.collect()),
        opacity: 1.0,
        lens: None,
        camera: Camera::fit(DVec3::ZERO, 44.0, Camera::orientation(25.0, 18.0), Projection::Perspective),
        background: [244, 244, 242],
        silhouette: [0, 0, 0],
        plane: None,
    }
}

fn diagrams() -> Vec<(&'static str, EllipsoidScene)> {
    let few = diagram(20);
    let lens = Some(Lens { center_mm: DVec3::new(2.0, -3.0, 6.0), radius_mm: 21.0 });
    let opaque = few.ellipsoids.iter().map(|e| DrawnEllipsoid { opacity: 1.0, ..*e }).collect();
    vec![
        ("ellipsoids_20_lens", EllipsoidScene { lens, ..few.clone() }),
        ("ellipsoids_20_opaque", EllipsoidScene { ellipsoids: Arc::new(opaque), ..few.clone() }),
        ("ellipsoids_20", few),
        ("ellipsoids_300", diagram(300)),
    ]
}
