//! Registration of two images, rigid or affine: robust within a modality, by mutual information across modalities.

mod consistency;
mod curve;
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

pub use consistency::{Consistency, Spread, consistency};
pub use run::register;
pub use types::{Image, Measure, Model, Options, Outcome, RegisterError, Warning, Which};
