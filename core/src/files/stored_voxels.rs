//! Voxels as they are stored: in one file or many, from some byte on, raw, compressed or as text.

use super::{
    FileError,
    bounded_gzip::{CHUNK_BYTES, Packing, SLACK_BYTES, Stream},
    nifti_header::SampleType,
    stored_file::Place,
    voxel_text::TextDecoder,
    voxels::VoxelBytes,
};
use crate::Progress;

/// Most files of one image: one a slice and frame.
pub(super) const MAX_FILES: u64 = 1 << 16;

/// How voxels are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    /// Bytes, packed or not.
    Bytes(Packing),
    /// zlib or gzip, whichever it begins as.
    Deflated,
    /// Decimal numbers.
    Text,
    /// Two hexadecimal digits a byte.
    Hex,
}

/// How many bytes to skip, after lines are skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Skip {
    /// So many, of the unpacked bytes where they are packed.
    Bytes(u64),
    /// All but the file's last bytes.
    AllButVoxels,
}

/// Where all voxels of an image are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Parts<'a> {
    /// The files in order, equally long in voxels.
    pub(super) files: Vec<Place<'a>>,
    /// First byte in each that isn't the header's.
    pub(super) start: u64,
    /// Lines to skip from there.
    pub(super) lines: u64,
    /// Bytes to skip then.
    pub(super) skip: Skip,
    /// Bytes of voxels in each, decoded.
    pub(super) bytes_each: u64,
    /// How they are encoded.
    pub(super) coding: Coding,
    /// Data type, for text.
    pub(super) sample_type: SampleType,
    /// Most unpacked bytes that may follow the voxels; `None`: few, and they are reported.
    pub(super) footer_bytes: Option<u64>,
}

impl Parts<'_> {
    fn open<'p>(&'p self, index: usize, progress: &'p Progress) -> Result<Part<'p>, FileError> {
        let Some(place) = self.files.get(index) else {
            return Err(FileError::wrong("voxels", "no more files", "another one"));
        };
        let mut start = self.start;
        if self.lines > 0 {
            start = behind_lines(place, start, self.lines)?;
        }
        if self.skip == Skip::AllButVoxels {
            let stored = place.stored_bytes()?;
            let last = stored.checked_sub(self.bytes_each).filter(|&last| last >= start);
            start = last.ok_or_else(|| {
                let found = format!("{} bytes behind the header", stored.saturating_sub(start));
                FileError::wrong(place.name(), found, format!("{} bytes of voxels", self.bytes_each))
            })?;
        }
        let packing = match self.coding {
            Coding::Bytes(packing) => packing,
            Coding::Text | Coding::Hex => Packing::Plain,
            Coding::Deflated => {
                let mut first = [0];
                let read_len = place.stream(start, Packing::Plain, &Progress::new())?.fill(&mut first)?;
                if read_len == 1 && first[0] == 0x1f { Packing::Gzip } else { Packing::Zlib }
            }
        };
        let mut stream = place.stream(start, packing, progress)?;
        let skip = if let Skip::Bytes(bytes) = self.skip { bytes } else { 0 };
        let expected = format!("{skip} bytes to skip in front of the voxels");
        stream.skip(skip, &expected)?;
        let least = match self.coding {
            Coding::Bytes(_) | Coding::Deflated => self.bytes_each,
            // A digit each, and white space between them.
            Coding::Text => (self.bytes_each / self.sample_type.bytes() as u64).saturating_mul(2) - 1,
            Coding::Hex => self.bytes_each.saturating_mul(2),
        };
        stream.can_hold(skip.saturating_add(least))?;
        let text = match self.coding {
            Coding::Text => Some(TextDecoder::decimal(self.sample_type)),
            Coding::Hex => Some(TextDecoder::hexadecimal()),
            Coding::Bytes(_) | Coding::Deflated => None,
        };
        Ok(Part { stream, text, left: self.bytes_each })
    }
}

/// The offset behind `lines` more lines from `start` on.
fn behind_lines(place: &Place<'_>, start: u64, lines: u64) -> Result<u64, FileError> {
    let progress = Progress::new();
    let mut stream = place.stream(start, Packing::Plain, &progress)?;
    let mut chunk = vec![0; CHUNK_BYTES];
    let (mut offset, mut missing) = (start, lines);
    loop {
        let read_len = stream.fill(&mut chunk)?;
        if read_len == 0 {
            return Err(stream.ends_early(&format!("{lines} lines to skip in front of the voxels")));
        }
        for (at, _) in chunk[..read_len].iter().enumerate().filter(|(_, byte)| **byte == b'\n') {
            missing -= 1;
            if missing == 0 {
                return Ok(offset + at as u64 + 1);
            }
        }
        offset += read_len as u64;
    }
}

/// An opened file.
struct Part<'p> {
    stream: Stream<'p>,
    text: Option<TextDecoder>,
    left: u64,
}

impl Part<'_> {
    fn fill_all(&mut self, buf: &mut [u8], expected: &str) -> Result<(), FileError> {
        self.left = self.left.saturating_sub(buf.len() as u64);
        match &mut self.text {
            Some(text) => text.fill_all(&mut self.stream, buf, expected),
            None => self.stream.fill_all(buf, expected),
        }
    }

    fn skip(&mut self, bytes: u64, expected: &str) -> Result<(), FileError> {
        if self.text.is_none() {
            self.left = self.left.saturating_sub(bytes);
            return self.stream.skip(bytes, expected);
        }
        // A multiple of every data type's size.
        let mut scratch = vec![0; CHUNK_BYTES.min(usize::try_from(bytes).unwrap_or(CHUNK_BYTES))];
        let mut remaining = bytes;
        while remaining > 0 {
            let part = scratch.len().min(usize::try_from(remaining).unwrap_or(usize::MAX));
            self.fill_all(&mut scratch[..part], expected)?;
            remaining -= part as u64;
        }
        Ok(())
    }
}

/// All of an image's voxels as one stream of bytes, whatever files they are in.
pub(super) struct StoredVoxels<'p> {
    parts: &'p Parts<'p>,
    progress: &'p Progress,
    opened: usize,
    part: Part<'p>,
    trailing: u64,
}

impl<'p> StoredVoxels<'p> {
    /// Opens the first file, which is checked against its length.
    pub(super) fn open(parts: &'p Parts<'p>, progress: &'p Progress) -> Result<Self, FileError> {
        Ok(Self { parts, progress, opened: 1, part: parts.open(0, progress)?, trailing: 0 })
    }

    /// Goes on to the next file where this one's voxels are read.
    fn advance(&mut self) -> Result<(), FileError> {
        while self.part.left == 0 && self.opened < self.parts.files.len() {
            let next = self.parts.open(self.opened, self.progress)?;
            self.opened += 1;
            let done = std::mem::replace(&mut self.part, next);
            self.trailing = self.trailing.saturating_add(finish(done, self.parts.footer_bytes)?);
        }
        Ok(())
    }

    /// Reads to the end, and returns the number of bytes that follow the voxels.
    pub(super) fn finish(self) -> Result<u64, FileError> {
        let last = finish(self.part, self.parts.footer_bytes)?;
        Ok(if self.parts.footer_bytes.is_some() { 0 } else { self.trailing.saturating_add(last) })
    }

    /// Calls `each` for the parts of `bytes` that lie in one file.
    fn in_parts(
        &mut self,
        bytes: u64,
        mut each: impl FnMut(&mut Part<'p>, u64) -> Result<(), FileError>,
    ) -> Result<(), FileError> {
        let mut remaining = bytes;
        while remaining > 0 {
            self.advance()?;
            // The last file says itself that it ends early.
            let is_last = self.opened == self.parts.files.len();
            let part = if is_last { remaining } else { remaining.min(self.part.left) };
            each(&mut self.part, part)?;
            remaining -= part;
        }
        Ok(())
    }
}

fn finish(part: Part<'_>, footer_bytes: Option<u64>) -> Result<u64, FileError> {
    let Part { mut stream, text, .. } = part;
    let unused = text.map_or(Ok(0), |text| text.unused(&mut stream))?;
    Ok(stream.finish_within(footer_bytes.unwrap_or(SLACK_BYTES))?.saturating_add(unused))
}

impl VoxelBytes for StoredVoxels<'_> {
    fn fill_all(&mut self, buf: &mut [u8], expected: &str) -> Result<(), FileError> {
        let mut filled = 0;
        self.in_parts(buf.len() as u64, |part, bytes| {
            let end = filled + usize::try_from(bytes).unwrap_or(usize::MAX);
            let into = &mut buf[filled..end];
            filled = end;
            part.fill_all(into, expected)
        })
    }

    fn skip(&mut self, bytes: u64, expected: &str) -> Result<(), FileError> {
        self.in_parts(bytes, |part, bytes| part.skip(bytes, expected))
    }

    fn file(&self) -> &str {
        self.part.stream.file()
    }
}
