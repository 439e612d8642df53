//! Drawing of the ring: fills, borders, labels.

use egui::{Align2, Color32, Id, Pos2, Rect, Shape, Stroke, Ui, epaint::Mesh, pos2, vec2};

use super::{
    OverlapInput, Shown, Target,
    interact::{self, FocusArea, Interaction},
    paint::{self, Style},
    ring::{GAP_PT, Piece, RingLayout, Segment, point},
};
use crate::theme::{self, LABEL_POINTS};
use crate::{command::Commands, format};

/// Margins for labels: left and right of the ring, and above and below it, points.
const LABEL_MARGINS_PT: [f32; 2] = [44.0, 20.0];

/// Draws the ring of `pieces` into `rect` and handles mouse and keyboard. `marked`: the target under the cursor in the
/// table.
pub fn show(
    ui: &Ui,
    id: Id,
    rect: Rect,
    pieces: &[Piece],
    input: &OverlapInput<'_>,
    marked: Option<Target>,
    out: &mut Commands,
) -> Interaction {
    let (layout, center) = &fit(pieces, rect);
    let center = *center;
    let hit = |p: Pos2| layout.hit(f64::from(p.x - center.x), f64::from(p.y - center.y));
    let interaction = interact::clickable_pieces(ui, id, rect, &focus_areas(layout, center), hit, input, out);
    let style = Style::of(ui);
    let marked = interaction.hovered.or(marked);
    fills(ui, layout, center, input, &style);
    borders(ui, layout, center, input, &style, marked, interaction.focused);
    labels(ui, rect, layout, center, input);
    interaction
}

/// The largest ring of `pieces` that fits into `rect` with its labels, and its centre, which is shifted so that the
/// painted area is centred.
pub fn fit(pieces: &[Piece], rect: Rect) -> (RingLayout, Pos2) {
    let margins =
        vec2(LABEL_MARGINS_PT[0].min(rect.width() * 0.19), LABEL_MARGINS_PT[1].min(rect.height() * 0.1));
    let inside = rect.shrink2(margins);
    let mut radius = f64::from(inside.size().min_elem() / 2.0);
    let mut layout = RingLayout::new(pieces, radius);
    for _ in 0..4 {
        let size = extent(&layout).size();
        let scale = (inside.width() / size.x.max(1.0)).min(inside.height() / size.y.max(1.0));
        radius *= f64::from(scale);
        layout = RingLayout::new(pieces, radius);
    }
    let center = inside.center() - extent(&layout).center().to_vec2();
    (layout, center)
}

/// Bounding box of the painted area with borders; the ring's centre is (0, 0).
fn extent(layout: &RingLayout) -> Rect {
    let mut bounds = Rect::NOTHING;
    for s in &layout.segments {
        for p in paint::arc(Pos2::ZERO, s.from_rad, s.to_rad, layout.outer_radius(s) + GAP_PT) {
            bounds.extend_with(p);
        }
    }
    // The inner edge of the ring, or the circle without one.
    let core = layout.layers.first().map_or_else(|| layout.disc.as_ref().map_or(0.0, |d| d.radius), |l| l.0);
    let core = (core + GAP_PT) as f32;
    bounds.union(Rect::from_center_size(Pos2::ZERO, vec2(2.0 * core, 2.0 * core)))
}

fn focus_areas(layout: &RingLayout, center: Pos2) -> Vec<FocusArea> {
    let ring = layout.segments.iter().map(|s| {
        let (inner, outer) = layout.layers.first().copied().unwrap_or((0.0, 0.0));
        let middle = (inner + outer) / 2.0;
        let [x, y] = point((s.from_rad + s.to_rad) / 2.0, middle);
        let side = ((s.to_rad - s.from_rad) * middle).min(outer - inner).clamp(2.0, 24.0) * 0.7;
        FocusArea { target: s.piece.target, rect: square(center + vec2(x as f32, y as f32), side) }
    });
    let disc = layout
        .disc
        .iter()
        .map(|d| FocusArea { target: d.piece.target, rect: square(center, d.radius.clamp(2.0, 40.0)) });
    ring.chain(disc).collect()
}

fn square(center: Pos2, side: f64) -> Rect {
    Rect::from_center_size(center, vec2(side as f32, side as f32))
}

fn fills(ui: &Ui, layout: &RingLayout, center: Pos2, input: &OverlapInput<'_>, style: &Style) {
    // The dark casing first, wide enough to be under every border.
    let mut mesh = Mesh::default();
    let casing_pt = GAP_PT;
    for s in &layout.segments {
        let (from, to) = cell(layout, s);
        let radii =
            [layout.layers.first().map_or(0.0, |l| l.0) - casing_pt, layout.outer_radius(s) + casing_pt];
        let widening = if layout.gap_rad > 0.0 { casing_pt / 2.0 } else { 0.0 };
        paint::ring_part(&mut mesh, center, [from, to], radii, widening, style.casing, style.pixel);
    }
    if let Some(d) = &layout.disc {
        let span = [0.0, std::f64::consts::TAU];
        paint::ring_part(
            &mut mesh,
            center,
            span,
            [0.0, d.radius + casing_pt],
            0.0,
            style.casing,
            style.pixel,
        );
    }
    for s in &layout.segments {
        let shown = input.drawn_visibility(s.piece.target);
        for (&mask, &(inner, outer)) in s.piece.masks.iter().zip(&layout.layers) {
            let color = style.fill(input.colors.mask(mask), shown);
            paint::ring_part(
                &mut mesh,
                center,
                [s.from_rad, s.to_rad],
                [inner, outer],
                0.0,
                color,
                style.pixel,
            );
        }
    }
    if let Some(d) = &layout.disc {
        let shown = input.drawn_visibility(d.piece.target);
        let sector = std::f64::consts::TAU / d.piece.masks.len() as f64;
        for (i, &mask) in d.piece.masks.iter().enumerate() {
            let span = [(i as f64 - 0.5) * sector, (i as f64 + 0.5) * sector];
            let color = style.fill(input.colors.mask(mask), shown);
            paint::ring_part(&mut mesh, center, span, [0.0, d.radius], 0.0, color, style.pixel);
        }
    }
    ui.painter().add(Shape::mesh(mesh));
}

/// From the middle of the gap before a segment to the middle of the gap after it.
fn cell(layout: &RingLayout, s: &Segment) -> (f64, f64) {
    (s.from_rad - layout.gap_rad / 2.0, s.to_rad + layout.gap_rad / 2.0)
}

fn borders(
    ui: &Ui,
    layout: &RingLayout,
    center: Pos2,
    input: &OverlapInput<'_>,
    style: &Style,
    marked: Option<Target>,
    focused: Option<Target>,
) {
    // Drawn in the order hidden, shown, marked: a border between two segments has the style of the stronger one.
    let mut lines: Vec<(u8, Vec<Shape>)> = Vec::new();
    let strength = |target: Target| {
        if marked == Some(target) || focused == Some(target) {
            2
        } else {
            u8::from(input.drawn_visibility(target) != Shown::None)
        }
    };
    let stroke = |strength: u8| match strength {
        2 => style.marked,
        1 => style.shown,
        _ => style.hidden,
    };
    let half_gap = GAP_PT / 2.0;
    let count = layout.segments.len();
    for (i, s) in layout.segments.iter().enumerate() {
        let level = strength(s.piece.target);
        let (from, to) = cell(layout, s);
        let inner = layout.layers.first().map_or(0.0, |l| l.0) - half_gap;
        let arcs = [inner, layout.outer_radius(s) + half_gap]
            .map(|radius| Shape::line(paint::arc(center, from, to, radius), stroke(level)));
        lines.push((level, arcs.into()));
        if count < 2 {
            continue;
        }
        let next = &layout.segments[(i + 1) % count];
        let next_level = strength(next.piece.target);
        for (layer, &(inner, outer)) in layout.layers.iter().enumerate() {
            let mask = s.piece.masks.get(layer);
            let next_mask = next.piece.masks.get(layer);
            let level = match (mask, next_mask) {
                (Some(_), Some(_)) => level.max(next_level),
                (Some(_), None) => level,
                (None, Some(_)) => next_level,
                (None, None) => continue,
            };
            let ends = [inner - half_gap, outer + half_gap].map(|r| {
                let [x, y] = point(to, r);
                center + vec2(x as f32, y as f32)
            });
            // Two segments share two boundaries; each is drawn once.
            let shapes = if mask == next_mask {
                stippled(ends, stroke(level))
            } else {
                vec![line(ends, stroke(level))]
            };
            lines.push((level, shapes));
        }
    }
    if let Some(d) = &layout.disc {
        let level = strength(d.piece.target);
        lines.push((level, vec![Shape::circle_stroke(center, (d.radius + half_gap) as f32, stroke(level))]));
    }
    lines.sort_by_key(|l| l.0);
    ui.painter().extend(lines.into_iter().flat_map(|l| l.1));
}

fn line(ends: [Pos2; 2], stroke: Stroke) -> Shape {
    Shape::line_segment(ends, stroke)
}

fn stippled(ends: [Pos2; 2], stroke: Stroke) -> Vec<Shape> {
    Shape::dashed_line(&ends, stroke, 3.5, 3.5)
}

/// Names and sizes beside the segments, largest segment first. Where there is no room beside a segment, its label stands
/// at the nearest free place of the left or right edge, with a line to it; a label that fits nowhere is left out.
fn labels(ui: &Ui, rect: Rect, layout: &RingLayout, center: Pos2, input: &OverlapInput<'_>) {
    let font = theme::font(LABEL_POINTS);
    let mut occupied: Vec<Rect> = Vec::new();
    let mut order: Vec<&Segment> = layout.segments.iter().collect();
    order.sort_by_key(|s| std::cmp::Reverse(s.piece.voxels));
    for s in order {
        let text = format!("{}\n{}", input.title(s.piece.target), format::ml(input.ml(s.piece.target)));
        let color = label_color(ui, input.drawn_visibility(s.piece.target));
        let galley = ui.painter().layout_no_wrap(text, font.clone(), color);
        let place = [0.5, 0.35, 0.65, 0.2, 0.8].into_iter().find_map(|t| {
            let angle = s.from_rad + t * (s.to_rad - s.from_rad);
            let place = beside(rect, center, angle, layout.outer_radius(s), galley.size());
            let free = !occupied.iter().any(|other| other.expand(1.0).intersects(place));
            (free && rect.contains_rect(place) && !over_ring(layout, center, place)).then_some(place)
        });
        let on = |radius: f64| {
            let [x, y] = point((s.from_rad + s.to_rad) / 2.0, radius);
            center + vec2(x as f32, y as f32)
        };
        let place = place.or_else(|| {
            let edge = on(layout.outer_radius(s) + 2.0 * GAP_PT);
            let line = |place: &Rect| [place.clamp(edge), edge];
            // What is cheap to tell first.
            let free = |place: &Rect| {
                !occupied.iter().any(|other| other.expand(1.0).intersects(*place))
                    && !over_ring(layout, center, *place)
                    && !line_over_ring(layout, center, line(place))
                    && !occupied.iter().any(|other| crosses(line(place), other.expand(1.0)))
            };
            let place = at_edges(rect, galley.size())
                .filter(free)
                .min_by(|a, b| a.distance_to_pos(edge).total_cmp(&b.distance_to_pos(edge)))?;
            ui.painter().line_segment(line(&place), Stroke::new(1.0, paint::dim_text(ui)));
            Some(place)
        });
        if let Some(place) = place {
            occupied.push(place);
            ui.painter().galley(place.min, galley, color);
        }
    }
    if let Some(d) = &layout.disc {
        let name = input.name(d.piece.target);
        let line = format!("middle: {name}, {}", format::ml(input.ml(d.piece.target)));
        let at = pos2(rect.left() + 2.0, rect.bottom() - 1.0);
        let galley =
            ui.painter().layout_no_wrap(line, font, label_color(ui, input.drawn_visibility(d.piece.target)));
        let place = Align2::LEFT_BOTTOM.anchor_size(at, galley.size());
        if !occupied.iter().any(|other| other.intersects(place)) && !over_ring(layout, center, place) {
            ui.painter().galley(place.min, galley, Color32::PLACEHOLDER);
        }
    }
}

/// Places for a label of this size at the left and right edges of `rect`.
fn at_edges(rect: Rect, size: egui::Vec2) -> impl Iterator<Item = Rect> {
    let rows = ((rect.height() - size.y) / (size.y / 2.0)).max(0.0) as usize + 1;
    (0..rows).flat_map(move |row| {
        let y = rect.top() + row as f32 * size.y / 2.0;
        [rect.left(), rect.right() - size.x].map(|x| Rect::from_min_size(pos2(x, y), size))
    })
}

/// Rectangle of a label of this size outside `radius`: beyond the tangent at `angle`, shifted to stay within `rect`.
fn beside(rect: Rect, center: Pos2, angle: f64, radius: f64, size: egui::Vec2) -> Rect {
    let [x, y] = point(angle, radius + GAP_PT + 2.5);
    let outwards = vec2(angle.sin() as f32, -angle.cos() as f32);
    let reach = (outwards.abs() * size).x / 2.0 + (outwards.abs() * size).y / 2.0;
    let place = Rect::from_center_size(center + vec2(x as f32, y as f32) + outwards * reach, size);
    let shift = (rect.min - place.min).max(egui::Vec2::ZERO) - (place.max - rect.max).max(egui::Vec2::ZERO);
    place.translate(shift)
}

fn label_color(ui: &Ui, shown: Shown) -> Color32 {
    if shown == Shown::None { paint::dim_text(ui) } else { ui.visuals().text_color() }
}

/// Points along a line, the last one left out.
fn along([from, to]: [Pos2; 2]) -> impl Iterator<Item = Pos2> {
    let steps = (from.distance(to) / 2.0).ceil().clamp(1.0, 500.0);
    (0..steps as usize).map(move |i| from.lerp(to, i as f32 / steps))
}

/// Whether a line to the ring's edge would cross the ring or circle before its end.
fn line_over_ring(layout: &RingLayout, center: Pos2, line: [Pos2; 2]) -> bool {
    along(line).map(|p| p - center).any(|p| layout.hit(f64::from(p.x), f64::from(p.y)).is_some())
}

fn crosses(line: [Pos2; 2], label: Rect) -> bool {
    along(line).any(|p| label.contains(p))
}

/// Whether a label would cover a part of the ring or circle.
fn over_ring(layout: &RingLayout, center: Pos2, label: Rect) -> bool {
    (0..=8).any(|i| {
        (0..=4).any(|j| {
            let p = label.lerp_inside(vec2(i as f32 / 8.0, j as f32 / 4.0)) - center;
            layout.hit(f64::from(p.x), f64::from(p.y)).is_some()
        })
    })
}
