//! The menus and their hierarchy.

use strum::{EnumIter, IntoEnumIterator};

/// A menu of the menu bar, or a submenu.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumIter)]
pub enum Menu {
    /// Cases, sessions, exports.
    File,
    /// Recently opened cases.
    Recent,
    /// The size of exported pictures.
    Pictures,
    /// Undo, selection.
    Edit,
    /// Panes, colours, lighting, viewing directions.
    View,
    /// Which panes are shown.
    Panes,
    /// Arrangements of panes.
    Layouts,
    /// Colours of regions.
    Colors,
    /// Lighting mode and quality.
    Light,
    /// Display convention, and masks on slices.
    Slices,
    /// Fibre tracts of the case.
    Tracts,
    /// Places: growth, disagreement, regions, components.
    GoTo,
    /// The six anatomical viewing directions.
    LookFrom,
    /// Lens and ruler.
    Tools,
    /// About.
    Help,
}

impl Menu {
    /// The menus of the menu bar.
    pub const BAR: [Self; 5] = [Self::File, Self::Edit, Self::View, Self::Tools, Self::Help];

    /// Its title.
    pub fn title(self) -> &'static str {
        match self {
            Self::File => "File",
            Self::Recent => "Recent cases",
            Self::Pictures => "Size of pictures",
            Self::Edit => "Edit",
            Self::View => "View",
            Self::Panes => "Panes",
            Self::Layouts => "Layouts",
            Self::Colors => "Colours",
            Self::Light => "Light and quality",
            Self::Slices => "Slices",
            Self::Tracts => "Fibre tracts",
            Self::GoTo => "Go to",
            Self::LookFrom => "Look from",
            Self::Tools => "Tools",
            Self::Help => "Help",
        }
    }

    /// The menu that contains it, and its group there; `None` for those of the menu bar.
    pub fn parent(self) -> Option<(Self, u8)> {
        match self {
            Self::File | Self::Edit | Self::View | Self::Tools | Self::Help => None,
            Self::Recent => Some((Self::File, 0)),
            Self::Pictures => Some((Self::File, 2)),
            Self::Panes | Self::Layouts => Some((Self::View, 1)),
            Self::Colors | Self::Light | Self::Slices | Self::Tracts => Some((Self::View, 2)),
            Self::GoTo | Self::LookFrom => Some((Self::View, 3)),
        }
    }

    /// Whether its entries depend on the case, not on the list of commands.
    pub fn is_dynamic(self) -> bool {
        self == Self::Tracts
    }
}

impl Menu {
    /// Its groups of commands and submenus, in order.
    pub fn groups(self) -> Vec<u8> {
        let commands = super::listed().iter().filter_map(|listed| listed.menu);
        let menus = Self::iter().filter_map(Self::parent);
        let mut groups: Vec<u8> =
            commands.chain(menus).filter(|(menu, _)| *menu == self).map(|(_, group)| group).collect();
        groups.sort_unstable();
        groups.dedup();
        groups
    }

    /// The submenus in one of its groups.
    pub fn inner(self, group: u8) -> impl Iterator<Item = Self> {
        Self::iter().filter(move |menu| menu.parent() == Some((self, group)))
    }
}

/// How a menu shows a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// A plain action.
    Plain,
    /// A check box, on or off.
    Switch(bool),
    /// A radio button, selected or not.
    Choice(bool),
}
