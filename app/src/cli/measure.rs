//! `glioscope measure`: volumes and agreement of masks and regions.

use clap::{Args, ValueEnum};
use glioscope_core::{
    case::Case,
    decimal,
    measure::{
        self, DateComparison, Operand, PairComparison, Statistics,
        conventions::{Comparison, Convention, LesionRule, METRICS, Settings},
    },
};

use super::{
    case::CaseArguments,
    parse::{self, keyword},
    terminal,
};
use crate::{
    error::AppError,
    format,
    world::agreement::{compare_two, with_metrics},
};

/// Additional decimals compared with the tables of the window.
const EXTRA_DECIMALS: usize = 1;

/// Which lesions BraTS joins and leaves out.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Tumor {
    /// Adult and paediatric glioma.
    Glioma,
    /// Meningioma.
    Meningioma,
    /// Metastases.
    Metastases,
}

impl From<Tumor> for LesionRule {
    fn from(tumor: Tumor) -> Self {
        match tumor {
            Tumor::Glioma => Self::GLIOMA,
            Tumor::Meningioma => Self::MENINGIOMA,
            Tumor::Metastases => Self::METASTASES,
        }
    }
}

/// Arguments of `measure`.
#[derive(Debug, Args)]
pub struct MeasureArguments {
    /// The case.
    #[command(flatten)]
    pub case: CaseArguments,
    /// Also the values of every image in every mask: mean, SD, percentiles, peak.
    #[arg(long)]
    pub statistics: bool,
    /// Also distances of surfaces, surface Dice, kappa, lesions, and the agreement of all masks as raters. The first mask of a
    /// pair is the reference.
    #[arg(long)]
    pub metrics: bool,
    /// Whose definitions they follow; they differ: docs/metrics.md. Default: deepmind.
    #[arg(long, value_name = "CONVENTION", value_parser = keyword::<Convention>(), requires = "metrics")]
    pub convention: Option<Convention>,
    /// Tolerance of the surface Dice; default: 1.
    #[arg(long, value_name = "MM", value_parser = parse::within(0.0..=1000.0), requires = "metrics", allow_hyphen_values = true)]
    pub tau: Option<f64>,
    /// A mask with which all others are compared: the first of its pairs. Repeat for more. Without it the mask that the case lists
    /// first.
    #[arg(long, value_name = "ID", requires = "metrics")]
    pub reference: Vec<String>,
    /// Percentile of the robust Hausdorff distance; default: 95.
    #[arg(long, value_name = "P", value_parser = parse::within(0.0..=100.0), requires = "metrics", allow_hyphen_values = true)]
    pub percentile: Option<f64>,
    /// Which lesions the convention brats joins and leaves out; default: those of gliomas.
    #[arg(long, value_enum, requires = "metrics")]
    pub tumor: Option<Tumor>,
    /// Also two masks, unions (ID+ID) or regions (=ID+ID: exactly these masks) of any dates, the first as the reference.
    #[arg(long, value_names = ["ID[@DATE]", "ID[@DATE]"], num_args = 2, requires = "metrics")]
    pub two: Vec<String>,
    /// As JSON: see docs/json.md.
    #[arg(long)]
    pub json: bool,
}

impl MeasureArguments {
    /// The comparisons that `--two` asks for.
    fn compared_two(&self, case: &Case) -> Result<Vec<PairComparison>, AppError> {
        let named = |text: &String| {
            Operand::parse(case, text).map_err(|why| AppError::Compared(format!("--two: {why}")))
        };
        let compared = |two: &[String]| {
            let [a, b] = two else { return Err(AppError::arguments("one mask", "two for each --two")) };
            let two = [named(a)?, named(b)?];
            terminal::with_progress(|progress| compare_two(case, &two, &self.settings(), progress))
        };
        self.two.chunks(2).map(compared).collect()
    }

    fn settings(&self) -> Settings {
        let default = Settings::default();
        Settings {
            convention: self.convention.unwrap_or(default.convention),
            percentile: self.percentile.unwrap_or(default.percentile),
            tolerance_mm: self.tau.unwrap_or(default.tolerance_mm),
            lesion_rule: self.tumor.map_or(default.lesion_rule, Into::into),
        }
    }
}

pub(super) fn run(arguments: &MeasureArguments) -> Result<(), AppError> {
    let case = arguments.case.read(false)?.case;
    let values = match arguments.statistics {
        true => Some(terminal::with_progress(|progress| measure::statistics(&case, progress))?),
        false => None,
    };
    let references = &arguments.reference;
    let has = |id: &str| case.time_points.iter().flat_map(|t| &t.masks).any(|mask| mask.mask.id() == id);
    for id in references.iter().filter(|id| !has(id)) {
        // No error: in a cohort some cases may lack it.
        terminal::warning(
            "reference",
            &format!("--reference: found no mask {id}, expected one of the case; pairs stay as listed"),
        );
    }
    let compared = match arguments.metrics {
        true => Some(terminal::with_progress(|progress| {
            measure::compared(&case, references, &arguments.settings(), progress)
        })?),
        false => None,
    };
    let two = arguments.compared_two(&case)?;
    if arguments.json {
        let mut report = measure::report(&case);
        for (time, of_date) in report.time_points.iter_mut().zip(values.into_iter().flatten()) {
            time.statistics = Some(of_date);
        }
        return match compared {
            None => terminal::print_json(&report),
            Some(compared) => terminal::print_json(&with_metrics(&report, &compared, &two)?),
        };
    }
    let text = table(&case);
    let compared = compared.map(|compared| metrics_table(&compared, &two)).unwrap_or_default();
    let values = values.map(|values| values_table(&case, &values)).unwrap_or_default();
    terminal::print(&format!("{text}{compared}{values}"))
}

/// Metrics of pairs as a text table.
fn metrics_table(compared: &[DateComparison], two: &[PairComparison]) -> String {
    let mut lines = Vec::new();
    let head = |place: &str, of: &PairComparison| {
        let Comparison { convention, percentile, tolerance_mm, .. } = of.comparison;
        let name: &str = convention.into();
        format!(
            "\n\nmetrics{place} by {name}: the first mask is the reference; percentile {percentile}, tolerance {tolerance_mm} mm"
        )
    };
    let values = |pair: &PairComparison| {
        std::iter::once(format!("{} and {}", pair.a, pair.b)).chain(values_of(pair)).collect::<Vec<_>>()
    };
    for date in compared {
        let place = if date.time.is_empty() { String::new() } else { format!(" at {}", date.time) };
        let Some(first) = date.pairs.first() else { continue };
        lines.push(head(&place, first));
        lines.extend(date.pairs.iter().flat_map(values));
        if let Some(raters) = &date.raters {
            let number =
                |value: Option<f64>| value.map_or_else(|| "undefined".to_owned(), |v| format!("{v:.4}"));
            lines.push(format!("all {} masks as raters", raters.masks.len()));
            lines.push(format!("  {:28} {}", "majority", format::ml(raters.majority_ml)));
            lines.push(format!(
                "  {:28} {} (union's box), {} (whole grid)",
                "Fleiss' kappa",
                number(raters.fleiss_kappa_union_box),
                number(raters.fleiss_kappa_whole_grid)
            ));
            if let (Some(staple), Some(ml)) = (&raters.staple, raters.staple_ml) {
                lines.push(format!("  {:28} {}", "STAPLE", format::ml(ml)));
                for ((id, sensitivity), specificity) in
                    raters.masks.iter().zip(&staple.sensitivity).zip(&staple.specificity)
                {
                    lines.push(format!(
                        "    {id:26} sensitivity {sensitivity:.4}, specificity {specificity:.6}"
                    ));
                }
            }
        }
    }
    if let Some(first) = two.first() {
        lines.push(head(" of any dates", first));
        lines.extend(two.iter().flat_map(values));
    }
    lines.join("\n")
}

/// The values of a pair, one line each; those that the convention hasn't are left out.
fn values_of(pair: &PairComparison) -> Vec<String> {
    let comparison = &pair.comparison;
    let number = |value: f64, decimals: usize, unit: &str| {
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        if value.is_finite() {
            format!("{value:.0$}{unit}", decimals + EXTRA_DECIMALS)
        } else {
            "infinite".to_owned()
        }
    };
    let values = METRICS.iter().zip(&comparison.values);
    let mut lines: Vec<String> = values
        .filter_map(|(metric, (_, value))| {
            Some(format!("  {:28} {}", metric.name, number((*value)?, metric.decimals, metric.unit)))
        })
        .collect();
    if let Some(lesions) = &comparison.lesions {
        lines.push(format!(
            "  {:28} {} found, {} missed, {} false, {} too small to count",
            "lesions", lesions.found, lesions.missed, lesions.false_positives, lesions.ignored
        ));
        let of_lesions =
            [("F1", lesions.f1), ("lesion-wise Dice", lesions.dice), ("panoptic quality", lesions.pq)];
        let known = of_lesions.into_iter().filter_map(|(name, value)| Some((name, value?)));
        lines.extend(known.map(|(name, value)| format!("  {name:28} {}", number(value, 3, ""))));
    }
    lines.extend(comparison.no_distances.as_ref().map(|why| format!("  no distances: {why}")));
    lines
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
