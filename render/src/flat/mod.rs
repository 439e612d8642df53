//! The three slice views: true axial, coronal and sagittal planes of patient space (thesis 7.4).
//!
//! Slices are resampled on the CPU: exact, testable without a GPU, and milliseconds for 512×512 pixels. Images
//! are interpolated trilinearly, masks by nearest neighbour. Nothing here draws text or lines: letters, scale bar,
//! crosshair and lens circle are returned as numbers for the caller to draw.

mod context;
mod draw;
mod fusion;
mod outline;
mod sampler;
#[cfg(test)]
mod tests;
mod view;
mod window;

pub use context::{PreparedContext, Readout, readout};
pub use draw::{ContextLayer, MaskLayer, Overlay, SliceImage, SliceLayers, SliceStyle, render_slice};
pub use fusion::{Mixing, SecondLayer};
pub use outline::OutlinePattern;
pub use view::{Convention, Plane, ScaleBar, SliceView, place_label};
pub use window::{Histogram, Preset, Window};
