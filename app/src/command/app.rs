//! Commands that act outside the document: on files, dialogs and the window.

use std::path::PathBuf;

use egui::{Key, Modifiers};
use glioscope_core::files::format::volume_names;
use strum::{EnumDiscriminants, EnumIter, VariantArray};

use super::{Label, Listed, Menu, Workstation};
use crate::model::{CaseRef, PaneId, RulerFormat};

/// A command that acts outside the document.
#[derive(Clone, Debug, PartialEq, EnumDiscriminants)]
#[strum_discriminants(name(AppKind), vis(pub(super)), derive(EnumIter))]
#[allow(missing_docs, reason = "label() describes each")]
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
    /// The commands of `kind` that need no further input.
    pub(super) fn listed(kind: AppKind) -> Vec<Listed> {
        let listed = |command: Self| Listed::new(command);
        match kind {
            AppKind::OpenDialog => vec![listed(Self::OpenDialog).keys(CTRL, Key::O).menu(Menu::File, 0)],
            AppKind::OpenSample => vec![listed(Self::OpenSample).menu(Menu::File, 0)],
            AppKind::SaveSession => vec![listed(Self::SaveSession).keys(CTRL, Key::S).menu(Menu::File, 1)],
            AppKind::SaveSessionAs => {
                vec![listed(Self::SaveSessionAs).keys(CTRL | Modifiers::SHIFT, Key::S).menu(Menu::File, 1)]
            }
            AppKind::ExportMeasurements => {
                vec![listed(Self::ExportMeasurements).keys(CTRL, Key::E).menu(Menu::File, 2)]
            }
            AppKind::ExportRulers => RulerFormat::VARIANTS
                .iter()
                .map(|format| listed(Self::ExportRulers(*format)).menu(Menu::Tools, 1))
                .collect(),
            AppKind::BrowseFiles => vec![listed(Self::BrowseFiles)],
            AppKind::BrowseFolders => vec![listed(Self::BrowseFolders)],
            AppKind::ClearRecent => vec![listed(Self::ClearRecent).menu(Menu::Recent, 0)],
            AppKind::ScreenshotWindow => {
                vec![listed(Self::ScreenshotWindow).key(Key::F12).menu(Menu::File, 2)]
            }
            AppKind::ScreenshotPane => PaneId::all()
                .filter(|pane| pane.row().cli.is_some())
                .map(|pane| listed(Self::ScreenshotPane(pane)))
                .collect(),
            AppKind::ShowPalette => vec![listed(Self::ShowPalette).keys(CTRL, Key::P).menu(Menu::Edit, 2)],
            AppKind::ToggleDark => vec![listed(Self::ToggleDark).menu(Menu::View, 0)],
            AppKind::ShowAbout => vec![listed(Self::ShowAbout).key(Key::F1).menu(Menu::Help, 0)],
            AppKind::Quit => vec![listed(Self::Quit).keys(CTRL, Key::Q).menu(Menu::File, 3)],
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

    pub(super) fn label(&self) -> Label {
        match self {
            Self::OpenDialog => {
                let detail = format!("A manifest, a {} file, or drop a folder on the window", volume_names());
                Label::new("Open a case…").detail(detail)
            }
            Self::OpenSample => Label::new("Open the sample case"),
            Self::Open(_) => Label::new("Open this case"),
            Self::OpenSession(_) => Label::new("Open this session"),
            Self::AddTracts(_) => Label::new("Add these fibre tracts"),
            Self::SaveSession => Label::new("Save the session")
                .detail("Selection, lens, views and layout; the images stay where they are"),
            Self::SaveSessionAs => Label::new("Save the session as…"),
            Self::SaveSessionTo(_) => Label::new("Save the session here"),
            Self::CancelLoading => Label::new("Cancel loading"),
            Self::AcceptGuess(true) => Label::new("Open it like this"),
            Self::AcceptGuess(false) => Label::new("Don't open it"),
            Self::ExportMeasurements => {
                Label::new("Export measurements…").detail("Every number of the case as JSON")
            }
            Self::ExportMeasurementsTo(_) => Label::new("Write the measurements"),
            Self::ExportRulers(format) => Label::new(format!("Export lines as {}…", format.name()))
                .detail("Every line measured, in millimetres"),
            Self::ExportRulersTo(_) => Label::new("Write the lines"),
            Self::BrowseFiles => Label::new("Browse for a case file…"),
            Self::BrowseFolders => Label::new("Browse for a case folder…"),
            Self::ClearRecent => Label::new("Forget recent cases"),
            Self::ScreenshotWindow => Label::new("Picture of the window…"),
            Self::ScreenshotPane(pane) => Label::new(format!("Picture of {}…", pane.title())),
            Self::ScreenshotTo(..) => Label::new("Write the picture"),
            Self::ShowPalette => Label::new("All commands…"),
            Self::ToggleDark => Label::new("Light or dark"),
            Self::ShowAbout => Label::new("About Glioscope"),
            Self::Quit => Label::new("Quit"),
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
