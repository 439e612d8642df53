//! Registration of two images, rigid or affine: robust within a modality, by mutual information across modalities.
//!
//! [`register`] finds where each point of a fixed image lies in a moving one; [`consistency()`] tells how far repeated
//! registrations disagree at the tumour. Both work in RAS+ millimetres in `f64`, on levels of 8, 4, 2 and 1 mm whatever
//! the voxels, and compare the images in the space half way between them.
//!
//! | step | from |
//! |---|---|
//! | half-way space, Tukey's biweight on differences | Reuter, Rosas, Fischl 2010, NeuroImage 53(4) |
//! | normalised mutual information | Studholme, Hill, Hawkes 1999, Pattern Recognition 32(1) |
//! | B-spline Parzen windows, exact derivative | Thévenaz, Unser 2000; Mattes et al. 2003 |
//! | one jittered point per cell of a lattice | against the lattice's own optima: Tsao 2003; Unser, Thévenaz 2000 |
//! | BFGS | Nocedal, Wright 2006, chapter 6 |
//!
//! A bias field between two images of one modality is estimated with the pose, as the exponential of a polynomial of
//! degree 3. Mutual information has none: its bins are wide, and a smooth gain widens clusters without moving edges.
//!
//! # Limits
//! - The similarity tells that images agree, not that the transform is right: distortion, brain shift and a contrast that
//!   moves an edge are invisible to it.
//! - Swapped sides are recognised because heads aren't symmetric: the search is repeated with the moving image mirrored.
//!   Where the mirror image fits about as well there is a [`Warning::SidesUnsure`]. With a given start it isn't checked.
//! - Starts are searched up to about 30 mm and 25° from the headers' or the foregrounds' alignment, and from quarter turns of
//!   these where nothing fits well.
//! - Soft tissue bends: a leg in another position has no rigid transform, and nothing here says so.

mod consistency;
mod curve;
mod deform;
mod exclude;
#[cfg(test)]
mod internal_tests;
mod level;
mod mutual;
mod pair;
mod pose;
mod prepared;
mod pyramid;
mod quasi_newton;
mod robust;
mod rough;
mod run;
mod search;
#[cfg(test)]
mod tests;
mod types;
mod words;

pub use consistency::{Consistency, Spread, around, consistency};
pub use deform::{DeformError, DeformOptions, Deformation, deform};
pub use run::register;
pub use types::{Image, Measure, Model, Options, Outcome, RegisterError, Warning, Which};
