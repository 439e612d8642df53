//! Metrics of masks by a named convention, computed on a worker.

use std::sync::Arc;

use glioscope_core::{
    Progress,
    case::Case,
    measure::{
        self, DateComparison, Operand, PairComparison,
        conventions::{Comparison, Settings},
    },
};

use serde_json::Value;

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::{error::AppError, model::AgreementSetting, output};

/// The pairs of a date, and the two of any dates.
pub struct Agreed {
    /// The masks of the date.
    pub date: DateComparison,
    /// The two; or why they can't be compared, in one line.
    pub two: Option<([Operand; 2], Result<Comparison, String>)>,
}

/// The report as JSON with each pair's metrics in the pair, the raters of each date beside them, and `two` compared of any dates. What a
/// convention says of Dice and Jaccard replaces what the report says.
///
/// # Errors
/// [`AppError`] for numbers that JSON can't hold.
pub fn with_metrics(
    report: &measure::MeasureReport,
    compared: &[DateComparison],
    two: &[PairComparison],
) -> Result<Value, AppError> {
    let mut value = output::value(report)?;
    let times = value.get_mut("time_points").and_then(Value::as_array_mut).into_iter().flatten();
    for (time, date) in times.zip(compared) {
        let pairs = time.get_mut("pairs").and_then(Value::as_array_mut).into_iter().flatten();
        for (pair, comparison) in pairs.zip(&date.pairs) {
            *pair = output::value(comparison)?;
        }
        time["raters"] = output::value(&date.raters)?;
    }
    value["two"] = output::value(two)?;
    Ok(value)
}

/// Any two masks or regions compared, by what they are called on the command line.
///
/// # Errors
/// [`AppError`] where they can't be compared; cancelled.
pub fn compare_two(
    case: &Case,
    two: &[Operand; 2],
    settings: &Settings,
    progress: &Progress,
) -> Result<PairComparison, AppError> {
    let [a, b] = two.each_ref().map(Operand::to_string);
    let comparison = measure::compared_two(case, two, settings, progress)?
        .map_err(|why| AppError::Compared(format!("{a} and {b}: {why}")))?;
    Ok(PairComparison { a, b, comparison })
}

/// The case, the number of the date, how masks are compared, and the two of any dates.
type Key = (Handle<Case>, usize, Settings, Option<[Operand; 2]>);

/// The metrics last requested.
#[derive(Default)]
pub struct Agreements {
    result: Derived<Key, Agreed>,
}

impl Agreements {
    /// Metrics of the masks at date number `time`, and of the two that `setting` names.
    pub fn get(
        &mut self,
        case: &Arc<Case>,
        time: usize,
        setting: &AgreementSetting,
        ask: &Ask,
    ) -> Lookup<'_, Agreed> {
        let (settings, two) = (setting.settings(), setting.two.clone());
        let key = (Handle::of(case), time, settings, two.clone());
        let case = case.clone();
        self.result.get(key, ask, move |progress| {
            let date = measure::compared_at(&case, time, &settings, progress)?;
            let compare = |two: [Operand; 2]| {
                let found = measure::compared_two(&case, &two, &settings, progress)?;
                Ok::<_, glioscope_core::Cancelled>((two, found))
            };
            Ok(Agreed { date, two: two.map(compare).transpose()? })
        })
    }

    /// The metrics last computed, which may be for older settings.
    pub fn last(&self) -> Option<&Arc<Agreed>> {
        self.result.last()
    }

    /// Whether a worker is computing them.
    pub fn working(&mut self) -> bool {
        self.result.working()
    }
}
