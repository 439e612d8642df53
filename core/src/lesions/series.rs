//! Volumes over dates: growth and change.

use std::collections::HashMap;

use serde::Serialize;

use super::change_point::{ChangePointKind, ChangePointTest};

/// A volume at a date.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Label of the date.
    pub time: String,
    /// Days since the first date.
    pub days: Option<f64>,
    /// The volume; 0 where the lesion isn't there, `None` where that isn't known.
    pub volume_ml: Option<f64>,
}

/// Growth of a series: a line through the logarithms of its volumes, by least squares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// Dates with a volume above 0, all that count.
    pub dates: usize,
    /// Increase of the natural logarithm of the volume per day.
    pub log_per_day: f64,
    /// Its standard error; `None` of two dates.
    pub standard_error: Option<f64>,
    /// Days in which the volume doubles; `None` where it doesn't grow.
    pub doubling_days: Option<f64>,
    /// Days in which the volume halves; `None` where it doesn't shrink.
    pub halving_days: Option<f64>,
}

/// The most likely change of a series, as reported.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChangePointReport {
    /// What changes.
    pub kind: ChangePointKind,
    /// Label of the date from which on the level is another, or at which the rate changes; `None` where nothing is tested.
    pub time: Option<String>,
    /// How often noise alone looks so; `None` where nothing is tested.
    pub false_alarm_rate: Option<f64>,
    /// Why nothing is tested.
    pub reason: Option<&'static str>,
}

/// What a series of volumes says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Series {
    /// The volumes.
    pub points: Vec<Point>,
    /// Growth; `None` without two dates of known days and volumes above 0.
    pub growth: Option<Growth>,
    /// Changes of level and of rate.
    pub changes: Vec<ChangePointReport>,
}

/// Change of the logarithm over the dates below which there is none but rounding.
const NO_CHANGE: f64 = 1e-9;

/// Tests by kind and days: lesions share their dates.
#[derive(Default)]
pub(super) struct Tests(HashMap<(ChangePointKind, Vec<u64>), Option<ChangePointTest>>);

impl Series {
    pub(super) fn new(points: Vec<Point>, tests: &mut Tests) -> Self {
        let growth = growth(&points);
        let kinds = [ChangePointKind::Level, ChangePointKind::Rate];
        let changes = kinds.map(|kind| change(&points, kind, tests)).to_vec();
        Self { points, growth, changes }
    }
}

fn is_positive(point: &&Point) -> bool {
    point.volume_ml.is_some_and(|ml| ml > 0.0)
}

fn growth(points: &[Point]) -> Option<Growth> {
    let points = points.iter().filter(is_positive);
    let values: Vec<(f64, f64)> = points.filter_map(|p| Some((p.days?, p.volume_ml?.ln()))).collect();
    let count = values.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| values.iter().map(of).sum::<f64>() / count;
    let (day, log) = (mean(&|v| v.0), mean(&|v| v.1));
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| values.iter().map(of).sum::<f64>();
    let days = sum(&|v| (v.0 - day).powi(2));
    if values.len() < 2 || days <= 0.0 {
        return None;
    }
    let log_per_day = sum(&|v| (v.0 - day) * (v.1 - log)) / days;
    let rest = sum(&|v| (v.1 - log - log_per_day * (v.0 - day)).powi(2));
    // Of a volume that doesn't change only rounding is left.
    let is_change = log_per_day.abs() * days.sqrt() > NO_CHANGE;
    let days_to = |factor: f64| {
        Some(factor.ln() / log_per_day).filter(|days| is_change && days.is_finite() && *days > 0.0)
    };
    Some(Growth {
        dates: values.len(),
        log_per_day,
        standard_error: (values.len() > 2).then(|| (rest / (count - 2.0) / days).sqrt()),
        doubling_days: days_to(2.0),
        halving_days: days_to(0.5),
    })
}

fn change(points: &[Point], kind: ChangePointKind, tests: &mut Tests) -> ChangePointReport {
    let none = |reason| ChangePointReport { kind, time: None, false_alarm_rate: None, reason: Some(reason) };
    let known: Vec<&Point> = points.iter().filter(is_positive).collect();
    // A change of level depends on the order alone.
    let days: Option<Vec<f64>> = match kind {
        ChangePointKind::Level => Some((0..known.len()).map(|n| n as f64).collect()),
        ChangePointKind::Rate => known.iter().map(|point| point.days).collect(),
    };
    let Some(days) = days else { return none("dates without days") };
    let key = (kind, days.iter().map(|day| day.to_bits()).collect());
    let test = tests.0.entry(key).or_insert_with(|| ChangePointTest::new(kind, &days));
    let Some(test) = test else { return none("too few dates") };
    let logs: Vec<f64> = known.iter().filter_map(|point| point.volume_ml.map(f64::ln)).collect();
    match test.of(&logs).and_then(|found| Some((known.get(found.at)?, found.false_alarm_rate))) {
        None => none("no variation"),
        Some((point, rate)) => ChangePointReport {
            kind,
            time: Some(point.time.clone()),
            false_alarm_rate: Some(rate),
            reason: None,
        },
    }
}
