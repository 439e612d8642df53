//! Locks between threads and processes that share a cache. The system frees them when a process ends, however it ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use crate::error::Error;

/// The lock files of a cache: one for files that are being received, 256 for studies, by a hash of their name, so that no
/// name of a study outlives the study. Two studies that share one hinder only each other's eviction.
#[derive(Clone, Debug)]
pub(crate) struct Locks(PathBuf);

impl Locks {
    /// Lock files in `folder`, which exists.
    pub fn new(folder: PathBuf) -> Self {
        Self(folder)
    }

    fn open(&self, name: &str) -> Result<(PathBuf, File), Error> {
        let path = self.0.join(name);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let file = options.open(&path).map_err(|error| Error::file(&path, &error, "a lock file"))?;
        Ok((path, file))
    }

    fn shared(&self, name: &str) -> Result<File, Error> {
        let (path, file) = self.open(name)?;
        file.lock_shared().map_err(|error| Error::file(&path, &error, "a lock"))?;
        Ok(file)
    }

    /// `None` where someone has it.
    fn exclusive(&self, name: &str) -> Result<Option<File>, Error> {
        let (path, file) = self.open(name)?;
        match file.try_lock() {
            Ok(()) => Ok(Some(file)),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(Error::file(&path, &error, "a lock")),
        }
    }

    /// Says that files are being received, until it is dropped.
    pub fn receive(&self) -> Result<File, Error> {
        self.shared("receiving")
    }

    /// Says that nobody is receiving, until it is dropped; `None` where someone is.
    pub fn nobody_receives(&self) -> Result<Option<File>, Error> {
        self.exclusive("receiving")
    }

    /// Says that a study is in use, until it is dropped.
    pub fn use_study(&self, study: &Path) -> Result<File, Error> {
        self.shared(&bucket(study))
    }

    /// Says that nobody uses a study, until it is dropped; `None` where someone does.
    pub fn nobody_uses(&self, study: &Path) -> Result<Option<File>, Error> {
        self.exclusive(&bucket(study))
    }
}

/// The lock file of a study, by the last two parts of its path: the server's and its own name.
fn bucket(study: &Path) -> String {
    let mut hash = Sha256::new();
    for part in study.iter().rev().take(2) {
        hash.update(part.as_encoded_bytes());
        hash.update(b"/");
    }
    format!("{:02x}", hash.finalize()[0])
}
