//! What all occlusion backends share: the medium as the graphics device reads it, and where pixels
//! and slices are.

mod bricks;
pub mod cone;
mod geometry;
pub(crate) mod poisson;
#[cfg(test)]
mod stability_tests;
pub(crate) mod upload;
mod volume;

pub(crate) use bricks::{Occupied, joined};
pub use geometry::Sight;
pub use poisson::{MOST_POINTS, poisson_disc};
pub use volume::{Filter, OPAQUE, OpticalVolume, Plane, Table};
