//! Lesions over time: the components of a mask at all dates, their diameters, which of them are one lesion, and what
//! became of it.
//!
//! [`find`] reads a case: components, numbers, what overlaps. [`track`] makes lesions of it, with the user's [`Edit`]s, in
//! milliseconds, so that an edit is undone by leaving it out. Nothing here depends on the order in which masks, files or
//! dates are listed, nor on the number of threads.

mod boxed;
mod change_point;
pub mod diameters;
mod edits;
mod error;
mod event;
mod events;
mod find;
mod links;
mod neck;
mod parts;
mod report;
mod series;
mod sets;
mod split;
mod table;
#[cfg(test)]
mod tests;
mod track;
mod tracked;
mod values;

pub use change_point::{
    ChangePoint, ChangePointKind, ChangePointTest, FEWEST_DATES_OF_LEVEL, FEWEST_DATES_OF_RATE,
};
pub use edits::{Anchor, Edit, NotApplied};
pub use error::LesionsError;
pub use event::{Event, EventKind};
pub use find::{Found, Of, Options, default_mask, find};
pub use links::{Link, LinkState, LinkedBy};
pub use neck::{Neck, WIDEST_NECK, neck};
pub use parts::Part;
pub(crate) use report::largest;
pub use report::{
    DateReport, EventReport, LesionDate, LesionReport, LesionsReport, LinkReport, PairReport, PartReport,
    report,
};
pub use series::{ChangePointReport, Growth, Point, Series};
pub use table::csv;
pub use track::track;
pub use tracked::{Lesion, Tracked, Unit};
pub use values::{SurfaceMove, Values};

/// The lesions that are new at a date after the first, with their names and that date; small ones are left out.
pub fn new_lesions(report: &LesionsReport) -> impl Iterator<Item = (&str, &LesionDate)> {
    report.lesions.iter().filter(|lesion| !lesion.small).flat_map(|lesion| {
        let born = lesion.dates.iter().skip(1).filter(|date| date.events.contains(&EventKind::Born));
        born.map(|date| (lesion.name.as_deref().unwrap_or(&lesion.id), date))
    })
}

/// Default of the smallest lesion: a ball of 5.8 mm. Smaller components are counted, but neither born, gone nor pieces of
/// a split: most are flecks of a segmentation's edge.
pub const DEFAULT_SMALLEST_ML: f64 = crate::change::DEFAULT_SMALLEST_ML;

/// Default of the farthest that components without a common voxel may lie apart to be proposed as one lesion: as far as
/// dates may lie apart and still count as aligned.
pub const DEFAULT_WITHIN_MM: f64 = crate::case::NOT_ALIGNED_MM;
