//! Cameras and light in `f64`, without a graphics device: what a pixel sees, how light from a cone falls
//! through matter, and the slow, exact answers that the passes on the device are compared with.

pub mod camera;
pub mod cone;
pub mod hemisphere;
pub mod march;
pub mod medium;
pub mod monte_carlo;
pub mod poisson;
pub mod random;
pub mod sight;
pub mod srgb;
#[cfg(test)]
mod tests;
pub mod volume;

pub use camera::{AnatomicalView, Camera, FIELD_OF_VIEW_DEG, Projection, Ray};
pub use sight::Sight;
