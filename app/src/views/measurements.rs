//! The list of rulers: naming, lengths, showing, deleting and exporting.

use egui::{Align, Layout, Rect, RichText, ScrollArea, Sense, TextEdit, Ui, pos2, vec2};
use egui_extras::{Column, TableBuilder};

use glioscope_core::{
    Unit,
    measure::{Statistics, ValueHistogram, in_circle},
};
use glioscope_render::flat::PreparedContext;
use strum::VariantArray;

use super::{
    draw,
    pane::{Input, Pane, Stage},
    ruler,
};
use crate::{
    command::{AppCommand, Command, Commands, EditCommand, LookCommand},
    format,
    model::{ExportFormat, Ruler, Shape, Tool, fusion::name_with_unit, rulers},
    world::jobs::{Handle, Lookup},
};

/// Height of a row, points.
const ROW_PT: f32 = 24.0;
/// Size of a histogram, points.
const HISTOGRAM_PT: [f32; 2] = [82.0, 16.0];
/// Width of the pane from which on the table of values has wide columns, points.
const WIDE_PT: f32 = 490.0;

/// The pane of the list of measurements.
#[derive(Default)]
pub struct MeasurementsPane {
    /// Values in the circles last shown, with what they are of.
    circles: Vec<(Ruler, Handle<PreparedContext>, Statistics)>,
}

impl Pane for MeasurementsPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        draw::padded(ui, |ui| {
            ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
                content(ui, &stage.input, out);
                self.circles(ui, &stage.input);
                in_lens(ui, stage);
                ui.add_space(8.0);
                values(ui, stage);
            });
        });
    }
}

impl MeasurementsPane {
    /// The values of the image shown in the circles of the date shown.
    fn circles(&mut self, ui: &mut Ui, input: &Input<'_>) {
        let Some((id, image)) = input.context else { return };
        let of_image = Handle::of(image);
        let mut shown = Vec::new();
        for (_, ruler) in input.doc.rulers_shown() {
            let Shape::Circle { normal } = ruler.shape else { continue };
            let known = self.circles.iter().find(|(of, handle, _)| of == ruler && *handle == of_image);
            let found = known.map(|(.., found)| found.clone()).unwrap_or_else(|| {
                in_circle(&ruler.name, (id, image.volume()), (ruler.from_mm, normal, ruler.length_mm()))
            });
            region(ui, &ruler.name, &found, image.volume().unit());
            shown.push((ruler.clone(), of_image.clone(), found));
        }
        self.circles = shown;
    }
}

/// The values of the image shown in the lens, while it is on.
fn in_lens(ui: &mut Ui, stage: &mut Stage<'_>) {
    let input = stage.input;
    let (Some(image), Some(lens)) = (input.context, input.doc.active_lens()) else { return };
    if let Lookup::Ready(found) = stage.results.numbers.lens_values(lens, image, stage.ask) {
        region(ui, "Lens", found, image.1.volume().unit());
    }
}

/// Values in a region: a line of numbers and their histogram.
fn region(ui: &mut Ui, name: &str, found: &Statistics, unit: Unit) {
    let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), format::four_digits);
    let [mean, sd, min, max, peak] = [found.mean, found.sd, found.min, found.max, found.peak].map(number);
    let (max_name, peak_name) =
        if unit == Unit::SuvBw { ("SUVmax", "SUVpeak") } else { ("most", "peak in 1 ml") };
    let glycolysis =
        if unit == Unit::SuvBw { format!(", TLG {} g", number(found.mean_times_ml)) } else { String::new() };
    ui.horizontal_wrapped(|ui| {
        ui.label(format!(
            "{name}, {} voxels of {}: mean {mean}, SD {sd}, least {min}, {max_name} {max}, {peak_name} {peak}{glycolysis}",
            format::count(found.voxels),
            name_with_unit(&found.image, unit)
        ));
        histogram(ui, name, found.histogram.as_ref(), HISTOGRAM_PT[0]);
    });
}

/// The histogram of values of a region as bars, the highest as high as there is room for; nothing where all values are the same.
fn histogram(ui: &mut Ui, of: &str, bins: Option<&ValueHistogram>, width_pt: f32) {
    let Some(bins) = bins else { return };
    let (rect, response) = ui.allocate_exact_size(vec2(width_pt, HISTOGRAM_PT[1]), Sense::hover());
    let most = bins.counts.iter().copied().max().unwrap_or(0).max(1) as f32;
    let width = rect.width() / bins.counts.len() as f32;
    let color = ui.visuals().weak_text_color();
    for (at, count) in bins.counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        // At least half a point, so that a bin that isn't empty shows.
        let height = (rect.height() * *count as f32 / most).max(0.5);
        let left = rect.left() + at as f32 * width;
        let bar = Rect::from_min_size(pos2(left, rect.bottom() - height), vec2(width, height));
        ui.painter().rect_filled(bar, 0.0, color);
    }
    let last = bins.first + bins.bin * bins.counts.len() as f64;
    let [first, last, bin] = [bins.first, last, bins.bin].map(format::four_digits);
    draw::name_widget(ui, &response, &format!("Histogram of {of}"));
    response.on_hover_text(format!("Histogram: {} bins of {bin} from {first} to {last}", bins.counts.len()));
}

fn content(ui: &mut Ui, input: &Input<'_>, out: &mut Commands) {
    let doc = input.doc;
    ui.horizontal_wrapped(|ui| {
        let command = Command::from(LookCommand::ToggleRuler);
        let text = if doc.nav.ruler_on { "Stop measuring" } else { "Measure" };
        if ui.selectable_label(doc.nav.ruler_on, text).on_hover_text(command.tooltip()).clicked() {
            out.push(command);
        }
        if doc.nav.ruler_on {
            for tool in Tool::VARIANTS {
                let command = Command::from(LookCommand::SetTool(*tool));
                let is_chosen = doc.nav.tool == *tool;
                if ui.selectable_label(is_chosen, tool.name()).on_hover_text(tool.detail()).clicked() {
                    out.push(command);
                }
            }
        }
        for format in ExportFormat::VARIANTS {
            let command = Command::from(AppCommand::ExportRulers(*format));
            let button = egui::Button::new(format!("{}…", format.name()));
            let response = ui.add_enabled(!doc.edit.rulers.is_empty(), button);
            response.widget_info(|| {
                let enabled = !doc.edit.rulers.is_empty();
                egui::WidgetInfo::labeled(egui::Role::Button, enabled, command.text())
            });
            if response.on_hover_text(command.tooltip()).clicked() {
                out.push(command);
            }
        }
    });
    for doubt in rulers::doubts(input.case) {
        ui.colored_label(ui.visuals().warn_fg_color, doubt);
    }
    ui.add_space(4.0);
    if doc.edit.rulers.is_empty() {
        let text = "No line yet. Switch the ruler on (M), then drag in the closeup from surface to surface, or in a slice; ends can be dragged.";
        ui.add(egui::Label::new(RichText::new(text).weak()).wrap());
        return;
    }
    list(ui, input, out);
}

/// The values of the image shown in each mask.
fn values(ui: &mut Ui, stage: &mut Stage<'_>) {
    let input = stage.input;
    let Some((id, image)) = input.context else { return };
    if input.time_point.masks.is_empty() {
        return;
    }
    let unit = image.volume().unit();
    let is_suv = unit == Unit::SuvBw;
    ui.strong(format!("Values of {} in the masks", name_with_unit(id, unit)));
    let all = match stage.results.numbers.statistics(input.time_point, (id, image), stage.ask) {
        Lookup::Ready(all) => all.clone(),
        Lookup::Working(_) => {
            ui.weak("counting");
            return;
        }
        Lookup::Failed(error) => {
            ui.colored_label(ui.visuals().error_fg_color, error.to_string());
            return;
        }
    };
    ui.spacing_mut().item_spacing.x = 4.0;
    let is_wide = ui.available_width() >= WIDE_PT;
    let (number_pt, histogram_pt) = match (is_wide, is_suv) {
        (true, false) => (62.0, HISTOGRAM_PT[0]),
        (true, true) => (54.0, HISTOGRAM_PT[0]),
        (false, false) => (50.0, 44.0),
        (false, true) => (42.0, 44.0),
    };
    let last = if is_wide { "Histogram" } else { "" };
    let titles = ["Mask", "Mean", "SD", "Least", "Most", "Peak"].into_iter();
    let titles: Vec<&str> = titles.chain(is_suv.then_some("TLG")).chain([last]).collect();
    let table = TableBuilder::new(ui).id_salt("values").vscroll(false).striped(true);
    let table = table.cell_layout(Layout::left_to_right(Align::Center));
    let table = table.column(Column::remainder().at_least(60.0).clip(true));
    let table = table.columns(Column::exact(number_pt).clip(true), titles.len() - 2);
    let table = table.column(Column::exact(histogram_pt));
    table
        .header(ROW_PT - 4.0, |mut row| {
            for &title in &titles {
                row.col(|ui| {
                    let response = ui.strong(title);
                    let tip = match title {
                        "Most" if is_suv => "SUVmax",
                        "Peak" if is_suv => {
                            "SUVpeak: the highest mean in a ball of 1 ml about a voxel of the mask"
                        }
                        "Peak" => "The highest mean in a ball of 1 ml about a voxel of the mask",
                        "TLG" => "Total lesion glycolysis: mean SUV times the volume, g",
                        _ => return,
                    };
                    response.on_hover_text(tip);
                });
            }
        })
        .body(|mut body| {
            for of_mask in all.iter() {
                body.row(ROW_PT - 4.0, |mut row| {
                    row.col(|ui| {
                        ui.label(input.doc.edit.masks.name(&of_mask.mask));
                    });
                    let values = [of_mask.mean, of_mask.sd, of_mask.min, of_mask.max, of_mask.peak];
                    for value in values.into_iter().chain(is_suv.then_some(of_mask.mean_times_ml)) {
                        row.col(|ui| {
                            ui.label(value.map_or_else(|| "–".to_owned(), format::four_digits));
                        });
                    }
                    row.col(|ui| {
                        let name = input.doc.edit.masks.name(&of_mask.mask);
                        histogram(ui, &name, of_mask.histogram.as_ref(), histogram_pt);
                    });
                });
            }
        });
}

fn list(ui: &mut Ui, input: &Input<'_>, out: &mut Commands) {
    let rulers = &input.doc.edit.rulers;
    ui.spacing_mut().item_spacing.x = 4.0;
    TableBuilder::new(ui)
        .id_salt("lines")
        .vscroll(false)
        .striped(true)
        .cell_layout(Layout::left_to_right(Align::Center))
        .column(Column::remainder().at_least(70.0).clip(true))
        .column(Column::exact(104.0).clip(true))
        .column(Column::exact(62.0).clip(true))
        .column(Column::exact(54.0))
        .column(Column::exact(62.0))
        .header(ROW_PT - 4.0, |mut row| {
            for title in ["Name", "Measured", "In", "", ""] {
                row.col(|ui| {
                    ui.strong(title);
                });
            }
        })
        .body(|mut body| {
            for (index, line) in rulers.iter().enumerate() {
                body.row(ROW_PT, |mut row| {
                    row.col(|ui| name_field(ui, index, &line.name, out));
                    row.col(|ui| {
                        ui.label(ruler::text_of(line));
                    });
                    row.col(|ui| {
                        let time = input.case.time_points.get(line.time).map_or("", |t| t.label.as_str());
                        let is_here = line.time == input.doc.nav.time;
                        let text = RichText::new(line.view_name());
                        let response = ui.label(if is_here { text } else { text.weak() });
                        response.on_hover_text(if is_here {
                            time.to_owned()
                        } else {
                            format!("measured on {time}, shown there only")
                        });
                    });
                    let show = Command::from(LookCommand::ShowRuler(index));
                    let delete = Command::from(EditCommand::DeleteRuler(index));
                    for (text, command) in [("Show", show), ("Delete", delete)] {
                        row.col(|ui| {
                            let response = ui.small_button(text);
                            let label = format!("{text} {}", line.name);
                            response
                                .widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, &label));
                            if response.on_hover_text(command.tooltip()).clicked() {
                                out.push(command);
                            }
                        });
                    }
                });
            }
        });
}

fn name_field(ui: &mut Ui, index: usize, name: &str, out: &mut Commands) {
    let mut text = name.to_owned();
    let field = TextEdit::singleline(&mut text).desired_width(f32::INFINITY).id_salt(("name of line", index));
    let response = ui.add(field);
    draw::name_widget(ui, &response, &format!("Name of line {}", index + 1));
    if response.changed() {
        out.push(EditCommand::RenameRuler(index, text));
    }
}
