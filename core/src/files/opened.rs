//! Opening a file: regular files only, small ones whole, and what stands in a file's place named as what it is.

use std::{
    fs::File,
    io::{ErrorKind, Read},
    path::Path,
};

use super::{FileError, printable};

const READABLE: &str = "a file that can be read";

/// Opens a regular file and returns its size in bytes. Anything else (folder, pipe, device) is refused before it is
/// opened: opening a pipe would wait for a writer, and a device may have no end.
///
/// # Errors
/// [`FileError`] for anything else, and where it can't be opened.
pub fn open_regular(path: &Path) -> Result<(File, u64), FileError> {
    let name = printable(&path.display().to_string());
    let meta = std::fs::metadata(path).map_err(|e| missing(path, &e, READABLE))?;
    if !meta.is_file() {
        let found = if meta.is_dir() { "a folder" } else { "a pipe or device" };
        return Err(FileError::wrong(name, found, "a file"));
    }
    let file = File::open(path).map_err(|e| FileError::wrong(name, e.to_string(), READABLE))?;
    Ok((file, meta.len()))
}

/// Why there is nothing at `path`, where `expected` is: a missing file, or a link to one.
pub(crate) fn missing(path: &Path, error: &std::io::Error, expected: &str) -> FileError {
    let name = printable(&path.display().to_string());
    let is_missing = error.kind() == ErrorKind::NotFound;
    match is_missing.then(|| broken_link(path)).flatten() {
        Some((found, instead)) => FileError::wrong(name, found, instead.unwrap_or(expected)),
        None if is_missing => FileError::wrong(name, "no such file", expected),
        None => FileError::wrong(name, error.to_string(), expected),
    }
}

/// What the link at `path` is, whose target doesn't exist, and what is expected instead where that is known; `None` where
/// there is no link.
pub(crate) fn broken_link(path: &Path) -> Option<(String, Option<&'static str>)> {
    let target = std::fs::read_link(path).ok()?;
    if target.to_string_lossy().contains("annex/objects") {
        return Some(("a link of git-annex whose content is not here".into(), Some(FETCH_ANNEX)));
    }
    let target = printable(&target.display().to_string());
    Some((format!("a link whose target {target} does not exist"), None))
}

/// The file's name without its folder.
pub(super) fn base_name(file: &str) -> String {
    let name = Path::new(file).file_name().map(|n| n.to_string_lossy().into_owned());
    name.unwrap_or_else(|| file.to_owned())
}

/// The first bytes of a regular file, at most `max_bytes`; `None` where it can't be read.
pub fn read_head(path: &Path, max_bytes: u64) -> Option<Vec<u8>> {
    let mut head = Vec::new();
    open_regular(path).ok()?.0.take(max_bytes).read_to_end(&mut head).ok()?;
    Some(head)
}

const FETCH_ANNEX: &str = "its content (fetch it first: git annex get)";

/// What a file that begins with `head` only stands for, and what to do: a pointer of git-annex or git-LFS, or the web
/// page that a server sent in the file's place.
pub(crate) fn stand_in(head: &[u8]) -> Option<(&'static str, &'static str)> {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    if head.starts_with(b"/annex/objects/") {
        return Some(("a git-annex pointer", FETCH_ANNEX));
    }
    if head.starts_with(b"version https://git-lfs.github.com/spec/")
        || head.starts_with(b"version https://hawser.github.com/spec/")
    {
        return Some(("a git-LFS pointer", "its content (fetch it first: git lfs pull)"));
    }
    let text = head.trim_ascii_start();
    let begins = |word: &[u8]| text.get(..word.len()).is_some_and(|t| t.eq_ignore_ascii_case(word));
    (begins(b"<!doctype html") || begins(b"<html")).then_some((
        "an HTML page",
        "the file itself (a server may have sent its login or error page instead)",
    ))
}

/// The whole content of a regular file of at most `max_bytes` bytes; `expected` describes the file in errors. Never
/// reads more, even if the file grows meanwhile.
///
/// # Errors
/// [`FileError::Wrong`] for a missing, unreadable or larger file, a folder, pipe or device, and for a pointer of
/// git-annex or git-LFS in the file's place.
pub fn read_small(path: &Path, max_bytes: u64, expected: &str) -> Result<Vec<u8>, FileError> {
    let name = || printable(&path.display().to_string());
    let (file, size) = open_regular(path)?;
    let too_large = |size: String| {
        FileError::wrong(name(), format!("{size} bytes"), format!("{expected} of at most {max_bytes} bytes"))
    };
    if size > max_bytes {
        return Err(too_large(size.to_string()));
    }
    let mut bytes = Vec::new();
    file.take(max_bytes.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(|e| FileError::wrong(name(), e.to_string(), expected))?;
    if bytes.len() as u64 > max_bytes {
        return Err(too_large(format!("more than {max_bytes}")));
    }
    match stand_in(&bytes) {
        Some((found, expected)) => Err(FileError::wrong(name(), found, expected)),
        None => Ok(bytes),
    }
}

/// As [`read_small`], for a text in UTF-8, whose byte order mark is left out.
///
/// # Errors
/// As [`read_small`]; also for bytes that are not UTF-8.
pub fn read_small_text(path: &Path, max_bytes: u64, expected: &str) -> Result<String, FileError> {
    let bytes = read_small(path, max_bytes, expected)?;
    let mut text = String::from_utf8(bytes).map_err(|e| {
        let found = format!("bytes that are not UTF-8 (at {})", e.utf8_error().valid_up_to());
        FileError::wrong(printable(&path.display().to_string()), found, expected)
    })?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::super::write_whole;
    use super::*;

    #[test]
    fn only_regular_files_within_the_limit_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let error = |name: &str, max: u64| read_small(&at(name), max, "a table").unwrap_err().to_string();
        write_whole(&at("five"), b"\xef\xbb\xbfab").unwrap();
        assert_eq!(read_small(&at("five"), 5, "a table").unwrap(), b"\xef\xbb\xbfab");
        assert_eq!(read_small_text(&at("five"), 5, "a table").unwrap(), "ab");
        assert!(error("five", 4).ends_with("found 5 bytes, expected a table of at most 4 bytes"));
        assert!(error("none", 5).contains("found no such file"));
        assert!(error(".", 5).contains("found a folder"));
        write_whole(&at("latin"), b"caf\xe9").unwrap();
        let latin = read_small_text(&at("latin"), 9, "a table").unwrap_err().to_string();
        assert!(latin.ends_with("found bytes that are not UTF-8 (at 3), expected a table"), "{latin}");
    }

    #[cfg(unix)]
    #[test]
    fn pipes_devices_and_broken_links_are_refused_without_waiting() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let error = |name: &str| read_small(&at(name), 99, "a table").unwrap_err().to_string();
        assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
        symlink("/dev/zero", at("endless")).unwrap();
        symlink("elsewhere.nii", at("broken")).unwrap();
        symlink("../.git/annex/objects/ab/cd/MD5E-s9--0.nii", at("annexed")).unwrap();
        assert!(error("pipe").contains("found a pipe or device, expected a file"));
        assert!(error("endless").contains("found a pipe or device, expected a file"));
        assert!(error("broken").contains("found a link whose target elsewhere.nii does not exist"));
        assert!(
            error("annexed").contains("a link of git-annex whose content is not here, expected its content")
        );
    }

    #[test]
    fn what_stands_in_a_files_place_is_recognised() {
        let of = |head: &[u8]| stand_in(head).map(|(found, _)| found);
        assert_eq!(of(b"/annex/objects/MD5E-s9--0.nii.gz\n"), Some("a git-annex pointer"));
        assert_eq!(of(b"version https://git-lfs.github.com/spec/v1\noid "), Some("a git-LFS pointer"));
        for page in ["<!DOCTYPE html>", "\u{feff}\r\n <HTML lang=en>", "<!doctype HTML PUBLIC"] {
            assert_eq!(of(page.as_bytes()), Some("an HTML page"), "{page}");
        }
        for other in [&b"\\\x01\0\0"[..], b"", b"<?xml version", b"version 2", b"/annex"] {
            assert_eq!(of(other), None);
        }
    }
}
