//! Commands: all user actions. Each group is an enum in its own file, which defines the text, tooltip, shortcut, menu
//! entry and palette entry of each command, and its effect on the document. Only [`Workstation::apply`] applies them.

pub mod app;
pub mod edit;
pub mod look;
pub mod menu;
pub mod workstation;

use std::{borrow::Cow, sync::LazyLock};

use egui::{Key, KeyboardShortcut, ModifierNames, Modifiers};
use strum::IntoEnumIterator;

use crate::model::layout::Held;
pub use app::AppCommand;
pub use edit::EditCommand;
pub use look::LookCommand;
pub use menu::{Entry, Menu};
pub use workstation::{Notice, Workstation};

/// A user action.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Acts outside the document: on files, dialogs and the window.
    App(AppCommand),
    /// Changes state that undo covers.
    Edit(EditCommand),
    /// Changes the navigation state.
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

/// Commands issued by a view.
#[derive(Debug, Default)]
pub struct Commands(Vec<Command>);

impl Commands {
    /// Appends a command.
    pub fn push(&mut self, command: impl Into<Command>) {
        self.0.push(command.into());
    }

    /// The commands, in the order issued.
    pub fn into_vec(self) -> Vec<Command> {
        self.0
    }
}

/// The label of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// Text in menus, on buttons and in the palette.
    pub text: Cow<'static, str>,
    /// Additional sentence for tooltips; may be empty.
    pub detail: Cow<'static, str>,
}

impl Label {
    fn new(text: impl Into<Cow<'static, str>>) -> Self {
        Self { text: text.into(), detail: "".into() }
    }

    fn detail(self, detail: impl Into<Cow<'static, str>>) -> Self {
        Self { detail: detail.into(), ..self }
    }
}

/// A command without further input: it is in the palette, and may have a shortcut and a menu entry.
#[derive(Clone, Debug, PartialEq)]
pub struct Listed {
    /// The command.
    pub command: Command,
    /// Its keyboard shortcut.
    pub keys: Option<KeyboardShortcut>,
    /// Its menu, and the group within that; separators are drawn between groups.
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

/// All commands without further input, collected from every kind of every group, so that none can be missed.
pub fn listed() -> &'static [Listed] {
    static LISTED: LazyLock<Vec<Listed>> = LazyLock::new(|| {
        let app = app::AppKind::iter().flat_map(AppCommand::listed);
        let edit = edit::EditKind::iter().flat_map(EditCommand::listed);
        app.chain(edit).chain(look::LookKind::iter().flat_map(LookCommand::listed)).collect()
    });
    &LISTED
}

impl Command {
    fn label(&self) -> Label {
        match self {
            Self::App(command) => command.label(),
            Self::Edit(command) => command.label(),
            Self::Look(command) => command.label(),
        }
    }

    /// Its text in menus, on buttons and in the palette.
    pub fn text(&self) -> String {
        self.label().text.into_owned()
    }

    /// Its tooltip: text, shortcut and detail.
    pub fn tooltip(&self) -> String {
        let Label { text, detail } = self.label();
        let keys = self.shortcut_text().map(|keys| format!(" ({keys})")).unwrap_or_default();
        if detail.is_empty() { format!("{text}{keys}") } else { format!("{text}{keys}. {detail}") }
    }

    /// Its keyboard shortcut.
    pub fn shortcut(&self) -> Option<KeyboardShortcut> {
        listed().iter().find(|listed| listed.command == *self)?.keys
    }

    /// Its keyboard shortcut as text: `Ctrl+S`.
    pub fn shortcut_text(&self) -> Option<String> {
        self.shortcut().map(|keys| keys.format(&ModifierNames::NAMES, false))
    }

    /// Key of its gesture: commands with the same key in quick succession are undone together. `None`: each is undone
    /// separately.
    pub fn gesture(&self) -> Option<&'static str> {
        match self {
            Self::Edit(command) => command.gesture(),
            Self::App(_) | Self::Look(_) => None,
        }
    }

    /// How a menu shows it in the current state.
    pub fn entry(&self, work: &Workstation) -> Entry {
        match (self, &work.doc) {
            (Self::App(command), _) => command.entry(work),
            (Self::Edit(command), Some(doc)) => command.entry(doc),
            (Self::Look(command), Some(doc)) => command.entry(doc),
            _ => Entry::Plain,
        }
    }

    /// Whether it is available in the current state.
    pub fn enabled(&self, work: &Workstation) -> bool {
        match self {
            Self::App(command) => command.enabled(work),
            Self::Edit(EditCommand::Undo) => work.history.can_undo(),
            Self::Edit(EditCommand::Redo) => work.history.can_redo(),
            Self::Edit(EditCommand::SetTask(task)) => {
                work.world.case().is_some_and(|case| task.suits(Held::of(case)))
            }
            Self::Edit(_) | Self::Look(_) => work.doc.is_some(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn shortcuts_and_texts_are_unique() {
        let mut keys: BTreeMap<String, String> = BTreeMap::new();
        let mut texts: BTreeMap<String, &Command> = BTreeMap::new();
        for Listed { command, .. } in listed() {
            if let Some(shortcut) = command.shortcut_text() {
                let previous = keys.insert(shortcut.clone(), command.text());
                assert_eq!(previous, None, "{shortcut}");
            }
            assert!(!command.text().is_empty() && !command.tooltip().is_empty());
            assert_eq!(texts.insert(command.text(), command), None);
        }
        assert!(keys.len() > 25, "{keys:?}");
    }

    /// Shortcuts and menus are defined only in [`listed`], so no command has a shortcut that the window doesn't handle.
    #[test]
    fn every_menu_has_commands_and_tooltips_name_the_keys() {
        for menu in Menu::iter().filter(|menu| !menu.is_dynamic()) {
            let has_command =
                listed().iter().any(|listed| listed.menu.is_some_and(|(parent, _)| parent == menu));
            assert!(has_command, "{menu:?}");
        }
        let lens = Command::from(EditCommand::ToggleLens);
        assert_eq!(lens.shortcut_text().as_deref(), Some("L"));
        assert!(lens.tooltip().contains("(L)"), "{}", lens.tooltip());
    }
}
