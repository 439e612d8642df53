//! One file for each view. A view reads the document and the world, draws, and writes commands.

pub mod camera_drag;
pub mod change;
pub mod closeup;
pub mod context;
pub mod dates;
pub mod diagnostics;
pub mod ellipsoids;
pub mod lens_table;
pub mod linked;
pub mod measurements;
pub mod orientation;
pub mod overlap;
pub mod plane;
pub mod ring;
pub mod ruler;
pub mod slices;
pub mod still;
pub mod tracts;
pub mod transfer;

use std::sync::{Arc, Weak};

use glioscope_core::case::{Case, TimePoint};
use glioscope_render::{MaskColors, slices::PreparedContext};

use crate::{comparing::Compared, document::Document};

/// What a view may read.
#[derive(Clone, Copy)]
pub struct ViewContext<'a> {
    /// What the user chose.
    pub doc: &'a Document,
    /// The case.
    pub case: &'a Arc<Case>,
    /// The date shown.
    pub time_point: &'a TimePoint,
    /// Colours of its masks.
    pub colors: &'a MaskColors,
    /// The image the slices show, with its id.
    pub context: Option<(&'a str, &'a Arc<PreparedContext>)>,
    /// The comparison of two dates that the document asks for, where it has been computed.
    pub compared: Option<&'a Arc<Compared>>,
}

/// Which volume or case it was, without keeping it alive: what results are kept under.
#[derive(Debug)]
pub struct Handle<T>(Weak<T>);

impl<T> Handle<T> {
    /// The handle of what `of` holds.
    pub fn of(of: &Arc<T>) -> Self {
        Self(Arc::downgrade(of))
    }
}

impl<T> Clone for Handle<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> PartialEq for Handle<T> {
    fn eq(&self, other: &Self) -> bool {
        self.0.ptr_eq(&other.0)
    }
}
