//! A knob's settings measured beside each other.

use std::time::{Duration, Instant};

use super::{Bench, Point};
use crate::{
    Outcome,
    clock::{Timing, peak_bytes, reset_peak, timed},
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
        if is_first && begin.elapsed() >= sweep.patience {
            self.times.push(first);
        } else {
            // Short jobs count together: the clock of processor time is not told to the microsecond.
            let together = (40.0 / first.0.max(1e-3)).ceil().clamp(1.0, 1000.0) as u32;
            self.times.push(run(together)?);
        }
        self.spent += begin.elapsed();
        Ok(())
    }

    /// Medians and quartiles into the point they are of.
    fn tell(&self, sweep: &Sweep<'_>, is_software: bool, point: &mut Point) {
        let walls: Vec<f64> = self.times.iter().map(|r| r.0).collect();
        let cpus: Vec<f64> = self.times.iter().filter_map(|r| r.1).collect();
        point.time = Timing::of(&walls);
        point.cpu = Timing::of(&cpus).filter(|_| is_software || !sweep.on_device);
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
        mut run: impl FnMut(&mut S, &T) -> Outcome<()>,
        mut look: impl FnMut(&mut S, &T) -> Outcome<Point>,
    ) -> Outcome<Vec<Point>> {
        let mut all: Vec<Runs> = settings.iter().map(|_| Runs::default()).collect();
        let mut points = Vec::new();
        for round in 0..sweep.rounds {
            for (runs, (name, setting)) in all.iter_mut().zip(settings) {
                if round == 0 {
                    self.begin(sweep.what, name);
                } else if runs.spent >= sweep.patience {
                    continue;
                }
                runs.round(sweep, || run(state, setting))?;
                if round == 0 {
                    points.push(Point { setting: name.clone(), ..look(state, setting)? });
                }
            }
        }
        for (runs, point) in all.iter().zip(&mut points) {
            runs.tell(sweep, self.gpu.is_software(), point);
        }
        Ok(points)
    }
}
