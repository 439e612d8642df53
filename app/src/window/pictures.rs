//! Screenshots of the window: requested, received and written to files.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, mpsc},
};

use egui::{ColorImage, Context, Rect};
use glioscope_core::files::Inputs;

use crate::{error::AppError, output, world::jobs::Waker};

/// A received screenshot, with what to crop and where to write it.
struct Picture {
    image: Arc<ColorImage>,
    crop: Option<Rect>,
    pixels_per_point: f32,
    path: PathBuf,
    inputs: Inputs,
}

/// Requested screenshots.
pub struct Pictures {
    send: mpsc::Sender<Picture>,
    receive: mpsc::Receiver<Picture>,
}

impl Default for Pictures {
    fn default() -> Self {
        let (send, receive) = mpsc::channel();
        Self { send, receive }
    }
}

impl Pictures {
    /// Requests a screenshot of the window, or of its part in `crop` (points), to be written to `path`.
    /// Nothing is written over one of `inputs`.
    pub fn request(&self, ctx: &Context, crop: Option<Rect>, path: &Path, inputs: Inputs) {
        let (send, path, wake) = (self.send.clone(), path.to_owned(), Waker::of(ctx));
        let pixels_per_point = ctx.pixels_per_point();
        ctx.request_screenshot(move |image| {
            // Fails only while the window closes, when nothing is written any more.
            let _ = send.send(Picture { image, crop, pixels_per_point, path, inputs });
            wake.wake();
        });
    }

    /// Writes the screenshots received since the last call; returns the path or error of each.
    pub fn write(&self) -> Vec<Result<PathBuf, AppError>> {
        let write = |Picture { image, crop, pixels_per_point, path, inputs }: Picture| {
            output::write_window_png(&path, &inputs, &image, crop, pixels_per_point).map(|()| path)
        };
        self.receive.try_iter().map(write).collect()
    }
}
