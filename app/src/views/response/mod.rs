//! Response by criteria: what a reader states, asked for where it can change a call, and the calls with their reasons.

mod bt_rads;
mod by_hand;
mod calls;
mod fields;
mod links;
mod patient;
mod rules;
mod scans;
mod trial;

use std::collections::{BTreeMap, HashSet};

use egui::{ComboBox, ScrollArea, Ui};
use glioscope_core::{
    case::Case,
    dates::leading_date,
    lesions::{Anchor, LesionDate, LesionsReport, new_lesions},
    response::{Assessment, Criterion, Evaluated, History, Input as Asked, unstated_new},
};
use strum::VariantArray;

use super::{
    draw,
    pane::{Input, Pane, Stage},
};
use crate::{
    command::{AppCommand, Commands, EditCommand},
    format,
    model::{PaneId, ResponseSetting, layout::Task, response::MOST_AUTHOR},
    world::jobs::{Handle, Lookup, progress_text},
};
use fields::By;

/// The pane of the response.
#[derive(Default)]
pub struct ResponsePane {
    /// Label of the date whose reasons are shown; `None`: the last.
    date: Option<String>,
    /// Whether inputs that change nothing are asked for too.
    all_inputs: bool,
    /// What was asked for, and by which criteria at which dates: it keeps its place until those change.
    asked: HashSet<AskedFor>,
    asked_by: Option<(Criterion, Handle<Case>)>,
}

/// An input of a scan by its label, or of the patient.
type AskedFor = (Option<String>, Asked);

/// Inputs that are asked for: of the patient, and of scans by their labels.
struct Wanted<'a> {
    all: bool,
    missing: HashSet<AskedFor>,
    /// What was asked for since the criteria were chosen, the missing ones among them.
    asked: &'a HashSet<AskedFor>,
    /// New lesions that the masks show, by date: a reader decides what they are.
    new_in_masks: BTreeMap<&'a str, Vec<Found>>,
    /// Whether the masks show no lesion at the first date but measurable ones.
    only_measurable: bool,
}

impl Wanted<'_> {
    /// Whether a fact of the patient is asked for, or was.
    fn of_patient(&self, input: Asked) -> bool {
        self.all || self.asked.contains(&(None, input))
    }

    /// Whether a fact of the patient can change a call now.
    fn counts(&self, input: Asked) -> bool {
        self.missing.contains(&(None, input))
    }

    /// Whether a fact of a scan can change a call now, or the masks ask for it.
    fn counts_at(&self, date: &str, input: Asked) -> bool {
        self.missing.contains(&(Some(date.to_owned()), input))
            || (input == Asked::NewLesion && self.new_in_masks.contains_key(date))
    }

    /// Whether a fact of a scan is asked for. Where all are, those of the first scan that compare it with an earlier one aren't, nor why a
    /// dose was raised that may not have been.
    fn at(&self, (date, is_first): (&str, bool), input: Asked) -> bool {
        let compares = !matches!(input, Asked::Steroids | Asked::Histology);
        let is_shown = self.all && !(is_first && compares) && input != Asked::SteroidsReason;
        is_shown || self.counts_at(date, input)
    }

    /// Whether it was asked for since the criteria were chosen.
    fn was_asked(&self, scan: (&str, bool), input: Asked) -> bool {
        self.at(scan, input) || self.asked.contains(&(Some(scan.0.to_owned()), input))
    }
}

/// A new lesion of the masks.
struct Found {
    /// Its name and size.
    words: String,
    /// Where its largest piece lies, and its volume in millilitres.
    at: Option<(Anchor, f64)>,
}

/// New lesions that masks show by date, and whether none of the first date is other than measurable.
fn of_masks(report: &LesionsReport) -> (BTreeMap<&str, Vec<Found>>, bool) {
    let mut new: BTreeMap<&str, Vec<Found>> = BTreeMap::new();
    for (name, date) in new_lesions(report) {
        let largest = date.parts.iter().max_by(|a, b| a.volume_ml.total_cmp(&b.volume_ml));
        let at = largest.and_then(|part| Some((part.anchor.clone()?, part.volume_ml)));
        new.entry(&date.time)
            .or_default()
            .push(Found { words: format!("{name}, {}", size_in_words(date)), at });
    }
    let first =
        report.lesions.iter().filter(|lesion| !lesion.small).filter_map(|lesion| lesion.dates.first());
    let only_measurable =
        first.filter(|date| !date.parts.is_empty()).all(|date| date.measurable == Some(true));
    (new, only_measurable)
}

/// Volume, diameters, and whether they count.
fn size_in_words(date: &LesionDate) -> String {
    let mut text = date.volume_ml.map_or_else(|| "unknown size".to_owned(), format::ml);
    if let (Some(d1), Some(d2)) = (date.d1_mm, date.d2_mm) {
        text = format!("{text}, {d1:.1} × {d2:.1} mm");
    }
    if date.measurable == Some(false) { text + ", not measurable" } else { text + ", measurable" }
}

/// What can change a call.
fn missing(evaluated: &Evaluated) -> HashSet<AskedFor> {
    let judgements = evaluated.response.dates.iter().flat_map(|date| [&date.by_diameters, &date.by_volume]);
    judgements.flat_map(|j| j.to_state()).map(|missing| (missing.date.clone(), missing.input)).collect()
}

impl Pane for ResponsePane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        draw::padded(ui, |ui| {
            // Another case begins at its top.
            let of_case = std::sync::Arc::as_ptr(stage.input.case) as usize;
            let area = ScrollArea::both().id_salt(("response", of_case)).auto_shrink([false, false]);
            area.show(ui, |ui| self.content(ui, stage, out));
        });
    }
}

impl ResponsePane {
    fn content(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        let input = stage.input;
        let old = &input.doc.edit.response;
        let mut new = old.clone();
        let by = By::today(&head(ui, &input, &mut new, out));
        match new.history.clone() {
            None => {
                ui.weak("Choose criteria: lesions are judged at every date, by diameters and by volume");
            }
            Some(mut history) => {
                let results = &mut *stage.results;
                let lookup = results.response.get(input.case, input.doc, &mut results.lesions, stage.ask);
                let mut status = Status::Nothing;
                match lookup {
                    Some(Lookup::Failed(error)) => status = Status::Error(error.to_string()),
                    Some(Lookup::Working(progress)) => status = Status::Working(progress_text(progress)),
                    _ => {}
                }
                let failed = matches!(status, Status::Error(_));
                let evaluated = results.response.last().filter(|_| !failed).cloned();
                if no_days(&input, &history) {
                    let text = "The dates are no calendar dates: state the day of each scan below, counted from any first day";
                    status = Status::Warning(text.into());
                }
                let lesions = results.lesions.last().cloned();
                let unstated =
                    lesions.as_deref().map(|lesions| unstated_new(lesions, &history)).unwrap_or_default();
                if let (Status::Nothing, Some(last)) = (&status, unstated.last()) {
                    let text =
                        format!("New lesions at {last} are not stated: the masks decide what they are");
                    status = Status::Warning(text);
                }
                layout_offer(ui, &input, out);
                if let Some(evaluated) = &evaluated {
                    calls::overall(ui, &evaluated.response.dates);
                }
                calls::head(ui, evaluated.as_deref(), &status);
                if let Some(lesions) = &lesions {
                    links::show(ui, &input, lesions, out);
                }
                if let Some(evaluated) = &evaluated {
                    calls::table(ui, &evaluated.response.dates, &mut self.date);
                }
                // Above the reasons, which change with every answer: a question stays where it is.
                ui.add_space(6.0);
                ui.horizontal_wrapped(|ui| {
                    ui.strong("What the images don't show");
                    ui.checkbox(&mut self.all_inputs, "also what changes no call")
                        .on_hover_text("Only inputs that can change a call are asked for");
                });
                let by_what = (history.criterion, Handle::of(input.case));
                if self.asked_by.as_ref() != Some(&by_what) {
                    self.asked.clear();
                    self.asked_by = Some(by_what);
                }
                // Where nothing could be evaluated, what was asked for is still open.
                let missing = evaluated.as_deref().map_or_else(|| self.asked.clone(), missing);
                self.asked.extend(missing.iter().cloned());
                let (new_in_masks, only_measurable) = lesions.as_deref().map(of_masks).unwrap_or_default();
                let asked = &self.asked;
                let wanted = Wanted { all: self.all_inputs, missing, asked, new_in_masks, only_measurable };
                patient::show(ui, &input, &mut history, &wanted, &by);
                scans::show(ui, &input, &mut history, &wanted, &by, out);
                patient::show_more(ui, &input, &mut history, &wanted, &by);
                if let Some(evaluated) = &evaluated {
                    calls::reasons(ui, evaluated, self.date.as_deref());
                }
                by_hand::show(ui, &input, &mut history);
                trial::show(ui, &mut history);
                rules::repeatability(ui, &mut history);
                rules::show(ui, history.criterion);
                ui.weak("By public descriptions of the criteria, not for clinical use");
                let names_change = |old: &History| {
                    (&old.targets, &old.non_targets) != (&history.targets, &history.non_targets)
                };
                let are_renamed = old.history.as_ref().is_some_and(names_change);
                new.history = Some(history);
                if let Some(report) = results.lesions.last().filter(|_| are_renamed) {
                    new.remember_targets(report);
                }
            }
        }
        bt_rads::show(ui, &input, &mut new, &by);
        if new != *old {
            out.push(EditCommand::SetResponse(Box::new(new)));
        }
    }
}

/// A button that arranges the panes for the response, where its images or lesions aren't in sight.
fn layout_offer(ui: &mut Ui, input: &Input<'_>, out: &mut Commands) {
    let edit = &input.doc.edit;
    let is_seen = |pane| {
        let front = edit.layout.active_tiles();
        edit.layout.tiles.find_pane(&pane).is_some_and(|tile| front.contains(&tile))
    };
    let suits = input.case.time_points.len() > 1;
    let is_complete = edit.maximized.is_none() && is_seen(PaneId::Lesions) && is_seen(PaneId::SideBySide);
    if !suits || is_complete {
        return;
    }
    let tip = "The layout Response: this form, the lesions, both dates and the change";
    if ui.button("Show lesions and images beside it").on_hover_text(tip).clicked() {
        out.push(EditCommand::SetTask(Task::Response));
    }
}

/// What stands above the calls, on a line that is always there.
enum Status {
    Nothing,
    Working(String),
    Warning(String),
    Error(String),
}

/// Whether a scan has neither a calendar date nor a day.
fn no_days(input: &Input<'_>, history: &History) -> bool {
    input.case.time_labels().into_iter().any(|label| {
        let stated = history.date.iter().any(|facts| facts.date.0 == label && facts.days.is_some());
        leading_date(label).is_none() && !stated
    })
}

/// The criteria, what is assessed, the mask of non-enhancing disease, the way to a report, and who states it: returned as typed so far, as a click on an answer also
/// leaves the field.
fn head(ui: &mut Ui, input: &Input<'_>, new: &mut ResponseSetting, out: &mut Commands) -> String {
    let mut author = new.author.clone();
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Criteria");
        let chosen = new.history.as_ref().map(|history| history.criterion);
        let combo = ComboBox::from_id_salt("criteria").selected_text(chosen.map_or("none", Criterion::name));
        combo
            .show_ui(ui, |ui| {
                if ui.selectable_label(chosen.is_none(), "none").clicked() {
                    new.set_criterion(None);
                }
                for criterion in Criterion::VARIANTS {
                    let is_chosen = chosen == Some(*criterion);
                    if ui.selectable_label(is_chosen, criterion.name()).clicked() && !is_chosen {
                        let mask = input.doc.edit.lesions.mask(input.case, &input.doc.edit.change);
                        new.judge_by(*criterion, input.case, mask.as_deref());
                    }
                }
            })
            .response
            .labelled_by(label.id);
        if let Some(history) = new.history.as_mut().filter(|history| history.criterion == Criterion::Rano20) {
            let label = ui.label("assessed");
            let name = |assessment: Assessment| match assessment {
                Assessment::Enhancing => "enhancing disease",
                Assessment::NonEnhancing => "non-enhancing disease",
                Assessment::Mixed => "both",
            };
            let combo = ComboBox::from_id_salt("assessment");
            combo
                .selected_text(history.assessment.map_or("", name))
                .show_ui(ui, |ui| {
                    for assessment in Assessment::VARIANTS {
                        ui.selectable_value(&mut history.assessment, Some(*assessment), name(*assessment));
                    }
                })
                .response
                .labelled_by(label.id);
        }
        if new.history.is_some() {
            masks(ui, input, new);
        }
    });
    if new.history.is_some() || !new.bt_rads.is_empty() {
        // On a line of its own: the label doesn't wrap away from its field, nor the field out of a narrow pane.
        ui.horizontal(|ui| {
            let label = ui.label("stated by");
            author = fields::typed(ui, "author", &new.author);
            if let Some(typed) = fields::text(ui, "author", label.id, &new.author, 110.0) {
                let is_first = new.author.is_empty();
                new.author = named(&typed);
                author.clone_from(&new.author);
                // What was answered before the name was typed is the reader's, too.
                if is_first && !author.is_empty() {
                    new.sign(&fields::today());
                }
            }
            // Where the form begins: it may be long.
            let tip = "With this response, its reasons and your conclusion";
            if ui.button("Write a report…").on_hover_text(tip).clicked() {
                out.push(AppCommand::ShowReport);
            }
        });
    }
    named(&author)
}

fn named(typed: &str) -> String {
    typed.trim().chars().take(MOST_AUTHOR).collect()
}

fn masks(ui: &mut Ui, input: &Input<'_>, new: &mut ResponseSetting) {
    let name = |id: &str| input.doc.edit.masks.name(id);
    let main = input.doc.edit.lesions.mask(input.case, &input.doc.edit.change);
    if let Some(main) = &main {
        ui.label(format!("lesions of {}", name(main))).on_hover_text("Chosen in the lesions' pane");
    }
    let mut ids = input.case.mask_ids();
    ids.retain(|id| main.as_deref() != Some(*id));
    if ids.is_empty() {
        return;
    }
    let label = ui.label("non-enhancing");
    let shown = new.other_mask(input.case).map_or_else(|| "no mask".to_owned(), |id| name(id));
    ComboBox::from_id_salt("mask of non-enhancing disease")
        .selected_text(shown)
        .truncate()
        .show_ui(ui, |ui| {
            ui.selectable_value(&mut new.non_enhancing, None, "no mask");
            for id in ids {
                ui.selectable_value(&mut new.non_enhancing, Some(id.to_owned()), name(id));
            }
        })
        .response
        .labelled_by(label.id);
}
