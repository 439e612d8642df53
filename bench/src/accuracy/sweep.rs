//! Measures the settings of a knob in interleaved rounds.

use std::time::{Duration, Instant};

use super::{Bench, Point};
use crate::{
    Outcome,
    clock::{Timing, peak_bytes, reset_peak, timed},
};

/// How settings are measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep<'a> {
    /// Name for the progress report.
    pub label: &'a str,
    /// Rounds over all settings: the largest number of runs of each. Interleaving spreads temporary load over all
    /// settings instead of the one that happens to run.
    pub rounds: usize,
    /// A setting that has used this much time isn't run again.
    pub time_budget: Duration,
    /// Whether the kernel runs on the graphics device; on a hardware GPU its processor time then isn't reported.
    pub on_device: bool,
}

/// Runs of one setting so far.
#[derive(Default)]
struct Runs {
    /// Wall and processor time of each run, milliseconds.
    times: Vec<(f64, Option<f64>)>,
    total: Duration,
    peak_bytes: Option<u64>,
}

impl Runs {
    /// One round: a warm-up run, which does all work needed once or after a change of setting, then a measured run. If
    /// the very first run uses up the time budget, it is the measurement.
    fn round(&mut self, sweep: &Sweep<'_>, mut job: impl FnMut() -> Outcome<()>) -> Outcome<()> {
        let begin = Instant::now();
        let mut run = |times: u32| {
            let (wall, cpu, done) = timed(|| (0..times).try_for_each(|_| job()));
            done?;
            let share = 1.0 / f64::from(times);
            Outcome::Ok((wall * share, cpu.map(|ms| ms * share)))
        };
        let is_first = self.times.is_empty();
        if is_first {
            reset_peak();
        }
        let first = run(1)?;
        if is_first {
            self.peak_bytes = peak_bytes();
        }
        if is_first && begin.elapsed() >= sweep.time_budget {
            self.times.push(first);
        } else {
            // Short jobs are repeated and averaged: the processor clock has no microsecond resolution.
            let repetitions = (40.0 / first.0.max(1e-3)).ceil().clamp(1.0, 1000.0) as u32;
            self.times.push(run(repetitions)?);
        }
        self.total += begin.elapsed();
        Ok(())
    }

    /// Writes medians and quartiles into the setting's point.
    fn summarize(&self, sweep: &Sweep<'_>, is_software: bool, point: &mut Point) {
        let walls: Vec<f64> = self.times.iter().map(|r| r.0).collect();
        let cpus: Vec<f64> = self.times.iter().filter_map(|r| r.1).collect();
        point.time = Timing::of(&walls);
        point.cpu = Timing::of(&cpus).filter(|_| is_software || !sweep.on_device);
        point.peak_bytes = self.peak_bytes;
    }
}

impl Bench<'_> {
    /// Measures named settings in interleaved rounds. `run` is the measured job; `evaluate` computes a setting's errors
    /// once, right after its first run. Both work on `state`.
    pub fn sweep<S, T>(
        &self,
        sweep: &Sweep<'_>,
        state: &mut S,
        settings: &[(String, T)],
        mut run: impl FnMut(&mut S, &T) -> Outcome<()>,
        mut evaluate: impl FnMut(&mut S, &T) -> Outcome<Point>,
    ) -> Outcome<Vec<Point>> {
        let mut all: Vec<Runs> = settings.iter().map(|_| Runs::default()).collect();
        let mut points = Vec::new();
        for round in 0..sweep.rounds {
            for (runs, (name, setting)) in all.iter_mut().zip(settings) {
                if round == 0 {
                    self.begin(sweep.label, name);
                } else if runs.total >= sweep.time_budget {
                    continue;
                }
                runs.round(sweep, || run(state, setting))?;
                if round == 0 {
                    points.push(Point { setting: name.clone(), ..evaluate(state, setting)? });
                }
            }
        }
        for (runs, point) in all.iter().zip(&mut points) {
            runs.summarize(sweep, self.gpu.is_software(), point);
        }
        Ok(points)
    }
}
