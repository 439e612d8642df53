//! Reading the cases of a cohort: how it begins, and the bar in which a verdict is given while the case is open.

use egui::{
    DragValue, Panel, PopupCloseBehavior, TextEdit, Ui,
    containers::menu::{MenuButton, MenuConfig},
};
use glioscope_cohort::{Agreement, Judgement, Verdict};
use strum::VariantArray;

use crate::{
    command::{AppCommand, Command, Commands},
    model::cohort::OpenCohort,
    views::draw,
};

/// The longest reasons, letters.
const MOST_REASONS: usize = 2000;

/// What is typed before a reading begins.
#[derive(Clone, Debug, Default)]
struct Form {
    reader: String,
    seed: u64,
    names_hidden: bool,
}

/// A menu in which a reading begins.
pub fn begin(ui: &mut Ui, out: &mut Commands) {
    let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    let id = ui.scope_id().with("who reads");
    MenuButton::new("Read…").config(config).ui(ui, |ui| {
        let mut form: Form = ui.data(|data| data.get_temp(id)).unwrap_or_default();
        ui.set_width(280.0);
        let label = ui.label("Reader");
        ui.add(TextEdit::singleline(&mut form.reader).hint_text("Name or initials")).labelled_by(label.id);
        ui.horizontal(|ui| {
            let label = ui.label("Seed of the random order");
            ui.add(DragValue::new(&mut form.seed)).labelled_by(label.id);
        });
        ui.checkbox(&mut form.names_hidden, "Hide the names of raters and algorithms");
        ui.weak("Who has begun goes on where they were, in the same order.");
        let can = !form.reader.trim().is_empty();
        if ui.add_enabled(can, egui::Button::new("Begin to read")).clicked() {
            let Form { reader, seed, names_hidden } = form.clone();
            out.push(AppCommand::BeginReading { reader, seed, names_hidden });
            ui.close();
        }
        ui.separator();
        if ui.button("Export verdicts as CSV…").clicked() {
            out.push(AppCommand::ExportVerdicts);
            ui.close();
        }
        ui.data_mut(|data| data.insert_temp(id, form));
    });
}

fn word(judgement: Judgement) -> &'static str {
    match judgement {
        Judgement::Accept => "Accept",
        Judgement::Mend => "Mend",
        Judgement::Reject => "Reject",
    }
}

/// The bar below the panes while a list is read. `case`: the case that is read and open; `None` while it isn't.
pub fn bar(ui: &mut Ui, open: &OpenCohort, case: Option<&str>, out: &mut Commands) {
    let Some(reading) = &open.reading else { return };
    Panel::bottom("reading").show(ui, |ui| {
        ui.add_space(3.0);
        ui.horizontal_wrapped(|ui| {
            let (given, all) = (reading.verdicts.given(), reading.verdicts.cases.len());
            ui.strong(&reading.verdicts.reader);
            ui.label(format!("{given} of {all} cases read"));
            ui.separator();
            match case {
                Some(case) => verdict(ui, case, &reading.verdicts.of(case), out),
                None => drop(ui.weak("No case of the list is open.")),
            }
            ui.separator();
            for command in [AppCommand::NextCase, AppCommand::GoToDisagreement, AppCommand::EndReading]
                .map(Command::from)
            {
                let is_shown = case.is_some() || command != AppCommand::GoToDisagreement.into();
                if is_shown && ui.button(command.text()).on_hover_text(command.tooltip()).clicked() {
                    out.push(command);
                }
            }
            if let Some(said) = in_words(&reading.agreement) {
                ui.weak(said.0).on_hover_text(said.1);
            }
        });
        ui.add_space(3.0);
    });
}

fn verdict(ui: &mut Ui, case: &str, given: &Verdict, out: &mut Commands) {
    let mut new = given.clone();
    ui.label(case);
    for judgement in Judgement::VARIANTS {
        let is_given = given.judgement == Some(*judgement);
        if ui.selectable_label(is_given, word(*judgement)).clicked() {
            new.judgement = (!is_given).then_some(*judgement);
        }
    }
    ui.label("Stars");
    for stars in 1..=5 {
        let is_given = given.stars == Some(stars);
        let response = ui.selectable_label(is_given, stars.to_string());
        draw::name_widget(ui, &response, &format!("{stars} of 5 stars"));
        if response.clicked() {
            new.stars = (!is_given).then_some(stars);
        }
    }
    let field = TextEdit::singleline(&mut new.reasons)
        .char_limit(MOST_REASONS)
        .desired_width(220.0)
        .hint_text("Reasons");
    let response = ui.add(field);
    draw::name_widget(ui, &response, "Reasons");
    if new != *given {
        out.push(AppCommand::GiveVerdict(Box::new(new)));
    }
}

/// The agreement of all readers in short, and in full.
fn in_words(agreement: &[Agreement]) -> Option<(String, String)> {
    let value = |one: &Agreement| one.value.map_or_else(|| "–".to_owned(), |value| format!("{value:.2}"));
    let of_all: Vec<&Agreement> = agreement.iter().rev().take(2).collect();
    let short = of_all.iter().rev().map(|one| format!("{} {}", one.name, value(one)));
    let full = agreement.iter().map(|one| {
        format!("{} of {}: {} ({} cases)", one.name, one.readers.join(", "), value(one), one.cases)
    });
    (!agreement.is_empty())
        .then(|| (short.collect::<Vec<_>>().join(", "), full.collect::<Vec<_>>().join("\n")))
}
