//! `glioscope report`: writes all pictures and numbers of a case into a folder.

use std::path::Path;

use glioscope_core::measure;

use super::{
    case::CaseArguments,
    offscreen_app::{OffscreenApp, gpu},
    parse::View,
    terminal,
};
use crate::{command::Workstation, error::AppError, model::PaneId, output};

/// Size of the window's picture.
const WINDOW_PX: [u32; 2] = [1600, 1000];

pub(super) fn run(case: &CaseArguments, out: &Path, software: bool) -> Result<(), AppError> {
    let read = case.read(true)?;
    let case = &read.case;
    std::fs::create_dir_all(out)
        .map_err(|e| AppError::file(out, e.to_string(), "a folder that can be made"))?;
    output::write_json(&out.join("measure.json"), &measure::report(case))?;
    let time_point_count = case.time_points.len();
    let mut app =
        OffscreenApp::new(Workstation::with_opened(read.into()), &gpu(software)?, false)?;
    // A single time point has nothing to compare with.
    let panes = PaneId::all()
        .map(|pane| (pane, pane.row()))
        .filter(|(_, row)| time_point_count > 1 || !row.needs_dates);
    let pictures = panes.filter_map(|(pane, row)| Some((row.cli?, View::Pane(pane), row.report_px?)));
    for (name, view, size) in std::iter::once(("window", View::Window, WINDOW_PX)).chain(pictures) {
        let rgba = app.capture(view, size, 1.0)?;
        output::write_png(&out.join(format!("{name}.png")), size, &rgba)?;
    }
    terminal::print(&format!("pictures and numbers written to {}", out.display()))
}
