//! The numbers of each lesion at each date.

use egui::{Align, Layout, RichText, Ui};
use egui_extras::{Column, TableBuilder};
use glioscope_core::{
    change::Lengths,
    lesions::{EventKind, Growth, LesionDate, LesionReport, LesionsReport, LinkState, Series, Values},
};

use super::timeline::{change_text, title};
use crate::{format, theme::Tokens};

/// Least change of the logarithm of a volume between two dates that is called growth: a tenth.
const LEAST_GROWTH: f64 = 0.1;
/// Height of a row, points.
const ROW: f32 = 20.0;

/// The table, and what the series of volumes say.
pub(super) fn show(ui: &mut Ui, report: &LesionsReport, shown: &[&LesionReport]) {
    ui.spacing_mut().item_spacing.x = 4.0;
    let second = Tokens::in_ui(ui).second;
    let rows: Vec<(&LesionReport, usize)> =
        shown.iter().flat_map(|lesion| (0..lesion.dates.len()).map(|date| (*lesion, date))).collect();
    let all = || report.lesions.iter().flat_map(|lesion| &lesion.dates);
    let image = all().find_map(|date| date.values.as_ref()).map(|values| values.image.as_str());
    let has_surface = all().any(|date| date.surface.is_some());
    let mut table = TableBuilder::new(ui)
        .id_salt("numbers of lesions")
        .vscroll(false)
        .striped(true)
        .cell_layout(Layout::left_to_right(Align::Center))
        .column(Column::exact(70.0).clip(true))
        .column(Column::exact(84.0).clip(true))
        .column(Column::exact(66.0))
        .column(Column::exact(56.0))
        .column(Column::exact(120.0))
        .column(Column::exact(84.0));
    let mut beside: Vec<(String, &str)> = Vec::new();
    if let Some(image) = image {
        beside.extend([
            (format!("{image} mean"), "Mean of the image in the lesion"),
            ("most".to_owned(), "Largest value: SUVmax where values are SUV"),
            ("peak".to_owned(), "The highest mean in a ball of 1 ml: SUVpeak"),
        ]);
    }
    if has_surface {
        let tip = "95th percentile of how far the surface moved outwards, and inwards, since the date before";
        beside.push(("Grew, receded".to_owned(), tip));
    }
    for (text, _) in &beside {
        table = table.column(Column::exact(if text.len() > 5 { 100.0 } else { 56.0 }).clip(true));
    }
    table
        .column(Column::remainder().at_least(90.0).clip(true))
        .header(ROW, |mut row| {
            let fixed = [
                ("Lesion", ""),
                ("Date", ""),
                ("Volume", ""),
                ("Change", "Of the volume since the date before"),
                (
                    "Diameters",
                    "Longest in a slice, and the longest at right angles to it, of the largest piece",
                ),
                ("Product", "Sum of the products of all pieces"),
            ];
            let last = ("What happened", "Since the date before, and whether a reader verified the link");
            let beside = beside.iter().map(|(text, tip)| (text.as_str(), *tip));
            for (text, tip) in fixed.into_iter().chain(beside).chain([last]) {
                row.col(|ui| {
                    let response = ui.strong(text);
                    if !tip.is_empty() {
                        response.on_hover_text(tip);
                    }
                });
            }
        })
        .body(|body| {
            body.rows(ROW, rows.len(), |mut row| {
                let Some((lesion, number)) = rows.get(row.index()) else { return };
                let Some(date) = lesion.dates.get(*number) else { return };
                let before = number.checked_sub(1).and_then(|number| lesion.dates.get(number));
                let name = if *number == 0 { title(lesion) } else { String::new() };
                let mut cells = cells(before, date);
                let happened = cells.pop().unwrap_or_default();
                let beside = beside_cells(date, image.is_some(), has_surface);
                for text in [vec![name, date.time.clone()], cells, beside, vec![happened]].concat() {
                    row.col(|ui| {
                        ui.label(text);
                    });
                }
            });
        });
    ui.add_space(4.0);
    let mut say = |text: String| ui.label(RichText::new(text).color(second));
    if let Some(text) = series_text("All lesions", &report.total) {
        say(text);
    }
    for lesion in shown {
        if let Some(text) = series_text(&format!("Lesion {}", title(lesion)), &lesion.series) {
            say(text);
        }
    }
}

/// Values of the image, and movements of the surface.
fn beside_cells(date: &LesionDate, has_image: bool, has_surface: bool) -> Vec<String> {
    let dash = || "–".to_owned();
    let mut cells = Vec::new();
    if has_image {
        let of = |value: fn(&Values) -> Option<f64>| {
            date.values.as_ref().and_then(value).map_or_else(dash, format::four_digits)
        };
        cells.extend([of(|values| values.mean), of(|values| values.max), of(|values| values.peak)]);
    }
    if has_surface {
        let mm = |lengths: &Lengths| lengths.p95_mm.map_or_else(|| "0".to_owned(), |mm| format!("{mm:.1}"));
        let moved = date.surface.as_ref();
        cells.push(moved.map_or_else(dash, |m| format!("{}, {} mm", mm(&m.growth), mm(&m.recession))));
    }
    cells
}

fn cells(before: Option<&LesionDate>, date: &LesionDate) -> Vec<String> {
    let Some(ml) = date.volume_ml else {
        return vec!["unknown".into(), String::new(), String::new(), String::new(), String::new()];
    };
    let diameters = match (date.d1_mm, date.d2_mm) {
        // With as many digits as the product needs to be theirs.
        (Some(d1), Some(d2)) => format!("{d1:.2} × {d2:.2} mm"),
        _ => "–".into(),
    };
    let product = date.product_mm2.map_or_else(|| "–".into(), |mm2| format!("{mm2:.1} mm²"));
    let name = |kind: &EventKind| match kind {
        EventKind::Born => "new".to_owned(),
        kind => <&str>::from(kind).replace('_', " "),
    };
    let mut events = date.events.iter().map(name).collect::<Vec<_>>().join(", ");
    if date.measurable == Some(false) && ml > 0.0 {
        events = if events.is_empty() { "not measurable".to_owned() } else { events + ", not measurable" };
    }
    match date.state {
        Some(LinkState::Proposed) => events.push_str(" · proposed"),
        Some(LinkState::Verified) => events.push_str(" · verified"),
        Some(LinkState::Edited) => events.push_str(" · by you"),
        None => {}
    }
    let volume = if date.parts.is_empty() { "not there".to_owned() } else { format::ml(ml) };
    vec![volume, change_text(before, date), diameters, product, events]
}

/// Growth and change points in a sentence; `None` where there is nothing to say.
fn series_text(of: &str, series: &Series) -> Option<String> {
    let mut said = Vec::new();
    // A slope within twice its standard error is none.
    let is_clear = |growth: &&Growth| match growth.standard_error {
        Some(sd) => growth.log_per_day.abs() > 2.0 * sd,
        // Of two dates: by more than measuring alone may make.
        None => {
            let mut known = series.points.iter().filter_map(|point| point.volume_ml).filter(|ml| *ml > 0.0);
            let ends = known.next().zip(known.next_back());
            ends.is_some_and(|(first, last)| (last / first).ln().abs() > LEAST_GROWTH)
        }
    };
    if let Some(growth) = series.growth.as_ref().filter(is_clear) {
        match (growth.doubling_days, growth.halving_days) {
            (Some(days), _) => said.push(format!("doubles in {days:.0} days by {} dates", growth.dates)),
            (_, Some(days)) => said.push(format!("halves in {days:.0} days by {} dates", growth.dates)),
            _ => {}
        }
    }
    for change in &series.changes {
        if let (Some(time), Some(rate)) = (&change.time, change.false_alarm_rate) {
            let kind: &str = change.kind.into();
            said.push(format!(
                "most likely change of {kind} at {time}, which series without a change show in {:.0} % of cases",
                100.0 * rate
            ));
        }
    }
    (!said.is_empty()).then(|| format!("{of}: {}", said.join("; ")))
}
