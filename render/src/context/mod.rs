//! The context view (thesis 7.3.2): an image of the anatomy by ray casting, with the whole tumour
//! seen in it from every side.

mod frame;
pub(crate) mod image;
mod renderer;
mod scene;
#[cfg(test)]
mod tests;
pub(crate) mod uniforms;
mod volume;

pub use frame::{ContextFrame, ContextPick, PickedFiber};
pub use renderer::ContextRenderer;
pub(crate) use renderer::{LIT_MARCH, shows_image};
pub use scene::{ClipPlane, ContextScene, MOST_CLIP_PLANES, context_plan};
pub use volume::ContextVolume;
pub(crate) use volume::{BRICK, Field, Tables};
