//! `glioscope change`: change of a mask between two time points.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use glioscope_core::{
    change::{self, ChangeOptions, ChangeReport, DEFAULT_SMALLEST_ML, Flag, Lengths},
    decimal,
    self_check::{self, Options, SelfCheckReport, Target},
    skeleton::{Level, SkeletonOptions},
};

use super::{case::CaseArguments, parse, resolve, terminal};
use crate::{
    error::AppError,
    format,
    model::{REGISTRATION_MM, lesions::SMALLEST_ML},
    output,
    world::surroundings,
};

/// Level of detail of the skeleton.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum LevelArgument {
    /// Core skeleton.
    #[value(name = "0")]
    Core,
    /// Also branches from minima of the divergence.
    #[value(name = "1")]
    Divergence,
    /// Also branches from tips of the boundary.
    #[value(name = "2")]
    Boundary,
}

impl From<LevelArgument> for Level {
    fn from(level: LevelArgument) -> Self {
        match level {
            LevelArgument::Core => Self::Core,
            LevelArgument::Divergence => Self::Divergence,
            LevelArgument::Boundary => Self::Boundary,
        }
    }
}

/// Arguments of `change`.
#[derive(Debug, Args)]
pub struct ChangeArguments {
    /// The case.
    #[command(flatten)]
    pub case: CaseArguments,
    /// The mask, by id; without it the first that both dates have.
    #[arg(long, value_name = "ID")]
    pub of: Option<String>,
    /// The earlier date, by its label; without it the first.
    #[arg(long, value_name = "LABEL")]
    pub from: Option<String>,
    /// The later date, by its label; without it the last.
    #[arg(long, value_name = "LABEL")]
    pub to: Option<String>,
    /// As JSON: see docs/json.md.
    #[arg(long)]
    pub json: bool,
    /// Also check the change on this case, with known changes put in, as self-check does: up to a minute more.
    #[arg(long)]
    pub self_check: bool,
    /// Also write every vector to this file.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Write over a file that exists.
    #[arg(long, requires = "csv")]
    pub force: bool,
    /// Registration error between the dates, in millimetres (standard deviation).
    /// Without it 0.5, or what the consistency of --register says.
    #[arg(long, value_name = "X", value_parser = parse::within(REGISTRATION_MM), allow_hyphen_values = true)]
    pub registration_mm: Option<f64>,
    /// Smaller components make neither appeared, vanished, split nor merged.
    #[arg(long, value_name = "ML", value_parser = parse::within(SMALLEST_ML), default_value_t = DEFAULT_SMALLEST_ML, allow_hyphen_values = true)]
    pub smallest: f64,
    /// Level of detail of the skeleton: 0 core, 1 also branches from minima of the divergence, 2 also branches from
    /// tips of the boundary.
    #[arg(long, value_name = "0|1|2", value_enum, default_value = "0", hide_possible_values = true)]
    pub level: LevelArgument,
}

pub(super) fn run(arguments: &ChangeArguments) -> Result<(), AppError> {
    let case = arguments.case.read(false)?.case;
    arguments.csv.iter().try_for_each(|path| output::refuse(path, &case.inputs, arguments.force))?;
    let options = ChangeOptions {
        skeleton: SkeletonOptions { level: arguments.level.into(), ..SkeletonOptions::default() },
        registration_mm: arguments.registration_mm.unwrap_or(change::DEFAULT_REGISTRATION_MM),
        uses_consistency: arguments.registration_mm.is_none(),
        smallest_ml: arguments.smallest,
        ..ChangeOptions::default()
    };
    let (of, from, to) = (arguments.of.as_deref(), arguments.from.as_deref(), arguments.to.as_deref());
    let choice = resolve::change(&case, of, from, to)?;
    let result = terminal::with_progress(|progress| {
        change::between_with_surroundings(&case, &choice, &options, None, progress)
    });
    let (report, change, around) = result?;
    terminal::notes(report.own_warnings(&case));
    if let Some(path) = &arguments.csv {
        output::write(path, &case.inputs, &change::csv(&change, Some(&around)))?;
    }
    let checked = arguments.self_check.then(|| {
        let options = Options { change: options, ..Options::default() };
        let target = Target::of(&choice);
        terminal::with_progress(|progress| self_check::self_check(&case, &target, &options, progress))
    });
    let checked = checked.transpose()?;
    if !arguments.json {
        let checked = checked.iter().flat_map(|checked| [String::new(), super::self_check::table(checked)]);
        return terminal::print(
            &std::iter::once(table(&report)).chain(checked).collect::<Vec<_>>().join("\n"),
        );
    }
    let Some(checked) = checked else { return terminal::print_json(&report) };
    terminal::print_json(&WithCheck { report: &report, self_check: &checked })
}

/// The change with the check on this case.
#[derive(serde::Serialize)]
struct WithCheck<'a> {
    #[serde(flatten)]
    report: &'a ChangeReport,
    self_check: &'a SelfCheckReport,
}

/// The report as a text table.
fn table(r: &ChangeReport) -> String {
    let ml = |ml: Option<f64>| ml.map_or_else(|| "–".to_owned(), format::ml);
    let mut lines = vec![
        format!("{} from {} to {}", r.mask, r.from, r.to),
        format!("{:24} {:>14}", "before", format::ml(r.from_ml)),
        format!("{:24} {:>14}", "after", format::ml(r.to_ml)),
        format!("{:24} {:>14}", "kept", ml(r.kept_ml)),
        format!("{:24} {:>14}", "gone", ml(r.gone_ml)),
        format!("{:24} {:>14}", "new", ml(r.new_ml)),
        String::new(),
    ];
    let mut moved: Vec<String> = r
        .aligned
        .iter()
        .filter(|a| a.is_mask && a.id == r.mask && (a.time == r.from || a.time == r.to))
        .map(|a| format!("{} moved by {}", a.time, a.by.join(", then by ")))
        .collect();
    moved.dedup();
    if !moved.is_empty() {
        lines.splice(1..1, moved);
    }
    if r.has_volumes_only() {
        let is_stated = r.flags.contains(&Flag::NotAligned);
        let why = if is_stated { "not aligned." } else { "no overlap: not aligned?" };
        lines.push(format!("{why} Only volumes are compared"));
        return lines.join("\n");
    }
    lines.push(format!(
        "{:24} {:>8} {:>9} {:>9} {:>9} {:>9}",
        "surface, mm", "vectors", "mean", "median", "95 %", "most"
    ));
    let row = |name: &str, l: &Lengths| {
        let mm = |v: Option<f64>| v.map_or("–".to_owned(), |v| decimal::text(v, 2));
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
    let cavities = &r.cavities;
    if cavities.from_ml > 0.0 || cavities.to_ml > 0.0 {
        lines.push(row("cavity widened, nearest", &cavities.widened));
        lines.push(row("cavity narrowed, nearest", &cavities.narrowed));
        lines.push(format!(
            "cavities from {} to {}",
            format::ml(cavities.from_ml),
            format::ml(cavities.to_ml)
        ));
    }
    let is_measured = r.uncertainty_mm.registration_from == "consistency";
    let from = if is_measured { " from the registration's consistency" } else { "" };
    let axes = r.uncertainty_mm.axes_mm.map(|mm| decimal::text(mm, 2)).join(", ");
    lines.push(format!(
        "{} of {} vectors within uncertainty ({axes} mm along the axes of the case grid, registration {} mm{from})",
        r.within_uncertainty,
        r.vectors,
        decimal::text(r.uncertainty_mm.registration_mm, 2)
    ));
    for (number, group) in r.components.iter().enumerate().take(20) {
        let ml = |parts: &[change::PartReport]| -> String {
            let list: Vec<String> = parts.iter().map(|p| format::ml(p.volume_ml)).collect();
            if list.is_empty() { "nothing".into() } else { list.join(" + ") }
        };
        let fate: &str = group.fate.into();
        let displaced: String = format::displaced(group).iter().map(|text| format!("; {text}")).collect();
        lines.push(format!(
            "component {number}: {fate} ({} to {}){displaced}",
            ml(&group.from),
            ml(&group.to)
        ));
    }
    if r.components.len() > 20 {
        lines.push(format!("… and {} components more", r.components.len() - 20));
    }
    let by_masks =
        |group: &change::GroupReport| group.displacement.as_ref().and_then(format::displacement).is_some();
    if r.components.iter().any(|group| by_masks(group) && group.tissue.is_none()) {
        lines.push("displaced: growth on one side with shrinkage on the other looks the same".to_owned());
    }
    if r.components.iter().any(|group| group.tissue.is_some_and(|tissue| tissue.moved_mm.is_some())) {
        lines.push(
            "displaced?: a lesion that grows and pushes the tissue before it looks the same".to_owned(),
        );
    }
    lines.extend(surroundings::line(r).map(|line| line.text));
    let flags: Vec<&str> = r.flags.iter().map(Into::into).collect();
    if !flags.is_empty() {
        lines.push(format!("flags: {}", flags.join(", ")));
    }
    lines.join("\n")
}
