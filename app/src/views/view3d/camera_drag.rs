//! What the mouse does in a 3D view: turn, pan, zoom, change the lens, move it.

use egui::{CursorIcon, IdSalt, Modifiers, PointerButton, Pos2, Response, Ui, Vec2};
use glam::{DVec2, DVec3};
use glioscope_core::optics::Camera;
use glioscope_render::Lens;

use super::{canvas::View, ring};
use crate::{
    command::{Commands, EditCommand},
    format,
    views::draw,
};

/// What a drag does from its start to its end, whatever is pressed meanwhile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Drag {
    /// Nothing.
    #[default]
    None,
    /// Turns the camera about its focus.
    Turn,
    /// Moves the camera along its picture.
    Pan,
    /// Changes the lens's radius.
    Ring,
    /// Moves the lens over the surface.
    Lens,
    /// Draws a line: see `views::ruler`.
    Ruler,
}

impl View<'_> {
    /// Whether the pointer at `pos` would grab the lens's ring.
    fn near_ring(&self, pos: Pos2) -> Option<Lens> {
        let lens = self.doc.active_lens().filter(|_| !self.doc.nav.ruler_on)?;
        ring::is_near(&self.camera, self.rect, &lens, pos).then_some(lens)
    }

    /// What a drag of the primary button does that was begun at `pos`.
    fn begun(&self, pos: Pos2, modifiers: Modifiers) -> Drag {
        let lens_key = modifiers.command || modifiers.ctrl;
        match () {
            () if modifiers.shift => Drag::Pan,
            () if lens_key && self.doc.edit.lens_on => Drag::Lens,
            () if modifiers.any() => Drag::None,
            () if self.doc.nav.ruler_on => Drag::Ruler,
            () if self.near_ring(pos).is_some() => Drag::Ring,
            () => Drag::Turn,
        }
    }
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// The camera after turning, panning and zooming. The closeup takes it as it is; a view whose
    /// orientation is linked takes `world_from_camera` for the closeup and the rest for itself.
    pub camera: Camera,
    /// What is being dragged.
    pub drag: Drag,
    /// Whether the ring is held or under the pointer: then [`ring_marks`] has something to draw.
    pub ring: bool,
}

impl Outcome {
    /// Whether the ruler is being dragged.
    pub fn measures(&self) -> bool {
        self.drag == Drag::Ruler
    }
}

/// Turns what the mouse did into a camera and commands for the lens. `pick_at` says what surface is under
/// a place of the view.
pub fn interact(
    ui: &Ui,
    response: &Response,
    view: &View<'_>,
    pick_at: &dyn Fn(Pos2) -> Option<DVec3>,
    out: &mut Commands,
) -> Outcome {
    let memory = response.id.with(IdSalt::new("drag"));
    let modifiers = ui.input(|i| i.modifiers);
    let mut drag = ui.data(|data| data.get_temp::<Drag>(memory)).unwrap_or_default();
    if response.drag_started_by(PointerButton::Primary) {
        let origin = ui.input(|i| i.pointer.press_origin());
        drag = origin.map_or(Drag::None, |origin| view.begun(origin, modifiers));
    }
    let dragged = response.dragged_by(PointerButton::Primary);
    if !dragged && !response.drag_stopped_by(PointerButton::Primary) {
        drag = Drag::None;
    }
    ui.data_mut(|data| data.insert_temp(memory, drag));

    let mut camera = view.camera;
    let (rect, lens) = (view.rect, &view.doc.edit.lens);
    let by = response.drag_delta();
    let height = rect.height().max(1.0);
    if drag == Drag::Turn && dragged {
        let part = by / height;
        camera.turn(DVec2::new(f64::from(part.x), f64::from(part.y)));
    }
    if response.dragged_by(PointerButton::Middle) || (drag == Drag::Pan && dragged) {
        let mm_per_point = camera.height_mm / f64::from(height);
        let [right, up, _] = camera.axes();
        camera.focus_mm += (right * -f64::from(by.x) + up * f64::from(by.y)) * mm_per_point;
    }
    let pointer = response.interact_pointer_pos().filter(|_| dragged && by != Vec2::ZERO);
    if let Some(pos) = pointer {
        match drag {
            Drag::Ring => {
                let radius_mm = ring::radius_through_mm(&camera, rect, lens.center_mm, pos);
                if let Some(radius_mm) = radius_mm {
                    out.push(EditCommand::SetLensRadius(radius_mm));
                }
            }
            Drag::Lens => {
                let in_plane = || ring::in_plane_of_view_mm(&camera, rect, lens.center_mm, pos);
                out.push(EditCommand::DragLensCenter(pick_at(pos).unwrap_or_else(in_plane)));
            }
            Drag::None | Drag::Turn | Drag::Pan | Drag::Ruler => {}
        }
    }
    if drag == Drag::Lens && response.drag_stopped_by(PointerButton::Primary) {
        // Now the camera follows: the lens's centre is what it turns about.
        out.push(EditCommand::SetLensCenter(lens.center_mm));
    }
    zoom(ui, response, view, modifiers, &mut camera, out);
    let near = response.hover_pos().filter(|_| drag == Drag::None && !modifiers.any());
    let near = near.filter(|pos| view.near_ring(*pos).is_some());
    cursor(ui, response, view, drag, near, modifiers);
    Outcome { camera, drag, ring: drag == Drag::Ring || near.is_some() }
}

fn zoom(
    ui: &Ui,
    response: &Response,
    view: &View<'_>,
    modifiers: Modifiers,
    camera: &mut Camera,
    out: &mut Commands,
) {
    if !response.hovered() {
        return;
    }
    let (scroll, zoom) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
    if modifiers.alt && scroll != 0.0 {
        out.push(EditCommand::SetLensRadius(view.doc.edit.lens.radius_mm * f64::from(scroll * 0.003).exp()));
    } else if scroll != 0.0 || zoom != 1.0 {
        let factor = f64::from(-scroll * 0.003).exp() / f64::from(zoom);
        camera.height_mm = (camera.height_mm * factor).clamp(0.5, 5000.0);
    }
}

/// Shows by the pointer's shape what a drag would do.
fn cursor(
    ui: &Ui,
    response: &Response,
    view: &View<'_>,
    drag: Drag,
    near: Option<Pos2>,
    modifiers: Modifiers,
) {
    let at = near.or(response.interact_pointer_pos().filter(|_| drag == Drag::Ring));
    let moves_lens = view.doc.edit.lens_on && (modifiers.command || modifiers.ctrl);
    let icon = match (drag, at) {
        (Drag::None | Drag::Ring, Some(pos)) => {
            ring::cursor_icon(&view.camera, view.rect, &view.doc.edit.lens, pos)
        }
        (Drag::Lens, _) => CursorIcon::Move,
        (Drag::None, None) if response.hovered() && moves_lens => CursorIcon::Move,
        (Drag::None | Drag::Ruler, None) if response.hovered() && view.doc.nav.ruler_on => {
            CursorIcon::Crosshair
        }
        _ => return,
    };
    ui.ctx().set_cursor_icon(icon);
}

/// The bright ring and its radius beside the pointer, over the picture.
pub fn ring_marks(ui: &Ui, response: &Response, view: &View<'_>, outcome: &Outcome) {
    let painter = ui.painter().with_clip_rect(view.rect);
    let lens = &view.doc.edit.lens;
    if outcome.ring {
        ring::highlight(&painter, &view.camera, view.rect, lens);
    }
    let text = match outcome.drag {
        Drag::Ring => format!("lens radius {}", format::length_mm(lens.radius_mm)),
        Drag::None if outcome.ring => {
            format!("lens radius {}: drag to change it", format::length_mm(lens.radius_mm))
        }
        _ => return,
    };
    if let Some(pointer) = response.hover_pos().or(response.interact_pointer_pos()) {
        draw::beside_pointer(&painter, view.rect, pointer, text);
    }
}
