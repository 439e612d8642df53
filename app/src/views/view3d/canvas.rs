//! 3D views that follow the closeup's camera: its orientation, not its position (thesis 7.3.3).

use egui::{Color32, Pos2, Rect, Response, Ui, pos2};
use glam::{DVec3, UVec2};
use glioscope_render::{Camera, Gpu, RenderError, SceneRenderer};

use super::{
    ViewContext,
    camera_drag::{self, Outcome, View3d},
    closeup, ruler,
    still::{PART_MS, Refinement},
};
use crate::{commands::Command, document::Pane, viewport::Screen};

/// Magnifications that scrolling reaches.
const ZOOMS: std::ops::RangeInclusive<f64> = 0.2..=40.0;

/// A camera with the closeup's orientation and projection, which sees a ball of `radius_mm` about
/// `focus_mm` at `zoom` 1.
pub fn camera(closeup: &Camera, focus_mm: DVec3, radius_mm: f64, zoom: f64) -> Camera {
    let mut camera = Camera::fit(focus_mm, radius_mm, closeup.world_from_camera, closeup.projection);
    camera.height_mm /= zoom;
    camera
}

/// A linked view: its pane, its camera, its magnification and where it is.
#[derive(Clone, Copy)]
pub struct Linked {
    /// Whose magnification scrolling changes.
    pub pane: Pane,
    /// What it is seen with now.
    pub camera: Camera,
    /// Its magnification now.
    pub zoom: f64,
    /// Where the picture is.
    pub rect: Rect,
}

impl Linked {
    /// Dragging turns the closeup's camera, and with it every linked one, or works on the lens;
    /// scrolling zooms this view alone. A double click fits it again.
    pub fn interact(
        &self,
        ui: &Ui,
        view: &ViewContext<'_>,
        response: &Response,
        pick_at: &dyn Fn(Pos2) -> Option<DVec3>,
        out: &mut Vec<Command>,
    ) -> Outcome {
        let outcome = camera_drag::interact(ui, response, &self.view3d(view), pick_at, out);
        let new = outcome.camera;
        if new.world_from_camera != self.camera.world_from_camera {
            let world_from_camera = new.world_from_camera;
            out.push(Command::SetCamera(Camera { world_from_camera, ..view.doc.nav.camera }));
        }
        if new.height_mm != self.camera.height_mm {
            let zoom = self.zoom * self.camera.height_mm / new.height_mm;
            out.push(Command::SetPaneZoom(self.pane, zoom.clamp(*ZOOMS.start(), *ZOOMS.end())));
        }
        if response.double_clicked() {
            out.push(Command::SetPaneZoom(self.pane, 1.0));
        }
        outcome
    }

    fn view3d<'a>(&self, view: &ViewContext<'a>) -> View3d<'a> {
        View3d { doc: view.doc, camera: self.camera, rect: self.rect }
    }
}

/// What is under a pixel of a linked view's picture.
pub trait Picked {
    /// Where that is.
    fn world_mm(&self) -> DVec3;
}

/// A linked view's picture and what it remembers between frames; never saved.
pub struct LinkedView<S, P> {
    refinement: Refinement<S>,
    pointer: Option<Pos2>,
    hover: Option<P>,
    /// A finer picture is under way.
    coming: bool,
}

impl<S, P> Default for LinkedView<S, P> {
    fn default() -> Self {
        Self { refinement: Refinement::default(), pointer: None, hover: None, coming: false }
    }
}

/// What drawing a linked view needs.
pub struct Drawing<'a, R: SceneRenderer, F> {
    /// The device.
    pub gpu: &'a Gpu,
    /// The view's renderer.
    pub screen: &'a mut Screen<R>,
    /// What is drawn.
    pub scene: &'a R::Scene,
    /// For pictures: no draft is shown.
    pub refine_at_once: bool,
    /// What is under a pixel of a frame.
    pub pick: F,
}

impl<S: Clone + PartialEq, P: Picked> LinkedView<S, P> {
    /// Whether the picture last drawn was in full quality.
    pub fn refined(&self) -> bool {
        self.refinement.refined() && !self.coming
    }

    /// What is under the pointer.
    pub fn hover(&self) -> Option<&P> {
        self.hover.as_ref()
    }

    /// Does what the mouse asks for, draws the scene, and looks up what is under the pointer, where the
    /// crosshair goes. `None` where nothing could be drawn; then the pane says why.
    pub fn draw<R, F>(
        &mut self,
        ui: &Ui,
        view: &ViewContext<'_>,
        linked: &Linked,
        response: &Response,
        drawing: Drawing<'_, R, F>,
        out: &mut Vec<Command>,
    ) -> Option<Outcome>
    where
        R: SceneRenderer<Scene = S>,
        F: Fn(&R::Frame, &Gpu, [u32; 2]) -> Result<Option<P>, RenderError>,
    {
        let Drawing { gpu, screen, scene, refine_at_once, pick } = drawing;
        let rect = linked.rect;
        let under = |screen: &Screen<R>, pos: Pos2| {
            let (u, v) = fraction(rect, pos)?;
            let (frame, pixel) = screen.pixel(u, v)?;
            // A device that fails says so when the next frame is drawn.
            pick(frame, gpu, pixel).ok().flatten()
        };
        let outcome = {
            let pick_at = |pos| under(screen, pos).map(|p| p.world_mm());
            linked.interact(ui, view, response, &pick_at, out)
        };
        let size = rect.size() * ui.pixels_per_point();
        if size.x < 1.0 || size.y < 1.0 {
            return None;
        }
        let light = &view.doc.edit.light;
        let now = self.refinement.quality(ui, scene, light, refine_at_once);
        if now.just_refined {
            // What is under a pointer that didn't move may be something else now.
            self.pointer = None;
        }
        let size = UVec2::new(size.x.round() as u32, size.y.round() as u32);
        let frames = screen.frames_drawn;
        let shown = match &now.in_parts {
            Some(draft) => screen.show_in_parts(gpu, scene, (draft, &now.quality), size, PART_MS),
            None => screen.show(gpu, scene, &now.quality, size, now.timed),
        };
        self.coming = now.in_parts.is_some()
            && shown.is_ok()
            && (screen.share_done().is_some() || screen.quality() != Some(&now.quality));
        if self.coming {
            ui.ctx().request_repaint();
        }
        if now.in_parts.is_some() && screen.frames_drawn != frames {
            self.pointer = None;
        }
        if let Some(milliseconds) = screen.took_ms() {
            self.refinement.took(light, milliseconds);
        }
        match shown {
            Ok(texture) => {
                let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                ui.painter().image(texture, rect, whole, Color32::WHITE);
            }
            Err(error) => {
                closeup::message(ui, rect, &error);
                return None;
            }
        }
        let pointer = response.hover_pos();
        if pointer != self.pointer || response.clicked() {
            self.pointer = pointer;
            self.hover = pointer.filter(|_| !response.dragged()).and_then(|pos| under(screen, pos));
            if let Some(pick) = &self.hover
                && (view.doc.nav.follow_pointer || response.clicked())
            {
                out.push(Command::SetCursor(pick.world_mm()));
            }
        }
        Some(outcome)
    }
}

impl Linked {
    /// The ring where the pointer holds it, else `words` beside the pointer.
    pub fn say(
        &self,
        ui: &Ui,
        view: &ViewContext<'_>,
        response: &Response,
        outcome: &Outcome,
        words: Option<&str>,
    ) {
        camera_drag::ring_marks(ui, response, &self.view3d(view), outcome);
        if let (Some(pointer), Some(words), false) = (response.hover_pos(), words, outcome.ring) {
            let painter = ui.painter().with_clip_rect(self.rect);
            ruler::beside_pointer(&painter, self.rect, pointer, words.to_owned());
        }
    }
}

/// Where a place of the screen is in a picture: fractions of its width and height, inside it only.
fn fraction(rect: Rect, pos: Pos2) -> Option<(f32, f32)> {
    let (u, v) = ((pos.x - rect.left()) / rect.width(), (pos.y - rect.top()) / rect.height());
    ((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v)).then_some((u, v))
}
