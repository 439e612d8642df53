//! A knob's settings measured beside each other.

use std::time::{Duration, Instant};

use super::{
    AccuracyError, Bench, Point, Timing,
    measure::{cpu_ms, peak_bytes, quartiles, reset_peak},
};

/// How settings are measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep<'a> {
    /// What the user is told that runs.
    pub what: &'a str,
    /// Rounds over the settings, and so the most runs of each: what slows the machine for a while then slows all of
    /// them, and not the one that happens to run.
    pub rounds: usize,
    /// After so long, a setting takes no further part.
    pub patience: Duration,
    /// Whether the device works: on a graphics card, that is no time of the processor.
    pub on_device: bool,
}

/// Runs of one setting so far.
#[derive(Default)]
struct Runs {
    /// Milliseconds, and those of the processor, of each.
    times: Vec<(f64, Option<f64>)>,
    spent: Duration,
    peak_bytes: Option<u64>,
}

impl Runs {
    /// A round: once unmeasured (what is made once, or anew after another setting, is made then), then once measured.
    /// Where the first run of all has used up all patience, it is the measurement.
    fn round(
        &mut self,
        sweep: &Sweep<'_>,
        mut job: impl FnMut() -> Result<(), AccuracyError>,
    ) -> Result<(), AccuracyError> {
        let begin = Instant::now();
        let mut run = |times: u32| {
            let (start, cpu) = (Instant::now(), cpu_ms());
            for _ in 0..times {
                job()?;
            }
            let share = 1.0 / f64::from(times);
            let wall = start.elapsed().as_secs_f64() * 1e3;
            let cpu = cpu.and_then(|before| Some((cpu_ms()? - before) * share));
            Ok::<_, AccuracyError>((wall * share, cpu))
        };
        let is_first = self.times.is_empty();
        if is_first {
            reset_peak();
        }
        let first = run(1)?;
        if is_first {
            self.peak_bytes = peak_bytes();
        }
        if is_first && begin.elapsed() >= sweep.patience {
            self.times.push(first);
        } else {
            // Processor time is told in steps of the scheduler's clock, up to 10 ms: short jobs count together.
            let together = (40.0 / first.0.max(1e-3)).ceil().clamp(1.0, 1000.0) as u32;
            self.times.push(run(together)?);
        }
        self.spent += begin.elapsed();
        Ok(())
    }

    /// Medians and quartiles into the point they are of.
    fn tell(&self, sweep: &Sweep<'_>, is_software: bool, point: &mut Point) {
        let timing = |times: &[f64]| {
            let [q1_ms, median_ms, q3_ms] = quartiles(times)?;
            Some(Timing { median_ms, q1_ms, q3_ms, runs: times.len() })
        };
        let walls: Vec<f64> = self.times.iter().map(|r| r.0).collect();
        let cpus: Vec<f64> = self.times.iter().filter_map(|r| r.1).collect();
        point.time = timing(&walls);
        point.cpu = timing(&cpus).filter(|_| is_software || !sweep.on_device);
        point.peak_bytes = self.peak_bytes;
    }
}

impl Bench<'_> {
    /// Measures named settings in rounds over all of them. `run` does what is measured, `look` says what came
    /// of a setting, once, right after it ran; both work on `state`.
    pub fn sweep<S, T>(
        &self,
        sweep: &Sweep<'_>,
        state: &mut S,
        settings: &[(String, T)],
        mut run: impl FnMut(&mut S, &T) -> Result<(), AccuracyError>,
        mut look: impl FnMut(&mut S, &T) -> Result<Point, AccuracyError>,
    ) -> Result<Vec<Point>, AccuracyError> {
        let mut all: Vec<Runs> = settings.iter().map(|_| Runs::default()).collect();
        let mut points = Vec::new();
        for round in 0..sweep.rounds {
            for (runs, (name, setting)) in all.iter_mut().zip(settings) {
                if round == 0 {
                    self.begin(sweep.what, name)?;
                } else if runs.spent >= sweep.patience {
                    continue;
                } else {
                    self.progress.say(format!("{}: {name}, again", sweep.what));
                    self.progress.check()?;
                }
                runs.round(sweep, || run(state, setting))?;
                if round == 0 {
                    let point = look(state, setting)?;
                    let setting = format!("{name}{}", point.setting);
                    points.push(Point { setting, ..point });
                }
            }
        }
        for (runs, point) in all.iter().zip(&mut points) {
            runs.tell(sweep, self.gpu.is_software(), point);
        }
        Ok(points)
    }
}
