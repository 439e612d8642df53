//! Lesions over time, found on a worker; the user's edits are applied to what was found.

use std::sync::Arc;

use glioscope_core::{
    case::Case,
    lesions::{self, Edit, Found, LesionsReport, Options},
};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::model::{ChangeSetting, LesionSetting};

/// The lesions last requested.
#[derive(Default)]
pub struct Lesions {
    found: Derived<(Handle<Case>, Options), Found>,
    tracked: Derived<(Handle<Found>, Vec<Edit>), LesionsReport>,
}

impl Lesions {
    /// The lesions of `case` with the user's edits; `None` without any mask.
    pub fn get(
        &mut self,
        case: &Arc<Case>,
        (setting, change): (&LesionSetting, &ChangeSetting),
        ask: &Ask,
    ) -> Option<Lookup<'_, LesionsReport>> {
        let options = setting.options(case, change)?;
        let edits = setting.edits_of(&options.of.name());
        let (read, asked) = (case.clone(), options.clone());
        let find = move |progress: &_| Ok(lesions::find(&read, &asked, progress)?);
        let found = match self.found.get((Handle::of(case), options), ask, find) {
            Lookup::Ready(found) => found.clone(),
            Lookup::Working(progress) => return Some(Lookup::Working(progress)),
            Lookup::Failed(error) => return Some(Lookup::Failed(error)),
        };
        let key = (Handle::of(&found), edits.clone());
        let track = move |progress: &_| Ok(LesionsReport::of(&lesions::track(&found, &edits, progress)?));
        Some(self.tracked.get(key, ask, track))
    }

    /// The components last found: what a split is proposed of.
    pub fn found(&self) -> Option<&Arc<Found>> {
        self.found.last()
    }

    /// The lesions last computed, which may be for older settings: shown while newer ones are computed.
    pub fn last(&self) -> Option<&Arc<LesionsReport>> {
        self.tracked.last()
    }

    /// Whether a worker is computing any.
    pub fn working(&mut self) -> bool {
        // Each takes what is finished.
        self.found.working() | self.tracked.working()
    }
}
