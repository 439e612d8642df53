//! `glioscope ellipsoids`: enclosing ellipsoids of connected components.

use clap::ValueEnum;
use glioscope_core::{
    Connectivity, decimal,
    ellipsoid::{EllipsoidReport, EllipsoidsReport, OfReport, Options, report},
};

use super::{case::CaseArguments, terminal};
use crate::{error::AppError, format};

/// Connectivity: neighbours of a voxel.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Neighbors {
    /// Neighbours across faces.
    #[value(name = "6")]
    Six,
    /// Neighbours across faces and edges.
    #[value(name = "18")]
    Eighteen,
    /// Neighbours across faces, edges and corners.
    #[value(name = "26")]
    TwentySix,
}

impl From<Neighbors> for Connectivity {
    fn from(neighbors: Neighbors) -> Self {
        match neighbors {
            Neighbors::Six => Self::Six,
            Neighbors::Eighteen => Self::Eighteen,
            Neighbors::TwentySix => Self::TwentySix,
        }
    }
}

pub(super) fn run(
    case: &CaseArguments,
    neighbors: Neighbors,
    tolerance: f64,
    json: bool,
) -> Result<(), AppError> {
    let case = case.read(false)?.case;
    let options = Options { tolerance, ..Options::default() };
    let ellipsoids = terminal::with_progress(|progress| {
        progress.say("ellipsoids");
        report(&case, neighbors.into(), &options, progress)
    })?;
    if json { terminal::print_json(&ellipsoids) } else { terminal::print(&table(&ellipsoids)) }
}

/// The report as a text table; within each mask or region, the largest component first.
fn table(report: &EllipsoidsReport) -> String {
    let mut lines = vec![
        report.case.clone(),
        format!(
            "{} components of masks and regions, {} neighbours",
            report.components.len(),
            report.connectivity
        ),
    ];
    for components in report.components.chunk_by(|a, b| a.of == b.of && a.time == b.time) {
        let name = match &components[0].of {
            OfReport::Mask(id) => format!("mask {id}"),
            OfReport::Region(ids) => format!("region {}", ids.join("+")),
        };
        let time =
            if components[0].time.is_empty() { String::new() } else { format!(", {}", components[0].time) };
        lines.push(format!("\n{name}{time}"));
        lines.push(format!(
            "{:>12} {:>14} {:>26} {:>24} {:>12} {:>12}",
            "voxels", "volume", "centre R, A, S (mm)", "semi-axes (mm)", "enclosing", "bound - 1"
        ));
        let mut sorted: Vec<_> = components.iter().collect();
        sorted.sort_by_key(|c| std::cmp::Reverse(c.voxels));
        for c in sorted {
            let EllipsoidReport { center_mm: [r, a, s], .. } = c.enclosing;
            lines.push(format!(
                "{:>12} {:>14} {:>26} {:>24} {:>12} {:>12.1e}",
                c.voxels,
                format::ml(c.volume_ml),
                format!("{r:.1}, {a:.1}, {s:.1}"),
                decimal::sizes(c.enclosing.semi_axes_mm, 2),
                format!("{:.2} times", c.exaggeration),
                c.volume_bound - 1.0
            ));
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use glioscope_core::{Progress, case, sample};

    #[test]
    fn table_lists_every_mask_and_region_of_the_sample() {
        let case =
            case::load(&sample::sample_spec(), &case::LoadOptions::default(), &Progress::new()).unwrap();
        let found = report(&case, Connectivity::default(), &Options::default(), &Progress::new()).unwrap();
        let text = table(&found);
        let masks: usize = case.time_points.iter().map(|t| t.regions.mask_ids().len()).sum();
        let regions: usize = case.time_points.iter().map(|t| t.regions.list().len()).sum();
        assert_eq!(text.matches("\nmask ").count(), masks);
        assert_eq!(text.matches("\nregion ").count(), regions);
        assert_eq!(text.matches(" times ").count(), found.components.len());
    }
}
