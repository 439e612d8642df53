//! File dialogs on their own thread: a desktop whose file chooser never answers must not hang the
//! window, and one that has none must not look like "cancel".

use std::{
    path::PathBuf,
    sync::mpsc,
    time::{Duration, Instant},
};

/// A chooser that answers sooner than this without a file wasn't there (it takes a person longer).
const TOO_FAST: Duration = Duration::from_millis(150);

/// What a dialog is for.
#[derive(Clone, Debug, PartialEq)]
pub enum Purpose {
    /// A manifest, a NIfTI file or a session.
    OpenFile,
    /// A folder with a case.
    OpenFolder,
    /// Where to save.
    Save {
        /// Name to begin with.
        name: String,
    },
}

/// A dialog that is open.
pub struct Dialog<T> {
    /// What to do with the answer.
    pub then: T,
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

impl<T> Dialog<T> {
    /// Opens it. `wake` is called when it has an answer.
    pub fn open(purpose: Purpose, then: T, wake: impl FnOnce() + Send + 'static) -> Self {
        let (send, receive) = mpsc::channel();
        std::thread::spawn(move || {
            let dialog = rfd::FileDialog::new();
            let answer = match purpose {
                Purpose::OpenFile => dialog
                    .set_title("Open a case")
                    .add_filter("Cases, NIfTI files, sessions", &["toml", "nii", "gz", "hdr", "img", "json"])
                    .pick_file(),
                Purpose::OpenFolder => dialog.set_title("Open a folder as a case").pick_folder(),
                Purpose::Save { name } => dialog.set_title("Save").set_file_name(name).save_file(),
            };
            let _ = send.send(answer);
            wake();
        });
        Self { then, since: Instant::now(), receive }
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
