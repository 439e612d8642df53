//! All time points of the case: which is shown, which two are compared, and volumes over time (thesis 7.3.4).

use egui::{Color32, Role, Sense, Ui, WidgetInfo, vec2};
use egui_plot::{Line, MarkerShape, Plot, PlotPoints, Points, VLine};
use glioscope_core::{Selection, case::TimePoint, change::Choice, dates};

use super::{
    change::{no_comparison_text, pair_colors},
    draw,
    overlap::{self, OverlapInput},
    pane::{Input, Pane, Stage},
    pointer,
};
use crate::{
    command::{Commands, EditCommand, LookCommand},
    format,
    model::OverlapMode,
    world::{
        comparison::Comparison,
        jobs::{Lookup, progress_text},
    },
};

/// Seconds that each date is shown during playback.
const SECONDS_PER_DATE: f64 = 0.9;

/// The pane of dates.
#[derive(Default)]
pub struct DatesPane {
    /// Time of the last step in seconds of egui's clock, during playback.
    playing_since: Option<f64>,
    /// Whether the chart shows regions instead of masks.
    regions: bool,
}

/// Position of each date on the time axis: days since the first if all labels are ISO dates in rising order, else their
/// index from 0. Second, the label of the axis.
pub fn positions(labels: &[&str]) -> (Vec<f64>, &'static str) {
    match dates::days_since_first(labels) {
        Some(days) => (days, "days since the first date"),
        None => ((0..labels.len()).map(|i| i as f64).collect(), "date number"),
    }
}

impl Pane for DatesPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        draw::padded(ui, |ui| self.content(ui, stage, out));
    }
}

impl DatesPane {
    fn content(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        let input = stage.input;
        let labels = input.case.time_labels();
        self.play(ui, &input, out);
        ui.horizontal_wrapped(|ui| {
            ui.label("Shown");
            for (index, label) in labels.iter().enumerate() {
                let shown = input.doc.nav.time == index;
                let response = ui.selectable_label(shown, name_of(label));
                let text = format!("Show {}", name_of(label));
                response.widget_info(|| WidgetInfo::selected(Role::Button, true, shown, &text));
                if response.clicked() {
                    out.push(LookCommand::SetTime(index));
                }
            }
            if labels.len() > 1 {
                let text = if self.playing_since.is_some() { "Stop" } else { "Play" };
                if ui.button(text).on_hover_text("Show one date after the other").clicked() {
                    self.playing_since = match self.playing_since {
                        Some(_) => None,
                        None => Some(ui.input(|i| i.time)),
                    };
                }
            }
        });
        let chosen = input.doc.edit.change.chosen(input.case);
        pair_choice(ui, &input, &labels, chosen.as_ref().ok(), out);
        ui.horizontal_wrapped(|ui| {
            ui.selectable_value(&mut self.regions, false, "Masks");
            ui.selectable_value(&mut self.regions, true, "Regions");
            ui.weak("ml over time; click a date to compare with it, Shift-click for the earlier one");
        });
        let height = (ui.available_height() * 0.55).clamp(120.0, 320.0);
        chart(ui, &input, &labels, self.regions, chosen.as_ref().ok(), height, out);
        if let Err(error) = &chosen {
            ui.weak(no_comparison_text(error));
            return;
        }
        match stage.results.comparison.get(input.case, &input.doc.edit.change, stage.ask) {
            Some(Lookup::Ready(compared)) => volumes(ui, &input, compared),
            Some(Lookup::Working(progress)) => {
                ui.weak(progress_text(progress));
            }
            Some(Lookup::Failed(error)) => {
                ui.weak(error.to_string());
            }
            None => {}
        }
    }

    fn play(&mut self, ui: &Ui, input: &Input<'_>, out: &mut Commands) {
        let Some(since) = self.playing_since else { return };
        let now = ui.input(|i| i.time);
        if now - since >= SECONDS_PER_DATE {
            self.playing_since = Some(now);
            let next = (input.doc.nav.time + 1) % input.case.time_points.len().max(1);
            out.push(LookCommand::SetTime(next));
        }
        ui.request_repaint_after(std::time::Duration::from_millis(100));
    }
}

fn name_of(label: &str) -> &str {
    if label.is_empty() { "no date" } else { label }
}

fn choose(input: &Input<'_>, date: usize, as_earlier: bool, out: &mut Commands) {
    let setting = &input.doc.edit.change;
    if let Some(dates) = setting.with_date(input.case, date, as_earlier) {
        let mut new = setting.clone();
        new.dates = Some(dates);
        if new != *setting {
            out.push(EditCommand::SetChange(Box::new(new)));
        }
    }
}

fn pair_choice(ui: &mut Ui, input: &Input<'_>, labels: &[&str], chosen: Option<&Choice>, out: &mut Commands) {
    let Some(chosen) = chosen else { return };
    for (end, text) in ["Compare from", "Compare to"].into_iter().enumerate() {
        ui.horizontal_wrapped(|ui| {
            ui.label(text);
            for (index, label) in labels.iter().enumerate() {
                let is_chosen = chosen.dates[end] == index;
                let possible = input.doc.edit.change.with_date(input.case, index, end == 0).is_some();
                let response = ui.add_enabled(possible, egui::Button::selectable(is_chosen, name_of(label)));
                response.widget_info(|| {
                    WidgetInfo::selected(
                        Role::Button,
                        possible,
                        is_chosen,
                        format!("{text} {}", name_of(label)),
                    )
                });
                if response.clicked() {
                    choose(input, index, end == 0, out);
                }
            }
        });
    }
}

/// Volumes over time; a click chooses the nearest date for the comparison.
fn chart(
    ui: &mut Ui,
    input: &Input<'_>,
    labels: &[&str],
    regions: bool,
    chosen: Option<&Choice>,
    height: f32,
    out: &mut Commands,
) {
    let (xs, axis_label) = positions(labels);
    let lines = if regions { region_lines(input) } else { mask_lines(input) };
    // Above the chart, not on it, where it would hide lines.
    ui.horizontal_wrapped(|ui| {
        for (name, color, _) in &lines {
            let (swatch, _) = ui.allocate_exact_size(vec2(11.0, 11.0), Sense::hover());
            ui.painter().rect_filled(swatch, 2.0, draw::color(*color));
            ui.label(name);
        }
    });
    let plot = Plot::new("volumes over time")
        .height(height)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .include_y(0.0)
        .x_axis_label(axis_label)
        .y_axis_label("ml");
    let shown = plot.show(ui, |plot| {
        for (name, color, values) in &lines {
            let points: Vec<[f64; 2]> =
                xs.iter().zip(values).filter_map(|(&x, y)| y.map(|ml| [x, ml])).collect();
            let color = draw::color(*color);
            plot.line(Line::new(name.clone(), PlotPoints::from(points.clone())).color(color).width(2.0));
            plot.points(
                Points::new(name.clone(), PlotPoints::from(points))
                    .color(color)
                    .shape(MarkerShape::Circle)
                    .radius(4.0),
            );
        }
        for date in chosen.into_iter().flat_map(|c| c.dates) {
            if let Some(&x) = xs.get(date) {
                plot.vline(VLine::new("", x).color(Color32::GRAY).width(1.0));
            }
        }
        plot.pointer_coordinate()
    });
    shown.response.widget_info(|| {
        let series: Vec<String> = lines
            .iter()
            .map(|(name, _, values)| {
                let list: Vec<String> =
                    values.iter().map(|v| v.map_or_else(|| "none".into(), format::ml)).collect();
                format!("{name}: {}", list.join(", "))
            })
            .collect();
        WidgetInfo::labeled(Role::Canvas, true, format!("Volumes over time. {}", series.join("; ")))
    });
    if let (true, Some(pointer)) = (shown.response.clicked(), shown.inner) {
        let nearest =
            (0..xs.len()).min_by(|&a, &b| (xs[a] - pointer.x).abs().total_cmp(&(xs[b] - pointer.x).abs()));
        if let Some(date) = nearest {
            choose(input, date, pointer::press_modifiers(ui.ctx()).shift, out);
        }
    }
}

type ChartLine = (String, [u8; 3], Vec<Option<f64>>);

/// Volumes of the masks of all dates, in order of first occurrence.
fn mask_lines(input: &Input<'_>) -> Vec<ChartLine> {
    let mut ids: Vec<&str> = Vec::new();
    for mask in input.case.time_points.iter().flat_map(|t| &t.masks) {
        if !ids.contains(&mask.mask.id()) {
            ids.push(mask.mask.id());
        }
    }
    let volumes = |id: &str| {
        let volume_at = |t: &TimePoint| {
            let k = t.masks.iter().position(|m| m.mask.id() == id)?;
            Some(t.regions.mask_ml(k))
        };
        input.case.time_points.iter().map(volume_at).collect()
    };
    let color = |id: &str| {
        let k = input.time_point.masks.iter().position(|m| m.mask.id() == id);
        k.map_or([128, 128, 128], |k| input.colors.mask(k))
    };
    ids.into_iter().map(|id| (input.doc.edit.masks.name(id), color(id), volumes(id))).collect()
}

/// Volumes of the regions of all dates, matched by name.
fn region_lines(input: &Input<'_>) -> Vec<ChartLine> {
    let mut names: Vec<(String, [u8; 3])> = Vec::new();
    for time_point in &input.case.time_points {
        for region in time_point.regions.list() {
            let name = time_point.regions.name(region.bits);
            if !names.iter().any(|(listed, _)| *listed == name) {
                let same = input
                    .time_point
                    .regions
                    .list()
                    .iter()
                    .find(|r| input.time_point.regions.name(r.bits) == name);
                let color = same.map_or([128, 128, 128], |r| input.colors.region(r.bits));
                names.push((name, color));
            }
        }
    }
    // The name of the first time point that has the region: the same ids have the same names everywhere.
    let shown_name = |name: &str| {
        let named = |t: &TimePoint| {
            let region = t.regions.list().iter().find(|r| t.regions.name(r.bits) == name)?;
            Some(input.doc.edit.masks.region(t.regions.mask_ids(), region.bits))
        };
        input.case.time_points.iter().find_map(named).unwrap_or_else(|| name.to_owned())
    };
    let volumes = |name: &str| {
        let volume_at = |t: &TimePoint| {
            let region = t.regions.list().iter().find(|r| t.regions.name(r.bits) == name);
            Some(region.map_or(0.0, |r| r.volume_ml))
        };
        input.case.time_points.iter().map(volume_at).collect()
    };
    names
        .into_iter()
        .map(|(name, color)| {
            let volumes_ml = volumes(&name);
            (shown_name(&name), color, volumes_ml)
        })
        .collect()
}

/// Unchanged, lost and new volume of the compared mask, as numbers and as an overlap diagram of the two dates.
fn volumes(ui: &mut Ui, input: &Input<'_>, compared: &Comparison) {
    let report = &compared.report;
    ui.horizontal_wrapped(|ui| {
        ui.strong(input.doc.edit.masks.name(&report.mask));
        ui.label(format!("kept {}", format::ml(report.kept_ml)));
        ui.label(format!("gone {}", format::ml(report.gone_ml)));
        ui.label(format!("new {}", format::ml(report.new_ml)));
        let change = report.to_ml - report.from_ml;
        let share = if report.from_ml > 0.0 {
            format!(" ({:+.1} %)", 100.0 * change / report.from_ml)
        } else {
            String::new()
        };
        ui.label(format!("in all {change:+.2} ml{share}"));
    });
    if ui.available_height() < 90.0 {
        return;
    }
    let colors = pair_colors(input.doc.edit.palette);
    let selection = Selection::all();
    let diagram = OverlapInput {
        names: compared.regions.mask_ids(),
        regions: &compared.regions,
        selection: &selection,
        colors: &colors,
        mode: OverlapMode::Regions,
    };
    // Clicks are ignored: these regions aren't regions of the case.
    overlap::show_diagram(ui, &diagram, &mut Commands::default());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iso_dates_are_placed_in_days_and_other_labels_by_number() {
        assert_eq!(positions(&["2024-01-15", "2024-04-15"]), (vec![0.0, 91.0], "days since the first date"));
        assert_eq!(positions(&["before", "after"]), (vec![0.0, 1.0], "date number"));
        assert_eq!(positions(&["2024-02-31", "2024-04-15"]).1, "date number", "no such day");
    }
}
