//! The graphics device: adapter and queue, buffers, pipelines, running and timing passes, readback. Knows no scene
//! and no view.

pub(crate) mod buffers;
pub mod error;
pub mod gpu;
pub(crate) mod pass;
pub(crate) mod pipelines;
pub(crate) mod raster;
pub(crate) mod readback;
pub(crate) mod runner;

pub use error::RenderError;
pub use gpu::{AdapterPreference, Gpu, GpuError};
pub use pass::PassName;
pub use runner::TimeSource;
