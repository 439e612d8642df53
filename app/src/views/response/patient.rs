//! What is asked of the patient: baseline, targets, radiotherapy, disease, treatment, surgery.

use egui::{ComboBox, Ui};
use glioscope_core::response::{
    Disease, Fact, History, Input as Asked, Label, Radiotherapy, Surgery, Treatment, TreatmentKind,
};

use super::{
    Wanted,
    fields::{By, choice, day, text},
};
use crate::views::pane::Input;

const DISEASE: [(Disease, &str); 2] =
    [(Disease::NewlyDiagnosed, "newly diagnosed"), (Disease::Recurrent, "recurrent")];
const KINDS: [(TreatmentKind, &str); 3] = [
    (TreatmentKind::Drug, "drug"),
    (TreatmentKind::Immunotherapy, "immunotherapy"),
    (TreatmentKind::Antiangiogenic, "antiangiogenic"),
];

/// The fields that are asked for or stated.
pub(super) fn show(ui: &mut Ui, input: &Input<'_>, history: &mut History, wanted: &Wanted, by: &By) {
    let asks = |asked: Asked| wanted.of_patient(asked);
    if asks(Asked::Baseline) || history.baseline.is_some() {
        baseline(ui, input, history, by);
    }
    if asks(Asked::Disease) || asks(Asked::Baseline) || history.disease.is_some() {
        ui.horizontal_wrapped(|ui| {
            ui.label("Disease");
            choice(ui, "Disease", &mut history.disease, &DISEASE, by);
        });
    }
    if asks(Asked::RadiotherapyEnd) || asks(Asked::Baseline) || history.radiotherapy_end.is_some() {
        radiotherapy(ui, history, by);
    }
    if asks(Asked::Targets) || history.targets.is_some() {
        targets(ui, history);
    }
    if asks(Asked::Treatment) || history.treatment.is_some() {
        treatments(ui, history);
    }
    surgeries(ui, history);
}

fn baseline(ui: &mut Ui, input: &Input<'_>, history: &mut History, by: &By) {
    ui.horizontal_wrapped(|ui| {
        ui.label("Baseline");
        let chosen = history.baseline.as_ref().map(|fact| fact.value.0.clone());
        let text = chosen.clone().unwrap_or_else(|| "by the criteria".to_owned());
        let shown = ComboBox::from_id_salt("baseline").selected_text(text).show_ui(ui, |ui| {
            if ui.selectable_label(chosen.is_none(), "by the criteria").clicked() {
                history.baseline = None;
            }
            for label in input.case.time_labels() {
                let is_chosen = chosen.as_deref() == Some(label);
                if ui.selectable_label(is_chosen, label).clicked() && !is_chosen {
                    history.baseline = Some(by.fact(Label(label.to_owned())));
                }
            }
        });
        ui.ctx().accesskit_node_builder(shown.response.id, |node| node.set_label("Baseline"));
    });
}

fn radiotherapy(ui: &mut Ui, history: &mut History, by: &By) {
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Radiotherapy ended");
        let stated = history.radiotherapy_end.as_ref().map(|fact| fact.value);
        let mut none = stated == Some(Radiotherapy::None);
        if ui.checkbox(&mut none, "there was none").changed() {
            history.radiotherapy_end = none.then(|| by.fact(Radiotherapy::None));
        }
        if none {
            return;
        }
        let end = match stated {
            Some(Radiotherapy::Ended(when)) => Some(when),
            _ => None,
        };
        if let Some(new) = day(ui, "radiotherapy", label.id, end) {
            history.radiotherapy_end = new.map(|when| by.fact(Radiotherapy::Ended(when)));
        }
    });
}

fn targets(ui: &mut Ui, history: &mut History) {
    for (title, tip, is_main) in [
        ("Targets", "Names of lesions, with commas; empty: all measurable lesions of the baseline", true),
        ("Not targets", "Lesions that are followed, but aren't targets", false),
    ] {
        ui.horizontal_wrapped(|ui| {
            let label = ui.label(title).on_hover_text(tip);
            let stated = if is_main {
                history.targets.clone().unwrap_or_default()
            } else {
                history.non_targets.clone()
            };
            if let Some(typed) = text(ui, title, label.id, &stated.join(", "), 180.0) {
                let names = typed.split(',').map(str::trim).filter(|name| !name.is_empty());
                let mut all: Vec<String> = Vec::new();
                for name in names {
                    if !all.iter().any(|other| other == name) {
                        all.push(name.to_owned());
                    }
                }
                if is_main {
                    history.targets = (!all.is_empty()).then_some(all);
                } else {
                    history.non_targets = all;
                }
            }
            if is_main && history.targets.is_none() {
                ui.weak("all measurable lesions of the baseline");
            }
        });
    }
}

fn treatments(ui: &mut Ui, history: &mut History) {
    ui.horizontal_wrapped(|ui| {
        ui.label("Treatment");
        let mut none = history.treatment.as_ref().is_some_and(Vec::is_empty);
        let can_be_none = history.treatment.as_ref().is_none_or(Vec::is_empty);
        let tick = egui::Checkbox::new(&mut none, "there was none");
        if ui.add_enabled(can_be_none, tick).changed() {
            history.treatment = none.then(Vec::new);
        }
    });
    let mut removed = None;
    for (n, treatment) in history.treatment.iter_mut().flatten().enumerate() {
        ui.push_id(("treatment", n), |ui| {
            ui.horizontal_wrapped(|ui| {
                let label = ui.label(format!("Start of treatment {}", n + 1));
                if let Some(Some(start)) = day(ui, "start", label.id, Some(treatment.start)) {
                    treatment.start = start;
                }
                let mut kind = Some(Fact::of(treatment.kind));
                choice(ui, &format!("Kind of treatment {}", n + 1), &mut kind, &KINDS, &By::today(""));
                treatment.kind = kind.map_or(treatment.kind, |fact| fact.value);
                let label = ui.label("name");
                let name = treatment.name.clone().unwrap_or_default();
                if let Some(typed) = text(ui, "name", label.id, &name, 110.0) {
                    let typed = typed.trim().to_owned();
                    treatment.name = (!typed.is_empty()).then_some(typed);
                }
                if ui.small_button("Remove").clicked() {
                    removed = Some(n);
                }
            });
        });
    }
    if let (Some(n), Some(all)) = (removed, &mut history.treatment) {
        all.remove(n);
        if all.is_empty() {
            history.treatment = None;
        }
    }
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Add a treatment that started on");
        if let Some(Some(start)) = day(ui, "another treatment", label.id, None) {
            let new = Treatment { start, kind: TreatmentKind::Drug, name: None };
            history.treatment.get_or_insert_default().push(new);
        }
    });
}

fn surgeries(ui: &mut Ui, history: &mut History) {
    let mut removed = None;
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Surgery").on_hover_text("Resets baseline, lowest sum and targets");
        for (n, surgery) in history.surgery.iter().enumerate() {
            if ui.button(format!("{} ×", surgery.date)).on_hover_text("Take away").clicked() {
                removed = Some(n);
            }
        }
        if let Some(Some(date)) = day(ui, "another surgery", label.id, None) {
            history.surgery.push(Surgery { date, baseline: None, targets: None });
        }
    });
    if let Some(n) = removed {
        history.surgery.remove(n);
    }
}
