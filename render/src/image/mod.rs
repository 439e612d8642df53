//! The context image (anatomy): prepared for ray casting, its transfer function, and both on the device.

pub(crate) mod buffers;
pub(crate) mod tables;
pub mod transfer;
pub(crate) mod uniforms;
pub mod volume;

use glam::DVec3;
use glioscope_core::optics::Camera;
use serde::{Deserialize, Serialize};

pub use transfer::{
    ControlPoint, Form, GradientHistogram, GradientPoint, Shape, TransferFunction, TransferPreset,
    ValueHistogram,
};
pub use volume::ContextVolume;

use crate::device::PassName;

/// Ray march through the image.
pub(crate) const CONTEXT: PassName = PassName::new("context");
/// Colour and opacity by gradient magnitude: part of that pass, not timed separately.
pub(crate) const GRADIENT_OPACITY: PassName = PassName::new("gradient_opacity");

/// The most clipping planes of a scene.
pub const MOST_CLIP_PLANES: usize = 6;

/// Keeps the half-space where `normal · p <= offset_mm`. `normal` needn't have unit length, but
/// `offset_mm` then scales with it; it must be finite and not zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClipPlane {
    /// Points towards the removed half, world axes.
    pub normal: DVec3,
    /// Position of the plane along the normal.
    pub offset_mm: f64,
}

/// How an image is drawn in a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImageLook<'a> {
    pub clip: &'a [ClipPlane],
    pub camera: &'a Camera,
    /// View depth of the reference plane, from which depths are measured.
    pub reference_mm: f64,
    /// See `Quality::context_step_mm`.
    pub step_mm: f64,
    /// Whether opacity depends on the gradient.
    pub by_gradient: bool,
    /// Whether the samples of each ray are shifted by a per-pixel jitter.
    pub jitter: bool,
    pub shade: Shade,
}

/// How tissue is shaded by its gradients (Phong), where no light is computed for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shade {
    /// How much of the shading is shown: 0 none, 1 all.
    pub share: f64,
    /// Direction towards the lamp, unit length, world; `None`: the light is at the eye.
    pub lamp: Option<DVec3>,
}

impl Shade {
    /// A headlight.
    pub const HEADLIGHT: Self = Self { share: 1.0, lamp: None };
}
