//! `glioscope self-check`: known changes are put into the case, and what of them is measured is told.

use clap::Args;
use glioscope_core::{
    case::Case,
    change::{self, ChangeOptions, Choice, DEFAULT_SMALLEST_ML},
    decimal,
    self_check::{
        self, Comes, LesionCheck, Options, Recovered, SelfCheckReport, SurfaceCheck, Target, Where,
    },
};

use super::{case::CaseArguments, parse, terminal};
use crate::{
    error::AppError,
    format,
    model::{REGISTRATION_MM, lesions::SMALLEST_ML},
};

/// Arguments of `self-check`.
#[derive(Debug, Args)]
pub struct SelfCheckArguments {
    /// The case.
    #[command(flatten)]
    pub case: CaseArguments,
    /// The mask, by id; without it the first that both dates have, else the first.
    #[arg(long, value_name = "ID")]
    pub of: Option<String>,
    /// The date into which changes are put, by its label; without it the first.
    #[arg(long, value_name = "LABEL")]
    pub from: Option<String>,
    /// The date with which it is compared, whose registration says how uncertain a change is; without it the last.
    #[arg(long, value_name = "LABEL")]
    pub to: Option<String>,
    /// Runs without change; without it 100, of a large lesion fewer, so that it takes about a minute.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=10_000))]
    pub unchanged: Option<u16>,
    /// Runs of each known change; without it 6, of a large lesion fewer.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub runs: Option<u16>,
    /// Seed of the random numbers: the same seed gives the same answer.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Registration error between the dates, in millimetres (standard deviation).
    /// Without it 0.5, or what the consistency of --register says.
    #[arg(long, value_name = "X", value_parser = parse::within(REGISTRATION_MM), allow_hyphen_values = true)]
    pub registration_mm: Option<f64>,
    /// Smaller components make neither appeared, vanished, split nor merged.
    #[arg(long, value_name = "ML", value_parser = parse::within(SMALLEST_ML), default_value_t = DEFAULT_SMALLEST_ML, allow_hyphen_values = true)]
    pub smallest: f64,
    /// As JSON: see docs/json.md.
    #[arg(long)]
    pub json: bool,
}

pub(super) fn run(arguments: &SelfCheckArguments) -> Result<(), AppError> {
    let case = arguments.case.read(true)?.case;
    let target = target(&case, arguments)?;
    let defaults = Options::default();
    let options = Options {
        seed: arguments.seed,
        unchanged_runs: arguments.unchanged.map_or(defaults.unchanged_runs, usize::from),
        runs: arguments.runs.map_or(defaults.runs, usize::from),
        fits_minute: arguments.unchanged.is_none() && arguments.runs.is_none(),
        change: ChangeOptions {
            registration_mm: arguments.registration_mm.unwrap_or(change::DEFAULT_REGISTRATION_MM),
            uses_consistency: arguments.registration_mm.is_none(),
            smallest_ml: arguments.smallest,
            ..ChangeOptions::default()
        },
        ..defaults
    };
    let report =
        terminal::with_progress(|progress| self_check::self_check(&case, &target, &options, progress))?;
    if arguments.json { terminal::print_json(&report) } else { terminal::print(&table(&report)) }
}

/// What is compared where the case has two dates with it, else its first mask.
fn target(case: &Case, arguments: &SelfCheckArguments) -> Result<Target, AppError> {
    let (of, from, to) = (arguments.of.as_deref(), arguments.from.as_deref(), arguments.to.as_deref());
    if case.time_points.len() < 2 && to.is_none() {
        return Ok(Target::resolve(case, of, from)?);
    }
    match Choice::resolve(case, of, from, to) {
        Ok(choice) => {
            for assumed in choice.assumed(case, of, from, to) {
                terminal::assumed(&assumed);
            }
            Ok(Target::of(&choice))
        }
        // What only one of the dates has can be checked all the same.
        Err(_) if to.is_none() => Ok(Target::resolve(case, of, from)?),
        Err(error) => Err(error.into()),
    }
}

/// The report as a text table.
pub(super) fn table(report: &SelfCheckReport) -> String {
    let date = if report.date.is_empty() { String::new() } else { format!(" at {}", report.date) };
    let mut lines = vec![
        format!("{}{date}: {}, known changes put in and measured", report.mask, format::ml(report.volume_ml)),
        format!(
            "{:22} {:>9} {:>9} {:>14} {:>14} {:>14} {:>9}",
            "known change", "known", "measured", "lengths", "nearest", "volume", "called"
        ),
    ];
    lines.extend(report.surfaces.iter().map(surface_row));
    lines.push(String::new());
    lines.push(format!("{:22} {:>6} {:>6} {:>16}", "known lesion", "runs", "found", "volume"));
    lines.extend(report.lesions.iter().map(lesion_row));
    lines.push(String::new());
    let unchanged = &report.unchanged;
    lines.push(format!(
        "no change: {} false calls in {} runs (grew {}, shrank {}, appeared {}, vanished {}){}; split or merged in {}",
        unchanged.false_calls,
        unchanged.runs,
        unchanged.grew,
        unchanged.shrank,
        unchanged.appeared,
        unchanged.vanished,
        mark(unchanged.marked),
        unchanged.pieces
    ));
    if let Some(registration) = &report.registration {
        let mm = |mm: Option<f64>| mm.map_or_else(|| "–".to_owned(), |mm| decimal::text(mm, 3));
        lines.push(format!(
            "registration off at the lesion: median {} mm, most {} mm of {} runs, {} refused; in full {} mm of {}",
            mm(registration.median_mm),
            mm(registration.max_mm),
            registration.runs,
            registration.refused,
            mm(registration.full_max_mm),
            registration.full_runs
        ));
    }
    lines.extend(report.notes.iter().cloned());
    if report.is_marked() {
        lines.push(
            "* outside 0.9 to 1.1 of what is known, fewer than 9 in 10 found, or more than 1 % false calls"
                .to_owned(),
        );
    }
    lines.join("\n")
}

fn mark(marked: bool) -> &'static str {
    if marked { " *" } else { "" }
}

/// A share with its standard error: `0.97 ± 0.01`.
fn share(recovered: Option<Recovered>) -> String {
    recovered.map_or_else(
        || "–".to_owned(),
        |r| {
            let error = r.standard_error.map(|error| format!(" ± {error:.2}")).unwrap_or_default();
            format!("{:.2}{error}{}", r.share, mark(r.marked))
        },
    )
}

fn surface_row(check: &SurfaceCheck) -> String {
    let at = match check.at {
        Where::Evenly => "evenly",
        Where::OneSide => "on one side",
    };
    format!(
        "{:22} {:>6.2} mm {:>6.2} mm {:>14} {:>14} {:>14} {:>9}",
        format!("{:+} mm {at}", check.known_mm),
        check.known_mean_mm,
        check.mean_mm,
        share(check.surface),
        share(check.nearest),
        share(check.volume),
        format!("{} of {}", check.called, check.runs)
    )
}

fn lesion_row(check: &LesionCheck) -> String {
    let what = match check.comes {
        Comes::New => "new",
        Comes::Vanished => "vanished",
    };
    format!(
        "{:22} {:>6} {:>6} {:>16}{}",
        format!("{what}, {} ml", check.known_ml),
        check.runs,
        check.found,
        share(check.volume),
        mark(check.marked)
    )
}
