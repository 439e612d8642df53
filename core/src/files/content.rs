//! Whole small files, and the identity of a file by its content.

use std::{
    fs::File,
    io::Read as _,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{FileError, printable};
use crate::{Progress, digest::Digest};

/// Number of bytes hashed at a time.
const BLOCK_BYTES: u64 = 1 << 20;

/// Opens a regular file. Folders, devices and pipes are refused before they are opened: opening a pipe waits for a writer.
fn open_regular(path: &Path, expected: &str) -> Result<(File, u64), FileError> {
    let name = || printable(&path.display().to_string());
    let wrong = |found: String| FileError::wrong(name(), found, expected);
    let metadata = path.metadata().map_err(|e| wrong(e.to_string()))?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(wrong(found.into()));
    }
    Ok((File::open(path).map_err(|e| wrong(e.to_string()))?, metadata.len()))
}

/// The bytes of a regular file of at most `max_bytes`; `expected` says what it should be, for the error.
///
/// # Errors
/// [`FileError::Wrong`] for a folder, device or pipe, a larger file, and one that can't be read.
pub fn read_small(path: &Path, max_bytes: u64, expected: &str) -> Result<Vec<u8>, FileError> {
    let (file, size) = open_regular(path, expected)?;
    let name = || printable(&path.display().to_string());
    let mut bytes = Vec::new();
    // Files of /proc and /sys claim another length than they have.
    if size <= max_bytes {
        let read = file.take(max_bytes + 1).read_to_end(&mut bytes);
        read.map_err(|e| FileError::wrong(name(), e.to_string(), expected))?;
    }
    let size = size.max(bytes.len() as u64);
    if size > max_bytes {
        let found = format!("{size} bytes");
        return Err(FileError::wrong(name(), found, format!("{expected} of at most {max_bytes} bytes")));
    }
    Ok(bytes)
}

/// Size and hash of a file, by which it is recognised at another place.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileMark {
    /// The file, for messages.
    pub file: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// 128 bits of all its bytes, as hexadecimal digits ([`Digest`]).
    pub hash: String,
}

impl FileMark {
    /// The mark of a file: reads all of it.
    ///
    /// # Errors
    /// [`FileError`] where it is no regular file, can't be read, or the user cancels.
    pub fn of(path: &Path, progress: &Progress) -> Result<Self, FileError> {
        let expected = "a file that can be read";
        let (mut file, _) = open_regular(path, expected)?;
        let (mut digest, mut bytes, mut block) = (Digest::new(), 0, Vec::new());
        loop {
            progress.check()?;
            block.clear();
            let read = file.by_ref().take(BLOCK_BYTES).read_to_end(&mut block);
            read.map_err(|e| {
                FileError::wrong(printable(&path.display().to_string()), e.to_string(), expected)
            })?;
            if block.is_empty() {
                break;
            }
            bytes += block.len() as u64;
            digest.bytes(&block);
        }
        let [a, b] = digest.finish();
        Ok(Self { file: path.to_owned(), bytes, hash: format!("{a:016x}{b:016x}") })
    }

    /// The marks of files, several at a time.
    ///
    /// # Errors
    /// As [`FileMark::of`].
    pub fn of_all(paths: &[PathBuf], progress: &Progress) -> Result<Vec<Self>, FileError> {
        paths.par_iter().map(|path| Self::of(path, progress)).collect()
    }

    /// Whether both are of the same content.
    pub fn same_content(&self, other: &Self) -> bool {
        (self.bytes, &self.hash) == (other.bytes, &other.hash)
    }
}

/// The other files that belong to `path`: of a NIfTI pair of `.hdr` and `.img`, each gzipped or not, the other half.
pub fn companions(path: &Path) -> Vec<PathBuf> {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let plain = name.strip_suffix(".gz").unwrap_or(&name);
    let Some((stem, ending)) = plain.rsplit_once('.') else { return Vec::new() };
    let other = match ending.to_lowercase().as_str() {
        "hdr" => "img",
        "img" => "hdr",
        _ => return Vec::new(),
    };
    let endings = [other.to_owned(), other.to_uppercase(), format!("{other}.gz")];
    let paths = endings.iter().map(|ending| path.with_file_name(format!("{stem}.{ending}")));
    paths.filter(|path| path.is_file()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_whole;

    #[test]
    fn only_small_regular_files_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        write_whole(&path, b"12345").unwrap();
        assert_eq!(read_small(&path, 5, "a note").unwrap(), b"12345");
        let error = |path: &Path| read_small(path, 4, "a note").unwrap_err().to_string();
        assert!(
            error(&path).ends_with("a: found 5 bytes, expected a note of at most 4 bytes"),
            "{}",
            error(&path)
        );
        assert!(error(folder.path()).contains("found a folder, expected a note"));
        assert!(error(Path::new("/dev/zero")).contains("found a device or a pipe"));
    }

    #[test]
    fn marks_are_equal_for_equal_contents_alone() {
        let folder = tempfile::tempdir().unwrap();
        let mark = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            write_whole(&path, bytes).unwrap();
            FileMark::of(&path, &Progress::new()).unwrap()
        };
        let mut bytes: Vec<u8> = (0..3 << 20_u32).map(|i: u32| (i % 251) as u8).collect();
        let first = mark("a", &bytes);
        assert!(first.same_content(&mark("b", &bytes)));
        assert_eq!(first.bytes, 3 << 20);
        for at in [0, 1 << 20, (3 << 20) - 1] {
            bytes[at] ^= 1;
            assert!(!first.same_content(&mark("c", &bytes)), "byte {at}");
            bytes[at] ^= 1;
        }
        assert!(!first.same_content(&mark("d", &bytes[1..])));
        write_whole(&folder.path().join("x.hdr"), b"").unwrap();
        assert_eq!(companions(&folder.path().join("x.img.gz")), [folder.path().join("x.hdr")]);
        assert!(companions(&folder.path().join("a.nii")).is_empty());
    }
}
