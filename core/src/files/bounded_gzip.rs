//! Sequential reading of a plain or packed file, never further than requested.
//!
//! gzip (RFC 1952) is recognised by its two magic bytes, may have several members and trailing zero padding, and is
//! read to its end so that every CRC and length is verified. zlib (RFC 1950) and bzip2 have no such mark of their own:
//! a header names them.

use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use bzip2::bufread::MultiBzDecoder;
use flate2::bufread::{GzDecoder, ZlibDecoder};

use super::opened::{open_regular, stand_in};
use super::{FileError, printable};
use crate::Progress;

/// Bytes beyond its declared content that a gzip may inflate to before it is refused.
pub(crate) const SLACK_BYTES: u64 = 64 << 10;

/// Deflate's maximum compression ratio: 258 bytes for two bits (RFC 1951: one bit of length and of distance code).
pub(crate) const MAX_RATIO: u64 = 1032;

/// Bytes read, converted and reported at once.
pub(crate) const CHUNK_BYTES: usize = 256 << 10;

trait Raw: BufRead + Seek {}
impl<T: BufRead + Seek> Raw for T {}

/// The file's stored bytes, counted as they are consumed.
struct Counted<'a> {
    inner: Box<dyn Raw + 'a>,
    consumed: u64,
}

impl Read for Counted<'_> {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(buf)?;
        self.consumed += n as u64;
        Ok(n)
    }
}

impl BufRead for Counted<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        self.consumed += amount as u64;
        self.inner.consume(amount);
    }
}

enum Body<'a> {
    Plain(Counted<'a>),
    Gzip(Box<GzDecoder<Counted<'a>>>),
    Zlib(Box<ZlibDecoder<Counted<'a>>>),
    Bzip2(Box<MultiBzDecoder<Counted<'a>>>),
    /// A gzip read to its end, or a reader that failed.
    Ended,
}

/// How bytes are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Packing {
    /// Not at all.
    Plain,
    /// RFC 1952.
    Gzip,
    /// RFC 1950.
    Zlib,
    /// By blocks; a block of zeros has no useful limit on its ratio.
    Bzip2,
}

impl Packing {
    /// Its name in messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Plain => "file",
            Self::Gzip => "gzip",
            Self::Zlib => "zlib stream",
            Self::Bzip2 => "bzip2 stream",
        }
    }
}

/// A file's content as a stream: plain bytes, or the unpacked ones.
pub(crate) struct Stream<'a> {
    file: String,
    body: Body<'a>,
    packing: Packing,
    /// Offset in the file of the first byte that belongs to the stream.
    start: u64,
    /// Bytes in the file from `start` on.
    stored_bytes: u64,
    reported: u64,
    position: u64,
    progress: &'a Progress,
}

impl<'a> Stream<'a> {
    /// Opens a regular file; anything else (folder, pipe, device) is refused before it is opened.
    pub(crate) fn open(path: &Path, progress: &'a Progress) -> Result<Self, FileError> {
        let (inner, bytes) = open_regular(path)?;
        let file = printable(&path.display().to_string());
        Self::new(file, Box::new(BufReader::with_capacity(CHUNK_BYTES, inner)), bytes, progress)
    }

    /// Reads a regular file from offset `start` on, packed as its header says and not as its bytes look: voxels may
    /// begin with any.
    pub(crate) fn open_at(
        path: &Path,
        start: u64,
        packing: Packing,
        progress: &'a Progress,
    ) -> Result<Self, FileError> {
        let (inner, bytes) = open_regular(path)?;
        let file = printable(&path.display().to_string());
        let inner = Box::new(BufReader::with_capacity(CHUNK_BYTES, inner));
        Self::from_offset(file, inner, bytes, start, packing, progress)
    }

    /// As [`Stream::open_at`], from memory.
    pub(crate) fn of_bytes_at(
        name: &str,
        bytes: &'a [u8],
        start: u64,
        packing: Packing,
        progress: &'a Progress,
    ) -> Result<Self, FileError> {
        let inner = Box::new(std::io::Cursor::new(bytes));
        Self::from_offset(printable(name), inner, bytes.len() as u64, start, packing, progress)
    }

    fn from_offset(
        file: String,
        mut inner: Box<dyn Raw + 'a>,
        bytes: u64,
        start: u64,
        packing: Packing,
        progress: &'a Progress,
    ) -> Result<Self, FileError> {
        if start > bytes {
            let found = format!("the end of the file after {bytes} bytes");
            return Err(FileError::wrong(file, found, format!("voxels from byte {start} on")));
        }
        let seek_result = inner.seek(SeekFrom::Start(start));
        seek_result.map_err(|e| FileError::wrong(&file, e.to_string(), "readable bytes"))?;
        Ok(Self::packed(file, inner, packing, (start, bytes - start), progress))
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
        if let Some((found, expected)) = stand_in(magic) {
            return Err(FileError::wrong(file, found, expected));
        }
        let packing = if magic.starts_with(&[0x1f, 0x8b]) { Packing::Gzip } else { Packing::Plain };
        Ok(Self::packed(file, inner, packing, (0, stored_bytes), progress))
    }

    fn packed(
        file: String,
        inner: Box<dyn Raw + 'a>,
        packing: Packing,
        (start, stored_bytes): (u64, u64),
        progress: &'a Progress,
    ) -> Self {
        let counted = Counted { inner, consumed: 0 };
        let body = match packing {
            Packing::Plain => Body::Plain(counted),
            Packing::Gzip => Body::Gzip(Box::new(GzDecoder::new(counted))),
            Packing::Zlib => Body::Zlib(Box::new(ZlibDecoder::new(counted))),
            Packing::Bzip2 => Body::Bzip2(Box::new(MultiBzDecoder::new(counted))),
        };
        progress.expect(stored_bytes);
        Self { file, body, packing, start, stored_bytes, reported: 0, position: 0, progress }
    }

    /// The file's name in messages.
    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// Whether the file is gzipped.
    pub(crate) fn is_gzip(&self) -> bool {
        self.packing == Packing::Gzip
    }

    /// Content bytes read or skipped so far.
    pub(crate) fn position(&self) -> u64 {
        self.position
    }

    /// Stored bytes after the current position; for a gzip a rough estimate, as the position counts inflated bytes.
    pub(crate) fn remaining(&self) -> u64 {
        self.stored_bytes.saturating_sub(self.position)
    }

    /// Marks the last `bytes` read as unused: they count as trailing bytes.
    pub(crate) fn unread(&mut self, bytes: u64) {
        self.position = self.position.saturating_sub(bytes);
    }

    /// Refuses a claim of `declared` content bytes that the file's length rules out: a plain file
    /// that is shorter, or a gzip that could not hold them even at deflate's maximum ratio.
    pub(crate) fn can_hold(&self, declared: u64) -> Result<(), FileError> {
        let max_bytes = match self.packing {
            Packing::Plain => self.stored_bytes,
            Packing::Gzip | Packing::Zlib => self.stored_bytes.saturating_mul(MAX_RATIO),
            Packing::Bzip2 => u64::MAX,
        };
        if declared <= max_bytes {
            return Ok(());
        }
        let found = match self.packing {
            Packing::Plain => format!("{} bytes", self.stored_bytes),
            packing => {
                let name = packing.name();
                format!("{} bytes of {name}, which inflate to {max_bytes} at most", self.stored_bytes)
            }
        };
        Err(FileError::wrong(&self.file, found, format!("the {declared} bytes that its header declares")))
    }

    /// Fills as much of `buf` as the file still has and returns the number of bytes.
    pub(crate) fn fill(&mut self, buf: &mut [u8]) -> Result<usize, FileError> {
        let mut filled = 0;
        while filled < buf.len() {
            let n = self.read_some(&mut buf[filled..])?;
            if n == 0 {
                break;
            }
            filled += n;
            self.position += n as u64;
        }
        self.report()?;
        Ok(filled)
    }

    /// Fills all of `buf`; a truncated file is an error that states `expected`.
    pub(crate) fn fill_all(&mut self, buf: &mut [u8], expected: &str) -> Result<(), FileError> {
        if self.fill(buf)? == buf.len() { Ok(()) } else { Err(self.ends_early(expected)) }
    }

    /// Skips `bytes`; a truncated file is an error that states `expected`.
    pub(crate) fn skip(&mut self, bytes: u64, expected: &str) -> Result<(), FileError> {
        if let Body::Plain(counted) = &mut self.body {
            let to = self.position.saturating_add(bytes);
            if to > self.stored_bytes {
                self.position = self.stored_bytes;
                return Err(self.ends_early(expected));
            }
            let seek_result = counted.inner.seek(SeekFrom::Start(self.start.saturating_add(to)));
            seek_result.map_err(|e| FileError::wrong(&self.file, e.to_string(), expected))?;
            counted.consumed = to;
            self.position = to;
            return self.report();
        }
        let mut scratch = vec![0; CHUNK_BYTES.min(usize::try_from(bytes).unwrap_or(CHUNK_BYTES))];
        let mut remaining = bytes;
        while remaining > 0 {
            let part = scratch.len().min(usize::try_from(remaining).unwrap_or(usize::MAX));
            self.fill_all(&mut scratch[..part], expected)?;
            remaining -= part as u64;
        }
        Ok(())
    }

    /// Reads to the end, which for a packed stream verifies its last CRC, and returns the number of trailing bytes.
    /// A packed stream with more than [`SLACK_BYTES`] of them is refused without unpacking the rest.
    pub(crate) fn finish(self) -> Result<u64, FileError> {
        self.finish_within(SLACK_BYTES)
    }

    /// As [`Stream::finish`], with another limit on the trailing bytes of a packed stream.
    pub(crate) fn finish_within(mut self, slack_bytes: u64) -> Result<u64, FileError> {
        let trailing = if self.packing == Packing::Plain {
            self.stored_bytes.saturating_sub(self.position)
        } else {
            let mut scratch = [0; 4096];
            let mut trailing = 0;
            loop {
                let n = self.fill(&mut scratch)? as u64;
                trailing += n;
                if n == 0 {
                    break trailing + self.unpacked_rest();
                }
                if trailing > slack_bytes {
                    let name = self.packing.name();
                    let found = format!("a {name} that inflates to more than {} bytes", self.position);
                    let expected = format!("{}, as its header declares", self.position - trailing);
                    return Err(FileError::wrong(self.file, found, expected));
                }
            }
        };
        self.progress.advance(self.stored_bytes.saturating_sub(self.reported))?;
        Ok(trailing)
    }

    /// Stored bytes behind the end of a zlib stream, which says itself where it ends.
    fn unpacked_rest(&self) -> u64 {
        match &self.body {
            Body::Zlib(zlib) => self.stored_bytes.saturating_sub(zlib.total_in()),
            _ => 0,
        }
    }

    /// The whole content of a gzip, at most `max_bytes`; memory is used as bytes arrive.
    pub(crate) fn inflate(mut self, max_bytes: u64) -> Result<Vec<u8>, FileError> {
        let (mut bytes, mut part) = (Vec::new(), vec![0; CHUNK_BYTES]);
        loop {
            let read_len = self.fill(&mut part)?;
            bytes.extend_from_slice(&part[..read_len]);
            if bytes.len() as u64 > max_bytes {
                let found = format!("a gzip that inflates to more than {max_bytes} bytes");
                return Err(FileError::wrong(self.file, found, "no more (the limit, which can be raised)"));
            }
            if read_len < part.len() {
                return Ok(bytes);
            }
        }
    }

    /// The progress that reading reports to.
    pub(crate) fn progress(&self) -> &'a Progress {
        self.progress
    }

    /// The error for a file that ends at [`Self::position`].
    pub(crate) fn ends_early(&self, expected: &str) -> FileError {
        let found = match (self.position, self.packing) {
            (0, _) if self.start == 0 => "an empty file".to_owned(),
            (position, Packing::Plain) => {
                format!("the end of the file after {} bytes", self.start.saturating_add(position))
            }
            (position, packing) => {
                format!("the end of the {} after {position} inflated bytes", packing.name())
            }
        };
        FileError::wrong(&self.file, found, expected)
    }

    fn read_some(&mut self, buf: &mut [u8]) -> Result<usize, FileError> {
        loop {
            let read = match &mut self.body {
                Body::Plain(plain) => plain.read(buf),
                Body::Gzip(member) => member.read(buf),
                Body::Zlib(zlib) => zlib.read(buf),
                Body::Bzip2(blocks) => blocks.read(buf),
                Body::Ended => return Ok(0),
            };
            match read {
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(self.read_error(&e)),
                Ok(0) if self.packing == Packing::Gzip => self.next_member()?,
                Ok(n) => return Ok(n),
            }
            // A file may have a million empty members: cancelling must work inside this loop too.
            self.progress.check()?;
        }
    }

    /// After a member's end: the next member, zero padding up to the end, or the end.
    fn next_member(&mut self) -> Result<(), FileError> {
        let Body::Gzip(member) = std::mem::replace(&mut self.body, Body::Ended) else { return Ok(()) };
        let mut rest = member.into_inner();
        loop {
            let next = rest.fill_buf().map_err(|e| self.read_error(&e))?;
            match next.first() {
                None => {
                    self.report_consumed(rest.consumed)?;
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

    fn read_error(&self, e: &std::io::Error) -> FileError {
        let name = self.packing.name();
        let (found, expected) = match (self.packing, e.kind()) {
            (Packing::Plain, _) => (e.to_string(), "readable bytes".to_owned()),
            (_, ErrorKind::UnexpectedEof) => (
                format!("a {name} that is cut off after {} inflated bytes", self.position),
                format!("a whole {name}"),
            ),
            (_, ErrorKind::InvalidInput | ErrorKind::InvalidData) => {
                (format!("a damaged {name} ({e})"), format!("a whole {name}"))
            }
            _ => (e.to_string(), format!("a whole {name}")),
        };
        FileError::wrong(&self.file, found, expected)
    }

    fn report(&mut self) -> Result<(), FileError> {
        let consumed = match &self.body {
            Body::Plain(plain) => plain.consumed,
            Body::Gzip(member) => member.get_ref().consumed,
            Body::Zlib(zlib) => zlib.get_ref().consumed,
            Body::Bzip2(blocks) => blocks.get_ref().consumed,
            Body::Ended => return Ok(self.progress.check()?),
        };
        self.report_consumed(consumed)
    }

    fn report_consumed(&mut self, consumed: u64) -> Result<(), FileError> {
        let new = consumed.saturating_sub(self.reported);
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

    fn read_all(bytes: &[u8], declared: usize) -> Result<(Vec<u8>, u64), FileError> {
        let progress = Progress::new();
        let mut stream = Stream::of_bytes("t", bytes, &progress)?;
        let mut out = vec![0; declared];
        stream.fill_all(&mut out, "all")?;
        let trailing = stream.finish()?;
        assert_eq!(progress.fraction().unwrap_or(1.0), 1.0);
        Ok((out, trailing))
    }

    #[test]
    fn members_padding_and_trailing_bytes_are_handled() {
        let one = gz(b"hello ");
        let two = gz(b"world");
        let mut file = [one, gz(b""), two].concat();
        assert_eq!(read_all(&file, 11).unwrap(), (b"hello world".to_vec(), 0));
        assert_eq!(read_all(&file, 6).unwrap(), (b"hello ".to_vec(), 5));
        file.extend([0; 700]);
        assert_eq!(read_all(&file, 11).unwrap().1, 0);
        file.push(7);
        assert!(read_all(&file, 11).unwrap_err().to_string().contains("after the gzip's end"));
        assert!(read_all(b"plain", 5).is_ok());
        assert!(read_all(b"plain", 6).unwrap_err().to_string().contains("after 5 bytes"));
    }

    #[test]
    fn every_truncation_and_every_flipped_trailer_bit_is_an_error() {
        let text: Vec<u8> = (0..2000u32).map(|i| (i * i % 251) as u8).collect();
        let file = gz(&text);
        assert_eq!(read_all(&file, text.len()).unwrap().0, text);
        for cut in 2..file.len() {
            assert!(read_all(&file[..cut], text.len()).is_err(), "cut at {cut}");
        }
        for bit in 0..64 {
            let mut bad = file.clone();
            let byte = file.len() - 8 + bit / 8;
            bad[byte] ^= 1 << (bit % 8);
            assert!(read_all(&bad, text.len()).is_err(), "trailer bit {bit}");
        }
    }

    #[test]
    fn a_gzip_larger_than_declared_is_refused() {
        let file = gz(&vec![0; 100 + SLACK_BYTES as usize]);
        assert_eq!(read_all(&file, 100).unwrap().1, SLACK_BYTES);
        let file = gz(&vec![0; 8192 + SLACK_BYTES as usize]);
        assert!(read_all(&file, 100).unwrap_err().to_string().contains("inflates to more than"));
    }

    #[test]
    fn a_claim_beyond_the_maximum_ratio_is_refused() {
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
