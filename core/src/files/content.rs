//! The identity of a file by its content.

use std::{
    io::Read as _,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{FileError, open_regular, printable};
use crate::{Progress, digest::Digest};

/// Number of bytes hashed at a time.
const BLOCK_BYTES: u64 = 1 << 20;

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
        let (mut file, _) = open_regular(path)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_whole;

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
    }
}
