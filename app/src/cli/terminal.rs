//! stdout, stderr, progress and ctrl-C.

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

/// Longest a job runs before a bar is shown.
const PATIENCE: Duration = Duration::from_millis(500);

/// A line of the answer.
///
/// # Errors
/// When stdout can't be written (a closed pipe is not an error).
pub fn print(text: &str) -> Result<(), AppError> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(AppError::wrong("stdout", e.to_string(), "a place that can be written"))
        }
        _ => Ok(()),
    }
}

/// A value of the answer as JSON.
///
/// # Errors
/// As [`print`].
pub fn print_json(value: &impl serde::Serialize) -> Result<(), AppError> {
    let text = serde_json::to_string_pretty(value).map_err(|e| {
        AppError::wrong("the answer", format!("numbers that JSON can't hold ({e})"), "finite ones")
    })?;
    print(&text)
}

/// The one line of a failure.
pub fn error(line: &str) {
    let line = line.replace('\n', " ");
    // Nothing can be done when stderr is gone.
    let _ = writeln!(std::io::stderr(), "glioscope: {line}");
}

/// Warnings on stderr, so that stdout stays the answer.
pub fn notes(checks: &[Check]) {
    for check in checks.iter().filter(|c| c.severity >= Severity::Warning) {
        let _ = writeln!(std::io::stderr(), "glioscope: warning [{}]: {}", check.code, check.message);
    }
}

/// A warning about the answer, on stderr.
pub fn warning(code: &str, sentence: &str) {
    let _ = writeln!(std::io::stderr(), "glioscope: warning [{code}]: {sentence}");
}

/// How a case was put together from names, on stderr; nothing where nothing was guessed.
pub fn guess(spec: &CaseSpec) {
    for note in &spec.notes {
        let _ = writeln!(std::io::stderr(), "glioscope: guess [{}]: {}", note.code, note.message);
    }
}

/// What was chosen without being asked for, on stderr.
pub fn assumed(sentence: &str) {
    let _ = writeln!(std::io::stderr(), "glioscope: note [assumed]: {sentence}");
}

/// Runs a job; ctrl-C cancels it, and a bar is shown on a terminal when it takes its time.
///
/// # Errors
/// The job's.
pub fn with_progress<T: Send, E: Send>(job: impl FnOnce(&Progress) -> Result<T, E> + Send) -> Result<T, E> {
    let progress = Progress::new();
    let cancel = progress.clone();
    // A second job in one process keeps the first handler: it only cancels a finished job then.
    let _ = ctrlc::set_handler(move || cancel.cancel());
    if !std::io::stderr().is_terminal() {
        return job(&progress);
    }
    let done = Arc::new(AtomicBool::new(false));
    thread::scope(|scope| {
        let (watched, over) = (progress.clone(), done.clone());
        scope.spawn(move || watch(&watched, &over));
        let result = job(&progress);
        done.store(true, Ordering::Relaxed);
        result
    })
}

fn watch(progress: &Progress, over: &AtomicBool) {
    let started = Instant::now();
    let mut bar = None;
    while !over.load(Ordering::Relaxed) {
        thread::sleep(Duration::from_millis(50));
        if started.elapsed() > PATIENCE {
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
