//! A 3D view in its pane: its picture, and what the mouse does in it. All but the closeup follow the closeup's
//! camera: its orientation, not its position (thesis 7.3.3).

use egui::{Color32, Pos2, Rect, Response, Ui, pos2};
use glam::{DVec3, UVec2};
use glioscope_core::optics::Camera;
use glioscope_render::View3d;

use super::{
    camera_drag::{self, Outcome},
    refinement::{PART_MS, Refinement},
    screen::{Graphics, Screen, ScreenReport},
};
use crate::{
    command::{Commands, LookCommand},
    model::{Document, PaneId},
    views::draw,
};

/// Magnifications that scrolling reaches.
const ZOOMS: std::ops::RangeInclusive<f64> = 0.2..=40.0;

/// A camera with the closeup's orientation and projection, which sees a ball of `radius_mm` about
/// `focus_mm` at `zoom` 1.
pub fn linked_camera(closeup: &Camera, focus_mm: DVec3, radius_mm: f64, zoom: f64) -> Camera {
    let mut camera = Camera::fit(focus_mm, radius_mm, closeup.world_from_camera, closeup.projection);
    camera.height_mm /= zoom;
    camera
}

/// What is under a pixel of a 3D view.
pub trait Picked {
    /// Where that is, world millimetres.
    fn world_mm(&self) -> DVec3;
}

/// A 3D view as it is laid out in its pane.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The document.
    pub doc: &'a Document,
    /// Whose view it is.
    pub pane: PaneId,
    /// What it is seen with now.
    pub camera: Camera,
    /// Where the picture is.
    pub rect: Rect,
}

impl View<'_> {
    /// Hands the camera that the mouse left to the closeup, which owns it; a linked view hands on its orientation and
    /// keeps its magnification for itself.
    fn follow(&self, response: &Response, new: &Camera, out: &mut Commands) {
        if self.pane == PaneId::Closeup {
            if *new != self.camera {
                out.push(LookCommand::SetCamera(*new));
            }
            return;
        }
        if new.world_from_camera != self.camera.world_from_camera {
            let world_from_camera = new.world_from_camera;
            out.push(LookCommand::SetCamera(Camera { world_from_camera, ..self.doc.nav.camera }));
        }
        if new.height_mm != self.camera.height_mm {
            let zoom = self.doc.nav.zoom(self.pane) * self.camera.height_mm / new.height_mm;
            out.push(LookCommand::SetZoom(self.pane, zoom.clamp(*ZOOMS.start(), *ZOOMS.end())));
        }
        if response.double_clicked() {
            out.push(LookCommand::SetZoom(self.pane, 1.0));
        }
    }
}

/// A 3D view's picture and what it remembers between frames; never saved.
pub struct Canvas<V: View3d> {
    /// What draws it.
    pub screen: Screen<V>,
    refinement: Refinement<V::Scene>,
    pointer: Option<Pos2>,
    hover: Option<V::Pick>,
    /// A finer picture is under way.
    pending: bool,
}

impl<V: View3d> Default for Canvas<V> {
    fn default() -> Self {
        Self {
            screen: Screen::default(),
            refinement: Refinement::default(),
            pointer: None,
            hover: None,
            pending: false,
        }
    }
}

impl<V: View3d<Pick: Picked>> Canvas<V> {
    /// Whether the picture last drawn was in full quality.
    pub fn refined(&self) -> bool {
        self.refinement.refined() && !self.pending
    }

    /// What is under the pointer.
    pub fn hover(&self) -> Option<&V::Pick> {
        self.hover.as_ref()
    }

    /// What is under a place of the picture last drawn.
    pub fn pick(&self, graphics: &Graphics, rect: Rect, pos: Pos2) -> Option<V::Pick> {
        let (u, v) = ((pos.x - rect.left()) / rect.width(), (pos.y - rect.top()) / rect.height());
        let inside = (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v);
        let (frame, [x, y]) = self.screen.pixel(u, v).filter(|_| inside)?;
        // A device that fails is reported when the next frame is drawn.
        frame.pick(&graphics.gpu, x, y).ok().flatten()
    }

    /// Does what the mouse asks for: turns, pans, zooms, works on the lens.
    pub fn steer(
        &self,
        ui: &Ui,
        graphics: &Graphics,
        view: &View<'_>,
        response: &Response,
        out: &mut Commands,
    ) -> Outcome {
        let pick_at = |pos| self.pick(graphics, view.rect, pos).map(|pick| pick.world_mm());
        let outcome = camera_drag::interact(ui, response, view, &pick_at, out);
        view.follow(response, &outcome.camera, out);
        outcome
    }

    /// Draws `scene` and looks up what is under the pointer, where the crosshair goes. `false` where nothing could be
    /// drawn; then the pane shows why. `at_once`: no draft is shown, for pictures.
    pub fn draw(
        &mut self,
        ui: &Ui,
        (graphics, view, response): (&Graphics, &View<'_>, &Response),
        scene: &V::Scene,
        at_once: bool,
        out: &mut Commands,
    ) -> bool {
        let rect = view.rect;
        let size = rect.size() * ui.pixels_per_point();
        if size.x < 1.0 || size.y < 1.0 {
            return false;
        }
        let size = UVec2::new(size.x.round() as u32, size.y.round() as u32);
        let choice = &view.doc.edit.light;
        let now = self.refinement.quality(ui, scene, choice, at_once);
        let frames = self.screen.frames_drawn();
        let shown = match &now.in_parts {
            Some(draft) => self.screen.show_in_parts(graphics, scene, (draft, &now.quality), size, PART_MS),
            None => self.screen.show(graphics, scene, &now.quality, size, now.timed),
        };
        self.pending = now.in_parts.is_some()
            && shown.is_ok()
            && (self.screen.share_done().is_some() || self.screen.quality() != Some(&now.quality));
        if self.pending {
            ui.ctx().request_repaint();
        }
        if let Some(milliseconds) = self.screen.draw_ms() {
            self.refinement.adapt(choice, milliseconds);
        }
        if now.just_refined || (now.in_parts.is_some() && self.screen.frames_drawn() != frames) {
            // What is under a pointer that didn't move may be something else now.
            self.pointer = None;
        }
        match shown {
            Ok(texture) => {
                let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                ui.painter().image(texture, rect, whole, Color32::WHITE);
            }
            Err(error) => {
                draw::message(ui, rect, &error.to_string());
                return false;
            }
        }
        self.look_up(graphics, view, response, out);
        true
    }

    fn look_up(&mut self, graphics: &Graphics, view: &View<'_>, response: &Response, out: &mut Commands) {
        let pointer = response.hover_pos();
        if pointer == self.pointer && !response.clicked() {
            return;
        }
        self.pointer = pointer;
        self.hover =
            pointer.filter(|_| !response.dragged()).and_then(|pos| self.pick(graphics, view.rect, pos));
        if let Some(pick) = &self.hover
            && (view.doc.nav.follow_pointer || response.clicked())
        {
            out.push(LookCommand::SetCursor(pick.world_mm()));
        }
    }

    /// Over the picture: the ring where the pointer holds it, else `words` beside the pointer; and what the picture
    /// shows less of than the scene has.
    pub fn finish(
        &self,
        ui: &Ui,
        view: &View<'_>,
        response: &Response,
        outcome: &Outcome,
        words: Option<&str>,
    ) {
        camera_drag::ring_marks(ui, response, view, outcome);
        let painter = ui.painter().with_clip_rect(view.rect);
        if let (Some(pointer), Some(words), false) = (response.hover_pos(), words, outcome.ring) {
            draw::beside_pointer(&painter, view.rect, pointer, words.to_owned());
        }
        draw::warnings(ui, view.rect, self.warnings());
    }

    /// What the picture shows less of than the scene has, in words.
    pub fn warnings(&self) -> &[String] {
        self.screen.warnings()
    }

    /// What a screen reader says of the picture: `what`, what is under the pointer, and the warnings.
    pub fn spoken(&self, what: &str, under: Option<&str>) -> String {
        let mut spoken = format!("{what}: {}", under.unwrap_or("nothing under the pointer"));
        for warning in self.warnings() {
            spoken = format!("{spoken}\nWarning: {warning}");
        }
        spoken
    }
}
