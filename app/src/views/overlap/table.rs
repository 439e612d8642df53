//! The table of regions (thesis 7.7) and the table of agreement metrics of mask pairs.

use egui::{Align, Checkbox, Label, Layout, RichText, Sense, Ui, vec2};
use egui_extras::{Column, TableBuilder};
use glioscope_core::measure::{PAIR_METRICS, Pair};

use super::{OverlapInput, OverlapMode, Shown, Target, interact::click_row, paint::dim_text};
use crate::{
    command::{Commands, EditCommand},
    format, theme,
};

/// Height of a row, points.
const ROW_PT: f32 = 19.0;

/// Rows by size, largest first.
fn rows(input: &OverlapInput<'_>) -> Vec<Target> {
    let mut rows: Vec<Target> = match input.mode {
        OverlapMode::Regions => input.regions.list().iter().map(|r| Target::Region(r.bits)).collect(),
        OverlapMode::WholeMasks => (0..input.regions.mask_ids().len()).map(Target::Mask).collect(),
    };
    rows.sort_by_key(|&t| std::cmp::Reverse(input.voxels(t)));
    rows
}

/// Height of the table of regions, points.
pub fn height(input: &OverlapInput<'_>) -> f32 {
    (rows(input).len() + 2) as f32 * (ROW_PT + 3.0) + 6.0
}

/// Check box, colours, name, volume, share and (if the pane is wide enough) voxels of each region, or of each mask in
/// whole-mask mode; below, those of the union. Returns the row under the cursor.
pub fn regions(
    ui: &mut Ui,
    input: &OverlapInput<'_>,
    marked: Option<Target>,
    out: &mut Commands,
) -> Option<Target> {
    let with_voxels = ui.available_width() > 300.0;
    let rows = rows(input);
    let mut hovered = None;
    ui.spacing_mut().item_spacing.x = 4.0;
    let mut builder = TableBuilder::new(ui)
        .id_salt("regions")
        .vscroll(false)
        .striped(true)
        .sense(Sense::CLICK)
        .cell_layout(Layout::right_to_left(Align::Center))
        .column(Column::remainder().at_least(60.0).clip(true))
        .column(Column::exact(64.0))
        .column(Column::exact(50.0));
    if with_voxels {
        builder = builder.column(Column::exact(72.0));
    }
    let table = builder.header(ROW_PT, |mut row| {
        row.col(|ui| {
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                ui.strong(if input.mode == OverlapMode::Regions { "Region" } else { "Mask" });
            });
        });
        for (name, hint) in [("Size", "Millilitres"), ("Share", "Share of the union of all masks")] {
            row.col(|ui| {
                ui.strong(name).on_hover_text(hint);
            });
        }
        if with_voxels {
            row.col(|ui| {
                ui.strong("Voxels");
            });
        }
    });
    table.body(|mut body| {
        for &target in &rows {
            body.row(ROW_PT, |mut row| {
                row.set_hovered(marked == Some(target));
                row.col(|ui| {
                    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                        name_cell(ui, input, target, out);
                    });
                });
                let hidden = input.drawn_visibility(target) == Shown::None;
                let mut number = |text: String| {
                    row.col(|ui| {
                        let text = RichText::new(text);
                        let text = if hidden { text.color(dim_text(ui)) } else { text };
                        ui.add(Label::new(text).selectable(false));
                    });
                };
                number(format::ml(input.ml(target)));
                number(format::percent(input.share(target)));
                if with_voxels {
                    number(format::count(input.voxels(target)));
                }
                let response = row.response();
                if response.contains_pointer() {
                    hovered = Some(target);
                }
                click_row(&response, target, out);
            });
        }
        body.row(ROW_PT, |mut row| {
            row.col(|ui| {
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    ui.strong("Union");
                });
            });
            row.col(|ui| {
                ui.strong(format::ml(input.regions.union_ml()));
            });
            row.col(|ui| {
                ui.strong(format::percent(if input.regions.union_voxels() > 0 { 1.0 } else { 0.0 }));
            });
            if with_voxels {
                row.col(|ui| {
                    ui.strong(format::count(input.regions.union_voxels()));
                });
            }
        });
    });
    hovered
}

fn name_cell(ui: &mut Ui, input: &OverlapInput<'_>, target: Target, out: &mut Commands) {
    let shown = input.drawn_visibility(target);
    let mut on = shown == Shown::All;
    ui.spacing_mut().item_spacing.x = 4.0;
    let name = input.name(target);
    if !input.is_picture {
        let check = Checkbox::without_text(&mut on).indeterminate(shown == Shown::Some);
        let response = ui.add(check);
        response.widget_info(|| {
            let text = format!("Show {name}");
            egui::WidgetInfo::selected(egui::Role::CheckBox, true, shown == Shown::All, text)
        });
        if response.changed() {
            out.push(match target {
                Target::Region(bits) => EditCommand::SetRegion(bits, on),
                Target::Mask(k) => EditCommand::ToggleMask(k),
            });
        }
    }
    swatch(ui, input, target);
    let text = RichText::new(input.title(target));
    let label = ui.add(
        Label::new(if shown == Shown::None { text.color(dim_text(ui)) } else { text })
            .truncate()
            .selectable(false),
    );
    label.on_hover_text(format!("{name}. Click: on or off. Double-click: only this."));
}

/// The region's colour as in the 3D views, above the colours of its masks.
fn swatch(ui: &mut Ui, input: &OverlapInput<'_>, target: Target) {
    let (rect, _) = ui.allocate_exact_size(vec2(16.0, 13.0), Sense::hover());
    let painter = ui.painter();
    match target {
        Target::Mask(k) => {
            painter.rect_filled(rect, 2.0, theme::color(input.colors.mask(k)));
        }
        Target::Region(bits) => {
            painter.rect_filled(rect, 2.0, theme::color(input.colors.region(bits)));
            let masks: Vec<usize> = (0..32).filter(|k| bits >> k & 1 == 1).collect();
            if masks.len() > 1 {
                let width = rect.width() / masks.len() as f32;
                for (i, &k) in masks.iter().enumerate() {
                    let left = rect.left() + i as f32 * width;
                    let part =
                        egui::Rect::from_x_y_ranges(left..=left + width, rect.bottom() - 4.0..=rect.bottom());
                    painter.rect_filled(part, 0.0, theme::color(input.colors.mask(k)));
                }
            }
        }
    }
    let border = ui.visuals().widgets.noninteractive.fg_stroke.color.gamma_multiply(0.5);
    painter.rect_stroke(rect, 2.0, egui::Stroke::new(1.0, border), egui::StrokeKind::Outside);
}

/// All metrics of all pairs of masks; draws nothing without pairs.
pub fn agreement(ui: &mut Ui, input: &OverlapInput<'_>, pairs: &[Pair]) {
    if pairs.is_empty() {
        return;
    }
    let left = |ui: &mut Ui, add: &mut dyn FnMut(&mut Ui)| {
        ui.with_layout(Layout::left_to_right(Align::Center), |ui| add(ui));
    };
    let mut builder = TableBuilder::new(ui)
        .id_salt("agreement")
        .vscroll(false)
        .striped(true)
        .cell_layout(Layout::right_to_left(Align::Center))
        .column(Column::remainder().at_least(60.0).clip(true));
    for metric in PAIR_METRICS {
        // As wide as the longer of its name and its values.
        let characters = metric.name.len().max(metric.print(Some(1.0), 0).len()) as f32;
        builder = builder.column(Column::exact(7.0 + 7.0 * characters));
    }
    builder
        .header(ROW_PT, |mut row| {
            row.col(|ui| {
                left(ui, &mut |ui| {
                    ui.strong("Agreement");
                });
            });
            for metric in PAIR_METRICS {
                row.col(|ui| {
                    ui.strong(metric.name).on_hover_text(metric.definition);
                });
            }
        })
        .body(|mut body| {
            for pair in pairs {
                let name = |id: &str| {
                    let k = input.regions.mask_ids().iter().position(|mask| mask == id);
                    k.and_then(|k| input.names.get(k)).cloned().unwrap_or_else(|| id.to_owned())
                };
                body.row(ROW_PT, |mut row| {
                    row.col(|ui| {
                        left(ui, &mut |ui| {
                            ui.add(Label::new(format!("{} – {}", name(&pair.a), name(&pair.b))).truncate());
                        });
                    });
                    for (metric, value) in pair.metrics() {
                        row.col(|ui| {
                            ui.label(metric.print(value, 0));
                        });
                    }
                });
            }
        });
}
