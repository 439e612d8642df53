//! One step as a process: watched for its memory, ended with its helpers when the user cancels, and when this process is killed.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::Path,
    process::{Child, Command, ExitStatus, Stdio},
    time::{Duration, Instant},
};

use glioscope_core::{Cancelled, Progress, files::printable};

/// How often a process is looked after.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// How long a process that was ended by a signal may be the first to know that all are to end.
const CANCEL_DELAY: Duration = Duration::from_millis(500);
/// Last bytes of the log that are read for an error.
const TAIL_BYTES: u64 = 1 << 14;
/// Maximum length of an error in characters.
const MAX_ERROR_CHARS: usize = 500;
/// The variable that tells a child whose end is its own.
const PARENT: &str = "GLIOSCOPE_COHORT_PARENT";

/// How a process ended.
#[derive(Debug)]
pub struct Ended {
    /// How long it took.
    pub seconds: f64,
    /// Most memory it was seen with, MiB; `None` where the system doesn't tell or it was too short.
    pub peak_mb: Option<f64>,
    /// Its exit code; `None` where a signal ended it, or it didn't start.
    pub exit_code: Option<i64>,
    /// Why it failed.
    pub error: Option<String>,
    /// It was ended because it had more memory than it may.
    pub is_too_large: bool,
}

/// Runs `program` in `folder` with its answer in the file `answer` (else nowhere) and what it says in `log`, until it ends. At more than
/// `memory_mb` it is ended, at a cancellation, too.
///
/// # Errors
/// [`Cancelled`]: the process and its helpers are ended.
pub fn watched(
    command: &mut Command,
    answer: Option<File>,
    log: &File,
    memory_mb: Option<u64>,
    progress: &Progress,
) -> Result<Ended, Cancelled> {
    let started = Instant::now();
    let not_started = |e: std::io::Error| Ended {
        seconds: 0.0,
        peak_mb: None,
        exit_code: None,
        error: Some(format!("the process does not start ({e})")),
        is_too_large: false,
    };
    let written = log.metadata().map_or(0, |metadata| metadata.len());
    let said = match log.try_clone() {
        Ok(said) => said,
        Err(e) => return Ok(not_started(e)),
    };
    command.stdin(Stdio::null()).stdout(answer.map_or_else(Stdio::null, Stdio::from)).stderr(said);
    command.env(PARENT, std::process::id().to_string());
    // An interrupt of the terminal goes to this process alone, which ends the others.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(e) => return Ok(not_started(e)),
    };
    let (mut peak_mb, mut is_too_large) = (None::<f64>, false);
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break Ok(status),
            Ok(None) => {}
            Err(e) => {
                end(&mut child);
                break Err(e);
            }
        }
        if let Err(cancelled) = progress.check() {
            end(&mut child);
            return Err(cancelled);
        }
        if let Some([now_mb, most_mb]) = memory_mb_of(child.id()) {
            peak_mb = Some(peak_mb.unwrap_or(0.0).max(most_mb));
            if memory_mb.is_some_and(|limit| now_mb > limit as f64) {
                is_too_large = true;
                end(&mut child);
            }
        }
        std::thread::sleep(LOOK_EVERY);
    };
    let seconds = started.elapsed().as_secs_f64();
    let exit_code = status.as_ref().ok().and_then(|status| status.code()).map(i64::from);
    let error = match status {
        Err(e) => Some(format!("the process can't be waited for ({e})")),
        Ok(status) if status.success() => None,
        Ok(_) if is_too_large => {
            Some(format!("more than {} MB of memory (--mem-mb)", memory_mb.unwrap_or_default()))
        }
        Ok(status) => {
            if exit_code.is_none() {
                // Whoever ends this process and its children may reach the child first.
                let asked = Instant::now();
                while asked.elapsed() < CANCEL_DELAY {
                    progress.check()?;
                    std::thread::sleep(LOOK_EVERY);
                }
            }
            Some(last_error(log, written).unwrap_or_else(|| ended_by(status)))
        }
    };
    Ok(Ended { seconds, peak_mb, exit_code, error, is_too_large })
}

fn ended_by(status: ExitStatus) -> String {
    format!("the process ended without a word ({status})")
}

/// Ends a process with its helpers, and waits for it.
fn end(child: &mut Child) {
    #[cfg(unix)]
    if let Some(group) = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw) {
        let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
    }
    let _ = child.kill();
    let _ = child.wait();
}

/// Resident memory of a process now, and most so far, MiB.
fn memory_mb_of(process: u32) -> Option<[f64; 2]> {
    let text = std::fs::read_to_string(Path::new("/proc").join(process.to_string()).join("status")).ok()?;
    let of = |key: &str| -> Option<f64> {
        let line = text.lines().find_map(|line| line.strip_prefix(key))?;
        let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
        Some(kib / 1024.0)
    };
    Some([of("VmRSS:")?, of("VmHWM:")?])
}

/// The last error that a process of the program wrote to the log after `from`.
fn last_error(log: &File, from: u64) -> Option<String> {
    let mut log = log.try_clone().ok()?;
    let length = log.metadata().ok()?.len();
    log.seek(SeekFrom::Start(from.max(length.saturating_sub(TAIL_BYTES)))).ok()?;
    let mut bytes = Vec::new();
    log.take(TAIL_BYTES).read_to_end(&mut bytes).ok()?;
    let text = String::from_utf8_lossy(&bytes);
    let is_error = |line: &&str| {
        !line.starts_with("warning [") && !line.starts_with("note [") && !line.starts_with("guess [")
    };
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let own = lines.clone().filter_map(|line| line.strip_prefix("glioscope: ")).rfind(is_error);
    let line = own.or_else(|| lines.next_back())?;
    Some(printable(line).chars().take(MAX_ERROR_CHARS).collect())
}

/// Whether a cohort started this process: what it says is kept in the results.
pub fn is_of_cohort() -> bool {
    std::env::var_os(PARENT).is_some()
}

/// For a process that a cohort started: it ends when that one does, whatever ends it. Otherwise nothing.
pub fn end_with_parent() {
    #[cfg(target_os = "linux")]
    if let Some(parent) = std::env::var(PARENT).ok().and_then(|text| text.parse::<u32>().ok()) {
        let _ = rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL));
        // It may be gone already.
        let now = rustix::process::getppid().and_then(|id| u32::try_from(id.as_raw_nonzero().get()).ok());
        if now != Some(parent) {
            std::process::exit(2);
        }
    }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str, memory_mb: Option<u64>, progress: &Progress) -> Result<Ended, Cancelled> {
        let log = tempfile::tempfile().expect("a temporary file");
        watched(Command::new("sh").args(["-c", script]), None, &log, memory_mb, progress)
    }

    #[test]
    fn an_error_is_the_programs_last_line_and_a_signal_is_said() {
        let progress = Progress::new();
        let script =
            "echo 'glioscope: a: found b, expected c' >&2; echo 'glioscope: warning [x]: y' >&2; exit 2";
        let ended = shell(script, None, &progress).unwrap();
        assert_eq!((ended.exit_code, ended.error.as_deref()), (Some(2), Some("a: found b, expected c")));
        let ended = shell("kill -SEGV $$", None, &progress).unwrap();
        assert!(ended.exit_code.is_none() && ended.error.unwrap().contains("signal: 11"));
        assert_eq!(shell("exit 0", None, &progress).unwrap().error, None);
    }

    #[test]
    fn a_cancelled_process_ends_at_once() {
        let progress = Progress::new();
        let cancel = progress.clone();
        let started = Instant::now();
        std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            cancel.cancel();
        });
        assert!(shell("sleep 60 & sleep 60", None, &progress).is_err());
        assert!(started.elapsed() < Duration::from_secs(20));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_process_with_too_much_memory_is_ended() {
        // 64 MB of text in a variable of the shell.
        let script = "x=$(head -c 64000000 /dev/zero | tr '\\0' x); sleep 60";
        let ended = shell(script, Some(20), &Progress::new()).unwrap();
        assert!(ended.is_too_large && ended.error.unwrap().contains("20 MB"), "{:?}", ended.peak_mb);
    }
}
