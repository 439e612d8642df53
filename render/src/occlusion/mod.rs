//! What all occlusion backends share: the medium as the graphics device reads it, and where pixels
//! and slices are.

mod bricks;
pub mod cone;
mod geometry;
pub(crate) mod upload;
mod volume;

pub(crate) use bricks::Occupied;
pub use geometry::Sight;
pub use volume::{Filter, OPAQUE, OpticalVolume, Plane, Table};
