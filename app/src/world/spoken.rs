//! What is said of a date to a patient, put together on a worker: new spots are connected pieces of whole masks.

use std::sync::Arc;

use glioscope_core::case::Case;

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::{
    page::{Spoken, spoken},
    words::Language,
};

/// What was last said.
#[derive(Default)]
pub struct Sayings {
    result: Derived<(Handle<Case>, usize, Language), Spoken>,
}

impl Sayings {
    /// What is said of the date number `time`; `None` until it is known.
    pub fn get(
        &mut self,
        case: &Arc<Case>,
        time: usize,
        language: Language,
        ask: &Ask,
    ) -> Option<Arc<Spoken>> {
        let of = case.clone();
        match self
            .result
            .get((Handle::of(case), time, language), ask, move |_| Ok(spoken(&of, time, language)))
        {
            Lookup::Ready(said) => Some(said.clone()),
            Lookup::Working(_) | Lookup::Failed(_) => None,
        }
    }

    /// Whether a worker is at it.
    pub fn working(&mut self) -> bool {
        self.result.working()
    }
}
