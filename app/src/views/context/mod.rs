//! The context view (thesis 7.3.2): the tumour in its anatomy, seen through it from every side.

use std::sync::Arc;

use egui::{FontId, Rect, Role, Sense, Ui, WidgetInfo, vec2};
use glam::DVec3;
use glioscope_core::{RegionVolume, Sides};
use glioscope_render::{
    Camera, ContextFrame, ContextPick, ContextScene, ContextVolume, Gpu, TransferFunction, TransferPreset,
    slices::PreparedContext,
};

use super::{
    Handle, ViewContext, closeup,
    ellipsoids::Stage,
    linked::{self, Drawing, Linked, LinkedView, Picked},
    tracts::{self, TractsState},
};
use crate::{
    commands::Command,
    document::{self, Pane},
    jobs::{Derived, Lookup},
    window::waker,
};

/// The image shown, with its histograms: made when the context view or its editor is first open.
pub type VolumeJob = Derived<Handle<PreparedContext>, ContextVolume>;

/// The image shown; `None` where the slices show none.
pub fn volume<'a>(
    ui: &Ui,
    view: &ViewContext<'_>,
    wait: bool,
    job: &'a mut VolumeJob,
) -> Option<Lookup<'a, ContextVolume>> {
    let (_, image) = view.context?;
    let prepared = image.clone();
    let work = move |progress: &glioscope_core::Progress| {
        progress.say("preparing the image");
        Ok(ContextVolume::of_prepared(&prepared))
    };
    Some(job.get(Handle::of(image), wait, waker(ui.ctx()), work))
}

/// What the view remembers between frames; never saved.
#[derive(Default)]
pub struct ContextState {
    picture: LinkedView<ContextScene, ContextPick>,
    transfer: Option<Arc<TransferFunction>>,
    /// Its fibre tracts.
    pub tracts: TractsState,
}

impl ContextState {
    /// Whether the picture last drawn was in full quality.
    pub fn refined(&self) -> bool {
        self.picture.refined()
    }

    /// The scene's transfer function; the same `Arc` as long as it is the same function, so that
    /// nothing is uploaded again.
    fn transfer(&mut self, wanted: TransferFunction) -> Arc<TransferFunction> {
        match &self.transfer {
            Some(have) if **have == wanted => have.clone(),
            _ => self.transfer.insert(Arc::new(wanted)).clone(),
        }
    }
}

/// The user's transfer function of an image, or the one to begin with.
pub fn transfer_of(view: &ViewContext<'_>, id: &str, image: &PreparedContext) -> TransferFunction {
    let first = || TransferPreset::first_for(image.histogram(), id).transfer(image.histogram());
    view.doc.edit.transfers.get(id).cloned().unwrap_or_else(first)
}

/// A camera that holds the image, or without one the tumour.
fn camera(view: &ViewContext<'_>) -> Camera {
    let nav = &view.doc.nav;
    let (focus_mm, radius_mm) = match view.context {
        Some((_, image)) => {
            let (low, high) = image.volume().grid().bounds_mm();
            // Heads are round: the corners of their box may leave the picture.
            ((low + high) / 2.0, (high - low).length() * 0.36)
        }
        None => (view.doc.edit.lens.center_mm, document::tumor_radius_mm(view.time_point)),
    };
    linked::camera(&nav.camera, focus_mm, radius_mm, nav.context_zoom)
}

/// Draws the view into all of `ui` and writes what the user did to `out`.
pub fn show(
    ui: &mut Ui,
    view: &ViewContext<'_>,
    tumor: Option<&Arc<RegionVolume>>,
    stage: Stage<'_>,
    (state, job): (&mut ContextState, &mut VolumeJob),
    out: &mut Vec<Command>,
) {
    let rect = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    let Some(viewport) = stage.viewport else {
        closeup::message(ui, rect, "No graphics adapter: the context view can't be drawn.");
        return;
    };
    let mut note = None;
    let volume = match volume(ui, view, stage.refine_at_once, job) {
        Some(Lookup::Ready(volume)) => Some(volume.clone()),
        Some(Lookup::Working(_)) => {
            note = Some("Preparing the image…".to_owned());
            ui.request_repaint_after(std::time::Duration::from_millis(100));
            None
        }
        Some(Lookup::Failed(why)) => {
            note = Some(why.to_owned());
            None
        }
        None => None,
    };
    let transfer = match view.context {
        Some((id, image)) => transfer_of(view, id, image),
        None => TransferFunction::transparent(),
    };
    let transfer = state.transfer(transfer);
    let (tubes, tracts_note) = state.tracts.drawn(ui, view, stage.refine_at_once);
    let scene = ContextScene {
        volume,
        transfer,
        clip: view.doc.edit.clips.clone(),
        tumor: tumor.cloned(),
        selection: view.doc.edit.selection.clone(),
        colors: view.colors.clone(),
        lens: view.doc.active_lens(),
        tubes,
        camera: camera(view),
        background: closeup::background(ui.visuals().dark_mode),
        silhouette: [0, 0, 0],
    };
    let linked = Linked { pane: Pane::Context, camera: scene.camera, zoom: view.doc.nav.context_zoom, rect };
    let drawing = Drawing {
        gpu: &viewport.gpu,
        screen: &mut viewport.context,
        scene: &scene,
        refine_at_once: stage.refine_at_once,
        pick: |frame: &ContextFrame, gpu: &Gpu, [x, y]: [u32; 2]| frame.pick(gpu, x, y),
    };
    let Some(outcome) = state.picture.draw(ui, view, &linked, &response, drawing, out) else { return };
    let spoken = state.picture.hover().copied().map(|pick| {
        let fiber = pick.fiber.map(|fiber| state.tracts.words(ui, view, stage.refine_at_once, fiber));
        pick_text(view, &pick, fiber)
    });
    linked.say(ui, view, &response, &outcome, spoken.as_deref());
    let name = view.context.map_or("no image", |(id, _)| id);
    let ink = closeup::ink(ui.visuals().dark_mode);
    let painter = ui.painter().with_clip_rect(rect);
    let text = note.unwrap_or_else(|| name.to_owned());
    let text = painter.layout_no_wrap(text, FontId::proportional(12.0), ink);
    let words = Rect::from_min_size(rect.left_top() + vec2(10.0, 8.0), text.size());
    closeup::plate(&painter, words, ui.visuals().dark_mode);
    painter.galley(words.min, text, ink);
    tracts::list(ui, view, rect, words.bottom() + 8.0, &scene.tubes, out);
    if let Some(words) = tracts_note {
        tracts::note(ui, rect, &words);
    }
    closeup::corner_marks(ui, view, rect, (&scene.camera, "at the middle"), true);
    response.widget_info(|| {
        let under = spoken.clone().unwrap_or_else(|| "nothing under the pointer".into());
        WidgetInfo::labeled(Role::Canvas, true, format!("Context view of {name}: {under}"))
    });
}

impl Picked for ContextPick {
    fn world_mm(&self) -> DVec3 {
        self.world_mm
    }
}

fn pick_text(view: &ViewContext<'_>, pick: &ContextPick, fiber: Option<String>) -> String {
    let known = view.case.grid.sides() == Sides::Known;
    let place = glioscope_render::slices::place_label(pick.world_mm, known);
    let what = fiber.or_else(|| pick.bits.map(|bits| view.time_point.regions.name(bits)));
    what.map_or_else(|| place.clone(), |what| format!("{what}\n{place}"))
}
