//! Glioscope's core: volumes, files, masks, the tumour index and the measurements made on them.
//!
//! No code here depends on a GPU or a window. World space is RAS+ millimetres in `f64`;
//! [`Grid::world_from_voxel`] maps voxel *centres*. Terms (mask, region, tumour index, lens …) are defined in
//! ARCHITECTURE.md.

pub mod array;
pub mod case;
pub mod change;
pub mod check;
pub mod components;
pub mod csv;
pub mod dates;
pub mod distance;
pub mod ellipsoid;
pub mod files;
pub mod grid;
pub mod inside_lens;
pub mod mask;
pub mod measure;
pub mod optics;
pub mod phantom;
pub mod progress;
pub mod regions;
pub mod resample;
pub mod sample;
pub mod skeleton;
pub mod surface;
pub mod tract_distance;
pub mod tracts;
pub mod tumor_index;
pub mod volume;

pub use array::{Sample, WrongShape};
pub use check::{Check, Severity};
pub use components::{Component, Components, Connectivity};
pub use grid::{Grid, GridError, Sides};
pub use mask::{Mask, MaskBits};
pub use progress::{Cancelled, Progress};
pub use regions::{Region, RegionVolume, Regions, Selection};
pub use tracts::Tracts;
pub use tumor_index::{IndexData, TumorIndex};
pub use volume::{Samples, Scaling, Volume};

// The versions whose types the functions here take and return.
pub use glam;
pub use ndarray;
