//! What is asked of each scan: a row per fact, a column per date.

use egui::{Grid, Ui};
use glioscope_core::{
    dates::leading_date,
    response::{
        Clinical, Field, Flair, Histology, History, Input as Asked, Label, NewLesion, NonTarget, ScanFacts,
        SteroidReason, Technique,
    },
};

use super::{
    Wanted,
    fields::{By, choice, number},
};
use crate::views::pane::Input;

const CLINICAL: [(Clinical, &str); 4] = [
    (Clinical::Stable, "stable"),
    (Clinical::Better, "better"),
    (Clinical::Worse, "worse"),
    (Clinical::MuchWorse, "much worse"),
];
const NEW: [(NewLesion, &str); 4] = [
    (NewLesion::None, "none"),
    (NewLesion::Equivocal, "equivocal"),
    (NewLesion::Measurable, "measurable"),
    (NewLesion::NonMeasurable, "not measurable"),
];
const NON_TARGET: [(NonTarget, &str); 4] = [
    (NonTarget::None, "there are none"),
    (NonTarget::Gone, "gone"),
    (NonTarget::NotWorse, "not worse"),
    (NonTarget::Worse, "worse"),
];
const FLAIR: [(Flair, &str); 2] = [(Flair::NotWorse, "not worse"), (Flair::Worse, "worse")];
const FIELD: [(Field, &str); 2] = [(Field::Inside, "inside"), (Field::Outside, "outside")];
const REASON: [(SteroidReason, &str); 2] =
    [(SteroidReason::Tumour, "the tumour"), (SteroidReason::Other, "another cause")];
const HISTOLOGY: [(Histology, &str); 3] = [
    (Histology::NotDone, "not done"),
    (Histology::Tumour, "tumour"),
    (Histology::TreatmentEffect, "treatment effect"),
];
const TECHNIQUE: [(Technique, &str); 3] = [
    (Technique::Sequence, "sequence"),
    (Technique::Contrast, "contrast"),
    (Technique::SliceThickness, "slice thickness"),
];

/// The facts, in rows.
const ROWS: [(Asked, &str); 9] = [
    (Asked::NewLesion, "New lesions"),
    (Asked::NonTarget, "Lesions that aren't targets"),
    (Asked::Flair, "T2/FLAIR"),
    (Asked::Clinical, "Clinical state"),
    (Asked::Steroids, "Steroids, mg dexamethasone a day"),
    (Asked::SteroidsReason, "Why steroids were raised"),
    (Asked::Technique, "Technique changed"),
    (Asked::Field, "Growth and radiation field"),
    (Asked::Histology, "Histology"),
];

/// The table of facts that are asked for or stated.
pub(super) fn show(ui: &mut Ui, input: &Input<'_>, history: &mut History, wanted: &Wanted, by: &By) {
    let labels: Vec<String> = input.case.time_labels().into_iter().map(str::to_owned).collect();
    let no_dates = labels.iter().any(|label| leading_date(label).is_none());
    let facts_at = |history: &History, label: &str| history.date.iter().position(|f| f.date.0 == label);
    let is_stated = |history: &History, asked: Asked, label: &str| {
        facts_at(history, label).and_then(|n| history.date.get(n)).is_some_and(|facts| has(facts, asked))
    };
    let rows: Vec<(Asked, &str)> = ROWS
        .into_iter()
        .filter(|(asked, _)| {
            labels.iter().any(|label| wanted.at(label, *asked) || is_stated(history, *asked, label))
        })
        .collect();
    if rows.is_empty() && !no_dates {
        return;
    }
    Grid::new("facts of scans").striped(true).spacing([10.0, 4.0]).show(ui, |ui| {
        ui.label("");
        for label in &labels {
            ui.strong(if label.is_empty() { "no date" } else { label });
        }
        ui.end_row();
        if no_dates {
            let name =
                ui.label("Day").on_hover_text("Days since any first day, as the dates aren't calendar dates");
            for label in &labels {
                let days = facts_at(history, label).and_then(|n| history.date.get(n)?.days);
                if let Some(typed) = number(ui, ("day of", label), name.id, days.map(f64::from)) {
                    facts_of(history, label).days = typed.map(|day| day.round() as i32);
                }
            }
            ui.end_row();
        }
        for (asked, title) in rows {
            let name = ui.label(title);
            for label in &labels {
                if !wanted.at(label, asked) && !is_stated(history, asked, label) {
                    ui.weak("–");
                    continue;
                }
                let mut facts = facts_at(history, label)
                    .and_then(|n| history.date.get(n).cloned())
                    .unwrap_or_else(|| ScanFacts { date: Label(label.clone()), ..ScanFacts::default() });
                let before = facts.clone();
                ui.push_id((title, label), |ui| {
                    cell(ui, asked, &format!("{title} at {label}"), &mut facts, name.id, by);
                });
                if facts != before {
                    *facts_of(history, label) = facts;
                }
            }
            ui.end_row();
        }
    });
}

/// The facts of a scan, made where there are none.
fn facts_of<'a>(history: &'a mut History, label: &str) -> &'a mut ScanFacts {
    let at = history.date.iter().position(|facts| facts.date.0 == label).unwrap_or_else(|| {
        history.date.push(ScanFacts { date: Label(label.to_owned()), ..ScanFacts::default() });
        history.date.len() - 1
    });
    &mut history.date[at]
}

fn has(facts: &ScanFacts, asked: Asked) -> bool {
    match asked {
        Asked::NewLesion => facts.new_lesion.is_some(),
        Asked::NonTarget => facts.non_target.is_some(),
        Asked::Flair => facts.flair.is_some(),
        Asked::Clinical => facts.clinical.is_some(),
        Asked::Steroids => facts.steroids_mg.is_some(),
        Asked::SteroidsReason => facts.steroids_reason.is_some(),
        Asked::Technique => facts.technique_changed.is_some(),
        Asked::Field => facts.field.is_some(),
        Asked::Histology => facts.histology.is_some(),
        _ => false,
    }
}

fn cell(ui: &mut Ui, asked: Asked, label: &str, facts: &mut ScanFacts, name: egui::Id, by: &By) {
    match asked {
        Asked::NewLesion => choice(ui, label, &mut facts.new_lesion, &NEW, by),
        Asked::NonTarget => choice(ui, label, &mut facts.non_target, &NON_TARGET, by),
        Asked::Flair => choice(ui, label, &mut facts.flair, &FLAIR, by),
        Asked::Clinical => choice(ui, label, &mut facts.clinical, &CLINICAL, by),
        Asked::SteroidsReason => choice(ui, label, &mut facts.steroids_reason, &REASON, by),
        Asked::Field => choice(ui, label, &mut facts.field, &FIELD, by),
        Asked::Histology => choice(ui, label, &mut facts.histology, &HISTOLOGY, by),
        Asked::Steroids => {
            let stated = facts.steroids_mg.as_ref().map(|fact| fact.value);
            if let Some(typed) = number(ui, "steroids", name, stated) {
                facts.steroids_mg = typed.map(|mg| by.fact(mg.clamp(0.0, 1000.0)));
            }
        }
        Asked::Technique => technique(ui, facts, by),
        _ => {}
    }
}

/// What changed of the technique: nothing, or some of it.
fn technique(ui: &mut Ui, facts: &mut ScanFacts, by: &By) {
    let stated = facts.technique_changed.as_ref().map(|fact| fact.value.clone());
    let mut new = stated.clone();
    ui.vertical(|ui| {
        let mut same = stated.as_ref().is_some_and(Vec::is_empty);
        if ui.checkbox(&mut same, "nothing").changed() {
            new = same.then(Vec::new);
        }
        for (technique, text) in TECHNIQUE {
            let mut changed = stated.as_ref().is_some_and(|all| all.contains(&technique));
            if ui.checkbox(&mut changed, text).changed() {
                let mut all = stated.clone().unwrap_or_default();
                all.retain(|other| *other != technique);
                if changed {
                    all.push(technique);
                }
                new = (!all.is_empty()).then_some(all);
            }
        }
    });
    if new != stated {
        facts.technique_changed = new.map(|all| by.fact(all));
    }
}
