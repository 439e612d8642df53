//! Saved state: the document and its types, the layout of panes, undo, and the session file. Independent of views.

pub mod change;
pub mod document;
pub mod ellipsoids;
pub mod history;
pub mod layout;
pub mod light;
pub mod masks;
pub mod overlap;
pub mod pane;
pub mod picture;
pub mod rulers;
pub mod session;

pub use change::ChangeSetting;
pub use document::{CaseRef, Document, Edit, Navigation};
pub use ellipsoids::{EllipsoidKind, EllipsoidLook, EllipsoidOpacity};
pub use history::History;
pub use light::LightChoice;
pub use overlap::OverlapMode;
pub use pane::PaneId;
pub use picture::PictureSize;
pub use rulers::{Ruler, RulerFormat};
