//! Choosing a quantity: a column, what its rows are of, and how several rows of a case become one value.

use egui::{
    Button, PopupCloseBehavior, RichText, ScrollArea, Ui,
    containers::menu::{MenuButton, MenuConfig},
};
use glioscope_cohort::{Collected, Offered, Quantity, Reduce};
use strum::VariantArray;

use crate::views::draw;

/// Height of the lists, points.
const LIST_HEIGHT: f32 = 300.0;

/// What a quantity is called: `least dice`, `last call of rano-2.0`, `greatest volume (masks), consensus`.
pub fn title(quantity: &Quantity) -> String {
    let Quantity { table, column, of, reduce } = quantity;
    let column = ["_mm", "_ml", "_mm2"].iter().find_map(|unit| column.strip_suffix(unit)).unwrap_or(column);
    let table = if *table == "pairs" { String::new() } else { format!(" ({table})") };
    let of = if of.is_empty() { String::new() } else { format!(", {}", of_text(of)) };
    format!("{reduce} {}{table}{of}", column.replace('_', " "))
}

fn of_text(of: &[String]) -> String {
    of.join(" with ")
}

/// A button with a menu that chooses a quantity. `none`: what no quantity is called, where none can be chosen. Returns the choice when it
/// changes.
pub fn show(
    ui: &mut Ui,
    name: &str,
    chosen: Option<&Quantity>,
    none: Option<&str>,
    (collected, offered): (&Collected, &[Offered]),
) -> Option<Option<Quantity>> {
    let text = chosen.map_or_else(|| none.unwrap_or("nothing").to_owned(), title);
    let text = format!("{name}: {text}");
    menu(ui, &text, chosen, none, (collected, offered))
}

/// As [`show`], a button with the quantity's name alone.
pub fn title_button(
    ui: &mut Ui,
    chosen: &Quantity,
    of: (&Collected, &[Offered]),
) -> Option<Option<Quantity>> {
    menu(ui, &title(chosen), Some(chosen), None, of)
}

fn menu(
    ui: &mut Ui,
    text: &str,
    chosen: Option<&Quantity>,
    none: Option<&str>,
    (collected, offered): (&Collected, &[Offered]),
) -> Option<Option<Quantity>> {
    let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    let mut answer = None;
    let button = Button::new(text).truncate();
    let (response, _) = MenuButton::from_button(button).config(config).ui(ui, |ui| {
        ui.horizontal_top(|ui| {
            answer = columns(ui, chosen, none, offered);
            if let Some(chosen) = chosen {
                rows(ui, chosen, collected, offered, &mut answer);
            }
        });
    });
    draw::name_widget(ui, &response, text);
    answer
}

fn columns(
    ui: &mut Ui,
    chosen: Option<&Quantity>,
    none: Option<&str>,
    offered: &[Offered],
) -> Option<Option<Quantity>> {
    let mut answer = None;
    ScrollArea::vertical().id_salt("columns").max_height(LIST_HEIGHT).show(ui, |ui| {
        ui.vertical(|ui| {
            if let Some(none) = none
                && ui.selectable_label(chosen.is_none(), none).clicked()
            {
                answer = Some(None);
            }
            let mut table = "";
            for offer in offered {
                if offer.table != table {
                    table = offer.table;
                    ui.label(RichText::new(table).strong());
                }
                let is_chosen =
                    chosen.is_some_and(|chosen| chosen.table == offer.table && chosen.column == offer.column);
                let unit = if offer.unit.is_empty() { String::new() } else { format!(", {}", offer.unit) };
                let text = format!("{}{unit}", offer.column);
                let reduce = if offer.is_text { Reduce::Last } else { Reduce::default() };
                if ui.selectable_label(is_chosen, text).on_hover_text(offer.about).clicked() && !is_chosen {
                    answer = Some(Some(Quantity::new(offer.table, &offer.column, reduce)));
                }
            }
        });
    });
    answer
}

fn rows(
    ui: &mut Ui,
    chosen: &Quantity,
    collected: &Collected,
    offered: &[Offered],
    answer: &mut Option<Option<Quantity>>,
) {
    let is_text = offered
        .iter()
        .any(|offer| offer.is_text && offer.table == chosen.table && offer.column == chosen.column);
    ui.vertical(|ui| {
        ui.label(RichText::new("Rows of").strong());
        ScrollArea::vertical().id_salt("rows of").max_height(LIST_HEIGHT - 150.0).show(ui, |ui| {
            if ui.selectable_label(chosen.of.is_empty(), "all").clicked() {
                *answer = Some(Some(Quantity { of: Vec::new(), ..chosen.clone() }));
            }
            // Opened seldom: a pass over the table for each frame of it is quick.
            for of in collected.of(chosen.table) {
                if ui.selectable_label(chosen.of == of, of_text(&of)).clicked() {
                    *answer = Some(Some(Quantity { of, ..chosen.clone() }));
                }
            }
        });
        ui.label(RichText::new("Of a case's rows").strong());
        for reduce in
            Reduce::VARIANTS.iter().filter(|r| !is_text || matches!(r, Reduce::First | Reduce::Last))
        {
            if ui.selectable_label(chosen.reduce == *reduce, reduce.to_string()).clicked() {
                *answer = Some(Some(Quantity { reduce: *reduce, ..chosen.clone() }));
            }
        }
    });
}
