//! What a pane is, and what it may read.

use std::{any::Any, path::Path, sync::Arc};

use egui::Ui;
use glioscope_core::{
    RegionVolume, Sides,
    case::{Case, TimePoint},
};
use glioscope_render::MaskColors;

use super::view3d::screen::{Graphics, ScreenReport};
use crate::{
    command::Commands,
    model::{Document, PaneId},
    world::{Results, comparison::Compared, image::Named, jobs::Ask},
};

/// What a pane may read.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// What the user chose.
    pub doc: &'a Document,
    /// The case.
    pub case: &'a Arc<Case>,
    /// The date shown.
    pub time_point: &'a TimePoint,
    /// Its regions, cropped; `None` where no voxel is active.
    pub tumor: Option<&'a Arc<RegionVolume>>,
    /// Colours of its masks.
    pub colors: &'a MaskColors,
    /// The image the slices show, with its id.
    pub context: Option<Named<'a>>,
    /// The comparison of two dates that the document asks for, where it has been computed.
    pub compared: Option<&'a Arc<Compared>>,
}

impl Input<'_> {
    /// Whether the case tells left from right.
    pub fn sides_known(&self) -> bool {
        self.case.grid.sides() == Sides::Known
    }
}

/// What a pane draws with.
pub struct Stage<'a> {
    /// What it may read.
    pub input: Input<'a>,
    /// The graphics device; `None` without an adapter.
    pub graphics: Option<&'a Graphics>,
    /// Results it may ask for.
    pub results: &'a mut Results,
    /// How results are asked for. Those for files wait, and no draft is drawn for them.
    pub ask: &'a Ask,
    /// The session file, beside which results are kept.
    pub session: Option<&'a Path>,
    /// What the other panes' 3D views drew.
    pub screens: Vec<(PaneId, &'a mut dyn ScreenReport)>,
}

/// A pane of the window. What it remembers between frames is never saved.
pub trait Pane: Any {
    /// Draws into all of `ui` and pushes what the user did.
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands);

    /// Whether what was drawn last is final: for pictures of the window.
    fn ready(&self) -> bool {
        true
    }

    /// What its 3D view drew; `None` for panes without one.
    fn screen(&mut self) -> Option<&mut dyn ScreenReport> {
        None
    }
}
