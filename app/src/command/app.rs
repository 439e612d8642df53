//! Commands that reach outside the document: files, dialogs, the window.

use std::path::PathBuf;

use egui::{Key, Modifiers};
use strum::{EnumDiscriminants, EnumIter, VariantArray};

use super::{Listed, Menu, Words, Workstation};
use crate::model::{CaseRef, PaneId, RulerFormat};

/// A command that reaches outside the document.
#[derive(Clone, Debug, PartialEq, EnumDiscriminants)]
#[strum_discriminants(name(AppKind), vis(pub(super)), derive(EnumIter))]
#[allow(missing_docs, reason = "words() tells what each does")]
pub enum AppCommand {
    OpenDialog,
    OpenSample,
    Open(CaseRef),
    OpenSession(PathBuf),
    AddTracts(Vec<PathBuf>),
    SaveSession,
    SaveSessionAs,
    SaveSessionTo(PathBuf),
    CancelLoading,
    AcceptGuess(bool),
    ExportMeasurements,
    ExportMeasurementsTo(PathBuf),
    ExportRulers(RulerFormat),
    ExportRulersTo(PathBuf),
    BrowseFiles,
    BrowseFolders,
    ClearRecent,
    ScreenshotWindow,
    ScreenshotPane(PaneId),
    ScreenshotTo(Option<PaneId>, PathBuf),
    ShowPalette,
    ToggleDark,
    ShowAbout,
    Quit,
}

const CTRL: Modifiers = Modifiers::COMMAND;

impl AppCommand {
    /// The commands of a kind that need no argument.
    pub(super) fn listed(kind: AppKind) -> Vec<Listed> {
        let one = |command: Self| Listed::new(command);
        match kind {
            AppKind::OpenDialog => vec![one(Self::OpenDialog).keys(CTRL, Key::O).menu(Menu::File, 0)],
            AppKind::OpenSample => vec![one(Self::OpenSample).menu(Menu::File, 0)],
            AppKind::SaveSession => vec![one(Self::SaveSession).keys(CTRL, Key::S).menu(Menu::File, 1)],
            AppKind::SaveSessionAs => {
                vec![one(Self::SaveSessionAs).keys(CTRL | Modifiers::SHIFT, Key::S).menu(Menu::File, 1)]
            }
            AppKind::ExportMeasurements => {
                vec![one(Self::ExportMeasurements).keys(CTRL, Key::E).menu(Menu::File, 2)]
            }
            AppKind::ExportRulers => RulerFormat::VARIANTS
                .iter()
                .map(|format| one(Self::ExportRulers(*format)).menu(Menu::Tools, 1))
                .collect(),
            AppKind::BrowseFiles => vec![one(Self::BrowseFiles)],
            AppKind::BrowseFolders => vec![one(Self::BrowseFolders)],
            AppKind::ClearRecent => vec![one(Self::ClearRecent).menu(Menu::Recent, 0)],
            AppKind::ScreenshotWindow => vec![one(Self::ScreenshotWindow).key(Key::F12).menu(Menu::File, 2)],
            AppKind::ScreenshotPane => PaneId::all()
                .filter(|pane| pane.row().cli.is_some())
                .map(|pane| one(Self::ScreenshotPane(pane)))
                .collect(),
            AppKind::ShowPalette => vec![one(Self::ShowPalette).keys(CTRL, Key::P).menu(Menu::Edit, 2)],
            AppKind::ToggleDark => vec![one(Self::ToggleDark).menu(Menu::View, 0)],
            AppKind::ShowAbout => vec![one(Self::ShowAbout).key(Key::F1).menu(Menu::Help, 0)],
            AppKind::Quit => vec![one(Self::Quit).keys(CTRL, Key::Q).menu(Menu::File, 3)],
            AppKind::Open
            | AppKind::OpenSession
            | AppKind::AddTracts
            | AppKind::SaveSessionTo
            | AppKind::CancelLoading
            | AppKind::AcceptGuess
            | AppKind::ExportMeasurementsTo
            | AppKind::ExportRulersTo
            | AppKind::ScreenshotTo => Vec::new(),
        }
    }

    pub(super) fn words(&self) -> Words {
        match self {
            Self::OpenDialog => {
                Words::new("Open a case…").more("A manifest, a NIfTI file, or drop a folder on the window")
            }
            Self::OpenSample => Words::new("Open the sample case"),
            Self::Open(_) => Words::new("Open this case"),
            Self::OpenSession(_) => Words::new("Open this session"),
            Self::AddTracts(_) => Words::new("Add these fibre tracts"),
            Self::SaveSession => Words::new("Save the session")
                .more("Selection, lens, views and layout; the images stay where they are"),
            Self::SaveSessionAs => Words::new("Save the session as…"),
            Self::SaveSessionTo(_) => Words::new("Save the session here"),
            Self::CancelLoading => Words::new("Cancel loading"),
            Self::AcceptGuess(true) => Words::new("Open it like this"),
            Self::AcceptGuess(false) => Words::new("Don't open it"),
            Self::ExportMeasurements => {
                Words::new("Export measurements…").more("Every number of the case as JSON")
            }
            Self::ExportMeasurementsTo(_) => Words::new("Write the measurements"),
            Self::ExportRulers(format) => Words::new(format!("Export lines as {}…", format.name()))
                .more("Every line measured, in millimetres"),
            Self::ExportRulersTo(_) => Words::new("Write the lines"),
            Self::BrowseFiles => Words::new("Browse for a case file…"),
            Self::BrowseFolders => Words::new("Browse for a case folder…"),
            Self::ClearRecent => Words::new("Forget recent cases"),
            Self::ScreenshotWindow => Words::new("Picture of the window…"),
            Self::ScreenshotPane(pane) => Words::new(format!("Picture of {}…", pane.title())),
            Self::ScreenshotTo(..) => Words::new("Write the picture"),
            Self::ShowPalette => Words::new("All commands…"),
            Self::ToggleDark => Words::new("Light or dark"),
            Self::ShowAbout => Words::new("About Glioscope"),
            Self::Quit => Words::new("Quit"),
        }
    }

    pub(super) fn enabled(&self, work: &Workstation) -> bool {
        match self {
            Self::SaveSession
            | Self::SaveSessionAs
            | Self::SaveSessionTo(_)
            | Self::ExportMeasurements
            | Self::ExportMeasurementsTo(_)
            | Self::AddTracts(_)
            | Self::ScreenshotPane(_) => work.doc.is_some(),
            Self::ExportRulers(_) | Self::ExportRulersTo(_) => {
                work.doc.as_ref().is_some_and(|doc| !doc.edit.rulers.is_empty())
            }
            _ => true,
        }
    }
}
