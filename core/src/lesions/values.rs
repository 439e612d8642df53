//! What lesions are in an image of their date, and how their surface moved since the date before.

use std::{collections::BTreeMap, sync::Arc};

use serde::Serialize;

use crate::{
    Mask, MaskBits, Progress, Volume,
    case::{Case, TimePoint},
    change::{self, ChangeOptions, Choice, Lengths},
    measure::{Statistics, statistics_of},
};

use super::{
    error::LesionsError,
    parts::{DateParts, Part, part_at},
};

/// Values of an image in a lesion, in the image's unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Values {
    /// Id of the image.
    pub image: String,
    /// Finite values.
    pub voxels: u64,
    /// Mean; `None` without a finite value, like all that follow.
    pub mean: Option<f64>,
    /// Largest value: SUVmax where values are SUV.
    pub max: Option<f64>,
    /// The highest mean in a ball of 1 ml about a voxel of the lesion: SUVpeak; `None` where no such ball lies inside the image.
    pub peak: Option<f64>,
    /// Mean times the volume of these voxels: total lesion glycolysis.
    pub mean_times_ml: Option<f64>,
}

/// How the outer surface of a lesion moved since the date before.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceMove {
    /// Label of the date before.
    pub from_time: String,
    /// Lengths of growth.
    pub growth: Lengths,
    /// Lengths of recession.
    pub recession: Lengths,
    /// Number of both that can't be told from no change.
    pub within_uncertainty: u64,
}

/// A movement of the surface at a voxel of the case grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moved {
    /// The line of the case grid, and the voxel in it.
    at: (usize, u32),
    signed_mm: f64,
    within_uncertainty: bool,
}

/// What is known of dates beside their components.
#[derive(Clone, Debug, Default)]
pub(super) struct Beside {
    /// The image's id, and that image of each date.
    image: Option<(String, Vec<Option<Arc<Volume>>>)>,
    /// Movements by their earlier and later date.
    moved: BTreeMap<[usize; 2], Arc<Vec<Moved>>>,
}

impl Beside {
    /// The images, where one is asked for.
    pub fn image(&mut self, case: &Case, id: &str) {
        let of = |time: &TimePoint| {
            time.contexts.iter().find(|context| context.id == id).map(|context| Arc::clone(&context.volume))
        };
        self.image = Some((id.to_owned(), case.time_points.iter().map(of).collect()));
    }

    /// The movements of a mask between two dates. Nothing where only volumes can be compared.
    pub fn surface(
        &mut self,
        case: &Case,
        dates: [usize; 2],
        id: &str,
        progress: &Progress,
    ) -> Result<(), LesionsError> {
        let Ok(choice) = Choice::at(case, Some(id), dates) else { return Ok(()) };
        let (_, change) = change::between(case, &choice, &ChangeOptions::default(), None, progress)?;
        let rows = case.grid.dims()[1];
        let moved = change.vectors.iter().map(|vector| Moved {
            at: (vector.voxel[2] * rows + vector.voxel[1], vector.voxel[0] as u32),
            signed_mm: vector.signed_mm,
            within_uncertainty: vector.flags.within_uncertainty,
        });
        self.moved.insert(dates, Arc::new(moved.collect()));
        Ok(())
    }

    /// Values of the image in parts of a date; `None` where none is asked for, or the date lacks it.
    pub fn values(&self, date: usize, grid_parts: &DateParts, parts: &[&Part]) -> Option<Values> {
        let (id, volumes) = self.image.as_ref()?;
        let volume = volumes.get(date)?.as_ref()?;
        let grid = &grid_parts.grid;
        let mut bits = MaskBits::empty(grid.dims());
        for run in parts.iter().flat_map(|part| &part.runs) {
            (run.first..=run.last).for_each(|x| bits.set([x as usize, run.y as usize, run.z as usize]));
        }
        let mask = Mask::new("", grid.clone(), bits)?;
        let Statistics { voxels, mean, max, peak, mean_times_ml, .. } = statistics_of(&mask, (id, volume));
        Some(Values { image: id.clone(), voxels, mean, max, peak, mean_times_ml })
    }

    /// Movements between two dates whose voxel lies in one of the parts: of the later date, or of the earlier one.
    pub fn moves(
        &self,
        dates: [usize; 2],
        from_time: String,
        of: [(Option<&DateParts>, &[usize]); 2],
    ) -> Option<SurfaceMove> {
        let moved = self.moved.get(&dates)?;
        let is_of = |at: (usize, u32)| {
            of.iter().any(|(date, parts)| {
                let part = date.and_then(|date| part_at(&date.case_runs, at));
                part.is_some_and(|part| parts.contains(&(part as usize)))
            })
        };
        let (mut growth, mut recession, mut within_uncertainty) = (Vec::new(), Vec::new(), 0);
        for one in moved.iter().filter(|one| is_of(one.at)) {
            if one.signed_mm > 0.0 {
                growth.push(one.signed_mm);
            } else {
                recession.push(-one.signed_mm);
            }
            within_uncertainty += u64::from(one.within_uncertainty);
        }
        Some(SurfaceMove {
            from_time,
            growth: Lengths::of(growth),
            recession: Lengths::of(recession),
            within_uncertainty,
        })
    }
}
