//! What the whole-program tests share: the window on the sample without a display, the program as a
//! process, real data, and pictures compared with goldens.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::Arc,
    time::Instant,
};

use egui_kittest::{Harness, HarnessBuilder};
use egui_wgpu::{WgpuSetup, WgpuSetupCreateNew};
use glioscope::{
    command::{Command as UserCommand, EditCommand, Workstation},
    model::{CaseRef, Document, PaneId},
    views::view3d::{Graphics, ScreenReport},
    window::{GlioscopeApp, recent::Recent, run::adapter_selector},
    world::{Loaded, load},
};
use glioscope_core::{
    Progress,
    case::{self, LoadOptions},
};
use glioscope_render::{AdapterPreference, Gpu, device::gpu};
use image::RgbaImage;

/// The wgpu setup of every test: the software adapter, with what the renderer needs.
pub fn software_setup() -> WgpuSetup {
    software_setup_with(None)
}

/// As [`software_setup`], on a device whose buffers hold at most so many bytes.
fn software_setup_with(most_bytes: Option<u64>) -> WgpuSetup {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor = gpu::instance_descriptor();
    setup.native_adapter_selector = Some(adapter_selector(AdapterPreference::SoftwareOnly));
    setup.device_descriptor = Arc::new(move |adapter| {
        let mut descriptor = gpu::device_descriptor(adapter);
        if let Some(bytes) = most_bytes {
            descriptor.required_limits.max_storage_buffer_binding_size = bytes;
            descriptor.required_limits.max_buffer_size = bytes;
        }
        descriptor
    });
    WgpuSetup::CreateNew(setup)
}

/// A workstation with this case open.
///
/// # Panics
/// When the case doesn't load.
pub fn workstation(case: CaseRef) -> Workstation {
    let (options, progress) = (LoadOptions::default(), Progress::new());
    let loaded = load::spec_of(&case, &options, &progress)
        .and_then(|spec| case::load(&spec, &options, &progress))
        .map(Loaded::new);
    match loaded {
        Ok(loaded) => Workstation::with_case(case, loaded),
        Err(error) => fail(&error.to_string()),
    }
}

/// The whole window on a case, drawn without a display.
///
/// # Panics
/// When there is no software adapter.
pub fn window_on(case: CaseRef, size: [f32; 2], theme: egui::Theme) -> Window {
    window_with(workstation(case), size, theme)
}

/// The whole window on a workstation.
///
/// # Panics
/// When there is no software adapter.
pub fn window_with(work: Workstation, size: [f32; 2], theme: egui::Theme) -> Window {
    harness(work, size, theme, software_setup(), GlioscopeApp::refined)
}

/// As [`window_on`], but 3D views are drawn as drafts while something moves, as for a user.
///
/// # Panics
/// When there is no software adapter.
pub fn drafting_window_on(case: CaseRef, size: [f32; 2]) -> Window {
    harness(workstation(case), size, egui::Theme::Light, software_setup(), |app| app)
}

/// As [`window_on`], on a graphics device whose buffers hold at most `most_bytes`.
///
/// # Panics
/// When there is no software adapter.
pub fn window_on_small_device(case: CaseRef, size: [f32; 2], most_bytes: u64) -> Window {
    let setup = software_setup_with(Some(most_bytes));
    harness(workstation(case), size, egui::Theme::Light, setup, GlioscopeApp::refined)
}

fn harness(
    work: Workstation,
    size: [f32; 2],
    theme: egui::Theme,
    setup: WgpuSetup,
    finish: impl FnOnce(GlioscopeApp) -> GlioscopeApp,
) -> Window {
    HarnessBuilder::default()
        .with_size(size)
        .with_theme(theme)
        .with_max_steps(60)
        .wgpu_setup(setup)
        .build_eframe(move |cc| {
            let Some(state) = cc.wgpu_render_state.as_ref() else { fail("no software adapter") };
            let gpu = Gpu::from_parts(state.adapter.clone(), state.device.clone(), state.queue.clone());
            let graphics = Graphics { gpu, egui_renderer: state.renderer.clone() };
            match GlioscopeApp::new(work, Some(graphics), Recent::default()) {
                Ok(app) => finish(app),
                Err(error) => fail(&error.to_string()),
            }
        })
}

/// The software adapter, for renderers without a window.
///
/// # Panics
/// When there is none.
pub fn software_gpu() -> Gpu {
    match Gpu::headless(AdapterPreference::SoftwareOnly) {
        Ok(gpu) => gpu,
        Err(error) => fail(&error.to_string()),
    }
}

/// The window in a test.
pub type Window = Harness<'static, GlioscopeApp>;

/// Carries out a command; nothing is drawn yet.
pub fn issue(harness: &mut Window, command: impl Into<UserCommand>) {
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(&ctx, &command.into(), Instant::now());
}

/// Carries out a command and draws until nothing changes any more.
pub fn perform(harness: &mut Window, command: impl Into<UserCommand>) {
    issue(harness, command);
    harness.run_ok();
}

/// What went wrong last, in words; empty for nothing.
pub fn error_text(harness: &Harness<'_, GlioscopeApp>) -> String {
    harness.state().work.error.as_ref().map(ToString::to_string).unwrap_or_default()
}

/// The document of a window with a case.
///
/// # Panics
/// Without one.
pub fn doc<'a>(harness: &'a Harness<'_, GlioscopeApp>) -> &'a Document {
    match &harness.state().work.doc {
        Some(doc) => doc,
        None => fail("no case is open"),
    }
}

/// What a pane's 3D view drew.
///
/// # Panics
/// When the pane has none.
pub fn screens(harness: &mut Window, pane: PaneId) -> &mut dyn ScreenReport {
    match harness.state_mut().panes.screen(pane) {
        Some(screen) => screen,
        None => fail(&format!("{} has no 3D view", pane.title())),
    }
}

/// The picture of one pane.
///
/// # Panics
/// When it isn't drawn.
pub fn pane_picture(harness: &mut Window, pane: PaneId) -> RgbaImage {
    let Some(rect) = harness.state().pane_rect(pane) else { fail(&format!("{} is not drawn", pane.title())) };
    match harness.render() {
        Ok(picture) => crop(&picture, rect),
        Err(error) => fail(&error),
    }
}

/// Runs frames until no case is being read and no file written any more.
pub fn wait_for_workers(harness: &mut Window) {
    for _ in 0..2000 {
        harness.run_ok();
        let app = harness.state();
        if app.work.job.is_none() && !app.is_exporting() && !app.results.working() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    harness.run_ok();
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

/// Lets `pane` fill the window; where it is then.
///
/// # Panics
/// When it isn't drawn.
pub fn maximized(harness: &mut Window, pane: PaneId) -> egui::Rect {
    perform(harness, EditCommand::MaximizePane(pane));
    match harness.state().pane_rect(pane) {
        Some(rect) => rect,
        None => fail(&format!("{} is not drawn", pane.title())),
    }
}

/// Runs the program.
///
/// # Panics
/// When it can't be started.
pub fn run(program: &str, arguments: &[&str]) -> Output {
    match Command::new(program).args(arguments).output() {
        Ok(output) => output,
        Err(error) => fail(&format!("{program}: {error}")),
    }
}

/// The folder of real files, or `None` after saying that a test is skipped.
pub fn real_data(folder: &str) -> Option<PathBuf> {
    let root = std::env::var_os("GLIOSCOPE_REAL_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let path = root.join(folder);
    if path.is_dir() {
        return Some(path);
    }
    say(&format!("SKIPPED: real data folder {folder} is not here (GLIOSCOPE_REAL_DATA names its parent)"));
    None
}

/// A `.tck` file of these fibres.
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

/// The most by which a channel may differ before a pixel counts as different.
const CHANNEL_TOLERANCE: u8 = 24;
/// The share of pixels that may differ: text anti-aliasing moves a little between Mesa versions.
const PIXEL_TOLERANCE: f64 = 0.002;

/// Compares a picture with `goldens/NAME.png`. `UPDATE_GOLDENS=1` writes it instead; look at it then.
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
            fail(&format!("{}: {error}; UPDATE_GOLDENS=1 writes it, then look at it", path.display()))
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
        let seen = folder.join(format!("{name}.new.png"));
        let _ = picture.save(&seen);
        fail(&format!(
            "{name}: {different} pixels ({share:.4}) differ from the golden; see {}",
            seen.display()
        ));
    }
}

/// A part of a picture, in logical points at one pixel a point.
pub fn crop(picture: &RgbaImage, rect: egui::Rect) -> RgbaImage {
    let (x, y) = (rect.left().max(0.0) as u32, rect.top().max(0.0) as u32);
    image::imageops::crop_imm(picture, x, y, rect.width() as u32, rect.height() as u32).to_image()
}

/// How many pixels are this colour, within `tolerance` a channel.
pub fn count_color(picture: &RgbaImage, [r, g, b]: [u8; 3], tolerance: u8) -> usize {
    let near = |p: &&image::Rgba<u8>| {
        p.0[0].abs_diff(r) <= tolerance && p.0[1].abs_diff(g) <= tolerance && p.0[2].abs_diff(b) <= tolerance
    };
    picture.pixels().filter(near).count()
}

#[allow(clippy::panic, reason = "this library is only for tests: failing is its way to say so")]
#[track_caller]
fn fail(why: &str) -> ! {
    panic!("{why}")
}

#[allow(clippy::print_stdout, reason = "a skipped test must say so")]
fn say(line: &str) {
    println!("{line}");
}
