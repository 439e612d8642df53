//! Measurements of lesions that the masks don't show, as a reader took them.

use egui::{CollapsingHeader, ComboBox, Ui};
use glioscope_core::response::{Compartment, History, Label, Measurement};

use super::fields::{number, text};
use crate::views::{draw::name_widget, pane::Input};

const COMPARTMENTS: [(Compartment, &str); 2] =
    [(Compartment::Enhancing, "enhancing"), (Compartment::NonEnhancing, "non-enhancing")];

/// The measurements, and fields for another one.
pub(super) fn show(ui: &mut Ui, input: &Input<'_>, history: &mut History) {
    let count = history.measurement.len();
    let title = if count == 0 { "Measured by hand".to_owned() } else { format!("Measured by hand: {count}") };
    CollapsingHeader::new(title).id_salt("measured by hand").show(ui, |ui| {
        ui.weak("Lesions that the masks don't show: all others are measured by the program");
        let mut removed = None;
        for (n, one) in history.measurement.iter().enumerate() {
            ui.horizontal_wrapped(|ui| {
                ui.label(in_words(one));
                let response = ui.small_button("×").on_hover_text("Takes it away");
                name_widget(ui, &response, &format!("Take away {} at {}", one.lesion, one.date));
                if response.clicked() {
                    removed = Some(n);
                }
            });
        }
        if let Some(n) = removed {
            history.measurement.remove(n);
        }
        another(ui, input, history);
    });
}

/// A measurement in one line.
fn in_words(one: &Measurement) -> String {
    let mm = |value: f64| format!("{value} mm");
    let size = match (one.gone, one.longest_mm, one.perpendicular_mm) {
        (true, ..) => Some("gone".to_owned()),
        (_, Some(longest), Some(perpendicular)) => Some(format!("{longest} × {perpendicular} mm")),
        (_, longest, perpendicular) => longest.or(perpendicular).map(mm),
    };
    let product = one.product_mm2.map(|product| format!("{product} mm²"));
    let volume = one.volume_ml.map(|ml| format!("{ml} ml"));
    let compartment =
        COMPARTMENTS.iter().find(|(of, _)| *of == one.compartment).map(|(_, text)| (*text).to_owned());
    let parts = [size, product, volume, compartment];
    format!("{} at {}: {}", one.lesion, one.date, parts.into_iter().flatten().collect::<Vec<_>>().join(", "))
}

/// What is typed of the next measurement.
#[derive(Clone, Debug, Default)]
struct Draft {
    lesion: String,
    date: Option<String>,
    non_enhancing: bool,
    gone: bool,
    longest_mm: Option<f64>,
    perpendicular_mm: Option<f64>,
    volume_ml: Option<f64>,
}

impl Draft {
    fn measurement(&self, date: &str) -> Measurement {
        let sized = |value: Option<f64>| value.filter(|_| !self.gone);
        Measurement {
            date: Label(date.to_owned()),
            days: None,
            lesion: self.lesion.trim().to_owned(),
            compartment: COMPARTMENTS[usize::from(self.non_enhancing)].0,
            gone: self.gone,
            longest_mm: sized(self.longest_mm),
            perpendicular_mm: sized(self.perpendicular_mm),
            product_mm2: None,
            slices: None,
            slice_thickness_mm: None,
            volume_ml: sized(self.volume_ml),
        }
    }
}

/// Fields for another measurement; what is refused stays, with the reason.
fn another(ui: &mut Ui, input: &Input<'_>, history: &mut History) {
    // What is typed of a patient isn't that of the next.
    let of_case = std::sync::Arc::as_ptr(input.case) as usize;
    let at = ui.make_persistent_id(("measurement by hand", of_case));
    let refused = at.with("refused");
    let mut draft: Draft = ui.data(|data| data.get_temp(at)).unwrap_or_default();
    let labels = input.case.time_labels();
    let date = draft.date.clone().filter(|date| labels.contains(&date.as_str()));
    let date = date.or_else(|| labels.last().map(|&label| label.to_owned())).unwrap_or_default();
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Lesion").on_hover_text("Its name, the same at all dates");
        if let Some(typed) = text(ui, "name of a lesion by hand", label.id, &draft.lesion, 70.0) {
            draft.lesion = typed;
        }
        let label = ui.label("at");
        let combo = ComboBox::from_id_salt("date of a measurement").selected_text(&date);
        combo
            .show_ui(ui, |ui| {
                for label in &labels {
                    if ui.selectable_label(*label == date, *label).clicked() {
                        draft.date = Some((*label).to_owned());
                    }
                }
            })
            .response
            .labelled_by(label.id);
        for (n, (_, text)) in COMPARTMENTS.into_iter().enumerate() {
            ui.radio_value(&mut draft.non_enhancing, n == 1, text);
        }
        ui.checkbox(&mut draft.gone, "gone");
    });
    ui.horizontal_wrapped(|ui| {
        if !draft.gone {
            let fields = [
                ("longest, mm", &mut draft.longest_mm),
                ("perpendicular, mm", &mut draft.perpendicular_mm),
                ("volume, ml", &mut draft.volume_ml),
            ];
            for (title, value) in fields {
                let label = ui.label(title);
                if let Some(typed) = number(ui, title, label.id, *value) {
                    *value = typed;
                }
            }
        }
        let is_sized = draft.gone || draft.longest_mm.is_some() || draft.volume_ml.is_some();
        let can_add = is_sized && !draft.lesion.trim().is_empty();
        let button = ui.add_enabled(can_add, egui::Button::new("Add"));
        name_widget(ui, &button, "Add a measurement");
        if button.on_disabled_hover_text("Needs the lesion's name, and a size or gone").clicked() {
            let mut with = history.clone();
            with.measurement.push(draft.measurement(&date));
            match with.check() {
                Ok(()) => {
                    *history = with;
                    // The next one is often of the same lesion.
                    draft = Draft {
                        lesion: draft.lesion.clone(),
                        non_enhancing: draft.non_enhancing,
                        ..Draft::default()
                    };
                    ui.data_mut(|data| data.remove::<String>(refused));
                }
                Err(error) => {
                    ui.data_mut(|data| data.insert_temp(refused, error.to_string()));
                }
            }
        }
    });
    if let Some(error) = ui.data(|data| data.get_temp::<String>(refused)) {
        ui.colored_label(ui.visuals().error_fg_color, error);
    }
    ui.data_mut(|data| data.insert_temp(at, draft));
}
