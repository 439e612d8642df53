//! The trait of panes, and what a pane may read and draw with.

use std::{any::Any, path::Path, sync::Arc};

use egui::Ui;
use glioscope_core::{
    Grid, RegionVolume, Selection, Sides,
    case::{Case, TimePoint},
};
use glioscope_render::{
    MaskColors,
    flat::{PreparedContext, Window},
};

use super::view3d::screen::{Graphics, ScreenReport};
use crate::{
    command::Commands,
    model::{Document, PaneId},
    world::{Results, Second, comparison::Comparison, image::NamedImage, jobs::Ask},
};

/// One of the case's dates, for panes that show several.
pub struct DateInput<'a> {
    /// The time point.
    pub time_point: &'a TimePoint,
    /// Its regions that are shown.
    pub selection: Selection,
    /// Colours of its masks.
    pub colors: MaskColors,
    /// Its images, in the order of its contexts.
    pub images: &'a [Arc<PreparedContext>],
}

/// Read-only state for drawing a pane.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The user's choices.
    pub doc: &'a Document,
    /// The case.
    pub case: &'a Arc<Case>,
    /// All dates; empty where no pane shown needs them.
    pub dates: &'a [DateInput<'a>],
    /// Number of the time point shown.
    pub time: usize,
    /// The time point shown.
    pub time_point: &'a TimePoint,
    /// Its regions that are shown.
    pub selection: &'a Selection,
    /// Its regions, cropped to their bounding box; `None` if no voxel is active.
    pub tumor: Option<&'a Arc<RegionVolume>>,
    /// Colours of its masks.
    pub colors: &'a MaskColors,
    /// The image the slices show, with its id.
    pub context: Option<NamedImage<'a>>,
    /// The image of another date that the window of the image is matched to; `None`: it has its own.
    pub matched_to: Option<&'a Arc<PreparedContext>>,
    /// The grid that slices fit; `None`: the image's.
    pub fit_grid: Option<&'a Grid>,
    /// The second image that the slices show.
    pub second: Option<Second<'a>>,
    /// The mask that slices show alone, by its number, whatever is hidden; `None`: what is selected.
    pub only_mask: Option<usize>,
    /// Whether views are drawn without controls, and without names of files: for explaining.
    pub is_plain: bool,
    /// Whether views are drawn without controls: for a picture on paper.
    pub is_picture: bool,
    /// The comparison of two time points chosen in the document; `None` until it is computed.
    pub compared: Option<&'a Arc<Comparison>>,
}

impl Input<'_> {
    /// Whether left and right are known in the case.
    pub fn sides_known(&self) -> bool {
        self.case.grid.sides() == Sides::Known
    }

    /// Whether the window of the image shown is that of another date's, matched by percentiles.
    pub fn is_window_matched(&self) -> bool {
        let (Some(other), Some((id, image))) = (self.matched_to, self.context) else { return false };
        let is_ct = other.histogram().looks_like_ct() || image.histogram().looks_like_ct();
        !is_ct && self.window().is_some_and(|window| window != self.doc.window_of(id, other))
    }

    /// The window of the image shown.
    pub fn window(&self) -> Option<Window> {
        let (id, image) = self.context?;
        Some(match self.matched_to {
            Some(other) => self.doc.window_of(id, other).matched(other.histogram(), image.histogram()),
            None => self.doc.window_of(id, image),
        })
    }
}

/// Everything a pane is drawn with.
pub struct Stage<'a> {
    /// Read-only state.
    pub input: Input<'a>,
    /// The graphics device; `None` without an adapter.
    pub graphics: Option<&'a Graphics>,
    /// Derived results, computed on request.
    pub results: &'a mut Results,
    /// How results are requested. For picture files they are waited for, and no draft is drawn.
    pub ask: &'a Ask,
    /// The session file; results are saved beside it.
    pub session: Option<&'a Path>,
    /// Reports of the other panes' 3D views.
    pub screens: Vec<(PaneId, &'a mut dyn ScreenReport)>,
}

/// A pane of the window. Its own state lasts between frames and is never saved.
pub trait Pane: Any {
    /// Draws the pane into all of `ui` and pushes the user's commands.
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands);

    /// Whether the pane was last drawn in its final quality; screenshots wait for it.
    fn ready(&self) -> bool {
        true
    }

    /// Report of its 3D view; `None` for panes without one.
    fn screen(&mut self) -> Option<&mut dyn ScreenReport> {
        None
    }
}
