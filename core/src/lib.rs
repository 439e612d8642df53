//! Glioscope's core: volumes, files, masks, the tumour index and the measurements made on them.
//!
//! No code here depends on a GPU or a window. World space is RAS+ millimetres in `f64`;
//! [`Grid::world_from_voxel`] maps voxel *centres*. Terms (mask, region, tumour index, lens …) are defined in
//! ARCHITECTURE.md.
//!
//! A case is described, loaded and then measured; a folder or a manifest is described by
//! [`case::CaseSpec::from_path`]:
//!
//! ```
//! use glioscope_core::{Progress, case, measure, sample};
//!
//! // The embedded sample's masks of its first date.
//! let mut spec = sample::sample_spec();
//! spec.contexts.clear();
//! spec.masks.retain(|mask| mask.time.as_deref() == Some("2024-01-15"));
//! let case = case::load(&spec, &case::LoadOptions::default(), &Progress::new())?;
//!
//! // Regions are the voxels in exactly these masks: three masks that overlap in every way have seven.
//! let regions = &case.time_points[0].regions;
//! assert_eq!(regions.mask_ids(), ["T1", "T2", "PET"]);
//! assert_eq!(regions.list().len(), 7);
//! let in_all = regions.get(0b111).ok_or("no voxel in all masks")?;
//! assert_eq!(regions.name(in_all.bits), "T1+T2+PET");
//!
//! // The shape drawn in mask T1 has 30.278 ml (truth.json of the sample); voxels cut its surface.
//! let report = measure::report(&case);
//! let t1 = &report.time_points[0].masks[0];
//! assert!((t1.native_volume_ml / 30.278 - 1.0).abs() < 0.002);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Further examples: [`mod@array`] (masks and images as arrays), [`measure::pairs`],
//! [`ellipsoid::ellipsoids_of`], [`change::change`] (two dates), [`files::write_nifti`].

pub mod array;
pub mod axes;
pub mod case;
pub mod change;
pub mod check;
pub mod components;
pub mod csv;
pub mod dates;
pub mod decimal;
pub mod digest;
pub mod distance;
mod eigen;
pub mod ellipsoid;
pub mod export;
pub mod files;
pub mod grid;
mod histogram;
pub mod inside_lens;
pub mod lesions;
pub mod mask;
pub mod measure;
pub mod optics;
pub mod phantom;
pub mod phrase;
pub mod progress;
pub mod regions;
pub mod register;
pub mod resample;
pub mod response;
pub mod sample;
pub mod self_check;
pub mod skeleton;
pub mod study;
pub mod surface;
pub mod tract_distance;
pub mod tracts;
pub mod transform;
pub mod tumor_index;
pub mod volume;
pub mod workers;

pub use array::{Sample, WrongShape};
pub use check::{Check, Severity};
pub use components::{Component, Components, Connectivity};
pub use grid::{Grid, GridError, Sides};
pub use mask::{Mask, MaskBits};
pub use progress::{Cancelled, Progress};
pub use regions::{Region, RegionVolume, Regions, Selection};
pub use tracts::{ScalarPer, TractScalar, Tracts};
pub use tumor_index::{IndexData, TumorIndex};
pub use volume::{Samples, Scaling, Unit, Volume};

// The versions whose types the functions here take and return.
pub use glam;
pub use ndarray;
