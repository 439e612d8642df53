//! Mouse input in a 3D view: rotates, pans and zooms the camera, resizes and moves the lens, turns the lamp.

use egui::{CursorIcon, Event, IdSalt, Modifiers, MouseWheelUnit, PointerButton, Pos2, Response, Ui, Vec2};
use glam::{DVec2, DVec3};
use glioscope_core::optics::Camera;
use glioscope_render::{Lamp, Lens};

use super::{ring, view::View};
use crate::{
    command::{Commands, EditCommand},
    format,
    views::{draw, pointer},
};

/// Points per line of a wheel, as egui has.
const POINTS_PER_LINE: f32 = 40.0;

/// Effect of a drag, fixed at its start regardless of keys pressed later.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Drag {
    /// Nothing.
    #[default]
    None,
    /// Rotates the camera about its focus.
    Turn,
    /// Moves the camera parallel to the view plane.
    Pan,
    /// Changes the lens's radius.
    Ring,
    /// Moves the lens over the surface.
    Lens,
    /// Draws a ruler: see `views::ruler`.
    Ruler,
}

impl View<'_> {
    /// The lens if the pointer at `pos` would grab its ring.
    fn lens_grabbed_at(&self, pos: Pos2) -> Option<Lens> {
        let lens = self.doc.active_lens().filter(|_| !self.doc.nav.ruler_on)?;
        ring::is_near(&self.camera, self.rect, &lens, pos).then_some(lens)
    }

    /// Effect of a drag of the primary button that starts at `pos`.
    fn drag_at(&self, pos: Pos2, modifiers: Modifiers) -> Drag {
        let lens_key = modifiers.command || modifiers.ctrl;
        match () {
            () if modifiers.shift => Drag::Pan,
            () if lens_key && self.doc.edit.lens_on => Drag::Lens,
            () if modifiers.any() => Drag::None,
            () if self.doc.nav.ruler_on => Drag::Ruler,
            () if self.lens_grabbed_at(pos).is_some() => Drag::Ring,
            () => Drag::Turn,
        }
    }
}

/// Result of the mouse input in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// The camera after rotating, panning and zooming. It is the closeup's new camera; a linked view passes only
    /// `world_from_camera` to the closeup.
    pub camera: Camera,
    /// The drag in progress.
    pub drag: Drag,
    /// Whether the ring is grabbed or under the pointer, so that [`ring_marks`] highlights it.
    pub ring: bool,
}

impl Outcome {
    /// Whether the ruler is being dragged.
    pub fn measures(&self) -> bool {
        self.drag == Drag::Ruler
    }
}

/// Converts mouse input into a camera and commands for the lens. `pick_at` gives the surface point at a position of the
/// view.
pub fn interact(
    ui: &Ui,
    response: &Response,
    view: &View<'_>,
    pick_at: &dyn Fn(Pos2) -> Option<DVec3>,
    out: &mut Commands,
) -> Outcome {
    let drag_id = response.id.with(IdSalt::new("drag"));
    let modifiers = ui.input(|i| i.modifiers);
    let mut drag = ui.data(|data| data.get_temp::<Drag>(drag_id)).unwrap_or_default();
    if response.drag_started_by(PointerButton::Primary) {
        let origin = ui.input(|i| i.pointer.press_origin());
        drag = origin.map_or(Drag::None, |origin| view.drag_at(origin, pointer::press_modifiers(ui.ctx())));
    }
    let dragged = response.dragged_by(PointerButton::Primary);
    if !dragged && !response.drag_stopped_by(PointerButton::Primary) {
        drag = Drag::None;
    }
    ui.data_mut(|data| data.insert_temp(drag_id, drag));

    let mut camera = view.camera;
    let (rect, lens) = (view.rect, &view.doc.edit.lens);
    let delta = response.drag_delta();
    let height = rect.height().max(1.0);
    if drag == Drag::Turn && dragged {
        let fraction = delta / height;
        camera.turn(DVec2::new(f64::from(fraction.x), f64::from(fraction.y)));
    }
    if response.dragged_by(PointerButton::Middle) || (drag == Drag::Pan && dragged) {
        let mm_per_point = camera.height_mm / f64::from(height);
        let [right, up, _] = camera.axes();
        camera.focus_mm += (right * -f64::from(delta.x) + up * f64::from(delta.y)) * mm_per_point;
    }
    let light = &view.doc.edit.light;
    if response.dragged_by(PointerButton::Secondary) && light.has_lamp() && delta != Vec2::ZERO {
        out.push(EditCommand::SetLamp(dragged_lamp(light.lamp, delta / height)));
    }
    let pointer = response.interact_pointer_pos().filter(|_| dragged && delta != Vec2::ZERO);
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
        // At the end of the drag the camera's focus follows the lens's centre.
        out.push(EditCommand::SetLensCenter(lens.center_mm));
    }
    zoom(ui, response, view, &mut camera, out);
    let hovered = response.hover_pos().filter(|_| drag == Drag::None && !modifiers.any());
    let on_ring = hovered.filter(|pos| view.lens_grabbed_at(*pos).is_some());
    cursor(ui, response, view, drag, on_ring, modifiers);
    Outcome { camera, drag, ring: drag == Drag::Ring || on_ring.is_some() }
}

/// The lamp after a drag by these shares of the view's height: half a turn for all of it.
fn dragged_lamp(lamp: Lamp, by: Vec2) -> Lamp {
    let azimuth_deg = lamp.azimuth_deg + 180.0 * f64::from(by.x);
    Lamp {
        azimuth_deg: (azimuth_deg + 180.0).rem_euclid(360.0) - 180.0,
        elevation_deg: (lamp.elevation_deg - 180.0 * f64::from(by.y)).clamp(-90.0, 90.0),
        ..lamp
    }
}

fn zoom(ui: &Ui, response: &Response, view: &View<'_>, camera: &mut Camera, out: &mut Commands) {
    if !response.hovered() {
        return;
    }
    let [with_alt, without_alt] = [true, false].map(|alt| wheel_points(ui, alt));
    let (smooth, zoom) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
    // egui spreads a notch over several frames: what is left of one turned with Alt must not zoom when Alt is released.
    let smoothing_id = response.id.with(IdSalt::new("scrolled with Alt"));
    let smoothing = ui.data(|data| data.get_temp(smoothing_id)).unwrap_or(false);
    let smoothing = with_alt != 0.0 || (smoothing && smooth != 0.0);
    ui.data_mut(|data| data.insert_temp(smoothing_id, smoothing));
    if with_alt != 0.0 {
        let factor = f64::from(with_alt * 0.003).exp();
        out.push(EditCommand::SetLensRadius(view.doc.edit.lens.radius_mm * factor));
    }
    let scroll = if smoothing { without_alt } else { smooth };
    if scroll != 0.0 || zoom != 1.0 {
        let factor = f64::from(-scroll * 0.003).exp() / f64::from(zoom);
        camera.height_mm = (camera.height_mm * factor).clamp(0.5, 5000.0);
    }
}

/// How far the wheel was turned in this frame with Alt held, or without any key: each event with the keys held then.
fn wheel_points(ui: &Ui, with_alt: bool) -> f32 {
    ui.input(|i| {
        let points = |event: &Event| match event {
            Event::MouseWheel { unit, delta, modifiers, .. }
                if modifiers.alt == with_alt && (with_alt || !modifiers.any()) =>
            {
                Some(match unit {
                    MouseWheelUnit::Point => delta.y,
                    MouseWheelUnit::Line => delta.y * POINTS_PER_LINE,
                    MouseWheelUnit::Page => delta.y * POINTS_PER_LINE * 10.0,
                })
            }
            _ => None,
        };
        i.events.iter().filter_map(points).sum()
    })
}

/// Sets the cursor to the effect of a drag.
fn cursor(
    ui: &Ui,
    response: &Response,
    view: &View<'_>,
    drag: Drag,
    on_ring: Option<Pos2>,
    modifiers: Modifiers,
) {
    let ring_pos = on_ring.or(response.interact_pointer_pos().filter(|_| drag == Drag::Ring));
    let moves_lens = view.doc.edit.lens_on && (modifiers.command || modifiers.ctrl);
    let icon = match (drag, ring_pos) {
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

/// Draws the highlighted ring, and the lens radius beside the pointer.
pub fn ring_marks(ui: &Ui, response: &Response, view: &View<'_>, outcome: &Outcome) {
    let painter = ui.painter().with_clip_rect(view.rect);
    let lens = &view.doc.edit.lens;
    if outcome.ring {
        ring::highlight(&painter, crate::theme::Tokens::in_ui(ui).interaction, &view.camera, view.rect, lens);
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
