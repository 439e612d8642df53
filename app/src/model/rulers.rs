//! Lines measured: going to one, and all of them as CSV or JSON.

use std::path::{Path, PathBuf};

use glioscope_core::{Sides, case::Case, files::write_whole};
use glioscope_render::slices::Plane;
use serde_json::json;

use crate::{
    document::{Document, Ruler},
    files,
    world::World,
};

/// How lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RulerFormat {
    /// One line of text a line measured.
    Csv,
    /// With the case's doubts.
    Json,
}

impl RulerFormat {
    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Csv => "CSV",
            Self::Json => "JSON",
        }
    }

    /// `path` with this format's ending, where it has neither.
    pub fn on(self, path: PathBuf) -> PathBuf {
        let known =
            path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv") || e.eq_ignore_ascii_case("json"));
        if known {
            return path;
        }
        let mut name = path.into_os_string();
        name.push(match self {
            Self::Csv => ".csv",
            Self::Json => ".json",
        });
        PathBuf::from(name)
    }

    /// A file name to propose.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Csv => "lines.csv",
            Self::Json => "lines.json",
        }
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

/// Puts the crosshair, the closeup and the slices at the middle of a line; the lens stays.
pub(crate) fn look_at(doc: &mut Document, world: &World, at: usize) {
    let Some(ruler) = doc.edit.rulers.get(at) else { return };
    let middle_mm = ruler.middle_mm();
    if ruler.time < world.time_point_count() {
        doc.nav.time = ruler.time;
    }
    doc.nav.cursor_mm = middle_mm;
    doc.nav.camera.focus_mm = middle_mm;
    if doc.nav.mm_per_point.is_none() {
        return;
    }
    // Zoomed slices may not show the place: they are moved so that it is in their middle.
    let bounds_mm = match (world.context(doc), world.case()) {
        (Some((_, image)), _) => image.volume().grid().bounds_mm(),
        (None, Some(case)) => case.grid.bounds_mm(),
        (None, None) => return,
    };
    for plane in Plane::ALL {
        let convention = doc.nav.convention;
        let fitted =
            glioscope_render::slices::SliceView::fit(plane, convention, bounds_mm, middle_mm, [1, 1]);
        let off_mm = middle_mm - fitted.center_mm;
        doc.nav.pan_mm[plane as usize] =
            glam::DVec2::new(off_mm.dot(fitted.right()), off_mm.dot(fitted.down()));
    }
}

/// Writes all lines; the ending of `path` says how: `.csv` or `.json`.
///
/// # Errors
/// One line that names the file.
pub fn write(path: &Path, case: &Case, rulers: &[Ruler]) -> Result<(), String> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("csv") => write_whole(path, csv(case, rulers).as_bytes()).map_err(|e| e.to_string()),
        Some("json") => files::write_json(path, &as_json(case, rulers)),
        _ => Err(format!(
            "{}: found the ending \"{}\", expected .csv or .json",
            path.display(),
            ending.unwrap_or_default()
        )),
    }
}

fn time_label(case: &Case, ruler: &Ruler) -> String {
    case.time_points.get(ruler.time).map(|t| t.label.clone()).unwrap_or_default()
}

/// As RFC 4180 has it: fields with commas, quotes or line ends are quoted, quotes doubled. A name that a
/// spreadsheet would take for a formula gets an apostrophe before it.
fn field(text: &str) -> String {
    let text = if text.starts_with(['=', '+', '-', '@']) { format!("'{text}") } else { text.to_owned() };
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
}

fn csv(case: &Case, rulers: &[Ruler]) -> String {
    // RAS+ is only claimed where it is known.
    let axes = if case.grid.sides() == Sides::Known { ["r", "a", "s"] } else { ["x", "y", "z"] };
    let ends = ["from", "to"].map(|end| axes.map(|axis| format!("{end}_{axis}_mm")).join(","));
    let mut out = format!("name,time,view,length_mm,{}\r\n", ends.join(","));
    for ruler in rulers {
        let numbers =
            [ruler.from_mm, ruler.to_mm].map(|end| end.to_array().map(|mm| mm.to_string()).join(","));
        out.push_str(&format!(
            "{},{},{},{},{}\r\n",
            field(&ruler.name),
            field(&time_label(case, ruler)),
            ruler.view.name(),
            ruler.length_mm(),
            numbers.join(",")
        ));
    }
    out
}

fn as_json(case: &Case, rulers: &[Ruler]) -> serde_json::Value {
    let lines: Vec<_> = rulers
        .iter()
        .map(|ruler| {
            json!({
                "name": ruler.name,
                "time": time_label(case, ruler),
                "view": ruler.view.name(),
                "length_mm": ruler.length_mm(),
                "from_mm": ruler.from_mm.to_array(),
                "to_mm": ruler.to_mm.to_array(),
            })
        })
        .collect();
    json!({
        "case": case.name,
        "sides": if case.grid.sides() == Sides::Known { "known" } else { "unknown" },
        "doubts": doubts(case),
        "lines": lines,
    })
}

#[cfg(test)]
mod tests {
    use super::field;

    #[test]
    fn names_can_hold_anything() {
        assert_eq!(field("Line 1"), "Line 1");
        assert_eq!(field("a, \"b\"\nc"), "\"a, \"\"b\"\"\nc\"");
        assert_eq!(field("=1+1"), "'=1+1");
    }
}
