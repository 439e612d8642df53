//! Saved state: the document and its types, the layout of panes, undo, and the session file. Independent of views.

pub mod accepted;
pub mod change;
pub mod document;
pub mod ellipsoids;
pub mod fusion;
pub mod hidden;
pub mod history;
pub mod kept;
pub mod layout;
pub mod light;
pub mod made;
pub mod masks;
pub mod overlap;
pub mod pane;
pub mod picture;
pub mod place;
pub mod rulers;
pub mod session;
mod session_limits;
mod session_names;
mod session_old;

pub use accepted::{Answer, Answers};
pub use change::{CHANGE_SCALE_MM, ChangeSetting};
pub use document::{CaseRef, Document, Edit, Navigation};
pub use ellipsoids::{ComponentOf, EllipsoidKind, EllipsoidLook, EllipsoidOpacity};
pub use fusion::{Fusion, SecondImage};
pub use hidden::HiddenRegions;
pub use history::History;
pub use light::{LightChoice, Shading};
pub use overlap::OverlapMode;
pub use pane::PaneId;
pub use picture::PictureSize;
pub use place::Place;
pub use rulers::{ExportFormat, Ruler};
pub use session::{Origin, Session};
