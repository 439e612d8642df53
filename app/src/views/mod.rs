//! One file for each view. A view reads the document and the world, draws, and writes commands.

pub mod camera_drag;
pub mod closeup;
pub mod diagnostics;
pub mod lens_table;
pub mod measurements;
pub mod orientation;
pub mod overlap;
pub mod ring;
pub mod ruler;
pub mod slices;

use glioscope_core::case::{Case, TimePoint};
use glioscope_render::{MaskColors, slices::PreparedContext};

use crate::document::Document;

/// What a view may read.
#[derive(Clone, Copy)]
pub struct ViewContext<'a> {
    /// What the user chose.
    pub doc: &'a Document,
    /// The case.
    pub case: &'a Case,
    /// The date shown.
    pub time_point: &'a TimePoint,
    /// Colours of its masks.
    pub colors: &'a MaskColors,
    /// The image the slices show, with its id.
    pub context: Option<(&'a str, &'a std::sync::Arc<PreparedContext>)>,
}
