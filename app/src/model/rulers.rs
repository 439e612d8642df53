//! What is measured in views, and its export as CSV or JSON.

use std::path::PathBuf;

use glam::DVec3;
use glioscope_core::{
    Sides,
    case::Case,
    csv,
    measure::{Statistics, in_circle},
};
use serde::{Deserialize, Serialize};
use serde_json::json;
use strum::{IntoStaticStr, VariantArray};

use super::{pane::PaneId, shape::Shape};

/// The most lines of a case.
pub const MOST_RULERS: usize = 1000;

/// A measured straight line, and what belongs to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ruler {
    /// Its name, editable by the user.
    pub name: String,
    /// One end, world millimetres.
    pub from_mm: DVec3,
    /// The other end, world millimetres.
    pub to_mm: DVec3,
    /// What is measured with it.
    #[serde(default, skip_serializing_if = "Shape::is_line")]
    pub shape: Shape,
    /// The pane it was drawn in: the closeup, between first-hit points, or a slice.
    pub view: PaneId,
    /// Index of the time point it was drawn at; it is shown only there.
    pub time: usize,
}

impl Ruler {
    /// Its length.
    pub fn length_mm(&self) -> f64 {
        self.from_mm.distance(self.to_mm)
    }

    /// Product of both diameters, square millimetres.
    pub fn product_mm2(&self) -> Option<f64> {
        Some(self.length_mm() * self.across_mm()?)
    }

    /// Its midpoint, world millimetres.
    pub fn middle_mm(&self) -> DVec3 {
        self.from_mm.midpoint(self.to_mm)
    }

    /// The name of its view in lists and exports.
    pub fn view_name(&self) -> &'static str {
        self.view.row().cli.unwrap_or_default()
    }
}

/// File format of exported numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum ExportFormat {
    /// A table.
    Csv,
    /// Also what is doubtful about the case.
    Json,
}

impl ExportFormat {
    /// Its file extension, without the dot.
    pub fn extension(self) -> &'static str {
        self.into()
    }

    /// Its name for display.
    pub fn name(self) -> String {
        self.extension().to_uppercase()
    }

    /// The format of a file, by its extension.
    pub fn of(path: &std::path::Path) -> Option<Self> {
        let extension = path.extension()?;
        Self::VARIANTS.iter().copied().find(|format| extension.eq_ignore_ascii_case(format.extension()))
    }

    /// `path` with this format's extension appended, unless it already has the extension of a format.
    pub fn with_extension(self, path: PathBuf) -> PathBuf {
        if Self::of(&path).is_some() {
            return path;
        }
        let mut name = path.into_os_string();
        name.push(".");
        name.push(self.extension());
        PathBuf::from(name)
    }
}

/// Reasons to doubt the lengths or sides of this case, one sentence each.
pub fn doubts(case: &Case) -> Vec<&'static str> {
    let has_check = |code: &str| case.checks.iter().any(|check| check.code == code);
    let mut out = Vec::new();
    if case.grid.sides() == Sides::Unknown {
        out.push("Side unknown: left and right can't be told.");
    }
    if has_check("units-unknown") {
        out.push("Unit of length unknown: a file names none, and mm is assumed.");
    }
    if has_check("thickness-unknown") {
        out.push("Thickness unknown: a file doesn't say how thick its slice is.");
    }
    out
}

fn time_label(case: &Case, ruler: &Ruler) -> String {
    case.time_points.get(ruler.time).map(|t| t.label.clone()).unwrap_or_default()
}

/// Values of the images of its date in a circle; nothing of other shapes.
fn values(case: &Case, ruler: &Ruler) -> Vec<Statistics> {
    let Shape::Circle { normal } = ruler.shape else { return Vec::new() };
    let images = case.time_points.get(ruler.time).map(|time| time.contexts.as_slice()).unwrap_or_default();
    let circle = (ruler.from_mm, normal, ruler.length_mm());
    images.iter().map(|image| in_circle(&ruler.name, (&image.id, &image.volume), circle)).collect()
}

/// All lines as CSV, a circle once for each image of its date. Names that a spreadsheet would interpret as a formula are prefixed with an apostrophe.
pub fn as_csv(case: &Case, rulers: &[Ruler]) -> Vec<u8> {
    // Columns are named after the RAS+ axes only where the sides are known.
    let axes = if case.grid.sides() == Sides::Known { ["r", "a", "s"] } else { ["x", "y", "z"] };
    let ends = ["from", "to"].into_iter().flat_map(|end| axes.map(|axis| format!("{end}_{axis}_mm")));
    let head = ["name", "time", "view", "length_mm"].map(str::to_owned);
    let beside = ["kind", "across_mm", "product_mm2", "angle_degrees", "area_mm2"].map(str::to_owned);
    let of_image = ["image", "voxels", "mean", "sd", "min", "max", "peak", "mean_times_ml"].into_iter();
    let of_image = of_image.chain(["histogram_first", "histogram_bin", "histogram"]).map(str::to_owned);
    let mut table = csv::Table::new(head.into_iter().chain(ends).chain(beside).chain(of_image.clone()));
    for ruler in rulers {
        let coordinates_mm = [ruler.from_mm, ruler.to_mm].into_iter().flat_map(|end| end.to_array());
        let head = [
            csv::text(&ruler.name),
            csv::text(&time_label(case, ruler)),
            ruler.view_name().to_owned(),
            ruler.length_mm().to_string(),
        ];
        let kind: &str = ruler.shape.tool().into();
        let numbers = [ruler.across_mm(), ruler.product_mm2(), ruler.angle_degrees(), ruler.area_mm2()];
        let numbers = numbers.map(|value| value.map(|value| value.to_string()).unwrap_or_default());
        let beside = std::iter::once(kind.to_owned()).chain(numbers);
        let own: Vec<String> =
            head.into_iter().chain(coordinates_mm.map(|mm| mm.to_string())).chain(beside).collect();
        let values = values(case, ruler);
        if values.is_empty() {
            table.row(own.into_iter().chain(of_image.clone().map(|_| String::new())));
            continue;
        }
        for found in values {
            table.row(own.iter().cloned().chain(value_cells(&found)));
        }
    }
    table.into_bytes()
}

/// The cells of values: of the histogram the counts, separated by spaces.
fn value_cells(found: &Statistics) -> impl Iterator<Item = String> {
    let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    let Statistics { mean, sd, min, max, peak, mean_times_ml, histogram, .. } = found;
    let bins = histogram.as_ref();
    let counts = bins.map(|bins| bins.counts.iter().map(u64::to_string).collect::<Vec<_>>().join(" "));
    let numbers = [*mean, *sd, *min, *max, *peak, *mean_times_ml].map(number);
    let [first, bin] = [bins.map(|bins| bins.first), bins.map(|bins| bins.bin)].map(number);
    let counts = counts.unwrap_or_default();
    let head = [csv::text(&found.image), found.voxels.to_string()].into_iter();
    head.chain(numbers).chain([first, bin, counts])
}

/// All lines as JSON, with the case's doubts.
pub fn as_json(case: &Case, rulers: &[Ruler]) -> serde_json::Value {
    let line = |ruler: &Ruler| {
        let kind: &str = ruler.shape.tool().into();
        let (across, third_mm) = match ruler.shape {
            Shape::Diameters { across_mm } => (Some(across_mm.map(|end| end.to_array())), None),
            Shape::Angle { third_mm } => (None, Some(third_mm.to_array())),
            Shape::Line | Shape::Circle { .. } => (None, None),
        };
        json!({
            "name": ruler.name,
            "time": time_label(case, ruler),
            "view": ruler.view_name(),
            "length_mm": ruler.length_mm(),
            "from_mm": ruler.from_mm.to_array(),
            "to_mm": ruler.to_mm.to_array(),
            "kind": kind,
            "across": across.map(|[from_mm, to_mm]| {
                json!({ "length_mm": ruler.across_mm(), "from_mm": from_mm, "to_mm": to_mm })
            }),
            "product_mm2": ruler.product_mm2(),
            "angle_degrees": ruler.angle_degrees(),
            "third_mm": third_mm,
            "area_mm2": ruler.area_mm2(),
            "values": values(case, ruler),
        })
    };
    json!({
        "case": case.name,
        "sides": if case.grid.sides() == Sides::Known { "known" } else { "unknown" },
        "doubts": doubts(case),
        "lines": rulers.iter().map(line).collect::<Vec<_>>(),
    })
}
