//! MRtrix `.tck`: a text header, then triples of numbers in RAS+ millimetres; three NaNs end a
//! fibre, three infinities the file. From MRtrix3's documentation ("Tracks file format").

use super::bounded_gzip::{CHUNK_BYTES, Stream};
use super::nifti_header::ByteOrder;
use super::tracts::{FiberBuilder, LoadedTracts, base_name, check_trailing, count_check, f32_at};
use super::{FileError, printable};
use crate::{Check, Sides};

/// First bytes of a file.
pub(super) const MAGIC: &[u8; 13] = b"mrtrix tracks";

/// Maximum header size in bytes: real headers keep their command history, some kilobytes.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// Number format of the values.
#[derive(Clone, Copy)]
pub(super) struct Numbers {
    order: ByteOrder,
    pub(super) bytes: usize,
}

/// The header of a `.tck` or of a `.tsf`, which has the same form.
pub(super) struct Header {
    pub(super) numbers: Numbers,
    /// The numbers of fibres declared: of several, as tools append that write into a copied header, any may be right.
    pub(super) counts: Vec<u64>,
    pub(super) offset: u64,
    /// When the fibres were made: a `.tsf` repeats that of its `.tck`.
    pub(super) timestamp: Option<String>,
    pub(super) checks: Vec<Check>,
}

impl Header {
    /// A finding where no declared count is that of the `fibers` in the file. Some writers count fibres without points,
    /// others don't.
    pub(super) fn count_check(&self, name: &str, fibers: u64, empty: u64) -> Option<Check> {
        let is_right = |&c: &u64| c == fibers || c == fibers - empty;
        let count = *self.counts.last()?;
        (!self.counts.iter().any(is_right)).then(|| count_check(name, count, fibers))
    }
}

/// Reads the file from after [`MAGIC`].
pub(super) fn read(mut stream: Stream<'_>) -> Result<LoadedTracts, FileError> {
    let file = stream.file().to_owned();
    let header = header(&mut stream, &file)?;
    stream.skip(header.offset - stream.position(), "fibres where the header's \"file\" says")?;
    let (builder, unread) = fibers(&mut stream, header.numbers, &file)?;

    let name = base_name(&file);
    let total = builder.fibers() as u64;
    let tracts = builder.finish(Sides::Known, &file)?;
    let empty = tracts.offsets().windows(2).filter(|o| o[0] == o[1]).count() as u64;
    let count_check = header.count_check(&name, total, empty);
    let mut checks = header.checks;
    checks.extend(count_check);
    stream.unread(unread);
    check_trailing(stream, &name, &mut checks)?;
    Ok(LoadedTracts { tracts, timestamp: header.timestamp, checks })
}

/// All fibres up to the end marker, and the number of bytes read beyond it.
fn fibers(stream: &mut Stream<'_>, numbers: Numbers, file: &str) -> Result<(FiberBuilder, u64), FileError> {
    let triple = 3 * numbers.bytes;
    let mut builder = FiberBuilder::with_capacity(stream.remaining() / triple as u64, file)?;
    let mut buffer = vec![0; CHUNK_BYTES / triple * triple];
    loop {
        let read_len = stream.fill(&mut buffer)?;
        let whole = read_len / triple * triple;
        for (at, bytes) in buffer[..whole].chunks_exact(triple).enumerate() {
            let point = [0, 1, 2].map(|axis| numbers.get(bytes, axis));
            if point.iter().all(|v| v.is_nan()) {
                builder.end_fiber();
            } else if point.iter().all(|v| v.is_infinite()) {
                if builder.is_open() {
                    let found = format!("the end marker inside fibre {}", builder.fibers());
                    return Err(FileError::wrong(file, found, "three NaNs at the end of every fibre"));
                }
                return Ok((builder, (read_len - (at + 1) * triple) as u64));
            } else {
                builder.push(point, file)?;
            }
        }
        if read_len < buffer.len() {
            return Err(stream.ends_early("three infinities, which end a .tck"));
        }
    }
}

impl Numbers {
    /// The number at position `n` of `bytes`.
    pub(super) fn get(self, bytes: &[u8], n: usize) -> f64 {
        if self.bytes == 4 {
            return f32_at(bytes, 4 * n, self.order);
        }
        let eight = bytes.get(8 * n..).and_then(|b| b.first_chunk()).copied().unwrap_or_default();
        match self.order {
            ByteOrder::Little => f64::from_le_bytes(eight),
            ByteOrder::Big => f64::from_be_bytes(eight),
        }
    }
}

/// The header's text after the magic, up to `END`.
fn header_text(stream: &mut Stream<'_>, file: &str) -> Result<String, FileError> {
    const END: &[u8] = b"\nEND";
    let mut text = Vec::new();
    let mut byte = [0];
    loop {
        stream.fill_all(&mut byte, "a line END, which ends the header")?;
        let [b] = byte;
        let line_ends = b == b'\n' && (text.ends_with(END) || text.ends_with(b"\nEND\r"));
        if line_ends {
            return Ok(String::from_utf8_lossy(&text).into_owned());
        }
        if text.len() == MAX_HEADER_BYTES {
            let found = format!("no line END within {MAX_HEADER_BYTES} bytes");
            return Err(FileError::wrong(file, found, "the end of an MRtrix header"));
        }
        text.push(b);
    }
}

/// `text` for a message: one line, at most 60 characters.
fn excerpt(text: &str) -> String {
    printable(&text.chars().take(60).collect::<String>())
}

/// The header after the magic.
pub(super) fn header(stream: &mut Stream<'_>, file: &str) -> Result<Header, FileError> {
    let text = header_text(stream, file)?;
    let header_end = stream.position();
    let values = |key: &str| -> Vec<&str> {
        let lines = text.lines().filter_map(|line| line.split_once(':'));
        lines.filter(|(k, _)| k.trim() == key).map(|(_, value)| value.trim()).collect()
    };
    let mut checks = Vec::new();
    let mut repeated = |key: &str, values: &[&str]| {
        if values.len() > 1 {
            let found =
                format!("{key} {} times in the header ({})", values.len(), excerpt(&values.join(", ")));
            checks.push(Check::warning(
                "tracts-header-repeated",
                format!("{}: found {found}, expected once; the fibres in the file are read", base_name(file)),
            ));
        }
    };
    let mut needed = |key: &str, form: &str| {
        let values = values(key);
        repeated(key, &values);
        match values.first() {
            Some(first) if values.iter().all(|value| value == first) => Ok(*first),
            Some(_) => {
                let found = format!("{key} twice in the header ({})", excerpt(&values.join(", ")));
                Err(FileError::wrong(file, found, format!("one {key}: {form}")))
            }
            None => Err(FileError::wrong(file, format!("no {key} in the header"), format!("{key}: {form}"))),
        }
    };

    let form = "Float32LE, Float32BE, Float64LE or Float64BE";
    let numbers = match needed("datatype", form)? {
        "Float32LE" => Numbers { order: ByteOrder::Little, bytes: 4 },
        "Float32BE" => Numbers { order: ByteOrder::Big, bytes: 4 },
        "Float64LE" => Numbers { order: ByteOrder::Little, bytes: 8 },
        "Float64BE" => Numbers { order: ByteOrder::Big, bytes: 8 },
        other => return Err(FileError::wrong(file, format!("datatype {}", excerpt(other)), form)),
    };
    let form = ". OFFSET, with fibres in this file behind the header";
    let place = needed("file", form)?;
    let offset = place
        .strip_prefix('.')
        .and_then(|offset| offset.trim().parse().ok())
        .filter(|&offset: &u64| offset >= header_end)
        .ok_or_else(|| FileError::wrong(file, format!("file: {}", excerpt(place)), form))?;
    let form = "a whole number of fibres";
    let written = values("count");
    repeated("count", &written);
    let parse = |count: &&str| {
        count.parse().map_err(|_| FileError::wrong(file, format!("count: {}", excerpt(count)), form))
    };
    let counts = written.iter().map(parse).collect::<Result<_, _>>()?;
    let timestamp = values("timestamp").last().map(|&value| value.to_owned());
    Ok(Header { numbers, counts, offset, timestamp, checks })
}
