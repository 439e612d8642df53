//! Fields of the form. A text counts when it is left, or with Enter: half of it is no statement.

use std::ops::RangeInclusive;

use egui::{AsIdSalt, Id, Key, TextEdit, Ui};
use glioscope_core::{
    dates::iso_date,
    response::{Fact, Stated, When},
};
use jiff::{Timestamp, civil::Date};

use crate::views::draw::name_widget;

/// Says behind a field that it was asked for and no longer needs an answer; the field stays, as it may still be answered.
pub(super) fn no_more(ui: &mut Ui, is_open: bool) {
    if !is_open {
        ui.weak("changes no call any more");
    }
}

/// Who states a fact, and when.
pub(super) struct By {
    author: Option<String>,
    today: String,
}

impl By {
    /// Today.
    pub fn today(author: &str) -> Self {
        let author = (!author.is_empty()).then(|| author.to_owned());
        Self { author, today: today() }
    }

    /// Whose statement it is, and its day.
    pub fn stated(&self) -> Stated {
        Stated { author: self.author.clone(), entered: Some(self.today.clone()) }
    }

    /// A fact stated now.
    pub fn fact<T>(&self, value: T) -> Fact<T> {
        Fact { value, author: self.author.clone(), entered: Some(self.today.clone()) }
    }
}

/// The day on which it is stated, as 2024-01-31.
pub(super) fn today() -> String {
    Timestamp::now().strftime("%Y-%m-%d").to_string()
}

/// What is hovered over a fact: who stated it.
fn said_by<T>(fact: &Fact<T>) -> String {
    if fact.is_proposed() {
        return "proposed by the program: a click states it".to_owned();
    }
    let parts: Vec<&str> = [&fact.author, &fact.entered].into_iter().flatten().map(String::as_str).collect();
    said_in(&parts)
}

/// What is hovered over a treatment: who stated it.
pub(super) fn said(author: Option<&str>, entered: Option<&str>) -> String {
    said_in(&[author, entered].into_iter().flatten().collect::<Vec<_>>())
}

fn said_in(parts: &[&str]) -> String {
    if parts.is_empty() {
        "stated without a name".to_owned()
    } else {
        format!("stated by {}", parts.join(", "))
    }
}

/// A choice that may be left open: a click on an answer states it, and on the cross takes it back.
pub(super) fn choice<T: Copy + PartialEq>(
    ui: &mut Ui,
    label: &str,
    fact: &mut Option<Fact<T>>,
    all: &[(T, &str)],
    by: &By,
) {
    let chosen = fact.as_ref().map(|fact| fact.value);
    let tip = fact.as_ref().map(said_by);
    for (value, text) in all {
        let is_chosen = chosen == Some(*value);
        let response = ui.radio(is_chosen, *text);
        name_widget(ui, &response, &format!("{label}: {text}"));
        if response.clicked() && !is_chosen {
            *fact = Some(by.fact(*value));
        }
        if let Some(tip) = tip.as_ref().filter(|_| is_chosen) {
            response.on_hover_text(tip);
        }
    }
    if chosen.is_some() && take_back(ui, label) {
        *fact = None;
    }
}

/// A button that takes a statement back.
pub(super) fn take_back(ui: &mut Ui, label: &str) -> bool {
    let response = ui.small_button("×").on_hover_text("Not stated");
    name_widget(ui, &response, &format!("{label}: not stated"));
    response.clicked()
}

/// What a field says now, typed to its end or not; `value` where nothing is being typed.
pub(super) fn typed(ui: &Ui, salt: impl AsIdSalt, value: &str) -> String {
    let id = ui.make_persistent_id(&salt);
    ui.data(|data| data.get_temp(id)).unwrap_or_else(|| value.to_owned())
}

/// A line of text: what was typed, once the field is left with another text.
pub(super) fn text(ui: &mut Ui, salt: impl AsIdSalt, label: Id, value: &str, width: f32) -> Option<String> {
    hinted(ui, salt, label, value, (width, ""))
}

fn hinted(
    ui: &mut Ui,
    salt: impl AsIdSalt,
    label: Id,
    value: &str,
    (width, hint): (f32, &str),
) -> Option<String> {
    let id = ui.make_persistent_id(&salt);
    let mut typed = typed(ui, &salt, value);
    let field = TextEdit::singleline(&mut typed).id(id.with("field")).desired_width(width).char_limit(300);
    let field = if hint.is_empty() { field } else { field.hint_text(hint) };
    let response = ui.add(field).labelled_by(label);
    if response.has_focus() {
        ui.data_mut(|data| data.insert_temp(id, typed));
        return None;
    }
    ui.data_mut(|data| data.remove::<String>(id));
    let is_taken_back = ui.input(|i| i.key_pressed(Key::Escape));
    (response.lost_focus() && !is_taken_back && typed != value).then_some(typed)
}

/// A day; `Some` once another one was typed, with `None` where the field was emptied. What is no day is said beside the field.
pub(super) fn day(ui: &mut Ui, salt: impl AsIdSalt, label: Id, value: Option<When>) -> Option<Option<When>> {
    day_with(ui, salt, label, (value, false))
}

/// As [`day`]; `is_next`: whether it is typed into next.
pub(super) fn day_with(
    ui: &mut Ui,
    salt: impl AsIdSalt,
    label: Id,
    (value, is_next): (Option<When>, bool),
) -> Option<Option<When>> {
    if is_next {
        let field = ui.make_persistent_id(&salt).with("field");
        ui.memory_mut(|memory| memory.request_focus(field));
    }
    let bad = ui.make_persistent_id(&salt).with("bad");
    let shown = value.map(|when| match when {
        When::Date(date) => date.to_string(),
        When::Day(day) => day.to_string(),
    });
    let shown = shown.unwrap_or_default();
    let typed = hinted(ui, salt, label, &shown, (104.0, "YYYY-MM-DD"));
    if let Some(typed) = typed {
        let typed = typed.trim().to_owned();
        let when = date_of(&typed).map(When::Date).or_else(|| {
            // A count of days; eight digits are a date that isn't in the calendar.
            typed.parse().ok().filter(|_| typed.len() < 8).map(When::Day)
        });
        if when.is_none() && !typed.is_empty() {
            ui.data_mut(|data| data.insert_temp(bad, typed));
            return None;
        }
        ui.data_mut(|data| data.remove::<String>(bad));
        return Some(when);
    }
    if let Some(typed) = ui.data_mut(|data| data.get_temp::<String>(bad)) {
        let text = format!("“{typed}” is no date: expected 2024-01-31");
        ui.colored_label(ui.visuals().error_fg_color, text);
    }
    None
}

/// A date as readers type it: 2024-01-31, 20240131 or 31.1.2024. With slashes day and month can't be told apart.
fn date_of(typed: &str) -> Option<Date> {
    let digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    if typed.len() == 8 && digits(typed) {
        return iso_date(&format!("{}-{}-{}", &typed[..4], &typed[4..6], &typed[6..]));
    }
    let parts: Vec<&str> = typed.split('.').map(str::trim).collect();
    match parts[..] {
        [day, month, year] if year.len() == 4 && [day, month, year].iter().all(|part| digits(part)) => {
            Date::new(year.parse().ok()?, month.parse().ok()?, day.parse().ok()?).ok()
        }
        _ => iso_date(typed),
    }
}

/// A number that may be left open; `Some` once another one was typed.
pub(super) fn number(ui: &mut Ui, salt: impl AsIdSalt, label: Id, value: Option<f64>) -> Option<Option<f64>> {
    let shown = value.map(|value| value.to_string()).unwrap_or_default();
    let typed = text(ui, salt, label, &shown, 56.0)?;
    let typed = typed.trim().replace(',', ".");
    match typed.parse::<f64>() {
        Ok(value) if value.is_finite() => Some(Some(value)),
        _ if typed.is_empty() => Some(None),
        _ => None,
    }
}

/// Who a number is from until the reader says where it is from.
pub(super) const SOURCE: &str = "stated by the reader";

/// A number and where it is from, in one line; `None`: not stated, as a number out of `range` is.
pub(super) fn with_source(
    ui: &mut Ui,
    (title, unit): (&str, &str),
    stated: Option<&(f64, String)>,
    range: RangeInclusive<f64>,
) -> Option<(f64, String)> {
    let mut new = stated.cloned();
    ui.horizontal_wrapped(|ui| {
        let label = ui.label(title);
        if let Some(typed) = number(ui, ("number", title), label.id, stated.map(|(value, _)| *value)) {
            let source = stated.map_or_else(|| SOURCE.to_owned(), |(_, source)| source.clone());
            new = typed.filter(|value| range.contains(value)).map(|value| (value, source));
        }
        let label = ui.label(format!("{unit}, source"));
        if let Some((_, source)) = &mut new
            && let Some(typed) = source_of(ui, title, label.id, source)
        {
            *source = typed;
        }
    });
    new
}

/// Where something is from: never empty.
pub(super) fn source_of(ui: &mut Ui, key: &str, label: Id, source: &str) -> Option<String> {
    let typed = text(ui, ("source", key), label, source, 180.0)?;
    let typed = typed.trim();
    (!typed.is_empty()).then(|| typed.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_read_as_readers_type_them() {
        let day = Date::constant(2024, 1, 31);
        for typed in ["2024-01-31", "20240131", "31.1.2024", "31.01.2024", "31. 1. 2024"] {
            assert_eq!(date_of(typed), Some(day), "{typed}");
        }
        for typed in
            ["1/31/2024", "31.1.24", "20241331", "2024", "31.2.2024", "..2024", "ä.1.2024", "2024013é"]
        {
            assert_eq!(date_of(typed), None, "{typed}");
        }
    }
}
