//! Draws panes and the window offscreen, on a graphics device without a window.

use glioscope_core::Check;
use glioscope_render::{AdapterPreference, Gpu, Plan, Quality};

use super::parse::View;
use crate::{
    command::Workstation,
    error::AppError,
    model::PaneId,
    report::Painter,
    views::view3d::{Graphics, screen::PassTimes},
    window::{GlioscopeApp, offscreen::Offscreen, recent::Recent},
};

/// The graphics device: the software adapter's, or a hardware adapter's where there is one.
pub(super) fn gpu(software: bool) -> Result<Gpu, AppError> {
    let preference = if software { AdapterPreference::SoftwareOnly } else { AdapterPreference::RealFirst };
    Ok(Gpu::headless(preference)?)
}

/// Pixels per point of pictures in a report: they are shown at about half their size, and their words must be read.
const REPORT_SCALE: f32 = 1.5;

/// Plan, pass times, quality and messages of a drawn 3D view.
#[derive(Default)]
pub(super) struct DrawReport {
    pub plan: Option<Plan>,
    pub times: Option<PassTimes>,
    pub quality: Option<Quality>,
    pub warnings: Vec<String>,
    pub notes: Vec<String>,
}

/// The application drawn offscreen, for one workstation.
pub(super) struct OffscreenApp {
    offscreen: Offscreen,
    app: GlioscopeApp,
}

impl OffscreenApp {
    pub(super) fn new(work: Workstation, gpu: &Gpu, dark: bool) -> Result<Self, AppError> {
        let offscreen = Offscreen::new(gpu, dark);
        let graphics = Graphics { gpu: gpu.clone(), egui_renderer: offscreen.renderer(), pictures: None };
        let app = GlioscopeApp::new(work, Some(graphics), Recent::default())?.refined();
        Ok(Self { offscreen, app })
    }

    /// Draws a pane or the whole window of `size` pixels at `scale` pixels per logical point. RGBA, row by row.
    pub(super) fn capture(&mut self, view: View, size: [u32; 2], scale: f32) -> Result<Vec<u8>, AppError> {
        let Self { offscreen, app } = self;
        let rgba = offscreen.picture(size, scale, |ui| match view {
            View::Window => app.draw(ui),
            View::Pane(pane) => draw_pane(ui, app, pane),
        });
        Ok(rgba?)
    }

    /// Findings of the comparison of dates that was drawn; empty where none was.
    pub(super) fn comparison_warnings(&self) -> Vec<Check> {
        let found = self.app.results.comparison.last().zip(self.app.work.world.case());
        found.map(|(last, case)| last.report.own_warnings(case).to_vec()).unwrap_or_default()
    }

    /// Report on the last frame of `pane`'s 3D view; empty for other panes. `timed`: with its pass times.
    pub(super) fn draw_report(&mut self, pane: PaneId, timed: bool) -> Result<DrawReport, AppError> {
        let Some(gpu) = self.app.gpu().cloned() else { return Ok(DrawReport::default()) };
        let Some(screen) = self.app.panes.screen(pane) else { return Ok(DrawReport::default()) };
        let mut report = DrawReport {
            plan: screen.plan().map(|(plan, _)| plan.clone()),
            times: None,
            quality: screen.quality().copied(),
            warnings: screen.warnings().to_vec(),
            notes: screen.notes().to_vec(),
        };
        if timed && report.plan.is_some() {
            report.times = Some(screen.pass_times(&gpu)?.clone());
        }
        Ok(report)
    }
}

impl Painter for OffscreenApp {
    fn picture(&mut self, pane: PaneId, size: [u32; 2]) -> Result<Vec<u8>, AppError> {
        self.capture(View::Pane(pane), size, REPORT_SCALE)
    }

    fn adapter(&self) -> String {
        self.app.gpu().map(Gpu::describe).unwrap_or_default()
    }
}

fn draw_pane(ui: &mut egui::Ui, app: &mut GlioscopeApp, pane: PaneId) {
    egui::CentralPanel::default()
        .frame(egui::Frame::new().fill(ui.visuals().panel_fill))
        .show(ui, |ui| app.one_pane(ui, pane));
}
