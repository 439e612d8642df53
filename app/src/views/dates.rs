//! All dates of the case: which is shown, which two are compared, and how volumes went (issue: change
//! between time points; thesis 7.3.4).

use egui::{Color32, Role, Ui, WidgetInfo};
use egui_plot::{Legend, Line, MarkerShape, Plot, PlotPoints, Points, VLine};

use super::{
    ViewContext,
    overlap::{self, OverlapInput, OverlapMode},
};
use crate::{
    commands::Command,
    comparing::{self, Chosen, Compared, Comparisons},
    format,
    jobs::Lookup,
    window::waker,
};

/// Seconds that a date is shown while dates are played.
const SECONDS_A_DATE: f64 = 0.9;

/// What the pane remembers between frames; never saved.
#[derive(Default)]
pub struct DatesState {
    /// When the date last changed, while dates are played.
    playing: Option<f64>,
    regions: bool,
}

/// Days of an ISO date (proleptic Gregorian calendar, from 1 March of year 0); `None` for another
/// label.
fn days(label: &str) -> Option<i64> {
    let mut parts = label.get(..10)?.split('-');
    let mut next = || parts.next()?.parse::<i64>().ok();
    let (year, month, day) = (next()?, next()?, next()?);
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // Years that begin in March put the leap day last.
    let (y, m) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    Some(365 * y + y.div_euclid(4) - y.div_euclid(100) + y.div_euclid(400) + (153 * m + 2) / 5 + day - 1)
}

/// Where each date is along the time axis: days since the first where all are ISO dates in rising
/// order, else their numbers. Beside it what the axis counts.
pub fn positions(labels: &[&str]) -> (Vec<f64>, &'static str) {
    let all: Option<Vec<i64>> = labels.iter().map(|l| days(l)).collect();
    match all {
        Some(days) if days.windows(2).all(|d| d[0] < d[1]) => {
            (days.iter().map(|d| (d - days[0]) as f64).collect(), "days since the first date")
        }
        _ => ((0..labels.len()).map(|i| i as f64).collect(), "date number"),
    }
}

/// Draws the pane.
pub fn show(
    ui: &mut Ui,
    view: &ViewContext<'_>,
    (state, comparisons): (&mut DatesState, &mut Comparisons),
    wait: bool,
    out: &mut Vec<Command>,
) {
    let labels: Vec<&str> = view.case.time_points.iter().map(|t| t.label.as_str()).collect();
    play(ui, view, state, out);
    ui.horizontal_wrapped(|ui| {
        ui.label("Shown");
        for (at, label) in labels.iter().enumerate() {
            let response = ui.selectable_label(view.doc.nav.time == at, name_of(label));
            response.widget_info(|| {
                WidgetInfo::selected(
                    Role::Button,
                    true,
                    view.doc.nav.time == at,
                    format!("Show {}", name_of(label)),
                )
            });
            if response.clicked() {
                out.push(Command::SetTime(at));
            }
        }
        if labels.len() > 1 {
            let text = if state.playing.is_some() { "Stop" } else { "Play" };
            if ui.button(text).on_hover_text("Show one date after the other").clicked() {
                state.playing = match state.playing {
                    Some(_) => None,
                    None => Some(ui.input(|i| i.time)),
                };
            }
        }
    });
    let chosen = view.doc.edit.change.chosen(view.case);
    pair(ui, view, &labels, chosen.as_ref().ok(), out);
    ui.horizontal_wrapped(|ui| {
        ui.selectable_value(&mut state.regions, false, "Masks");
        ui.selectable_value(&mut state.regions, true, "Regions");
        ui.weak("ml over time; click a date to compare with it, Shift-click for the earlier one");
    });
    let height = (ui.available_height() * 0.55).clamp(120.0, 320.0);
    chart(ui, view, &labels, state.regions, chosen.as_ref().ok(), height, out);
    if let Err(why) = &chosen {
        ui.weak(why);
        return;
    }
    match comparing::get(comparisons, view.case, &view.doc.edit.change, wait, waker(ui.ctx())) {
        Some(Lookup::Ready(compared)) => volumes(ui, view, compared),
        Some(Lookup::Working(progress)) => {
            ui.weak(crate::world::progress_text(progress));
        }
        Some(Lookup::Failed(why)) => {
            ui.weak(why);
        }
        None => {}
    }
}

fn name_of(label: &str) -> &str {
    if label.is_empty() { "no date" } else { label }
}

fn play(ui: &Ui, view: &ViewContext<'_>, state: &mut DatesState, out: &mut Vec<Command>) {
    let Some(since) = state.playing else { return };
    let now = ui.input(|i| i.time);
    if now - since >= SECONDS_A_DATE {
        state.playing = Some(now);
        out.push(Command::SetTime((view.doc.nav.time + 1) % view.case.time_points.len().max(1)));
    }
    ui.request_repaint_after(std::time::Duration::from_millis(100));
}

fn choose(view: &ViewContext<'_>, date: usize, as_earlier: bool, out: &mut Vec<Command>) {
    let setting = &view.doc.edit.change;
    if let Some(dates) = setting.with_date(view.case, date, as_earlier) {
        let mut new = setting.clone();
        new.dates = Some(dates);
        if new != *setting {
            out.push(Command::SetChange(Box::new(new)));
        }
    }
}

fn pair(
    ui: &mut Ui,
    view: &ViewContext<'_>,
    labels: &[&str],
    chosen: Option<&Chosen>,
    out: &mut Vec<Command>,
) {
    let Some(chosen) = chosen else { return };
    for (end, words) in ["Compare from", "Compare to"].into_iter().enumerate() {
        ui.horizontal_wrapped(|ui| {
            ui.label(words);
            for (at, label) in labels.iter().enumerate() {
                let is = chosen.dates[end] == at;
                let possible = view.doc.edit.change.with_date(view.case, at, end == 0).is_some();
                let response = ui.add_enabled(possible, egui::Button::selectable(is, name_of(label)));
                response.widget_info(|| {
                    WidgetInfo::selected(Role::Button, possible, is, format!("{words} {}", name_of(label)))
                });
                if response.clicked() {
                    choose(view, at, end == 0, out);
                }
            }
        });
    }
}

/// Volumes over time; a click chooses the date nearest to it.
fn chart(
    ui: &mut Ui,
    view: &ViewContext<'_>,
    labels: &[&str],
    regions: bool,
    chosen: Option<&Chosen>,
    height: f32,
    out: &mut Vec<Command>,
) {
    let (at, counts) = positions(labels);
    let lines = if regions { region_lines(view) } else { mask_lines(view) };
    let plot = Plot::new("volumes over time")
        .height(height)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .include_y(0.0)
        .x_axis_label(counts)
        .y_axis_label("ml")
        .legend(Legend::default());
    let shown = plot.show(ui, |plot| {
        for (name, color, values) in &lines {
            let points: Vec<[f64; 2]> =
                at.iter().zip(values).filter_map(|(&x, y)| y.map(|ml| [x, ml])).collect();
            let color = Color32::from_rgb(color[0], color[1], color[2]);
            plot.line(Line::new(name.clone(), PlotPoints::from(points.clone())).color(color).width(2.0));
            plot.points(
                Points::new(name.clone(), PlotPoints::from(points))
                    .color(color)
                    .shape(MarkerShape::Circle)
                    .radius(4.0),
            );
        }
        for date in chosen.into_iter().flat_map(|c| c.dates) {
            if let Some(&x) = at.get(date) {
                // Without a name it has no place in the legend.
                plot.vline(VLine::new("", x).color(Color32::GRAY).width(1.0));
            }
        }
        plot.pointer_coordinate()
    });
    shown.response.widget_info(|| {
        let words: Vec<String> = lines
            .iter()
            .map(|(name, _, values)| {
                let list: Vec<String> =
                    values.iter().map(|v| v.map_or_else(|| "none".into(), format::ml)).collect();
                format!("{name}: {}", list.join(", "))
            })
            .collect();
        WidgetInfo::labeled(Role::Canvas, true, format!("Volumes over time. {}", words.join("; ")))
    });
    if let (true, Some(pointer)) = (shown.response.clicked(), shown.inner) {
        let nearest =
            (0..at.len()).min_by(|&a, &b| (at[a] - pointer.x).abs().total_cmp(&(at[b] - pointer.x).abs()));
        if let Some(date) = nearest {
            choose(view, date, ui.input(|i| i.modifiers.shift), out);
        }
    }
}

type ChartLine = (String, [u8; 3], Vec<Option<f64>>);

/// Every mask of any date, in the order first met.
fn mask_lines(view: &ViewContext<'_>) -> Vec<ChartLine> {
    let mut ids: Vec<&str> = Vec::new();
    for mask in view.case.time_points.iter().flat_map(|t| &t.masks) {
        if !ids.contains(&mask.mask.id()) {
            ids.push(mask.mask.id());
        }
    }
    let volumes = |id: &str| {
        let of = |t: &glioscope_core::case::TimePoint| {
            let k = t.masks.iter().position(|m| m.mask.id() == id)?;
            Some(t.regions.mask_ml(k))
        };
        view.case.time_points.iter().map(of).collect()
    };
    let color = |id: &str| {
        let k = view.time_point.masks.iter().position(|m| m.mask.id() == id);
        k.map_or([128, 128, 128], |k| view.colors.mask(k))
    };
    ids.into_iter().map(|id| (id.to_owned(), color(id), volumes(id))).collect()
}

/// Every region of any date, by its name.
fn region_lines(view: &ViewContext<'_>) -> Vec<ChartLine> {
    let mut names: Vec<(String, [u8; 3])> = Vec::new();
    for time_point in &view.case.time_points {
        for region in time_point.regions.list() {
            let name = time_point.regions.name(region.bits);
            if !names.iter().any(|(have, _)| *have == name) {
                let same = view
                    .time_point
                    .regions
                    .list()
                    .iter()
                    .find(|r| view.time_point.regions.name(r.bits) == name);
                let color = same.map_or([128, 128, 128], |r| view.colors.region(r.bits));
                names.push((name, color));
            }
        }
    }
    let volumes = |name: &str| {
        let of = |t: &glioscope_core::case::TimePoint| {
            let region = t.regions.list().iter().find(|r| t.regions.name(r.bits) == name);
            Some(region.map_or(0.0, |r| r.volume_ml))
        };
        view.case.time_points.iter().map(of).collect()
    };
    names
        .into_iter()
        .map(|(name, color)| {
            let v = volumes(&name);
            (name, color, v)
        })
        .collect()
}

/// What was kept, went and came, as numbers and as an overlap diagram of the mask with itself.
fn volumes(ui: &mut Ui, view: &ViewContext<'_>, compared: &Compared) {
    let report = &compared.report;
    ui.horizontal_wrapped(|ui| {
        ui.strong(&report.mask);
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
    let colors = crate::views::change::pair_colors(view.doc.edit.palette);
    let selection = glioscope_core::Selection::all();
    let input = OverlapInput {
        regions: &compared.regions,
        selection: &selection,
        colors: &colors,
        mode: OverlapMode::Regions,
    };
    // It says sizes only: what a click would select isn't a region of the case.
    overlap::show_diagram(ui, &input, &mut Vec::new());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iso_dates_are_days_apart_and_other_labels_are_numbered() {
        assert_eq!(positions(&["2024-01-15", "2024-04-15"]), (vec![0.0, 91.0], "days since the first date"));
        assert_eq!(positions(&["2023-02-28", "2023-03-01", "2024-03-01"]).0, [0.0, 1.0, 367.0]);
        assert_eq!(positions(&["2000-02-28", "2000-03-01"]).0, [0.0, 2.0], "a leap year");
        assert_eq!(positions(&["before", "after"]), (vec![0.0, 1.0], "date number"));
        assert_eq!(positions(&["2024-04-15", "2024-01-15"]).1, "date number", "not in order");
    }
}
