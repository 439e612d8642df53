//! Pictures with more pixels than the screen has: drawn again off the screen, on a worker.

use std::path::Path;

use egui::{CentralPanel, Frame, Vec2};
use glioscope_core::files::Inputs;
use glioscope_render::Gpu;

use super::{GlioscopeApp, offscreen::Offscreen, recent::Recent};
use crate::{
    command::Workstation,
    error::AppError,
    model::{Document, PaneId},
    output,
    views::view3d::Graphics,
    world::World,
};

/// What is drawn, and how large.
pub struct Enlarged {
    /// The pane, or the whole window.
    pub pane: Option<PaneId>,
    /// Its size on the screen, points.
    pub size_points: Vec2,
    /// Pixels per point of the picture.
    pub pixels_per_point: f32,
    /// The theme.
    pub dark: bool,
    /// The user's choices.
    pub doc: Document,
    /// The case.
    pub world: World,
    /// Files that aren't written over.
    pub inputs: Inputs,
}

impl Enlarged {
    /// Draws the picture and writes it to `path`.
    ///
    /// # Errors
    /// [`AppError`] if the picture has more pixels than the device draws, or can't be written.
    pub fn write(self, gpu: &Gpu, path: &Path) -> Result<(), AppError> {
        let Self { pane, size_points, pixels_per_point, dark, doc, world, inputs } = self;
        let pixels = (size_points * pixels_per_point).round().max(Vec2::splat(1.0));
        let most = gpu.device.limits().max_texture_dimension_2d;
        if pixels.max_elem() > most as f32 {
            let found = format!("a picture of {} × {} pixels", pixels.x, pixels.y);
            return Err(AppError::file(path, found, format!("at most {most} along each side")));
        }
        let size = [pixels.x as u32, pixels.y as u32];
        let offscreen = Offscreen::new(gpu, dark);
        let graphics = Graphics { gpu: gpu.clone(), egui_renderer: offscreen.renderer(), pictures: None };
        // Before seconds of drawing.
        inputs.refuse_as_output(path)?;
        let work = Workstation { doc: Some(doc), world, ..Workstation::default() };
        let mut app = GlioscopeApp::new(work, Some(graphics), Recent::default())?.refined();
        let rgba = offscreen.picture(size, pixels_per_point, |ui| match pane {
            None => app.draw(ui),
            Some(pane) => {
                let fill = Frame::new().fill(ui.visuals().panel_fill);
                CentralPanel::default().frame(fill).show(ui, |ui| app.one_pane(ui, pane));
            }
        })?;
        output::write_png(path, &inputs, size, &rgba)
    }
}
