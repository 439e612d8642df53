//! Camera and geometry of a 3D view. All views except the closeup follow the orientation of the closeup's camera, not
//! its position (thesis 7.3.3).

use egui::{Rect, Response};
use glam::DVec3;
use glioscope_core::optics::Camera;

use crate::{
    command::{Commands, LookCommand},
    model::{Document, PaneId},
};

/// Range of magnification by scrolling.
const ZOOM_RANGE: std::ops::RangeInclusive<f64> = 0.2..=40.0;

/// A camera with the closeup's orientation and projection that fits a ball of `radius_mm` about `focus_mm` at `zoom` 1.
pub fn linked_camera(closeup: &Camera, focus_mm: DVec3, radius_mm: f64, zoom: f64) -> Camera {
    let mut camera = Camera::fit(focus_mm, radius_mm, closeup.world_from_camera, closeup.projection);
    camera.height_mm /= zoom;
    camera
}

/// Camera and geometry of a 3D view in its pane.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The document.
    pub doc: &'a Document,
    /// The view's pane.
    pub pane: PaneId,
    /// The current camera.
    pub camera: Camera,
    /// Rectangle of the view.
    pub rect: Rect,
}

impl View<'_> {
    /// The camera of the next frame after the mouse moved this one's to `new`. A linked view takes its orientation alone: its focus is
    /// the tumour's, and its zoom has limits.
    pub(super) fn moved(&self, new: &Camera) -> Camera {
        match self.pane {
            PaneId::Closeup => *new,
            _ => Camera { world_from_camera: new.world_from_camera, ..self.camera },
        }
    }

    /// Pushes the changes of the camera by the mouse: the closeup sets its own camera; a linked view sets the
    /// orientation of the closeup's camera and its own zoom.
    pub(super) fn push_camera(&self, response: &Response, new: &Camera, out: &mut Commands) {
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
            out.push(LookCommand::SetZoom(self.pane, zoom.clamp(*ZOOM_RANGE.start(), *ZOOM_RANGE.end())));
        }
        if response.double_clicked() {
            out.push(LookCommand::SetZoom(self.pane, 1.0));
        }
    }
}
