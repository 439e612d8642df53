//! Contents of the lens: volume and shares of every region inside it, recounted when the lens changes.

use egui::{Align, Layout, RichText, ScrollArea, Sense, Ui, vec2};
use egui_extras::{Column, TableBuilder};

use super::{
    draw,
    overlap::{Target, interact::click_row},
    pane::{Input, Pane, Stage},
};
use crate::{
    command::{Command, Commands, EditCommand},
    format,
    model::document::ball_ml,
    theme,
};

/// Height of a row, points.
const ROW_PT: f32 = 19.0;

/// The pane of the lens's contents.
#[derive(Default)]
pub struct LensPane;

impl Pane for LensPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        draw::padded(ui, |ui| content(ui, stage, out));
    }
}

fn content(ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
    let input = stage.input;
    let lens = input.doc.edit.lens;
    let (true, Some(tumor)) = (input.doc.edit.lens_on, input.tumor) else {
        empty_message(ui, input.tumor.is_none(), out);
        return;
    };
    let Some((counts, is_current)) = stage.results.numbers.in_lens(tumor, lens, stage.ask) else {
        ui.weak("Counting what is in the lens…");
        return;
    };
    let voxels: u64 = counts.iter().map(|(_, n)| n).sum();
    let ml = |voxels: u64| tumor.grid().volume_ml(voxels);
    let ball_ml = ball_ml(lens.radius_mm);
    let size_in_lens = if is_current {
        format::ml(ml(voxels))
    } else {
        // The counts below are of the previous lens.
        "…".to_owned()
    };
    ui.label(format!(
        "Ball of {} radius, {}; in it {size_in_lens} of {} in masks.",
        format::length_mm(lens.radius_mm),
        format::ml(ball_ml),
        format::ml(input.time_point.regions.union_ml())
    ));
    ui.add_space(4.0);
    ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        if !is_current {
            ui.multiply_opacity(0.5);
        }
        table(ui, &input, &counts, voxels, &ml, out);
    });
}

fn empty_message(ui: &mut Ui, no_tumor: bool, out: &mut Commands) {
    ui.vertical_centered(|ui| {
        ui.add_space(ui.available_height() * 0.3);
        if no_tumor {
            ui.label("No mask is active at this time point.");
            return;
        }
        ui.label("The lens is off.");
        let command = Command::from(EditCommand::ToggleLens);
        if ui.button("Switch the lens on").on_hover_text(command.tooltip()).clicked() {
            out.push(command);
        }
    });
}

/// One row: a region and its values; `bits` is 0 in the row of the total.
struct Row {
    bits: u32,
    name: String,
    cells: [String; 3],
}

fn rows(input: &Input<'_>, counts: &[(u32, u64)], voxels: u64, ml: &dyn Fn(u64) -> f64) -> Vec<Row> {
    let regions = &input.time_point.regions;
    let mut counts = counts.to_vec();
    counts.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let share = |n: u64, total: u64| {
        if total == 0 { "0.0 %".into() } else { format::percent(n as f64 / total as f64) }
    };
    let mut rows: Vec<Row> = counts
        .into_iter()
        .map(|(bits, n)| {
            let is_single_mask = bits.count_ones() == 1 && regions.mask_ids().len() > 1;
            let name = format!(
                "{}{}",
                input.doc.edit.masks.region(regions.mask_ids(), bits),
                if is_single_mask { " only" } else { "" }
            );
            let region_voxels = regions.get(bits).map_or(0, |r| r.voxels);
            Row { bits, name, cells: [format::ml(ml(n)), share(n, voxels), share(n, region_voxels)] }
        })
        .collect();
    let union_voxels = regions.union_voxels();
    let whole = if voxels > 0 { "100.0 %".into() } else { share(0, 0) };
    rows.push(Row {
        bits: 0,
        name: "All".into(),
        cells: [format::ml(ml(voxels)), whole, share(voxels, union_voxels)],
    });
    rows
}

fn table(
    ui: &mut Ui,
    input: &Input<'_>,
    counts: &[(u32, u64)],
    voxels: u64,
    ml: &dyn Fn(u64) -> f64,
    out: &mut Commands,
) {
    let rows = rows(input, counts, voxels, ml);
    ui.spacing_mut().item_spacing.x = 4.0;
    TableBuilder::new(ui)
        .id_salt("in the lens")
        .vscroll(false)
        .striped(true)
        .sense(Sense::CLICK)
        .cell_layout(Layout::right_to_left(Align::Center))
        .column(Column::remainder().at_least(60.0).clip(true))
        .column(Column::exact(64.0))
        .column(Column::exact(58.0))
        .column(Column::exact(66.0))
        .header(ROW_PT, |mut row| {
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
                body.row(ROW_PT, |mut row| {
                    row.col(|ui| {
                        ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                            name_cell(ui, input, &line);
                        });
                    });
                    for text in &line.cells {
                        row.col(|ui| {
                            let text = RichText::new(text);
                            let text = if line.bits == 0 { text.strong() } else { text };
                            ui.add(egui::Label::new(text).selectable(false));
                        });
                    }
                    if line.bits != 0 {
                        click_row(&row.response(), Target::Region(line.bits), out);
                    }
                });
            }
        });
}

fn name_cell(ui: &mut Ui, input: &Input<'_>, line: &Row) {
    if line.bits == 0 {
        ui.strong(&line.name);
        return;
    }
    let (rect, _) = ui.allocate_exact_size(vec2(14.0, 12.0), Sense::hover());
    let border = ui.visuals().widgets.noninteractive.fg_stroke.color.gamma_multiply(0.5);
    let stroke = egui::Stroke::new(1.0, border);
    ui.painter().rect(
        rect,
        2.0,
        theme::color(input.colors.region(line.bits)),
        stroke,
        egui::StrokeKind::Outside,
    );
    let hidden = !input.selection.shows(line.bits);
    let text = RichText::new(if hidden { format!("{} (hidden)", line.name) } else { line.name.clone() });
    let label = egui::Label::new(if hidden { text.weak() } else { text }).truncate().selectable(false);
    ui.add(label).on_hover_text(format!("{}: {} in the lens", line.name, line.cells[0]));
}
