//! The rules that are applied, with what they rest on, and how well sums repeat.

use egui::{CollapsingHeader, Grid, Ui};
use glioscope_core::response::{Criterion, History, RULES, Repeatability, UNSTATED};

use super::{calls::known_by, fields::with_source};

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
            let percent = stated.as_ref().map(|of| (100.0 * of.relative_sd, of.source.clone()));
            let new = with_source(ui, (title, "%"), percent.as_ref(), 1e-4..=200.0);
            match (new, stated) {
                (new, _) if new == percent => {}
                // Another source leaves the number as it was stated.
                (Some((value, source)), Some(of)) if value == 100.0 * of.relative_sd => of.source = source,
                (new, stated) => {
                    *stated = new.map(|(percent, source)| Repeatability { relative_sd: percent / 100.0, source });
                }
            }
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
