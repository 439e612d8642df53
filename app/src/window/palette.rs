//! The command palette: finds every command by its text.

use egui::{Align2, Key, RichText, ScrollArea, TextEdit, Ui};
use nucleo_matcher::{
    Config, Matcher, Utf32Str,
    pattern::{CaseMatching, Normalization, Pattern},
};

use crate::command::{Command, Commands, listed};

/// State of the palette: whether it is open, the query, and the index of the chosen row.
#[derive(Default)]
pub struct CommandPalette {
    open: bool,
    query: String,
    chosen: usize,
}

/// Commands whose text matches `query`, best first; all of them for an empty query. `more`: commands that depend on the
/// case, with their texts.
pub fn matching(query: &str, more: &[(String, Command)]) -> Vec<(String, Command)> {
    let always = listed().iter().map(|listed| (listed.command.text(), listed.command.clone()));
    let commands = always.chain(more.iter().cloned());
    if query.trim().is_empty() {
        return commands.collect();
    }
    let mut matcher = Matcher::new(Config::DEFAULT);
    let pattern = Pattern::parse(query, CaseMatching::Ignore, Normalization::Smart);
    let mut buffer = Vec::new();
    let mut scored: Vec<(u32, (String, Command))> = commands
        .filter_map(|(text, command)| {
            let score = pattern.score(Utf32Str::new(&text, &mut buffer), &mut matcher)?;
            Some((score, (text, command)))
        })
        .collect();
    scored.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    scored.into_iter().map(|(_, command)| command).collect()
}

impl CommandPalette {
    /// Whether it is open.
    pub fn is_open(&self) -> bool {
        self.open
    }

    /// Opens it, empty.
    pub fn open(&mut self) {
        *self = Self { open: true, ..Self::default() };
    }

    /// Draws it if it is open; pushes the chosen command to `out`.
    pub fn show(&mut self, ui: &mut Ui, more: &[(String, Command)], out: &mut Commands) {
        if !self.open {
            return;
        }
        let matches = matching(&self.query, more);
        let (up, down, enter, escape) = ui.input_mut(|i| {
            let mut pressed = |key| i.consume_key(egui::Modifiers::NONE, key);
            (pressed(Key::ArrowUp), pressed(Key::ArrowDown), pressed(Key::Enter), pressed(Key::Escape))
        });
        self.chosen = match (up, down) {
            (true, _) => self.chosen.saturating_sub(1),
            (_, true) => (self.chosen + 1).min(matches.len().saturating_sub(1)),
            _ => self.chosen.min(matches.len().saturating_sub(1)),
        };
        let mut done = escape;
        if enter && let Some((_, command)) = matches.get(self.chosen) {
            out.push(command.clone());
            done = true;
        }
        egui::Window::new("Commands")
            .title_bar(false)
            .resizable(false)
            .anchor(Align2::CENTER_TOP, [0.0, 60.0])
            .fixed_size([430.0, 380.0])
            .show(ui.ctx(), |ui| {
                // Before the field is drawn, so that what is typed in this frame arrives in it.
                let id = egui::Id::unique("search commands");
                ui.memory_mut(|memory| memory.request_focus(id));
                let edit = TextEdit::singleline(&mut self.query)
                    .id(id)
                    .hint_text("Type what you want to do")
                    .desired_width(f32::INFINITY);
                let response = ui.add(edit);
                response.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Search commands")
                });
                ui.add_space(4.0);
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    if matches.is_empty() {
                        ui.label("No command has these words.");
                    }
                    for (row, (text, command)) in matches.iter().enumerate() {
                        let chosen = row == self.chosen;
                        let clicked = ui
                            .horizontal(|ui| {
                                let clicked = ui.selectable_label(chosen, text.as_str()).clicked();
                                if let Some(keys) = command.shortcut_text() {
                                    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                                        ui.label(RichText::new(keys).weak());
                                    });
                                }
                                clicked
                            })
                            .inner;
                        if clicked {
                            out.push(command.clone());
                            done = true;
                        }
                    }
                });
            });
        if done {
            self.open = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matching_finds_words_in_any_case() {
        let found = matching("only lens", &[]);
        assert!(found.len() < listed().len());
        let first = matching("UNDO", &[]).first().map(|(_, command)| command.clone());
        assert_eq!(first, Some(crate::command::EditCommand::Undo.into()));
        assert_eq!(matching("", &[]).len(), listed().len());
        assert!(matching("qqqzzz", &[]).is_empty());
        let place = ("Go to T1+PET".to_owned(), crate::command::AppCommand::GoToRegion(5).into());
        assert_eq!(matching("t1+pet", std::slice::from_ref(&place)), [place]);
    }
}
