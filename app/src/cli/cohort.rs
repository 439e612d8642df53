//! `glioscope cohort`: the cases of a data set, each computed by processes of its own, and tables of all of them (a BIDS-App).

use std::{
    path::{Path, PathBuf},
    sync::Mutex,
    time::{Duration, Instant},
};

use clap::{Args, ValueEnum};
use glioscope_cohort::{
    CohortCase, CohortError, Grouped, Options, Outcome, Place, Ranking, Resources, Said, Step, Summary, find,
    group, rank, run as compute,
};
use glioscope_core::{
    case::derived_data_set,
    measure::conventions::Convention,
    response::{Assessment, Criterion},
};

use super::{
    measure::Tumor,
    parse::{self, keyword},
    register::ModelArgument,
    terminal,
};
use crate::{error::AppError, model::session, world::load};

/// Memory that a case is taken to need, MiB: `--mem-mb` holds so many cases. docs/cohort.md has what was measured.
const CASE_MB: u64 = 1024;
/// The names of cases in one line of an error.
const MAX_NAMED: usize = 5;

/// What is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Level {
    /// Compute every case that has no current results.
    Participant,
    /// Write the tables of all cases.
    Group,
}

/// Arguments of `cohort`.
#[derive(Debug, Args)]
pub struct CohortArguments {
    /// The data set: a folder of cases (BIDS, BraTS, DICOM studies), of manifests, or a table (.csv, .tsv) with the columns case and
    /// path. It is never written.
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// The folder of results.
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// What is done.
    #[arg(value_enum)]
    pub level: Level,
    /// These cases alone, with or without "sub-".
    #[arg(long, alias = "participant_label", value_name = "LABEL", num_args = 1..)]
    pub participant_label: Vec<String>,
    /// Cases that are computed at a time; default: as many as the memory holds, at most one for each core.
    #[arg(long, alias = "n_procs", value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub n_procs: Option<u16>,
    /// Memory of all processes together, in MB: fewer run at a time, and a case that needs more than its share is computed again alone.
    #[arg(long, alias = "mem_mb", value_name = "MB", value_parser = clap::value_parser!(u64).range(64..))]
    pub mem_mb: Option<u64>,
    /// Where cases are made before they are copied to OUT: a disk of the node.
    #[arg(short = 'w', long, alias = "work_dir", value_name = "FOLDER")]
    pub work_dir: Option<PathBuf>,
    /// Print the labels of the cases, one on each line, and do nothing else.
    #[arg(long)]
    pub list: bool,
    /// Don't ask for the description of a BIDS data set.
    #[arg(long, alias = "skip_bids_validation")]
    pub skip_bids_validation: bool,
    /// Of a raw BIDS data set: the derived ones whose masks belong to its images, by their names in derivatives/ or paths with a /, or
    /// none. Default: in each case the only one that has any of the subject, where it has no masks itself.
    #[arg(long, value_name = "NAME", num_args = 1.., value_parser = parse::derived)]
    pub derivatives: Vec<PathBuf>,
    /// What is computed of every case; measure always is.
    #[arg(long, value_name = "WHAT,...", value_delimiter = ',', default_value = "measure", value_parser = keyword::<Step>())]
    pub compute: Vec<Step>,
    /// The mask of lesions, change and response, by id; repeat for more. Without it each command's own choice.
    #[arg(long, value_name = "ID")]
    pub of: Vec<String>,
    /// The criteria of response; default: those of each history.
    #[arg(long, value_name = "CRITERIA", value_parser = keyword::<Criterion>())]
    pub criteria: Option<Criterion>,
    /// Whose definitions the metrics follow; default: deepmind.
    #[arg(long, value_name = "CONVENTION", value_parser = keyword::<Convention>())]
    pub convention: Option<Convention>,
    /// Tolerance of the surface Dice; default: 1.
    #[arg(long, value_name = "MM", value_parser = parse::within(0.0..=1000.0), allow_hyphen_values = true)]
    pub tau: Option<f64>,
    /// Percentile of the robust Hausdorff distance; default: 95.
    #[arg(long, value_name = "P", value_parser = parse::within(0.0..=100.0), allow_hyphen_values = true)]
    pub percentile: Option<f64>,
    /// Which lesions the convention brats joins and leaves out; default: those of gliomas.
    #[arg(long, value_enum)]
    pub tumor: Option<Tumor>,
    /// RANO 2.0: what is assessed; default: that of each history, else enhancing.
    #[arg(long, value_name = "WHAT", value_parser = keyword::<Assessment>())]
    pub assessment: Option<Assessment>,
    /// The mask of non-enhancing disease, where that is assessed, too.
    #[arg(long, value_name = "ID,...", value_delimiter = ',')]
    pub non_enhancing: Vec<String>,
    /// Also the values of this image in each lesion.
    #[arg(long, value_name = "ID")]
    pub image: Option<String>,
    /// Also how the surface of each lesion moved since the date before.
    #[arg(long)]
    pub surface: bool,
    /// Register each later date to the first one by its images, in every case.
    #[arg(long, value_enum, value_name = "MODEL", num_args = 0..=1, require_equals = true, default_missing_value = "rigid")]
    pub register: Option<ModelArgument>,
    /// All files of a case lie in one space, though they state several frames of reference.
    #[arg(long)]
    pub one_space: bool,
    /// Draw with the software graphics adapter alone.
    #[arg(long)]
    pub software: bool,
    /// Group: rank the other masks by their agreement with this one; repeated: with these parts of one reference (ref-WT, ref-TC), each by the
    /// masks of that part. Participant: compare them with it, as the first of its pairs; what isn't the same both ways is ranked by such
    /// results alone.
    #[arg(long, value_name = "ID")]
    pub reference: Vec<String>,
    /// Group: the metrics of the ranking: docs/cohort.md.
    #[arg(
        long,
        value_name = "METRIC,...",
        value_delimiter = ',',
        default_value = "dice",
        requires = "reference"
    )]
    pub rank_by: Vec<String>,
    /// Group: fixes which cases the bootstrap draws.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "reference")]
    pub seed: u64,
}

impl CohortArguments {
    fn options(&self) -> Options {
        let mut compute = self.compute.clone();
        compute.push(Step::Measure);
        compute.sort();
        compute.dedup();
        let register = self.register.map(|model| match model {
            ModelArgument::Rigid => "--register=rigid".to_owned(),
            ModelArgument::Affine => "--register=affine".to_owned(),
        });
        let one_space = self.one_space.then(|| "--one-space".to_owned());
        Options {
            compute,
            of: self.of.clone(),
            criteria: self.criteria.map(|criterion| <&str>::from(criterion).to_owned()),
            convention: self.convention.map(|convention| <&str>::from(convention).to_owned()),
            tau_mm: self.tau,
            percentile: self.percentile,
            tumor: self.tumor.and_then(|tumor| Some(tumor.to_possible_value()?.get_name().to_owned())),
            assessment: self.assessment.map(|assessment| <&str>::from(assessment).to_owned()),
            non_enhancing: self.non_enhancing.clone(),
            image: self.image.clone(),
            surface: self.surface,
            references: self.reference.clone(),
            derivatives: self.derivatives.clone(),
            case_arguments: register.into_iter().chain(one_space).collect(),
            software: self.software,
        }
    }

    fn resources(&self) -> Result<Resources, AppError> {
        let program = std::env::current_exe().map_err(|e| {
            AppError::wrong(
                "the program",
                format!("no path to itself ({e})"),
                "one, for the processes of cases",
            )
        })?;
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let held = self.mem_mb.map_or(u64::MAX, |all| (all / CASE_MB).max(1));
        let wanted = self.n_procs.map_or(cores, usize::from);
        let processes = wanted.min(usize::try_from(held).unwrap_or(usize::MAX)).max(1);
        Ok(Resources {
            program,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            processes,
            threads: (cores / processes).max(1),
            memory_mb: self.mem_mb,
            work: self.work_dir.clone(),
        })
    }
}

pub(super) fn run(arguments: &CohortArguments) -> Result<(), AppError> {
    let cases = find(&arguments.input, &arguments.participant_label, !arguments.skip_bids_validation)?;
    if arguments.list {
        let labels: Vec<&str> = cases.iter().map(|case| case.label.as_str()).collect();
        return terminal::print(&labels.join("\n"));
    }
    match arguments.level {
        Level::Participant => participant(arguments, &cases),
        Level::Group => grouped(arguments, &cases),
    }
}

fn participant(arguments: &CohortArguments, cases: &[CohortCase]) -> Result<(), AppError> {
    let (options, resources) = (arguments.options(), arguments.resources()?);
    for derived in &arguments.derivatives {
        derived_data_set(&arguments.input, derived)?;
    }
    if options.compute.contains(&Step::Response)
        && options.criteria.is_none()
        && let Some(case) = cases.iter().find(|case| case.history.is_none())
    {
        let found = format!("response without criteria, and no history of {}", case.label);
        return Err(AppError::wrong(
            "--compute",
            found,
            "--criteria, or a history of every case in the table",
        ));
    }
    let place = Place::open(&arguments.out, &arguments.input)?;
    let estimate = Estimate::default();
    let said = |said: &Said<'_>| estimate.say(said);
    let summary = terminal::with_progress(|progress| {
        compute((cases, &arguments.input), &place, &options, &resources, &session_files, (progress, &said))
    })?;
    let failed = summary.failed();
    terminal::print(&counted(&summary, &failed))?;
    if failed.is_empty() {
        return Ok(());
    }
    let mut names = failed.iter().take(MAX_NAMED).copied().collect::<Vec<_>>().join(", ");
    if failed.len() > MAX_NAMED {
        names.push_str(", …");
    }
    let (count, all, log) = (failed.len(), cases.len(), place.case("CASE").join("log.txt"));
    Err(AppError::CasesFailed(format!("{count} of {all} cases failed ({names}); {} says why", log.display())))
}

fn counted(summary: &Summary, failed: &[&str]) -> String {
    let (done, skipped) = (summary.count(&Outcome::Done), summary.count(&Outcome::Skipped));
    format!("{done} computed, {skipped} were there, {} failed", failed.len())
}

/// The files that a session names: those that its case is read from.
fn session_files(path: &Path) -> Result<Vec<PathBuf>, CohortError> {
    let wrong = |error: &dyn std::fmt::Display| {
        CohortError::wrong(path.display().to_string(), error.to_string(), "a session that can be read")
    };
    let session = session::load(path).map_err(|e| wrong(&e))?;
    let request = load::Request::of_session(session, &[], &glioscope_core::case::LoadOptions::default());
    let progress = glioscope_core::Progress::new();
    let spec = load::spec_of(&request.case, &request.options, &progress).map_err(|e| wrong(&e))?;
    Ok(spec.inputs().paths().to_vec())
}

/// Says how far a run is, and how long it may still take.
struct Estimate {
    started: Instant,
    /// Finished cases that were computed.
    computed: Mutex<usize>,
}

impl Default for Estimate {
    fn default() -> Self {
        Self { started: Instant::now(), computed: Mutex::new(0) }
    }
}

impl Estimate {
    fn say(&self, said: &Said<'_>) {
        let Said { case, outcome, seconds, finished, of } = said;
        let computed = {
            let mut computed = self.computed.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            *computed += usize::from(**outcome != Outcome::Skipped);
            *computed
        };
        let word = match outcome {
            Outcome::Skipped => return,
            Outcome::Done => format!("done in {seconds:.1} s"),
            Outcome::Failed(why) => format!("failed: {why}"),
        };
        let left = of - finished;
        let each = self.started.elapsed().as_secs_f64() / computed.max(1) as f64;
        let left = match left {
            0 => String::new(),
            left => format!("; about {} left", duration(Duration::from_secs_f64(each * left as f64))),
        };
        terminal::step(&format!("[{finished}/{of}] {case}: {word}{left}"));
    }
}

/// A duration in its two largest units.
fn duration(duration: Duration) -> String {
    let seconds = duration.as_secs();
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s} s"),
        (h, m, _) => format!("{h} h {m} min"),
    }
}

fn grouped(arguments: &CohortArguments, cases: &[CohortCase]) -> Result<(), AppError> {
    let unknown = arguments.rank_by.iter().find(|metric| rank::ranked_metric(metric).is_none());
    if let Some(metric) = unknown.filter(|_| !arguments.reference.is_empty()) {
        return Err(AppError::option("rank-by", metric, rank::ranked_metrics()));
    }
    let metrics = arguments.rank_by.clone();
    let references = arguments.reference.clone();
    let ranking = (!references.is_empty()).then_some(Ranking { references, metrics, seed: arguments.seed });
    let place = Place::open(&arguments.out, &arguments.input)?;
    let version = env!("CARGO_PKG_VERSION");
    let grouped =
        terminal::with_progress(|progress| group(cases, &place, ranking.as_ref(), version, progress))?;
    let Grouped { tables, missing, failed, notes } = grouped;
    notes.iter().for_each(|note| terminal::warning("cohort", note));
    if missing + failed > 0 {
        let text =
            format!("{missing} cases have no results, {failed} a step that failed: tables/failures.csv");
        terminal::warning("cohort", &text);
    }
    let tables: Vec<String> = tables.iter().map(|(name, rows)| format!("{name} {rows}")).collect();
    terminal::print(&format!("{}: {} rows", place.tables().display(), tables.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Task};
    use clap::Parser;

    fn parsed(options: &[&str]) -> CohortArguments {
        let words = ["glioscope", "cohort", "in", "out", "participant"].iter().chain(options);
        match Cli::try_parse_from(words).unwrap().task {
            Some(Task::Cohort(arguments)) => *arguments,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn memory_bounds_the_processes_and_measure_is_always_computed() {
        let processes = |options: &[&str]| parsed(options).resources().unwrap().processes;
        assert_eq!(processes(&["--n-procs", "8", "--mem-mb", "3000"]), 2);
        assert_eq!(processes(&["--n-procs", "8", "--mem-mb", "100"]), 1);
        assert_eq!(processes(&["--n-procs", "8"]), 8);
        let options = parsed(&["--compute", "change,lesions", "--register"]).options();
        assert_eq!(options.compute, [Step::Measure, Step::Lesions, Step::Change]);
        assert_eq!(options.case_arguments, ["--register=rigid"]);
    }

    #[test]
    fn durations_have_two_units() {
        let of = |seconds| duration(Duration::from_secs(seconds));
        assert_eq!(
            [of(59), of(61), of(3661), of(360_000)],
            ["59 s", "1 min 1 s", "1 h 1 min", "100 h 0 min"]
        );
    }
}
