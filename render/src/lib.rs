//! From a scene to a frame: the plan of passes, the passes on wgpu, and their CPU twins.
//!
//! Knows no window and no egui. `Gpu` is made once a program, `Renderer` (pipelines) once a device,
//! a scene's buffers once an input, targets once a size.

mod bricks;
pub mod camera;
#[cfg(test)]
mod closeup_tests;
mod compute;
pub mod cones;
pub mod dos;
pub mod frame;
pub mod gpu;
pub mod occlusion;
pub mod palette;
pub mod plan;
pub mod reference;
pub mod renderer;
pub mod scene;
pub mod slices;
mod targets;
#[cfg(test)]
mod testing;
mod uniforms;

pub use camera::{AnatomicalView, Camera, Projection, Ray};
pub use compute::TimeSource;
pub use frame::{Frame, Pick};
pub use gpu::{AdapterPreference, Gpu, GpuError};
pub use palette::{MaskColors, Palette, Rgb};
pub use plan::{PassName, Plan, Quality, plan};
pub use renderer::{RenderError, Renderer};
pub use scene::{Lens, Scene};
