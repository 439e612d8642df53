//! Which instance a file is: its UIDs, read from its beginning (PS3.10), whatever follows.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek};
use std::path::Path;

use crate::uid::Uid;

/// Most elements before the series' UID; real files have under a hundred.
const MAX_ELEMENTS: usize = 20_000;

/// Deepest nesting of sequences.
const MAX_DEPTH: usize = 16;

/// Longest UID with its padding, in bytes; longer ones aren't valid.
const MAX_UID_BYTES: u64 = 66;

const UNDEFINED: u32 = u32::MAX;

/// Whose a file is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Identity {
    /// SOP instance UID.
    pub instance: Uid,
    /// UIDs of study and series; `None` where the data set is deflated.
    pub of: Option<(Uid, Uid)>,
}

/// Reads a file's UIDs.
///
/// # Errors
/// What is wrong with it, in words.
pub(crate) fn identity(path: &Path) -> Result<Identity, String> {
    let file = File::open(path).map_err(|error| error.to_string())?;
    let length = file.metadata().map_err(|error| error.to_string())?.len();
    let mut header = Header { file: BufReader::new(file), length, elements: 0, is_big: false };
    header.identity().map_err(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof => "a file that ends before its study and series are known".to_owned(),
        _ => error.to_string(),
    })
}

fn wrong<T>(text: impl Into<String>) -> io::Result<T> {
    Err(io::Error::other(text.into()))
}

type Tag = (u16, u16);

struct Header {
    file: BufReader<File>,
    length: u64,
    elements: usize,
    is_big: bool,
}

impl Header {
    fn identity(&mut self) -> io::Result<Identity> {
        let mut begin = [0; 132];
        if self.length < 132 || self.file.read_exact(&mut begin).is_err() || &begin[128..] != b"DICM" {
            return wrong("no DICOM file (\"DICM\" after 128 bytes)");
        }
        let (mut syntax, mut meta_instance) = (None, None);
        while self.file.buffer_or_fill()?.starts_with(&[2, 0]) {
            let (tag, _, length) = self.element(true)?;
            match tag {
                (2, 0x10) => syntax = self.uid(length)?,
                (2, 0x03) => meta_instance = self.uid(length)?,
                _ => self.skip(u64::from(length))?,
            }
        }
        let Some(syntax) = syntax else { return wrong("a file without a transfer syntax") };
        if syntax.as_str() == "1.2.840.10008.1.2.1.99" {
            let Some(instance) = meta_instance else {
                return wrong("a deflated file without (0002,0003)");
            };
            return Ok(Identity { instance, of: None });
        }
        self.is_big = syntax.as_str() == "1.2.840.10008.1.2.2";
        let is_explicit = syntax.as_str() != "1.2.840.10008.1.2";
        let (mut instance, mut study) = (None, None);
        loop {
            let (tag, kind, length) = self.element(is_explicit)?;
            match tag {
                (0x0008, 0x0018) => instance = self.uid(length)?,
                (0x0020, 0x000d) => study = self.uid(length)?,
                (0x0020, 0x000e) => {
                    return match (instance, study, self.uid(length)?) {
                        (Some(instance), Some(study), Some(series)) => {
                            Ok(Identity { instance, of: Some((study, series)) })
                        }
                        _ => wrong("a file with an invalid UID of instance, study or series"),
                    };
                }
                tag if tag > (0x0020, 0x000e) => return wrong("a file without a series instance UID"),
                _ if length == UNDEFINED => self.skip_items(is_explicit && &kind != b"UN", 0)?,
                _ => self.skip(u64::from(length))?,
            }
        }
    }

    fn u16(&mut self) -> io::Result<u16> {
        let mut two = [0; 2];
        self.file.read_exact(&mut two)?;
        Ok(if self.is_big { u16::from_be_bytes(two) } else { u16::from_le_bytes(two) })
    }

    fn u32(&mut self) -> io::Result<u32> {
        let mut four = [0; 4];
        self.file.read_exact(&mut four)?;
        Ok(if self.is_big { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
    }

    /// Tag, value representation (zeros where it isn't stated) and length of the next element.
    fn element(&mut self, is_explicit: bool) -> io::Result<(Tag, [u8; 2], u32)> {
        self.elements += 1;
        if self.elements > MAX_ELEMENTS {
            return wrong("a file with too many elements before its series");
        }
        let tag = (self.u16()?, self.u16()?);
        if !is_explicit || tag.0 == 0xfffe {
            return Ok((tag, [0; 2], self.u32()?));
        }
        let mut kind = [0; 2];
        self.file.read_exact(&mut kind)?;
        let is_long = matches!(
            &kind,
            b"OB"
                | b"OD"
                | b"OF"
                | b"OL"
                | b"OV"
                | b"OW"
                | b"SQ"
                | b"SV"
                | b"UC"
                | b"UN"
                | b"UR"
                | b"UT"
                | b"UV"
        );
        if is_long {
            self.skip(2)?;
            return Ok((tag, kind, self.u32()?));
        }
        Ok((tag, kind, u32::from(self.u16()?)))
    }

    fn uid(&mut self, length: u32) -> io::Result<Option<Uid>> {
        if u64::from(length) > MAX_UID_BYTES {
            return wrong("a file with an endless UID");
        }
        let mut text = vec![0; length as usize];
        self.file.read_exact(&mut text)?;
        Ok(std::str::from_utf8(&text).ok().and_then(Uid::read))
    }

    fn skip(&mut self, length: u64) -> io::Result<()> {
        let at = self.file.stream_position()?;
        if length > self.length.saturating_sub(at) {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        self.file.seek_relative(length as i64)
    }

    /// Skips the items of a sequence of undefined length, with its delimiter.
    fn skip_items(&mut self, is_explicit: bool, depth: usize) -> io::Result<()> {
        if depth > MAX_DEPTH {
            return wrong("a file with sequences that are nested too deep");
        }
        loop {
            match self.element(is_explicit)? {
                ((0xfffe, 0xe0dd), ..) => return Ok(()),
                ((0xfffe, 0xe000), _, UNDEFINED) => loop {
                    match self.element(is_explicit)? {
                        ((0xfffe, 0xe00d), ..) => break,
                        (_, kind, UNDEFINED) => self.skip_items(is_explicit && &kind != b"UN", depth + 1)?,
                        (_, _, length) => self.skip(u64::from(length))?,
                    }
                },
                ((0xfffe, 0xe000), _, length) => self.skip(u64::from(length))?,
                _ => return wrong("a file with a sequence of something else than items"),
            }
        }
    }
}

/// The next bytes, without reading past them.
trait Peek {
    fn buffer_or_fill(&mut self) -> io::Result<&[u8]>;
}

impl Peek for BufReader<File> {
    fn buffer_or_fill(&mut self) -> io::Result<&[u8]> {
        // A buffer with one byte left can't tell a group: read on from there.
        if self.buffer().len() < 2 {
            let at = self.stream_position()?;
            self.seek(io::SeekFrom::Start(at))?;
        }
        io::BufRead::fill_buf(self)
    }
}

#[cfg(test)]
mod tests;
