//! Output to stdout and stderr, progress bar and Ctrl+C.

use std::{
    io::{IsTerminal, Write},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use glioscope_core::{Check, Progress, Severity, case::CaseSpec};

use crate::error::AppError;

/// Delay before the progress bar is shown.
const PROGRESS_BAR_DELAY: Duration = Duration::from_millis(500);

/// Prints text and a newline to stdout.
///
/// # Errors
/// [`AppError::Wrong`] where stdout can't be written; a closed pipe is not an error.
pub fn print(text: &str) -> Result<(), AppError> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(AppError::wrong("stdout", e.to_string(), "a place that can be written"))
        }
        _ => Ok(()),
    }
}

/// Prints a value to stdout as indented JSON.
///
/// # Errors
/// As [`print`]; also where the value can't be written as JSON.
pub fn print_json(value: &impl serde::Serialize) -> Result<(), AppError> {
    let text = serde_json::to_string_pretty(value).map_err(|e| {
        AppError::wrong("the answer", format!("numbers that JSON can't hold ({e})"), "finite ones")
    })?;
    print(&text)
}

/// Prints an error to stderr as one line.
pub fn error(line: &str) {
    let line = line.replace('\n', " ");
    // A closed stderr can't be reported anywhere.
    let _ = writeln!(std::io::stderr(), "glioscope: {line}");
}

/// Prints checks of at least warning severity to stderr, as stdout is for results only.
pub fn notes(checks: &[Check]) {
    for check in checks.iter().filter(|c| c.severity >= Severity::Warning) {
        let _ = writeln!(std::io::stderr(), "glioscope: warning [{}]: {}", check.code, check.message);
    }
}

/// Prints a warning about the result to stderr.
pub fn warning(code: &str, sentence: &str) {
    let _ = writeln!(std::io::stderr(), "glioscope: warning [{code}]: {sentence}");
}

/// Prints to stderr how the roles of files were guessed from their names, if they were.
pub fn guess(spec: &CaseSpec) {
    for note in &spec.notes {
        let _ = writeln!(std::io::stderr(), "glioscope: guess [{}]: {}", note.code, note.message);
    }
}

/// Prints an assumed default to stderr.
pub fn assumed(sentence: &str) {
    let _ = writeln!(std::io::stderr(), "glioscope: note [assumed]: {sentence}");
}

/// Runs a job on the calling thread. Ctrl+C cancels it; on a terminal, a progress bar is shown after
/// `PROGRESS_BAR_DELAY`.
///
/// # Errors
/// The job's error.
pub fn with_progress<T: Send, E: Send>(job: impl FnOnce(&Progress) -> Result<T, E> + Send) -> Result<T, E> {
    let progress = Progress::new();
    let cancel = progress.clone();
    // A second call in one process keeps the first handler, which then cancels only the finished job.
    let _ = ctrlc::set_handler(move || cancel.cancel());
    if !std::io::stderr().is_terminal() {
        return job(&progress);
    }
    let done = Arc::new(AtomicBool::new(false));
    thread::scope(|scope| {
        let (job_progress, job_done) = (progress.clone(), done.clone());
        // Without a thread there is no bar.
        let _ = thread::Builder::new().spawn_scoped(scope, move || show_progress(&job_progress, &job_done));
        let result = job(&progress);
        done.store(true, Ordering::Relaxed);
        result
    })
}

fn show_progress(progress: &Progress, done: &AtomicBool) {
    let started = Instant::now();
    let mut bar = None;
    while !done.load(Ordering::Relaxed) {
        thread::sleep(Duration::from_millis(50));
        if started.elapsed() > PROGRESS_BAR_DELAY {
            let bar = bar.get_or_insert_with(|| indicatif::ProgressBar::new(1000));
            bar.set_message(progress.label());
            if let Some(fraction) = progress.fraction() {
                bar.set_position((fraction * 1000.0) as u64);
            }
        }
    }
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
}
