//! Fibre tracts as tubes, prepared once per case, and the selection for distance queries.

use std::sync::Arc;

use glioscope_core::{
    MaskBits, Progress, Selection, Sides, Tracts,
    case::{Case, CaseTracts, TimePoint},
    tract_distance::SelectedCells,
};
use glioscope_render::{TubeSet, tract_color};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::error::AppError;

/// Inputs of [`SelectedCells`].
#[derive(PartialEq)]
struct CellsKey {
    case: Handle<Case>,
    time: usize,
    selection: Selection,
}

/// Results derived from a case's fibre tracts.
#[derive(Default)]
pub struct TractResult {
    sets: Derived<Handle<Case>, Vec<Arc<TubeSet>>>,
    /// The selection, prepared for distance queries; `None` where it is empty.
    cells: Derived<CellsKey, Option<SelectedCells>>,
}

/// Whether `tracts` may be drawn with the masks of `case`: only where left and right are known for both.
pub fn is_placed(case: &Case, tracts: &Tracts) -> bool {
    tracts.sides() == Sides::Known && case.grid.sides() == Sides::Known
}

impl TractResult {
    /// One tube set per tract file of the case, in their order; empty for files whose position is unknown
    /// ([`is_placed`]). `None` where the case has no tracts.
    pub fn sets(&mut self, case: &Arc<Case>, ask: &Ask) -> Option<Lookup<'_, Vec<Arc<TubeSet>>>> {
        if case.tracts.is_empty() {
            return None;
        }
        let job_case = case.clone();
        Some(self.sets.get(Handle::of(case), ask, move |progress| prepare(&job_case, progress)))
    }

    /// The selected voxels of the time point with index `time`, prepared for distance queries; `None` inside the result
    /// where none is selected.
    pub fn cells(
        &mut self,
        case: &Arc<Case>,
        (time, time_point): (usize, &TimePoint),
        selection: &Selection,
        ask: &Ask,
    ) -> Lookup<'_, Option<SelectedCells>> {
        let key = CellsKey { case: Handle::of(case), time, selection: selection.clone() };
        let (index, selection) = (time_point.index.clone(), selection.clone());
        self.cells.get(key, ask, move |_| {
            let bits = MaskBits::from_fn(index.grid().dims(), |linear| selection.shows(index.get(linear)));
            Ok(SelectedCells::new(index.grid(), &bits))
        })
    }

    /// Whether a worker is preparing tubes.
    pub fn working(&mut self) -> bool {
        self.sets.working()
    }
}

fn prepare(case: &Case, progress: &Progress) -> Result<Vec<Arc<TubeSet>>, AppError> {
    let no_tracts = Tracts::new(Vec::new(), vec![0], Sides::Unknown);
    let mut sets = Vec::new();
    for (n, CaseTracts { id, tracts }) in case.tracts.iter().enumerate() {
        progress.say(format!("preparing {id}"));
        let drawn = no_tracts.as_ref().filter(|_| !is_placed(case, tracts)).unwrap_or(tracts);
        sets.push(Arc::new(TubeSet::new(drawn, tract_color(n), TubeSet::RADIUS_MM, progress)?));
    }
    Ok(sets)
}
