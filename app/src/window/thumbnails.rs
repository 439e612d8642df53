//! Small pictures of files that aren't opened yet: the axial slice through the middle of an image, or of what is active in a
//! mask. Made one after the other on a worker, and only of files that are looked at.

use std::{collections::HashMap, sync::Arc};

use egui::{ColorImage, TextureHandle, TextureOptions, Ui, vec2};
use glam::DVec3;
use glioscope_core::{
    Progress,
    files::{self, ReadOptions, Source},
};
use glioscope_render::flat::{
    ContextLayer, Convention, Plane, PreparedContext, SliceLayers, SliceStyle, SliceView, render_slice,
};

use crate::{
    error::AppError,
    world::jobs::{Job, Waker},
};

/// Side of a picture in pixels; rows show it smaller than the tip does.
const SIDE_PX: u32 = 160;
/// Larger files have no picture: reading them takes longer than looking.
const MAX_BYTES: u64 = 1 << 30;

/// Pictures of files, by what they are read from; `None`: there is none.
#[derive(Default)]
pub struct Thumbnails {
    made: HashMap<Source, Option<TextureHandle>>,
    job: Option<(Source, Job<ColorImage>)>,
}

impl Thumbnails {
    /// Draws the picture of `source` with this side in points; an empty place until it is made.
    pub fn show(&mut self, ui: &mut Ui, source: &Source, side: f32) {
        self.receive(ui);
        match self.made.get(source) {
            Some(Some(picture)) => {
                ui.image((picture.id(), vec2(side, side)));
            }
            Some(None) => drop(ui.allocate_space(vec2(side, side))),
            None => {
                ui.allocate_space(vec2(side, side));
                if self.job.is_none() {
                    let of = source.clone();
                    let job = Job::start(Waker::of(ui.ctx()), move |progress| picture(&of, progress));
                    self.job = Some((source.clone(), job));
                }
            }
        }
    }

    /// Forgets all pictures and stops the worker.
    pub fn clear(&mut self) {
        if let Some((_, job)) = self.job.take() {
            job.progress.cancel();
        }
        self.made.clear();
    }

    fn receive(&mut self, ui: &Ui) {
        let Some(result) = self.job.as_ref().and_then(|(_, job)| job.poll()) else { return };
        let Some((source, _)) = self.job.take() else { return };
        // A file that can't be read says so when the case is.
        let picture =
            result.ok().map(|image| ui.ctx().load_texture("thumbnail", image, TextureOptions::LINEAR));
        self.made.insert(source, picture);
    }
}

fn picture(source: &Source, progress: &Progress) -> Result<ColorImage, AppError> {
    let options = ReadOptions { max_bytes: MAX_BYTES, ..ReadOptions::default() };
    let volume = files::read(source, &options, progress)?.volume;
    let image = PreparedContext::new(Arc::new(volume));
    let volume = image.volume();
    let window = image.histogram().initial_window();
    let through_mm = middle_mm(&image);
    let size = [SIDE_PX; 2];
    let bounds_mm = volume.grid().bounds_mm();
    let view = SliceView::fit(Plane::Axial, Convention::Radiological, bounds_mm, through_mm, size);
    let context = Some(ContextLayer { image: &image, window });
    let slice =
        render_slice(&view, &SliceLayers { context, second: None, masks: None, style: SliceStyle::DARK });
    Ok(ColorImage::from_rgba_premultiplied(slice.size.map(|side| side as usize), &slice.rgba))
}

/// The middle of the image; of a mask, which has few values, that of what is active.
fn middle_mm(image: &PreparedContext) -> DVec3 {
    let grid = image.volume().grid();
    let is_mask = image.histogram().range().is_some_and(|(low, high)| low >= 0.0 && high <= 64.0);
    let [x, y, z] = grid.dims();
    let active = |k: &usize| {
        let first = k * x * y;
        (first..first + x * y).any(|at| image.volume().value(at) > 0.5)
    };
    let slices: Vec<usize> = if is_mask { (0..z).filter(active).collect() } else { Vec::new() };
    match (slices.first(), slices.last()) {
        (Some(first), Some(last)) => grid.center_of_voxel_mm([x / 2, y / 2, (first + last) / 2]),
        _ => grid.center_mm(),
    }
}
