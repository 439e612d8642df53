//! Whether a series of volumes has a change, and how often noise alone would look as if it had.
//!
//! The likelihood ratio of one change at the best of all places, whose distribution under noise is simulated: for normal
//! errors of the logarithms it depends on the dates alone, so that the false-alarm rate is exact but for the simulation's
//! number (Barnard 1963).

use crate::optics::random::Random;
use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

/// Fewest dates of a change of level: with fewer, two levels fit almost anything.
pub const FEWEST_DATES_OF_LEVEL: usize = 5;

/// Fewest dates of a change of rate, which has one parameter more.
pub const FEWEST_DATES_OF_RATE: usize = 6;

/// Series of noise that are simulated: the least false-alarm rate that can be stated is 1 in 20,000, and that of
/// 0.05 is known to 0.0015.
const SERIES: usize = 19_999;

const SEED: u64 = 0x6c65_7369_6f6e_7301;

/// Share of the squares that rounding leaves of a series that fits without a rest.
const ROUNDING: f64 = 1e-20;

/// What changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ChangePointKind {
    /// From one level to another, against no change at all: steady growth is a change of level, too.
    Level,
    /// From one rate of growth to another, against steady growth or shrinkage.
    Rate,
}

/// The most likely change of a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangePoint {
    /// Position of the date from which on the level is another, or at which the rate changes.
    pub at: usize,
    /// Share of noise series whose best change fits at least as well: the false-alarm rate of calling this one a change.
    pub false_alarm_rate: f64,
}

/// The test for dates at given times.
#[derive(Clone, Debug)]
pub struct ChangePointTest {
    /// Of length 1, orthogonal to each other: what is fitted without a change.
    base: Vec<Vec<f64>>,
    /// Of length 1, orthogonal to the base: what a change at a position adds.
    changes: Vec<(usize, Vec<f64>)>,
    /// The statistic of each noise series, sorted.
    noise: Vec<f64>,
}

impl ChangePointTest {
    /// The test for dates at these days, in order; `None` for fewer than [`FEWEST_DATES_OF_LEVEL`] or
    /// [`FEWEST_DATES_OF_RATE`], or for days that don't increase.
    pub fn new(kind: ChangePointKind, days: &[f64]) -> Option<Self> {
        let count = days.len();
        let fewest = match kind {
            ChangePointKind::Level => FEWEST_DATES_OF_LEVEL,
            ChangePointKind::Rate => FEWEST_DATES_OF_RATE,
        };
        let increases = days.iter().zip(days.iter().skip(1)).all(|(a, b)| a < b);
        if count < fewest || !increases || !days.iter().all(|day| day.is_finite()) {
            return None;
        }
        let one = vec![1.0; count];
        let mut base = vec![unit(one)?];
        let column = |at: usize| -> Vec<f64> {
            let from = days.get(at).copied().unwrap_or_default();
            let value = |(n, day): (usize, &f64)| match kind {
                ChangePointKind::Level => f64::from(u8::from(n >= at)),
                ChangePointKind::Rate => (day - from).max(0.0),
            };
            days.iter().enumerate().map(value).collect()
        };
        let places = match kind {
            ChangePointKind::Level => 1..count,
            ChangePointKind::Rate => {
                let slope = rest(days.to_vec(), &base);
                base.push(unit(slope)?);
                1..count - 1
            }
        };
        let changes = places.filter_map(|at| Some((at, unit(rest(column(at), &base))?))).collect();
        let mut test = Self { base, changes, noise: Vec::new() };
        let series = (0..SERIES as u64).filter_map(|n| {
            let mut random = Random::new(SEED, n);
            let values = (0..count).map(|_| normal(&mut random)).collect();
            test.statistic(values).map(|(_, statistic)| statistic)
        });
        let mut noise: Vec<f64> = series.collect();
        noise.sort_by(f64::total_cmp);
        test.noise = noise;
        Some(test)
    }

    /// The most likely change of a series; `None` for another number of values than dates, for one that isn't finite, and
    /// for a series that fits without a rest.
    pub fn of(&self, values: &[f64]) -> Option<ChangePoint> {
        let is_fit = self.base.first().is_some_and(|one| one.len() == values.len());
        let (at, statistic) = self.statistic(values.to_vec()).filter(|_| is_fit)?;
        let below = self.noise.partition_point(|noise| *noise < statistic);
        let as_high = self.noise.len() - below;
        Some(ChangePoint { at, false_alarm_rate: (as_high + 1) as f64 / (self.noise.len() + 1) as f64 })
    }

    /// The share of the squares left by the base that the best change takes away, and its place.
    fn statistic(&self, values: Vec<f64>) -> Option<(usize, f64)> {
        let all = dot(&values, &values);
        let values = rest(values, &self.base);
        let squares = dot(&values, &values);
        let is_usable = squares.is_finite() && squares > ROUNDING * all;
        let shares = self.changes.iter().map(|(at, change)| (*at, dot(&values, change).powi(2) / squares));
        let best = shares.reduce(|best, share| if share.1 > best.1 { share } else { best });
        best.filter(|_| is_usable)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// What the unit vectors of `base` leave.
fn rest(mut values: Vec<f64>, base: &[Vec<f64>]) -> Vec<f64> {
    for one in base {
        let share = dot(&values, one);
        values.iter_mut().zip(one).for_each(|(value, part)| *value -= share * part);
    }
    values
}

/// Of length 1; `None` for zero.
fn unit(mut values: Vec<f64>) -> Option<Vec<f64>> {
    let length = dot(&values, &values).sqrt();
    values.iter_mut().for_each(|value| *value /= length);
    (length > 0.0).then_some(values)
}

/// A standard normal number (Box and Muller 1958).
fn normal(random: &mut Random) -> f64 {
    let radius = (-2.0 * (1.0 - random.unit()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.unit()).cos()
}
