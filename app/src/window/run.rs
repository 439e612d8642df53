//! Opens the real window.

use std::sync::Arc;

use egui_wgpu::{NativeAdapterSelectorMethod, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use glioscope_core::case::LoadOptions;
use glioscope_render::{AdapterPreference, Gpu, gpu};

use crate::{
    document::CaseRef,
    recent::Recent,
    session,
    viewport::Viewport,
    window::{GlioscopeApp, open_command, waker},
    workstation::Workstation,
};

/// Takes the adapter that `preference` asks for, of those that can draw to the window.
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

/// How the window starts.
#[derive(Clone, Debug, Default)]
pub struct Start {
    /// What to open; `None` opens the sample.
    pub case: Option<CaseRef>,
    /// Files of fibre tracts beside it.
    pub tracts: Vec<std::path::PathBuf>,
    /// Limits and choices of loading.
    pub options: LoadOptions,
    /// Whether only the software adapter is used.
    pub software: bool,
    /// Write a picture of the window here once the case is drawn, then quit.
    pub picture: Option<std::path::PathBuf>,
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// One line: no display, or no graphics adapter and what to install.
pub fn run(start: Start) -> Result<(), String> {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    let preference =
        if start.software { AdapterPreference::SoftwareOnly } else { AdapterPreference::RealFirst };
    setup.instance_descriptor = gpu::instance_descriptor();
    setup.native_adapter_selector = Some(adapter_selector(preference));
    setup.device_descriptor = Arc::new(gpu::device_descriptor);
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("Glioscope")
            .with_app_id("glioscope")
            .with_inner_size([1440.0, 900.0])
            .with_min_inner_size([640.0, 420.0])
            .with_drag_and_drop(true),
        wgpu_options: WgpuConfiguration {
            wgpu_setup: WgpuSetup::CreateNew(setup),
            ..WgpuConfiguration::default()
        },
        ..eframe::NativeOptions::default()
    };
    eframe::run_native(
        "Glioscope",
        options,
        Box::new(move |cc| {
            let render_state = cc.wgpu_render_state.as_ref().ok_or("no graphics adapter")?;
            let gpu = Gpu::from_parts(
                render_state.adapter.clone(),
                render_state.device.clone(),
                render_state.queue.clone(),
            );
            let viewport = Viewport::new(gpu, render_state.renderer.clone())?;
            let mut work = Workstation {
                options: start.options.clone(),
                accept_guesses: start.picture.is_some(),
                ..Workstation::default()
            };
            let wake = waker(&cc.egui_ctx);
            match start.case.clone().unwrap_or_default() {
                CaseRef::Path(path) if session::is_session(&path) => {
                    work.open_session(&path, &start.tracts, wake);
                }
                case => work.open_with(case, start.tracts.clone(), None, wake),
            }
            let app = GlioscopeApp::new(work, Some(viewport), Recent::of_user());
            Ok(Box::new(match start.picture {
                Some(path) => app.picture_and_quit(path),
                None => app,
            }))
        }),
    )
    .map_err(|e| {
        format!(
            "the window can't be opened ({e}); a display is needed, and a Vulkan driver: on Debian or Ubuntu \
             install mesa-vulkan-drivers and libvulkan1"
        )
    })
}

/// The case reference that a path on the command line stands for.
pub fn case_of_path(path: std::path::PathBuf) -> CaseRef {
    match open_command(path) {
        crate::commands::Command::OpenSession(path) => CaseRef::Path(path),
        crate::commands::Command::Open(case) => case,
        _ => CaseRef::Sample,
    }
}
