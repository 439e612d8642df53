//! The panes, and their names in tabs, menus, files and the command line.

use glioscope_render::flat::Plane;
use serde::{Deserialize, Serialize};
use strum::{EnumIter, IntoEnumIterator};

/// A pane of the window; variants are in menu order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, EnumIter)]
#[serde(rename_all = "snake_case")]
pub enum PaneId {
    /// The tumour intersection closeup.
    Closeup,
    /// The tumour in its anatomy.
    Context,
    /// The ellipsoid diagram.
    Ellipsoids,
    /// The surface change between two time points.
    Change,
    /// All time points, and volumes over time.
    Dates,
    /// Lesions over time.
    Lesions,
    /// Response by criteria.
    Response,
    /// The overlap diagram with its bar and the table of regions.
    Overlap,
    /// Metrics of agreement by a named convention.
    Agreement,
    /// The table of the volumes inside the lens.
    Lens,
    /// The list of measured lines.
    Measurements,
    /// The transfer function of the context view.
    Transfer,
    /// Render plan, pass times and graphics adapter.
    Diagnostics,
    /// Slices of several dates and images, side by side.
    SideBySide,
    /// The axial slice.
    Axial,
    /// The coronal slice.
    Coronal,
    /// The sagittal slice.
    Sagittal,
}

/// A pane's names, and its part in reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaneRow {
    /// Name in sentences: `the closeup`.
    pub title: &'static str,
    /// Title of its tab.
    pub tab: &'static str,
    /// Name for `--view` and file names; `None`: it can't be exported as a picture.
    pub cli: Option<&'static str>,
    /// Size of its picture in a report, pixels; `None`: not included.
    pub report_px: Option<[u32; 2]>,
    /// Whether it compares time points: reports omit it where the case has one.
    pub needs_dates: bool,
}

impl PaneRow {
    const fn new(title: &'static str, tab: &'static str, cli: &'static str) -> Self {
        Self { title, tab, cli: Some(cli), report_px: None, needs_dates: false }
    }

    const fn report(self, report_px: [u32; 2]) -> Self {
        Self { report_px: Some(report_px), ..self }
    }

    const fn needs_dates(self) -> Self {
        Self { needs_dates: true, ..self }
    }
}

impl PaneId {
    /// Its row in the table of panes.
    pub const fn row(self) -> PaneRow {
        let row = PaneRow::new;
        match self {
            Self::Closeup => row("the closeup", "Closeup", "closeup").report([900, 900]),
            Self::Context => row("the context view", "Context", "context").report([900, 900]),
            Self::Ellipsoids => row("the ellipsoid diagram", "Ellipsoids", "ellipsoids").report([900, 900]),
            Self::Change => row("the change view", "Change", "change").report([900, 900]).needs_dates(),
            Self::Dates => row("the dates", "Dates", "dates").report([700, 900]).needs_dates(),
            Self::Lesions => row("the lesions", "Lesions", "lesions").report([900, 700]).needs_dates(),
            Self::Response => row("the response", "Response", "response").needs_dates(),
            Self::Overlap => row("the overlap diagram", "Overlap", "overlap").report([700, 900]),
            Self::Agreement => row("the agreement", "Agreement", "agreement"),
            Self::Lens => row("what is in the lens", "In the lens", "lens"),
            Self::Measurements => row("measurements", "Measurements", "measurements"),
            Self::Transfer => row("the transfer function", "Transfer", "transfer"),
            Self::Diagnostics => PaneRow { cli: None, ..row("diagnostics", "Diagnostics", "diagnostics") },
            Self::SideBySide => row("the slices side by side", "Side by side", "side-by-side")
                .report([1400, 760])
                .needs_dates(),
            Self::Axial => row("the axial slice", "Axial", "axial").report([700, 700]),
            Self::Coronal => row("the coronal slice", "Coronal", "coronal").report([700, 700]),
            Self::Sagittal => row("the sagittal slice", "Sagittal", "sagittal").report([700, 700]),
        }
    }

    /// Its name in sentences.
    pub const fn title(self) -> &'static str {
        self.row().title
    }

    /// The title of its tab.
    pub const fn tab(self) -> &'static str {
        self.row().tab
    }

    /// Every pane, in menu order.
    pub fn all() -> impl Iterator<Item = Self> {
        Self::iter()
    }

    /// The pane of a slice plane.
    pub const fn of_plane(plane: Plane) -> Self {
        match plane {
            Plane::Axial => Self::Axial,
            Plane::Coronal => Self::Coronal,
            Plane::Sagittal => Self::Sagittal,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn pane_names_are_unique() {
        for name_of in [|row: PaneRow| Some(row.title), |row: PaneRow| Some(row.tab), |row: PaneRow| row.cli]
        {
            let names: Vec<&str> = PaneId::all().filter_map(|pane| name_of(pane.row())).collect();
            assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len(), "{names:?}");
        }
    }
}
