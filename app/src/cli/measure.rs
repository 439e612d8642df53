//! `glioscope measure`: volumes and agreement of masks and regions.

use glioscope_core::{
    case::Case,
    decimal,
    measure::{self, Statistics},
};

use super::{case::CaseArguments, terminal};
use crate::{error::AppError, format};

/// Additional decimals compared with the tables of the window.
const EXTRA_DECIMALS: usize = 1;

pub(super) fn run(case: &CaseArguments, statistics: bool, json: bool) -> Result<(), AppError> {
    let case = case.read(false)?.case;
    let values = match statistics {
        true => Some(terminal::with_progress(|progress| measure::statistics(&case, progress))?),
        false => None,
    };
    if json {
        let mut report = measure::report(&case);
        for (time, of_date) in report.time_points.iter_mut().zip(values.into_iter().flatten()) {
            time.statistics = Some(of_date);
        }
        return terminal::print_json(&report);
    }
    let text = table(&case);
    let values = values.map(|values| values_table(&case, &values)).unwrap_or_default();
    terminal::print(&format!("{text}{values}"))
}

/// Values of images in masks as a text table, in each image's unit.
fn values_table(case: &Case, values: &[Vec<Statistics>]) -> String {
    let mut lines = Vec::new();
    for (time, of_date) in case.time_points.iter().zip(values) {
        let place = if time.label.is_empty() { String::new() } else { format!(" at {}", time.label) };
        lines.push(format!("\n\nvalues of images in masks{place}, in the image's unit"));
        lines.push(format!(
            "{:16} {:16} {:>8} {:>11} {:>11} {:>11} {:>11} {:>11} {:>11}",
            "image", "mask", "voxels", "mean", "SD", "least", "median", "most", "peak (1 ml)"
        ));
        for s in of_date {
            let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), format::four_digits);
            lines.push(format!(
                "{:16} {:16} {:>8} {:>11} {:>11} {:>11} {:>11} {:>11} {:>11}",
                s.image,
                s.mask,
                s.voxels,
                number(s.mean),
                number(s.sd),
                number(s.min),
                number(s.p50),
                number(s.max),
                number(s.peak)
            ));
        }
    }
    lines.join("\n")
}

/// The report as a text table.
fn table(case: &Case) -> String {
    let spacing = case.grid.spacing_mm();
    let [nx, ny, nz] = case.grid.dims();
    let mut lines = vec![
        case.name.clone(),
        format!("grid {nx} × {ny} × {nz}, {} mm", decimal::sizes(spacing.to_array(), 3)),
    ];
    for time_point in &case.time_points {
        let regions = &time_point.regions;
        let union = regions.union_voxels();
        if !time_point.label.is_empty() {
            lines.push(format!("\n{}", time_point.label));
        }
        lines.push(format!("{:24} {:>12} {:>14} {:>14}", "mask", "voxels", "volume", "on own grid"));
        for (k, mask) in time_point.masks.iter().enumerate() {
            let name = mask.name.as_ref().map(|name| format!(" ({name})")).unwrap_or_default();
            lines.push(format!(
                "{:24} {:>12} {:>14} {:>14}",
                format!("{}{name}", mask.mask.id()),
                regions.mask_voxels(k),
                format::ml(regions.mask_ml(k)),
                format::ml(mask.native_volume_ml)
            ));
            if let Some(ml) = mask.expected_volume_ml {
                lines.push(format!(
                    "{:24} {:>12} {:>14} {:>14}",
                    "  sum of probabilities",
                    "",
                    "",
                    format::ml(ml)
                ));
            }
        }
        lines.push(format!("{:24} {:>12} {:>14} {:>14}", "region", "voxels", "volume", "of the union"));
        for region in regions.list() {
            let share = region.voxels as f64 / union as f64;
            lines.push(format!(
                "{:24} {:>12} {:>14} {:>14}",
                regions.name(region.bits),
                region.voxels,
                format::ml(region.volume_ml),
                format::percent(share)
            ));
        }
        lines.push(format!("{:24} {:>12} {:>14}", "union", union, format::ml(regions.union_ml())));
        for pair in measure::pairs(&time_point.index, regions) {
            let name = format!("{} and {}", pair.a, pair.b);
            let values: Vec<String> = pair
                .metrics()
                .map(|(metric, value)| format!("{} {}", metric.name, metric.print(value, EXTRA_DECIMALS)))
                .collect();
            lines.push(format!("{name:24} {}", values.join("  ")));
        }
    }
    lines.join("\n")
}
