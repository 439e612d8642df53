//! The timeline: a column per date, a band per lesion, a disc per component, lines for links.

use std::collections::BTreeMap;

use egui::{Align2, Color32, Pos2, Rect, Response, Role, Sense, Shape, Stroke, Ui, WidgetInfo, pos2, vec2};
use glioscope_core::lesions::{Anchor, LesionDate, LesionReport, LesionsReport, LinkReport, LinkState};

use super::selected::{Selected, ends};
use crate::{
    command::{Commands, EditCommand, LookCommand},
    format,
    model::document::ball_radius_mm,
    theme::{self, LABEL_POINTS, TEXT_POINTS, Tokens},
    views::{draw, pane::Input, pointer},
};

/// The most lesions drawn; further ones are in the command line's tables.
pub(super) const MOST_LESIONS: usize = 40;
/// Height of a row of components, points.
const ROW: f32 = 36.0;
/// Largest and smallest radius of a disc, points.
const LARGEST: f32 = 13.0;
const LEAST: f32 = 3.0;
/// Room for the lesions' names, points.
const NAMES: f32 = 92.0;
/// Room for the dates' names, points.
const DATES: f32 = 22.0;
/// Least width of a column, points.
const COLUMN: f32 = 74.0;

/// A component's place in the timeline.
struct Disc<'a> {
    anchor: &'a Anchor,
    at: Pos2,
    radius: f32,
    color: Color32,
    text: String,
    volume_ml: f64,
    date: usize,
}

/// Draws the timeline of the lesions `shown`, and takes clicks on it.
pub(super) fn show(
    ui: &mut Ui,
    input: &Input<'_>,
    report: &LesionsReport,
    shown: &[&LesionReport],
    selected: &mut Selected,
    out: &mut Commands,
) {
    if shown.is_empty() {
        let text = match report.lesions.len() {
            0 => "No lesion: the mask is empty".to_owned(),
            small => format!("{small} lesions, none ever as large as {} ml", report.smallest_ml),
        };
        ui.weak(text);
        return;
    }
    let rows: Vec<usize> =
        shown.iter().map(|l| l.dates.iter().map(|date| date.parts.len()).max().unwrap_or(0).max(1)).collect();
    let width = (NAMES + COLUMN * report.dates.len() as f32).max(ui.available_width());
    let height = DATES + ROW * rows.iter().sum::<usize>() as f32 + 4.0;
    let (rect, ground) = ui.allocate_exact_size(vec2(width, height), Sense::click());
    let column = (width - NAMES) / report.dates.len().max(1) as f32;
    let x_of = |date: usize| rect.left() + NAMES + column * (date as f32 + 0.5);
    let tokens = Tokens::in_ui(ui);
    let painter = ui.painter().with_clip_rect(rect.intersect(ui.clip_rect()));

    // Dates.
    for (date, of) in report.dates.iter().enumerate() {
        let is_shown = input.case.time_points.get(input.time).is_some_and(|time| time.label == of.time);
        let column_rect =
            Rect::from_x_y_ranges(x_of(date) - column / 2.0..=x_of(date) + column / 2.0, rect.y_range());
        if is_shown {
            painter.rect_filled(column_rect.shrink2(vec2(2.0, 0.0)), 4.0, tokens.raised);
        }
        let name = if of.time.is_empty() { "no date" } else { &of.time };
        let ink = if is_shown { tokens.text } else { tokens.second };
        let galley = draw::elided(ui, name, &theme::font(LABEL_POINTS), ink, column - 6.0);
        painter.galley(pos2(x_of(date) - galley.size().x / 2.0, rect.top() + 3.0), galley, ink);
        if of.volume_ml.is_none() {
            let at = pos2(x_of(date), rect.center().y);
            painter.text(at, Align2::CENTER_CENTER, "no mask", theme::font(LABEL_POINTS), tokens.second);
        }
    }
    // Dates that aren't linked.
    for pair in report.pairs.iter().filter(|pair| pair.not_linked.is_some()) {
        if let Some(later) = report.dates.iter().position(|date| date.time == pair.to) {
            let x = x_of(later) - column / 2.0;
            let line = [pos2(x, rect.top() + DATES), pos2(x, rect.bottom())];
            painter.extend(Shape::dashed_line(&line, Stroke::new(1.5, tokens.warning), 3.0, 3.0));
        }
    }

    let most_ml = shown.iter().flat_map(|l| &l.dates).flat_map(|d| &d.parts).map(|p| p.volume_ml);
    let most_ml = most_ml.fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let mut discs: Vec<Disc<'_>> = Vec::new();
    let mut top = rect.top() + DATES;
    for (lesion, rows) in shown.iter().zip(&rows) {
        let band = Rect::from_x_y_ranges(rect.x_range(), top..=top + ROW * *rows as f32);
        painter.hline(rect.x_range(), band.top(), Stroke::new(1.0, tokens.line));
        name_of(ui, &painter, lesion, band, tokens);
        for (date, at) in lesion.dates.iter().enumerate() {
            let before = date.checked_sub(1).and_then(|date| lesion.dates.get(date));
            let color = growth_color(before, at, tokens);
            if at.volume_ml == Some(0.0) && before.and_then(|b| b.volume_ml).is_some_and(|ml| ml > 0.0) {
                let center = pos2(x_of(date), band.center().y);
                painter.circle_stroke(center, 5.0, Stroke::new(1.5, tokens.shrinkage));
                painter.line_segment(
                    [center + vec2(-3.5, 3.5), center + vec2(3.5, -3.5)],
                    Stroke::new(1.5, tokens.shrinkage),
                );
            }
            let first = band.center().y - ROW * (at.parts.len().saturating_sub(1)) as f32 / 2.0;
            for (n, part) in at.parts.iter().enumerate() {
                let Some(anchor) = &part.anchor else { continue };
                let radius = LARGEST * (part.volume_ml / most_ml).sqrt() as f32;
                discs.push(Disc {
                    anchor,
                    at: pos2(x_of(date), first + ROW * n as f32),
                    radius: radius.max(LEAST),
                    color,
                    text: text_of(lesion, at, part.volume_ml, change_text(before, at)),
                    volume_ml: part.volume_ml,
                    date,
                });
            }
        }
        top = band.bottom();
    }

    let places: BTreeMap<(&str, [u64; 3]), Pos2> =
        discs.iter().map(|disc| (key(disc.anchor), disc.at)).collect();
    let mut clicked = None;
    for (n, link) in report.links.iter().enumerate() {
        if let Some(response) = show_link(ui, &painter, (n, link), &places, selected, tokens)
            && response.clicked()
        {
            clicked = Some(link);
        }
    }
    for disc in &discs {
        painter.circle_filled(disc.at, disc.radius, disc.color);
        painter.circle_stroke(disc.at, disc.radius, Stroke::new(1.0, tokens.panel));
        if selected.has(disc.anchor) {
            painter.circle_stroke(disc.at, disc.radius + 3.0, Stroke::new(2.0, tokens.interaction));
        }
        let value = format::ml(disc.volume_ml);
        // Above the line of a link.
        let beside = disc.at + vec2(0.75, -0.75) * disc.radius + vec2(4.0, -3.0);
        if beside.x + 44.0 < x_of(disc.date) + column / 2.0 + 8.0 {
            painter.text(beside, Align2::LEFT_CENTER, value, theme::font(LABEL_POINTS), tokens.second);
        }
        let hit = Rect::from_center_size(disc.at, vec2(2.0, 2.0) * disc.radius.max(9.0));
        let id = ui.scope_id().with(("lesion", disc.anchor.time.as_str(), key(disc.anchor).1));
        let response = ui.interact(hit, id, Sense::click()).on_hover_text(&disc.text);
        response
            .widget_info(|| WidgetInfo::selected(Role::Button, true, selected.has(disc.anchor), &disc.text));
        if response.clicked() {
            let pressed = pointer::press_modifiers(ui.ctx());
            selected.take(disc.anchor, pressed.shift || pressed.command);
            go_to(input, disc.anchor, disc.volume_ml, out);
        }
    }
    match clicked.and_then(|link| Some((link, ends(link)?))) {
        Some((_, [from, to])) => {
            *selected = Selected::Link(from.clone(), to.clone());
            let volume_ml = discs.iter().find(|disc| disc.anchor == to).map_or(1.0, |disc| disc.volume_ml);
            go_to(input, to, volume_ml, out);
        }
        None if ground.clicked() => *selected = Selected::Nothing,
        None => {}
    }
    ui.weak(
        "Area: volume. Colour: growth and shrinkage since the date before, full at double and half. Dashed: proposed link. Click: go there. Shift-click: a second one",
    );
    let rest = report.lesions.iter().filter(|l| !l.small).count().saturating_sub(MOST_LESIONS);
    if rest > 0 {
        ui.weak(format!("{rest} further lesions are not drawn"));
    }
}

/// Shows the component in all views, at its date.
pub(in crate::views) fn go_to(input: &Input<'_>, anchor: &Anchor, volume_ml: f64, out: &mut Commands) {
    if let Some(time) = input.case.time_at(&anchor.time)
        && time != input.time
    {
        out.push(LookCommand::SetTime(time));
    }
    out.push(EditCommand::GoTo(anchor.at_mm, ball_radius_mm(volume_ml, &input.case.grid)));
}

/// Bits of a place, to find it again.
fn key(anchor: &Anchor) -> (&str, [u64; 3]) {
    (anchor.time.as_str(), anchor.at_mm.to_array().map(f64::to_bits))
}

fn name_of(ui: &Ui, painter: &egui::Painter, lesion: &LesionReport, band: Rect, tokens: &Tokens) {
    let name = title(lesion);
    let ink = if lesion.small { tokens.second } else { tokens.text };
    let galley = draw::elided(ui, &name, &theme::font(TEXT_POINTS), ink, NAMES - 10.0);
    painter.galley(pos2(band.left() + 4.0, band.center().y - galley.size().y / 2.0), galley, ink);
}

/// `A`, or `A: frontal`.
pub(super) fn title(lesion: &LesionReport) -> String {
    match &lesion.name {
        Some(name) => format!("{}: {name}", lesion.id),
        None => lesion.id.clone(),
    }
}

/// Line of a link, with a handle in its middle.
fn show_link(
    ui: &Ui,
    painter: &egui::Painter,
    (number, link): (usize, &LinkReport),
    places: &BTreeMap<(&str, [u64; 3]), Pos2>,
    selected: &Selected,
    tokens: &Tokens,
) -> Option<Response> {
    let [from, to] = ends(link)?;
    let line = [*places.get(&key(from))?, *places.get(&key(to))?];
    let is_selected = selected.is_link([from, to]);
    let color = if is_selected { tokens.interaction } else { tokens.second };
    let stroke = Stroke::new(if is_selected { 3.0 } else { 1.5 }, color);
    let middle = line[0].lerp(line[1], 0.5);
    if link.state == LinkState::Proposed {
        painter.extend(Shape::dashed_line(&line, stroke, 5.0, 4.0));
        painter.circle(middle, 4.0, tokens.panel, Stroke::new(1.5, color));
    } else {
        painter.line_segment(line, stroke);
        painter.circle_filled(middle, 4.0, color);
    }
    let state: &str = link.state.into();
    let how = match (link.overlap_ml, link.distance_mm) {
        (_, Some(mm)) => format!("nearest, {mm:.1} mm apart"),
        (Some(ml), None) => format!("by overlap of {}", format::ml(ml)),
        (None, None) => "by you".to_owned(),
    };
    let text = format!("Link from {} to {}, {how}, {state}", from.time, to.time);
    let hit = Rect::from_center_size(middle, vec2(18.0, 18.0));
    let response = ui.interact(hit, ui.scope_id().with(("link of lesions", number)), Sense::click());
    response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_selected, &text));
    Some(response.on_hover_text(text))
}

/// Volume now against the date before, where both are known and there was something.
fn ratio(before: Option<&LesionDate>, at: &LesionDate) -> Option<f64> {
    let before = before?.volume_ml.filter(|ml| *ml > 0.0)?;
    Some(at.volume_ml? / before)
}

/// Growth and shrinkage since the date before: full at twice and half the volume; a new lesion grew.
fn growth_color(before: Option<&LesionDate>, at: &LesionDate, tokens: &Tokens) -> Color32 {
    let is_new = before.is_some_and(|before| before.volume_ml == Some(0.0));
    let doublings = match ratio(before, at) {
        Some(ratio) => ratio.log2().clamp(-1.0, 1.0),
        None if is_new => 1.0,
        None => 0.0,
    };
    let end = if doublings > 0.0 { tokens.growth } else { tokens.shrinkage };
    tokens.second.lerp_to_gamma(end, doublings.abs() as f32)
}

/// `+20 %`, `new`; empty at the first date.
pub(super) fn change_text(before: Option<&LesionDate>, at: &LesionDate) -> String {
    match ratio(before, at) {
        Some(0.0) => "gone".to_owned(),
        Some(ratio) => format!("{:+.0} %", 100.0 * (ratio - 1.0)).replace('-', "\u{2212}"),
        None if before.is_some_and(|b| b.volume_ml == Some(0.0))
            && at.volume_ml.is_some_and(|ml| ml > 0.0) =>
        {
            "new".to_owned()
        }
        None => String::new(),
    }
}

fn text_of(lesion: &LesionReport, at: &LesionDate, volume_ml: f64, change: String) -> String {
    let of = if at.parts.len() > 1 { format!(", one of {} pieces", at.parts.len()) } else { String::new() };
    let time = if at.time.is_empty() { String::new() } else { format!(" at {}", at.time) };
    let change = if change.is_empty() { change } else { format!(", {change}") };
    let events: Vec<&str> = at.events.iter().map(Into::into).collect();
    let events =
        if events.is_empty() { String::new() } else { format!(" ({})", events.join(", ").replace('_', " ")) };
    format!("Lesion {}{time}: {}{of}{change}{events}", title(lesion), format::ml(volume_ml))
}
