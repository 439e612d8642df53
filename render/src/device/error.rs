//! Why a frame can't be rendered.

/// A frame that can't be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// An empty frame, or one past the device's limits.
    #[error(
        "found a picture of {}x{} pixels, expected sides of 1 to {side} pixels and at most {pixels} pixels",
        found[0], found[1]
    )]
    Size {
        /// The requested size in pixels.
        found: [u32; 2],
        /// Longest side that the device supports, pixels.
        side: u32,
        /// Most pixels that the device supports.
        pixels: u64,
    },
    /// The regions, or the context image, don't fit on the graphics device.
    #[error(
        "found a volume that needs {found} bytes in one buffer, expected at most {limit} on this graphics device"
    )]
    Volume {
        /// Bytes needed.
        found: u64,
        /// Bytes that the device allows.
        limit: u64,
    },
    /// Something else doesn't fit on the graphics device.
    #[error(
        "found {what} to need {found} bytes in one buffer, expected at most {limit} on this graphics device"
    )]
    Buffer {
        /// What is too large.
        what: &'static str,
        /// Bytes needed.
        found: u64,
        /// Bytes that the device allows.
        limit: u64,
    },
    /// Lens, camera or another part of the scene is not a number, or has no size.
    #[error("found {0}, expected finite numbers and sizes above 0")]
    Scene(String),
    /// The device failed.
    #[error("the graphics device failed: {0}")]
    Device(String),
    /// A shader of this program doesn't compose.
    #[error(transparent)]
    Shader(#[from] glioscope_shaders::ComposeError),
}
