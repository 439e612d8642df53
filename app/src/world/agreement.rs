//! Metrics of masks by a named convention, computed on a worker.

use std::sync::Arc;

use glioscope_core::{
    case::Case,
    measure::{
        self, DateComparison, Operand,
        conventions::{Comparison, Settings},
    },
};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::model::AgreementSetting;

/// The pairs of a date, and the two of any dates.
pub struct Agreed {
    /// The masks of the date.
    pub date: DateComparison,
    /// The two; or why they can't be compared, in one line.
    pub two: Option<([Operand; 2], Result<Comparison, String>)>,
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
