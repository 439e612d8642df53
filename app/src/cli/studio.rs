//! Pictures of panes and of the window on a device without one.

use glioscope_render::{AdapterPreference, Gpu, Plan, Quality};

use super::parse::View;
use crate::{
    command::Workstation,
    error::AppError,
    model::PaneId,
    views::view3d::{Graphics, screen::PassTimes},
    window::{GlioscopeApp, offscreen::Offscreen, recent::Recent},
};

/// The adapter that pictures are drawn on.
pub(super) fn gpu(software: bool) -> Result<Gpu, AppError> {
    let preference = if software { AdapterPreference::SoftwareOnly } else { AdapterPreference::RealFirst };
    Ok(Gpu::headless(preference)?)
}

/// What drawing a 3D view took.
#[derive(Default)]
pub(super) struct Drawn {
    pub plan: Option<Plan>,
    pub times: Option<PassTimes>,
    pub quality: Option<Quality>,
    pub warnings: Vec<String>,
    pub notes: Vec<String>,
}

/// Draws views of one workstation without a window.
pub(super) struct Studio {
    offscreen: Offscreen,
    app: GlioscopeApp,
}

impl Studio {
    pub(super) fn new(work: Workstation, gpu: &Gpu, dark: bool) -> Result<Self, AppError> {
        let offscreen = Offscreen::new(gpu, dark);
        let graphics = Graphics { gpu: gpu.clone(), egui_renderer: offscreen.renderer() };
        let app = GlioscopeApp::new(work, Some(graphics), Recent::default())?.refined();
        Ok(Self { offscreen, app })
    }

    /// One pane, or the whole window, as pixels.
    pub(super) fn picture(&mut self, view: View, size: [u32; 2], scale: f32) -> Result<Vec<u8>, AppError> {
        let Self { offscreen, app } = self;
        let rgba = offscreen.picture(size, scale, |ui| match view {
            View::Window => app.draw(ui),
            View::Pane(pane) => draw_pane(ui, app, pane),
        });
        Ok(rgba?)
    }

    /// What the 3D view of `pane` drew; nothing of other panes. `timed`: also how long its passes took.
    pub(super) fn drawn(&mut self, pane: PaneId, timed: bool) -> Result<Drawn, AppError> {
        let Some(gpu) = self.app.gpu().cloned() else { return Ok(Drawn::default()) };
        let Some(screen) = self.app.panes.screen(pane) else { return Ok(Drawn::default()) };
        let mut drawn = Drawn {
            plan: screen.plan().map(|(plan, _)| plan.clone()),
            times: None,
            quality: screen.quality().copied(),
            warnings: screen.warnings().to_vec(),
            notes: screen.notes().to_vec(),
        };
        if timed && drawn.plan.is_some() {
            drawn.times = Some(screen.pass_times(&gpu)?.clone());
        }
        Ok(drawn)
    }
}

fn draw_pane(ui: &mut egui::Ui, app: &mut GlioscopeApp, pane: PaneId) {
    egui::CentralPanel::default()
        .frame(egui::Frame::new().fill(ui.visuals().panel_fill))
        .show(ui, |ui| app.one_pane(ui, pane));
}
