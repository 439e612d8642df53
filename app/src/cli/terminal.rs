//! Output to stdout and stderr, progress bar and Ctrl+C.

use std::{
    fmt::Write as _,
    io::{IsTerminal, Write},
    sync::{
        Arc, Mutex, Once, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use glioscope_core::{
    Check, Progress, Severity,
    case::CaseSpec,
    files::{archive::remove_unpacked, is_misleading, printable},
};

use crate::error::AppError;

/// Delay before the progress bar is shown.
const PROGRESS_BAR_DELAY: Duration = Duration::from_millis(500);

/// Prints text and a newline to stdout, without characters that a terminal would obey: names may hold escape sequences.
///
/// # Errors
/// [`AppError::Wrong`] where stdout can't be written; a closed pipe is not an error.
pub fn print(text: &str) -> Result<(), AppError> {
    write_stdout(&printable_lines(text))
}

fn write_stdout(text: &str) -> Result<(), AppError> {
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
    print_json_text(&text)
}

/// Prints indented JSON to stdout.
///
/// # Errors
/// As [`print`].
pub fn print_json_text(json: &str) -> Result<(), AppError> {
    write_stdout(&escaped_json(json))
}

/// JSON leaves misleading characters from U+007F on in its strings; here they are escaped.
fn escaped_json(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        if is_misleading(c) && c != '\n' {
            // All are below U+10000. Writing into a string can't fail.
            let _ = write!(out, "\\u{:04x}", u32::from(c));
        } else {
            out.push(c);
        }
    }
    out
}

/// `text` with every line printable.
fn printable_lines(text: &str) -> String {
    text.split('\n').map(printable).collect::<Vec<_>>().join("\n")
}

/// Prints a line about the work to stderr. A closed stderr can't be reported anywhere.
fn line(text: &str) {
    let text = if glioscope_cohort::is_of_cohort() { without_names(text) } else { text.to_owned() };
    let _ = writeln!(std::io::stderr(), "glioscope: {}", printable(&text));
}

/// A sentence without the names of patients that core's errors list: what the processes of a cohort say is kept in its results.
fn without_names(text: &str) -> String {
    let end = text.rfind(", expected").unwrap_or(text.len());
    let marks = [" patients (", " patients: "];
    let names = marks.into_iter().filter_map(|mark| text[..end].find(mark)).min();
    names.map_or_else(|| text.to_owned(), |at| format!("{} patients{}", &text[..at], &text[end..]))
}

/// Prints an error to stderr as one line.
pub fn error(line: &str) {
    self::line(&line.replace('\n', " "));
}

/// Prints checks of at least warning severity to stderr, as stdout is for results only.
pub fn notes(checks: &[Check]) {
    for check in checks.iter().filter(|c| c.severity >= Severity::Warning) {
        warning(check.code, &check.message);
    }
}

/// Prints a warning about the result to stderr.
pub fn warning(code: &str, sentence: &str) {
    line(&format!("warning [{code}]: {sentence}"));
}

/// Prints to stderr how the roles of files were guessed from their names, if they were. Warnings are left to [`notes`].
pub fn guess(spec: &CaseSpec) {
    for note in spec.notes.iter().filter(|note| note.severity < Severity::Warning) {
        line(&format!("guess [{}]: {}", note.code, note.message));
    }
}

/// Prints what a long job has finished to stderr.
pub fn step(sentence: &str) {
    line(sentence);
}

/// Prints an assumed default to stderr.
pub fn assumed(sentence: &str) {
    line(&format!("note [assumed]: {sentence}"));
}

/// Runs a job on the calling thread. Ctrl+C cancels it; on a terminal, a progress bar is shown after
/// `PROGRESS_BAR_DELAY`.
///
/// # Errors
/// The job's error.
pub fn with_progress<T: Send, E: Send>(job: impl FnOnce(&Progress) -> Result<T, E> + Send) -> Result<T, E> {
    let progress = Progress::new();
    let _current = Current::new(&progress);
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

/// The job that a signal cancels.
static CURRENT: Mutex<Option<Progress>> = Mutex::new(None);

/// Makes a job the one that is cancelled, as long as it lives.
struct Current;

impl Current {
    fn new(progress: &Progress) -> Self {
        static HANDLER: Once = Once::new();
        // Once for the process: interrupt, terminate and hang-up.
        HANDLER.call_once(|| {
            let _ = ctrlc::set_handler(|| {
                let current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner).clone();
                match current {
                    Some(job) if job.check().is_ok() => job.cancel(),
                    // Between jobs, or once more while one is being cancelled.
                    _ => {
                        remove_unpacked();
                        std::process::exit(130);
                    }
                }
            });
        });
        *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) = Some(progress.clone());
        Self
    }
}

impl Drop for Current {
    fn drop(&mut self) {
        *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

fn show_progress(progress: &Progress, done: &AtomicBool) {
    let started = Instant::now();
    let mut bar = None;
    while !done.load(Ordering::Relaxed) {
        thread::sleep(Duration::from_millis(50));
        if started.elapsed() > PROGRESS_BAR_DELAY {
            let bar = bar.get_or_insert_with(|| indicatif::ProgressBar::new(1000));
            bar.set_message(printable(&progress.label()));
            if let Some(fraction) = progress.fraction() {
                bar.set_position((fraction * 1000.0) as u64);
            }
        }
    }
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_patients_are_left_out_of_sentences() {
        let text = "x: found files of 2 patients (Doe (A), 1, Roe, 2), expected the folder of one patient";
        assert_eq!(without_names(text), "x: found files of 2 patients, expected the folder of one patient");
        let text = "x: found files of two patients: m (Doe, 1) and n (Roe, 2), expected files of one";
        assert_eq!(without_names(text), "x: found files of two patients, expected files of one");
        assert_eq!(without_names("files of 2 patients (Doe, Roe)"), "files of 2 patients");
        assert_eq!(without_names("x: found y, expected z"), "x: found y, expected z");
    }

    #[test]
    fn no_control_character_reaches_the_terminal() {
        let name = "\u{1b}]0;\u{7}\u{9b}31m\u{202e}\u{7f}";
        let json = escaped_json(&serde_json::to_string_pretty(&[name]).unwrap());
        assert!(json.is_ascii() && !json.chars().any(|c| is_misleading(c) && c != '\n'), "{json}");
        assert_eq!(serde_json::from_str::<[String; 1]>(&json).unwrap(), [name]);
        assert_eq!(printable_lines("a\u{1b}[31m\tb\n\u{9b}c\r"), "a\\u{1b}[31m\\tb\n\\u{9b}c\\r");
    }
}
