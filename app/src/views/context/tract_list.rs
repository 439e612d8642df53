//! Fibre tracts in the context view: drawn as tubes, listed over the view, and named under the pointer.

use std::sync::Arc;

use egui::{Color32, Id, Rect, Role, Sense, Ui, WidgetInfo, pos2, vec2};
use glioscope_core::case::CaseTracts;
use glioscope_render::{DrawnTubes, PickedFiber, tract_color};

use crate::{
    command::{Command, Commands, EditCommand},
    format,
    theme::{self, LABEL_POINTS, Tokens},
    views::{
        draw,
        pane::{Input, Stage},
    },
    world::{jobs::Lookup, tracts::is_placed},
};

/// Line height of the list.
const LINE_POINTS: f32 = 17.0;

/// The case's tracts with their visibility; and a note if they are being prepared or failed.
pub(super) fn drawn_tubes(ui: &Ui, stage: &mut Stage<'_>) -> (Vec<DrawnTubes>, Option<String>) {
    let Stage { input, ask, results, .. } = stage;
    match results.tracts.sets(input.case, ask) {
        Some(Lookup::Ready(sets)) => {
            let hidden = &input.doc.edit.hidden_tracts;
            let with_tracts = sets.iter().zip(&input.case.tracts);
            let drawn = with_tracts.map(|(set, tracts)| DrawnTubes {
                set: Arc::clone(set),
                shown: !hidden.contains(&tracts.id),
            });
            (drawn.collect(), None)
        }
        Some(Lookup::Working(_)) => {
            ui.request_repaint_after(std::time::Duration::from_millis(100));
            (Vec::new(), Some("Preparing fibre tracts…".into()))
        }
        Some(Lookup::Failed(error)) => (Vec::new(), Some(error.to_string())),
        None => (Vec::new(), None),
    }
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

/// Draws the list of tracts from `top` downwards: colour and name; a click shows or hides a tract.
pub(super) fn list(
    ui: &Ui,
    input: &Input<'_>,
    rect: Rect,
    top: f32,
    drawn: &[DrawnTubes],
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
    let max_rows = ((rect.bottom() - 60.0 - top) / LINE_POINTS).max(0.0) as usize;
    let rows = if case.tracts.len() > max_rows { max_rows.saturating_sub(1) } else { case.tracts.len() };
    let omitted = case.tracts.len() - rows;
    let mut lines: Vec<(Option<usize>, String)> = Vec::new();
    for (n, CaseTracts { id, tracts }) in case.tracts.iter().enumerate().take(rows) {
        let note = match drawn.get(n).map(|d| d.set.left_out()) {
            _ if !is_placed(case, tracts) => ": place unknown, not drawn".to_owned(),
            Some(0) | None => String::new(),
            Some(n) => {
                format!(": {} of {} fibres drawn", format::count((tracts.fiber_count() - n) as u64), {
                    format::count(tracts.fiber_count() as u64)
                })
            }
        };
        lines.push((Some(n), format!("{id}{note}")));
    }
    if omitted > 0 {
        lines.push((None, format!("and {omitted} more: see the menu View")));
    }
    let left = rect.left() + 10.0;
    for (row, (index, text)) in lines.into_iter().enumerate() {
        let galley = painter.layout_no_wrap(text, font.clone(), ink);
        let at = pos2(left, top + row as f32 * LINE_POINTS);
        let line = Rect::from_min_size(at, vec2(galley.size().x + 17.0, LINE_POINTS - 2.0));
        draw::plate(&painter, line, dark);
        let Some(CaseTracts { id, .. }) = index.and_then(|n| case.tracts.get(n)) else {
            painter.galley(at, galley, ink);
            continue;
        };
        let shown = !input.doc.edit.hidden_tracts.contains(id);
        let response = ui.interact(line, Id::unique(("fibre tracts", id)), Sense::click());
        let command = Command::from(EditCommand::ToggleTracts(id.clone()));
        response.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, shown, command.text()));
        let color = theme::color(tract_color(index.unwrap_or_default()));
        let fill = if shown { color } else { Color32::TRANSPARENT };
        let edge = if response.hovered() { ink } else { ink.gamma_multiply(0.6) };
        let swatch = Rect::from_min_size(at + vec2(0.0, 2.0), vec2(11.0, 11.0));
        painter.rect(swatch, 2.0, fill, egui::Stroke::new(1.0, edge), egui::StrokeKind::Outside);
        let text_color = ink.gamma_multiply(if shown { 1.0 } else { 0.55 });
        painter.galley_with_override_text_color(at + vec2(17.0, 0.0), galley, text_color);
        if response.on_hover_text(command.tooltip()).clicked() {
            out.push(command);
        }
    }
}
