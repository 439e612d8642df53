//! Bytes of a plain or gzipped file, read once from front to back, never further than asked for.
//!
//! gzip (RFC 1952) is recognised by its two magic bytes, may have several members and zero padding
//! at its end, and is read to its end so that every CRC and length is compared.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use flate2::bufread::GzDecoder;

use super::{FileError, printable};
use crate::Progress;

/// Bytes past the last declared one that a gzip may inflate to before it is refused.
pub(crate) const SLACK_BYTES: u64 = 64 << 10;

/// Deflate's best ratio: 258 bytes for two bits (RFC 1951: one bit of length and of distance code).
pub(crate) const MAX_RATIO: u64 = 1032;

/// How much is read, converted and reported at once.
pub(crate) const CHUNK_BYTES: usize = 256 << 10;

trait Raw: BufRead + Seek {}
impl<T: BufRead + Seek> Raw for T {}

/// The file's own bytes, counted as they are used up.
struct Counted<'a> {
    inner: Box<dyn Raw + 'a>,
    used: u64,
}

impl Read for Counted<'_> {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(buf)?;
        self.used += n as u64;
        Ok(n)
    }
}

impl BufRead for Counted<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        self.used += amount as u64;
        self.inner.consume(amount);
    }
}

enum Body<'a> {
    Plain(Counted<'a>),
    Gzip(Box<GzDecoder<Counted<'a>>>),
    /// A gzip that is read to its end, or a reader that failed.
    Ended,
}

/// A file's content from front to back: plain bytes, or what its gzip members inflate to.
pub(crate) struct Stream<'a> {
    file: String,
    body: Body<'a>,
    gzip: bool,
    stored_bytes: u64,
    reported: u64,
    at: u64,
    progress: &'a Progress,
}

impl<'a> Stream<'a> {
    /// Opens a regular file; anything else (folder, pipe, device) is refused before it is opened.
    pub(crate) fn open(path: &Path, progress: &'a Progress) -> Result<Self, FileError> {
        let file = printable(&path.display().to_string());
        let fail = |e: &std::io::Error| FileError::Wrong {
            file: file.clone(),
            found: if e.kind() == ErrorKind::NotFound { "no such file".into() } else { e.to_string() },
            expected: "a file that can be read".into(),
        };
        let meta = std::fs::metadata(path).map_err(|e| fail(&e))?;
        if !meta.is_file() {
            let found = if meta.is_dir() { "a folder" } else { "a pipe or device" };
            return Err(FileError::wrong(file, found, "a file"));
        }
        let inner = File::open(path).map_err(|e| fail(&e))?;
        Self::new(file, Box::new(BufReader::with_capacity(CHUNK_BYTES, inner)), meta.len(), progress)
    }

    /// Reads from memory.
    pub(crate) fn of_bytes(name: &str, bytes: &'a [u8], progress: &'a Progress) -> Result<Self, FileError> {
        Self::new(printable(name), Box::new(std::io::Cursor::new(bytes)), bytes.len() as u64, progress)
    }

    fn new(
        file: String,
        mut inner: Box<dyn Raw + 'a>,
        stored_bytes: u64,
        progress: &'a Progress,
    ) -> Result<Self, FileError> {
        let magic = inner.fill_buf().map_err(|e| FileError::wrong(&file, e.to_string(), "readable bytes"))?;
        let gzip = magic.starts_with(&[0x1f, 0x8b]);
        let counted = Counted { inner, used: 0 };
        let body = if gzip { Body::Gzip(Box::new(GzDecoder::new(counted))) } else { Body::Plain(counted) };
        progress.expect(stored_bytes);
        Ok(Self { file, body, gzip, stored_bytes, reported: 0, at: 0, progress })
    }

    /// What messages call the file.
    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// Whether the file is gzipped.
    pub(crate) fn is_gzip(&self) -> bool {
        self.gzip
    }

    /// Content bytes read or skipped so far.
    pub(crate) fn at(&self) -> u64 {
        self.at
    }

    /// Bytes behind those read so far; of a gzip, an idea only: its stored bytes.
    pub(crate) fn left(&self) -> u64 {
        self.stored_bytes.saturating_sub(self.at)
    }

    /// Says that the last `bytes` read were not used: they count as left over.
    pub(crate) fn unread(&mut self, bytes: u64) {
        self.at = self.at.saturating_sub(bytes);
    }

    /// Refuses a claim of `declared` content bytes that the file's length rules out: a plain file
    /// that is shorter, or a gzip that could not hold them even at deflate's best ratio.
    pub(crate) fn can_hold(&self, declared: u64) -> Result<(), FileError> {
        let most = if self.gzip { self.stored_bytes.saturating_mul(MAX_RATIO) } else { self.stored_bytes };
        if declared <= most {
            return Ok(());
        }
        let found = if self.gzip {
            format!("{} bytes of gzip, which inflate to {most} at most", self.stored_bytes)
        } else {
            format!("{} bytes", self.stored_bytes)
        };
        Err(FileError::wrong(&self.file, found, format!("the {declared} bytes that its header declares")))
    }

    /// Fills as much of `buf` as the file has left and says how much that was.
    pub(crate) fn fill(&mut self, buf: &mut [u8]) -> Result<usize, FileError> {
        let mut filled = 0;
        while filled < buf.len() {
            let n = self.read_some(&mut buf[filled..])?;
            if n == 0 {
                break;
            }
            filled += n;
            self.at += n as u64;
        }
        self.report()?;
        Ok(filled)
    }

    /// Fills all of `buf`; the file ending early is an error that says `expected`.
    pub(crate) fn fill_all(&mut self, buf: &mut [u8], expected: &str) -> Result<(), FileError> {
        if self.fill(buf)? == buf.len() { Ok(()) } else { Err(self.ends_early(expected)) }
    }

    /// Passes over `bytes`; the file ending early is an error that says `expected`.
    pub(crate) fn skip(&mut self, bytes: u64, expected: &str) -> Result<(), FileError> {
        if let Body::Plain(counted) = &mut self.body {
            let to = self.at.saturating_add(bytes);
            if to > self.stored_bytes {
                self.at = self.stored_bytes;
                return Err(self.ends_early(expected));
            }
            let sought = counted.inner.seek(SeekFrom::Start(to));
            sought.map_err(|e| FileError::wrong(&self.file, e.to_string(), expected))?;
            counted.used = to;
            self.at = to;
            return self.report();
        }
        let mut scratch = vec![0; CHUNK_BYTES.min(usize::try_from(bytes).unwrap_or(CHUNK_BYTES))];
        let mut left = bytes;
        while left > 0 {
            let part = scratch.len().min(usize::try_from(left).unwrap_or(usize::MAX));
            self.fill_all(&mut scratch[..part], expected)?;
            left -= part as u64;
        }
        Ok(())
    }

    /// Goes to the end, which for a gzip compares its last CRC, and says how many bytes were left.
    /// A gzip with more than [`SLACK_BYTES`] left is refused without inflating them.
    pub(crate) fn finish(mut self) -> Result<u64, FileError> {
        let left = if self.gzip {
            let mut scratch = [0; 4096];
            let mut left = 0;
            loop {
                let n = self.fill(&mut scratch)? as u64;
                left += n;
                if n == 0 {
                    break left;
                }
                if left > SLACK_BYTES {
                    let found = format!("a gzip that inflates to more than {} bytes", self.at);
                    let expected = format!("{}, as its header declares", self.at - left);
                    return Err(FileError::wrong(self.file, found, expected));
                }
            }
        } else {
            self.stored_bytes.saturating_sub(self.at)
        };
        self.progress.advance(self.stored_bytes.saturating_sub(self.reported))?;
        Ok(left)
    }

    /// The error of a file that has no more than [`Self::at`] bytes.
    pub(crate) fn ends_early(&self, expected: &str) -> FileError {
        let found = match (self.at, self.gzip) {
            (0, _) => "an empty file".to_owned(),
            (at, false) => format!("the end of the file after {at} bytes"),
            (at, true) => format!("the end of the gzip after {at} inflated bytes"),
        };
        FileError::wrong(&self.file, found, expected)
    }

    fn read_some(&mut self, buf: &mut [u8]) -> Result<usize, FileError> {
        loop {
            let read = match &mut self.body {
                Body::Plain(plain) => plain.read(buf),
                Body::Gzip(member) => member.read(buf),
                Body::Ended => return Ok(0),
            };
            match read {
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(self.broken(&e)),
                Ok(0) if self.gzip => self.next_member()?,
                Ok(n) => return Ok(n),
            }
            // A file may be a million empty members: stop must work inside this loop too.
            self.progress.check()?;
        }
    }

    /// After a member's end: the next member, zero padding up to the end, or the end.
    fn next_member(&mut self) -> Result<(), FileError> {
        let Body::Gzip(member) = std::mem::replace(&mut self.body, Body::Ended) else { return Ok(()) };
        let mut rest = member.into_inner();
        loop {
            let next = rest.fill_buf().map_err(|e| self.broken(&e))?;
            match next.first() {
                None => {
                    self.count_used(rest.used)?;
                    return Ok(());
                }
                Some(0x1f) => {
                    self.body = Body::Gzip(Box::new(GzDecoder::new(rest)));
                    return Ok(());
                }
                Some(0) => {
                    let zeros = next.iter().take_while(|&&b| b == 0).count();
                    rest.consume(zeros);
                    self.progress.check()?;
                }
                Some(_) => {
                    return Err(FileError::wrong(
                        &self.file,
                        "other bytes after the gzip's end",
                        "the file's end or another gzip member",
                    ));
                }
            }
        }
    }

    fn broken(&self, e: &std::io::Error) -> FileError {
        let found = match (self.gzip, e.kind()) {
            (true, ErrorKind::UnexpectedEof) => {
                format!("a gzip that is cut off after {} inflated bytes", self.at)
            }
            (true, ErrorKind::InvalidInput | ErrorKind::InvalidData) => {
                format!("a damaged gzip ({e})")
            }
            _ => e.to_string(),
        };
        FileError::wrong(&self.file, found, if self.gzip { "a whole gzip" } else { "readable bytes" })
    }

    fn report(&mut self) -> Result<(), FileError> {
        let used = match &self.body {
            Body::Plain(plain) => plain.used,
            Body::Gzip(member) => member.get_ref().used,
            Body::Ended => return Ok(self.progress.check()?),
        };
        self.count_used(used)
    }

    fn count_used(&mut self, used: u64) -> Result<(), FileError> {
        let new = used.saturating_sub(self.reported);
        self.reported += new;
        Ok(self.progress.advance(new)?)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn gz(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::new(6));
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn all(bytes: &[u8], declared: usize) -> Result<(Vec<u8>, u64), FileError> {
        let progress = Progress::new();
        let mut stream = Stream::of_bytes("t", bytes, &progress)?;
        let mut out = vec![0; declared];
        stream.fill_all(&mut out, "all")?;
        let left = stream.finish()?;
        assert_eq!(progress.fraction().unwrap_or(1.0), 1.0);
        Ok((out, left))
    }

    #[test]
    fn members_padding_and_rest() {
        let one = gz(b"hello ");
        let two = gz(b"world");
        let mut file = [one, gz(b""), two].concat();
        assert_eq!(all(&file, 11).unwrap(), (b"hello world".to_vec(), 0));
        assert_eq!(all(&file, 6).unwrap(), (b"hello ".to_vec(), 5));
        file.extend([0; 700]);
        assert_eq!(all(&file, 11).unwrap().1, 0);
        file.push(7);
        assert!(all(&file, 11).unwrap_err().to_string().contains("after the gzip's end"));
        assert!(all(b"plain", 5).is_ok());
        assert!(all(b"plain", 6).unwrap_err().to_string().contains("after 5 bytes"));
    }

    #[test]
    fn every_cut_and_every_flipped_trailer_bit_is_an_error() {
        let text: Vec<u8> = (0..2000u32).map(|i| (i * i % 251) as u8).collect();
        let file = gz(&text);
        assert_eq!(all(&file, text.len()).unwrap().0, text);
        for cut in 2..file.len() {
            assert!(all(&file[..cut], text.len()).is_err(), "cut at {cut}");
        }
        for bit in 0..64 {
            let mut bad = file.clone();
            let byte = file.len() - 8 + bit / 8;
            bad[byte] ^= 1 << (bit % 8);
            assert!(all(&bad, text.len()).is_err(), "trailer bit {bit}");
        }
    }

    #[test]
    fn a_gzip_may_not_outgrow_its_declaration() {
        let file = gz(&vec![0; 100 + SLACK_BYTES as usize]);
        assert_eq!(all(&file, 100).unwrap().1, SLACK_BYTES);
        let file = gz(&vec![0; 8192 + SLACK_BYTES as usize]);
        assert!(all(&file, 100).unwrap_err().to_string().contains("inflates to more than"));
    }

    #[test]
    fn a_claim_beyond_the_best_ratio_is_refused() {
        let zeros = vec![0u8; 4 << 20];
        let file = gz(&zeros);
        let progress = Progress::new();
        let stream = Stream::of_bytes("t", &file, &progress).unwrap();
        assert!(stream.can_hold(zeros.len() as u64).is_ok(), "{} bytes", file.len());
        assert!(stream.can_hold(file.len() as u64 * MAX_RATIO + 1).is_err());
    }

    #[test]
    fn cancel_stops_at_once() {
        let progress = Progress::new();
        let file = gz(&[1; 50]);
        let mut stream = Stream::of_bytes("t", &file, &progress).unwrap();
        progress.cancel();
        assert_eq!(stream.fill(&mut [0; 10]), Err(FileError::Cancelled(crate::Cancelled)));
    }
}
