//! Cameras that follow the closeup's: its orientation, not its position (thesis 7.3.3).

use egui::{PointerButton, Rect, Ui};
use glam::{DVec2, DVec3};
use glioscope_render::Camera;

use super::ViewContext;
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

/// Dragging turns the closeup's camera, and with it every linked one; scrolling zooms this view.
pub fn interact(
    ui: &Ui,
    view: &ViewContext<'_>,
    response: &egui::Response,
    rect: Rect,
    (pane, zoom): (Pane, f64),
    out: &mut Vec<Command>,
) {
    let modifiers = ui.input(|i| i.modifiers);
    if response.dragged_by(PointerButton::Primary) && !modifiers.any() {
        let drag = response.drag_delta() / rect.height().max(1.0);
        let mut camera = view.doc.nav.camera;
        camera.turn(DVec2::new(f64::from(drag.x), f64::from(drag.y)));
        if camera != view.doc.nav.camera {
            out.push(Command::SetCamera(camera));
        }
    }
    if response.hovered() && !modifiers.alt {
        let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
        if scroll != 0.0 || pinch != 1.0 {
            let factor = f64::from(scroll * 0.003).exp() * f64::from(pinch);
            out.push(Command::SetPaneZoom(pane, (zoom * factor).clamp(*ZOOMS.start(), *ZOOMS.end())));
        }
    }
    if response.double_clicked() {
        out.push(Command::SetPaneZoom(pane, 1.0));
    }
}
