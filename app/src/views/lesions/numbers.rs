//! The numbers of each lesion at each date.

use egui::{Align, Layout, RichText, Ui};
use egui_extras::{Column, TableBuilder};
use glioscope_core::lesions::{Growth, LesionDate, LesionReport, LesionsReport, LinkState, Series};

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
    TableBuilder::new(ui)
        .id_salt("numbers of lesions")
        .vscroll(false)
        .striped(true)
        .cell_layout(Layout::left_to_right(Align::Center))
        .column(Column::exact(70.0).clip(true))
        .column(Column::exact(84.0).clip(true))
        .column(Column::exact(66.0))
        .column(Column::exact(56.0))
        .column(Column::exact(108.0))
        .column(Column::exact(70.0))
        .column(Column::remainder().at_least(90.0).clip(true))
        .header(ROW, |mut row| {
            for (text, tip) in [
                ("Lesion", ""),
                ("Date", ""),
                ("Volume", ""),
                ("Change", "Of the volume since the date before"),
                (
                    "Diameters",
                    "Longest in a slice, and the longest at right angles to it, of the largest piece",
                ),
                ("Product", "Sum of the products of all pieces"),
                ("What happened", "Since the date before, and whether a reader verified the link"),
            ] {
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
                for text in [vec![name, date.time.clone()], cells(before, date)].concat() {
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

fn cells(before: Option<&LesionDate>, date: &LesionDate) -> Vec<String> {
    let Some(ml) = date.volume_ml else {
        return vec!["unknown".into(), String::new(), String::new(), String::new(), String::new()];
    };
    let diameters = match (date.d1_mm, date.d2_mm) {
        (Some(d1), Some(d2)) => format!("{d1:.1} × {d2:.1} mm"),
        _ => "–".into(),
    };
    let product = date.product_mm2.map_or_else(|| "–".into(), |mm2| format!("{mm2:.0} mm²"));
    let events: Vec<&str> = date.events.iter().map(Into::into).collect();
    let mut events = events.join(", ").replace('_', " ");
    if date.measurable == Some(false) && ml > 0.0 {
        events = [events.as_str(), "not measurable"].join(" ").trim().to_owned();
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
