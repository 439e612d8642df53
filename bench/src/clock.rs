//! Wall time, processor time, memory, and what of several runs is told.

use std::{io::Write, time::Instant};

use serde::Serialize;

/// Quartiles of several runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Timing {
    /// Median.
    pub median_ms: f64,
    /// A quarter of the runs took at most this.
    pub q1_ms: f64,
    /// Three quarters did.
    pub q3_ms: f64,
    /// Runs, at least one.
    pub runs: usize,
}

impl Timing {
    /// Of these milliseconds; `None` for none.
    pub fn of(ms: &[f64]) -> Option<Self> {
        let [q1_ms, median_ms, q3_ms] = quartiles(ms)?;
        Some(Self { median_ms, q1_ms, q3_ms, runs: ms.len() })
    }
}

/// First quartile, median and third, between neighbours where they fall between; `None` for none.
pub fn quartiles(values: &[f64]) -> Option<[f64; 3]> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |part: f64| {
        let x = part * sorted.len().checked_sub(1)? as f64;
        let (low, high) = (sorted.get(x.floor() as usize)?, sorted.get(x.ceil() as usize)?);
        Some(low + (high - low) * x.fract())
    };
    Some([at(0.25)?, at(0.5)?, at(0.75)?])
}

/// The median; NaN of none.
pub fn median(values: &[f64]) -> f64 {
    quartiles(values).map_or(f64::NAN, |q| q[1])
}

/// The least; NaN of none.
pub fn least(values: &[f64]) -> f64 {
    values.iter().copied().reduce(f64::min).unwrap_or(f64::NAN)
}

/// The value at the part `p`, 0 to 1, of a sorted list; NaN of none.
pub fn at_part(sorted: &[f64], p: f64) -> f64 {
    sorted.get((p * sorted.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(f64::NAN)
}

/// Milliseconds of processor time that this process's living threads have had; `None` on other systems than Linux.
pub fn cpu_ms() -> Option<f64> {
    let tasks = std::fs::read_dir("/proc/self/task").ok()?;
    let one = |task: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let line = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        line.split_whitespace().next()?.parse().ok()
    };
    // A thread that ends while it is asked is one that had nothing to do.
    Some(tasks.filter_map(one).sum::<f64>() * 1e-6)
}

/// One run of a job: wall and processor milliseconds, and its answer.
pub fn timed<T>(job: impl FnOnce() -> T) -> (f64, Option<f64>, T) {
    let (cpu, start) = (cpu_ms(), Instant::now());
    let answer = job();
    let wall = start.elapsed().as_secs_f64() * 1e3;
    (wall, cpu.and_then(|before| Some(cpu_ms()? - before)), answer)
}

/// Wall milliseconds of `runs` runs, at least one, and the last answer.
pub fn repeated<T, E>(runs: usize, mut job: impl FnMut() -> Result<T, E>) -> Result<(Vec<f64>, T), E> {
    let (first, _, mut last) = timed(&mut job);
    let mut times = vec![first];
    for _ in 1..runs {
        let (ms, _, again) = timed(&mut job);
        times.push(ms);
        last = again;
    }
    Ok((times, last?))
}

/// Sets the peak back to what is resident now; does nothing where the system has no such file.
pub fn reset_peak() {
    if let Ok(mut file) = std::fs::OpenOptions::new().write(true).open("/proc/self/clear_refs") {
        // Not being able to only makes the peak an older one.
        let _ = file.write_all(b"5");
    }
}

/// Most bytes that this process had resident since the peak was last reset: VmHWM of
/// /proc/self/status; `None` on other systems.
pub fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

/// The system's load of the last minute, processes; `None` on other systems than Linux.
pub fn load_average() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// Cores, processor and system, as far as the system says.
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
    fn quartiles_lie_between_neighbours() {
        assert_eq!(quartiles(&[]), None);
        assert_eq!(quartiles(&[7.0]), Some([7.0; 3]));
        assert_eq!(quartiles(&[5.0, 1.0, 3.0]), Some([2.0, 3.0, 4.0]));
        assert_eq!(quartiles(&[4.0, 1.0, 2.0, 3.0]), Some([1.75, 2.5, 3.25]));
        assert_eq!((median(&[3.0, 1.0]), least(&[3.0, 1.0])), (2.0, 1.0));
        assert!(median(&[]).is_nan() && least(&[]).is_nan());
    }

    #[test]
    fn a_job_takes_as_long_as_it_sleeps() {
        let sleep = || {
            std::thread::sleep(std::time::Duration::from_millis(20));
            Ok::<u8, ()>(3)
        };
        let (times, answer) = repeated(3, sleep).unwrap();
        assert!(times.len() == 3 && least(&times) >= 20.0 && answer == 3, "{times:?}");
    }
}
