//! From a scene to a frame: the plan of passes, the passes on wgpu, and their CPU twins.
//!
//! Knows no window and no egui. `Gpu` is made once a program, `Renderer` (pipelines) once a device,
//! a scene's buffers once an input, targets once a size.

pub mod camera;
pub mod palette;
pub mod scene;
pub mod slices;

pub use camera::{AnatomicalView, Camera, Projection, Ray};
pub use palette::{MaskColors, Palette, Rgb};
pub use scene::{Lens, Scene};
