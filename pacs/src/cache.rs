//! Received studies on this machine: `<cache>/<server>/<study>/<series>/<instance>.dcm`, bounded in bytes. A file is there
//! whole or not at all. Only what has this form is counted and deleted.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use tempfile::NamedTempFile;

use crate::error::Error;
use crate::locks::Locks;
use crate::uid::Uid;

/// Begin of names of files that are being received.
const RECEIVING: &str = "receiving-";

/// A bounded store of studies, which threads and processes may share.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
    most: u64,
    locks: Locks,
}

/// Keeps a study from being evicted until it is dropped.
#[derive(Debug)]
pub struct InUse {
    _lock: File,
}

/// A study in the cache.
struct Stored {
    folder: PathBuf,
    used: SystemTime,
    bytes: u64,
}

impl Cache {
    /// The cache in `folder`, which is made if it isn't there, of at most `most` bytes. Deletes what interrupted retrievals
    /// left.
    ///
    /// # Errors
    /// A folder that can't be written.
    pub fn open(folder: &Path, most: u64) -> Result<Self, Error> {
        let locks = folder.join("locks");
        make_folder(&locks)?;
        make_folder(&folder.join("incoming"))?;
        let cache = Self { folder: folder.to_owned(), most, locks: Locks::new(locks) };
        cache.sweep()?;
        Ok(cache)
    }

    /// Bytes of all studies.
    ///
    /// # Errors
    /// A folder that can't be read.
    pub fn size(&self) -> Result<u64, Error> {
        Ok(self.studies()?.iter().map(|study| study.bytes).sum())
    }

    /// Deletes all studies that nobody uses; returns the bytes of what is left.
    ///
    /// # Errors
    /// A folder that can't be read, a file that can't be deleted.
    pub fn clear(&self) -> Result<u64, Error> {
        self.sweep()?;
        for study in self.studies()? {
            self.evict(&study)?;
        }
        self.size()
    }

    /// The folder of a study, in use from now on.
    pub(crate) fn study(&self, server: &str, study: &Uid) -> Result<StudyFolder, Error> {
        self.sweep()?;
        let folder = self.folder.join(server).join(study.as_str());
        let lock = self.locks.use_study(&folder)?;
        let receiving = self.locks.receive()?;
        make_folder(&folder)?;
        mark_used(&folder)?;
        let bytes = self.size()?;
        let mut study = StudyFolder { cache: self.clone(), folder, bytes, lock, _receiving: receiving };
        study.make_room(0)?;
        Ok(study)
    }

    /// Deletes files that were being received when their process ended.
    fn sweep(&self) -> Result<(), Error> {
        let Some(_lock) = self.locks.nobody_receives()? else { return Ok(()) };
        for (path, kind) in entries(&self.folder.join("incoming"))? {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
            if kind.is_file() && name.is_some_and(|name| name.starts_with(RECEIVING)) {
                remove(fs::remove_file(&path), &path)?;
            }
        }
        Ok(())
    }

    /// All studies.
    fn studies(&self) -> Result<Vec<Stored>, Error> {
        let mut studies = Vec::new();
        for server in folders(&self.folder, is_server)? {
            for folder in folders(&server, |name| Uid::read(name).is_some())? {
                let mut bytes = 0;
                for file in files(&folder)? {
                    // One that another process just evicted counts as nothing.
                    bytes += fs::symlink_metadata(&file).map_or(0, |metadata| metadata.len());
                }
                let used = fs::metadata(marker(&folder)).and_then(|metadata| metadata.modified());
                studies.push(Stored { folder, bytes, used: used.unwrap_or(SystemTime::UNIX_EPOCH) });
            }
        }
        Ok(studies)
    }

    /// Deletes a study's files if nobody uses it; returns whether.
    fn evict(&self, study: &Stored) -> Result<bool, Error> {
        let Some(_lock) = self.locks.nobody_uses(&study.folder)? else { return Ok(false) };
        for file in files(&study.folder)? {
            remove(fs::remove_file(&file), &file)?;
        }
        // Folders with files of others stay, as removing them fails.
        for series in folders(&study.folder, |name| Uid::read(name).is_some())? {
            let _ = fs::remove_dir(series);
        }
        let _ = fs::remove_dir(&study.folder);
        let marker = marker(&study.folder);
        remove(fs::remove_file(&marker), &marker)?;
        if let Some(server) = study.folder.parent() {
            let _ = fs::remove_dir(server);
        }
        Ok(true)
    }
}

/// A study's folder while its instances are received.
pub(crate) struct StudyFolder {
    cache: Cache,
    pub folder: PathBuf,
    /// Bytes of the whole cache with files that are being received here.
    bytes: u64,
    lock: File,
    _receiving: File,
}

impl StudyFolder {
    /// Where an instance is, or will be.
    pub fn path(&self, series: &Uid, instance: &Uid) -> PathBuf {
        self.folder.join(series.as_str()).join(format!("{instance}.dcm"))
    }

    /// A file to receive an instance in, which vanishes unless it is kept.
    pub fn receive(&self) -> Result<NamedTempFile, Error> {
        let folder = self.cache.folder.join("incoming");
        let made = tempfile::Builder::new().prefix(RECEIVING).tempfile_in(&folder);
        made.map_err(|error| Error::file(&folder, &error, "a folder to write in"))
    }

    /// Puts a received file where its instance belongs.
    pub fn keep(&self, received: NamedTempFile, series: &Uid, instance: &Uid) -> Result<PathBuf, Error> {
        make_folder(&self.folder.join(series.as_str()))?;
        let path = self.path(series, instance);
        received.persist(&path).map_err(|error| Error::file(&path, &error.error, "a file to write"))?;
        Ok(path)
    }

    /// Counts `bytes` more, evicting other studies, those longest unused first, where they are too many.
    ///
    /// # Errors
    /// [`Error::TooLarge`]: studies in use leave too little room.
    pub fn make_room(&mut self, bytes: u64) -> Result<(), Error> {
        self.bytes += bytes;
        if self.bytes <= self.cache.most {
            return Ok(());
        }
        let mut studies = self.cache.studies()?;
        studies.sort_by_key(|study| study.used);
        for study in studies.iter().filter(|study| study.folder != self.folder) {
            if self.cache.evict(study)? {
                self.bytes = self.bytes.saturating_sub(study.bytes);
            }
            if self.bytes <= self.cache.most {
                return Ok(());
            }
        }
        let found = format!("{} bytes of studies in use", self.bytes);
        let most = format!("{} bytes", self.cache.most);
        Err(Error::TooLarge { server: "cache of received studies".to_owned(), found, most })
    }

    /// Counts `bytes` less, of a file that isn't kept.
    pub fn gave_back(&mut self, bytes: u64) {
        self.bytes = self.bytes.saturating_sub(bytes);
    }

    /// Ends receiving; the study stays in use until what is returned is dropped.
    pub fn finish(self) -> Result<InUse, Error> {
        mark_used(&self.folder)?;
        Ok(InUse { _lock: self.lock })
    }
}

/// The file whose time says when a study was last used, beside its folder, which holds nothing but DICOM files.
fn marker(study: &Path) -> PathBuf {
    study.with_added_extension("used")
}

fn mark_used(study: &Path) -> Result<(), Error> {
    let path = marker(study);
    let mut options = fs::OpenOptions::new();
    options.write(true).create(true).truncate(false);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let marked = options.open(&path).and_then(|file| file.set_modified(SystemTime::now()));
    marked.map_err(|error| Error::file(&path, &error, "a file to write"))
}

/// Makes a folder and those above it, for this user alone.
fn make_folder(path: &Path) -> Result<(), Error> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(path).map_err(|error| Error::file(path, &error, "a folder to write in"))
}

/// Whether a name is one of [`crate::Client::folder_name`].
fn is_server(name: &str) -> bool {
    name.len() == 16 && name.bytes().all(|b| b.is_ascii_hexdigit() && !b.is_ascii_uppercase())
}

/// Entries of a folder with their kinds, links not followed; none where the folder isn't there.
fn entries(folder: &Path) -> Result<Vec<(PathBuf, fs::FileType)>, Error> {
    let read =
        || fs::read_dir(folder)?.map(|entry| entry.and_then(|e| Ok((e.path(), e.file_type()?)))).collect();
    let entries: io::Result<_> = read();
    match entries {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        other => other.map_err(|error| Error::file(folder, &error, "a folder to read")),
    }
}

fn folders(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>, Error> {
    let mut found = entries(folder)?;
    found.retain(|(path, kind)| {
        kind.is_dir() && path.file_name().and_then(|name| name.to_str()).is_some_and(&is_wanted)
    });
    Ok(found.into_iter().map(|(path, _)| path).collect())
}

/// The instances of a study's folder.
fn files(study: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut files = Vec::new();
    for series in folders(study, |name| Uid::read(name).is_some())? {
        for (path, kind) in entries(&series)? {
            let name =
                path.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_suffix(".dcm"));
            if kind.is_file() && name.is_some_and(|name| Uid::read(name).is_some()) {
                files.push(path);
            }
        }
    }
    Ok(files)
}

/// What isn't there any more is deleted.
fn remove(result: io::Result<()>, path: &Path) -> Result<(), Error> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(Error::file(path, &error, "a file to delete"))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
