//! The dialog of names and colours of masks.

use egui::{Role, TextEdit, Ui, WidgetInfo};

use super::modal::{self, Reply};
use crate::{
    command::{Commands, EditCommand, Workstation},
    model::masks::MaskLook,
    views::draw,
};

/// Width of a name's field.
const NAME_POINTS: f32 = 200.0;

/// Draws the dialog if it is open. What is changed in it is changed at once, and can be undone.
pub fn show(ui: &Ui, open: &mut bool, work: &Workstation, out: &mut Commands) {
    let Some(doc) = work.doc.as_ref().filter(|_| *open) else { return };
    let Some(time_point) = work.world.time_point(doc) else { return };
    let colors = work.world.colors(doc);
    let reply = modal::show(ui.ctx(), "Names and colours of masks", |ui| {
        ui.set_width(380.0);
        ui.label(
            "For the window and its pictures, saved in the session. Files and exported numbers keep the ids.",
        );
        egui::Grid::new("masks").num_columns(5).show(ui, |ui| {
            for (k, id) in time_point.regions.mask_ids().iter().enumerate() {
                let made =
                    doc.edit.made.iter().find(|made| (&made.id, &made.time) == (id, &time_point.label));
                let look = doc.edit.masks.get(id);
                let mut new = look.clone();
                let label = ui.label(id);
                if let Some(made) = made {
                    label.on_hover_text(format!("Made {}", made.provenance()));
                }
                let mut color = colors.mask(k);
                let response = ui.color_edit_button_srgb(&mut color);
                response
                    .widget_info(|| WidgetInfo::labeled(Role::ColorWell, true, format!("Colour of {id}")));
                if response.changed() {
                    new.color = Some(color);
                }
                let mut name = look.name.clone().unwrap_or_default();
                let field = TextEdit::singleline(&mut name).hint_text(id.as_str());
                // A grid gives a field the width of its text otherwise.
                let response = ui.add_sized([NAME_POINTS, ui.spacing().interact_size.y], field);
                draw::name_widget(ui, &response, &format!("Name of {id}"));
                if response.changed() {
                    new.name = Some(name);
                }
                if ui.add_enabled(look != MaskLook::default(), egui::Button::new("Reset")).clicked() {
                    new = MaskLook::default();
                }
                if made.is_some() && ui.button("Delete").on_hover_text("Undo brings it back").clicked() {
                    out.push(EditCommand::DeleteMadeMask(id.clone(), time_point.label.clone()));
                }
                if new != look {
                    out.push(EditCommand::SetMaskLook(id.clone(), new));
                }
                ui.end_row();
            }
        });
        ui.add_space(6.0);
        if ui.button("Close").clicked() { Reply::Accept } else { Reply::None }
    });
    *open = reply == Reply::None;
}
