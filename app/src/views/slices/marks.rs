//! Overlays of a slice: crosshair, orientation letters, scale bar, lens and texts. White with a dark halo, so that they
//! are legible on black, on white and on every mask.

use std::sync::Arc;

use egui::{Align2, Color32, Galley, Painter, Pos2, Stroke, Ui, pos2, vec2};
use glam::DVec3;

use glioscope_render::{
    Coloring, agreement_color,
    flat::{Mixing, OutlinePattern, Overlay},
};

use super::{
    Input, Layout,
    ruler::{self, Draft, Look},
    shown_grid, sides_known,
};
use crate::theme::{
    self, CROSSHAIR, EDGE, HEADING_POINTS, LABEL_POINTS, ON_IMAGE, TEXT_POINTS, WARNING_ON_IMAGE,
};
use crate::{
    format,
    model::{
        fusion::{image_name, name_with_unit},
        overlap::{Shown, mask_shown},
    },
    world::Second,
};

/// Width kept for an orientation letter on either side of the middle, points.
const LETTER_POINTS: f32 = 12.0;
/// Least gap between texts on a line, points.
const GAP_POINTS: f32 = 12.0;
/// Half the crosshair's central gap, which leaves the marked point visible, points.
const HALF_GAP_POINTS: f32 = 9.0;
const MARGIN_POINTS: f32 = 7.0;

/// Height of the legend of agreement, points.
const AGREEMENT_POINTS: f32 = 20.0;

/// Draws all overlays except rulers.
pub(super) fn draw(ui: &Ui, input: &Input<'_>, layout: &Layout, readout: &str, not_finite_pixels: u64) {
    let painter = ui.painter().with_clip_rect(layout.rect.intersect(ui.clip_rect()));
    crosshair(&painter, layout, layout.pos_of(input.doc.nav.crosshair_mm()));
    if let Some(lens) = input.doc.active_lens()
        && let Some((middle, radius_px)) = layout.slice.lens_circle(&lens)
    {
        let radius = (radius_px.min(1e6) as f32) / layout.pixels_per_point;
        let middle = layout.pos_of_pixel(middle);
        painter.circle_stroke(middle, radius, Stroke::new(3.25, EDGE));
        painter.circle_stroke(middle, radius, Stroke::new(1.5, ON_IMAGE));
    }
    let sides_known = sides_known(input);
    let (title_height, is_middle_free) = title(&painter, input, layout, sides_known, not_finite_pixels);
    let readout_height = readout_line(&painter, layout, readout);
    if sides_known {
        letters(&painter, layout, if is_middle_free { 0.0 } else { title_height }, readout_height);
    }
    scale_bar(&painter, layout, readout_height);
    let mut below = readout_height;
    if let Some(second) = &input.second {
        second_image(&painter, input, layout, second);
    }
    if input.colors.coloring() == Coloring::Agreement {
        agreement(&painter, layout, input.colors.mask_count(), readout_height);
        below += AGREEMENT_POINTS;
    }
    if input.doc.edit.outline_patterns && input.doc.edit.overlay != Overlay::Fill {
        patterns(&painter, input, layout, below);
    }
}

/// Numbers of the measurements of the date that lie within half a slice thickness of the plane.
pub(super) fn in_slice(input: &Input<'_>, layout: &Layout) -> Vec<usize> {
    let half_mm = layout.slice.step_mm(shown_grid(input)) / 2.0;
    let is_near = |mm: &DVec3| layout.slice.distance_mm(*mm).abs() <= half_mm;
    let of_date = input.doc.rulers_at(input.time);
    of_date.filter(|(_, ruler)| ruler.handles_mm().iter().all(is_near)).map(|(index, _)| index).collect()
}

/// Rulers: solid where they are `here`, as [`in_slice`] has them, else faint and dashed.
pub(super) fn rulers(ui: &Ui, input: &Input<'_>, layout: &Layout, here: &[usize], draft: Option<Draft>) {
    let painter = ui.painter().with_clip_rect(layout.rect.intersect(ui.clip_rect()));
    for (index, ruler) in input.doc.rulers_at(input.time) {
        let look = if here.contains(&index) { Look::Solid } else { Look::Faint };
        ruler::draw(&painter, ruler, &|mm| Some(layout.pos_of(mm)), look);
    }
    if let Some(Draft { from_mm, to_mm: Some(to_mm) }) = draft {
        ruler::line(&painter, [from_mm, to_mm].map(|end| layout.pos_of(end)), Look::Solid, "");
    }
}

/// Legend of the second image, below the middle of the right edge: its name and date, its colours with the values at their
/// ends, and how it is shown. The line of a swipe, where it is one.
fn second_image(painter: &Painter, input: &Input<'_>, layout: &Layout, second: &Second<'_>) {
    const BAR_WIDTH_POINTS: f32 = 10.0;
    const LEAST_LEGEND_POINTS: f32 = 260.0;
    const SCALE_BAR_POINTS: f32 = 64.0;
    let fusion = &input.doc.edit.fusion;
    let rect = layout.rect;
    if fusion.mixing == Mixing::Swipe {
        let x = rect.left() + rect.width() * fusion.share;
        for stroke in [Stroke::new(3.0, EDGE), Stroke::new(1.0, ON_IMAGE)] {
            painter.line_segment([pos2(x, rect.top()), pos2(x, rect.bottom())], stroke);
        }
    }
    let name = image_name(second.id, second.time);
    let name = name_with_unit(&name, second.image.volume().unit());
    let how = match fusion.mixing {
        Mixing::Over => {
            let above = three_digits(fusion.threshold_in(second.window));
            format!("over it, {:.0} %, above {above}", fusion.opacity * 100.0)
        }
        Mixing::Checkerboard => "in squares".to_owned(),
        Mixing::Swipe => "right of the line".to_owned(),
        Mixing::Edges => "its edges".to_owned(),
        Mixing::Blink if super::shows_second(painter.ctx(), fusion) => "in turn: shown now".to_owned(),
        Mixing::Blink => "in turn: not now".to_owned(),
    };
    let right = rect.right() - MARGIN_POINTS;
    let mut at = pos2(right, rect.center().y + HEADING_POINTS);
    let is_narrow = rect.width() < LEAST_LEGEND_POINTS;
    // Masks are those of the date shown on either side.
    let date = input.time_point.label.as_str();
    let masks = (second.time != date && !input.time_point.masks.is_empty()).then(|| format!("masks: {date}"));
    let mut texts = vec![name];
    texts.extend((!is_narrow).then_some(how));
    texts.extend(masks);
    for text in &texts {
        at.y += draw_text(painter, at, Align2::RIGHT_TOP, text, LABEL_POINTS, ON_IMAGE);
    }
    // Above the scale bar.
    let height = (rect.height() * 0.25).min(70.0).min(rect.bottom() - SCALE_BAR_POINTS - at.y);
    if fusion.mixing == Mixing::Edges || height < 24.0 || is_narrow {
        return;
    }
    at.y += 3.0;
    let bar = egui::Rect::from_min_size(pos2(right - BAR_WIDTH_POINTS, at.y), vec2(BAR_WIDTH_POINTS, height));
    painter.rect_stroke(bar, 0.0, Stroke::new(1.0, EDGE), egui::StrokeKind::Outside);
    let steps = height as usize;
    for step in 0..steps {
        let share = 1.0 - (step as f64 + 0.5) / steps as f64;
        let row = egui::Rect::from_min_size(bar.min + vec2(0.0, step as f32), vec2(BAR_WIDTH_POINTS, 1.0));
        painter.rect_filled(row, 0.0, theme::color(fusion.map.color(share)));
    }
    let beside = bar.left() - 4.0;
    let [high, low] = [second.window.high, second.window.low].map(three_digits);
    draw_text(painter, pos2(beside, bar.top()), Align2::RIGHT_TOP, &high, LABEL_POINTS, ON_IMAGE);
    draw_text(painter, pos2(beside, bar.bottom()), Align2::RIGHT_BOTTOM, &low, LABEL_POINTS, ON_IMAGE);
}

/// Legend of the agreement colours: a square per level, with its number of masks.
fn agreement(painter: &Painter, layout: &Layout, masks: usize, readout_height: f32) {
    let mut at = layout.rect.left_bottom() + vec2(MARGIN_POINTS + 1.0, -readout_height - AGREEMENT_POINTS);
    let step = (layout.rect.width() * 0.5 / masks.max(1) as f32).min(17.0);
    for level in 1..=masks as u32 {
        let color = agreement_color(level, masks);
        let square = egui::Rect::from_min_size(at, vec2(step - 1.0, 15.0));
        painter.rect(square, 1.0, theme::color(color), Stroke::new(1.0, EDGE), egui::StrokeKind::Outside);
        if step >= 12.0 {
            let ink = theme::ink_on(theme::color(color));
            painter.text(
                square.center(),
                Align2::CENTER_CENTER,
                level.to_string(),
                theme::font(LABEL_POINTS),
                ink,
            );
        }
        at.x += step;
    }
    draw_text(painter, at + vec2(4.0, 0.0), Align2::LEFT_TOP, "masks", LABEL_POINTS, ON_IMAGE);
}

/// Legend of the outlines' patterns: a line per mask shown, as many as fit into half the height.
fn patterns(painter: &Painter, input: &Input<'_>, layout: &Layout, readout_height: f32) {
    const ROW_POINTS: f32 = 14.0;
    const LINE_POINTS: f32 = 26.0;
    if input.compared.is_some() && input.doc.edit.change.on_slices {
        return;
    }
    let regions = &input.time_point.regions;
    let shown = regions.mask_ids().iter().enumerate();
    let shown = shown.filter(|(k, _)| mask_shown(regions, input.selection, *k) != Shown::None);
    let room = (layout.rect.height() * 0.5 / ROW_POINTS) as usize;
    let mut at = layout.rect.left_bottom() + vec2(MARGIN_POINTS, -readout_height - 8.0);
    for (k, id) in shown.take(room).collect::<Vec<_>>().into_iter().rev() {
        at.y -= ROW_POINTS;
        let ends = [at + vec2(0.0, ROW_POINTS / 2.0), at + vec2(LINE_POINTS, ROW_POINTS / 2.0)];
        painter.line_segment(ends, Stroke::new(4.0, EDGE));
        let stroke = Stroke::new(2.0, theme::color(input.colors.mask(k)));
        let [mark, gap] = OutlinePattern::of_mask(k).mark_and_gap_widths().map(|widths| widths as f32 * 1.5);
        if gap > 0.0 {
            painter.extend(egui::Shape::dashed_line(&ends, stroke, mark, gap));
        } else {
            painter.line_segment(ends, stroke);
        }
        let name = input.doc.edit.masks.name(id);
        let place = at + vec2(LINE_POINTS + 5.0, 0.0);
        draw_text(painter, place, Align2::LEFT_TOP, &name, LABEL_POINTS, ON_IMAGE);
    }
}

fn crosshair(painter: &Painter, layout: &Layout, at: Pos2) {
    let rect = layout.rect;
    let lines = [
        [pos2(rect.left(), at.y), pos2(at.x - HALF_GAP_POINTS, at.y)],
        [pos2(at.x + HALF_GAP_POINTS, at.y), pos2(rect.right(), at.y)],
        [pos2(at.x, rect.top()), pos2(at.x, at.y - HALF_GAP_POINTS)],
        [pos2(at.x, at.y + HALF_GAP_POINTS), pos2(at.x, rect.bottom())],
    ];
    for stroke in [Stroke::new(3.0, EDGE.gamma_multiply(0.35)), Stroke::new(1.0, CROSSHAIR)] {
        for [from, to] in lines {
            if from.x <= to.x && from.y <= to.y {
                painter.line_segment([from, to], stroke);
            }
        }
    }
}

/// Text with a dark halo; returns its height.
fn draw_text(painter: &Painter, at: Pos2, anchor: Align2, text: &str, size: f32, ink: Color32) -> f32 {
    draw_galley(painter, at, anchor, painter.layout_no_wrap(text.to_owned(), theme::font(size), ink), ink)
}

fn draw_galley(painter: &Painter, at: Pos2, anchor: Align2, galley: Arc<Galley>, ink: Color32) -> f32 {
    let corner = anchor.anchor_size(at, galley.size()).min;
    for (dx, dy) in
        [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)]
    {
        painter.galley_with_override_text_color(corner + vec2(dx, dy), galley.clone(), EDGE);
    }
    let height = galley.size().y;
    painter.galley_with_override_text_color(corner, galley, ink);
    height
}

/// The corners above: image and date left, window right, plane and position below. What doesn't fit is left out in this
/// order: the date, the window. Returns the height, and whether the middle of the upper edge is free.
fn title(
    painter: &Painter,
    input: &Input<'_>,
    layout: &Layout,
    sides_known: bool,
    not_finite_pixels: u64,
) -> (f32, bool) {
    let rect = layout.rect;
    let free = rect.width() - 2.0 * MARGIN_POINTS - GAP_POINTS;
    let line = |text: String| painter.layout_no_wrap(text, theme::font(LABEL_POINTS), ON_IMAGE);
    // In a pane that is narrower than a text, the text takes several lines.
    let width = (rect.width() - 2.0 * MARGIN_POINTS).max(40.0);
    let wrapped = |text: String, points: f32, color| painter.layout(text, theme::font(points), color, width);
    let matched = if input.is_window_matched() { ", matched" } else { "" };
    let window = input.window().map(|window| {
        line(format!("W {} L {}{matched}", three_digits(window.width()), three_digits(window.level())))
    });
    let date = input.time_point.label.as_str();
    let series = input.context.map_or("no image", |(id, _)| id);
    let dated = if date.is_empty() { series.to_owned() } else { format!("{series} · {date}") };
    let window_width = window.as_ref().map_or(0.0, |window| window.size().x);
    let series = [line(dated), line(series.to_owned())]
        .into_iter()
        .find(|text| text.size().x + window_width <= free)
        .unwrap_or_else(|| wrapped(series.to_owned(), LABEL_POINTS, ON_IMAGE));
    let window = window.filter(|window| series.size().x + window.size().x <= free);
    let place = format!("{} {}", layout.slice.plane.name(), layout.slice.position_label(sides_known));
    let place = wrapped(place, LABEL_POINTS, ON_IMAGE);
    let middle = [rect.center().x - LETTER_POINTS, rect.center().x + LETTER_POINTS];
    // The letter is higher than a line: it reaches beside the second one.
    let is_middle_free = rect.left() + MARGIN_POINTS + series.size().x.max(place.size().x) < middle[0]
        && window.as_ref().is_none_or(|w| rect.right() - MARGIN_POINTS - w.size().x > middle[1]);
    let top = rect.left_top() + vec2(MARGIN_POINTS, MARGIN_POINTS - 2.0);
    let mut at = top;
    at.y += draw_galley(painter, at, Align2::LEFT_TOP, series, ON_IMAGE);
    if let Some(window) = window {
        let corner = rect.right_top() + vec2(-MARGIN_POINTS, MARGIN_POINTS - 2.0);
        draw_galley(painter, corner, Align2::RIGHT_TOP, window, ON_IMAGE);
    }
    at.y += draw_galley(painter, at, Align2::LEFT_TOP, place, ON_IMAGE);
    if !sides_known {
        let text = wrapped("side unknown".into(), TEXT_POINTS, WARNING_ON_IMAGE);
        at.y += draw_galley(painter, at, Align2::LEFT_TOP, text, WARNING_ON_IMAGE);
    }
    if not_finite_pixels > 0 {
        let text = format!("NaN or infinite: {not_finite_pixels} pixels");
        let text = wrapped(text, LABEL_POINTS, WARNING_ON_IMAGE);
        at.y += draw_galley(painter, at, Align2::LEFT_TOP, text, WARNING_ON_IMAGE);
    }
    (at.y - rect.top(), is_middle_free)
}

/// About three significant digits.
fn three_digits(value: f64) -> String {
    let digits = if value == 0.0 { 0.0 } else { (2.0 - value.abs().log10().floor()).clamp(0.0, 6.0) };
    format!("{value:.0$}", digits as usize)
}

/// The readout at the bottom; returns its height.
fn readout_line(painter: &Painter, layout: &Layout, readout: &str) -> f32 {
    let rect = layout.rect;
    let max_width = (rect.width() - 2.0 * MARGIN_POINTS).max(40.0);
    let galley = painter.layout(readout.to_owned(), theme::font(LABEL_POINTS), ON_IMAGE, max_width);
    draw_galley(
        painter,
        rect.left_bottom() + vec2(MARGIN_POINTS, -MARGIN_POINTS + 2.0),
        Align2::LEFT_BOTTOM,
        galley,
        ON_IMAGE,
    ) + MARGIN_POINTS
}

fn letters(painter: &Painter, layout: &Layout, title_height: f32, readout_height: f32) {
    let rect = layout.rect;
    let [left, right, top, bottom] = layout.slice.edge_names();
    // Where the title reaches the middle, the top letter is below it.
    let top_y = rect.top() + title_height.max(MARGIN_POINTS - 3.0) + 1.0;
    let places = [
        (left, pos2(rect.left() + MARGIN_POINTS, rect.center().y), Align2::LEFT_CENTER),
        (right, pos2(rect.right() - MARGIN_POINTS, rect.center().y), Align2::RIGHT_CENTER),
        (top, pos2(rect.center().x, top_y), Align2::CENTER_TOP),
        (bottom, pos2(rect.center().x, rect.bottom() - readout_height), Align2::CENTER_BOTTOM),
    ];
    for (letter, at, anchor) in places {
        draw_text(painter, at, anchor, &letter, HEADING_POINTS, ON_IMAGE);
    }
}

fn scale_bar(painter: &Painter, layout: &Layout, readout_height: f32) {
    let rect = layout.rect;
    let max_length_px = f64::from(rect.width() * layout.pixels_per_point) * 0.3;
    let Some(bar) = layout.slice.scale_bar(max_length_px) else { return };
    let length = bar.px as f32 / layout.pixels_per_point;
    let right = rect.right_bottom() + vec2(-MARGIN_POINTS - 1.0, -readout_height - 6.0);
    let left = right - vec2(length, 0.0);
    let text = format!("{} mm", format::plain(bar.mm));
    let text = painter.layout_no_wrap(text, theme::font(LABEL_POINTS), ON_IMAGE);
    // No room below the letter at the right edge.
    if right.y - 4.0 - text.size().y < rect.center().y + HEADING_POINTS {
        return;
    }
    for stroke in [Stroke::new(4.0, EDGE), Stroke::new(2.0, ON_IMAGE)] {
        let overhang = vec2((stroke.width - 2.0) / 2.0, 0.0);
        painter.line_segment([left - overhang, right + overhang], stroke);
        for end in [left, right] {
            let half_tick = vec2(0.0, 4.0 + overhang.x);
            painter.line_segment([end - half_tick, end + half_tick], stroke);
        }
    }
    // Above the middle of the bar, but within the slice where the bar is shorter than its text.
    let beyond = ((text.size().x - length) / 2.0).max(0.0);
    let middle = right - vec2(length / 2.0 + beyond, 4.0);
    draw_galley(painter, middle, Align2::CENTER_BOTTOM, text, ON_IMAGE);
}
