//! The choice of two masks or regions of any dates.

use egui::{ComboBox, Ui};
use glioscope_core::measure::Operand;

use super::all_operands;
use crate::{
    model::AgreementSetting,
    views::{draw, pane::Input},
};

/// What an operand is called: `T1`, `T1 at feb`, `T1 and PET only`.
pub(super) fn title(input: &Input<'_>, operand: &Operand) -> String {
    let names: Vec<String> = operand.masks.iter().map(|id| input.doc.edit.masks.name(id)).collect();
    let names = if operand.is_region { format!("{} only", names.join(" and ")) } else { names.join(" or ") };
    if operand.time.is_empty() { names } else { format!("{names} at {}", operand.time) }
}

/// Two lists; nothing is compared before both are chosen.
pub(super) fn show(ui: &mut Ui, input: &Input<'_>, new: &mut AgreementSetting) {
    let all = all_operands(input);
    let Some(first) = all.first() else { return };
    ui.horizontal_wrapped(|ui| {
        let mut is_on = new.two.is_some();
        let tip = "Masks of any date, or regions of the date shown; the first is the reference";
        if ui.checkbox(&mut is_on, "Any two").on_hover_text(tip).changed() {
            let second = all.get(1).unwrap_or(first);
            new.two = is_on.then(|| [first.clone(), second.clone()]);
        }
        let Some(two) = &mut new.two else { return };
        for (operand, label) in two.iter_mut().zip(["Reference", "Compared"]) {
            let text = title(input, operand);
            let shown = ComboBox::from_id_salt(label).selected_text(text).width(170.0).show_ui(ui, |ui| {
                for one in &all {
                    if ui.selectable_label(operand == one, title(input, one)).clicked() {
                        *operand = one.clone();
                    }
                }
            });
            draw::name_widget(ui, &shown.response, label);
        }
    });
}
