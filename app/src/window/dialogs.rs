//! File dialogs on their own thread, so that a file chooser that never answers doesn't block the window. A desktop
//! without a file chooser is distinguished from a cancelled dialog.

use std::{
    cell::RefCell,
    path::{Path, PathBuf},
    sync::{Arc, Once, mpsc},
};

use glioscope_cohort::Collected;
use glioscope_core::{
    case::is_tract_scalars,
    files::format::{self, volume_filter, volume_names},
};

use crate::{
    command::{AppCommand, Command},
    export::{Format, What},
    model::{CaseRef, ExportFormat, PaneId, session, transfer_file},
    page, report,
    world::jobs::Waker,
};

use super::take_home;

/// Purpose of a dialog.
#[derive(Clone, Debug, PartialEq)]
pub enum Purpose {
    /// Open a case or session file.
    OpenFile,
    /// Open a folder as a case.
    OpenFolder,
    /// Open the output of `glioscope cohort`.
    OpenCohort,
    /// Choose a registration transform that moves this date.
    Transform(String),
    /// Save the session.
    SaveSession {
        /// Its proposed name, without the ending.
        stem: String,
    },
    /// Choose a transfer function for the image shown.
    OpenTransfer,
    /// Write the transfer function of the image shown.
    SaveTransfer,
    /// Write the manifest of the case.
    Manifest,
    /// Write a picture of a pane, or of the window.
    Picture(Option<PaneId>),
    /// Write the numbers.
    Measurements(ExportFormat),
    /// Write the masks, or the selection.
    Masks(What),
    /// Write the rulers.
    Rulers(ExportFormat),
    /// Write the cohort's diagrams.
    CohortFigure,
    /// Write the verdicts of the cohort's readers.
    Verdicts,
    /// Write a report.
    Report(report::Options),
    /// Write the page to take home.
    Page,
}

impl Purpose {
    /// Proposed name of the file to write; `None` for dialogs that open a file or folder.
    pub fn file_name(&self) -> Option<String> {
        Some(match self {
            Self::OpenFile
            | Self::OpenFolder
            | Self::OpenCohort
            | Self::Transform(_)
            | Self::OpenTransfer => {
                return None;
            }
            Self::SaveSession { stem } => format!("{stem}.{}", session::EXTENSION),
            Self::SaveTransfer => format!("image.{}", transfer_file::EXTENSION),
            Self::Manifest => "case.toml".into(),
            Self::Picture(pane) => format!("{}.png", pane.map_or("window", PaneId::tab).to_lowercase()),
            Self::Measurements(format) => format!("numbers.{}", format.extension()),
            Self::Masks(What::Selection) => "selection.seg.nrrd".into(),
            Self::Masks(_) => "masks.seg.nrrd".into(),
            Self::Rulers(format) => format!("lines.{}", format.extension()),
            Self::CohortFigure => "cohort.svg".into(),
            Self::Verdicts => "verdicts.csv".into(),
            Self::Report(_) => "report.html".into(),
            Self::Page => format!("page.{}", take_home::ENDING),
        })
    }

    /// Title of its dialog.
    pub fn title(&self) -> &'static str {
        match self {
            Self::OpenFile => "Open a case",
            Self::OpenFolder => "Open a folder as a case",
            Self::OpenCohort => "Open a cohort",
            Self::Transform(_) => "A transform that moves the date",
            Self::SaveSession { .. } => "Save the session",
            Self::OpenTransfer => "Open a transfer function",
            Self::SaveTransfer => "Save the transfer function",
            Self::Manifest => "Save the case's manifest",
            Self::Picture(_) => "Save the picture",
            Self::Measurements(_) => "Export the numbers",
            Self::Masks(What::Selection) => "Export the selection",
            Self::Masks(_) => "Export the masks",
            Self::Rulers(_) => "Export the lines",
            Self::CohortFigure => "Export the cohort's diagrams",
            Self::Verdicts => "Export the verdicts",
            Self::Report(_) => "Write a report",
            Self::Page => "Write the page to take home",
        }
    }

    /// The file's path with the ending that its content needs, where that is missing: the file that
    /// [`Purpose::command`] writes.
    pub fn complete(&self, path: PathBuf) -> PathBuf {
        let with = |path: PathBuf, ending: &str| {
            let mut name = path.into_os_string();
            name.push(".");
            name.push(ending);
            PathBuf::from(name)
        };
        match self {
            Self::SaveSession { .. } => session::with_ending(path),
            Self::SaveTransfer if !ends_in(&path, "json") => with(path, transfer_file::EXTENSION),
            Self::Manifest if !ends_in(&path, "toml") => with(path, "toml"),
            Self::Picture(_) if !ends_in(&path, "png") => with(path, "png"),
            Self::Masks(_) if Format::of(&path).is_none() => with(path, "seg.nrrd"),
            Self::CohortFigure if !ends_in(&path, "svg") && !ends_in(&path, "pdf") => with(path, "svg"),
            Self::Verdicts if !ends_in(&path, "csv") => with(path, "csv"),
            Self::Page if page::check_ending(&path).is_err() => with(path, take_home::ENDING),
            Self::Report(_) if report::FileKind::of(&path).is_none() => with(path, "html"),
            Self::Measurements(format) | Self::Rulers(format) => format.with_extension(path),
            _ => path,
        }
    }

    /// The command for the chosen path.
    pub fn command(&self, path: PathBuf) -> Command {
        let path = self.complete(path);
        match self {
            Self::OpenFile | Self::OpenFolder => open_command(path),
            Self::OpenCohort => AppCommand::OpenCohortAt(path).into(),
            Self::Transform(time) => AppCommand::AlignByFile(time.clone(), path).into(),
            Self::SaveSession { .. } => AppCommand::SaveSessionTo(path).into(),
            Self::OpenTransfer => AppCommand::OpenTransferFrom(path).into(),
            Self::SaveTransfer => AppCommand::SaveTransferTo(path).into(),
            Self::Manifest => AppCommand::SaveManifestTo(path).into(),
            Self::Picture(pane) => AppCommand::ScreenshotTo(*pane, path).into(),
            Self::Measurements(_) => AppCommand::ExportMeasurementsTo(path).into(),
            Self::Masks(what) => AppCommand::ExportMasksTo(*what, path).into(),
            Self::Rulers(_) => AppCommand::ExportRulersTo(path).into(),
            Self::Verdicts => AppCommand::ExportVerdictsTo(path).into(),
            Self::CohortFigure => AppCommand::ExportCohortTo(path).into(),
            Self::Report(options) => AppCommand::WriteReportTo(*options, path).into(),
            Self::Page => AppCommand::WritePageTo(path).into(),
        }
    }
}

/// The command that opens a path as a session, a cohort or a case.
pub fn open_command(path: PathBuf) -> Command {
    if session::is_session(&path) {
        AppCommand::OpenSession(path).into()
    } else if Collected::is_at(&path) {
        AppCommand::OpenCohortAt(path).into()
    } else {
        AppCommand::Open(CaseRef::Path(path)).into()
    }
}

/// Kinds of files that can be opened, as text for prompts.
pub fn openable() -> String {
    format!("a manifest (case.toml), a folder, a {} file or a session file", volume_names())
}

/// File extensions of cases, without the dot.
fn case_filter() -> Vec<&'static str> {
    let mut endings = volume_filter();
    endings.extend(["toml", "json"]);
    endings
}

/// What a file chooser answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The user chose this.
    Path(PathBuf),
    /// The user cancelled.
    Cancelled,
    /// There is no file chooser on this desktop, and why.
    Unavailable(String),
}

/// A file chooser: asked for a purpose and the folder to begin in, it answers when the user has. Called on a thread of
/// its own.
pub type Chooser = Arc<dyn Fn(&Purpose, Option<&Path>) -> Choice + Send + Sync>;

/// The desktop's file chooser.
pub fn desktop_chooser() -> Chooser {
    Arc::new(|purpose, folder| {
        // The chooser's library answers "nothing" both when the user cancels and when there is no chooser; it reports
        // the latter only to the log. Time doesn't tell: a missing portal may take seconds to be found missing.
        listen();
        FAILURE.set(None);
        let mut dialog = rfd::FileDialog::new().set_title(purpose.title());
        if let Some(folder) = folder {
            dialog = dialog.set_directory(folder);
        }
        let answer = match (purpose, purpose.file_name()) {
            (Purpose::OpenFolder | Purpose::OpenCohort, _) => dialog.pick_folder(),
            (Purpose::Transform(_), _) => dialog
                .add_filter("Transforms", &["tfm", "txt", "mat", "h5", "hdf5", "lta", "dat"])
                .pick_file(),
            (Purpose::OpenTransfer, _) => dialog.add_filter("Transfer functions", &["json"]).pick_file(),
            (_, None) => dialog
                .add_filter(format!("Cases, {} files, sessions", volume_names()), &case_filter())
                .pick_file(),
            (_, Some(name)) => dialog.set_file_name(name).save_file(),
        };
        match (answer, FAILURE.take()) {
            (Some(path), _) => Choice::Path(path),
            (None, Some(why)) => Choice::Unavailable(why),
            (None, None) => Choice::Cancelled,
        }
    })
}

thread_local! {
    /// The last error of the chooser's library on this thread.
    static FAILURE: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Keeps the errors of the chooser's library; writes nothing anywhere.
struct ChooserLog;

impl log::Log for ChooserLog {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() == log::Level::Error && metadata.target().starts_with("rfd")
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            FAILURE.set(Some(record.args().to_string()));
        }
    }

    fn flush(&self) {}
}

fn listen() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        if log::set_logger(&ChooserLog).is_ok() {
            log::set_max_level(log::LevelFilter::Error);
        }
    });
}

/// A dialog that is open.
pub struct Dialog {
    /// Its purpose.
    pub purpose: Purpose,
    receive: mpsc::Receiver<Choice>,
}

impl Dialog {
    /// Opens it. `wake` is called when it has an answer.
    pub fn open(purpose: Purpose, folder: Option<PathBuf>, chooser: &Chooser, wake: Waker) -> Self {
        let (send, receive) = mpsc::channel();
        let (thread_purpose, chooser) = (purpose.clone(), chooser.clone());
        // Without a thread the answer is that the dialog stopped.
        let _ = std::thread::Builder::new().spawn(move || {
            // Fails where the window was closed meanwhile.
            let _ = send.send(chooser(&thread_purpose, folder.as_deref()));
            wake.wake();
        });
        Self { purpose, receive }
    }

    /// Its answer; `None` while it is open.
    pub fn poll(&self) -> Option<Choice> {
        match self.receive.try_recv() {
            Ok(choice) => Some(choice),
            Err(mpsc::TryRecvError::Empty) => None,
            Err(mpsc::TryRecvError::Disconnected) => Some(Choice::Unavailable("it stopped".to_owned())),
        }
    }
}

fn ends_in(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(ending))
}

/// Whether a dropped file contains fibre tracts or scalars of them, which are added to the open case.
pub fn is_tracts(path: &Path) -> bool {
    path.file_name().is_some_and(|name| format::is_tracts(&name.to_string_lossy())) || is_tract_scalars(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_errors_of_the_chooser_mean_that_there_is_none() {
        listen();
        log::error!(target: "another::library", "something else");
        log::warn!(target: "rfd::backend", "Using zenity fallback");
        assert_eq!(FAILURE.take(), None);
        log::error!(target: "rfd::backend", "Failed to pick file with zenity: not found");
        assert_eq!(FAILURE.take().as_deref(), Some("Failed to pick file with zenity: not found"));
    }

    #[test]
    fn each_purpose_gives_its_file_name_and_command() {
        let path = || PathBuf::from("/somewhere/x.nii");
        assert_eq!(Purpose::OpenFile.command(path()), AppCommand::Open(CaseRef::Path(path())).into());
        let session = PathBuf::from("/somewhere/x.glioscope.json");
        assert_eq!(Purpose::OpenFile.command(session.clone()), AppCommand::OpenSession(session).into());
        let rulers = Purpose::Rulers(ExportFormat::Csv);
        assert_eq!(rulers.file_name().as_deref(), Some("lines.csv"));
        assert_eq!(
            rulers.command("/a/lines".into()),
            AppCommand::ExportRulersTo("/a/lines.csv".into()).into()
        );
        let named = Purpose::SaveSession { stem: "case".into() }.command("/a/visit".into());
        assert_eq!(named, AppCommand::SaveSessionTo("/a/visit.glioscope.json".into()).into());
        assert!(
            case_filter().contains(&"gz")
                && is_tracts("a.TCK".as_ref())
                && is_tracts("a.trk.gz".as_ref())
                && is_tracts("a.fa.tsf".as_ref())
                && !is_tracts("a.nii".as_ref())
        );
    }
}
