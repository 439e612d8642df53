//! Fibre tracts in the context view: drawn as tubes, listed over the view, and named under the pointer.

use std::sync::Arc;

use egui::{
    Color32, Galley, Id, Painter, Popup, PopupCloseBehavior, Rect, Role, Sense, Ui, WidgetInfo, pos2, vec2,
};
use glioscope_core::case::CaseTracts;
use glioscope_render::{ColorMap, DrawnTubes, PickedFiber, Rgb, tract_color};

use super::tract_look;
use crate::{
    command::{Command, Commands, EditCommand},
    format,
    model::FiberColor,
    theme::{self, LABEL_POINTS, Tokens},
    views::{
        draw,
        pane::{Input, Stage},
    },
    world::{
        jobs::Lookup,
        tracts::{TubeSets, is_placed},
    },
};

/// Line height of the list.
const LINE_POINTS: f32 = 17.0;

/// The case's tracts with their looks and visibility, and whether their scalars have gaps; and a note if they are being
/// prepared or failed.
pub(super) fn drawn_tubes(ui: &Ui, stage: &mut Stage<'_>) -> (Vec<DrawnTubes>, Vec<bool>, Option<String>) {
    let Stage { input, ask, results, .. } = stage;
    let edit = &input.doc.edit;
    let TubeSets { sets, is_working, error } = results.tracts.sets(input.case, edit, ask);
    if is_working {
        ui.request_repaint_after(std::time::Duration::from_millis(100));
    }
    let gaps = sets.iter().map(|prepared| prepared.has_gaps).collect();
    let with_tracts = sets.into_iter().zip(&input.case.tracts).enumerate();
    let drawn = with_tracts.map(|(n, (prepared, CaseTracts { id, tracts }))| DrawnTubes {
        set: prepared.set,
        look: edit.tract_look(id).of_tubes(tracts, tract_color(n)),
        shown: !edit.hidden_tracts.contains(id),
    });
    (drawn.collect(), gaps, error.or_else(|| is_working.then(|| "Preparing fibre tracts…".into())))
}

/// A fibre's name, and its distance from the selection once that is computed.
pub(super) fn fiber_text(stage: &mut Stage<'_>, picked: PickedFiber) -> String {
    let Stage { input, ask, results, .. } = stage;
    let Some(CaseTracts { id, tracts }) = input.case.tracts.get(picked.set) else {
        return String::new();
    };
    let name = format!("{id}, fibre {}", picked.fiber);
    let (doc, time_point) = (input.doc, input.time_point);
    let cells = match results.tracts.cells(input.case, (doc.nav.time, time_point), input.selection, ask) {
        Lookup::Ready(cells) => cells.clone(),
        Lookup::Working(_) | Lookup::Failed(_) => return name,
    };
    match cells.as_ref().as_ref().and_then(|cells| cells.nearest(tracts.fiber(picked.fiber))) {
        Some(near) if near.distance_mm > 0.0 => {
            format!("{name}, {} from the selection", format::length_mm(near.distance_mm))
        }
        Some(_) => format!("{name}, through the selection"),
        None => name,
    }
}

/// A line of the list.
enum Line {
    /// A file of tracts, by its index, and what is said of it.
    Tracts(usize, String),
    /// The colours of a scalar and the values at their ends.
    Scale(ColorMap, [f64; 2], String),
    /// What the colours of directions mean.
    Directions,
    /// How many files have no line.
    Omitted(usize),
}

/// The convention of tractography.
const DIRECTIONS: [(Rgb, &str); 3] = [
    ([255, 0, 0], "left\u{2013}right"),
    ([0, 255, 0], "anterior\u{2013}posterior"),
    ([0, 0, 255], "superior\u{2013}inferior"),
];
/// Colours of a scale.
const SCALE_STEPS: u8 = 30;
/// Width of a scale's colours.
const SCALE_POINTS: f32 = 60.0;

/// The lines of the list, at most `most`, but one where files are left out: those of the files, with scales and the
/// convention where they are used.
fn lines(input: &Input<'_>, (drawn, gaps): (&[DrawnTubes], &[bool]), most: usize) -> Vec<Line> {
    let (case, edit) = (input.case, &input.doc.edit);
    let mut has_directions = false;
    let of_file = |(n, CaseTracts { id, tracts }): (usize, &CaseTracts)| {
        let note = match drawn.get(n).map(|d| d.set.left_out()) {
            _ if !is_placed(case, tracts) => ": place unknown, not drawn".to_owned(),
            Some(0) | None => String::new(),
            Some(n) => {
                format!(": {} of {} fibres drawn", format::count((tracts.fiber_count() - n) as u64), {
                    format::count(tracts.fiber_count() as u64)
                })
            }
        };
        let look = edit.tract_look(id);
        let is_shown = !edit.hidden_tracts.contains(id) && is_placed(case, tracts);
        has_directions |= is_shown && look.color == FiberColor::Direction;
        let mut own = vec![Line::Tracts(n, format!("{id}{note}"))];
        if let Some(scalar) = look.scalar(tracts).filter(|_| is_shown) {
            let grey = if gaps.get(n).is_some_and(|&gaps| gaps) { ", grey: no value" } else { "" };
            own.push(Line::Scale(look.map, look.range_of(scalar), format!("{}{grey}", scalar.name())));
        }
        own
    };
    let all: Vec<Vec<Line>> = case.tracts.iter().enumerate().map(of_file).collect();
    let most = most.saturating_sub(usize::from(has_directions));
    let total: usize = all.iter().map(Vec::len).sum();
    let room = if total <= most { most } else { most.saturating_sub(1) };
    let mut lines = Vec::new();
    for (n, own) in all.into_iter().enumerate() {
        if lines.len() + own.len() > room {
            lines.push(Line::Omitted(case.tracts.len() - n));
            break;
        }
        lines.extend(own);
    }
    if has_directions {
        lines.push(Line::Directions);
    }
    lines
}

/// Draws the list of tracts from `top` downwards: colour and name; a click shows or hides a tract.
pub(super) fn list(
    ui: &Ui,
    input: &Input<'_>,
    rect: Rect,
    top: f32,
    drawn: (&[DrawnTubes], &[bool]),
    out: &mut Commands,
) {
    let case = input.case;
    if case.tracts.is_empty() {
        return;
    }
    let dark = ui.visuals().dark_mode;
    let ink = Tokens::of(dark).text;
    let painter = ui.painter().with_clip_rect(rect);
    let font = theme::font(LABEL_POINTS);
    // Space for the scale bar below.
    let most = ((rect.bottom() - 60.0 - top) / LINE_POINTS).max(0.0) as usize;
    let left = rect.left() + 10.0;
    let text = |text: String| painter.layout_no_wrap(text, font.clone(), ink);
    for (row, line) in lines(input, drawn, most).into_iter().enumerate() {
        let at = pos2(left, top + row as f32 * LINE_POINTS);
        let line_rect = |width: f32| Rect::from_min_size(at, vec2(width, LINE_POINTS - 2.0));
        match line {
            Line::Tracts(n, words) => {
                let galley = text(words);
                let own = line_rect(galley.size().x + 17.0);
                draw::plate(&painter, own, dark);
                tracts_line(ui, input, (n, own), (&painter, galley), out);
            }
            Line::Scale(map, range, name) => {
                let [low, high] = range.map(|value| text(format::four_digits(value)));
                let name = text(name);
                let texts = [low.size().x, high.size().x, name.size().x];
                let ramp_at = 17.0 + texts[0] + 5.0;
                let high_at = ramp_at + SCALE_POINTS + 5.0;
                let name_at = high_at + texts[1] + 8.0;
                draw::plate(&painter, line_rect(name_at + texts[2]), dark);
                painter.galley(at + vec2(17.0, 0.0), low, ink);
                let scale = Rect::from_min_size(at + vec2(ramp_at, 2.0), vec2(SCALE_POINTS, 11.0));
                draw::color_ramp(&painter, scale, map, SCALE_STEPS);
                painter.galley(at + vec2(high_at, 0.0), high, ink);
                painter.galley(at + vec2(name_at, 0.0), name, ink);
            }
            Line::Directions => {
                let words = DIRECTIONS.map(|(color, word)| (color, text(word.to_owned())));
                let width: f32 = words.iter().map(|(_, galley)| galley.size().x + 25.0).sum();
                draw::plate(&painter, line_rect(width - 8.0), dark);
                let mut x = 0.0;
                for (color, galley) in words {
                    let swatch = Rect::from_min_size(at + vec2(x, 2.0), vec2(11.0, 11.0));
                    painter.rect_filled(swatch, 2.0, theme::color(color));
                    let width = galley.size().x;
                    painter.galley(at + vec2(x + 17.0, 0.0), galley, ink);
                    x += width + 25.0;
                }
            }
            Line::Omitted(count) => {
                let galley = text(format!("and {count} more: see the menu View"));
                draw::plate(&painter, line_rect(galley.size().x + 17.0), dark);
                painter.galley(at, galley, ink);
            }
        }
    }
}

/// The line of the tracts with index `n`: a click shows or hides them, its menu has their look.
fn tracts_line(
    ui: &Ui,
    input: &Input<'_>,
    (n, line): (usize, Rect),
    (painter, galley): (&Painter, Arc<Galley>),
    out: &mut Commands,
) {
    let Some(tracts) = input.case.tracts.get(n) else { return };
    let ink = Tokens::in_ui(ui).text;
    let (at, id) = (line.min, &tracts.id);
    let edit = &input.doc.edit;
    let shown = !edit.hidden_tracts.contains(id);
    let response = ui.interact(line, Id::unique(("fibre tracts", id)), Sense::click());
    let command = Command::from(EditCommand::ToggleTracts(id.clone()));
    response.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, shown, command.text()));
    let edge = if response.hovered() { ink } else { ink.gamma_multiply(0.6) };
    let swatch = Rect::from_min_size(at + vec2(0.0, 2.0), vec2(11.0, 11.0));
    let look = edit.tract_look(id);
    let stripes: Vec<Rgb> = match (&look.color, look.scalar(&tracts.tracts)) {
        _ if !shown => Vec::new(),
        (FiberColor::Direction, _) => DIRECTIONS.map(|(color, _)| color).to_vec(),
        (FiberColor::Scalar(_), Some(_)) => [0.1, 0.5, 0.9].map(|share| look.map.color(share)).to_vec(),
        (FiberColor::Plain | FiberColor::Scalar(_), _) => vec![tract_color(n)],
    };
    let fill = match stripes.as_slice() {
        [color] => theme::color(*color),
        _ => Color32::TRANSPARENT,
    };
    if stripes.len() > 1 {
        for (k, &color) in stripes.iter().enumerate() {
            let [from, to] =
                [k, k + 1].map(|k| swatch.left() + swatch.width() * k as f32 / stripes.len() as f32);
            let part = Rect::from_min_max(pos2(from, swatch.top()), pos2(to, swatch.bottom()));
            painter.rect_filled(part, 0.0, theme::color(color));
        }
    }
    painter.rect(swatch, 2.0, fill, egui::Stroke::new(1.0, edge), egui::StrokeKind::Outside);
    let text_color = ink.gamma_multiply(if shown { 1.0 } else { 0.55 });
    painter.galley_with_override_text_color(at + vec2(17.0, 0.0), galley, text_color);
    let tooltip = format!("{}\nIts menu has colour, width and form", command.tooltip());
    if response.clone().on_hover_text(tooltip).clicked() {
        out.push(command);
    }
    Popup::context_menu(&response)
        .close_behavior(PopupCloseBehavior::CloseOnClickOutside)
        .show(|ui| tract_look::controls(ui, edit, &[tracts], out));
}
