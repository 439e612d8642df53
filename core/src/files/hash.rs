//! SHA-256 of files and bytes.

use std::{io::Read, path::Path};

use sha2::{Digest, Sha256};

use crate::Progress;

use super::{FileError, opened::open_regular, printable};

/// Bytes that are hashed at once.
const BLOCK_BYTES: usize = 1 << 20;

/// Size of a regular file in bytes, and the SHA-256 of its content in lower-case hexadecimal digits.
///
/// # Errors
/// [`FileError`] where it can't be read; [`FileError::Cancelled`] when `progress` is cancelled.
pub fn sha256_of(path: &Path, progress: &Progress) -> Result<(u64, String), FileError> {
    let (mut file, _) = open_regular(path)?;
    let (mut hash, mut block, mut bytes) = (Sha256::new(), vec![0; BLOCK_BYTES], 0);
    loop {
        progress.check()?;
        let read = file.read(&mut block).map_err(|e| {
            FileError::wrong(printable(&path.display().to_string()), e.to_string(), "a file that can be read")
        })?;
        if read == 0 {
            return Ok((bytes, digits(&hash.finalize())));
        }
        hash.update(&block[..read]);
        bytes += read as u64;
    }
}

/// SHA-256 of bytes in lower-case hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    digits(&Sha256::digest(bytes))
}

fn digits(hash: &[u8]) -> String {
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_the_standard_however_long_the_file_is() {
        // FIPS 180-2: of "abc", and of a million letters a.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        for (text, expected) in [
            (b"abc".to_vec(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"),
            (vec![b'a'; 1_000_000], "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0"),
        ] {
            super::super::write_whole(&path, &text).unwrap();
            assert_eq!(sha256_of(&path, &Progress::new()).unwrap(), (text.len() as u64, expected.to_owned()));
            assert_eq!(sha256(&text), expected);
        }
        let stop = Progress::new();
        stop.cancel();
        assert!(matches!(sha256_of(&path, &stop), Err(FileError::Cancelled(_))));
    }
}
