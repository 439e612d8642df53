//! Fibre tracts as tubes, prepared once per case, and the selection for distance queries.

use std::sync::Arc;

use glioscope_core::{
    MaskBits, Progress, Selection, Sides, Tracts,
    case::{Case, CaseTracts, TimePoint},
    tract_distance::SelectedCells,
};
use glioscope_render::{TubeSet, TubeShape, TubeValues};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::{
    error::AppError,
    model::{Edit, FiberColor},
};

/// Inputs of [`SelectedCells`].
#[derive(PartialEq)]
struct CellsKey {
    case: Handle<Case>,
    time: usize,
    selection: Selection,
}

/// What a set of tubes is prepared with besides its tracts.
#[derive(Clone, Debug, PartialEq)]
struct Shape {
    color: FiberColor,
    smooth_mm: Option<f64>,
}

/// Inputs of the tube sets.
#[derive(Clone, PartialEq)]
struct SetsKey {
    case: Handle<Case>,
    /// Of each file of tracts.
    shapes: Vec<Shape>,
}

/// Tube sets with what they were prepared with.
struct Sets {
    key: SetsKey,
    sets: Vec<PreparedTubes>,
}

/// The tubes of a file.
#[derive(Clone)]
pub struct PreparedTubes {
    /// Them.
    pub set: Arc<TubeSet>,
    /// Whether the scalar that colours them lacks values.
    pub has_gaps: bool,
}

/// The tube sets of a case.
#[derive(Default)]
pub struct TubeSets {
    /// One per tract file of the case, in their order; those of other looks while others are being prepared, none before
    /// the first.
    pub sets: Vec<PreparedTubes>,
    /// Whether a worker prepares them.
    pub is_working: bool,
    /// Why they can't be prepared.
    pub error: Option<String>,
}

/// Results derived from a case's fibre tracts.
#[derive(Default)]
pub struct TractResult {
    sets: Derived<SetsKey, Sets>,
    /// The selection, prepared for distance queries; `None` where it is empty.
    cells: Derived<CellsKey, Option<SelectedCells>>,
}

/// Whether `tracts` may be drawn with the masks of `case`: only where left and right are known for both.
pub fn is_placed(case: &Case, tracts: &Tracts) -> bool {
    tracts.sides() == Sides::Known && case.grid.sides() == Sides::Known
}

impl TractResult {
    /// One tube set per tract file of the case, in their order; empty for files whose position is unknown
    /// ([`is_placed`]). A file whose look needs no other set keeps its own.
    pub fn sets(&mut self, case: &Arc<Case>, edit: &Edit, ask: &Ask) -> TubeSets {
        if case.tracts.is_empty() {
            return TubeSets::default();
        }
        let shape = |CaseTracts { id, tracts }: &CaseTracts| {
            let look = edit.tract_look(id);
            // What has no such scalar has one colour.
            let has_color = look.scalar(tracts).is_some() || look.color == FiberColor::Direction;
            let color = if has_color { look.color.clone() } else { FiberColor::Plain };
            Shape { color, smooth_mm: look.smooth_mm() }
        };
        let key = SetsKey { case: Handle::of(case), shapes: case.tracts.iter().map(shape).collect() };
        let before = self.sets.last().filter(|last| last.key.case == key.case).cloned();
        let (job_case, job_key, job_before) = (case.clone(), key.clone(), before.clone());
        let prepare = move |progress: &Progress| prepare(&job_case, job_key, job_before.as_deref(), progress);
        match self.sets.get(key, ask, prepare) {
            Lookup::Ready(sets) => TubeSets { sets: sets.sets.clone(), ..TubeSets::default() },
            Lookup::Working(_) => {
                let sets = before.map(|before| before.sets.clone()).unwrap_or_default();
                TubeSets { sets, is_working: true, error: None }
            }
            Lookup::Failed(error) => {
                TubeSets { sets: Vec::new(), is_working: false, error: Some(error.to_string()) }
            }
        }
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

fn prepare(case: &Case, key: SetsKey, before: Option<&Sets>, progress: &Progress) -> Result<Sets, AppError> {
    let no_tracts = Tracts::new(Vec::new(), vec![0], Sides::Unknown);
    let mut sets = Vec::new();
    for (n, (CaseTracts { id, tracts }, shape)) in case.tracts.iter().zip(&key.shapes).enumerate() {
        let same = before.filter(|before| before.key.shapes.get(n) == Some(shape));
        if let Some(set) = same.and_then(|before| before.sets.get(n)) {
            sets.push(set.clone());
            continue;
        }
        progress.say(format!("preparing {id}"));
        let drawn = no_tracts.as_ref().filter(|_| !is_placed(case, tracts)).unwrap_or(tracts);
        let values = match &shape.color {
            FiberColor::Plain => TubeValues::Nothing,
            FiberColor::Direction => TubeValues::Direction,
            FiberColor::Scalar(name) => tracts.scalar(name).map_or(TubeValues::Nothing, TubeValues::Scalar),
        };
        let has_gaps = matches!(values, TubeValues::Scalar(scalar) if scalar.has_gaps());
        let shape = TubeShape { values, smooth_mm: shape.smooth_mm };
        sets.push(PreparedTubes { set: Arc::new(TubeSet::new(drawn, &shape, progress)?), has_gaps });
    }
    Ok(Sets { key, sets })
}
