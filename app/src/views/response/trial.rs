//! What a trial states where no source of the criteria that was read does.

use egui::{CollapsingHeader, Ui};
use glioscope_core::response::{Criterion, History, Part, TrialNumber, TrialValue};
use strum::VariantArray;

use super::fields::{SOURCE, source_of, with_source};

const PARTS: [(Part, &str); 4] = [
    (Part::Measurable, "measurable lesions"),
    (Part::NonTarget, "lesions that aren't targets"),
    (Part::Steroids, "steroids"),
    (Part::Clinical, "clinical state"),
];

/// What a number is called, and its unit.
fn title(number: TrialNumber) -> (&'static str, &'static str) {
    match number {
        TrialNumber::MaxTargets => ("Most targets", "lesions"),
        TrialNumber::ConfirmResponseDays => ("Response is confirmed after", "days"),
        TrialNumber::ConfirmProgressionDays => ("Progression is confirmed after", "days"),
        TrialNumber::MinorResponseVolumePercent => ("Minor response: volume less by", "%"),
        TrialNumber::ProgressionAbsoluteMm => ("Progression: longer by at least", "mm"),
    }
}

/// Fields for the numbers that the criteria leave to a trial, and for the parts that it takes from RANO 2010.
pub(super) fn show(ui: &mut Ui, history: &mut History) {
    let criterion = history.criterion;
    let open: Vec<TrialNumber> =
        TrialNumber::VARIANTS.iter().copied().filter(|number| number.is_open(criterion)).collect();
    let follows = criterion != Criterion::Rano2010;
    if open.is_empty() && !follows {
        return;
    }
    CollapsingHeader::new("What the trial states").id_salt("trial").show(ui, |ui| {
        ui.weak(
            "Where no source of these criteria that was read states it: the trial's own, and where it stands",
        );
        for of in open {
            row(ui, history, of);
        }
        if follows {
            parts(ui, history);
        }
    });
}

fn row(ui: &mut Ui, history: &mut History, of: TrialNumber) {
    let trial = &mut history.trial;
    let stated = of.of(trial).map(|(value, source)| (value, source.to_owned()));
    let new = with_source(ui, title(of), stated.as_ref(), 0.0..=of.most());
    if new != stated {
        of.set(trial, new);
    }
}

fn parts(ui: &mut Ui, history: &mut History) {
    let stated = history.trial.follow_2010.clone();
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("As RANO 2010");
        let mut chosen = stated.as_ref().map(|stated| stated.value.clone()).unwrap_or_default();
        for (part, text) in PARTS {
            let mut follows = chosen.contains(&part);
            if ui.checkbox(&mut follows, text).changed() {
                chosen.retain(|other| *other != part);
                if follows {
                    chosen.push(part);
                }
            }
        }
        let source = stated.as_ref().map_or_else(|| SOURCE.to_owned(), |stated| stated.source.clone());
        let typed = stated.is_some().then(|| {
            ui.label("source");
            source_of(ui, "follow_2010", label.id, &source)
        });
        let source = typed.flatten().unwrap_or(source);
        history.trial.follow_2010 = (!chosen.is_empty()).then_some(TrialValue { value: chosen, source });
    });
}
