//! The menus, and where they hang.

use strum::{EnumIter, IntoEnumIterator};

/// A menu of the bar, or one within another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumIter)]
pub enum Menu {
    /// Cases, sessions, exports.
    File,
    /// Cases opened before.
    Recent,
    /// Undo, selection.
    Edit,
    /// Panes, colours, light, directions.
    View,
    /// Colours of regions.
    Colors,
    /// Lighting mode and quality.
    Light,
    /// Sides and masks on slices.
    Slices,
    /// Fibre tracts of the case.
    Tracts,
    /// The six anatomical views.
    LookFrom,
    /// Lens and ruler.
    Tools,
    /// About.
    Help,
}

impl Menu {
    /// The menus of the bar.
    pub const BAR: [Self; 5] = [Self::File, Self::Edit, Self::View, Self::Tools, Self::Help];

    /// What it is called.
    pub fn title(self) -> &'static str {
        match self {
            Self::File => "File",
            Self::Recent => "Recent cases",
            Self::Edit => "Edit",
            Self::View => "View",
            Self::Colors => "Colours",
            Self::Light => "Light and quality",
            Self::Slices => "Slices",
            Self::Tracts => "Fibre tracts",
            Self::LookFrom => "Look from",
            Self::Tools => "Tools",
            Self::Help => "Help",
        }
    }

    /// The menu it is in, and the group there; `None` for those of the bar.
    pub fn parent(self) -> Option<(Self, u8)> {
        match self {
            Self::File | Self::Edit | Self::View | Self::Tools | Self::Help => None,
            Self::Recent => Some((Self::File, 0)),
            Self::Colors | Self::Light | Self::Slices | Self::Tracts => Some((Self::View, 2)),
            Self::LookFrom => Some((Self::View, 3)),
        }
    }

    /// Whether what it holds depends on the case alone, not on the list of commands.
    pub fn is_dynamic(self) -> bool {
        self == Self::Tracts
    }
}

impl Menu {
    /// The groups within it, in order: those of commands and of menus.
    pub fn groups(self) -> Vec<u8> {
        let commands = super::listed().iter().filter_map(|listed| listed.menu);
        let menus = Self::iter().filter_map(Self::parent);
        let mut groups: Vec<u8> =
            commands.chain(menus).filter(|(menu, _)| *menu == self).map(|(_, group)| group).collect();
        groups.sort_unstable();
        groups.dedup();
        groups
    }

    /// The menus in one of its groups.
    pub fn inner(self, group: u8) -> impl Iterator<Item = Self> {
        Self::iter().filter(move |menu| menu.parent() == Some((self, group)))
    }
}

/// How a menu shows a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// As something to do.
    Plain,
    /// As something that is on or off.
    Switch(bool),
    /// As one of several, chosen or not.
    Choice(bool),
}
