//! One file or folder per pane. A pane reads the document and the case, draws, and pushes commands.

pub mod agreement;
pub mod change;
pub mod closeup;
pub mod cohort;
pub mod context;
pub mod dates;
pub mod diagnostics;
pub mod draw;
pub mod ellipsoids;
pub mod legend;
pub mod lens;
pub mod lesions;
pub mod measurements;
pub mod overlap;
pub mod pane;
pub mod pointer;
pub mod response;
pub mod ruler;
pub mod side_by_side;
pub mod slices;
pub mod transfer;
pub mod view3d;

use std::{any::Any, collections::BTreeMap, path::Path};

use egui::Ui;
use glioscope_render::{RenderError, flat::Plane};

use crate::{
    command::Commands,
    model::PaneId,
    world::{Results, jobs::Ask},
};
use pane::{Input, Pane, Stage};
use view3d::{Graphics, ScreenReport};

/// A new pane of each kind.
fn new_pane(id: PaneId) -> Box<dyn Pane> {
    match id {
        PaneId::Closeup => Box::<closeup::CloseupPane>::default(),
        PaneId::Context => Box::<context::ContextPane>::default(),
        PaneId::Ellipsoids => Box::<ellipsoids::EllipsoidPane>::default(),
        PaneId::Change => Box::<change::ChangePane>::default(),
        PaneId::Dates => Box::<dates::DatesPane>::default(),
        PaneId::Lesions => Box::<lesions::LesionsPane>::default(),
        PaneId::Response => Box::<response::ResponsePane>::default(),
        PaneId::Overlap => Box::<overlap::OverlapPane>::default(),
        PaneId::Agreement => Box::<agreement::AgreementPane>::default(),
        PaneId::Lens => Box::<lens::LensPane>::default(),
        PaneId::Measurements => Box::<measurements::MeasurementsPane>::default(),
        PaneId::Transfer => Box::<transfer::TransferPane>::default(),
        PaneId::Diagnostics => Box::<diagnostics::DiagnosticsPane>::default(),
        PaneId::SideBySide => Box::<side_by_side::SideBySidePane>::default(),
        PaneId::Axial => Box::new(slices::SlicePane::new(Plane::Axial)),
        PaneId::Coronal => Box::new(slices::SlicePane::new(Plane::Coronal)),
        PaneId::Sagittal => Box::new(slices::SlicePane::new(Plane::Sagittal)),
    }
}

/// State that all panes are drawn with.
pub struct Shared<'a> {
    /// Read-only state.
    pub input: Input<'a>,
    /// The graphics device; `None` without an adapter.
    pub graphics: Option<&'a Graphics>,
    /// Derived results, computed on request.
    pub results: &'a mut Results,
    /// How results are requested.
    pub ask: &'a Ask,
    /// The session file; results are saved beside it.
    pub session: Option<&'a Path>,
}

/// All panes. A 3D view's pipelines are compiled when it is first shown; with [`Panes::on`], the closeup's at once.
pub struct Panes(BTreeMap<PaneId, Box<dyn Pane>>);

impl Default for Panes {
    fn default() -> Self {
        Self(PaneId::all().map(|id| (id, new_pane(id))).collect())
    }
}

impl Panes {
    /// All panes, with the closeup's pipelines compiled, so that an unsuitable device is detected at the start.
    ///
    /// # Errors
    /// [`RenderError`] if the device can't run the closeup's passes.
    pub fn on(graphics: &Graphics) -> Result<Self, RenderError> {
        let mut panes = Self::default();
        panes.0.insert(PaneId::Closeup, Box::new(closeup::CloseupPane::compiled(&graphics.gpu)?));
        Ok(panes)
    }

    /// Draws one pane into all of `ui`.
    pub fn show(&mut self, ui: &mut Ui, id: PaneId, shared: &mut Shared<'_>, out: &mut Commands) {
        let Some(mut pane) = self.0.remove(&id) else { return };
        let screens = self.0.iter_mut().filter_map(|(id, pane)| Some((*id, pane.screen()?)));
        let mut stage = Stage {
            input: shared.input,
            graphics: shared.graphics,
            results: shared.results,
            ask: shared.ask,
            session: shared.session,
            screens: screens.collect(),
        };
        pane.show(ui, &mut stage, out);
        self.0.insert(id, pane);
    }

    /// Whether a pane was last drawn in its final quality.
    pub fn ready(&self, id: PaneId) -> bool {
        self.0.get(&id).is_some_and(|pane| pane.ready())
    }

    /// Report of a pane's 3D view; `None` for panes without one.
    pub fn screen(&mut self, id: PaneId) -> Option<&mut dyn ScreenReport> {
        self.0.get_mut(&id)?.screen()
    }

    /// A pane downcast to its type, for tests; `None` for another type.
    pub fn get<P: Pane>(&self, id: PaneId) -> Option<&P> {
        let pane: &dyn Any = self.0.get(&id)?.as_ref();
        pane.downcast_ref()
    }
}
