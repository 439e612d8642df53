//! Fibre tracts in the context view: prepared once a case, their list over the picture, and what a fibre
//! under the pointer is.

use std::sync::Arc;

use egui::{Align2, Color32, FontId, Id, Rect, Role, Sense, Ui, WidgetInfo, pos2, vec2};
use glioscope_core::{
    MaskBits, Progress, Selection, Sides, Tracts,
    case::{Case, CaseTracts},
    tract_distance::SelectedCells,
};
use glioscope_render::{DrawnTubes, PickedFiber, TubeSet, tract_color};

use super::{Handle, ViewContext, closeup};
use crate::{
    commands::Command,
    format,
    jobs::{Derived, Lookup},
    window::waker,
};

/// From line to line of the list.
const LINE_POINTS: f32 = 17.0;

/// What the distance of a fibre depends on besides the fibre.
#[derive(PartialEq)]
struct CellsKey {
    case: Handle<Case>,
    time: usize,
    selection: Selection,
}

/// What is derived from a case's fibre tracts; never saved.
#[derive(Default)]
pub struct TractsState {
    sets: Derived<Handle<Case>, Vec<Arc<TubeSet>>>,
    /// The selection, ready to be asked for distances; `None` where it is empty.
    cells: Derived<CellsKey, Option<SelectedCells>>,
}

/// Whether `tracts` may be drawn beside the masks of `case`: only where both say which side is which.
fn is_placed(case: &Case, tracts: &Tracts) -> bool {
    tracts.sides() == Sides::Known && case.grid.sides() == Sides::Known
}

/// A set for each of the case's files of tracts, in their order; an empty one where the place is not
/// known.
fn prepare(case: &Case, progress: &Progress) -> Result<Vec<Arc<TubeSet>>, String> {
    let nothing = Tracts::new(Vec::new(), vec![0], Sides::Unknown);
    let mut sets = Vec::new();
    for (n, CaseTracts { id, tracts }) in case.tracts.iter().enumerate() {
        progress.say(format!("preparing {id}"));
        let drawn = nothing.as_ref().filter(|_| !is_placed(case, tracts)).unwrap_or(tracts);
        let set = TubeSet::new(drawn, tract_color(n), TubeSet::RADIUS_MM, progress);
        sets.push(Arc::new(set.map_err(|e| e.to_string())?));
    }
    Ok(sets)
}

impl TractsState {
    /// Whether a worker is at something that changes the picture.
    pub fn working(&self) -> bool {
        self.sets.working()
    }

    /// The case's tracts as the document shows them; what to say meanwhile where they aren't ready.
    pub fn drawn(
        &mut self,
        ui: &Ui,
        view: &ViewContext<'_>,
        wait: bool,
    ) -> (Vec<DrawnTubes>, Option<String>) {
        if view.case.tracts.is_empty() {
            return (Vec::new(), None);
        }
        let case = Arc::clone(view.case);
        let work = move |progress: &Progress| prepare(&case, progress);
        match self.sets.get(Handle::of(view.case), wait, waker(ui.ctx()), work) {
            Lookup::Ready(sets) => {
                let hidden = &view.doc.edit.hidden_tracts;
                let drawn = sets
                    .iter()
                    .zip(&view.case.tracts)
                    .map(|(set, of)| DrawnTubes { set: Arc::clone(set), shown: !hidden.contains(&of.id) });
                (drawn.collect(), None)
            }
            Lookup::Working(_) => {
                ui.request_repaint_after(std::time::Duration::from_millis(100));
                (Vec::new(), Some("Preparing fibre tracts…".into()))
            }
            Lookup::Failed(why) => (Vec::new(), Some(why.to_owned())),
        }
    }

    /// What a fibre is called, and how far it runs from the selection once that is known.
    pub fn words(&mut self, ui: &Ui, view: &ViewContext<'_>, wait: bool, picked: PickedFiber) -> String {
        let Some(CaseTracts { id, tracts }) = view.case.tracts.get(picked.set) else {
            return String::new();
        };
        let name = format!("{id}, fibre {}", picked.fiber);
        let time = view.doc.nav.time;
        let key = CellsKey { case: Handle::of(view.case), time, selection: view.doc.edit.selection.clone() };
        let (index, selection) = (Arc::clone(&view.time_point.index), view.doc.edit.selection.clone());
        let work = move |_: &Progress| {
            let bits = MaskBits::from_fn(index.grid().dims(), |linear| selection.shows(index.get(linear)));
            Ok(SelectedCells::new(index.grid(), &bits))
        };
        let Lookup::Ready(cells) = self.cells.get(key, wait, waker(ui.ctx()), work) else { return name };
        match cells.as_ref().as_ref().and_then(|cells| cells.nearest(tracts.fiber(picked.fiber))) {
            Some(near) if near.distance_mm > 0.0 => {
                format!("{name}, {:.1} mm from the selection", near.distance_mm)
            }
            Some(_) => format!("{name}, through the selection"),
            None => name,
        }
    }
}

/// The list of tracts below `corner`: colour, name, and a click shows or hides.
pub fn list(
    ui: &Ui,
    view: &ViewContext<'_>,
    rect: Rect,
    top: f32,
    drawn: &[DrawnTubes],
    out: &mut Vec<Command>,
) {
    let case = view.case;
    if case.tracts.is_empty() {
        return;
    }
    let dark = ui.visuals().dark_mode;
    let ink = closeup::ink(dark);
    let painter = ui.painter().with_clip_rect(rect);
    let font = FontId::proportional(12.0);
    // The scale bar is below.
    let room = ((rect.bottom() - 60.0 - top) / LINE_POINTS).max(0.0) as usize;
    let rows = if case.tracts.len() > room { room.saturating_sub(1) } else { case.tracts.len() };
    let rest = case.tracts.len() - rows;
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
    if rest > 0 {
        lines.push((None, format!("and {rest} more: see the menu View")));
    }
    let left = rect.left() + 10.0;
    for (row, (of, words)) in lines.into_iter().enumerate() {
        let galley = painter.layout_no_wrap(words, font.clone(), ink);
        let at = pos2(left, top + row as f32 * LINE_POINTS);
        let line = Rect::from_min_size(at, vec2(galley.size().x + 17.0, LINE_POINTS - 2.0));
        closeup::plate(&painter, line, dark);
        let Some(CaseTracts { id, .. }) = of.and_then(|n| case.tracts.get(n)) else {
            painter.galley(at, galley, ink);
            continue;
        };
        let shown = !view.doc.edit.hidden_tracts.contains(id);
        let response = ui.interact(line, Id::unique(("fibre tracts", id)), Sense::click());
        let command = Command::ToggleTracts(id.clone());
        response.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, shown, command.text()));
        let [r, g, b] = tract_color(of.unwrap_or_default());
        let fill = if shown { Color32::from_rgb(r, g, b) } else { Color32::TRANSPARENT };
        let edge = if response.hovered() { ink } else { ink.gamma_multiply(0.6) };
        let swatch = Rect::from_min_size(at + vec2(0.0, 2.0), vec2(11.0, 11.0));
        painter.rect(swatch, 2.0, fill, egui::Stroke::new(1.0, edge), egui::StrokeKind::Outside);
        let faint = ink.gamma_multiply(if shown { 1.0 } else { 0.55 });
        painter.galley_with_override_text_color(at + vec2(17.0, 0.0), galley, faint);
        if response.on_hover_text(command.tooltip()).clicked() {
            out.push(command);
        }
    }
}

/// A note in the middle of the lower edge, for what is on its way.
pub fn note(ui: &Ui, rect: Rect, words: &str) {
    let ink = closeup::ink(ui.visuals().dark_mode);
    let at = rect.center_bottom() - vec2(0.0, 14.0);
    let painter = ui.painter().with_clip_rect(rect);
    painter.text(at, Align2::CENTER_BOTTOM, words, FontId::proportional(12.0), ink);
}
