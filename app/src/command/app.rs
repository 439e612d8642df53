//! Commands that act outside the document: on files, dialogs and the window.

use std::path::PathBuf;

use egui::{Key, Modifiers};
use glam::DVec3;
use glioscope_cohort::Verdict;
use glioscope_core::files::format::volume_names;
use strum::{EnumDiscriminants, EnumIter, VariantArray};

use super::{Entry, Label, Listed, Menu, Workstation};
use crate::export::What;
use crate::model::cohort::CohortSetting;
use crate::model::{CaseRef, ExportFormat, PaneId, PictureSize};
use crate::report;

/// A command that acts outside the document.
#[derive(Clone, Debug, PartialEq, EnumDiscriminants)]
#[strum_discriminants(name(AppKind), vis(pub(super)), derive(EnumIter))]
#[allow(missing_docs, reason = "label() describes each")]
pub enum AppCommand {
    OpenDialog,
    OpenSample,
    ShowPacs,
    Open(CaseRef),
    OpenSession(PathBuf),
    OpenCohort,
    OpenCohortAt(PathBuf),
    OpenCohortCase(String),
    ShowCohort,
    SetCohort(Box<CohortSetting>),
    ExportCohort,
    ExportCohortTo(PathBuf),
    BeginReading { reader: String, seed: u64, names_hidden: bool },
    NextCase,
    GiveVerdict(Box<Verdict>),
    EndReading,
    ExportVerdicts,
    ExportVerdictsTo(PathBuf),
    AddTracts(Vec<PathBuf>),
    SaveSession,
    SaveSessionAs,
    SaveSessionTo(PathBuf),
    CancelLoading,
    OpenFiles(Vec<PathBuf>),
    OpenSubject { folder: PathBuf, derivatives: Vec<PathBuf> },
    ShowCaseFiles,
    AcceptGuess(bool),
    OrderDates(Option<Vec<String>>),
    OpenTransfer,
    OpenTransferFrom(PathBuf),
    SaveTransfer,
    SaveTransferTo(PathBuf),
    SaveManifest,
    SaveManifestTo(PathBuf),
    ExportMeasurements(ExportFormat),
    ExportMeasurementsTo(PathBuf),
    ExportMasks(What),
    ExportMasksTo(What, PathBuf),
    ExportRulers(ExportFormat),
    ExportRulersTo(PathBuf),
    ShowReport,
    KeepPicture,
    WriteReport(report::Options),
    ShowPage,
    WritePage,
    WritePageTo(PathBuf),
    WriteReportTo(report::Options, PathBuf),
    OpenWritten(PathBuf),
    BrowseFiles,
    BrowseFolders,
    BrowseCohorts,
    ClearRecent,
    ScreenshotWindow,
    ScreenshotPane(PaneId),
    ScreenshotTo(Option<PaneId>, PathBuf),
    SetPictureSize(PictureSize),
    GoToGrowth,
    GoToDisagreement,
    GoToRegion(u32),
    GoToComponent(u32, usize),
    SaveLayout(String),
    ForgetLayout(String),
    ShowPalette,
    ToggleDark,
    ShowMasks,
    ShowMakeMask,
    ShowAlign,
    ChooseTransform(String),
    ShiftDate(String, DVec3),
    AlignByFile(String, PathBuf),
    Explain,
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
            AppKind::ShowPacs => vec![listed(Self::ShowPacs).menu(Menu::File, 0)],
            AppKind::OpenCohort => vec![listed(Self::OpenCohort).menu(Menu::File, 0)],
            AppKind::NextCase => vec![listed(Self::NextCase).key(Key::F8)],
            AppKind::EndReading => vec![listed(Self::EndReading)],
            AppKind::ExportVerdicts => vec![listed(Self::ExportVerdicts)],
            AppKind::ExportCohort => vec![listed(Self::ExportCohort).menu(Menu::File, 2)],
            AppKind::ShowCohort => vec![listed(Self::ShowCohort).key(Key::F4).menu(Menu::File, 0)],
            AppKind::ShowCaseFiles => vec![listed(Self::ShowCaseFiles).menu(Menu::File, 1)],
            AppKind::SaveSession => vec![listed(Self::SaveSession).keys(CTRL, Key::S).menu(Menu::File, 1)],
            AppKind::SaveSessionAs => {
                vec![listed(Self::SaveSessionAs).keys(CTRL | Modifiers::SHIFT, Key::S).menu(Menu::File, 1)]
            }
            AppKind::ExportMeasurements => {
                let [csv, json] = [ExportFormat::Csv, ExportFormat::Json].map(Self::ExportMeasurements);
                vec![
                    listed(json).keys(CTRL, Key::E).menu(Menu::File, 2),
                    listed(csv).keys(CTRL | Modifiers::SHIFT, Key::E).menu(Menu::File, 2),
                ]
            }
            AppKind::ExportMasks => [What::Masks, What::Selection]
                .map(|what| listed(Self::ExportMasks(what)).menu(Menu::File, 2))
                .into(),
            AppKind::ShowReport => vec![listed(Self::ShowReport).keys(CTRL, Key::R).menu(Menu::File, 2)],
            AppKind::ShowPage => vec![listed(Self::ShowPage).menu(Menu::File, 2)],
            AppKind::KeepPicture => vec![listed(Self::KeepPicture).key(Key::K).menu(Menu::File, 2)],
            AppKind::ExportRulers => ExportFormat::VARIANTS
                .iter()
                .map(|format| listed(Self::ExportRulers(*format)).menu(Menu::Tools, 1))
                .collect(),
            AppKind::BrowseFiles => vec![listed(Self::BrowseFiles)],
            AppKind::BrowseFolders => vec![listed(Self::BrowseFolders)],
            AppKind::BrowseCohorts => vec![listed(Self::BrowseCohorts)],
            AppKind::ClearRecent => vec![listed(Self::ClearRecent).menu(Menu::Recent, 0)],
            AppKind::ScreenshotWindow => {
                vec![listed(Self::ScreenshotWindow).key(Key::F12).menu(Menu::File, 2)]
            }
            AppKind::ScreenshotPane => PaneId::all()
                .filter(|pane| pane.row().cli.is_some())
                .map(|pane| listed(Self::ScreenshotPane(pane)))
                .collect(),
            AppKind::SetPictureSize => PictureSize::FACTORS
                .iter()
                .map(|factor| {
                    listed(Self::SetPictureSize(PictureSize::Times(*factor))).menu(Menu::Pictures, 0)
                })
                .collect(),
            AppKind::GoToGrowth => vec![listed(Self::GoToGrowth).key(Key::G).menu(Menu::GoTo, 0)],
            AppKind::GoToDisagreement => {
                vec![listed(Self::GoToDisagreement).keys(Modifiers::SHIFT, Key::G).menu(Menu::GoTo, 0)]
            }
            AppKind::ShowPalette => vec![listed(Self::ShowPalette).keys(CTRL, Key::P).menu(Menu::Edit, 2)],
            AppKind::ToggleDark => vec![listed(Self::ToggleDark).menu(Menu::View, 0)],
            AppKind::ShowMasks => vec![listed(Self::ShowMasks).menu(Menu::Colors, 2)],
            AppKind::ShowMakeMask => vec![listed(Self::ShowMakeMask).menu(Menu::Edit, 1)],
            AppKind::OpenTransfer => vec![listed(Self::OpenTransfer)],
            AppKind::SaveTransfer => vec![listed(Self::SaveTransfer)],
            AppKind::ShowAlign => vec![listed(Self::ShowAlign).menu(Menu::Tools, 2)],
            AppKind::Explain => vec![listed(Self::Explain).key(Key::F5).menu(Menu::View, 0)],
            AppKind::ShowAbout => vec![listed(Self::ShowAbout).key(Key::F1).menu(Menu::Help, 0)],
            AppKind::Quit => vec![listed(Self::Quit).keys(CTRL, Key::Q).menu(Menu::File, 3)],
            AppKind::Open
            | AppKind::OpenSession
            | AppKind::OpenCohortAt
            | AppKind::OpenCohortCase
            | AppKind::SetCohort
            | AppKind::ExportCohortTo
            | AppKind::BeginReading
            | AppKind::GiveVerdict
            | AppKind::ExportVerdictsTo
            | AppKind::AddTracts
            | AppKind::ChooseTransform
            | AppKind::AlignByFile
            | AppKind::SaveSessionTo
            | AppKind::CancelLoading
            | AppKind::OpenFiles
            | AppKind::OpenSubject
            | AppKind::AcceptGuess
            | AppKind::OrderDates
            | AppKind::SaveTransferTo
            | AppKind::OpenTransferFrom
            | AppKind::SaveManifest
            | AppKind::SaveManifestTo
            | AppKind::ExportMeasurementsTo
            | AppKind::ExportMasksTo
            | AppKind::ExportRulersTo
            | AppKind::WriteReport
            | AppKind::WritePage
            | AppKind::WritePageTo
            | AppKind::WriteReportTo
            | AppKind::OpenWritten
            | AppKind::ShiftDate
            | AppKind::SaveLayout
            | AppKind::ForgetLayout
            | AppKind::GoToRegion
            | AppKind::GoToComponent
            | AppKind::ScreenshotTo => Vec::new(),
        }
    }

    /// Whether its shortcut works while the cohort is in front of the case, which isn't seen then.
    pub fn is_of_cohort(&self) -> bool {
        matches!(
            self,
            Self::OpenDialog
                | Self::ShowCohort
                | Self::ShowPalette
                | Self::ScreenshotWindow
                | Self::ShowAbout
                | Self::Quit
        )
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
            Self::OpenCohort => Label::new("Open a cohort…")
                .detail("The output of glioscope cohort: the overlaps of all its cases side by side"),
            Self::OpenCohortAt(_) => Label::new("Open this cohort"),
            Self::OpenCohortCase(case) => Label::new(format!("Open the case {case}")),
            Self::ShowCohort => {
                Label::new("The cohort").detail("In front of the case, or behind it; it stays as it is")
            }
            Self::ExportCohort => Label::new("Export the cohort's diagrams…")
                .detail("Those shown, in their order, as SVG or PDF: the file's ending is the format"),
            Self::ExportCohortTo(_) => Label::new("Write the cohort's diagrams"),
            Self::BeginReading { .. } => Label::new("Begin to read")
                .detail("In a random order; who has begun goes on where they were. Every verdict is saved at once"),
            Self::NextCase => Label::new("Next case to read").detail("The next one of your list without a verdict"),
            Self::GiveVerdict(_) => Label::new("Give this verdict"),
            Self::EndReading => Label::new("End reading").detail("Verdicts are saved; you can go on later"),
            Self::ExportVerdicts => Label::new("Export verdicts as CSV…")
                .detail("Those of all readers of the cohort, and beside it how far they agree"),
            Self::ExportVerdictsTo(_) => Label::new("Write the verdicts"),
            Self::SetCohort(_) => Label::new("Show the cohort like this"),
            Self::AddTracts(_) => Label::new("Add these fibre tracts"),
            Self::SaveSession => Label::new("Save the session")
                .detail("Selection, lens, views and layout; the images stay where they are"),
            Self::SaveSessionAs => Label::new("Save the session as…"),
            Self::SaveSessionTo(_) => Label::new("Save the session here"),
            Self::CancelLoading => Label::new("Cancel loading"),
            Self::OpenFiles(_) => Label::new("Open these files as one case"),
            Self::OpenSubject { .. } => Label::new("Open this subject with masks of derived data sets"),
            Self::ShowCaseFiles => Label::new("Case files…")
                .detail("What each file of the open case is: image or mask, its id, date, labels and colour"),
            Self::OrderDates(Some(_)) => Label::new("Use this order"),
            Self::OrderDates(None) => Label::new("Don't open the case"),
            Self::OpenTransfer => Label::new("Open a transfer function…").detail("From a file, for the image shown"),
            Self::OpenTransferFrom(_) => Label::new("Open this transfer function"),
            Self::SaveTransfer => {
                Label::new("Save the transfer function…").detail("As a file, for other images or render --transfer")
            }
            Self::SaveTransferTo(_) => Label::new("Save the transfer function here"),
            Self::SaveManifest => Label::new("Save as case.toml…"),
            Self::SaveManifestTo(_) => Label::new("Write the manifest"),
            Self::AcceptGuess(true) => Label::new("Open it like this"),
            Self::AcceptGuess(false) => Label::new("Don't open it"),
            Self::ExportMeasurements(format) => {
                Label::new(format!("Export the numbers as {}…", format.name())).detail(
                    "Every number that the window shows: volumes, agreement, lens, change, ellipsoids, lines",
                )
            }
            Self::ExportMeasurementsTo(_) => Label::new("Write the numbers"),
            Self::ExportMasks(What::Selection) => Label::new("Export the selection as one mask…")
                .detail("The regions shown, together; the file's ending is the format, as for the masks"),
            Self::ExportMasks(_) => Label::new("Export the masks…").detail(
                "Of the date shown. The file's ending is the format: .seg.nrrd, .dcm (SEG), .nii.gz, .stl, .obj or .glb",
            ),
            Self::ExportMasksTo(..) => Label::new("Write the masks"),
            Self::ExportRulers(format) => Label::new(format!("Export lines as {}…", format.name()))
                .detail("Every line measured, in millimetres"),
            Self::ExportRulersTo(_) => Label::new("Write the lines"),
            Self::ShowReport => Label::new("Write a report…")
                .detail("One file with pictures, numbers and warnings, to hand over: HTML, PDF or Markdown"),
            Self::KeepPicture => Label::new("Keep the view for the report")
                .detail("The view under the pointer, as it is now; its caption is in the report's dialog"),
            Self::ShowPage => Label::new("Write a page to take home…")
                .detail("One file that turns in a phone's browser, in plain words that you can change"),
            Self::WritePage => Label::new("Choose the page's file"),
            Self::WritePageTo(_) => Label::new("Write the page"),
            Self::WriteReport(_) => Label::new("Choose the report's file"),
            Self::WriteReportTo(..) => Label::new("Write the report"),
            Self::OpenWritten(_) => {
                Label::new("Open").detail("The file that was written, in the program this desktop has for it")
            }
            Self::BrowseFiles => Label::new("Browse for a case file…"),
            Self::BrowseFolders => Label::new("Browse for a case folder…"),
            Self::BrowseCohorts => Label::new("Browse for a cohort…"),
            Self::ClearRecent => Label::new("Forget recent cases"),
            Self::ScreenshotWindow => Label::new("Picture of the window…"),
            Self::ScreenshotPane(pane) => Label::new(format!("Picture of {}…", pane.title())),
            Self::ScreenshotTo(..) => Label::new("Write the picture"),
            Self::SetPictureSize(PictureSize::Times(1)) => {
                Label::new("Pictures as on the screen").detail("1 ×: the pixels that the window has")
            }
            Self::SetPictureSize(PictureSize::Times(factor)) => {
                Label::new(format!("Pictures {factor} × as large"))
                    .detail("Drawn again with more pixels, so that print is sharp")
            }
            Self::SetPictureSize(PictureSize::WidthPx(pixels)) => {
                Label::new(format!("Pictures {pixels} pixels wide"))
            }
            Self::GoToGrowth => Label::new("Go to the largest growth")
                .detail("Between the two dates compared: crosshair and lens move there"),
            Self::GoToDisagreement => Label::new("Go to the largest disagreement")
                .detail("The largest connected piece where some masks are active, but not all"),
            Self::GoToRegion(_) => Label::new("Go to the region").detail("To its largest component"),
            Self::GoToComponent(..) => Label::new("Go to the component"),
            Self::ShowPalette => Label::new("All commands…"),
            Self::SaveLayout(_) => Label::new("Keep this layout"),
            Self::ForgetLayout(_) => Label::new("Forget the layout"),
            Self::ToggleDark => Label::new("Light or dark"),
            Self::ShowMasks => Label::new("Names and colours of masks…"),
            Self::ShowPacs => Label::new("Open from PACS…").detail("Studies of an archive, by DICOMweb"),
            Self::ShowMakeMask => Label::new("Make a mask of the selection…")
                .detail("Of what is shown, of what is in the lens, of one piece, or where masks agree"),
            Self::ShowAlign => Label::new("Align dates and images…")
                .detail("By registration, by a transform of another program, or by hand"),
            Self::ChooseTransform(_) => Label::new("Choose a transform"),
            Self::ShiftDate(..) => Label::new("Move the date by hand"),
            Self::AlignByFile(..) => Label::new("Move the date by a transform"),
            Self::Explain => Label::new("Explain to a patient")
                .detail("Big words, the size in true size, the dates one after the other; no names"),
            Self::ShowAbout => Label::new("About Glioscope"),
            Self::Quit => Label::new("Quit"),
        }
    }

    pub(super) fn entry(&self, work: &Workstation) -> Entry {
        match self {
            Self::SetPictureSize(size) => Entry::Choice(work.picture_size == *size),
            Self::ShowCohort => Entry::Switch(work.cohort_in_front().is_some()),
            _ => Entry::Plain,
        }
    }

    pub(super) fn enabled(&self, work: &Workstation) -> bool {
        match self {
            Self::SaveSession
            | Self::SaveSessionAs
            | Self::SaveSessionTo(_)
            | Self::ExportMeasurements(_)
            | Self::ExportMeasurementsTo(_)
            | Self::ExportMasks(_)
            | Self::ExportMasksTo(..)
            | Self::ShowReport
            | Self::ShowPage
            | Self::WritePage
            | Self::WritePageTo(_)
            | Self::KeepPicture
            | Self::Explain
            | Self::WriteReport(_)
            | Self::WriteReportTo(..)
            | Self::AddTracts(_)
            | Self::ShowMasks
            | Self::ShowMakeMask
            | Self::GoToDisagreement
            | Self::GoToRegion(_)
            | Self::GoToComponent(..)
            | Self::ScreenshotPane(_) => work.doc.is_some(),
            Self::OpenTransfer | Self::OpenTransferFrom(_) | Self::SaveTransfer | Self::SaveTransferTo(_) => {
                work.doc.as_ref().is_some_and(|doc| work.world.context(doc).is_some())
            }
            Self::ShowCohort => work.cohort.is_some(),
            Self::NextCase | Self::EndReading => work.reading().is_some(),
            Self::ExportVerdicts => work.cohort.is_some(),
            Self::ExportCohort | Self::ExportCohortTo(_) => work.cohort_in_front().is_some(),
            // The sample has no files.
            Self::ShowCaseFiles => work.doc.as_ref().is_some_and(|doc| doc.case != CaseRef::Sample),
            Self::GoToGrowth | Self::ChooseTransform(_) | Self::AlignByFile(..) | Self::ShiftDate(..) => {
                work.world.time_point_count() > 1
            }
            Self::ShowAlign => work.world.case().is_some_and(|case| {
                case.time_points.len() > 1 || case.time_points.iter().any(|time| time.contexts.len() > 1)
            }),
            Self::ExportRulers(_) | Self::ExportRulersTo(_) => {
                work.doc.as_ref().is_some_and(|doc| !doc.edit.rulers.is_empty())
            }
            _ => true,
        }
    }
}
