//! Shared parts of the panes of 3D views: rendered frame, progressive refinement, mouse input and lens ring.

pub mod camera_drag;
pub mod canvas;
pub mod marks;
pub mod refinement;
pub mod ring;
pub mod screen;
mod view;

pub use canvas::{Canvas, Picked};
pub use screen::{Graphics, Screen, ScreenReport};
pub use view::{View, linked_camera};
