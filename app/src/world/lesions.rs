//! Lesions over time, found on a worker; the user's edits are applied to what was found.

use std::sync::Arc;

use glioscope_core::{
    case::Case,
    lesions::{self, Anchor, Edit, Found, LesionsReport, Neck, Options},
};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::model::{ChangeSetting, LesionSetting};

/// A neck, or why there is none.
type Necked = Result<Neck, String>;

/// The lesions last requested.
#[derive(Default)]
pub struct Lesions {
    found: Derived<(Handle<Case>, Options), Found>,
    tracked: Derived<(Handle<Found>, Vec<Edit>), LesionsReport>,
    neck: Derived<(Handle<Found>, Vec<Edit>, Anchor), Necked>,
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

    /// Where the component at a place would be split, or why nowhere; `None` before lesions are found.
    pub fn neck(&mut self, setting: &LesionSetting, at: &Anchor, ask: &Ask) -> Option<Lookup<'_, Necked>> {
        let found = self.found.last()?.clone();
        let (edits, at) = (setting.edits_of(&found.of), at.clone());
        let key = (Handle::of(&found), edits.clone(), at.clone());
        Some(self.neck.get(key, ask, move |progress| {
            // A piece of an earlier split is a component of its own.
            let tracked = lesions::track(&found, &edits, progress)?;
            Ok(lesions::neck(&tracked.found, &at, progress)?)
        }))
    }

    /// The lesions last computed, which may be for older settings: shown while newer ones are computed.
    pub fn last(&self) -> Option<&Arc<LesionsReport>> {
        self.tracked.last()
    }

    /// Whether a worker is computing any.
    pub fn working(&mut self) -> bool {
        // Each takes what is finished.
        self.found.working() | self.tracked.working() | self.neck.working()
    }
}
