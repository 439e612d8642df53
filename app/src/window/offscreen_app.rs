//! The window's panes drawn without a window: for pictures with more pixels than the screen has, for the command line and for
//! reports.

use egui::{CentralPanel, Frame, Label, Panel, Ui};
use glioscope_core::Check;
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
            Some(pane) => one_pane(ui, app, pane),
        });
        Ok(rgba?)
    }

    /// As [`OffscreenApp::capture`] of a pane, above a line of text.
    ///
    /// # Errors
    /// [`AppError`] if the device fails.
    pub fn capture_above(
        &mut self,
        text: &str,
        pane: PaneId,
        size: [u32; 2],
        scale: f32,
    ) -> Result<Vec<u8>, AppError> {
        let Self { offscreen, app } = self;
        let rgba = offscreen.picture(size, scale, |ui| {
            Panel::bottom("text").show(ui, |ui| {
                ui.vertical_centered(|ui| ui.add(Label::new(text).truncate()));
            });
            one_pane(ui, app, pane);
        });
        Ok(rgba?)
    }

    /// Findings of the comparison of dates that was drawn; empty where none was.
    pub fn comparison_warnings(&self) -> Vec<Check> {
        let found = self.app.results.comparison.last().zip(self.app.work.world.case());
        found.map(|(last, case)| last.report.own_warnings(case).to_vec()).unwrap_or_default()
    }
}

fn one_pane(ui: &mut Ui, app: &mut GlioscopeApp, pane: PaneId) {
    let fill = Frame::new().fill(ui.visuals().panel_fill);
    CentralPanel::default().frame(fill).show(ui, |ui| app.one_pane(ui, pane));
}

impl Painter for OffscreenApp {
    fn picture(&mut self, pane: PaneId, size: [u32; 2]) -> Result<Vec<u8>, AppError> {
        self.app.is_picture = true;
        let picture = self.capture(Some(pane), size, REPORT_SCALE);
        self.app.is_picture = false;
        picture
    }

    fn show(&mut self, doc: &Document) {
        self.app.work.doc = Some(doc.clone());
    }

    fn adapter(&self) -> String {
        self.app.gpu().map(Gpu::describe).unwrap_or_default()
    }
}
