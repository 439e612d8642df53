//! What was measured, as numbers, plots and a page.

mod page;
mod plot;

use std::{collections::BTreeMap, path::Path, time::Duration};

use glioscope_core::files::write_whole;
use glioscope_render::Gpu;
use serde_json::{Value, json};

use super::Measured;
use crate::{Outcome, clock::load_average};

/// When and where a run began.
#[derive(Debug)]
pub(super) struct Begun {
    date: jiff::civil::Date,
    adapter: String,
    load: Option<f64>,
}

impl Begun {
    /// Now, here.
    pub fn now(gpu: &Gpu) -> Self {
        let date = jiff::tz::Offset::UTC.to_datetime(jiff::Timestamp::now()).date();
        Self { date, adapter: gpu.describe(), load: load_average() }
    }
}

/// Every number.
pub(super) fn json(measured: &[Measured], begun: &Begun, quick: bool) -> Value {
    let seconds: BTreeMap<&str, f64> =
        measured.iter().map(|m| (m.family.name, m.took.as_secs_f64())).collect();
    let curves: Vec<_> = measured.iter().flat_map(|m| &m.curves).collect();
    json!({ "adapter": begun.adapter, "quick": quick, "seconds": seconds, "curves": curves })
}

/// How long each family took, truths and settings together.
pub(super) fn durations(measured: &[Measured]) -> String {
    let one = |m: &Measured| format!("{} {:.1} s", m.family.name, m.took.as_secs_f64());
    let parts: Vec<String> = measured.iter().map(one).collect();
    let total: Duration = measured.iter().map(|m| m.took).sum();
    format!("{}; {:.1} s in all", parts.join(", "), total.as_secs_f64())
}

/// Writes `accuracy.csv`, `accuracy.md` and `images/` into `out`, which is made.
///
/// # Errors
/// Where a file can't be written, or a plot not drawn.
pub(super) fn write(measured: &[Measured], begun: &Begun, out: &Path) -> Outcome<()> {
    let images = out.join("images");
    std::fs::create_dir_all(&images)
        .map_err(|e| format!("{}: found {e}, expected a folder that can be made", images.display()))?;
    let plots: Vec<plot::Plot<'_>> = measured.iter().flat_map(plot::of_family).collect();
    for plot in &plots {
        write_whole(&images.join(plot.file_name()), plot.svg()?.as_bytes())?;
    }
    write_whole(&out.join("accuracy.csv"), &page::csv(measured))?;
    write_whole(&out.join("accuracy.md"), page::markdown(measured, &plots, begun).as_bytes())?;
    Ok(())
}
