//! Modal dialogs: they hold the keyboard. Escape cancels, Enter accepts, the same in all of them.

use egui::{Context, Id, Key, Modifiers, Ui};

use crate::words::Language;

/// What the user answered in this frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reply {
    /// Nothing yet.
    #[default]
    None,
    /// Accepted.
    Accept,
    /// Cancelled.
    Cancel,
}

/// Shows a dialog; `content` draws it and returns the reply of its buttons.
pub fn show(ctx: &Context, title: &str, content: impl FnOnce(&mut Ui) -> Reply) -> Reply {
    let id = Id::unique(("dialog", title));
    let pass = ctx.cumulative_pass_nr();
    let shown_before = ctx.data_mut(|data| data.get_temp_mut_or_default::<Option<u64>>(id).replace(pass));
    if shown_before.is_none_or(|before| before + 1 < pass) {
        // Just opened: what is typed now is not for the field below.
        ctx.memory_mut(|memory| memory.stop_text_input());
    }
    // Escape closes a list or a choice of colours within the dialog first.
    let popup_is_open = egui::Popup::is_any_open(ctx);
    let in_use = ctx.memory(|memory| memory.focused().is_some());
    let reply = egui::Modal::new(id)
        .show(ctx, |ui| {
            ui.heading(title);
            ui.add_space(4.0);
            content(ui)
        })
        .inner;
    if reply != Reply::None || popup_is_open {
        return reply;
    }
    let pressed = |key| ctx.input_mut(|input| input.consume_key(Modifiers::NONE, key));
    match () {
        () if pressed(Key::Escape) => Reply::Cancel,
        // Enter presses a button that has the focus.
        () if !in_use && pressed(Key::Enter) => Reply::Accept,
        () => Reply::None,
    }
}

/// Whether Enter was pressed in a text field.
pub fn entered(ui: &Ui, field: &egui::Response) -> bool {
    field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter))
}

/// Whether a dialog was shown in the last frame.
pub fn is_open(ctx: &Context) -> bool {
    ctx.memory(|memory| memory.top_modal_layer().is_some())
}

/// The choice of the language of something that is written.
pub fn language(ui: &mut Ui, language: &mut Language) {
    ui.radio_value(language, Language::En, "English");
    ui.radio_value(language, Language::De, "Deutsch");
}
