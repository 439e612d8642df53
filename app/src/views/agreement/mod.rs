//! Metrics of agreement by a named convention: every pair of masks of the date, any two masks or regions of any dates, and all
//! masks as raters of one tumour.

mod operands;
mod raters;

use egui::{Align, ComboBox, DragValue, Layout, RichText, ScrollArea, Ui};
use egui_extras::{Column, TableBuilder};
use glioscope_core::measure::{
    Operand,
    conventions::{CONVENTIONS, Comparison, METRICS, MetricRow},
};

use super::{
    draw,
    pane::{Input, Pane, Stage},
};
use crate::{
    command::{Commands, EditCommand, LookCommand},
    model::{
        AgreementSetting, Edit, PaneId, Ruler, Shape,
        agreement::{PERCENTILE, TOLERANCE_MM},
    },
    world::{
        agreement::Agreed,
        jobs::{Lookup, progress_text},
    },
};

/// Height of a row, points.
const ROW: f32 = 20.0;
/// Width of a column of values, points.
const VALUE: f32 = 92.0;

/// The pane of agreement.
#[derive(Default)]
pub struct AgreementPane;

/// A column of the table.
struct Pair<'a> {
    title: String,
    time: usize,
    comparison: &'a Comparison,
}

impl Pane for AgreementPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        draw::padded(ui, |ui| {
            ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| content(ui, stage, out));
        });
    }
}

fn content(ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
    let input = stage.input;
    let old = &input.doc.edit.agreement;
    let mut new = old.clone();
    head(ui, &mut new);
    operands::show(ui, &input, &mut new);
    let agreed = match stage.results.agreement.get(input.case, input.time, old, stage.ask) {
        Lookup::Ready(agreed) => Some(agreed.clone()),
        Lookup::Working(progress) => {
            ui.weak(progress_text(progress));
            stage.results.agreement.last().cloned()
        }
        Lookup::Failed(error) => {
            ui.colored_label(ui.visuals().error_fg_color, error.to_string());
            None
        }
    };
    if let Some(agreed) = agreed {
        show(ui, &input, &agreed, out);
    }
    if new != *old {
        out.push(EditCommand::SetAgreement(Box::new(new)));
    }
}

fn head(ui: &mut Ui, new: &mut AgreementSetting) {
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Convention");
        let row = new.convention.row();
        let shown = ComboBox::from_id_salt("convention").selected_text(row.title).show_ui(ui, |ui| {
            for row in CONVENTIONS {
                ui.selectable_value(&mut new.convention, row.convention, row.title).on_hover_text(row.source);
            }
        });
        shown.response.labelled_by(label.id);
        let label = ui.label("percentile").on_hover_text("Of the robust Hausdorff distance");
        ui.add(DragValue::new(&mut new.percentile).range(PERCENTILE).speed(0.5)).labelled_by(label.id);
        let label = ui.label("tolerance").on_hover_text("Of the surface Dice");
        ui.add(DragValue::new(&mut new.tolerance_mm).range(TOLERANCE_MM).speed(0.1).suffix(" mm"))
            .labelled_by(label.id);
    });
    let row = new.convention.row();
    ui.collapsing("Definitions", |ui| {
        let lesions = if row.lesion_definition.is_empty() { "not matched" } else { row.lesion_definition };
        for (name, text) in [
            ("Surface", row.surface_definition),
            ("Percentile", row.percentile_definition),
            ("Lesions", lesions),
            ("Empty masks", row.empty_definition),
            ("Compared with", row.source),
        ] {
            ui.label(format!("{name}: {text}"));
        }
    });
}

fn show(ui: &mut Ui, input: &Input<'_>, agreed: &Agreed, out: &mut Commands) {
    let name = |id: &str| input.doc.edit.masks.name(id);
    let mut pairs: Vec<Pair<'_>> = Vec::new();
    let date = input.case.time_at(&agreed.date.time).unwrap_or(input.time);
    match &agreed.two {
        Some(([a, b], Ok(comparison))) => pairs.push(Pair {
            title: format!("{} – {}", operands::title(input, a), operands::title(input, b)),
            time: input.case.time_at(&b.time).unwrap_or(input.time),
            comparison,
        }),
        Some((_, Err(why))) => {
            ui.colored_label(ui.visuals().warn_fg_color, why);
        }
        None => {}
    }
    let of_date = agreed.date.pairs.iter();
    pairs.extend(of_date.map(|pair| Pair {
        title: format!("{} – {}", name(&pair.a), name(&pair.b)),
        time: date,
        comparison: &pair.comparison,
    }));
    if pairs.is_empty() {
        ui.weak("One mask at this date: choose two above");
        return;
    }
    table(ui, &pairs, &input.doc.edit, out);
    raters::show(ui, input, &agreed.date);
}

fn table(ui: &mut Ui, pairs: &[Pair<'_>], edit: &Edit, out: &mut Commands) {
    ui.spacing_mut().item_spacing.x = 4.0;
    let lesions = raters::lesion_rows(pairs.iter().map(|pair| pair.comparison.lesions.as_ref()));
    TableBuilder::new(ui)
        .id_salt("metrics")
        .vscroll(false)
        .striped(true)
        .cell_layout(Layout::left_to_right(Align::Center))
        .column(Column::exact(164.0).clip(true))
        .columns(Column::exact(VALUE).clip(true), pairs.len())
        .header(ROW, |mut row| {
            row.col(|ui| {
                ui.strong("Metric").on_hover_text("The first mask is the reference A, the second is B");
            });
            for pair in pairs {
                row.col(|ui| {
                    ui.strong(&pair.title).on_hover_text(&pair.title);
                });
            }
        })
        .body(|mut body| {
            for (number, metric) in METRICS.iter().enumerate() {
                body.row(ROW, |mut row| {
                    row.col(|ui| {
                        let percentile = pairs.first().map_or(95.0, |pair| pair.comparison.percentile);
                        let title = match metric.key {
                            "hd95_mm" => format!("Hausdorff, {percentile} %"),
                            _ => metric.name.to_owned(),
                        };
                        ui.label(title).on_hover_text(metric.definition);
                    });
                    for pair in pairs {
                        row.col(|ui| cell(ui, metric, number, pair, edit, out));
                    }
                });
            }
            for (title, tip, values) in &lesions {
                body.row(ROW, |mut row| {
                    row.col(|ui| {
                        ui.label(*title).on_hover_text(*tip);
                    });
                    for value in values {
                        row.col(|ui| {
                            ui.label(value);
                        });
                    }
                });
            }
        });
    for pair in pairs {
        if let Some(why) = &pair.comparison.no_distances {
            ui.colored_label(ui.visuals().warn_fg_color, format!("{}: no distances: {why}", pair.title));
        }
    }
}

fn cell(ui: &mut Ui, metric: &MetricRow, number: usize, pair: &Pair<'_>, edit: &Edit, out: &mut Commands) {
    // Values stand in the order of the metrics: the robust distance's key has its percentile.
    let value = pair.comparison.values.get(number).and_then(|(_, value)| *value);
    let text = match value {
        None => {
            ui.weak("–").on_hover_text("Undefined, or the package hasn't it");
            return;
        }
        Some(value) if value.is_infinite() => "infinite".to_owned(),
        Some(value) if metric.unit.is_empty() => format!("{value:.*}", metric.decimals),
        Some(value) => format!("{value:.*} {}", metric.decimals, metric.unit),
    };
    let text = text.replace('-', "\u{2212}");
    let points = pair.comparison.hausdorff.filter(|_| metric.key == "hd_mm");
    let Some(points) = points else {
        ui.label(text);
        return;
    };
    let link = ui.link(RichText::new(text));
    let label = format!("Show the two points of Hausdorff {}", pair.title);
    link.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Link, true, &label));
    if link.on_hover_text("Shows the two points in all views, as a line among the measurements").clicked() {
        let (from_mm, to_mm) = (points.on_reference_mm, points.on_compared_mm);
        out.push(LookCommand::SetTime(pair.time));
        let name = format!("Hausdorff {}", pair.title);
        let line = Ruler { name, from_mm, to_mm, shape: Shape::Line, view: PaneId::Closeup, time: pair.time };
        if !edit.rulers.contains(&line) {
            out.push(EditCommand::AddRuler(Box::new(line)));
        }
        // Maximised, this pane hides the views.
        if edit.maximized == Some(PaneId::Agreement) {
            out.push(EditCommand::MaximizePane(PaneId::Agreement));
        }
        // Both points lie in the lens.
        out.push(EditCommand::GoTo(from_mm.midpoint(to_mm), points.distance_mm.max(4.0)));
    }
}

/// The operands that can be compared: masks of every date, and regions of the date shown.
fn all_operands(input: &Input<'_>) -> Vec<Operand> {
    let masks = input.case.time_points.iter().flat_map(|time| {
        time.masks.iter().map(|m| Operand {
            time: time.label.clone(),
            masks: vec![m.mask.id().to_owned()],
            is_region: false,
        })
    });
    let regions = input.time_point.regions.list().iter().map(|region| {
        let ids = input.time_point.regions.mask_ids().iter().enumerate();
        let of = ids.filter(|(k, _)| region.bits >> k & 1 == 1).map(|(_, id)| id.clone());
        Operand { time: input.time_point.label.clone(), masks: of.collect(), is_region: true }
    });
    masks.chain(regions).collect()
}
