//! Computing the cases of a cohort, several at a time, each in processes of its own.

use std::{
    collections::VecDeque,
    fs::{File, OpenOptions},
    io::Write as _,
    path::{Path, PathBuf},
    process::Command,
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use glioscope_core::{
    Progress,
    files::{read_small, write_whole},
};

use crate::{
    CaseStatus, CohortCase, CohortError, Options, Place, State, Step, StepStatus,
    hashes::{HashedFile, SessionFiles, of_case, of_results},
    place::Lock,
    process::{Ended, watched},
    status,
    steps::{self, StepCommand},
};

/// Name of the log beside a case's results.
const LOG: &str = "log.txt";
/// Temporary files of a process, beside the results that it makes.
const TEMPORARY: &str = ".temporary";
/// Maximum size of the first step's answer in bytes.
const MAX_ANSWER_BYTES: u64 = 1 << 30;
/// How often a case that another run computes is looked for.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// What a run may use.
#[derive(Clone, Debug)]
pub struct Resources {
    /// The program whose subcommands are the steps.
    pub program: PathBuf,
    /// Its version, as in the results.
    pub version: String,
    /// Cases that are computed at a time, at least 1.
    pub processes: usize,
    /// Threads of each process, at least 1.
    pub threads: usize,
    /// Memory of all processes together, MiB; `None`: no limit.
    pub memory_mb: Option<u64>,
    /// Where cases are made before they are copied to the results; `None`: beside them.
    pub work: Option<PathBuf>,
}

/// What became of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It was computed.
    Done,
    /// Its results were there, from the same inputs, options and version.
    Skipped,
    /// A step failed, or the case can't be read; why, in one line.
    Failed(String),
}

/// A case that is finished.
#[derive(Debug)]
pub struct Said<'a> {
    /// Its label.
    pub case: &'a str,
    /// What became of it.
    pub outcome: &'a Outcome,
    /// How long it took.
    pub seconds: f64,
    /// Cases that are finished, this one too.
    pub finished: usize,
    /// All cases.
    pub of: usize,
}

/// What became of all cases, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Label and outcome of each.
    pub cases: Vec<(String, Outcome)>,
}

impl Summary {
    /// Labels of the cases that failed.
    pub fn failed(&self) -> Vec<&str> {
        let failed = self.cases.iter().filter(|(_, outcome)| matches!(outcome, Outcome::Failed(_)));
        failed.map(|(label, _)| label.as_str()).collect()
    }

    /// How many have this outcome.
    pub fn count(&self, outcome: &Outcome) -> usize {
        self.cases.iter().filter(|(_, found)| found == outcome).count()
    }
}

/// Why a case without masks fails: nothing was compared, and whoever reads the tables should know.
const NO_MASK: &str = "found no mask, expected one at least (--derivatives NAME takes those in derivatives/NAME of a BIDS data set)";

/// What all cases of a run have in common.
struct Run<'a> {
    data_set: PathBuf,
    place: &'a Place,
    options: &'a Options,
    resources: &'a Resources,
    session_files: SessionFiles<'a>,
    progress: &'a Progress,
}

/// How one try ended.
enum Tried {
    Finished(Outcome),
    /// Another run is computing it.
    Busy,
    /// It needs more than its share of the memory.
    TooLarge(String),
}

/// Computes the `cases` of `data_set` that have no current results in `place`. A case that needs more than its share of the memory is
/// tried once more with all of it, alone. `said` is called as cases finish, from several threads.
///
/// # Errors
/// [`CohortError`] where results can't be written, and where the user cancels: cases that were finished stay, others leave nothing.
pub fn run(
    (cases, data_set): (&[CohortCase], &Path),
    place: &Place,
    options: &Options,
    resources: &Resources,
    session_files: SessionFiles<'_>,
    (progress, said): (&Progress, &(dyn Fn(&Said<'_>) + Sync)),
) -> Result<Summary, CohortError> {
    let folder = if data_set.is_dir() { data_set } else { data_set.parent().unwrap_or(data_set) };
    let data_set = glioscope_core::files::absolute(folder);
    place.describe(&resources.version)?;
    let run = Run { data_set, place, options, resources, session_files, progress };
    progress.expect(cases.len() as u64);
    let outcomes: Vec<Mutex<Option<Outcome>>> = cases.iter().map(|_| Mutex::new(None)).collect();
    let finished = Mutex::new(0);
    let finish = |n: usize, outcome: Outcome, seconds: f64| -> Result<(), CohortError> {
        let case = &cases[n].label;
        {
            // Held while it is said, so that cases are counted in the order in which they are said.
            let mut finished = locked(&finished);
            *finished += 1;
            said(&Said { case, outcome: &outcome, seconds, finished: *finished, of: cases.len() });
        }
        *locked(&outcomes[n]) = Some(outcome);
        Ok(progress.advance(1)?)
    };
    let processes = resources.processes.max(1);
    let share = resources.memory_mb.map(|all| all / processes as u64);
    let queue: Mutex<VecDeque<usize>> = Mutex::new((0..cases.len()).collect());
    let large = Mutex::new(Vec::new());
    let error: Mutex<Option<CohortError>> = Mutex::new(None);
    let work = || -> Result<(), CohortError> {
        loop {
            progress.check()?;
            let next = locked(&queue).pop_front();
            let Some(n) = next.filter(|_| locked(&error).is_none()) else { return Ok(()) };
            let started = std::time::Instant::now();
            match run.case(&cases[n], share)? {
                Tried::Finished(outcome) => finish(n, outcome, started.elapsed().as_secs_f64())?,
                Tried::TooLarge(_) if processes > 1 => locked(&large).push(n),
                Tried::TooLarge(why) => finish(n, Outcome::Failed(why), started.elapsed().as_secs_f64())?,
                Tried::Busy => {
                    // Whatever else there is comes first.
                    locked(&queue).push_back(n);
                    std::thread::sleep(LOOK_EVERY);
                }
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..processes.min(cases.len()) {
            let worker = || {
                if let Err(e) = work() {
                    locked(&error).get_or_insert(e);
                }
            };
            // Fewer threads compute the same.
            if std::thread::Builder::new().name("case".into()).spawn_scoped(scope, worker).is_err() {
                worker();
            }
        }
    });
    if let Some(error) = locked(&error).take() {
        return Err(error);
    }
    for n in std::mem::take(&mut *locked(&large)) {
        let started = std::time::Instant::now();
        let outcome = loop {
            match run.case(&cases[n], resources.memory_mb)? {
                Tried::Finished(outcome) => break outcome,
                Tried::TooLarge(why) => break Outcome::Failed(why),
                Tried::Busy => std::thread::sleep(LOOK_EVERY),
            }
        };
        finish(n, outcome, started.elapsed().as_secs_f64())?;
    }
    let outcomes =
        outcomes.into_iter().map(|outcome| outcome.into_inner().unwrap_or_else(PoisonError::into_inner));
    let labels = cases.iter().map(|case| case.label.clone());
    Ok(Summary {
        cases: labels.zip(outcomes).filter_map(|(label, outcome)| Some((label, outcome?))).collect(),
    })
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Run<'_> {
    fn case(&self, case: &CohortCase, memory_mb: Option<u64>) -> Result<Tried, CohortError> {
        let Some(lock) = self.place.lock_case(&case.label)? else { return Ok(Tried::Busy) };
        let hashed =
            of_case(case, (&self.data_set, &self.options.derivatives), self.session_files, self.progress);
        let (inputs, unreadable) = match hashed {
            Ok(inputs) => (inputs, None),
            Err(CohortError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) => (Vec::new(), Some(error.to_string())),
        };
        let version = &self.resources.version;
        let earlier = CaseStatus::read(lock.target());
        if earlier.is_some_and(|earlier| earlier.is_current(lock.target(), version, self.options, &inputs)) {
            return Ok(Tried::Finished(Outcome::Skipped));
        }
        self.compute(case, &lock, (inputs, unreadable), memory_mb)
    }

    /// Computes a case and puts its results in place.
    fn compute(
        &self,
        case: &CohortCase,
        lock: &Lock,
        (inputs, unreadable): (Vec<HashedFile>, Option<String>),
        memory_mb: Option<u64>,
    ) -> Result<Tried, CohortError> {
        let part = lock.part(self.resources.work.as_deref())?;
        let mut steps = Vec::new();
        if let Some(error) = unreadable {
            logged(part.folder(), &error)?;
            steps.push(not_run(Step::Measure, State::Failed, Some(error)));
        } else {
            let mut is_too_large = false;
            let mut step = |command: &StepCommand| -> Result<State, CohortError> {
                let ended = self.step(command, part.folder(), memory_mb)?;
                is_too_large |= ended.is_too_large;
                let state = if ended.error.is_none() { State::Done } else { State::Failed };
                steps.push(StepStatus {
                    step: command.step,
                    output: (state == State::Done).then(|| command.output.clone()),
                    state,
                    seconds: ended.seconds,
                    peak_mb: ended.peak_mb,
                    exit_code: ended.exit_code,
                    error: ended.error,
                });
                Ok(state)
            };
            if step(&steps::first(case, self.options))? == State::Done {
                let found = found(&part.folder().join(steps::MEASURE))?;
                if found.lacks_masks {
                    logged(part.folder(), NO_MASK)?;
                    if let Some(measured) = steps.last_mut() {
                        (measured.state, measured.error) = (State::Failed, Some(NO_MASK.to_owned()));
                    }
                } else {
                    for command in steps::others(case, self.options, &found.dates) {
                        step(&command)?;
                    }
                    if self.options.compute.contains(&Step::Change) && found.dates.len() < 2 {
                        steps.push(not_run(Step::Change, State::NotApplicable, None));
                    }
                }
            }
            let why = steps.iter().find_map(|step| step.error.clone()).unwrap_or_default();
            // Not put in place while it may be tried with more memory.
            if is_too_large && memory_mb < self.resources.memory_mb {
                return Ok(Tried::TooLarge(why));
            }
        }
        let mut results = of_results(part.folder(), self.progress)?;
        results.retain(|file| file.path != LOG);
        let state =
            if steps.iter().any(|step| step.state == State::Failed) { State::Failed } else { State::Done };
        let status = CaseStatus {
            glioscope: self.resources.version.clone(),
            case: case.label.clone(),
            path: case.path.to_string_lossy().into_owned(),
            state,
            options: self.options.clone(),
            inputs,
            steps,
            results,
        };
        let path = part.folder().join(status::NAME);
        let mut bytes = serde_json::to_vec_pretty(&status).map_err(|e| {
            CohortError::at(&path, format!("numbers that JSON can't hold ({e})"), "finite ones")
        })?;
        bytes.push(b'\n');
        write_whole(&path, &bytes)?;
        self.progress.check()?;
        part.put()?;
        let failure = status
            .failure()
            .map(|step| format!("{}: {}", step.step, step.error.as_deref().unwrap_or("failed")));
        Ok(Tried::Finished(failure.map_or(Outcome::Done, Outcome::Failed)))
    }

    /// Runs one step in the folder of results that are being made.
    fn step(&self, step: &StepCommand, folder: &Path, memory_mb: Option<u64>) -> Result<Ended, CohortError> {
        let words: Vec<String> =
            step.arguments.iter().map(|word| word.to_string_lossy().into_owned()).collect();
        let log = logged(folder, &format!("$ glioscope {}", words.join(" ")))?;
        let output = folder.join(&step.output);
        let answer = match step.answers {
            true => {
                let file = OpenOptions::new().create_new(true).write(true).open(&output);
                Some(file.map_err(|e| writable(&output, &e))?)
            }
            false => None,
        };
        // What a process unpacks and is ended before it removes goes with the folder.
        let temporary = folder.join(TEMPORARY);
        std::fs::create_dir_all(&temporary).map_err(|e| writable(&temporary, &e))?;
        let mut command = Command::new(&self.resources.program);
        command.args(&step.arguments).current_dir(folder).env("TMPDIR", &temporary);
        command.env("RAYON_NUM_THREADS", self.resources.threads.max(1).to_string());
        let ended = watched(&mut command, answer, &log, memory_mb, self.progress)?;
        std::fs::remove_dir_all(&temporary).map_err(|e| writable(&temporary, &e))?;
        if ended.error.is_some() {
            // Half an answer is none.
            let removed = if output.is_dir() {
                std::fs::remove_dir_all(&output)
            } else {
                std::fs::remove_file(&output)
            };
            removed.or_else(|e| if output.exists() { Err(writable(&output, &e)) } else { Ok(()) })?;
        }
        Ok(ended)
    }
}

fn writable(path: &Path, e: &std::io::Error) -> CohortError {
    CohortError::io(path, e, "a place that can be written")
}

/// The log of a case, with this line more.
fn logged(folder: &Path, line: &str) -> Result<File, CohortError> {
    let path = folder.join(LOG);
    let log = OpenOptions::new().create(true).append(true).read(true).open(&path);
    let mut log = log.map_err(|e| writable(&path, &e))?;
    writeln!(log, "{line}").map_err(|e| writable(&path, &e))?;
    Ok(log)
}

/// A step that no process was started for.
fn not_run(step: Step, state: State, error: Option<String>) -> StepStatus {
    StepStatus { step, output: None, state, seconds: 0.0, peak_mb: None, exit_code: None, error }
}

/// What the first answer tells of a case.
struct Found {
    dates: Vec<String>,
    /// At no date is there a mask.
    lacks_masks: bool,
}

fn found(answer: &Path) -> Result<Found, CohortError> {
    let bytes = read_small(answer, MAX_ANSWER_BYTES, "an answer of measure")?;
    let value: serde_json::Value = serde_json::from_slice(&bytes)
        .map_err(|e| CohortError::at(answer, format!("no JSON ({e})"), "an answer of measure"))?;
    let times = value["time_points"].as_array().map_or(&[][..], Vec::as_slice);
    Ok(Found {
        dates: times.iter().filter_map(|time| time["time"].as_str().map(str::to_owned)).collect(),
        lacks_masks: !times.is_empty()
            && times.iter().all(|time| time["masks"].as_array().is_some_and(Vec::is_empty)),
    })
}
