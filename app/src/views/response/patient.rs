//! What is asked of the patient: baseline, targets, radiotherapy, disease, treatment, surgery.

use egui::Ui;
use glioscope_core::{
    dates::leading_date,
    response::{
        Disease, Fact, History, Input as Asked, Label, Radiotherapy, Stated, Surgery, Treatment,
        TreatmentKind, When,
    },
};

use super::{
    Wanted,
    fields::{By, choice, day, day_with, no_more, said, take_back, text},
};
use crate::views::{
    draw::{self, name_widget},
    pane::Input,
};

const DISEASE: [(Disease, &str); 2] =
    [(Disease::NewlyDiagnosed, "newly diagnosed"), (Disease::Recurrent, "recurrent")];
const TARGETS_TIP: &str = "Names of lesions, with commas; empty: all measurable lesions of the baseline";
const KINDS: [(TreatmentKind, &str); 3] = [
    (TreatmentKind::Drug, "drug"),
    (TreatmentKind::Immunotherapy, "immunotherapy"),
    (TreatmentKind::Antiangiogenic, "antiangiogenic"),
];

/// The fields that are asked for or stated: baseline, disease and radiotherapy.
pub(super) fn show(ui: &mut Ui, input: &Input<'_>, history: &mut History, wanted: &Wanted<'_>, by: &By) {
    // Fields stay where they were once asked for, so that nothing moves under the pointer.
    let asks = |asked: Asked| wanted.of_patient(asked);
    if asks(Asked::Baseline) || history.baseline.is_some() {
        baseline(ui, input, wanted.counts(Asked::Baseline), history, by);
    }
    // By these the criteria choose a baseline where none is stated.
    let counts = |asked: Asked| wanted.all || wanted.counts(asked) || wanted.counts(Asked::Baseline);
    if asks(Asked::Disease) || asks(Asked::Baseline) || history.disease.is_some() {
        ui.horizontal_wrapped(|ui| {
            draw::asked(ui, "Disease", wanted.counts(Asked::Disease));
            let is_open = history.disease.is_some() || counts(Asked::Disease);
            choice(ui, "Disease", &mut history.disease, &DISEASE, by);
            no_more(ui, is_open);
        });
    }
    if asks(Asked::RadiotherapyEnd) || asks(Asked::Baseline) || history.radiotherapy_end.is_some() {
        ui.horizontal_wrapped(|ui| {
            let label = draw::asked(ui, "Radiotherapy ended", wanted.counts(Asked::RadiotherapyEnd));
            let is_open = history.radiotherapy_end.is_some() || counts(Asked::RadiotherapyEnd);
            radiotherapy(ui, label.id, history, by);
            no_more(ui, is_open);
        });
    }
}

/// Targets, treatments and surgeries, where asked for or stated.
pub(super) fn show_more(ui: &mut Ui, input: &Input<'_>, history: &mut History, wanted: &Wanted<'_>, by: &By) {
    let asks = |asked: Asked| wanted.of_patient(asked);
    if asks(Asked::Targets) || history.targets.is_some() {
        targets(ui, history, by);
    }
    if asks(Asked::Treatment) || history.treatment.is_some() {
        treatments(ui, history, by);
    }
    surgeries(ui, input, history, by);
}

fn baseline(ui: &mut Ui, input: &Input<'_>, is_missing: bool, history: &mut History, by: &By) {
    ui.horizontal_wrapped(|ui| {
        draw::asked(ui, "Baseline", is_missing)
            .on_hover_text("Not stated: by the criteria, from radiotherapy and surgery");
        let chosen = history.baseline.as_ref().map(|fact| fact.value.0.clone());
        for label in input.case.time_labels() {
            let is_chosen = chosen.as_deref() == Some(label);
            let response = ui.radio(is_chosen, if label.is_empty() { "no date" } else { label });
            name_widget(ui, &response, &format!("Baseline: {label}"));
            let is_proposed = is_chosen && history.baseline.as_ref().is_some_and(Fact::is_proposed);
            if response.clicked() && (!is_chosen || is_proposed) {
                history.baseline = Some(by.fact(Label(label.to_owned())));
            }
        }
        if chosen.is_some() && take_back(ui, "Baseline") {
            history.baseline = None;
        }
        if history.baseline.as_ref().is_some_and(Fact::is_proposed) {
            ui.weak("proposed: the only one with a later scan");
        }
    });
}

fn radiotherapy(ui: &mut Ui, label: egui::Id, history: &mut History, by: &By) {
    let stated = history.radiotherapy_end.as_ref().map(|fact| fact.value);
    let mut none = stated == Some(Radiotherapy::None);
    let response = ui.checkbox(&mut none, "there was none");
    name_widget(ui, &response, "Radiotherapy: there was none");
    if response.changed() {
        history.radiotherapy_end = none.then(|| by.fact(Radiotherapy::None));
    }
    if none {
        return;
    }
    let end = match stated {
        Some(Radiotherapy::Ended(when)) => Some(when),
        _ => None,
    };
    if let Some(new) = day(ui, "radiotherapy", label, end) {
        history.radiotherapy_end = new.map(|when| by.fact(Radiotherapy::Ended(when)));
    }
}

fn targets(ui: &mut Ui, history: &mut History, by: &By) {
    for (title, tip, is_main) in [
        ("Targets", TARGETS_TIP, true),
        ("Not targets", "Lesions that are followed, but aren't targets", false),
    ] {
        ui.horizontal_wrapped(|ui| {
            let label = ui.label(title).on_hover_text(tip);
            let fact = if is_main { &mut history.targets } else { &mut history.non_targets };
            let stated = fact.as_ref().map(|fact| fact.value.join(", ")).unwrap_or_default();
            if let Some(fact) = fact {
                label.clone().on_hover_text(said(fact.author.as_deref(), fact.entered.as_deref()));
            }
            if let Some(typed) = text(ui, title, label.id, &stated, 180.0) {
                *fact = Some(names_in(&typed)).filter(|all| !all.is_empty()).map(|all| by.fact(all));
            }
            if is_main && history.targets.is_none() {
                ui.weak("all measurable lesions of the baseline");
            }
        });
    }
}

fn treatments(ui: &mut Ui, history: &mut History, by: &By) {
    ui.horizontal_wrapped(|ui| {
        ui.label("Treatment");
        let mut none = history.treatment.as_ref().is_some_and(Vec::is_empty);
        let can_be_none = history.treatment.as_ref().is_none_or(Vec::is_empty);
        let tick = egui::Checkbox::new(&mut none, "there was none");
        let response = ui.add_enabled(can_be_none, tick);
        name_widget(ui, &response, "Treatment: there was none");
        if response.changed() {
            history.treatment = none.then(Vec::new);
            history.no_treatment_by = none.then(|| by.stated());
        }
    });
    let mut removed = None;
    for (n, treatment) in history.treatment.iter_mut().flatten().enumerate() {
        ui.push_id(("treatment", n), |ui| {
            ui.horizontal_wrapped(|ui| {
                let before = treatment.clone();
                let label = ui.label(format!("Start of treatment {}", n + 1));
                label.clone().on_hover_text(said(treatment.author.as_deref(), treatment.entered.as_deref()));
                if let Some(Some(start)) = day(ui, "start", label.id, Some(treatment.start)) {
                    treatment.start = start;
                }
                for (kind, text) in KINDS {
                    let response = ui.radio_value(&mut treatment.kind, kind, text);
                    name_widget(ui, &response, &format!("Kind of treatment {}: {text}", n + 1));
                }
                let label = ui.label("name");
                let called = treatment.name.clone().unwrap_or_default();
                if let Some(typed) = text(ui, "name", label.id, &called, 110.0) {
                    let typed = typed.trim().to_owned();
                    treatment.name = (!typed.is_empty()).then_some(typed);
                }
                if ui.small_button("Remove").clicked() {
                    removed = Some(n);
                }
                if *treatment != before {
                    Stated { author: treatment.author, entered: treatment.entered } = by.stated();
                }
            });
        });
    }
    if let (Some(n), Some(all)) = (removed, &mut history.treatment) {
        all.remove(n);
        if all.is_empty() {
            history.treatment = None;
            history.no_treatment_by = None;
        }
    }
    another_treatment(ui, history, by);
}

/// Its kind, then its date, which is typed into next.
fn another_treatment(ui: &mut Ui, history: &mut History, by: &By) {
    let chosen = ui.make_persistent_id("kind of another treatment");
    ui.horizontal_wrapped(|ui| {
        let mut kind = ui.data(|data| data.get_temp::<TreatmentKind>(chosen));
        // In the frame after the click, which takes the focus of every field.
        let focus = chosen.with("day");
        let is_next = ui.data_mut(|data| data.remove_temp::<bool>(focus)).unwrap_or_default();
        ui.label("Add");
        for (of, text) in KINDS {
            let response = ui.radio(kind == Some(of), text);
            name_widget(ui, &response, &format!("Kind of another treatment: {text}"));
            if response.clicked() {
                kind = Some(of);
                ui.data_mut(|data| {
                    data.insert_temp(chosen, of);
                    data.insert_temp(focus, true);
                });
                ui.ctx().request_repaint();
            }
        }
        let label = ui.label("started on");
        if let Some(Some(start)) = day_with(ui, "another treatment", label.id, (None, is_next)) {
            let Stated { author, entered } = by.stated();
            let kind = kind.unwrap_or(TreatmentKind::Drug);
            let new = Treatment { start, kind, name: None, author, entered };
            history.no_treatment_by = None;
            history.treatment.get_or_insert_default().push(new);
            ui.data_mut(|data| data.remove::<TreatmentKind>(chosen));
        }
    });
}

fn surgeries(ui: &mut Ui, input: &Input<'_>, history: &mut History, by: &By) {
    let mut removed = None;
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Surgery").on_hover_text("Resets baseline, lowest sum and targets");
        for (n, surgery) in history.surgery.iter().enumerate() {
            let said = said(surgery.author.as_deref(), surgery.entered.as_deref());
            let tip = format!("{said}; click to take it away");
            if ui.button(format!("{} ×", surgery.date)).on_hover_text(tip).clicked() {
                removed = Some(n);
            }
        }
        if let Some(Some(date)) = day(ui, "another surgery", label.id, None) {
            let Stated { author, entered } = by.stated();
            history.surgery.push(Surgery { date, baseline: None, targets: None, author, entered });
        }
    });
    if let Some(n) = removed {
        history.surgery.remove(n);
    }
    for (n, surgery) in history.surgery.iter_mut().enumerate() {
        ui.push_id(("after surgery", n), |ui| after_surgery(ui, input, surgery, by));
    }
}

/// Baseline and targets after a surgery, which are proposed by the criteria until they are stated.
fn after_surgery(ui: &mut Ui, input: &Input<'_>, surgery: &mut Surgery, by: &By) {
    let before = surgery.clone();
    let of = surgery.date.to_string();
    ui.horizontal_wrapped(|ui| {
        ui.label(format!("After that of {of}: baseline"))
            .on_hover_text("Not stated: by the criteria, else the first scan after it");
        let is_after = |label: &&str| match (surgery.date, leading_date(label)) {
            (When::Date(day), Some(date)) => date > day,
            _ => true,
        };
        let chosen = surgery.baseline.as_ref().map(|label| label.0.clone());
        for label in input.case.time_labels().into_iter().filter(is_after) {
            let response = ui.radio(chosen.as_deref() == Some(label), label);
            name_widget(ui, &response, &format!("Baseline after surgery of {of}: {label}"));
            if response.clicked() {
                surgery.baseline = Some(Label(label.to_owned()));
            }
        }
        if chosen.is_some() && take_back(ui, &format!("Baseline after surgery of {of}")) {
            surgery.baseline = None;
        }
        let label = ui.label("targets").on_hover_text(TARGETS_TIP);
        let stated = surgery.targets.as_ref().map(|all| all.join(", ")).unwrap_or_default();
        if let Some(typed) = text(ui, "targets", label.id, &stated, 140.0) {
            surgery.targets = Some(names_in(&typed)).filter(|all| !all.is_empty());
        }
        if surgery.targets.is_none() {
            ui.weak("all measurable lesions of that baseline");
        }
    });
    if *surgery != before {
        Stated { author: surgery.author, entered: surgery.entered } = by.stated();
    }
}

/// The names in a text, each once.
fn names_in(typed: &str) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for name in typed.split(',').map(str::trim).filter(|name| !name.is_empty()) {
        if !all.iter().any(|other| other == name) {
            all.push(name.to_owned());
        }
    }
    all
}
