//! Overlap and surface metrics of two masks by the conventions of published packages, and the agreement of more than two
//! raters.

mod bits;
mod compare;
mod convention;
mod distances;
mod lesions;
mod number;
mod overlap;
mod raters;
mod surface;
mod surfels;
#[cfg(test)]
mod tests;

pub use compare::{Comparison, Hausdorff, METRICS, MetricRow, NoDistances, Settings, Unequal, compare};
pub use convention::{
    Averages, BRATS_MISSED_MM, CONVENTIONS, Convention, ConventionRow, Empty, Lesions, Percentile,
    SurfaceDice,
};
pub use lesions::{LesionReport, LesionRule};
pub use overlap::Overlap;
pub use raters::{Domain, Ratings, Staple};
pub use surface::Surface;
