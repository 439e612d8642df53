//! Why a picture can't be drawn.

/// A picture that can't be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// Nothing to draw on, or too much.
    #[error(
        "found a picture of {}x{} pixels, expected sides of 1 to {side} pixels and at most {pixels} pixels",
        found[0], found[1]
    )]
    Size {
        /// The size asked for.
        found: [u32; 2],
        /// Longest side that the device takes.
        side: u32,
        /// Most pixels that the device takes.
        pixels: u64,
    },
    /// The regions, or the context image, don't fit on the card.
    #[error(
        "found a volume that needs {found} bytes in one buffer, expected at most {limit} on this graphics device"
    )]
    Volume {
        /// Bytes needed.
        found: u64,
        /// Bytes that the device takes.
        limit: u64,
    },
    /// Something else doesn't fit on the card.
    #[error(
        "found {what} to need {found} bytes in one buffer, expected at most {limit} on this graphics device"
    )]
    Buffer {
        /// What is too large.
        what: &'static str,
        /// Bytes needed.
        found: u64,
        /// Bytes that the device takes.
        limit: u64,
    },
    /// Lens, camera or another part of the scene is not a number, or has no size.
    #[error("found {0}, expected finite numbers and sizes above 0")]
    Scene(String),
    /// The device failed.
    #[error("the graphics device failed: {0}")]
    Device(String),
    /// A shader of ours does not compose.
    #[error(transparent)]
    Shader(#[from] glioscope_shaders::ComposeError),
}
