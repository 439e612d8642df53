//! The body of a store request: files between boundaries, read from disk while they are sent.

use std::fs::File;
use std::hash::{BuildHasher as _, RandomState};
use std::io::{self, Read};
use std::path::PathBuf;

use crate::client::Cancel;

/// Part of a body.
enum Piece {
    Text(Vec<u8>),
    /// A file of so many bytes.
    File(PathBuf, u64),
}

/// A body of known length.
pub(crate) struct Upload<'a> {
    /// What is to be sent, in reverse.
    pieces: Vec<Piece>,
    open: Option<Box<dyn Read>>,
    /// Bytes left of the open piece.
    left: u64,
    sent: &'a dyn Fn(u64),
    cancel: Cancel<'a>,
    /// The file that couldn't be read as it was when the request began.
    pub broken: Option<PathBuf>,
}

/// A boundary that no file has: 128 random bits.
pub(crate) fn random_boundary() -> String {
    let random = || RandomState::new().hash_one(0);
    format!("glioscope-{:016x}{:016x}", random(), random())
}

impl<'a> Upload<'a> {
    /// The body of `files` with their lengths, and its own length in bytes; `sent` is told how many bytes more were read.
    pub fn new(
        files: &[(PathBuf, u64)],
        boundary: &str,
        sent: &'a dyn Fn(u64),
        cancel: Cancel<'a>,
    ) -> (Self, u64) {
        let mut pieces = Vec::with_capacity(2 * files.len() + 1);
        let (mut length, mut line_break) = (0, "");
        for (path, bytes) in files {
            let head =
                format!("{line_break}--{boundary}\r\nContent-Type: application/dicom\r\n\r\n").into_bytes();
            length += head.len() as u64 + bytes;
            pieces.extend([Piece::Text(head), Piece::File(path.clone(), *bytes)]);
            line_break = "\r\n";
        }
        let end = format!("{line_break}--{boundary}--\r\n").into_bytes();
        length += end.len() as u64;
        pieces.push(Piece::Text(end));
        pieces.reverse();
        (Self { pieces, open: None, left: 0, sent, cancel, broken: None }, length)
    }
}

impl Read for Upload<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if (self.cancel)() {
            return Err(io::Error::other("cancelled"));
        }
        loop {
            if let Some(open) = self.open.as_mut().filter(|_| self.left > 0) {
                // A file that grew ends where its length was.
                let most = usize::try_from(self.left).unwrap_or(usize::MAX).min(out.len());
                let read = open.read(&mut out[..most]);
                if !out.is_empty() && !matches!(read, Ok(1..)) {
                    if let Some(Piece::File(path, _)) = self.pieces.last() {
                        self.broken = Some(path.clone());
                    }
                    return Err(read.err().unwrap_or_else(|| io::Error::other("a file that became shorter")));
                }
                let read = read?;
                self.left -= read as u64;
                (self.sent)(read as u64);
                return Ok(read);
            }
            if self.open.take().is_some() {
                self.pieces.pop();
            }
            match self.pieces.last_mut() {
                None => return Ok(0),
                Some(Piece::Text(text)) => {
                    self.left = text.len() as u64;
                    self.open = Some(Box::new(io::Cursor::new(std::mem::take(text))));
                }
                Some(Piece::File(path, bytes)) => {
                    self.left = *bytes;
                    let opened = File::open(&*path).inspect_err(|_| self.broken = Some(path.clone()));
                    self.open = Some(Box::new(opened?));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::io::Write as _;

    use super::*;

    #[test]
    fn bodies_are_as_long_as_they_say_even_if_files_grow() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(b"abcdef").unwrap();
        let path = file.path().to_owned();
        let total = Cell::new(0);
        let count = |bytes| total.set(total.get() + bytes);
        let files = [(path.clone(), 3), (path.clone(), 0), (path.clone(), 6)];
        let (mut upload, length) = Upload::new(&files, "b", &count, &|| false);
        let mut text = String::new();
        upload.read_to_string(&mut text).unwrap();
        let head = "--b\r\nContent-Type: application/dicom\r\n\r\n";
        assert_eq!(text, format!("{head}abc\r\n{head}\r\n{head}abcdef\r\n--b--\r\n"));
        assert_eq!((length, total.get()), (text.len() as u64, text.len() as u64));
        let (mut upload, _) = Upload::new(&[(path.clone(), 7)], "b", &count, &|| false);
        assert!(upload.read_to_string(&mut String::new()).is_err());
        assert_eq!(upload.broken, Some(path));
        let (mut upload, _) = Upload::new(&files, "b", &count, &|| true);
        assert!(upload.read_to_string(&mut String::new()).is_err());
    }

    #[test]
    fn boundaries_differ() {
        assert_ne!(random_boundary(), random_boundary());
    }
}
