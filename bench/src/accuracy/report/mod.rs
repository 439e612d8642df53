//! Writes results as numbers, plots and a page.

mod page;
mod path;
mod plot;

use std::{collections::BTreeMap, path::Path, time::Duration};

use glioscope_core::files::write_whole;
use glioscope_render::Gpu;
use serde_json::{Value, json};

use super::MeasuredFamily;
use crate::{Outcome, clock::load_average};

/// Date, adapter and load at the start of a run.
#[derive(Debug)]
pub(super) struct RunStart {
    date: jiff::civil::Date,
    adapter: String,
    load: Option<f64>,
}

impl RunStart {
    /// The current state.
    pub fn now(gpu: &Gpu) -> Self {
        let date = jiff::tz::Offset::UTC.to_datetime(jiff::Timestamp::now()).date();
        Self { date, adapter: gpu.describe(), load: load_average() }
    }
}

/// All numbers as JSON.
pub(super) fn json(measured: &[MeasuredFamily], run_start: &RunStart, quick: bool) -> Value {
    let seconds: BTreeMap<&str, f64> =
        measured.iter().map(|m| (m.family.name, m.elapsed.as_secs_f64())).collect();
    let curves: Vec<_> = measured.iter().flat_map(|m| &m.curves).collect();
    json!({ "adapter": run_start.adapter, "quick": quick, "seconds": seconds, "curves": curves })
}

/// Time of each family, truths included.
pub(super) fn durations(measured: &[MeasuredFamily]) -> String {
    let seconds = |m: &MeasuredFamily| format!("{} {:.1} s", m.family.name, m.elapsed.as_secs_f64());
    let parts: Vec<String> = measured.iter().map(seconds).collect();
    let total: Duration = measured.iter().map(|m| m.elapsed).sum();
    format!("{}; {:.1} s in total", parts.join(", "), total.as_secs_f64())
}

/// Writes `accuracy.csv`, `accuracy.md` and `images/` into `out`, which is created if needed.
///
/// # Errors
/// When a file can't be written, or a plot can't be drawn.
pub(super) fn write(measured: &[MeasuredFamily], run_start: &RunStart, out: &Path) -> Outcome<()> {
    let images = out.join("images");
    std::fs::create_dir_all(&images)
        .map_err(|e| format!("{}: found {e}, expected a folder that can be created", images.display()))?;
    let plots: Vec<plot::Plot<'_>> = measured.iter().flat_map(plot::of_family).collect();
    for plot in &plots {
        write_whole(&images.join(plot.file_name()), plot.svg()?.as_bytes())?;
    }
    write_whole(&out.join("accuracy.csv"), &page::csv(measured))?;
    write_whole(&out.join("accuracy.md"), page::markdown(measured, &plots, run_start).as_bytes())?;
    Ok(())
}
