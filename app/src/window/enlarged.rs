//! Pictures with more pixels than the screen has: drawn again off the screen, on a worker.

use std::path::Path;

use egui::Vec2;
use glioscope_core::files::Inputs;
use glioscope_render::Gpu;

use super::offscreen_app::OffscreenApp;
use crate::{
    command::Workstation,
    error::AppError,
    model::{Document, PaneId},
    output,
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
        // Before seconds of drawing.
        inputs.refuse_as_output(path)?;
        let work = Workstation { doc: Some(doc), world, ..Workstation::default() };
        let rgba = OffscreenApp::new(work, gpu, dark)?.capture(pane, size, pixels_per_point)?;
        output::write_png(path, &inputs, size, &rgba)
    }
}
