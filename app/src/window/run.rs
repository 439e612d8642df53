//! Opens the program's window.

use std::sync::{Arc, mpsc};

use egui_wgpu::{NativeAdapterSelectorMethod, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use glioscope_cohort::Collected;
use glioscope_core::{case::LoadOptions, files::absolute};
use glioscope_render::{AdapterPreference, Gpu, device::gpu};

use super::{GlioscopeApp, autosave::Autosave, preferences::Preferences, recent::Recent};
use crate::{
    command::Workstation,
    cpu_paint,
    error::AppError,
    model::{CaseRef, session},
    views::view3d::Graphics,
    world::jobs::Waker,
};

/// Selects the adapter by `preference` among those that can present to the window.
pub fn adapter_selector(preference: AdapterPreference) -> NativeAdapterSelectorMethod {
    Arc::new(move |adapters, surface| {
        let usable: Vec<_> =
            adapters.iter().filter(|a| surface.is_none_or(|s| a.is_surface_supported(s))).cloned().collect();
        gpu::choose_adapter(&usable, preference).cloned().ok_or_else(|| {
            "found no Vulkan driver that can draw here, expected one: install mesa-vulkan-drivers and libvulkan1"
                .to_owned()
        })
    })
}

/// What every window of the program needs of the system: its adapter, or the software one alone.
pub(super) fn native_options(software: bool) -> eframe::NativeOptions {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    let preference = if software { AdapterPreference::SoftwareOnly } else { AdapterPreference::RealFirst };
    setup.instance_descriptor = gpu::instance_descriptor();
    setup.native_adapter_selector = Some(adapter_selector(preference));
    setup.device_descriptor = Arc::new(gpu::device_descriptor);
    eframe::NativeOptions {
        wgpu_options: WgpuConfiguration {
            wgpu_setup: WgpuSetup::CreateNew(setup),
            ..WgpuConfiguration::default()
        },
        ..eframe::NativeOptions::default()
    }
}

/// How the window starts.
#[derive(Clone, Debug, Default)]
pub struct Start {
    /// What to open; `None` opens the sample.
    pub case: Option<CaseRef>,
    /// Files of fibre tracts to add.
    pub tracts: Vec<std::path::PathBuf>,
    /// Options of loading.
    pub options: LoadOptions,
    /// Whether only the software adapter is used.
    pub software: bool,
    /// Write a picture of the window here once the case is drawn, then quit.
    pub picture: Option<std::path::PathBuf>,
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// [`AppError`] without a display or a graphics adapter, with what to install, and if a scripted screenshot failed.
pub fn run(start: Start) -> Result<(), AppError> {
    let recent = Recent::of_user();
    let remembered = Preferences::in_folder(recent.folder()).get().clone();
    let size_points = remembered.size_points.unwrap_or([1440.0, 900.0]);
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("Glioscope")
            .with_app_id("glioscope")
            .with_inner_size(if start.picture.is_some() { [1440.0, 900.0] } else { size_points })
            .with_maximized(remembered.maximized && start.picture.is_none())
            .with_min_inner_size([640.0, 420.0])
            .with_drag_and_drop(true),
        ..native_options(start.software)
    };
    let (send, outcomes) = mpsc::channel();
    let picture = start.picture.clone();
    let create = move |cc: &eframe::CreationContext<'_>| -> Result<Box<dyn eframe::App>, _> {
        Ok(Box::new(Windowed { app: app(cc, start, recent)?, outcomes: send }))
    };
    eframe::run_native("Glioscope", options, Box::new(create))
        .map_err(|e| AppError::Window(e.to_string()))?;
    match (picture, outcomes.try_recv()) {
        (None, _) => Ok(()),
        (Some(_), Ok(outcome)) => outcome,
        (Some(path), Err(_)) => {
            Err(AppError::file(&path, "a window that closed before the picture was drawn", "a picture"))
        }
    }
}

/// The program in its window; sends how a scripted screenshot ended.
struct Windowed {
    app: GlioscopeApp,
    outcomes: mpsc::Sender<Result<(), AppError>>,
}

impl eframe::App for Windowed {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        self.app.draw(ui);
        if let Some(outcome) = self.app.scripted_outcome() {
            // The receiver exists until the window has closed.
            let _ = self.outcomes.send(outcome);
        }
    }
}

fn app(
    cc: &eframe::CreationContext<'_>,
    start: Start,
    recent: Recent,
) -> Result<GlioscopeApp, Box<dyn std::error::Error + Send + Sync>> {
    let render_state = cc.wgpu_render_state.as_ref().ok_or("no graphics adapter")?;
    let gpu = Gpu::from_parts(
        render_state.adapter.clone(),
        render_state.device.clone(),
        render_state.queue.clone(),
    );
    let pictures =
        gpu.is_software().then(|| cpu_paint::install(&cc.egui_ctx, &gpu, render_state.target_format));
    let graphics = Graphics { gpu, egui_renderer: render_state.renderer.clone(), pictures };
    let mut work = Workstation {
        options: start.options,
        accept_guesses: start.picture.is_some(),
        ..Workstation::default()
    };
    let wake = Waker::of(&cc.egui_ctx);
    match start.case.unwrap_or_default() {
        CaseRef::Path(path) if session::is_session(&path) => work.open_session(&path, &start.tracts, wake),
        CaseRef::Path(path) if Collected::is_at(&path) => work.open_cohort(&absolute(&path)),
        case => work.open(case, start.tracts, wake),
    }
    let app = GlioscopeApp::new(work, Some(graphics), recent)?;
    Ok(match start.picture {
        Some(path) => app.picture_and_quit(path),
        None => app.autosaved(Autosave::of_user()),
    })
}
