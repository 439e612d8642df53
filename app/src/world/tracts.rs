//! Fibre tracts as tubes, made once per case, and how far a fibre runs from the selection.

use std::sync::Arc;

use glioscope_core::{
    MaskBits, Progress, Selection, Sides, Tracts,
    case::{Case, CaseTracts, TimePoint},
    tract_distance::SelectedCells,
};
use glioscope_render::{TubeSet, tract_color};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::error::AppError;

/// What the distance of a fibre depends on besides the fibre.
#[derive(PartialEq)]
struct CellsKey {
    case: Handle<Case>,
    time: usize,
    selection: Selection,
}

/// What is derived from a case's fibre tracts.
#[derive(Default)]
pub struct TractResult {
    sets: Derived<Handle<Case>, Vec<Arc<TubeSet>>>,
    /// The selection, ready to be asked for distances; `None` where it is empty.
    cells: Derived<CellsKey, Option<SelectedCells>>,
}

/// Whether `tracts` may be drawn beside the masks of `case`: only where both say which side is which.
pub fn is_placed(case: &Case, tracts: &Tracts) -> bool {
    tracts.sides() == Sides::Known && case.grid.sides() == Sides::Known
}

impl TractResult {
    /// A set for each of the case's files of tracts, in their order; an empty one where the place is not
    /// known. `None` without a file.
    pub fn sets(&mut self, case: &Arc<Case>, ask: &Ask) -> Option<Lookup<'_, Vec<Arc<TubeSet>>>> {
        if case.tracts.is_empty() {
            return None;
        }
        let of = case.clone();
        Some(self.sets.get(Handle::of(case), ask, move |progress| prepare(&of, progress)))
    }

    /// The cells of what `selection` shows of the date at `time`, to ask for distances; `None` within where it is
    /// empty.
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

    /// Whether a worker is at something that changes the picture.
    pub fn working(&self) -> bool {
        self.sets.working()
    }
}

fn prepare(case: &Case, progress: &Progress) -> Result<Vec<Arc<TubeSet>>, AppError> {
    let nothing = Tracts::new(Vec::new(), vec![0], Sides::Unknown);
    let mut sets = Vec::new();
    for (n, CaseTracts { id, tracts }) in case.tracts.iter().enumerate() {
        progress.say(format!("preparing {id}"));
        let drawn = nothing.as_ref().filter(|_| !is_placed(case, tracts)).unwrap_or(tracts);
        sets.push(Arc::new(TubeSet::new(drawn, tract_color(n), TubeSet::RADIUS_MM, progress)?));
    }
    Ok(sets)
}
