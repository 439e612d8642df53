//! Pictures of the window: asked for, received, written.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, mpsc},
};

use egui::{ColorImage, Context, Rect};

use crate::{error::AppError, output, world::jobs::Waker};

/// A picture of the window that arrived, and what to do with it.
struct Picture {
    image: Arc<ColorImage>,
    crop: Option<Rect>,
    pixels_per_point: f32,
    path: PathBuf,
}

/// Pictures on their way.
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
    /// Asks for a picture of the window, or of the part of it in `crop`, to be written to `path`.
    pub fn ask(&self, ctx: &Context, crop: Option<Rect>, path: &Path) {
        let (send, path, wake) = (self.send.clone(), path.to_owned(), Waker::of(ctx));
        let pixels_per_point = ctx.pixels_per_point();
        ctx.request_screenshot(move |image| {
            // The window may be closing: then nobody writes the picture.
            let _ = send.send(Picture { image, crop, pixels_per_point, path });
            wake.wake();
        });
    }

    /// Writes what has arrived since; the path of each, or why it couldn't be written.
    pub fn write(&self) -> Vec<Result<PathBuf, AppError>> {
        let write = |Picture { image, crop, pixels_per_point, path }: Picture| {
            output::write_window_png(&path, &image, crop, pixels_per_point).map(|()| path)
        };
        self.receive.try_iter().map(write).collect()
    }
}
