//! What the panes of 3D views share: the picture, its refinement, mouse and lens ring.

pub mod camera_drag;
pub mod canvas;
pub mod marks;
pub mod refinement;
pub mod ring;
pub mod screen;

pub use canvas::{Canvas, Picked, View};
pub use screen::{Graphics, Screen, ScreenReport};
