//! The rules that are applied, with what they rest on, and how well sums repeat.

use egui::{CollapsingHeader, Grid, Ui};
use glioscope_core::response::{Criterion, History, RULES, Repeatability, UNSTATED};

use super::{
    calls::known_by,
    fields::{number, text},
};

/// Fields for the repeatability of sums: without it no margin is shown.
pub(super) fn repeatability(ui: &mut Ui, history: &mut History) {
    CollapsingHeader::new("How well measurements repeat").id_salt("repeatability").show(ui, |ui| {
        ui.weak("Relative standard deviation of one measurement of the sum, and where it is from: gives the margin of each change");
        let stated = &mut history.repeatability;
        let all = [
            ("Products of diameters", &mut stated.product),
            ("Longest diameters", &mut stated.longest),
            ("Volumes", &mut stated.volume),
        ];
        for (title, stated) in all {
            ui.horizontal_wrapped(|ui| {
                let label = ui.label(title);
                let percent = stated.as_ref().map(|stated| 100.0 * stated.relative_sd);
                if let Some(typed) = number(ui, ("percent", title), label.id, percent) {
                    let source = stated.as_ref().map_or_else(|| "stated by the reader".to_owned(), |s| s.source.clone());
                    *stated = typed.filter(|percent| (1e-4..=200.0).contains(percent)).map(|percent| {
                        Repeatability { relative_sd: percent / 100.0, source }
                    });
                }
                let percent = ui.label("%, source");
                if let Some(stated) = stated
                    && let Some(typed) = text(ui, ("source", title), percent.id, &stated.source.clone(), 180.0)
                    && !typed.trim().is_empty()
                {
                    stated.source = typed.trim().to_owned();
                }
            });
        }
    });
}

/// The rules of a criterion, and what isn't applied as no source that was read states it.
pub(super) fn show(ui: &mut Ui, criterion: Criterion) {
    CollapsingHeader::new(format!("Rules of {}, with their sources", criterion.name()))
        .id_salt("rules")
        .show(ui, |ui| {
            Grid::new("rules").striped(true).num_columns(3).spacing([12.0, 3.0]).show(ui, |ui| {
                for title in ["Rule", "Number", "Known by"] {
                    ui.strong(title);
                }
                ui.end_row();
                for rule in RULES.iter().filter(|rule| rule.criteria.contains(&criterion)) {
                    ui.label(rule.statement);
                    ui.label(rule.number.map(|number| format!("{number} {}", rule.unit)).unwrap_or_default());
                    ui.label(known_by(rule));
                    ui.end_row();
                }
            });
            ui.add_space(4.0);
            ui.strong("Not applied: no source that was read states it");
            for row in UNSTATED.iter().filter(|row| row.criteria.contains(&criterion)) {
                ui.label(row.what);
            }
        });
}
