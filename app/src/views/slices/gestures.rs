//! Mouse and keyboard input on a slice.

use egui::{Event, Key, MouseWheelUnit, PointerButton, Pos2, Response, Ui};
use glam::{DVec2, DVec3};
use glioscope_render::flat::Plane;

use super::{Input, Layout, shown_grid};
use crate::{
    command::{AppCommand, Commands, EditCommand, LookCommand},
    model::PaneId,
    views::pointer,
};

/// Touchpad points that count as one notch of a wheel.
const POINTS_PER_NOTCH: f32 = 40.0;
/// Range of magnification, mm per point.
const ZOOM_RANGE: (f64, f64) = (0.002, 20.0);

/// State of gestures between frames.
#[derive(Debug, Default)]
pub(super) struct GestureState {
    /// Pointer position in the last frame, where it hovered.
    hovered: Option<Pos2>,
    /// Scrolled part of a notch, below one slice.
    leftover_notches: f32,
    /// Where a drag with Alt began, which moves a date.
    grabbed: Option<Pos2>,
}

impl GestureState {
    /// Turns what the user did into commands.
    pub(super) fn interact(
        &mut self,
        ui: &Ui,
        input: &Input<'_>,
        (pane, layout): (PaneId, &Layout),
        response: &Response,
        out: &mut Commands,
    ) {
        if response.double_clicked() {
            out.push(LookCommand::ResetSlices);
            return;
        }
        let grabs_date = pointer::press_modifiers(ui.ctx()).alt && moved_date(input).is_some();
        if !input.doc.nav.ruler_on && !grabs_date {
            crosshair(ui, input, layout, response, out);
        }
        self.follow_pointer(ui, input, (pane, layout), response, out);
        if response.dragged_by(PointerButton::Secondary) {
            drag_window(input, response, out);
        }
        pan(ui, input, layout, response, out);
        if response.hovered() {
            self.scroll(ui, input, layout, out);
            zoom(ui, input, layout, response, out);
        }
        keys(ui, input, layout, response, out);
    }

    /// A drag with Alt over a slice that moves a date: its label, from where, to where. At its end the date is moved.
    pub(super) fn drag_of_date<'a>(
        &mut self,
        ui: &Ui,
        input: &Input<'a>,
        layout: &Layout,
        response: &Response,
        out: &mut Commands,
    ) -> Option<(&'a str, [Pos2; 2])> {
        let is_down = response.is_pointer_button_down_on() && ui.input(|i| i.pointer.primary_down());
        if is_down && self.grabbed.is_none() && pointer::press_modifiers(ui.ctx()).alt {
            self.grabbed = ui.input(|i| i.pointer.press_origin());
        }
        let (from, to) = (self.grabbed?, response.interact_pointer_pos());
        let ends = moved_date(input).zip(to).map(|(date, to)| (date, [from, to]));
        if is_down {
            return ends;
        }
        self.grabbed = None;
        if let Some((date, [from, to])) = ends.filter(|(_, [from, to])| from != to) {
            let shift_mm = layout.world_at(to) - layout.world_at(from);
            out.push(AppCommand::ShiftDate(date.to_owned(), shift_mm));
        }
        None
    }

    /// Shows the crosshair under a pointer that moves over the slice, until it leaves. Not while a button is pressed or
    /// the wheel turns: what is dragged or scrolled would jump.
    fn follow_pointer(
        &mut self,
        ui: &Ui,
        input: &Input<'_>,
        (pane, layout): (PaneId, &Layout),
        response: &Response,
        out: &mut Commands,
    ) {
        let pointer = response.hover_pos();
        let before = std::mem::replace(&mut self.hovered, pointer);
        let nav = &input.doc.nav;
        // One of several slices in a pane ends only its own preview.
        let is_own = before.is_some() || pane == PaneId::of_plane(layout.slice.plane);
        if pointer.is_none() && is_own && nav.preview.is_some_and(|(of, _)| of == pane) {
            out.push(LookCommand::PreviewCursor(pane, None));
        }
        let busy = ui.input(|i| {
            i.pointer.any_down() || i.smooth_scroll_delta() != egui::Vec2::ZERO || i.zoom_delta() != 1.0
        });
        let Some(pos) = pointer.filter(|_| pointer != before && !busy && nav.follow_pointer) else {
            return;
        };
        let place = layout.world_at(pos);
        if place != nav.crosshair_mm() {
            out.push(LookCommand::PreviewCursor(pane, Some(place)));
        }
    }

    fn scroll(&mut self, ui: &Ui, input: &Input<'_>, layout: &Layout, out: &mut Commands) {
        // Raw events rather than egui's smoothed sum: a notch is one slice, without delay.
        let notches: f32 = ui.input(|i| {
            let zooming = |m: &egui::Modifiers| m.ctrl || m.command;
            let wheel = |event: &Event| match event {
                Event::MouseWheel { unit, delta, modifiers, .. } if !zooming(modifiers) => Some(match unit {
                    MouseWheelUnit::Point => delta.y / POINTS_PER_NOTCH,
                    MouseWheelUnit::Line => delta.y,
                    MouseWheelUnit::Page => delta.y * 10.0,
                }),
                _ => None,
            };
            i.events.iter().filter_map(wheel).sum()
        });
        if notches == 0.0 {
            return;
        }
        // Touchpads scroll by parts of a notch: the remainder is added to the next event.
        let sum = notches + self.leftover_notches;
        let whole = sum.trunc();
        self.leftover_notches = sum - whole;
        if whole != 0.0 {
            step(input, layout, f64::from(whole), out);
        }
    }
}

fn crosshair(ui: &Ui, input: &Input<'_>, layout: &Layout, response: &Response, out: &mut Commands) {
    let primary_down = ui.input(|i| i.pointer.primary_down());
    let pressed = response.is_pointer_button_down_on() && primary_down;
    if pointer::press_modifiers(ui.ctx()).shift || !(pressed || response.clicked()) {
        return;
    }
    let Some(pos) = response.interact_pointer_pos() else { return };
    let place = layout.world_at(pos.clamp(layout.rect.min, layout.rect.max));
    if place != input.doc.nav.cursor_mm || input.doc.nav.preview.is_some() {
        out.push(LookCommand::SetCursor(place));
    }
}

/// Pans with the middle button, or with Shift and the primary button.
fn pan(ui: &Ui, input: &Input<'_>, layout: &Layout, response: &Response, out: &mut Commands) {
    // From the press on, not from where egui detects a drag: the grabbed point stays under the pointer.
    let shift = pointer::press_modifiers(ui.ctx()).shift;
    let delta = ui.input(|i| {
        let grabbed = i.pointer.button_down(PointerButton::Middle)
            || (shift && i.pointer.button_down(PointerButton::Primary));
        if grabbed && response.is_pointer_button_down_on() { i.pointer.delta() } else { egui::Vec2::ZERO }
    });
    if delta != egui::Vec2::ZERO {
        let moved_mm = DVec2::new(f64::from(delta.x), f64::from(delta.y)) * layout.mm_per_point();
        let plane = layout.slice.plane;
        out.push(LookCommand::SetPan(plane, input.doc.nav.pan_mm[plane as usize] - moved_mm));
    }
}

fn drag_window(input: &Input<'_>, response: &Response, out: &mut Commands) {
    let Some((id, image)) = input.context else { return };
    let Some(range) = image.histogram().range() else { return };
    let drag = response.drag_delta();
    if drag != egui::Vec2::ZERO {
        let Some(window) = input.window() else { return };
        let window = window.drag(f64::from(drag.x), f64::from(drag.y), range);
        // What is stored is the window of the image that this one's is matched to.
        let window =
            input.matched_to.map_or(window, |other| window.matched(image.histogram(), other.histogram()));
        out.push(EditCommand::SetWindow(id.to_owned(), window));
    }
}

/// The crosshair's coordinate along the plane's normal after a step of whole slices, at most to the outermost slice.
fn stepped_mm(input: &Input<'_>, layout: &Layout, plane: Plane, slices: f64) -> f64 {
    let grid = input.context.map_or(&input.case.grid, |(_, image)| image.volume().grid());
    let step_mm = plane.step_mm(grid);
    let axis = plane.axis();
    let (lo, hi) = (layout.bounds_mm.0[axis] + step_mm / 2.0, layout.bounds_mm.1[axis] - step_mm / 2.0);
    (input.doc.nav.crosshair_mm()[axis] + slices * step_mm).clamp(lo.min(hi), hi.max(lo))
}

/// Goes to another slice of this plane; the crosshair stays where it is within it.
fn step(input: &Input<'_>, layout: &Layout, slices: f64, out: &mut Commands) {
    let plane = layout.slice.plane;
    if layout.slice.is_turned() {
        let place_mm = turned_mm(input, layout, layout.slice.normal(), slices);
        if place_mm != input.doc.nav.crosshair_mm() {
            out.push(LookCommand::SetCursor(place_mm));
        }
        return;
    }
    let along_mm = stepped_mm(input, layout, plane, slices);
    if along_mm != input.doc.nav.crosshair_mm()[plane.axis()] {
        out.push(LookCommand::SetSlice(plane, along_mm));
    }
}

/// The date that a drag with Alt moves: that of the second image, else the one shown; never the first, whose space is the case's.
fn moved_date<'a>(input: &Input<'a>) -> Option<&'a str> {
    let first = input.case.time_points.first()?.label.as_str();
    let second = input.second.map(|second| second.time).filter(|time| *time != first);
    second.or(Some(input.time_point.label.as_str())).filter(|time| *time != first)
}

/// The crosshair moved by so many steps along a direction, within what the image's corners reach along it.
fn turned_mm(input: &Input<'_>, layout: &Layout, along: DVec3, steps: f64) -> DVec3 {
    let grid = shown_grid(input);
    let at_mm = input.doc.nav.crosshair_mm();
    let reach = grid.corners_mm().map(|corner| (corner - at_mm).dot(along));
    let (lo, hi) =
        reach.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    let step_mm = layout.slice.step_mm(grid);
    if lo > hi { at_mm } else { at_mm + along * (steps * step_mm).clamp(lo, hi) }
}

/// Zooms about the pointer: the point under it stays fixed.
fn zoom(ui: &Ui, input: &Input<'_>, layout: &Layout, response: &Response, out: &mut Commands) {
    let factor = f64::from(ui.input(egui::InputState::zoom_delta));
    let Some(pos) = response.hover_pos() else { return };
    if factor == 1.0 || factor <= 0.0 || factor.is_nan() {
        return;
    }
    let old_mm_per_point = layout.mm_per_point();
    let new_mm_per_point = (old_mm_per_point / factor).clamp(ZOOM_RANGE.0, ZOOM_RANGE.1);
    let from_middle = pos - layout.rect.center();
    let from_middle = DVec2::new(f64::from(from_middle.x), f64::from(from_middle.y));
    let plane = layout.slice.plane;
    out.push(LookCommand::SetSliceZoom(Some(new_mm_per_point)));
    out.push(LookCommand::SetPan(
        plane,
        input.doc.nav.pan_mm[plane as usize] + from_middle * (old_mm_per_point - new_mm_per_point),
    ));
}

/// Page keys step through the slices; arrow keys move the crosshair in the plane by one voxel.
fn keys(ui: &Ui, input: &Input<'_>, layout: &Layout, response: &Response, out: &mut Commands) {
    if response.has_focus() {
        let filter =
            egui::EventFilter { horizontal_arrows: true, vertical_arrows: true, ..Default::default() };
        ui.memory_mut(|memory| memory.set_focus_lock_filter(response.id, filter));
    } else if !response.hovered() || ui.memory(|memory| memory.focused().is_some()) {
        return;
    }
    let presses = |key: Key| ui.input(|i| if i.modifiers.any() { 0 } else { i.num_presses(key) }) as f64;
    let slices = presses(Key::PageUp) - presses(Key::PageDown);
    if slices != 0.0 {
        step(input, layout, slices, out);
    }
    let mut place_mm = input.doc.nav.crosshair_mm();
    for (direction, forwards, backwards) in [
        (layout.slice.right(), Key::ArrowRight, Key::ArrowLeft),
        (layout.slice.down(), Key::ArrowDown, Key::ArrowUp),
    ] {
        let steps = presses(forwards) - presses(backwards);
        if layout.slice.is_turned() {
            if steps != 0.0 {
                place_mm = turned_mm(input, layout, direction, steps);
            }
            continue;
        }
        let along = |plane: &Plane| plane.normal().dot(direction) != 0.0;
        if let Some(plane) = Plane::ALL.into_iter().find(along).filter(|_| steps != 0.0) {
            let sign = plane.normal().dot(direction);
            place_mm[plane.axis()] = stepped_mm(input, layout, plane, steps * sign);
        }
    }
    if place_mm != input.doc.nav.crosshair_mm() {
        out.push(LookCommand::SetCursor(place_mm));
    }
}
