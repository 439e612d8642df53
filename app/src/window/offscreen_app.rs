//! The window's panes drawn without a window: for pictures with more pixels than the screen has, for the command line and for
//! reports.

use egui::{CentralPanel, Frame};
use glioscope_render::Gpu;

use super::{GlioscopeApp, offscreen::Offscreen, recent::Recent};
use crate::{
    command::Workstation,
    error::AppError,
    model::{Document, PaneId},
    report::Painter,
    views::view3d::Graphics,
};

/// Pixels per point of pictures in a report: they are shown at about half their size, and their words must be read.
const REPORT_SCALE: f32 = 1.5;

/// The application drawn without a window, for one workstation.
pub struct OffscreenApp {
    offscreen: Offscreen,
    /// The application.
    pub app: GlioscopeApp,
}

impl OffscreenApp {
    /// The application on `gpu`, in the light or dark theme.
    ///
    /// # Errors
    /// [`AppError`] if the device can't run the passes.
    pub fn new(work: Workstation, gpu: &Gpu, dark: bool) -> Result<Self, AppError> {
        let offscreen = Offscreen::new(gpu, dark);
        let graphics = Graphics { gpu: gpu.clone(), egui_renderer: offscreen.renderer(), pictures: None };
        let app = GlioscopeApp::new(work, Some(graphics), Recent::default())?.refined();
        Ok(Self { offscreen, app })
    }

    /// Draws a pane, or the whole window, of `size` pixels at `scale` pixels per logical point. RGBA, row by row.
    ///
    /// # Errors
    /// [`AppError`] if the device fails.
    pub fn capture(&mut self, pane: Option<PaneId>, size: [u32; 2], scale: f32) -> Result<Vec<u8>, AppError> {
        let Self { offscreen, app } = self;
        let rgba = offscreen.picture(size, scale, |ui| match pane {
            None => app.draw(ui),
            Some(pane) => {
                let fill = Frame::new().fill(ui.visuals().panel_fill);
                CentralPanel::default().frame(fill).show(ui, |ui| app.one_pane(ui, pane));
            }
        });
        Ok(rgba?)
    }
}

impl Painter for OffscreenApp {
    fn picture(&mut self, pane: PaneId, size: [u32; 2]) -> Result<Vec<u8>, AppError> {
        self.capture(Some(pane), size, REPORT_SCALE)
    }

    fn show(&mut self, doc: &Document) {
        self.app.work.doc = Some(doc.clone());
    }

    fn adapter(&self) -> String {
        self.app.gpu().map(Gpu::describe).unwrap_or_default()
    }
}
