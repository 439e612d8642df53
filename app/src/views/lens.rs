//! What is in the lens: millilitres and shares of every region inside it, counted anew when the lens
//! moves.

use std::sync::{Arc, Weak};

use egui::{Align, Color32, Id, IdSalt, Layout, RichText, ScrollArea, Sense, Ui, vec2};
use egui_extras::{Column, TableBuilder};
use glioscope_core::{RegionVolume, inside_lens::voxels_inside};
use glioscope_render::Lens;

use super::ViewContext;
use crate::{commands::Command, format};

const ROW: f32 = 19.0;

/// What was counted last, in egui's memory: the lens changes less often than frames are drawn.
#[derive(Clone)]
struct Counted {
    tumor: Weak<RegionVolume>,
    lens: Lens,
    found: Arc<Vec<(u32, u64)>>,
    /// How often it was counted: a test that an idle view counts nothing reads it.
    counts: u64,
}

fn counted(ui: &Ui, memory: Id, tumor: &Arc<RegionVolume>, lens: Lens) -> Arc<Vec<(u32, u64)>> {
    let before = ui.data(|data| data.get_temp::<Counted>(memory));
    if let Some(counted) = &before
        && counted.lens == lens
        && counted.tumor.ptr_eq(&Arc::downgrade(tumor))
    {
        return counted.found.clone();
    }
    let found = Arc::new(voxels_inside(tumor, lens.center_mm, lens.radius_mm));
    let counts = before.map_or(1, |before| before.counts + 1);
    let counted = Counted { tumor: Arc::downgrade(tumor), lens, found: found.clone(), counts };
    ui.data_mut(|data| data.insert_temp(memory, counted));
    found
}

/// Draws the table into the rest of `ui`. `tumor` is what the closeup draws.
pub fn show(ui: &mut Ui, view: &ViewContext<'_>, tumor: Option<&Arc<RegionVolume>>, out: &mut Vec<Command>) {
    let lens = view.doc.edit.lens;
    let (true, Some(tumor)) = (view.doc.edit.lens_on, tumor) else {
        ui.vertical_centered(|ui| {
            ui.add_space(ui.available_height() * 0.3);
            if tumor.is_none() {
                ui.label("No mask is active at this time point.");
            } else {
                ui.label("The lens is off.");
                let command = Command::ToggleLens;
                if ui.button("Switch the lens on").on_hover_text(command.tooltip()).clicked() {
                    out.push(command);
                }
            }
        });
        return;
    };
    let found = counted(ui, ui.scope_id().with(IdSalt::new("in the lens")), tumor, lens);
    let voxels: u64 = found.iter().map(|(_, n)| n).sum();
    let ml = |voxels: u64| tumor.grid().volume_ml(voxels);
    let ball_ml = 4.0 / 3.0 * std::f64::consts::PI * lens.radius_mm.powi(3) / 1000.0;
    ui.label(format!(
        "Ball of {} radius, {}; in it {} of {} in masks.",
        super::ruler::length_text(lens.radius_mm),
        format::ml(ball_ml),
        format::ml(ml(voxels)),
        format::ml(view.time_point.regions.union_ml())
    ));
    ui.add_space(4.0);
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| table(ui, view, &found, voxels, &ml));
}

/// One row: a region's name and colour, and what is written of it.
struct Row {
    bits: u32,
    name: String,
    cells: [String; 3],
}

fn rows(view: &ViewContext<'_>, found: &[(u32, u64)], voxels: u64, ml: &dyn Fn(u64) -> f64) -> Vec<Row> {
    let regions = &view.time_point.regions;
    let mut found = found.to_vec();
    found.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let share =
        |n: u64, of: u64| if of == 0 { "0.0 %".into() } else { format::percent(n as f64 / of as f64) };
    let mut rows: Vec<Row> = found
        .into_iter()
        .map(|(bits, n)| {
            let alone = bits.count_ones() == 1 && regions.mask_ids().len() > 1;
            let name = format!("{}{}", regions.name(bits), if alone { " only" } else { "" });
            let of_region = regions.get(bits).map_or(0, |r| r.voxels);
            Row { bits, name, cells: [format::ml(ml(n)), share(n, voxels), share(n, of_region)] }
        })
        .collect();
    let all = regions.union_voxels();
    let whole = if voxels > 0 { "100.0 %".into() } else { share(0, 0) };
    rows.push(Row {
        bits: 0,
        name: "All".into(),
        cells: [format::ml(ml(voxels)), whole, share(voxels, all)],
    });
    rows
}

fn table(ui: &mut Ui, view: &ViewContext<'_>, found: &[(u32, u64)], voxels: u64, ml: &dyn Fn(u64) -> f64) {
    let rows = rows(view, found, voxels, ml);
    ui.spacing_mut().item_spacing.x = 4.0;
    TableBuilder::new(ui)
        .id_salt("in the lens")
        .vscroll(false)
        .striped(true)
        .cell_layout(Layout::right_to_left(Align::Center))
        .column(Column::remainder().at_least(60.0).clip(true))
        .column(Column::exact(64.0))
        .column(Column::exact(58.0))
        .column(Column::exact(66.0))
        .header(ROW, |mut row| {
            row.col(|ui| {
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| ui.strong("In the lens"));
            });
            for (name, hint) in [
                ("Size", "Millilitres inside the lens: voxels whose centre is in the ball"),
                ("Of lens", "Share of all that is in masks and inside the lens"),
                ("Of region", "How much of the region is inside the lens"),
            ] {
                row.col(|ui| {
                    ui.strong(name).on_hover_text(hint);
                });
            }
        })
        .body(|mut body| {
            for line in rows {
                body.row(ROW, |mut row| {
                    row.col(|ui| {
                        ui.with_layout(Layout::left_to_right(Align::Center), |ui| name(ui, view, &line));
                    });
                    for words in &line.cells {
                        row.col(|ui| {
                            let words = RichText::new(words);
                            ui.label(if line.bits == 0 { words.strong() } else { words });
                        });
                    }
                });
            }
        });
}

fn name(ui: &mut Ui, view: &ViewContext<'_>, line: &Row) {
    if line.bits == 0 {
        ui.strong(&line.name);
        return;
    }
    let (rect, _) = ui.allocate_exact_size(vec2(14.0, 12.0), Sense::hover());
    let [r, g, b] = view.colors.region(line.bits);
    let border = ui.visuals().widgets.noninteractive.fg_stroke.color.gamma_multiply(0.5);
    let stroke = egui::Stroke::new(1.0, border);
    ui.painter().rect(rect, 2.0, Color32::from_rgb(r, g, b), stroke, egui::StrokeKind::Outside);
    let hidden = !view.doc.edit.selection.shows(line.bits);
    let words = RichText::new(if hidden { format!("{} (hidden)", line.name) } else { line.name.clone() });
    let label = egui::Label::new(if hidden { words.weak() } else { words }).truncate();
    ui.add(label).on_hover_text(format!("{}: {} in the lens", line.name, line.cells[0]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use glioscope_core::{Grid, Mask, MaskBits, Regions, TumorIndex};

    #[test]
    fn a_lens_that_rests_is_counted_once() {
        let grid = Grid::axis_aligned([8, 8, 8], DVec3::ONE, DVec3::ZERO).unwrap();
        let mask = Mask::new("a", grid.clone(), MaskBits::from_fn([8, 8, 8], |_| true)).unwrap();
        let index = TumorIndex::new(grid, &[&mask]).unwrap();
        let volume = || Arc::new(RegionVolume::of(&index, &Regions::of(&index)).unwrap());
        let (tumor, other) = (volume(), volume());
        let small = Lens { center_mm: DVec3::splat(3.0), radius_mm: 1.0 };
        let large = Lens { radius_mm: 1.5, ..small };
        let ctx = egui::Context::default();
        let steps =
            [(&tumor, small, 7, 1), (&tumor, small, 7, 1), (&tumor, large, 19, 2), (&other, large, 19, 3)];
        for (tumor, lens, voxels, counts) in steps {
            let mut output = ctx.run_ui(egui::RawInput::default(), |ui| {
                let memory = Id::unique("test");
                assert_eq!(*counted(ui, memory, tumor, lens), [(1, voxels)]);
                let remembered = ui.data(|data| data.get_temp::<Counted>(memory)).unwrap();
                assert_eq!(remembered.counts, counts);
            });
            // There is no screen to bring textures to.
            output.textures_delta.clear();
        }
    }
}
