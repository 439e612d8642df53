//! Writing files whole or not at all.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use tempfile::{NamedTempFile, TempDir};

use super::{FileError, printable};

/// Start of the names of temporary files.
const PREFIX: &str = ".glioscope-";
/// Permissions of ordinary new files. Those of tempfile let only the owner read them, which is too strict for exported
/// results.
const ORDINARY: u32 = 0o666;
/// Permissions of files that only their owner reads.
const PRIVATE: u32 = 0o600;

/// Builder of temporary files with these permissions.
fn temporary(mode: u32) -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
    #[cfg(not(unix))]
    let _ = mode;
    builder
}

/// Writing to `path` failed.
pub(crate) fn write_failed(path: &Path, why: &dyn std::fmt::Display) -> FileError {
    let file = printable(&path.display().to_string());
    // `tempfile` adds the path of its own file, which tells nobody anything.
    let why = why.to_string();
    let why = why.split_once(" at path \"").map_or(why.as_str(), |(why, _)| why);
    FileError::wrong(file, format!("writing failed: {why}"), "a place that can be written")
}

/// Whether a file can be created in `path`: that it is a folder, and this user may write there. On systems other than Unix only
/// what the folder's own mark says.
pub fn is_writable_folder(path: &Path) -> bool {
    if !path.is_dir() {
        return false;
    }
    #[cfg(unix)]
    {
        use rustix::fs::{Access, access};
        access(path, Access::WRITE_OK | Access::EXEC_OK).is_ok()
    }
    #[cfg(not(unix))]
    path.metadata().is_ok_and(|found| !found.permissions().readonly())
}

/// Writes `bytes` to `path` atomically, or leaves the existing file untouched: a temporary file in the same
/// folder is flushed to disk, then renamed over `path`. A symbolic link is kept: its target is written.
///
/// # Errors
/// [`FileError::Wrong`] with the system's reason, or where `path` is a folder, a device, a pipe, a write-protected file, or
/// a link whose target doesn't exist.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_whole_with(path, "", |file| file.as_file_mut().write_all(bytes).map_err(|e| write_failed(path, &e)))
}

/// As [`write_whole`], readable and writable by its owner alone: for files that name patients' folders.
///
/// # Errors
/// As [`write_whole`].
pub fn write_whole_private(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    persist(path, "", PRIVATE, |file| file.as_file_mut().write_all(bytes).map_err(|e| write_failed(path, &e)))
}

/// As [`write_whole`], with content that `write` writes piece by piece: for files that needn't fit in memory.
///
/// # Errors
/// As [`write_whole`], and those of `write`, after which nothing has changed.
pub fn write_whole_by<E: From<FileError>>(
    path: &Path,
    write: impl FnOnce(&mut dyn std::io::Write) -> Result<(), E>,
) -> Result<(), E> {
    persist(path, "", ORDINARY, |file| write(file.as_file_mut()))
}

/// As [`write_whole`], with content that `write` writes to the temporary file, whose name ends in `suffix`.
/// When `write` fails, the temporary file is removed and nothing else changes.
pub(crate) fn write_whole_with(
    path: &Path,
    suffix: &'static str,
    write: impl FnOnce(&mut NamedTempFile) -> Result<(), FileError>,
) -> Result<(), FileError> {
    persist(path, suffix, ORDINARY, write)
}

fn persist<E: From<FileError>>(
    path: &Path,
    suffix: &'static str,
    mode: u32,
    write: impl FnOnce(&mut NamedTempFile) -> Result<(), E>,
) -> Result<(), E> {
    // Renaming over a device would replace it by a regular file.
    if path.metadata().is_ok_and(|metadata| !metadata.is_file()) {
        let found = "something that is no ordinary file";
        return Err(FileError::wrong(path.display().to_string(), found, "a place that can be written").into());
    }
    let target = match path.is_symlink().then(|| path.canonicalize()) {
        None => None,
        Some(Ok(target)) => Some(target),
        Some(Err(e)) => return Err(write_failed(path, &format!("a link to nowhere ({e})")).into()),
    };
    let path = target.as_deref().unwrap_or(path);
    let failed = |e: std::io::Error| write_failed(path, &e);
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = temporary(mode).suffix(suffix).tempfile_in(folder).map_err(failed)?;
    write(&mut file)?;
    // A file that is replaced keeps its permissions, unless the new one is private.
    if let Some(replaced) = path.metadata().ok().map(|metadata| metadata.permissions()) {
        if replaced.readonly() {
            return Err(write_failed(path, &"a write-protected file").into());
        }
        if mode == ORDINARY {
            file.as_file().set_permissions(replaced).map_err(failed)?;
        }
    }
    file.as_file().sync_all().map_err(failed)?;
    file.persist(path).map_err(|e| failed(e.error))?;
    sweep(folder);
    Ok(())
}

/// A new folder inside `parent` for files that are put in place together; it is removed when dropped.
///
/// # Errors
/// [`FileError::Wrong`] with the system's reason.
pub fn temporary_folder(parent: &Path) -> Result<TempDir, FileError> {
    tempfile::Builder::new().prefix(PREFIX).tempdir_in(parent).map_err(|e| write_failed(parent, &e))
}

/// Moves the files `new` from `from`, a [`temporary_folder`] of `folder`, into `folder` and removes the files `outdated`
/// where they are there. On failure `folder` is as before. If the process is killed meanwhile, each file is the old or the new one.
///
/// # Errors
/// [`FileError::Wrong`] with the first failure; it says so where a file couldn't be put back.
pub fn replace_files(
    from: &TempDir,
    folder: &Path,
    new: &[String],
    outdated: &[String],
) -> Result<(), FileError> {
    let kept = temporary_folder(from.path())?;
    let mut replaced = Vec::new();
    for name in new.iter().chain(outdated) {
        let file = folder.join(name);
        if file.symlink_metadata().is_err() || replaced.contains(&name) {
            continue;
        }
        let copy = kept.path().join(name);
        // Some file systems have no hard links.
        std::fs::hard_link(&file, &copy)
            .or_else(|_| std::fs::copy(&file, &copy).map(drop))
            .map_err(|e| write_failed(&file, &e))?;
        replaced.push(name);
    }
    let put = |name: &String| {
        let file = folder.join(name);
        std::fs::rename(from.path().join(name), &file).map_err(|e| write_failed(&file, &e))
    };
    let remove = |name: &String| {
        let file = folder.join(name);
        std::fs::remove_file(&file).map_err(|e| write_failed(&file, &e))
    };
    let mut done = Vec::new();
    let gone = outdated.iter().filter(|name| replaced.contains(name));
    let all = new.iter().map(|name| (name, true)).chain(gone.map(|name| (name, false)));
    for (name, is_new) in all {
        let Err(error) = (if is_new { put(name) } else { remove(name) }) else {
            done.push(name);
            continue;
        };
        let put_back = |name: &&String| {
            let file = folder.join(name);
            if replaced.contains(name) {
                std::fs::rename(kept.path().join(name), file)
            } else {
                std::fs::remove_file(file)
            }
        };
        let failed: Vec<PathBuf> =
            done.into_iter().filter(|name| put_back(name).is_err()).map(|name| folder.join(name)).collect();
        return Err(match failed.first() {
            None => error,
            Some(file) => write_failed(file, &format!("{error}; and the file before couldn't be put back")),
        });
    }
    sweep(folder);
    Ok(())
}

/// Age from which a temporary file or folder belongs to a run that was killed: no write takes so long.
const STALE: std::time::Duration = std::time::Duration::from_secs(3600);
/// Number of letters and digits after [`PREFIX`] in the names of temporary folders.
const RANDOM_CHARS: usize = 6;

/// Removes the temporary files and folders that killed runs left in `folder`.
pub(crate) fn sweep(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, Ok(metadata)) = (entry.file_name(), entry.metadata()) else { continue };
        let Some(random) = name.to_str().and_then(|name| name.strip_prefix(PREFIX)) else { continue };
        let age = metadata.modified().ok().and_then(|modified| modified.elapsed().ok());
        if age.is_none_or(|age| age <= STALE) {
            continue;
        }
        // What can't be removed is left.
        if metadata.is_file() {
            let _ = std::fs::remove_file(entry.path());
        } else if metadata.is_dir()
            && random.len() == RANDOM_CHARS
            && random.bytes().all(|b| b.is_ascii_alphanumeric())
        {
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
}
