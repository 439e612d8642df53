//! Files dropped on the window.

use std::path::PathBuf;

use egui::Context;
use glioscope_core::{case, files::format::volume_names};

use super::dialogs::{is_tracts, open_command};
use crate::{
    command::{AppCommand, Commands},
    model::session,
    theme,
};

/// Adds dropped fibre tracts to the open case; opens a dropped file or folder; opens several as one case. A session or a
/// manifest among several is opened alone: returns how many files and folders are passed over then.
pub fn dropped(ctx: &Context, case_is_open: bool, out: &mut Commands) -> usize {
    let paths: Vec<PathBuf> =
        ctx.input(|i| i.raw.dropped_files.iter().map(|f| f.path().to_owned()).collect());
    if ctx.input(|i| !i.raw.hovered_files.is_empty()) {
        hint(ctx);
    }
    if case_is_open && !paths.is_empty() && paths.iter().all(|path| is_tracts(path)) {
        out.push(AppCommand::AddTracts(paths));
        return 0;
    }
    let describes = |path: &&PathBuf| {
        let is_manifest = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"));
        is_manifest || session::is_session(path) || case::has_manifest(path)
    };
    match (paths.as_slice(), paths.iter().find(describes)) {
        ([], _) => 0,
        ([only], _) => {
            out.push(open_command(only.clone()));
            0
        }
        (several, Some(described)) => {
            out.push(open_command(described.clone()));
            several.len() - 1
        }
        (several, None) => {
            out.push(AppCommand::OpenFiles(several.to_vec()));
            0
        }
    }
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
            "Drop a folder, a manifest, {} files or a session to open them, or fibre tracts to add them",
            volume_names()
        ),
        theme::font(20.0),
        theme::ON_IMAGE,
    );
}
