//! Devices and reports of what is drawn offscreen.

use glioscope_core::Progress;
use glioscope_render::{
    AdapterPreference, Gpu, Plan, Quality,
    light::{FrameErrors, StandardError},
};

use crate::{
    error::AppError, model::PaneId, views::view3d::screen::PassTimes, window::offscreen_app::OffscreenApp,
};

/// The graphics device: the software adapter's, or a hardware adapter's where there is one.
pub(super) fn gpu(software: bool) -> Result<Gpu, AppError> {
    let preference = if software { AdapterPreference::SoftwareOnly } else { AdapterPreference::RealFirst };
    Ok(Gpu::headless(preference)?)
}

/// Plan, pass times, quality and messages of a drawn 3D view.
#[derive(Default)]
pub(super) struct DrawReport {
    pub plan: Option<Plan>,
    pub times: Option<PassTimes>,
    pub quality: Option<Quality>,
    pub standard_error: Option<StandardError>,
    pub warnings: Vec<String>,
    pub notes: Vec<String>,
    /// Measured errors of the light; `None` where it wasn't asked for or has no reference.
    pub measured: Option<FrameErrors>,
}

/// Report on the last frame of `pane`'s 3D view; empty for other panes. `timed`: with its pass times; `measured`: with the
/// error of its light.
pub(super) fn draw_report(
    drawn: &mut OffscreenApp,
    pane: PaneId,
    (timed, measured): (bool, bool),
) -> Result<DrawReport, AppError> {
    let Some(gpu) = drawn.app.gpu().cloned() else { return Ok(DrawReport::default()) };
    let Some(screen) = drawn.app.panes.screen(pane) else { return Ok(DrawReport::default()) };
    let mut report = DrawReport {
        plan: screen.plan().map(|(plan, _)| plan.clone()),
        times: None,
        quality: screen.quality().copied(),
        standard_error: None,
        warnings: screen.warnings().to_vec(),
        notes: screen.notes().to_vec(),
        measured: None,
    };
    if measured && let Some(sample) = screen.light_sample(&gpu)? {
        report.measured = Some(sample.measure(&Progress::new())?);
    }
    if timed && report.plan.is_some() {
        // Before the passes are run again for their times.
        report.standard_error = screen.standard_error(&gpu)?;
        report.times = Some(screen.pass_times(&gpu)?.clone());
    }
    Ok(report)
}
