//! Cone-traced occlusion in a ray caster: at each sample of a ray the cone towards the eye is split
//! into sub-cones of equal solid angle, and each is marched through a pyramid of prefiltered
//! extinction at the level of its width. With more sub-cones and finer levels it comes to the integral
//! itself; at level 0 a sub-cone is an exact ray.

mod pyramid;
pub(crate) mod renderer;
mod settings;
#[cfg(test)]
mod tests;
pub mod twin;

pub use pyramid::{Level, Pyramid};
pub use renderer::ConeRenderer;
pub use settings::{ConeSettings, ConesUsed, sub_cones};
