//! The 3D views: one folder each, one renderer for all.

pub mod change;
pub mod closeup;
pub mod context;
pub mod ellipsoids;
mod occlusion;
#[cfg(test)]
mod test_reads;
pub mod view3d;

pub use occlusion::Occlusion;
pub use view3d::{Frame, Renderer, View3d};

/// Draws closeups.
pub type CloseupRenderer = Renderer<closeup::Closeup>;
/// Draws context views.
pub type ContextRenderer = Renderer<context::Context>;
/// Draws ellipsoid diagrams.
pub type EllipsoidRenderer = Renderer<ellipsoids::Ellipsoids>;
/// Draws change views.
pub type ChangeRenderer = Renderer<change::Change>;

/// Structs of the views' shaders, for the test of layouts.
#[cfg(test)]
pub(crate) const VIEW_LAYOUTS: &[&[crate::layouts::Layout]] =
    &[change::uniforms::LAYOUTS, context::PROJECTION_LAYOUTS, ellipsoids::LAYOUTS];
