//! Directional occlusion shading by slices (Schott et al. 2009), front to back: the paper's own form,
//! and one mended so that the picture doesn't depend on the slice distance.

mod folded;
mod plan;
mod renderer;
#[cfg(test)]
mod stability_tests;
#[cfg(test)]
pub(crate) mod tests;
pub mod twin;
pub(crate) mod uniforms;

pub use plan::{DosPlan, DosSettings, Kernel, MOST_SLICES, Step, Variant, disc_points};
pub use renderer::{DosRenderer, Form};
