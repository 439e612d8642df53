//! 3D views that follow the closeup's camera: its orientation, not its position (thesis 7.3.3).

use egui::{Pos2, Rect, Response, Ui};
use glam::DVec3;
use glioscope_render::Camera;

use super::{
    ViewContext,
    camera_drag::{self, Outcome, View3d},
};
use crate::{commands::Command, document::Pane};

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

    /// The ring where the pointer holds it.
    pub fn marks(&self, ui: &Ui, view: &ViewContext<'_>, response: &Response, outcome: &Outcome) {
        camera_drag::ring_marks(ui, response, &self.view3d(view), outcome);
    }

    fn view3d<'a>(&self, view: &ViewContext<'a>) -> View3d<'a> {
        View3d { doc: view.doc, camera: self.camera, rect: self.rect }
    }
}

/// Where a place of the screen is in a picture: fractions of its width and height, inside it only.
pub fn fraction(rect: Rect, pos: Pos2) -> Option<(f32, f32)> {
    let (u, v) = ((pos.x - rect.left()) / rect.width(), (pos.y - rect.top()) / rect.height());
    ((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v)).then_some((u, v))
}
