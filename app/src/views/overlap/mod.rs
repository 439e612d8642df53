//! The tumour overlap diagram (thesis 7.5 and 7.7): sizes and visibility of the regions.
//!
//! Up to three masks are drawn as a ring around a circle ([`ring`]), with the bar of whole masks below; more masks as
//! an UpSet plot. Beside or below it are the tables of regions and of agreement. All parts read [`OverlapInput`] and
//! write commands; none changes the selection itself.

mod bar;
pub mod interact;
mod matrix;
pub mod paint;
pub mod ring;
mod ring_view;
mod table;
mod target;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod upset;

use egui::{Align, Layout, Rect, RichText, ScrollArea, Sense, Ui, pos2, vec2};
use glioscope_core::{Regions, Selection, measure::Pair};
use glioscope_render::MaskColors;

pub use target::Target;

use super::{
    draw,
    pane::{Pane, Stage},
};
use crate::{
    command::{Commands, EditCommand},
    model::{
        OverlapMode,
        overlap::{MAX_RING_MASKS, Shown},
    },
    world::jobs::Lookup,
};

/// The pane of the overlap diagram.
#[derive(Default)]
pub struct OverlapPane;

impl Pane for OverlapPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        let input = stage.input;
        let names = input.doc.edit.masks.names(input.time_point.regions.mask_ids());
        let diagram = OverlapInput {
            names: &names,
            regions: &input.time_point.regions,
            selection: input.selection,
            colors: input.colors,
            mode: input.doc.edit.overlap_mode,
            is_picture: input.is_picture,
        };
        let pairs = match stage.results.numbers.agreement(input.time_point, stage.ask) {
            Lookup::Ready(numbers) => numbers.pairs.as_slice(),
            Lookup::Working(_) | Lookup::Failed(_) => &[],
        };
        draw::padded(ui, |ui| {
            show(ui, &diagram, pairs, out);
        });
    }
}

/// Input of the view.
#[derive(Clone, Copy)]
pub struct OverlapInput<'a> {
    /// Sizes of the regions.
    pub regions: &'a Regions,
    /// Names of the masks.
    pub names: &'a [String],
    /// The regions shown.
    pub selection: &'a Selection,
    /// Colours of the masks.
    pub colors: &'a MaskColors,
    /// Whether a click toggles a region or a whole mask.
    pub mode: OverlapMode,
    /// Whether it is drawn without controls: for a picture on paper.
    pub is_picture: bool,
}

/// Smallest width of the ring with its labels, points.
const MIN_RING_WIDTH: f32 = 200.0;

/// Draws the whole view (diagram, bar, tables) into the rest of `ui` and pushes the user's commands to `out`. `pairs`:
/// agreement of each pair of masks; empty until it is computed. Returns the bits of the region under the cursor, in the
/// diagram or in the table; `None` in whole-mask mode.
pub fn show(ui: &mut Ui, input: &OverlapInput<'_>, pairs: &[Pair], out: &mut Commands) -> Option<u32> {
    let is_single = input.regions.mask_ids().len() == 1;
    if !is_single {
        header(ui, input, out);
    }
    if input.regions.union_voxels() == 0 {
        empty_message(ui, input);
        return None;
    }
    let hovered_row_id = ui.scope_id().with("pointed at in the table");
    let marked: Option<Target> = ui.data(|d| d.get_temp(hovered_row_id)).flatten();
    if is_single {
        // A ring of one mask says nothing.
        let hovered = ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            let hovered = table::regions(ui, input, marked, out);
            ui.add_space(6.0);
            ui.weak("One mask: no overlaps.");
            hovered
        });
        return hovered.inner.and_then(Target::region);
    }
    let size = ui.available_size();
    let mut in_diagram = None;
    let mut in_table = None;
    let matrix = matrix::size(input, pairs);
    if side_by_side(input, size) {
        let table_width = (size.x * 0.48).clamp(215.0, 340.0);
        ui.horizontal_top(|ui| {
            let left = vec2(size.x - table_width - ui.spacing().item_spacing.x, size.y);
            ui.allocate_ui(left, |ui| in_diagram = diagram_in(ui, left, input, marked, out));
            ui.vertical(|ui| {
                ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
                    if matrix.is_some() {
                        ui.scope(|ui| matrix::show(ui, input, pairs));
                        ui.add_space(8.0);
                    }
                    in_table = tables(ui, input, pairs, in_diagram, out);
                });
            });
        });
    } else {
        let matrix = matrix.map(|needed| (needed, matrix_place(input, size, needed)));
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            let mut left = size;
            if let Some((needed, MatrixPlace::Above)) = matrix {
                ui.scope(|ui| matrix::show(ui, input, pairs));
                ui.add_space(4.0);
                left.y -= needed.y + 4.0;
            }
            let height = stacked_height(input, left);
            let mut diagram = vec2(ui.available_width(), height);
            if let Some((needed, MatrixPlace::Beside)) = matrix {
                diagram.x -= needed.x + 8.0;
                let corner = ui.cursor().min + vec2(diagram.x + 8.0, 0.0);
                let mut beside =
                    ui.new_child(egui::UiBuilder::new().max_rect(Rect::from_min_size(corner, needed)));
                matrix::show(&mut beside, input, pairs);
            }
            in_diagram = diagram_in(ui, diagram, input, marked, out);
            ui.add_space(4.0);
            if let Some((_, MatrixPlace::Below)) = matrix {
                ui.scope(|ui| matrix::show(ui, input, pairs));
                ui.add_space(8.0);
            }
            in_table = tables(ui, input, pairs, in_diagram, out);
        });
    }
    if in_table != marked {
        ui.data_mut(|d| d.insert_temp(hovered_row_id, in_table));
        ui.ctx().request_repaint();
    }
    in_diagram.or(in_table).and_then(Target::region)
}

/// Draws only the diagram and the bar, filling `ui`: for pictures. While all regions are shown, the area of each mask's
/// pure colour is proportional to the mask's size. Returns the region under the cursor, as [`show`].
pub fn show_diagram(ui: &mut Ui, input: &OverlapInput<'_>, out: &mut Commands) -> Option<u32> {
    if input.regions.union_voxels() == 0 {
        empty_message(ui, input);
        return None;
    }
    let size = ui.available_size();
    diagram_in(ui, size, input, None, out).and_then(Target::region)
}

/// Where the matrix of agreement stands while the tables are below the diagram.
#[derive(Clone, Copy, PartialEq, Eq)]
enum MatrixPlace {
    /// Above the UpSet plot.
    Above,
    /// Right of the ring.
    Beside,
    /// Between the diagram and the tables: the pane is too small for it to be seen at once with the diagram.
    Below,
}

fn matrix_place(input: &OverlapInput<'_>, size: egui::Vec2, needed: egui::Vec2) -> MatrixPlace {
    let free = size - needed;
    if is_ring(input) && free.x >= MIN_RING_WIDTH && needed.y + bar::HEIGHT_PT <= stacked_height(input, size)
    {
        MatrixPlace::Beside
    } else if !is_ring(input) && free.x >= 0.0 && free.y >= upset::min_height(input.regions.mask_ids().len())
    {
        MatrixPlace::Above
    } else {
        MatrixPlace::Below
    }
}

/// Height of the diagram above the tables, points.
fn stacked_height(input: &OverlapInput<'_>, size: egui::Vec2) -> f32 {
    let free_height = size.y - table::height(input) - 8.0;
    if is_ring(input) {
        return free_height.clamp((size.y * 0.8).min(220.0), size.x + bar::HEIGHT_PT);
    }
    // The plot fills the pane up to a strip that shows that the tables follow.
    let min_height = upset::min_height(input.regions.mask_ids().len());
    (size.y - 26.0).min(min_height * 1.6).max(min_height)
}

fn is_ring(input: &OverlapInput<'_>) -> bool {
    input.mode == OverlapMode::WholeMasks || input.regions.mask_ids().len() <= MAX_RING_MASKS
}

fn side_by_side(input: &OverlapInput<'_>, size: egui::Vec2) -> bool {
    if is_ring(input) { size.x >= 420.0 && size.x > 1.1 * size.y } else { size.x >= 860.0 }
}

fn header(ui: &mut Ui, input: &OverlapInput<'_>, out: &mut Commands) {
    let (all, hidden) = {
        let list = input.regions.list();
        (list.len(), list.iter().filter(|r| !input.selection.shows(r.bits)).count())
    };
    if input.is_picture {
        if hidden > 0 {
            ui.weak(format!("{} of {all} shown", all - hidden));
        }
        return;
    }
    ui.horizontal(|ui| {
        for (mode, name, hint) in [
            (OverlapMode::Regions, "Overlaps", "Show and select each overlap of the masks on its own"),
            (OverlapMode::WholeMasks, "Whole masks", "No overlaps: show and select whole masks"),
        ] {
            if ui.selectable_label(input.mode == mode, name).on_hover_text(hint).clicked()
                && input.mode != mode
            {
                out.push(EditCommand::SetOverlapMode(mode));
            }
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let button = ui.add_enabled(hidden > 0, egui::Button::new("Show all"));
            if button.clicked() {
                out.push(EditCommand::ShowAllRegions);
            }
            if hidden > 0 {
                ui.weak(format!("{} of {all} shown", all - hidden));
            }
        });
    });
}

fn empty_message(ui: &mut Ui, input: &OverlapInput<'_>) {
    let masks = input.names;
    let reason = match masks {
        [] => "The case has no mask.".to_owned(),
        [one] => format!("The mask {one} is empty."),
        all => format!("All {} masks are empty: {}.", all.len(), all.join(", ")),
    };
    ui.vertical_centered(|ui| {
        ui.add_space(ui.available_height() * 0.35);
        ui.label(RichText::new("No active voxels").heading());
        ui.weak(reason);
    });
}

fn tables(
    ui: &mut Ui,
    input: &OverlapInput<'_>,
    pairs: &[Pair],
    marked: Option<Target>,
    out: &mut Commands,
) -> Option<Target> {
    let hovered = table::regions(ui, input, marked, out);
    ui.add_space(10.0);
    table::agreement(ui, input, pairs);
    hovered
}

/// Ring and bar, or the UpSet plot, in `size`.
fn diagram_in(
    ui: &mut Ui,
    size: egui::Vec2,
    input: &OverlapInput<'_>,
    marked: Option<Target>,
    out: &mut Commands,
) -> Option<Target> {
    let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
    let id = ui.scope_id().with("overlap diagram");
    if !is_ring(input) {
        return upset::show(ui, id.with("upset"), rect, input, marked, out);
    }
    let masks = input.regions.mask_ids().len();
    let pieces = match input.mode {
        OverlapMode::Regions => {
            ring::pieces_of_regions(masks, |b| input.regions.get(b).map_or(0, |r| r.voxels))
        }
        OverlapMode::WholeMasks => ring::pieces_of_masks(masks, |k| input.regions.mask_voxels(k)),
    };
    let note = match input.mode {
        OverlapMode::Regions => "Area of a colour: size of its mask",
        OverlapMode::WholeMasks => "Whole masks, overlaps not considered",
    };
    let small = egui::TextStyle::Small.resolve(ui.style());
    let color = paint::dim_text(ui);
    ui.painter().text(rect.left_top(), egui::Align2::LEFT_TOP, note, small, color);
    let split = rect.bottom() - bar::HEIGHT_PT;
    let above = Rect::from_min_max(rect.min + vec2(0.0, 15.0), pos2(rect.right(), split - 4.0));
    let below = Rect::from_min_max(pos2(rect.left(), split), rect.max);
    let ring = ring_view::show(ui, id.with("ring"), above, &pieces, input, marked, out);
    let bar = bar::show(ui, id.with("bar"), below, input, marked.or(ring.hovered), out);
    ring.hovered.or(bar.hovered)
}
