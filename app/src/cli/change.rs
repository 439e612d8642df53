//! `glioscope change`.

use std::path::PathBuf;

use clap::Args;
use glioscope_core::{
    change::{self, ChangeError, ChangeOptions, ChangeReport, Lengths},
    files::write_whole,
    skeleton::{Level, SkeletonOptions},
};

use super::{CaseArguments, Failure, terminal};
use crate::format;

/// What `change` can be told.
#[derive(Debug, Args)]
pub struct ChangeArguments {
    /// The case.
    #[command(flatten)]
    pub case: CaseArguments,
    /// The mask, by id; may be left out where there is one.
    #[arg(long, value_name = "ID")]
    pub of: Option<String>,
    /// The earlier date, by its label; may be left out where there are two.
    #[arg(long, value_name = "LABEL")]
    pub from: Option<String>,
    /// The later date, by its label; may be left out where there are two.
    #[arg(long, value_name = "LABEL")]
    pub to: Option<String>,
    /// As JSON: see docs/json.md.
    #[arg(long)]
    pub json: bool,
    /// Also write every vector to this file.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// How far off the dates may lie from one another, in millimetres (standard deviation).
    #[arg(long, value_name = "X", default_value_t = change::DEFAULT_REGISTRATION_MM, allow_hyphen_values = true)]
    pub registration_mm: f64,
    /// How much of the skeleton vectors go by: 0 core, 1 with branches of low divergence, 2 with tips
    /// of the boundary.
    #[arg(long, value_name = "0|1|2", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=2))]
    pub level: u8,
}

impl From<ChangeError> for Failure {
    fn from(error: ChangeError) -> Self {
        Self(match error {
            ChangeError::Registration(_) => format!("--registration-mm: {error}"),
            error => error.to_string(),
        })
    }
}

pub(super) fn run(arguments: &ChangeArguments) -> Result<(), Failure> {
    let (_, case) = arguments.case.load(false)?;
    let level = match arguments.level {
        0 => Level::Core,
        1 => Level::Divergence,
        _ => Level::Boundary,
    };
    let options = ChangeOptions {
        skeleton: SkeletonOptions { level, ..SkeletonOptions::default() },
        registration_mm: arguments.registration_mm,
    };
    let (of, from, to) = (arguments.of.as_deref(), arguments.from.as_deref(), arguments.to.as_deref());
    let (report, found) =
        terminal::with_progress(|progress| change::between(&case, of, from, to, &options, progress))?;
    if let Some(path) = &arguments.csv {
        write_whole(path, change::csv(&found).as_bytes())?;
    }
    if arguments.json { terminal::print_json(&report) } else { terminal::print(&table(&report)) }
}

/// The numbers as a text for people.
fn table(r: &ChangeReport) -> String {
    let mut lines = vec![
        format!("{} from {} to {}", r.mask, r.from, r.to),
        format!("{:24} {:>14}", "before", format::ml(r.from_ml)),
        format!("{:24} {:>14}", "after", format::ml(r.to_ml)),
        format!("{:24} {:>14}", "kept", format::ml(r.kept_ml)),
        format!("{:24} {:>14}", "gone", format::ml(r.gone_ml)),
        format!("{:24} {:>14}", "new", format::ml(r.new_ml)),
        String::new(),
        format!(
            "{:24} {:>8} {:>9} {:>9} {:>9} {:>9}",
            "surface, mm", "vectors", "mean", "median", "95 %", "most"
        ),
    ];
    let row = |name: &str, l: &Lengths| {
        let mm = |v: Option<f64>| v.map_or("–".to_owned(), |v| format!("{v:.2}"));
        format!(
            "{name:24} {:>8} {:>9} {:>9} {:>9} {:>9}",
            l.count,
            mm(l.mean_mm),
            mm(l.p50_mm),
            mm(l.p95_mm),
            mm(l.max_mm)
        )
    };
    lines.push(row("growth", &r.growth));
    lines.push(row("recession", &r.recession));
    lines.push(row("growth, nearest", &r.nearest.growth));
    lines.push(row("recession, nearest", &r.nearest.recession));
    let [x, y, z] = r.uncertainty_mm.axes_mm;
    lines.push(format!(
        "{} of {} vectors within uncertainty ({x:.2}, {y:.2}, {z:.2} mm along the voxel axes, registration \
         {} mm)",
        r.within_uncertainty, r.vectors, r.uncertainty_mm.registration_mm
    ));
    for (number, group) in r.components.iter().enumerate().take(20) {
        let ml = |parts: &[change::PartReport]| -> String {
            let list: Vec<String> = parts.iter().map(|p| format::ml(p.volume_ml)).collect();
            if list.is_empty() { "nothing".into() } else { list.join(" + ") }
        };
        let fate = serde_json::to_value(group.fate).ok().and_then(|v| v.as_str().map(str::to_owned));
        lines.push(format!(
            "component {number}: {} ({} to {})",
            fate.unwrap_or_default(),
            ml(&group.from),
            ml(&group.to)
        ));
    }
    if r.components.len() > 20 {
        lines.push(format!("… and {} components more", r.components.len() - 20));
    }
    let flags = serde_json::to_value(&r.flags).ok();
    let flags: Vec<&str> =
        flags.iter().flat_map(|f| f.as_array()).flatten().filter_map(|f| f.as_str()).collect();
    if !flags.is_empty() {
        lines.push(format!("flags: {}", flags.join(", ")));
    }
    lines.join("\n")
}
