//! File dialogs on their own thread, so that a file chooser that never answers doesn't block the window. A desktop
//! without a file chooser is distinguished from a cancelled dialog.

use std::{
    path::PathBuf,
    sync::mpsc,
    time::{Duration, Instant},
};

use glioscope_core::files::format::{tract_endings, volume_filter, volume_names};

use crate::{
    command::{AppCommand, Command},
    model::{CaseRef, PaneId, RulerFormat, session},
    world::jobs::Waker,
};

/// An answer without a file in less time than this means that there is no file chooser: a person takes longer.
const MIN_ANSWER_TIME: Duration = Duration::from_millis(150);

/// Purpose of a dialog.
#[derive(Clone, Debug, PartialEq)]
pub enum Purpose {
    /// Open a case or session file.
    OpenFile,
    /// Open a folder as a case.
    OpenFolder,
    /// Save the session.
    SaveSession,
    /// Write a picture of a pane, or of the window.
    Picture(Option<PaneId>),
    /// Write the measurements.
    Measurements,
    /// Write the rulers.
    Rulers(RulerFormat),
}

impl Purpose {
    /// Proposed name of the file to write; `None` for dialogs that open a file or folder.
    pub fn file_name(&self) -> Option<String> {
        Some(match self {
            Self::OpenFile | Self::OpenFolder => return None,
            Self::SaveSession => format!("case.{}", session::EXTENSION),
            Self::Picture(pane) => format!("{}.png", pane.map_or("window", PaneId::tab).to_lowercase()),
            Self::Measurements => "measurements.json".to_owned(),
            Self::Rulers(format) => format.file_name(),
        })
    }

    /// The command for the chosen path.
    pub fn command(&self, path: PathBuf) -> Command {
        match self {
            Self::OpenFile | Self::OpenFolder => open_command(path),
            Self::SaveSession => AppCommand::SaveSessionTo(path).into(),
            Self::Picture(pane) => AppCommand::ScreenshotTo(*pane, path).into(),
            Self::Measurements => AppCommand::ExportMeasurementsTo(path).into(),
            Self::Rulers(format) => AppCommand::ExportRulersTo(format.with_extension(path)).into(),
        }
    }
}

/// The command that opens a path as a session or a case.
pub fn open_command(path: PathBuf) -> Command {
    if session::is_session(&path) {
        AppCommand::OpenSession(path).into()
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

/// A dialog that is open.
pub struct Dialog {
    /// Its purpose.
    pub purpose: Purpose,
    since: Instant,
    receive: mpsc::Receiver<Option<PathBuf>>,
}

/// State of a dialog.
pub enum Answer {
    /// Still open.
    Waiting,
    /// The user chose this.
    Chosen(PathBuf),
    /// The user cancelled.
    Cancelled,
    /// There is no file chooser on this desktop.
    Unavailable,
}

impl Dialog {
    /// Opens it. `wake` is called when it has an answer.
    pub fn open(purpose: Purpose, wake: Waker) -> Self {
        let (send, receive) = mpsc::channel();
        let thread_purpose = purpose.clone();
        std::thread::spawn(move || {
            let dialog = rfd::FileDialog::new();
            let answer = match (&thread_purpose, thread_purpose.file_name()) {
                (Purpose::OpenFolder, _) => dialog.set_title("Open a folder as a case").pick_folder(),
                (_, None) => dialog
                    .set_title("Open a case")
                    .add_filter(format!("Cases, {} files, sessions", volume_names()), &case_filter())
                    // A session is known by its content, whatever its name.
                    .add_filter("All files", &["*"])
                    .pick_file(),
                (_, Some(name)) => dialog.set_title("Save").set_file_name(name).save_file(),
            };
            let _ = send.send(answer);
            wake.wake();
        });
        Self { purpose, since: Instant::now(), receive }
    }

    /// Its current state.
    pub fn poll(&self) -> Answer {
        match self.receive.try_recv() {
            Ok(Some(path)) => Answer::Chosen(path),
            Ok(None) if self.since.elapsed() < MIN_ANSWER_TIME => Answer::Unavailable,
            Ok(None) => Answer::Cancelled,
            Err(mpsc::TryRecvError::Empty) => Answer::Waiting,
            Err(mpsc::TryRecvError::Disconnected) => Answer::Unavailable,
        }
    }
}

/// Whether a dropped file contains fibre tracts, which are added to the open case.
pub fn is_tracts(path: &std::path::Path) -> bool {
    let ending = path.extension().unwrap_or_default();
    tract_endings().any(|tracts| ending.eq_ignore_ascii_case(tracts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_purpose_gives_its_file_name_and_command() {
        let path = || PathBuf::from("/somewhere/x.nii");
        assert_eq!(Purpose::OpenFile.command(path()), AppCommand::Open(CaseRef::Path(path())).into());
        let session = PathBuf::from("/somewhere/x.glioscope.json");
        assert_eq!(Purpose::OpenFile.command(session.clone()), AppCommand::OpenSession(session).into());
        let rulers = Purpose::Rulers(RulerFormat::Csv);
        assert_eq!(rulers.file_name().as_deref(), Some("lines.csv"));
        assert_eq!(
            rulers.command("/a/lines".into()),
            AppCommand::ExportRulersTo("/a/lines.csv".into()).into()
        );
        assert!(case_filter().contains(&"gz") && is_tracts("a.TCK".as_ref()) && !is_tracts("a.nii".as_ref()));
    }
}
