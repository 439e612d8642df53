//! All time points of the case: which is shown, which two are compared, and volumes over time (thesis 7.3.4).

use egui::{Align2, RichText, Role, Sense, Ui, WidgetInfo, vec2};
use egui_plot::{GridMark, Line, MarkerShape, Plot, PlotPoint, PlotPoints, Points, Text, VLine};
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
    theme::{self, LABEL_POINTS, Tokens},
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

/// Least distance of two labels of dates on the axis, points.
const LABEL_STEP_POINTS: f64 = 78.0;
/// Room for the names of masks above the chart, points.
const NAMES_POINTS: f32 = 28.0;
/// Width of the chart's axis of volumes, points.
const AXIS_POINTS: f32 = 40.0;

/// Position of each date on the time axis: days since the first if all labels are ISO dates in rising order, else their
/// index from 0.
pub fn positions(labels: &[&str]) -> Vec<f64> {
    dates::days_since_first(labels).unwrap_or_else(|| (0..labels.len()).map(|i| i as f64).collect())
}

/// Indices of the dates that are named on an axis `width` points long: the first, and each that is far enough from the
/// one named before it.
fn named(xs: &[f64], width: f64) -> Vec<usize> {
    let (Some(first), Some(last)) = (xs.first(), xs.last()) else { return Vec::new() };
    let points_per_unit = width / (last - first).max(1e-9);
    let mut named: Vec<usize> = Vec::new();
    for (index, x) in xs.iter().enumerate() {
        if named.last().is_none_or(|&before| (x - xs[before]) * points_per_unit >= LABEL_STEP_POINTS) {
            named.push(index);
        }
    }
    named
}

impl Pane for DatesPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        draw::padded(ui, |ui| {
            egui::ScrollArea::vertical()
                .auto_shrink([false, false])
                .show(ui, |ui| self.content(ui, stage, out));
        });
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
            ui.weak("Click a date: compare to it. Shift-click: from it");
        });
        let room = ui.available_height();
        // In a low pane as high as fits below the names, so that the dates under it are seen without scrolling.
        let height = (room * 0.55).clamp(140.0, 320.0).min((room - NAMES_POINTS).max(100.0));
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
    let xs = positions(labels);
    let named = named(&xs, f64::from(ui.available_width() - AXIS_POINTS) * 0.9);
    let span = xs.last().copied().unwrap_or_default().max(1.0);
    let lines = if regions { region_lines(input) } else { mask_lines(input) };
    // Above the chart, not on it, where it would hide lines.
    ui.horizontal_wrapped(|ui| {
        for (name, color, _) in &lines {
            let (swatch, _) = ui.allocate_exact_size(vec2(11.0, 11.0), Sense::hover());
            ui.painter().rect_filled(swatch, 2.0, theme::color(*color));
            ui.label(name);
        }
    });
    let most_ml = lines.iter().flat_map(|(_, _, values)| values).flatten().copied().fold(0.0, f64::max);
    let plot = Plot::new("volumes over time")
        .height(height)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .include_y(0.0)
        // Room for the value above the highest point.
        .include_y(1.2 * most_ml)
        .set_margin_fraction(vec2(0.08, 0.1))
        .y_axis_min_width(AXIS_POINTS)
        .y_axis_label("ml")
        // A line and a name at each date.
        .x_grid_spacer(|_| xs.iter().map(|&value| GridMark { value, step_size: span }).collect())
        .x_axis_formatter(|mark, _| {
            let date = named.iter().find(|&&date| (xs[date] - mark.value).abs() < 1e-6 * span);
            date.map_or_else(String::new, |&date| name_of(labels[date]).to_owned())
        })
        .label_formatter(|_| None);
    let Tokens { second: marked, text: ink, .. } = *Tokens::in_ui(ui);
    // Where they don't cover one another.
    let values_shown = lines.len() <= 3 && named.len() == xs.len();
    let shown = plot.show(ui, |plot| {
        for (name, color, values) in &lines {
            let points: Vec<[f64; 2]> =
                xs.iter().zip(values).filter_map(|(&x, y)| y.map(|ml| [x, ml])).collect();
            let color = theme::color(*color);
            if values_shown {
                for &[x, ml] in &points {
                    let text = RichText::new(format!(" {ml:.1} ")).size(LABEL_POINTS).color(ink);
                    // Beside the line of a compared date, and within the chart.
                    let anchor =
                        if xs.first() == Some(&x) { Align2::LEFT_BOTTOM } else { Align2::RIGHT_BOTTOM };
                    plot.text(Text::new("", PlotPoint::new(x, ml), text).anchor(anchor));
                }
            }
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
                plot.vline(VLine::new("", x).color(marked).width(1.0));
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
        for (word, ml) in [("kept", report.kept_ml), ("gone", report.gone_ml), ("new", report.new_ml)] {
            if let Some(ml) = ml {
                ui.label(format!("{word} {}", format::ml(ml)));
            }
        }
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
        is_picture: true,
    };
    // Clicks are ignored: these regions aren't regions of the case.
    overlap::show_diagram(ui, &diagram, &mut Commands::default());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iso_dates_are_placed_in_days_and_other_labels_by_number() {
        assert_eq!(positions(&["2024-01-15", "2024-04-15"]), [0.0, 91.0]);
        assert_eq!(positions(&["before", "after"]), [0.0, 1.0]);
        assert_eq!(positions(&["2024-02-31", "2024-04-15"]), [0.0, 1.0], "no such day");
    }

    #[test]
    fn dates_too_close_to_the_one_before_are_not_named() {
        assert_eq!(named(&[0.0, 91.0], 300.0), [0, 1]);
        assert_eq!(named(&[0.0, 10.0, 91.0, 100.0], 300.0), [0, 2]);
        assert_eq!(named(&[0.0], 300.0), [0]);
        assert!(named(&[], 300.0).is_empty());
    }
}
