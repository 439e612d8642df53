//! Unsaved work is kept in the user's state folder while the window is open, and offered at the next start after a crash.
//! That it fails is said once, and tried again. A lock, which ends with its process however that ends, tells files of
//! open windows from those left behind.

use std::{
    fs::{File, OpenOptions},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use glioscope_core::files::FileError;

use crate::{
    command::Workstation,
    model::{
        Document,
        session::{self, EXTENSION},
    },
};

/// Time from a change to the next copy.
pub const INTERVAL: Duration = Duration::from_secs(30);
/// The most windows whose work is kept.
const MOST_FILES: u32 = 100;

fn file_name(number: u32) -> String {
    format!("unsaved-{number}.{EXTENSION}")
}

/// A file of unsaved work, locked as long as this exists.
struct Kept {
    file: PathBuf,
    lock: PathBuf,
    _locked: File,
}

impl Kept {
    /// Locks the file with this number; `None` where another process has it.
    fn lock(folder: &Path, number: u32) -> Option<Self> {
        let lock = folder.join(format!("unsaved-{number}.lock"));
        let locked = OpenOptions::new().create(true).truncate(false).write(true).open(&lock).ok()?;
        locked.try_lock().ok()?;
        Some(Self { file: folder.join(file_name(number)), lock, _locked: locked })
    }

    fn remove(&self) {
        let _ = std::fs::remove_file(&self.file);
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        if !self.file.exists() {
            let _ = std::fs::remove_file(&self.lock);
        }
    }
}

/// Keeps copies of one window's unsaved work.
pub struct Autosave {
    own: Kept,
    /// The content of the copy.
    written: Option<Document>,
    changed_since: Option<Instant>,
    /// Whether the last copy failed.
    failed: bool,
    /// Why, until it is said.
    failure: Option<FileError>,
    /// Work of windows that ended without asking, oldest first.
    left_behind: Vec<Kept>,
    /// Work that is being opened; its file goes once the own one has it.
    opening: Option<Kept>,
}

impl Autosave {
    /// In the user's state folder, which `GLIOSCOPE_STATE` overrides; with a configuration of its own, in the folder `state` there.
    /// `None` where that can't be written.
    pub fn of_user() -> Option<Self> {
        let own = || std::env::var_os("GLIOSCOPE_CONFIG").map(|folder| PathBuf::from(folder).join("state"));
        let folder = std::env::var_os("GLIOSCOPE_STATE").map(PathBuf::from).or_else(own).or_else(|| {
            let folders = directories::ProjectDirs::from("", "", "glioscope")?;
            Some(folders.state_dir().unwrap_or_else(|| folders.data_local_dir()).to_owned())
        });
        Self::in_folder(&folder?)
    }

    /// In `folder`.
    pub fn in_folder(folder: &Path) -> Option<Self> {
        std::fs::create_dir_all(folder).ok()?;
        let (mut own, mut left_behind) = (None, Vec::new());
        for number in 0..MOST_FILES {
            if own.is_some() && !folder.join(file_name(number)).exists() {
                continue;
            }
            let Some(kept) = Kept::lock(folder, number) else { continue };
            if kept.file.exists() {
                left_behind.push(kept);
            } else if own.is_none() {
                own = Some(kept);
            }
        }
        let age = |kept: &Kept| kept.file.metadata().and_then(|metadata| metadata.modified()).ok();
        left_behind.sort_by_key(age);
        Some(Self {
            own: own?,
            written: None,
            changed_since: None,
            failed: false,
            failure: None,
            left_behind,
            opening: None,
        })
    }

    /// Unsaved work of a window that ended without asking, the newest first.
    pub fn left_behind(&self) -> Option<&Path> {
        self.left_behind.last().map(|kept| kept.file.as_path())
    }

    /// Takes over the work that [`Autosave::left_behind`] names, which is being opened. Returns its file.
    pub fn take_over(&mut self) -> Option<PathBuf> {
        self.opening = self.left_behind.pop();
        self.opening.as_ref().map(|kept| kept.file.clone())
    }

    /// Deletes the work that [`Autosave::left_behind`] names, or leaves it for the next start.
    pub fn pass_over(&mut self, delete: bool) {
        if let Some(kept) = self.left_behind.pop()
            && delete
        {
            kept.remove();
        }
    }

    /// Copies unsaved work that is older than [`INTERVAL`]. Returns the time until it will be.
    pub fn keep(&mut self, work: &Workstation, now: Instant) -> Option<Duration> {
        if !work.has_unsaved_work() {
            self.forget();
            return None;
        }
        let (doc, case) = (work.doc.as_ref()?, work.world.case()?);
        if self.written.as_ref().is_some_and(|written| written.same_work(doc)) {
            self.changed_since = None;
            return None;
        }
        let since = *self.changed_since.get_or_insert(now);
        let waited = now.saturating_duration_since(since);
        let taken_over = self.opening.is_some() && work.job.is_none();
        if waited < INTERVAL && (!taken_over || self.failed) {
            return Some(INTERVAL - waited);
        }
        if let Err(error) = session::save(&self.own.file, doc, case, work.world.files()) {
            if !std::mem::replace(&mut self.failed, true) {
                self.failure = Some(error);
            }
            self.changed_since = Some(now);
            return Some(INTERVAL);
        }
        self.failed = false;
        if taken_over && let Some(kept) = self.opening.take() {
            kept.remove();
        }
        self.written = Some(doc.clone());
        self.changed_since = None;
        None
    }

    /// Why no copy can be written; once, until one can be.
    pub fn take_failure(&mut self) -> Option<FileError> {
        self.failure.take()
    }

    /// Removes the copy: the work is saved, or given up.
    pub fn forget(&mut self) {
        self.changed_since = None;
        if self.written.take().is_some() {
            self.own.remove();
        }
    }
}
