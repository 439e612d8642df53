//! Measuring with the mouse, the same in every view: a ruler is dragged from one point to another; drawing of rulers.

use egui::{Align2, Id, IdSalt, Key, Painter, PointerButton, Pos2, Rect, Response, Shape, Stroke, Ui, vec2};
use glam::DVec3;
use glioscope_core::optics::Camera;

use super::{pointer, view3d::ring};
use crate::{
    command::{Commands, EditCommand},
    format,
    model::{Document, PaneId, Ruler},
    theme::{self, EDGE, PLATE, RULER, TEXT_POINTS},
};

/// A ruler being drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draft {
    /// Start point.
    pub from_mm: DVec3,
    /// Current end point; `None` if there is nothing under the pointer.
    pub to_mm: Option<DVec3>,
}

fn draft_id(response: &Response) -> Id {
    response.id.with(IdSalt::new("ruler"))
}

/// Handles drawing of a ruler with the primary button while the ruler is on; call it every frame. `pick_at` gives the
/// world point at a position of the view; a ruler can't start or end where it is `None`. Escape cancels. A finished
/// ruler is pushed to `out`; returns the ruler being drawn.
pub fn drag(
    ui: &Ui,
    response: &Response,
    doc: &Document,
    view: PaneId,
    pick_at: &dyn Fn(Pos2) -> Option<DVec3>,
    out: &mut Commands,
) -> Option<Draft> {
    let id = draft_id(response);
    let mut draft: Option<Draft> = ui.data(|data| data.get_temp(id)).flatten();
    // A drag with a modifier key has another effect.
    let plain = !pointer::press_modifiers(ui.ctx()).any();
    let (origin, pointer, moved, escape) = ui.input(|i| {
        let moved = i.pointer.delta() != egui::Vec2::ZERO;
        let origin = i.pointer.press_origin().filter(|_| plain);
        (origin, i.pointer.interact_pos(), moved, i.key_pressed(Key::Escape))
    });
    if !doc.nav.ruler_on && draft.is_none() {
        return None;
    }
    if response.drag_started_by(PointerButton::Primary) {
        let from_mm = origin.and_then(pick_at);
        draft = from_mm.map(|from_mm| Draft { from_mm, to_mm: pointer.and_then(pick_at) });
    } else if let (Some(draft), Some(pointer), true) = (&mut draft, pointer, moved) {
        draft.to_mm = pick_at(pointer);
    }
    if escape || !doc.nav.ruler_on {
        draft = None;
    }
    if response.drag_stopped_by(PointerButton::Primary)
        && let Some(Draft { from_mm, to_mm: Some(to_mm) }) = draft.take()
        && from_mm != to_mm
    {
        let name = doc.new_ruler_name();
        out.push(EditCommand::AddRuler(Box::new(Ruler { name, from_mm, to_mm, view, time: doc.nav.time })));
    }
    let pressed = response.is_pointer_button_down_on();
    let draft = draft.filter(|_| pressed);
    ui.data_mut(|data| data.insert_temp(id, draft));
    draft
}

/// How a ruler is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Solid line with end ticks and length.
    Solid,
    /// Dashed: not in the slice shown.
    Faint,
}

/// Draws a line between two screen positions, with `text` beside its middle unless it is empty or the line is faint.
pub fn line(painter: &Painter, ends: [Pos2; 2], look: Look, text: &str) {
    let [from, to] = ends;
    match look {
        Look::Solid => {
            painter.line_segment(ends, Stroke::new(4.0, EDGE));
            painter.line_segment(ends, Stroke::new(2.0, RULER));
        }
        Look::Faint => {
            painter.extend(Shape::dashed_line(&ends, Stroke::new(2.5, EDGE.gamma_multiply(0.5)), 5.0, 5.0));
            painter.extend(Shape::dashed_line(&ends, Stroke::new(1.2, RULER.gamma_multiply(0.75)), 5.0, 5.0));
        }
    }
    if look == Look::Solid {
        let across = (to - from).rot90().normalized() * 5.0;
        for end in ends {
            painter.line_segment([end - across, end + across], Stroke::new(4.0, EDGE));
            painter.line_segment([end - across, end + across], Stroke::new(2.0, RULER));
        }
        if !text.is_empty() {
            label(painter, from + (to - from) / 2.0, text);
        }
    }
}

fn label(painter: &Painter, at: Pos2, text: &str) {
    let galley = painter.layout_no_wrap(text.to_owned(), theme::font(TEXT_POINTS), RULER);
    let rect = Align2::LEFT_BOTTOM.anchor_size(at + vec2(6.0, -5.0), galley.size());
    painter.rect_filled(rect.expand2(vec2(4.0, 1.0)), 3.0, PLATE);
    painter.galley(rect.min, galley, RULER);
}

/// Draws the rulers of the time point shown over a 3D view, and the one being drawn.
pub fn draw_3d(painter: &Painter, doc: &Document, camera: &Camera, rect: Rect, draft: Option<Draft>) {
    for (_, ruler) in doc.rulers_shown() {
        let ends = [ruler.from_mm, ruler.to_mm].map(|end| ring::pos_of(camera, rect, end));
        if let [Some(from), Some(to)] = ends {
            line(painter, [from, to], Look::Solid, &format::length_mm(ruler.length_mm()));
        }
    }
    if let Some(Draft { from_mm, to_mm: Some(to_mm) }) = draft
        && let (Some(from), Some(to)) =
            (ring::pos_of(camera, rect, from_mm), ring::pos_of(camera, rect, to_mm))
    {
        line(painter, [from, to], Look::Solid, "");
    }
}

/// Text beside the pointer while a ruler is drawn.
pub fn draft_text(draft: &Draft) -> String {
    match draft.to_mm {
        Some(to_mm) => format::length_mm(draft.from_mm.distance(to_mm)),
        None => "nothing to measure to here".into(),
    }
}
