//! Measuring with the mouse, the same in every view: a ruler is dragged from one point to another; drawing of rulers.

use egui::{
    Align2, Id, IdSalt, Key, Painter, PointerButton, Pos2, Rect, Response, Shape as Shape2d, Stroke, Ui, vec2,
};
use glam::DVec3;
use glioscope_core::optics::Camera;

use super::{pointer, view3d::ring};
use crate::{
    command::{Commands, EditCommand},
    format,
    model::{Document, PaneId, Ruler, Shape, Tool},
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
/// world point at a position of the view, `plane` the unit vector across it where it is flat; a ruler can't start or end where it is `None`. Escape cancels. A finished
/// ruler is pushed to `out`; returns the ruler being drawn.
pub fn drag(
    ui: &Ui,
    response: &Response,
    doc: &Document,
    view: PaneId,
    (pick_at, plane): (&dyn Fn(Pos2) -> Option<DVec3>, Option<DVec3>),
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
        // Other shapes lie in a plane.
        let shape = plane.map_or(Shape::Line, |normal| Shape::drawn(doc.nav.tool, [from_mm, to_mm], normal));
        let ruler = Ruler { name, from_mm, to_mm, shape, view, time: doc.nav.time };
        out.push(EditCommand::AddRuler(Box::new(ruler)));
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
            painter.extend(Shape2d::dashed_line(&ends, Stroke::new(2.5, EDGE.gamma_multiply(0.5)), 5.0, 5.0));
            painter.extend(Shape2d::dashed_line(
                &ends,
                Stroke::new(1.2, RULER.gamma_multiply(0.75)),
                5.0,
                5.0,
            ));
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

/// What a measurement says beside it.
pub fn text_of(ruler: &Ruler) -> String {
    let length = format::length_mm(ruler.length_mm());
    match (ruler.shape.tool(), ruler.across_mm(), ruler.angle_degrees()) {
        (Tool::Diameters, Some(across), _) => {
            format!("{:.1} × {}", ruler.length_mm(), format::length_mm(across))
        }
        (Tool::Angle, _, Some(degrees)) => format!("{degrees:.1}°"),
        (Tool::Angle, ..) => "–".to_owned(),
        (Tool::Circle, ..) => format!("r {length}"),
        _ => length,
    }
}

/// Draws a measurement, with its text; `pos_of`: where a place is on the screen.
pub fn draw(painter: &Painter, ruler: &Ruler, pos_of: &dyn Fn(DVec3) -> Option<Pos2>, look: Look) {
    let segment = |ends_mm: [DVec3; 2], text: &str| {
        if let [Some(from), Some(to)] = ends_mm.map(pos_of) {
            line(painter, [from, to], look, text);
        }
    };
    let text = text_of(ruler);
    match ruler.shape {
        Shape::Line => segment([ruler.from_mm, ruler.to_mm], &text),
        Shape::Diameters { across_mm } => {
            segment(across_mm, "");
            segment([ruler.from_mm, ruler.to_mm], &text);
        }
        Shape::Angle { third_mm } => {
            segment([third_mm, ruler.to_mm], "");
            segment([ruler.from_mm, ruler.to_mm], &text);
        }
        Shape::Circle { normal } => circle(painter, ruler, normal, pos_of, look, &text),
    }
}

fn circle(
    painter: &Painter,
    ruler: &Ruler,
    normal: DVec3,
    pos_of: &dyn Fn(DVec3) -> Option<Pos2>,
    look: Look,
    text: &str,
) {
    const SIDES: usize = 64;
    let radius = ruler.to_mm - ruler.from_mm;
    let across = normal.cross(radius);
    let at = |n: usize| {
        let (sin, cos) = (n as f64 / SIDES as f64 * std::f64::consts::TAU).sin_cos();
        pos_of(ruler.from_mm + radius * cos + across * sin)
    };
    let Some(rim) = (0..=SIDES).map(at).collect::<Option<Vec<Pos2>>>() else { return };
    match look {
        Look::Solid => {
            painter.add(Shape2d::line(rim.clone(), Stroke::new(4.0, EDGE)));
            painter.add(Shape2d::line(rim.clone(), Stroke::new(2.0, RULER)));
            if let Some(at) = rim.iter().copied().reduce(|a, b| if a.y <= b.y { a } else { b }) {
                label(painter, at, text);
            }
        }
        Look::Faint => {
            let stroke = Stroke::new(1.2, RULER.gamma_multiply(0.75));
            painter.extend(Shape2d::dashed_line(&rim, stroke, 5.0, 5.0));
        }
    }
}

/// A flat view.
pub struct Flat<'a> {
    /// Where a place is on the screen.
    pub pos_of: &'a dyn Fn(DVec3) -> Pos2,
    /// The place at a position of the view; `None` outside it.
    pub place_at: &'a dyn Fn(Pos2) -> Option<DVec3>,
    /// Unit vector across its plane.
    pub normal: DVec3,
}

/// A handle that is dragged: of which measurement, and which of its handles.
type Held = (usize, usize);

/// Drags the handles of the measurements shown while the ruler is on; call it before [`drag`], every frame. `shown`: their numbers, as far as
/// their handles can be dragged here. Returns whether one is dragged.
pub fn drag_handles(
    ui: &Ui,
    response: &Response,
    (doc, shown): (&Document, &[usize]),
    Flat { pos_of, place_at, normal }: Flat<'_>,
    out: &mut Commands,
) -> bool {
    const REACH_POINTS: f32 = 8.0;
    let id = response.id.with(IdSalt::new("handle of a measurement"));
    let mut held: Option<Held> = ui.data(|data| data.get_temp(id)).flatten();
    if !doc.nav.ruler_on {
        ui.data_mut(|data| data.insert_temp(id, None::<Held>));
        return false;
    }
    let handles = || {
        let of = |index: &usize| doc.edit.rulers.get(*index).map(|ruler| (*index, ruler.handles_mm()));
        shown.iter().filter_map(of).flat_map(|(index, all)| {
            all.into_iter().enumerate().map(move |(handle, mm)| ((index, handle), mm))
        })
    };
    let near = |pos: Pos2| {
        let distance = |(held, mm): (Held, DVec3)| (held, pos_of(mm).distance(pos));
        let nearest = handles().map(distance).min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.filter(|(_, points)| *points <= REACH_POINTS).map(|(held, _)| held)
    };
    let is_pressed = response.is_pointer_button_down_on() && ui.input(|i| i.pointer.primary_down());
    let origin = ui.input(|i| i.pointer.press_origin());
    let is_released = response.drag_stopped_by(PointerButton::Primary);
    if ui.input(|i| i.pointer.primary_pressed()) && (is_pressed || is_released) {
        held = origin.and_then(near);
    }
    if !is_pressed && !is_released {
        held = None;
    }
    ui.data_mut(|data| data.insert_temp(id, held.filter(|_| is_pressed)));
    let over = response.hover_pos().and_then(near).filter(|_| !is_pressed);
    if let (Some((index, handle)), Some(pos)) = (held, response.interact_pointer_pos())
        && Some(pos) != origin
        && let Some(ruler) = doc.edit.rulers.get(index)
        && let (Some(place_mm), Some(was_mm)) = (place_at(pos), ruler.handles_mm().get(handle))
        // What lies a little off the plane of the slice stays there.
        && let Some(new) =
            ruler.with_handle_at(handle, place_mm + normal * (*was_mm - place_mm).dot(normal))
        && new != *ruler
    {
        out.push(EditCommand::SetRuler(index, Box::new(new)));
    }
    if held.or(over).is_some() {
        ui.ctx().set_cursor_icon(egui::CursorIcon::Grab);
        let painter = ui.painter().with_clip_rect(response.rect);
        let of = held.or(over).map(|(index, _)| index);
        for (_, mm) in handles().filter(|((index, _), _)| Some(*index) == of) {
            painter.circle(pos_of(mm), 4.0, RULER, Stroke::new(1.0, EDGE));
        }
    }
    held.is_some()
}

/// Draws the rulers of the time point shown over a 3D view, and the one being drawn.
pub fn draw_3d(painter: &Painter, doc: &Document, camera: &Camera, rect: Rect, draft: Option<Draft>) {
    for (_, ruler) in doc.rulers_shown() {
        draw(painter, ruler, &|mm| ring::pos_of(camera, rect, mm), Look::Solid);
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
