//! An image of the anatomy: made ready for ray casting, its transfer function, and both on the device.

pub(crate) mod buffers;
pub mod transfer;
pub(crate) mod uniforms;
pub mod volume;

use glam::DVec3;
use glioscope_core::optics::Camera;
use serde::{Deserialize, Serialize};

pub use transfer::{
    ControlPoint, GradientHistogram, GradientPoint, TransferFunction, TransferPreset, ValueHistogram,
};
pub use volume::ContextVolume;

use crate::device::PassName;

/// Ray march through the image.
pub(crate) const CONTEXT: PassName = PassName::new("context");
/// Its opacity by gradient magnitude: a part of that pass, without a time of its own.
pub(crate) const GRADIENT_OPACITY: PassName = PassName::new("gradient_opacity");

/// The most clipping planes of a scene.
pub const MOST_CLIP_PLANES: usize = 6;

/// Keeps the half of space where `normal · p <= offset_mm`. `normal` need not be of unit length, but
/// then `offset_mm` is in its lengths too; it must be finite and not zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClipPlane {
    /// Points to what is cut away, world axes.
    pub normal: DVec3,
    /// Where the plane is along it.
    pub offset_mm: f64,
}

/// How an image is seen in a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImageLook<'a> {
    pub clip: &'a [ClipPlane],
    pub camera: &'a Camera,
    /// View depth of the plane that depths are counted from.
    pub reference_mm: f64,
    /// See `Quality::context_step_mm`.
    pub step_mm: f64,
    /// Whether the gradient's opacity counts.
    pub by_gradient: bool,
    /// Whether samples of neighbouring rays are shifted.
    pub jitter: bool,
}
