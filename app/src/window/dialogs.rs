//! File dialogs on their own thread: a desktop whose file chooser never answers must not hang the
//! window, and one that has none must not look like "cancel".

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

/// A chooser that answers sooner than this without a file wasn't there (it takes a person longer).
const TOO_FAST: Duration = Duration::from_millis(150);

/// What a dialog is for.
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
    /// Write the lines measured.
    Rulers(RulerFormat),
}

impl Purpose {
    /// A name to propose for the file that is written; `None` where one is opened.
    pub fn file_name(&self) -> Option<String> {
        Some(match self {
            Self::OpenFile | Self::OpenFolder => return None,
            Self::SaveSession => format!("case.{}", session::ENDING),
            Self::Picture(pane) => format!("{}.png", pane.map_or("window", PaneId::tab).to_lowercase()),
            Self::Measurements => "measurements.json".to_owned(),
            Self::Rulers(format) => format.file_name(),
        })
    }

    /// What to do with the path chosen.
    pub fn command(&self, path: PathBuf) -> Command {
        match self {
            Self::OpenFile | Self::OpenFolder => open_command(path),
            Self::SaveSession => AppCommand::SaveSessionTo(path).into(),
            Self::Picture(pane) => AppCommand::ScreenshotTo(*pane, path).into(),
            Self::Measurements => AppCommand::ExportMeasurementsTo(path).into(),
            Self::Rulers(format) => AppCommand::ExportRulersTo(format.on(path)).into(),
        }
    }
}

/// What to do with a path someone chose: a session or a case.
pub fn open_command(path: PathBuf) -> Command {
    if session::is_session(&path) {
        AppCommand::OpenSession(path).into()
    } else {
        AppCommand::Open(CaseRef::Path(path)).into()
    }
}

/// What can be opened, in words: for prompts.
pub fn openable() -> String {
    format!("a manifest (case.toml), a folder, a {} file or a session file", volume_names())
}

/// Endings, without the dot, of what can be opened as a case.
fn case_filter() -> Vec<&'static str> {
    let mut endings = volume_filter();
    endings.extend(["toml", "json"]);
    endings
}

/// A dialog that is open.
pub struct Dialog {
    /// What to do with the answer.
    pub purpose: Purpose,
    since: Instant,
    receive: mpsc::Receiver<Option<PathBuf>>,
}

/// What became of a dialog.
pub enum Answer {
    /// Still open.
    Waiting,
    /// The user chose this.
    Chosen(PathBuf),
    /// The user chose nothing.
    Cancelled,
    /// There is no file chooser on this desktop.
    Unavailable,
}

impl Dialog {
    /// Opens it. `wake` is called when it has an answer.
    pub fn open(purpose: Purpose, wake: Waker) -> Self {
        let (send, receive) = mpsc::channel();
        let asked = purpose.clone();
        std::thread::spawn(move || {
            let dialog = rfd::FileDialog::new();
            let answer = match (&asked, asked.file_name()) {
                (Purpose::OpenFolder, _) => dialog.set_title("Open a folder as a case").pick_folder(),
                (_, None) => dialog
                    .set_title("Open a case")
                    .add_filter(format!("Cases, {} files, sessions", volume_names()), &case_filter())
                    .pick_file(),
                (_, Some(name)) => dialog.set_title("Save").set_file_name(name).save_file(),
            };
            let _ = send.send(answer);
            wake.wake();
        });
        Self { purpose, since: Instant::now(), receive }
    }

    /// What became of it.
    pub fn poll(&self) -> Answer {
        match self.receive.try_recv() {
            Ok(Some(path)) => Answer::Chosen(path),
            Ok(None) if self.since.elapsed() < TOO_FAST => Answer::Unavailable,
            Ok(None) => Answer::Cancelled,
            Err(mpsc::TryRecvError::Empty) => Answer::Waiting,
            Err(mpsc::TryRecvError::Disconnected) => Answer::Unavailable,
        }
    }
}

/// Whether a dropped file is of fibre tracts, which are added to the case that is open.
pub fn is_tracts(path: &std::path::Path) -> bool {
    let ending = path.extension().unwrap_or_default();
    tract_endings().any(|tracts| ending.eq_ignore_ascii_case(tracts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_purpose_has_its_file_and_its_command() {
        let path = || PathBuf::from("/somewhere/x.nii");
        assert_eq!(Purpose::OpenFile.command(path()), AppCommand::Open(CaseRef::Path(path())).into());
        let session = PathBuf::from("/somewhere/x.glioscope.json");
        assert_eq!(Purpose::OpenFile.command(session.clone()), AppCommand::OpenSession(session).into());
        let lines = Purpose::Rulers(RulerFormat::Csv);
        assert_eq!(lines.file_name().as_deref(), Some("lines.csv"));
        assert_eq!(
            lines.command("/a/lines".into()),
            AppCommand::ExportRulersTo("/a/lines.csv".into()).into()
        );
        assert!(case_filter().contains(&"gz") && is_tracts("a.TCK".as_ref()) && !is_tracts("a.nii".as_ref()));
    }
}
