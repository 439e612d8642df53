//! Lines measured, and all of them as CSV or JSON.

use std::path::PathBuf;

use glam::DVec3;
use glioscope_core::{Sides, case::Case, csv};
use serde::{Deserialize, Serialize};
use serde_json::json;
use strum::{IntoStaticStr, VariantArray};

use super::pane::PaneId;

/// A straight line that was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ruler {
    /// What the user calls it.
    pub name: String,
    /// One end, world millimetres.
    pub from_mm: DVec3,
    /// The other end.
    pub to_mm: DVec3,
    /// Where it was drawn: in the closeup between first-hit points, or in a slice.
    pub view: PaneId,
    /// The time point it was drawn on: it is shown there only.
    pub time: usize,
}

impl Ruler {
    /// How long it is.
    pub fn length_mm(&self) -> f64 {
        self.from_mm.distance(self.to_mm)
    }

    /// Its middle.
    pub fn middle_mm(&self) -> DVec3 {
        self.from_mm.midpoint(self.to_mm)
    }

    /// What lists and exports call the view it was drawn in.
    pub fn view_name(&self) -> &'static str {
        self.view.row().cli.unwrap_or_default()
    }
}

/// How lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum RulerFormat {
    /// A row per line measured.
    Csv,
    /// With the case's doubts.
    Json,
}

impl RulerFormat {
    /// The ending of its files, without the dot.
    pub fn ending(self) -> &'static str {
        self.into()
    }

    /// What people call it.
    pub fn name(self) -> String {
        self.ending().to_uppercase()
    }

    /// The format that the ending of `path` names.
    pub fn of(path: &std::path::Path) -> Option<Self> {
        let ending = path.extension()?;
        Self::VARIANTS.iter().copied().find(|format| ending.eq_ignore_ascii_case(format.ending()))
    }

    /// `path` with this format's ending, where it has none of them.
    pub fn on(self, path: PathBuf) -> PathBuf {
        if Self::of(&path).is_some() {
            return path;
        }
        let mut name = path.into_os_string();
        name.push(".");
        name.push(self.ending());
        PathBuf::from(name)
    }

    /// A file name to propose.
    pub fn file_name(self) -> String {
        format!("lines.{}", self.ending())
    }
}

/// Why lengths or sides of this case may not be what they seem, one sentence each.
pub fn doubts(case: &Case) -> Vec<&'static str> {
    let found = |code: &str| case.checks.iter().any(|check| check.code == code);
    let mut out = Vec::new();
    if case.grid.sides() == Sides::Unknown {
        out.push("Side unknown: left and right can't be told.");
    }
    if found("units-unknown") {
        out.push("Unit of length unknown: a file names none, and mm is assumed.");
    }
    if found("thickness-unknown") {
        out.push("Thickness unknown: a file doesn't say how thick its slice is.");
    }
    out
}

fn time_label(case: &Case, ruler: &Ruler) -> String {
    case.time_points.get(ruler.time).map(|t| t.label.clone()).unwrap_or_default()
}

/// All lines as CSV. A name that a spreadsheet would take for a formula gets an apostrophe before it.
pub fn as_csv(case: &Case, rulers: &[Ruler]) -> Vec<u8> {
    // RAS+ is only claimed where it is known.
    let axes = if case.grid.sides() == Sides::Known { ["r", "a", "s"] } else { ["x", "y", "z"] };
    let ends = ["from", "to"].into_iter().flat_map(|end| axes.map(|axis| format!("{end}_{axis}_mm")));
    let head = ["name", "time", "view", "length_mm"].map(str::to_owned);
    let mut table = csv::Table::new(head.into_iter().chain(ends));
    for ruler in rulers {
        let ends = [ruler.from_mm, ruler.to_mm].into_iter().flat_map(|end| end.to_array());
        let head = [
            csv::text(&ruler.name),
            csv::text(&time_label(case, ruler)),
            ruler.view_name().to_owned(),
            ruler.length_mm().to_string(),
        ];
        table.row(head.into_iter().chain(ends.map(|mm| mm.to_string())));
    }
    table.into_bytes()
}

/// All lines as JSON, with the case's doubts.
pub fn as_json(case: &Case, rulers: &[Ruler]) -> serde_json::Value {
    let line = |ruler: &Ruler| {
        json!({
            "name": ruler.name,
            "time": time_label(case, ruler),
            "view": ruler.view_name(),
            "length_mm": ruler.length_mm(),
            "from_mm": ruler.from_mm.to_array(),
            "to_mm": ruler.to_mm.to_array(),
        })
    };
    json!({
        "case": case.name,
        "sides": if case.grid.sides() == Sides::Known { "known" } else { "unknown" },
        "doubts": doubts(case),
        "lines": rulers.iter().map(line).collect::<Vec<_>>(),
    })
}
