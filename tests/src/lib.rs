//! Shared helpers of the whole-program tests: the window without a display, the program as a process, real data, and
//! comparison of images with goldens.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::Arc,
    time::Instant,
};

use egui_kittest::{Harness, HarnessBuilder, kittest::Queryable};
use egui_wgpu::{WgpuSetup, WgpuSetupCreateNew};
use glioscope::{
    command::{Command as UserCommand, EditCommand, Workstation},
    cpu_paint::{self, ViewPictures},
    model::{CaseRef, Document, PaneId, layout},
    views::view3d::{Graphics, ScreenReport},
    window::{GlioscopeApp, autosave::Autosave, recent::Recent, run::adapter_selector},
    world::{Loaded, load},
};
use glioscope_core::{
    Grid, Progress, Samples, Volume,
    case::{self, LoadOptions},
    files::{WriteOptions, write_nifti},
    glam::DVec3,
    optics::srgb,
    volume::Scaling,
};
use glioscope_render::{AdapterPreference, Gpu, device::gpu};
use image::RgbaImage;
use serde_json::Value;

/// The colours of the first three masks in the default palette.
pub const MASK_COLORS: [[u8; 3]; 3] = [[194, 28, 5], [10, 116, 100], [138, 17, 206]];

/// The wgpu setup of every test: the software adapter, with the features and limits that the renderer requires.
pub fn software_setup() -> WgpuSetup {
    software_setup_with(None)
}

/// As [`software_setup`], with device buffers limited to `max_buffer_bytes` each.
fn software_setup_with(max_buffer_bytes: Option<u64>) -> WgpuSetup {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor = gpu::instance_descriptor();
    setup.native_adapter_selector = Some(adapter_selector(AdapterPreference::SoftwareOnly));
    setup.device_descriptor = Arc::new(move |adapter| {
        let mut descriptor = gpu::device_descriptor(adapter);
        if let Some(bytes) = max_buffer_bytes {
            descriptor.required_limits.max_storage_buffer_binding_size = bytes;
            descriptor.required_limits.max_buffer_size = bytes;
        }
        descriptor
    });
    WgpuSetup::CreateNew(setup)
}

/// The arrangement for cases of one time point, with the change view and the dates as hidden tabs behind the closeup and
/// the context view: so tests find every view at the same place in every case.
pub fn every_view() -> egui_tiles::Tree<PaneId> {
    let mut tree = layout::default_layout(layout::Held { dates: 1, images: 1, has_pet: false, masks: 3 });
    for (hidden, shown) in [(PaneId::Change, PaneId::Closeup), (PaneId::Dates, PaneId::Context)] {
        layout::toggle(&mut tree, hidden);
        tree.make_active(|_, tile| matches!(tile, egui_tiles::Tile::Pane(pane) if *pane == shown));
    }
    tree
}

/// A workstation with `case` open, and its views arranged as [`every_view`].
///
/// # Panics
/// When the case doesn't load.
pub fn workstation(case: CaseRef) -> Workstation {
    let (options, progress) = (LoadOptions::default(), Progress::new());
    let loaded = load::spec_of(&case, &options, &progress)
        .and_then(|spec| case::load(&spec, &options, &progress))
        .map(Loaded::new);
    match loaded {
        Ok(loaded) => {
            let mut work = Workstation::with_case(case, loaded);
            if let Some(doc) =
                work.doc.as_mut().filter(|doc| layout::contains(&doc.edit.layout, PaneId::Change))
            {
                doc.edit.layout = every_view();
            }
            work
        }
        Err(error) => fail(&error.to_string()),
    }
}

/// The application window with `case` open, rendered without a display.
///
/// # Panics
/// When there is no software adapter.
pub fn window_on(case: CaseRef, size: [f32; 2], theme: egui::Theme) -> Window {
    window_with(workstation(case), size, theme)
}

/// The window with the sample, light, 1280 by 800 points, drawn once.
///
/// # Panics
/// When there is no software adapter.
pub fn sample() -> Window {
    let mut harness = window_on(CaseRef::Sample, [1280.0, 800.0], egui::Theme::Light);
    harness.run_ok();
    harness
}

/// As [`window_on`], with the list of recent cases and the preferences beside it.
///
/// # Panics
/// When there is no software adapter.
pub fn window_of_user(recent: Recent, size: [f32; 2]) -> Window {
    let work = workstation(CaseRef::Sample);
    harness(work, size, egui::Theme::Light, (software_setup(), recent), GlioscopeApp::refined)
}

/// The window as it starts for a user: with a list of recent cases, preferences and copies of unsaved work, and with drafts
/// while something moves.
///
/// # Panics
/// When there is no software adapter.
pub fn user_window(work: Workstation, size: [f32; 2], recent: Recent, autosave: Option<Autosave>) -> Window {
    harness(work, size, egui::Theme::Light, (software_setup(), recent), |app| app.autosaved(autosave))
}

/// As [`window_on`], for a given workstation.
///
/// # Panics
/// When there is no software adapter.
pub fn window_with(work: Workstation, size: [f32; 2], theme: egui::Theme) -> Window {
    harness(work, size, theme, (software_setup(), Recent::default()), GlioscopeApp::refined)
}

/// As [`window_on`], but 3D views draw drafts while something moves, as they do for a user.
///
/// # Panics
/// When there is no software adapter.
pub fn drafting_window_on(case: CaseRef, size: [f32; 2]) -> Window {
    let setup = (software_setup(), Recent::default());
    harness(workstation(case), size, egui::Theme::Light, setup, |app| app)
}

/// As [`window_on`], on a graphics device whose buffers are limited to `max_buffer_bytes` each.
///
/// # Panics
/// When there is no software adapter.
pub fn window_on_small_device(case: CaseRef, size: [f32; 2], max_buffer_bytes: u64) -> Window {
    let setup = (software_setup_with(Some(max_buffer_bytes)), Recent::default());
    harness(workstation(case), size, egui::Theme::Light, setup, GlioscopeApp::refined)
}

/// As [`window_on`], `size` points at `pixels_per_point`, arranged as it opens.
///
/// # Panics
/// When there is no software adapter.
pub fn window_as_opened(case: CaseRef, size: [f32; 2], theme: egui::Theme, pixels_per_point: f32) -> Window {
    let mut work = workstation(case);
    if let (Some(doc), Some(case)) = (&mut work.doc, work.world.case()) {
        doc.edit.layout = layout::opening(layout::Held::of(case));
    }
    let setup = (software_setup(), Recent::default());
    let builder = HarnessBuilder::default().with_pixels_per_point(pixels_per_point);
    harness_painted_by((work, builder), size, theme, setup, |_, _, _| None, GlioscopeApp::refined)
}

/// As [`window_on`], painted on the CPU as in the program's window on a software adapter.
///
/// # Panics
/// When there is no software adapter.
pub fn window_painted_on_cpu(case: CaseRef, size: [f32; 2], theme: egui::Theme) -> Window {
    let setup = (software_setup(), Recent::default());
    let paint = |ctx: &_, gpu: &_, format| Some(cpu_paint::install(ctx, gpu, format));
    let of = (workstation(case), HarnessBuilder::default());
    harness_painted_by(of, size, theme, setup, paint, GlioscopeApp::refined)
}

fn harness(
    work: Workstation,
    size: [f32; 2],
    theme: egui::Theme,
    setup: (WgpuSetup, Recent),
    finish: impl FnOnce(GlioscopeApp) -> GlioscopeApp,
) -> Window {
    harness_painted_by((work, HarnessBuilder::default()), size, theme, setup, |_, _, _| None, finish)
}

fn harness_painted_by(
    (work, builder): (Workstation, HarnessBuilder<GlioscopeApp>),
    size: [f32; 2],
    theme: egui::Theme,
    (setup, recent): (WgpuSetup, Recent),
    paint: impl FnOnce(&egui::Context, &Gpu, egui_wgpu::wgpu::TextureFormat) -> Option<ViewPictures>,
    finish: impl FnOnce(GlioscopeApp) -> GlioscopeApp,
) -> Window {
    builder.with_size(size).with_theme(theme).with_max_steps(60).wgpu_setup(setup).build_eframe(move |cc| {
        let Some(state) = cc.wgpu_render_state.as_ref() else { fail("no software adapter") };
        let gpu = Gpu::from_parts(state.adapter.clone(), state.device.clone(), state.queue.clone());
        let pictures = paint(&cc.egui_ctx, &gpu, state.target_format);
        let graphics = Graphics { gpu, egui_renderer: state.renderer.clone(), pictures };
        match GlioscopeApp::new(work, Some(graphics), recent) {
            Ok(app) => finish(app),
            Err(error) => fail(&error.to_string()),
        }
    })
}

/// The software adapter, for renderers without a window.
///
/// # Panics
/// When there is no software adapter.
pub fn software_gpu() -> Gpu {
    match Gpu::headless(AdapterPreference::SoftwareOnly) {
        Ok(gpu) => gpu,
        Err(error) => fail(&error.to_string()),
    }
}

/// The window in a test.
pub type Window = Harness<'static, GlioscopeApp>;

/// Performs a command without running a frame.
pub fn issue(harness: &mut Window, command: impl Into<UserCommand>) {
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(&ctx, &command.into(), Instant::now());
}

/// Performs a command and runs frames until the window is idle.
pub fn perform(harness: &mut Window, command: impl Into<UserCommand>) {
    issue(harness, command);
    harness.run_ok();
}

/// Text of the current error; empty without one.
pub fn error_text(harness: &Harness<'_, GlioscopeApp>) -> String {
    harness.state().work.error.as_ref().map(ToString::to_string).unwrap_or_default()
}

/// The document of the open case.
///
/// # Panics
/// When no case is open.
pub fn doc<'a>(harness: &'a Harness<'_, GlioscopeApp>) -> &'a Document {
    match &harness.state().work.doc {
        Some(doc) => doc,
        None => fail("no case is open"),
    }
}

/// Plan, quality and notes of the frame last drawn in a pane's 3D view.
///
/// # Panics
/// When the pane has no 3D view.
pub fn screens(harness: &mut Window, pane: PaneId) -> &mut dyn ScreenReport {
    match harness.state_mut().panes.screen(pane) {
        Some(screen) => screen,
        None => fail(&format!("{} has no 3D view", pane.title())),
    }
}

/// Renders the window and crops one pane.
///
/// # Panics
/// When the pane isn't visible.
pub fn pane_picture(harness: &mut Window, pane: PaneId) -> RgbaImage {
    let Some(rect) = harness.state().pane_rect(pane) else { fail(&format!("{} is not drawn", pane.title())) };
    match harness.render() {
        Ok(picture) => crop(&picture, rect),
        Err(error) => fail(&error),
    }
}

/// Runs frames until no worker is loading a case, exporting files or computing results.
pub fn wait_for_workers(harness: &mut Window) {
    for _ in 0..2000 {
        harness.run_ok();
        let app = harness.state_mut();
        if app.work.job.is_none() && !app.is_exporting() && !app.results.working() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    harness.run_ok();
}

/// Chooses an entry of a drop-down list by its text. Other widgets of that text may be drawn before the list.
///
/// # Panics
/// When the list has no such entry.
pub fn choose(harness: &mut Window, field: &str, entry: &str) {
    harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, field).click();
    harness.run_ok();
    match harness.query_all_by_label(entry).last() {
        Some(found) => found.click(),
        None => fail(&format!("{field} has no entry {entry}")),
    }
    wait_for_workers(harness);
}

/// A file dropped on the window.
#[derive(Debug)]
pub struct Dropped(pub PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|e| e.to_string())
    }
}

/// Maximises `pane` and returns its rectangle.
///
/// # Panics
/// When the pane isn't visible.
pub fn maximized(harness: &mut Window, pane: PaneId) -> egui::Rect {
    perform(harness, EditCommand::MaximizePane(pane));
    match harness.state().pane_rect(pane) {
        Some(rect) => rect,
        None => fail(&format!("{} is not drawn", pane.title())),
    }
}

/// Runs `program` to its end and captures its output.
///
/// # Panics
/// When it can't be started.
pub fn run(program: &str, arguments: &[&str]) -> Output {
    match Command::new(program).args(arguments).output() {
        Ok(output) => output,
        Err(error) => fail(&format!("{program}: {error}")),
    }
}

/// What the program answers to these arguments as JSON, and what it says on stderr.
///
/// # Panics
/// When it fails, or answers something else.
pub fn answer(program: &str, arguments: &[&str]) -> (Value, String) {
    let output = run(program, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {stderr}");
    match serde_json::from_slice(&output.stdout) {
        Ok(value) => (value, stderr),
        Err(error) => fail(&format!("{arguments:?}: {error}")),
    }
}

/// What the program says when it refuses these arguments: its last line on stderr.
///
/// # Panics
/// When it ends with another exit code than 2.
pub fn refusal(program: &str, arguments: &[&str]) -> String {
    let output = run(program, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
    stderr.lines().last().unwrap_or_default().to_owned()
}

/// A folder of real data, or `None` after printing that the test is skipped.
pub fn real_data(folder: &str) -> Option<PathBuf> {
    let root = std::env::var_os("GLIOSCOPE_REAL_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let path = root.join(folder);
    if path.is_dir() {
        return Some(path);
    }
    print_line(&format!(
        "SKIPPED: real data folder {folder} is absent (GLIOSCOPE_REAL_DATA names its parent)"
    ));
    None
}

/// Writes a cube of `side` voxels of `spacing_mm` with these values by index as NIfTI, and the folder that it lies in.
///
/// # Panics
/// When it can't be written.
pub fn write_cube(path: &Path, side: usize, spacing_mm: f64, value: impl Fn([usize; 3]) -> u8) {
    let written = || -> Result<(), Box<dyn std::error::Error>> {
        let grid = Grid::axis_aligned([side; 3], DVec3::splat(spacing_mm), DVec3::ZERO)?;
        let samples = Samples::U8((0..grid.voxel_count()).map(|l| value(grid.ijk(l))).collect());
        std::fs::create_dir_all(path.parent().unwrap_or(path))?;
        let volume = Volume::new(grid, samples, Scaling::NONE).ok_or("another number of values")?;
        Ok(write_nifti(path, &volume, &WriteOptions::default())?)
    };
    if let Err(error) = written() {
        fail(&error.to_string());
    }
}

/// Writes fibres, points in RAS+ mm, as an MRtrix `.tck` file.
///
/// # Panics
/// When it can't be written.
pub fn write_tck(path: &Path, fibers: &[Vec<[f32; 3]>]) {
    let mut header =
        format!("mrtrix tracks\ndatatype: Float32LE\ncount: {}\nfile: . 128\nEND\n", fibers.len());
    header.extend(std::iter::repeat_n('\0', 128 - header.len()));
    let mut bytes = header.into_bytes();
    let mut push = |p: [f32; 3]| bytes.extend(p.iter().flat_map(|v| v.to_le_bytes()));
    for fiber in fibers {
        fiber.iter().for_each(|&p| push(p));
        push([f32::NAN; 3]);
    }
    push([f32::INFINITY; 3]);
    #[allow(clippy::disallowed_methods, reason = "a test's own folder")]
    if let Err(error) = std::fs::write(path, bytes) {
        fail(&error.to_string());
    }
}

/// Largest difference of a channel, in 8-bit steps, at which two pixels count as equal.
const CHANNEL_TOLERANCE: u8 = 24;
/// Largest fraction of differing pixels: text anti-aliasing varies slightly between Mesa versions.
const PIXEL_TOLERANCE: f64 = 0.002;

/// Compares an image with `goldens/NAME.png`. `UPDATE_GOLDENS=1` overwrites the golden instead; inspect it afterwards.
///
/// # Panics
/// When they differ, or there is no golden.
pub fn golden(name: &str, picture: &RgbaImage) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("goldens");
    let path = folder.join(format!("{name}.png"));
    if std::env::var_os("UPDATE_GOLDENS").is_some() {
        let _ = std::fs::create_dir_all(&folder);
        if let Err(error) = picture.save(&path) {
            fail(&format!("{}: {error}", path.display()));
        }
        return;
    }
    let expected = match image::open(&path) {
        Ok(image) => image.to_rgba8(),
        Err(error) => {
            fail(&format!("{}: {error}; UPDATE_GOLDENS=1 writes it; inspect it afterwards", path.display()))
        }
    };
    if expected.dimensions() != picture.dimensions() {
        fail(&format!(
            "{name}: found {:?}, expected {:?} pixels",
            picture.dimensions(),
            expected.dimensions()
        ));
    }
    let differs = |(a, b): &(&image::Rgba<u8>, &image::Rgba<u8>)| {
        a.0.iter().zip(b.0).any(|(x, y)| x.abs_diff(y) > CHANNEL_TOLERANCE)
    };
    let different = picture.pixels().zip(expected.pixels()).filter(differs).count();
    let share = different as f64 / f64::from(picture.width() * picture.height());
    if share > PIXEL_TOLERANCE {
        let actual_path = folder.join(format!("{name}.new.png"));
        let _ = picture.save(&actual_path);
        fail(&format!(
            "{name}: {different} pixels ({share:.4}) differ from the golden; see {}",
            actual_path.display()
        ));
    }
}

/// Crops to `rect`, in logical points; `picture` has one pixel per point.
pub fn crop(picture: &RgbaImage, rect: egui::Rect) -> RgbaImage {
    let (x, y) = (rect.left().max(0.0) as u32, rect.top().max(0.0) as u32);
    image::imageops::crop_imm(picture, x, y, rect.width() as u32, rect.height() as u32).to_image()
}

/// Number of pixels that show `color` in more or less light: their linear values are its own times 0.25 to 1, within
/// `tolerance` in each encoded channel.
pub fn count_shades(picture: &RgbaImage, color: [u8; 3], tolerance: f64) -> usize {
    let linear = |rgb: [u8; 3]| rgb.map(|c| srgb::decode(f64::from(c) / 255.0));
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let full = linear(color);
    let is_shade = |p: [u8; 3]| {
        let light = dot(linear(p), full) / dot(full, full);
        let expected = full.map(|c| 255.0 * srgb::encode((light * c).min(1.0)));
        (0.25..=1.05).contains(&light)
            && expected.iter().zip(p).all(|(expected, c)| (expected - f64::from(c)).abs() <= tolerance)
    };
    picture.pixels().filter(|p| is_shade([p.0[0], p.0[1], p.0[2]])).count()
}

/// Number of pixels of this colour, within `tolerance` (8-bit steps) per channel.
pub fn count_color(picture: &RgbaImage, [r, g, b]: [u8; 3], tolerance: u8) -> usize {
    let near = |p: &&image::Rgba<u8>| {
        p.0[0].abs_diff(r) <= tolerance && p.0[1].abs_diff(g) <= tolerance && p.0[2].abs_diff(b) <= tolerance
    };
    picture.pixels().filter(near).count()
}

#[allow(clippy::panic, reason = "this library is only for tests, which fail by panicking")]
#[track_caller]
fn fail(why: &str) -> ! {
    panic!("{why}")
}

/// Prints a line that `./x test` summarises, such as `SKIPPED: …`.
#[allow(clippy::print_stdout, reason = "a skipped test must be reported")]
pub fn print_line(line: &str) {
    println!("{line}");
}
