//! Text headers in front of voxels: their lines, bounded, and where they end.

use super::{
    FileError,
    bounded_gzip::{CHUNK_BYTES, Stream},
    stored_file::Place,
};
use crate::Progress;

/// Most bytes of a header: the longest real ones, of segmentations with terminology, have a few hundred kilobytes.
const MAX_HEADER_BYTES: u64 = 4 << 20;

/// The lines of a file's text header.
pub(super) struct Lines<'a> {
    stream: Stream<'a>,
    format: &'static str,
    buffer: Vec<u8>,
    at: usize,
    position: u64,
}

impl<'a> Lines<'a> {
    /// Opens the file; one that is gzipped as a whole is refused.
    pub(super) fn open(
        place: &'a Place<'_>,
        format: &'static str,
        progress: &'a Progress,
    ) -> Result<Self, FileError> {
        let stream = match place {
            Place::File(path) => Stream::open(path, progress)?,
            Place::Bytes(name, bytes) => Stream::of_bytes(name, bytes, progress)?,
        };
        if stream.is_gzip() {
            let expected = format!("a {format} file, of which at most the voxels are compressed");
            return Err(FileError::wrong(stream.file(), "a gzip", expected));
        }
        Ok(Self { stream, format, buffer: Vec::new(), at: 0, position: 0 })
    }

    /// The file's name in messages.
    pub(super) fn file(&self) -> &str {
        self.stream.file()
    }

    /// Bytes of the lines so far: the offset of what follows them.
    pub(super) fn position(&self) -> u64 {
        self.position
    }

    /// The next line without its end (LF or CR LF); `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<String>, FileError> {
        let mut searched = 0;
        loop {
            let rest = &self.buffer[self.at..];
            if let Some(end) = rest[searched..].iter().position(|&b| b == b'\n').map(|at| searched + at) {
                let line = text(&rest[..end]);
                self.at += end + 1;
                self.position += end as u64 + 1;
                return Ok(Some(line));
            }
            searched = rest.len();
            if self.position + searched as u64 > MAX_HEADER_BYTES {
                let found = format!("no end of the header within {MAX_HEADER_BYTES} bytes");
                return Err(FileError::wrong(self.file(), found, format!("the header of {}", self.format)));
            }
            if !self.more()? {
                let rest = &self.buffer[self.at..];
                let line = (!rest.is_empty()).then(|| text(rest));
                self.position += rest.len() as u64;
                self.at = self.buffer.len();
                return Ok(line);
            }
        }
    }

    /// Reads on; `false` at the end of the file.
    fn more(&mut self) -> Result<bool, FileError> {
        self.buffer.drain(..self.at);
        self.at = 0;
        let old_len = self.buffer.len();
        self.buffer.resize(old_len + CHUNK_BYTES, 0);
        let read_len = self.stream.fill(&mut self.buffer[old_len..])?;
        self.buffer.truncate(old_len + read_len);
        Ok(read_len > 0)
    }
}

fn text(line: &[u8]) -> String {
    String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)).into_owned()
}

/// The numbers of a list separated by white space; `None` where a word is none.
pub(super) fn numbers(list: &str) -> Option<Vec<f64>> {
    list.split_whitespace().map(|word| word.parse().ok()).collect()
}

/// The sizes of axes, each at least 1; `None` where a word is no such number.
pub(super) fn sizes(list: &str) -> Option<Vec<u64>> {
    list.split_whitespace().map(|word| word.parse().ok().filter(|&size| size > 0)).collect()
}

/// A header's text for a message: one short line.
pub(super) fn quoted(text: &str) -> String {
    const MOST: usize = 80;
    if text.chars().any(|c| c.is_control() && c != '\t') {
        return "bytes that are no text".into();
    }
    let short: String = text.chars().take(MOST).collect();
    let more = if text.chars().nth(MOST).is_some() { "…" } else { "" };
    format!("\"{}{more}\"", super::printable(&short))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(bytes: &[u8]) -> (Vec<String>, u64) {
        let (place, progress) = (Place::Bytes("t", bytes), Progress::new());
        let mut lines = Lines::open(&place, "NRRD", &progress).unwrap();
        let mut all = Vec::new();
        while let Some(line) = lines.next().unwrap() {
            all.push(line);
        }
        (all, lines.position())
    }

    #[test]
    fn lines_end_in_lf_or_cr_lf_and_the_last_one_anyhow() {
        assert_eq!(lines(b"a\r\nb\n\n c"), (vec!["a".into(), "b".into(), String::new(), " c".into()], 8));
        assert_eq!(lines(b"a\n").0, ["a"]);
        let long = vec![b'x'; 3 * CHUNK_BYTES];
        assert_eq!(lines(&long).0[0].len(), long.len());
    }

    #[test]
    fn a_header_without_end_is_refused() {
        let endless = vec![b'x'; MAX_HEADER_BYTES as usize + 2 * CHUNK_BYTES];
        let (place, progress) = (Place::Bytes("t", &endless), Progress::new());
        let error = Lines::open(&place, "NRRD", &progress).unwrap().next().unwrap_err().to_string();
        assert!(error.starts_with("t: found no end of the header"), "{error}");
    }

    #[test]
    fn lists_of_numbers_and_sizes() {
        assert_eq!(numbers(" 1  -2.5e1 "), Some(vec![1.0, -25.0]));
        assert_eq!(numbers("1 x"), None);
        assert_eq!(sizes("31 61"), Some(vec![31, 61]));
        for bad in ["0", "-1", "1.5", "a"] {
            assert_eq!(sizes(bad), None, "{bad}");
        }
        assert!(quoted(&"y".repeat(99)).len() < 90 && !quoted("a\tb").contains('\t'));
        assert_eq!(quoted("\0\u{1}"), "bytes that are no text");
    }
}
