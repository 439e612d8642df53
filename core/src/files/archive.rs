//! Studies in a zip archive: unpacked into a private folder of this run, which is removed when the program ends.

use std::{
    collections::{HashMap, HashSet},
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
    sync::{LazyLock, Mutex},
};

use tempfile::TempDir;
use zip::{ZipArchive, result::ZipError};

use super::{FileError, FileMark, absolute, printable, read_head, write_failed};
use crate::Progress;

/// How a zip archive begins; that of an empty one differs.
const MAGIC: [&[u8]; 2] = [b"PK\x03\x04", b"PK\x05\x06"];
/// The most files of an archive, and the most folders that its names make.
const MOST_FILES: usize = 100_000;
/// The most folders inside each other: as deep as studies are searched.
const MOST_DEPTH: usize = 32;
/// Characters of a name in a message.
const SHOWN_CHARS: usize = 120;
/// Start of the names of the folders; the number of the process follows.
const PREFIX: &str = "glioscope-zip-";

/// Archives unpacked by this run, by their absolute path, each as it was then.
static UNPACKED: LazyLock<Mutex<HashMap<PathBuf, (FileMark, TempDir)>>> = LazyLock::new(Mutex::default);

/// Whether a file is a zip archive, by its content.
pub fn is_zip(path: &Path) -> bool {
    read_head(path, 4).is_some_and(|head| MAGIC.contains(&head.as_slice()))
}

/// The folder with the files of an archive. An archive that this run has unpacked already, and that is unchanged, is not
/// unpacked again.
///
/// # Errors
/// [`FileError`] naming the archive: it is damaged, encrypted, compressed by another method than deflate, holds more than
/// 100,000 files or folders, folders more than 32 deep, a link, a name twice, more than `max_bytes` unpacked, or a name that
/// leads out of it; there is no room for its files; or it was cancelled. Nothing is left then.
pub fn unpacked(path: &Path, max_bytes: u64, progress: &Progress) -> Result<PathBuf, FileError> {
    let path = absolute(path);
    let mark = FileMark::of(&path, progress)?;
    let mut all = UNPACKED.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some((known, folder)) = all.get(&path)
        && known.same_content(&mark)
        && folder.path().is_dir()
    {
        return Ok(folder.path().to_owned());
    }
    sweep(&std::env::temp_dir());
    let prefix = format!("{PREFIX}{}-", std::process::id());
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix);
    // A patient's files are their user's alone.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
    let folder = builder.tempdir();
    let folder = folder.map_err(|e| write_failed(&std::env::temp_dir(), &e))?;
    unpack(&path, folder.path(), max_bytes, progress)?;
    let place = folder.path().to_owned();
    all.insert(path, (mark, folder));
    Ok(place)
}

/// Removes the folders of all archives: at the end of the program.
pub fn remove_unpacked() {
    UNPACKED.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clear();
}

fn unpack(path: &Path, folder: &Path, max_bytes: u64, progress: &Progress) -> Result<(), FileError> {
    let name = printable(&path.display().to_string());
    let wrong = |found: String, expected: &str| FileError::wrong(name.clone(), found, expected);
    let damaged = |error: ZipError| match error {
        ZipError::UnsupportedArchive(why) if why.contains("assword") => {
            wrong("an encrypted archive".into(), "one without a password")
        }
        ZipError::UnsupportedArchive(why) => {
            wrong(format!("an archive of another kind ({why})"), "zip with deflate")
        }
        ZipError::InvalidPassword => wrong("an encrypted archive".into(), "one without a password"),
        other => wrong(format!("a damaged archive ({other})"), "a zip archive"),
    };
    let file = File::open(path).map_err(|e| wrong(e.to_string(), "a file that can be read"))?;
    let mut archive = ZipArchive::new(io::BufReader::new(file)).map_err(damaged)?;
    if archive.len() > MOST_FILES {
        return Err(wrong(format!("{} files", archive.len()), "at most 100000"));
    }
    if let Some(entries) = stated_entries(path).filter(|entries| *entries != archive.len()) {
        let found = format!("{entries} entries of {} names", archive.len());
        return Err(wrong(found, "each name once"));
    }
    let mut folders = HashSet::new();
    progress.say("unpacking");
    progress.expect(archive.len() as u64);
    let mut left = max_bytes;
    for n in 0..archive.len() {
        progress.check()?;
        progress.advance(1)?;
        let mut entry = archive.by_index(n).map_err(damaged)?;
        let shown: String = printable(&entry.name().map_err(damaged)?).chars().take(SHOWN_CHARS).collect();
        let Some(inside) = entry.enclosed_name() else {
            return Err(wrong(format!("the name {shown}"), "names within the archive"));
        };
        let target = folder.join(&inside);
        // A link could lead out of the folder.
        if entry.is_symlink() {
            return Err(wrong(format!("{shown}, which is a link"), "files and folders"));
        }
        let parts = inside.components().count();
        if parts > MOST_DEPTH {
            return Err(wrong(format!("a name of {parts} folders"), "at most 32 inside each other"));
        }
        folders.extend(inside.ancestors().skip(1).map(Path::to_owned));
        if folders.len() > MOST_FILES {
            return Err(wrong("more than 100000 folders".into(), "fewer"));
        }
        let cant = |e: io::Error| match e.kind() {
            io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory => {
                wrong(format!("{shown} beside another entry of its name"), "each name once")
            }
            _ => write_failed(&target, &e),
        };
        if entry.is_dir() {
            fs::create_dir_all(&target).map_err(cant)?;
            continue;
        }
        if let Some(parent) = target.parent() {
            fs::create_dir_all(parent).map_err(cant)?;
        }
        let mut out = File::create_new(&target).map_err(cant)?;
        let mut read = 0;
        let mut buffer = vec![0; 1 << 16];
        // Sizes in headers are claims: what is read counts.
        loop {
            progress.check()?;
            let count = match entry.read(&mut buffer) {
                Ok(0) => break,
                Ok(count) => count,
                Err(e) if e.to_string().contains("ompression method") => {
                    let found = format!("{shown}, compressed by another method ({e})");
                    return Err(wrong(found, "zip with deflate"));
                }
                Err(e) => return Err(wrong(format!("{shown}, which is damaged ({e})"), "a zip archive")),
            };
            read += count as u64;
            if read > left {
                return Err(wrong(format!("more than {max_bytes} bytes unpacked"), "fewer (--max-bytes)"));
            }
            io::Write::write_all(&mut out, &buffer[..count]).map_err(cant)?;
        }
        left -= read;
    }
    Ok(())
}

/// The number of entries that the end of an archive states (APPNOTE 4.3.16); `None` where it isn't found or doesn't fit its 16
/// bits. Entries of one name are one to the reader, which would lose all but the last.
fn stated_entries(path: &Path) -> Option<usize> {
    const END: usize = 22;
    let mut file = File::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    let tail = length.min((END + 0xffff) as u64);
    io::Seek::seek(&mut file, io::SeekFrom::Start(length - tail)).ok()?;
    let mut bytes = Vec::new();
    file.take(tail).read_to_end(&mut bytes).ok()?;
    let last = bytes.len().checked_sub(END)?;
    let at = (0..=last).rev().find(|&at| bytes[at..].starts_with(MAGIC[1]))?;
    let entries = u16::from_le_bytes([bytes[at + 10], bytes[at + 11]]);
    (entries != u16::MAX).then_some(usize::from(entries))
}

/// Removes the folders of runs that were killed.
fn sweep(parent: &Path) {
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let rest = name.to_str().and_then(|name| name.strip_prefix(PREFIX));
        let process = rest.and_then(|rest| rest.split_once('-')?.0.parse::<u32>().ok());
        // Only where running processes can be told.
        if let Some(process) = process
            && Path::new("/proc/self").exists()
            && !Path::new(&format!("/proc/{process}")).exists()
        {
            // What can't be removed is left.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Write};

    use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

    use super::*;
    use crate::files::write_whole;

    fn archive(files: &[(&str, &[u8])]) -> Vec<u8> {
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in files {
            writer
                .start_file(
                    *name,
                    SimpleFileOptions::default().compression_method(CompressionMethod::Deflated),
                )
                .unwrap();
            writer.write_all(bytes).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    #[test]
    fn files_of_an_archive_are_as_they_were_and_nothing_leads_out_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.bin");
        let unpack = |bytes: &[u8], max_bytes: u64| {
            write_whole(&path, bytes).unwrap();
            assert!(is_zip(&path));
            unpacked(&path, max_bytes, &Progress::new())
        };
        let zeros = vec![0; 1 << 20];
        let good = archive(&[("a/b.txt", b"hello"), ("c", &zeros)]);
        let place = unpack(&good, 1 << 21).unwrap();
        assert_eq!(fs::read(place.join("a/b.txt")).unwrap(), b"hello");
        assert_eq!(fs::read(place.join("c")).unwrap(), zeros);
        assert_eq!(unpack(&good, 1 << 21).unwrap(), place, "once is enough");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(place.metadata().unwrap().permissions().mode() & 0o77, 0, "its owner's alone");
        }

        for (files, found) in [
            (&[("../evil", &b"x"[..])][..], "the name ../evil"),
            (&[("/etc/evil", b"x")], ""),
            (&[("bomb", &zeros)], "more than 1000 bytes unpacked"),
        ] {
            match unpack(&archive(files), 1000) {
                // Stripped of its root, as all programs do.
                Ok(place) => assert!(found.is_empty() && place.join("etc/evil").is_file()),
                Err(error) => assert!(!found.is_empty() && error.to_string().contains(found), "{error}"),
            }
        }
        assert!(!Path::new("/etc/evil").exists());
        let deep = format!("{}x", "a/".repeat(40));
        for (name, found) in [(deep.as_str(), "a name of 41 folders"), ("a/b.txt/c", "")] {
            let error = unpack(&archive(&[("a/b.txt", b"x"), (name, b"y")]), 1000);
            let error = error.unwrap_err().to_string();
            assert!(error.contains(found), "{error}");
        }
        let mut twice = archive(&[("one", b"x"), ("two", b"y")]);
        let places: Vec<usize> = (0..twice.len() - 3).filter(|&at| &twice[at..at + 3] == b"two").collect();
        places.into_iter().for_each(|at| twice[at..at + 3].copy_from_slice(b"one"));
        let error = unpack(&twice, 1000).unwrap_err().to_string();
        assert!(error.contains("found 2 entries of 1 names, expected each name once"), "{error}");
        let mut cut = good.clone();
        cut.truncate(good.len() / 2);
        assert!(unpack(&cut, 1 << 21).unwrap_err().to_string().contains("damaged archive"));
        let mut bent = good;
        bent[40] ^= 0xff;
        assert!(unpack(&bent, 1 << 21).unwrap_err().to_string().contains("damaged"));
        let last = unpack(&archive(&[("x", b"y")]), 10).unwrap();
        remove_unpacked();
        assert!(!last.exists() && !place.exists());
    }
}
