//! The page that a patient takes home: one HTML file that shows the outlines of a case in 3D, in slices, in true size and in
//! plain words.
//!
//! It has no identifiers: no name, no file name, no folder; names of masks and dates only where the caller gives them. It
//! makes no request, and runs no script but its own. The same case and options give the same bytes.
//!
//! Left and right are as if one stood in front of the patient: the patient's left is at the right of every picture.

mod compare;
mod content;
mod contour;
mod diagram;
mod head;
mod html;
mod levels;
mod print;
mod sentences;
mod simplify;
mod slices;
mod spoken;
mod surface;
mod text;

use std::path::Path;

use glioscope_core::{Cancelled, export::MeshError};
use glioscope_render::flat::Plane;

pub use content::content;
pub use html::page;
pub use sentences::words;
pub use spoken::{Spoken, spoken};
pub use surface::Surface;
pub use text::{Paragraph, default_text, parse};

/// Why a page can't be made.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// There is nothing to show.
    #[error("the page: found no active voxel in any mask, expected at least one")]
    Nothing,
    /// The context image that was asked for is not in the case.
    #[error("the page's image: found {0:?}, expected the name of an image of the case")]
    NoImage(String),
    /// The file has another ending.
    #[error("{0}: found a file of another kind, expected .html")]
    Ending(String),
    /// A surface can't be made.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A picture can't be encoded.
    #[error("the page's pictures: found {0}, expected a picture that can be encoded")]
    Picture(String),
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// What a page is made with beside the case.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    /// Whether the labels of the dates are on the page; else they are numbered.
    pub has_dates: bool,
    /// The image of the slices and of the outline around the masks; `None`: the first of each date.
    pub image: Option<&'a str>,
    /// Text in place of the default one.
    pub text: Option<&'a [Paragraph]>,
    /// Colour of what exactly this many masks of this many hold, sRGB: `palette::agreement_color`.
    pub agreement_color: &'a (dyn Fn(u32, usize) -> [u8; 3] + Sync),
}

/// What a page shows, as plain data.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// The masks in the order of the case: that in which it first lists their ids.
    pub masks: Vec<MaskInfo>,
    /// The dates in the order of the case, never empty.
    pub dates: Vec<Date>,
    /// A coarse outline of what the image shows around the masks: a head, or a brain without its skull.
    pub head: Option<Surface>,
    /// Whether left and right are known.
    pub has_sides: bool,
    /// Whether the order of the dates is known, so that one can be called a change since another.
    pub is_ordered: bool,
    /// Text in place of the default one.
    pub text: Option<Vec<Paragraph>>,
}

/// A mask, the same at all dates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskInfo {
    /// Its name as the caller gives it; empty: numbered.
    pub name: String,
    /// Its colour, sRGB.
    pub color: [u8; 3],
}

/// A date.
#[derive(Clone, Debug, PartialEq)]
pub struct Date {
    /// Its label; `None`: numbered.
    pub label: Option<String>,
    /// One for each of [`Page::masks`]; `None` where this date lacks the mask.
    pub masks: Vec<Option<MaskAt>>,
    /// What at least 1, 2, … masks hold, that of all last; empty where there are fewer than two masks.
    pub levels: Vec<Level>,
    /// Slices through the middle of the masks.
    pub slices: Vec<Slice>,
    /// The axial slice in which the masks are largest; `None` where they are empty.
    pub largest: Option<Slice>,
}

/// A mask at a date.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskAt {
    /// Its volume on its own grid in millilitres.
    pub volume_ml: f64,
    /// Its surface; `None` where it is empty.
    pub surface: Option<Surface>,
}

/// What at least a number of masks hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// The number of masks.
    pub count: usize,
    /// Its volume on the case grid in millilitres.
    pub volume_ml: f64,
    /// Its colour, sRGB.
    pub color: [u8; 3],
    /// Its surface; `None` where it is empty.
    pub surface: Option<Surface>,
}

/// A slice, its outlines as SVG paths in millimetres from the picture's upper left corner.
#[derive(Clone, Debug, PartialEq)]
pub struct Slice {
    /// Its plane, seen so that the patient's left is at the right; a sagittal one from the patient's left.
    pub plane: Plane,
    /// Width and height in millimetres.
    pub size_mm: [f64; 2],
    /// The image as PNG; `None` where there is none.
    pub png: Option<Vec<u8>>,
    /// The outline of each of [`Page::masks`]; empty where the slice has none.
    pub masks: Vec<String>,
    /// The outline of each of [`Date::levels`].
    pub levels: Vec<String>,
}

impl Page {
    /// The colour of a mask, sRGB; grey where there is none of this number.
    fn color(&self, n: usize) -> [u8; 3] {
        self.masks.get(n).map_or([128; 3], |mask| mask.color)
    }
}

/// Refuses a page's file of another kind than HTML.
///
/// # Errors
/// [`PageError::Ending`].
pub fn check_ending(path: &Path) -> Result<(), PageError> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let is_html = matches!(ending.as_deref(), Some("html" | "htm"));
    if is_html { Ok(()) } else { Err(PageError::Ending(path.display().to_string())) }
}

/// A number with two decimals, for SVG.
fn hundredths(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

#[cfg(test)]
mod tests;
