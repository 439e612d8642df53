//! Everything a user can do. Each group is an enum in a file of its own, with a row per command that its text,
//! tooltip, shortcut, menu entry and place in the palette come from, and what it does to the document.
//! [`Workstation::apply`] is the one place that applies them.

pub mod app;
pub mod edit;
pub mod look;
pub mod menu;
pub mod workstation;

use std::{borrow::Cow, sync::LazyLock};

use egui::{Key, KeyboardShortcut, ModifierNames, Modifiers};
use strum::IntoEnumIterator;

pub use app::AppCommand;
pub use edit::EditCommand;
pub use look::LookCommand;
pub use menu::{Entry, Menu};
pub use workstation::Workstation;

/// Something the user did or asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Reaches outside the document: files, dialogs, the window.
    App(AppCommand),
    /// Changes what undo covers.
    Edit(EditCommand),
    /// Changes where the user looks.
    Look(LookCommand),
}

impl From<AppCommand> for Command {
    fn from(command: AppCommand) -> Self {
        Self::App(command)
    }
}

impl From<EditCommand> for Command {
    fn from(command: EditCommand) -> Self {
        Self::Edit(command)
    }
}

impl From<LookCommand> for Command {
    fn from(command: LookCommand) -> Self {
        Self::Look(command)
    }
}

/// Commands that a view writes.
#[derive(Debug, Default)]
pub struct Commands(Vec<Command>);

impl Commands {
    /// Adds one.
    pub fn push(&mut self, command: impl Into<Command>) {
        self.0.push(command.into());
    }

    /// The commands, in their order.
    pub fn into_vec(self) -> Vec<Command> {
        self.0
    }
}

/// What a command is called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Words {
    /// In menus, on buttons and in the palette.
    pub text: Cow<'static, str>,
    /// One sentence more, for tooltips; empty for none.
    pub more: &'static str,
}

impl Words {
    fn new(text: impl Into<Cow<'static, str>>) -> Self {
        Self { text: text.into(), more: "" }
    }

    fn more(self, more: &'static str) -> Self {
        Self { more, ..self }
    }
}

/// A command that needs nothing more to be said: it is in the palette, and may have a shortcut and a menu entry.
#[derive(Clone, Debug, PartialEq)]
pub struct Listed {
    /// The command.
    pub command: Command,
    /// Keys that do it.
    pub keys: Option<KeyboardShortcut>,
    /// Its menu, and the group within it; separators stand between groups.
    pub menu: Option<(Menu, u8)>,
}

impl Listed {
    fn new(command: impl Into<Command>) -> Self {
        Self { command: command.into(), keys: None, menu: None }
    }

    fn key(self, key: Key) -> Self {
        self.keys(Modifiers::NONE, key)
    }

    fn keys(self, modifiers: Modifiers, key: Key) -> Self {
        Self { keys: Some(KeyboardShortcut::new(modifiers, key)), ..self }
    }

    fn menu(self, menu: Menu, group: u8) -> Self {
        Self { menu: Some((menu, group)), ..self }
    }
}

/// All commands that need no argument: every kind of every group is asked for its own, so that none can be left out.
pub fn listed() -> &'static [Listed] {
    static LISTED: LazyLock<Vec<Listed>> = LazyLock::new(|| {
        let app = app::AppKind::iter().flat_map(AppCommand::listed);
        let edit = edit::EditKind::iter().flat_map(EditCommand::listed);
        app.chain(edit).chain(look::LookKind::iter().flat_map(LookCommand::listed)).collect()
    });
    &LISTED
}

impl Command {
    fn words(&self) -> Words {
        match self {
            Self::App(command) => command.words(),
            Self::Edit(command) => command.words(),
            Self::Look(command) => command.words(),
        }
    }

    /// What menus, buttons and the palette call it.
    pub fn text(&self) -> String {
        self.words().text.into_owned()
    }

    /// More words, for tooltips.
    pub fn tooltip(&self) -> String {
        let Words { text, more } = self.words();
        let keys = self.shortcut_text().map(|keys| format!(" ({keys})")).unwrap_or_default();
        if more.is_empty() { format!("{text}{keys}") } else { format!("{text}{keys}. {more}") }
    }

    /// Keys that do it.
    pub fn shortcut(&self) -> Option<KeyboardShortcut> {
        listed().iter().find(|listed| listed.command == *self)?.keys
    }

    /// Those keys in words: `Ctrl+S`.
    pub fn shortcut_text(&self) -> Option<String> {
        self.shortcut().map(|keys| keys.format(&ModifierNames::NAMES, false))
    }

    /// What runs of one gesture share: commands with the same key, one soon after the other, are
    /// undone together. `None`: each is undone by itself.
    pub fn gesture(&self) -> Option<&'static str> {
        match self {
            Self::Edit(command) => command.gesture(),
            Self::App(_) | Self::Look(_) => None,
        }
    }

    /// How a menu shows it now.
    pub fn entry(&self, work: &Workstation) -> Entry {
        match (self, &work.doc) {
            (Self::Edit(command), Some(doc)) => command.entry(doc),
            (Self::Look(command), Some(doc)) => command.entry(doc),
            _ => Entry::Plain,
        }
    }

    /// Whether it can do anything now.
    pub fn enabled(&self, work: &Workstation) -> bool {
        match self {
            Self::App(command) => command.enabled(work),
            Self::Edit(EditCommand::Undo) => work.history.can_undo(),
            Self::Edit(EditCommand::Redo) => work.history.can_redo(),
            Self::Edit(_) | Self::Look(_) => work.doc.is_some(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn no_two_commands_share_keys_or_words() {
        let mut keys: BTreeMap<String, String> = BTreeMap::new();
        let mut texts: BTreeMap<String, &Command> = BTreeMap::new();
        for Listed { command, .. } in listed() {
            if let Some(shortcut) = command.shortcut_text() {
                let before = keys.insert(shortcut.clone(), command.text());
                assert_eq!(before, None, "{shortcut}");
            }
            assert!(!command.text().is_empty() && !command.tooltip().is_empty());
            assert_eq!(texts.insert(command.text(), command), None);
        }
        assert!(keys.len() > 25, "{keys:?}");
    }

    /// A command's keys and its menu stand in its entry of the list, so that nothing has keys that the window doesn't
    /// look for.
    #[test]
    fn every_menu_has_commands_and_tooltips_name_the_keys() {
        for menu in Menu::iter().filter(|menu| !menu.is_dynamic()) {
            let has = listed().iter().any(|listed| listed.menu.is_some_and(|(of, _)| of == menu));
            assert!(has, "{menu:?}");
        }
        let lens = Command::from(EditCommand::ToggleLens);
        assert_eq!(lens.shortcut_text().as_deref(), Some("L"));
        assert!(lens.tooltip().contains("(L)"), "{}", lens.tooltip());
    }
}
