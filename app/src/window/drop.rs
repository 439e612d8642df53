//! Files dropped on the window.

use std::path::PathBuf;

use egui::Context;
use glioscope_core::files::format::volume_names;

use super::dialogs::{is_tracts, open_command};
use crate::{
    command::{AppCommand, Commands},
    theme,
};

/// Adds dropped fibre tracts to the open case, and opens the first other file or folder. Returns the number of other
/// files and folders.
pub fn dropped(ctx: &Context, case_is_open: bool, out: &mut Commands) -> usize {
    let paths: Vec<PathBuf> =
        ctx.input(|i| i.raw.dropped_files.iter().map(|f| f.path().to_owned()).collect());
    let (tracts, paths): (Vec<PathBuf>, Vec<PathBuf>) =
        paths.into_iter().partition(|path| case_is_open && is_tracts(path));
    if !tracts.is_empty() {
        out.push(AppCommand::AddTracts(tracts));
    }
    if let Some(path) = paths.first() {
        out.push(open_command(path.clone()));
    }
    if ctx.input(|i| !i.raw.hovered_files.is_empty()) {
        hint(ctx);
    }
    paths.len()
}

fn hint(ctx: &Context) {
    let layer = egui::LayerId::new(egui::Order::Foreground, egui::Id::unique("drop"));
    let painter = ctx.layer_painter(layer);
    let rect = ctx.content_rect();
    painter.rect_filled(rect, 0.0, theme::PLATE);
    painter.text(
        rect.center(),
        egui::Align2::CENTER_CENTER,
        format!(
            "Drop a folder, a manifest, a {} file or a session to open it, or fibre tracts to add them",
            volume_names()
        ),
        theme::font(20.0),
        theme::ON_IMAGE,
    );
}
