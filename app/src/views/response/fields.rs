//! Fields of the form. A text counts when it is left, or with Enter: half of it is no statement.

use egui::{AsIdSalt, ComboBox, Id, Key, TextEdit, Ui};
use glioscope_core::{
    dates::iso_date,
    response::{Fact, When},
};
use jiff::Timestamp;

/// Who states a fact, and when.
pub(super) struct By {
    author: Option<String>,
    today: String,
}

impl By {
    /// Today.
    pub fn today(author: &str) -> Self {
        let author = (!author.is_empty()).then(|| author.to_owned());
        Self { author, today: Timestamp::now().strftime("%Y-%m-%d").to_string() }
    }

    /// A fact stated now.
    pub fn fact<T>(&self, value: T) -> Fact<T> {
        Fact { value, author: self.author.clone(), entered: Some(self.today.clone()) }
    }
}

/// What is hovered over a fact: who stated it.
fn said_by<T>(fact: &Fact<T>) -> String {
    let parts: Vec<&str> = [&fact.author, &fact.entered].into_iter().flatten().map(String::as_str).collect();
    if parts.is_empty() {
        "stated without a name".to_owned()
    } else {
        format!("stated by {}", parts.join(", "))
    }
}

/// A choice that may be left open.
pub(super) fn choice<T: Copy + PartialEq>(
    ui: &mut Ui,
    label: &str,
    fact: &mut Option<Fact<T>>,
    all: &[(T, &str)],
    by: &By,
) {
    let chosen = fact.as_ref().map(|fact| fact.value);
    let text = all.iter().find(|(value, _)| Some(*value) == chosen).map_or("not stated", |(_, text)| text);
    let tip = fact.as_ref().map(said_by);
    let shown = ComboBox::from_id_salt(label).selected_text(text).width(96.0).show_ui(ui, |ui| {
        if ui.selectable_label(chosen.is_none(), "not stated").clicked() {
            *fact = None;
        }
        for (value, text) in all {
            let is_chosen = chosen == Some(*value);
            if ui.selectable_label(is_chosen, *text).clicked() && !is_chosen {
                *fact = Some(by.fact(*value));
            }
        }
    });
    ui.ctx().accesskit_node_builder(shown.response.id, |node| node.set_label(label));
    if let Some(tip) = tip {
        shown.response.on_hover_text(tip);
    }
}

/// A line of text: what was typed, once the field is left with another text.
pub(super) fn text(ui: &mut Ui, salt: impl AsIdSalt, label: Id, value: &str, width: f32) -> Option<String> {
    let id = ui.make_persistent_id(&salt);
    let kept: Option<String> = ui.data_mut(|data| data.get_temp(id));
    let mut typed = kept.unwrap_or_else(|| value.to_owned());
    let field = TextEdit::singleline(&mut typed).id(id.with("field")).desired_width(width).char_limit(300);
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
    let bad = ui.make_persistent_id(&salt).with("bad");
    let shown = value.map(|when| match when {
        When::Date(date) => date.to_string(),
        When::Day(day) => day.to_string(),
    });
    let shown = shown.unwrap_or_default();
    let typed = text(ui, salt, label, &shown, 84.0);
    if let Some(typed) = typed {
        let typed = typed.trim().to_owned();
        let when = iso_date(&typed).map(When::Date).or_else(|| typed.parse().ok().map(When::Day));
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
    } else if value.is_none() {
        ui.weak("2024-01-31");
    }
    None
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
