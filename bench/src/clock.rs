//! Wall time, processor time and memory, and summary statistics of several runs.

use std::{io::Write, time::Instant};

use serde::Serialize;

/// Quartiles of several runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Timing {
    /// Median.
    pub median_ms: f64,
    /// First quartile.
    pub q1_ms: f64,
    /// Third quartile.
    pub q3_ms: f64,
    /// Number of runs, at least 1.
    pub runs: usize,
}

impl Timing {
    /// Quartiles of run times in milliseconds; `None` without runs.
    pub fn of(ms: &[f64]) -> Option<Self> {
        let [q1_ms, median_ms, q3_ms] = quartiles(ms)?;
        Some(Self { median_ms, q1_ms, q3_ms, runs: ms.len() })
    }
}

/// First quartile, median and third quartile, linearly interpolated; `None` for an empty slice.
pub fn quartiles(values: &[f64]) -> Option<[f64; 3]> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let quantile = |p: f64| {
        let x = p * sorted.len().checked_sub(1)? as f64;
        let (low, high) = (sorted.get(x.floor() as usize)?, sorted.get(x.ceil() as usize)?);
        Some(low + (high - low) * x.fract())
    };
    Some([quantile(0.25)?, quantile(0.5)?, quantile(0.75)?])
}

/// The median; NaN for an empty slice.
pub fn median(values: &[f64]) -> f64 {
    quartiles(values).map_or(f64::NAN, |q| q[1])
}

/// The minimum; NaN for an empty slice.
pub fn minimum(values: &[f64]) -> f64 {
    values.iter().copied().reduce(f64::min).unwrap_or(f64::NAN)
}

/// The quantile `p`, 0 to 1, of values in ascending order, not interpolated; NaN for an empty slice.
pub fn quantile(sorted: &[f64], p: f64) -> f64 {
    sorted.get((p * sorted.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(f64::NAN)
}

/// Processor time in milliseconds that the process's live threads have used; `None` on systems other than Linux.
pub fn cpu_ms() -> Option<f64> {
    cpu_ms_of("self")
}

/// The same of the process with this number, or of `self`.
pub fn cpu_ms_of(process: &str) -> Option<f64> {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).ok()?;
    let thread_ns = |task: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let line = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        line.split_whitespace().next()?.parse().ok()
    };
    // A thread that ends during the scan is skipped: it was idle.
    Some(tasks.filter_map(thread_ns).sum::<f64>() * 1e-6)
}

/// Milliseconds since `start`: where [`timed`]'s look at the processor time would count.
pub fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Runs a job once: wall time and processor time in milliseconds, and its result.
pub fn timed<T>(job: impl FnOnce() -> T) -> (f64, Option<f64>, T) {
    let (cpu, start) = (cpu_ms(), Instant::now());
    let result = job();
    let wall = ms_since(start);
    (wall, cpu.and_then(|before| Some(cpu_ms()? - before)), result)
}

/// Runs a job `runs` times, at least once: wall time of each run in milliseconds, and the last result.
pub fn repeated<T, E>(runs: usize, mut job: impl FnMut() -> Result<T, E>) -> Result<(Vec<f64>, T), E> {
    let (first, _, mut last) = timed(&mut job);
    let mut times = vec![first];
    for _ in 1..runs {
        let (ms, _, result) = timed(&mut job);
        times.push(ms);
        last = result;
    }
    Ok((times, last?))
}

/// Resets the peak of resident memory to its current value; does nothing on systems without /proc/self/clear_refs.
pub fn reset_peak() {
    if let Ok(mut file) = std::fs::OpenOptions::new().write(true).open("/proc/self/clear_refs") {
        // On failure the peak is that of a longer period.
        let _ = file.write_all(b"5");
    }
}

/// Peak resident memory in bytes since the last reset (VmHWM of /proc/self/status); `None` on other systems.
pub fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

/// The system's load average of the last minute, in processes; `None` on systems other than Linux.
pub fn load_average() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// Number of cores, processor and operating system, as far as the system reports them.
pub fn machine() -> String {
    let value = |file: &str, key: &str| -> Option<String> {
        let text = std::fs::read_to_string(file).ok()?;
        let line = text.lines().find(|l| l.starts_with(key))?;
        let (_, value) = line.split_once([':', '='])?;
        Some(value.trim().trim_matches('"').to_owned())
    };
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let processor = value("/proc/cpuinfo", "model name").unwrap_or_else(|| "processor unknown".to_owned());
    let system = value("/etc/os-release", "PRETTY_NAME").unwrap_or_else(|| std::env::consts::OS.to_owned());
    format!("{cores} cores of {processor}, {system}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_are_interpolated() {
        assert_eq!(quartiles(&[]), None);
        assert_eq!(quartiles(&[7.0]), Some([7.0; 3]));
        assert_eq!(quartiles(&[5.0, 1.0, 3.0]), Some([2.0, 3.0, 4.0]));
        assert_eq!(quartiles(&[4.0, 1.0, 2.0, 3.0]), Some([1.75, 2.5, 3.25]));
        assert_eq!((median(&[3.0, 1.0]), minimum(&[3.0, 1.0])), (2.0, 1.0));
        assert!(median(&[]).is_nan() && minimum(&[]).is_nan());
    }

    #[test]
    fn repeated_measures_every_run() {
        let sleep = || {
            std::thread::sleep(std::time::Duration::from_millis(20));
            Ok::<u8, ()>(3)
        };
        let (times, result) = repeated(3, sleep).unwrap();
        assert!(times.len() == 3 && minimum(&times) >= 20.0 && result == 3, "{times:?}");
    }
}
