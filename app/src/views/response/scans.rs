//! What is asked of each scan.

use egui::{Link, RichText, Ui};
use glioscope_core::{
    dates::leading_date,
    response::{
        Clinical, Field, Flair, Histology, History, Input as Asked, Label, NewLesion, NonTarget, ScanFacts,
        SteroidReason, Technique,
    },
};

use super::{
    Found, Wanted,
    fields::{By, choice, no_more, number},
};
use crate::{
    command::Commands,
    views::{
        draw::{self, name_widget},
        lesions::{self, Selected},
        pane::Input,
    },
};

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

/// The facts that are asked for or stated, scan by scan, the last one first: it is the one that is read.
pub(super) fn show(
    ui: &mut Ui,
    input: &Input<'_>,
    history: &mut History,
    wanted: &Wanted<'_>,
    by: &By,
    out: &mut Commands,
) {
    let labels: Vec<String> = input.case.time_labels().into_iter().map(str::to_owned).collect();
    let no_dates = labels.iter().any(|label| leading_date(label).is_none());
    for (n, label) in labels.iter().enumerate().rev() {
        let before = facts_at(history, label).cloned();
        let before =
            before.unwrap_or_else(|| ScanFacts { date: Label(label.clone()), ..ScanFacts::default() });
        let stated = |asked: Asked| has(&before, asked);
        let scan = (label.as_str(), n == 0);
        let rows: Vec<(Asked, &str, bool)> = ROWS
            .into_iter()
            .filter(|(asked, _)| wanted.was_asked(scan, *asked) || stated(*asked))
            .map(|(asked, title)| (asked, title, wanted.at(scan, asked) || stated(asked)))
            .collect();
        if rows.is_empty() && !no_dates {
            continue;
        }
        ui.push_id(("facts of", label), |ui| {
            let date = if label.is_empty() { "no date" } else { label };
            let mut facts = before.clone();
            ui.horizontal(|ui| {
                ui.strong(date);
                let earlier = labels[..n].iter().filter_map(|label| facts_at(history, label));
                let dose =
                    earlier.filter_map(|facts| facts.steroids_mg.as_ref()).map(|fact| fact.value).next_back();
                // What the masks show is for the reader to decide.
                let is_found = |asked: Asked| {
                    asked == Asked::NewLesion && wanted.new_in_masks.contains_key(label.as_str())
                };
                let open = |asked: Asked| {
                    let is_seen = asked != Asked::Flair || !lacks_flair(input, label);
                    wanted.at(scan, asked) && !stated(asked) && !is_found(asked) && is_seen
                };
                nothing_worse(ui, date, &mut facts, (dose, wanted.only_measurable), &open, by);
            });
            if no_dates {
                ui.horizontal(|ui| {
                    let tip = "Days since any first day, as the dates aren't calendar dates";
                    let name = ui.label("Day").on_hover_text(tip);
                    if let Some(typed) = number(ui, ("day of", label), name.id, facts.days.map(f64::from)) {
                        facts.days = typed.map(|day| day.round() as i32);
                    }
                });
            }
            for (asked, title, counts) in rows {
                ui.horizontal_wrapped(|ui| {
                    let name = draw::asked(ui, title, wanted.counts_at(label, asked) && !stated(asked));
                    cell(ui, asked, &format!("{title} at {date}"), &mut facts, name.id, by);
                    no_more(ui, counts);
                    if asked == Asked::Flair && lacks_flair(input, label) {
                        ui.weak("no image here is named T2 or FLAIR");
                    }
                });
                // On lines of their own, where they stay whole.
                let found = wanted.new_in_masks.get(label.as_str());
                let stated = facts.new_lesion.as_ref().map(|fact| fact.value);
                let is_answered = stated.is_some_and(|stated| stated != NewLesion::None);
                for (n, found) in
                    found.filter(|_| asked == Asked::NewLesion).into_iter().flatten().enumerate()
                {
                    of_masks(ui, input, (n, found, is_answered), out);
                }
            }
            if facts != before {
                *facts_of(history, label) = facts;
            }
        });
        ui.add_space(4.0);
    }
}

/// Whether a scan has images, and none that is named like T2 or FLAIR: what these show isn't stated by the way.
fn lacks_flair(input: &Input<'_>, label: &str) -> bool {
    let images =
        input.case.time_points.iter().filter(|time| time.label == label).flat_map(|time| &time.contexts);
    let names: Vec<String> = images.map(|image| image.id.to_lowercase()).collect();
    !names.is_empty() && !names.iter().any(|name| name.contains("fla") || name.contains("t2"))
}

/// A new lesion of the masks, which a click shows in all views; in the colour of warnings unless the reader states one, too.
fn of_masks(
    ui: &mut Ui,
    input: &Input<'_>,
    (number, found, is_answered): (usize, &Found, bool),
    out: &mut Commands,
) {
    let text = if number == 0 { format!("the masks show {}", found.words) } else { found.words.clone() };
    let visuals = ui.visuals();
    let color = if is_answered { visuals.hyperlink_color } else { visuals.warn_fg_color };
    let link = ui.add(Link::new(RichText::new(text).color(color)));
    if link.on_hover_text("Shows it in all views").clicked()
        && let Some((anchor, volume_ml)) = &found.at
    {
        lesions::go_to(input, anchor, *volume_ml, out);
        lesions::select(ui, input, &Selected::One(anchor.clone()));
    }
}

/// A button that states of everything still open that nothing got worse; of the dose of steroids that it is `dose_mg`, the last stated
/// before. What only something worse can raise stays open.
fn nothing_worse(
    ui: &mut Ui,
    date: &str,
    facts: &mut ScanFacts,
    (dose_mg, only_measurable): (Option<f64>, bool),
    open: &dyn Fn(Asked) -> bool,
    by: &By,
) {
    let mut all = Vec::new();
    let mut filled = facts.clone();
    let mut state = |asked: Asked, text: String, set: &dyn Fn(&mut ScanFacts)| {
        if open(asked) {
            all.push(text);
            set(&mut filled);
        }
    };
    state(Asked::NewLesion, "no new lesions".into(), &|f| f.new_lesion = Some(by.fact(NewLesion::None)));
    let (others, text) = if only_measurable {
        (NonTarget::None, "no lesions that aren't targets")
    } else {
        (NonTarget::NotWorse, "lesions that aren't targets not worse")
    };
    state(Asked::NonTarget, text.into(), &|f| f.non_target = Some(by.fact(others)));
    state(Asked::Flair, "T2/FLAIR not worse".into(), &|f| f.flair = Some(by.fact(Flair::NotWorse)));
    state(Asked::Clinical, "clinically stable".into(), &|f| f.clinical = Some(by.fact(Clinical::Stable)));
    if let Some(mg) = dose_mg {
        state(Asked::Steroids, format!("{mg} mg dexamethasone as before"), &|f| {
            f.steroids_mg = Some(by.fact(mg));
        });
    }
    state(Asked::Technique, "the same technique".into(), &|f| {
        f.technique_changed = Some(by.fact(Vec::new()));
    });
    if all.is_empty() {
        return;
    }
    let response = ui.small_button("Nothing worse").on_hover_text(format!("States: {}", all.join(", ")));
    name_widget(ui, &response, &format!("Nothing worse at {date}"));
    if response.clicked() {
        *facts = filled;
    }
}

/// What is stated of a scan.
fn facts_at<'a>(history: &'a History, label: &str) -> Option<&'a ScanFacts> {
    history.date.iter().find(|facts| facts.date.0 == label)
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

fn cell(ui: &mut Ui, asked: Asked, label: &str, facts: &mut ScanFacts, title: egui::Id, by: &By) {
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
            if let Some(typed) = number(ui, "steroids", title, stated) {
                facts.steroids_mg = typed.map(|mg| by.fact(mg.clamp(0.0, 1000.0)));
            }
            if stated.is_none() {
                let response = ui.small_button("none");
                name_widget(ui, &response, &format!("{label}: none"));
                if response.clicked() {
                    facts.steroids_mg = Some(by.fact(0.0));
                }
            }
        }
        Asked::Technique => technique(ui, label, facts, by),
        _ => {}
    }
}

/// What changed of the technique: nothing, or some of it.
fn technique(ui: &mut Ui, label: &str, facts: &mut ScanFacts, by: &By) {
    let stated = facts.technique_changed.as_ref().map(|fact| fact.value.clone());
    let mut new = stated.clone();
    let tick = |ui: &mut Ui, ticked: &mut bool, text: &str| {
        let response = ui.checkbox(ticked, text);
        name_widget(ui, &response, &format!("{label}: {text}"));
        response.changed()
    };
    let mut same = stated.as_ref().is_some_and(Vec::is_empty);
    if tick(ui, &mut same, "nothing") {
        new = same.then(Vec::new);
    }
    for (technique, text) in TECHNIQUE {
        let mut changed = stated.as_ref().is_some_and(|all| all.contains(&technique));
        if tick(ui, &mut changed, text) {
            let mut all = stated.clone().unwrap_or_default();
            all.retain(|other| *other != technique);
            if changed {
                all.push(technique);
            }
            new = (!all.is_empty()).then_some(all);
        }
    }
    if new != stated {
        facts.technique_changed = new.map(|all| by.fact(all));
    }
}
