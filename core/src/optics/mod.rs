//! Cameras and light transport in `f64`, on the CPU: rays of pixels, attenuation of a light cone in a
//! medium, and the slow, accurate references that the GPU passes are compared with.

pub mod camera;
pub mod cone;
pub mod hemisphere;
pub mod march;
pub mod medium;
pub mod monte_carlo;
pub mod poisson;
pub mod random;
pub mod scattering;
pub mod sight;
pub mod solids;
pub mod srgb;
#[cfg(test)]
mod tests;
pub mod volume;
pub mod voxels;

pub use camera::{AnatomicalView, Camera, FIELD_OF_VIEW_DEG, Projection, Ray};
pub use sight::Sight;
