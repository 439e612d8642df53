//! Stored pixels of a frame: found in the file, decompressed, masked to their bits and given their sign.

use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;

use flate2::read::DeflateDecoder;

use super::codec;
use super::data_set::{Fragments, Unusable, Value};
use super::decoders::Codec;
use super::instance::PixelFormat;
use super::parse::Parsed;
use super::tags;

/// The stored numbers of a frame, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Stored {
    /// Integers of up to 16 bits, or 32 with a sign.
    Whole(Vec<i32>),
    /// Others: exact in `f64`.
    Real(Vec<f64>),
}

impl Stored {
    /// Passes each number to `value`.
    pub fn for_each(&self, mut value: impl FnMut(usize, f64)) {
        match self {
            Self::Whole(numbers) => numbers.iter().enumerate().for_each(|(n, &v)| value(n, f64::from(v))),
            Self::Real(numbers) => numbers.iter().enumerate().for_each(|(n, &v)| value(n, v)),
        }
    }
}

impl Stored {
    /// Writes each number to its place in `out`, as `convert` makes it.
    pub fn fill<T>(&self, out: &mut [T], convert: impl Fn(f64) -> T) {
        match self {
            Self::Whole(numbers) => {
                out.iter_mut().zip(numbers).for_each(|(out, &v)| *out = convert(f64::from(v)));
            }
            Self::Real(numbers) => out.iter_mut().zip(numbers).for_each(|(out, &v)| *out = convert(v)),
        }
    }
}

/// Where the bytes of each frame are.
pub(super) enum Layout<'a> {
    /// One after the other, without compression.
    Plain(Range<usize>),
    /// A range of fragments for each frame, and how they are compressed.
    Encapsulated(&'a Fragments, Vec<Range<usize>>, Compression),
}

/// How frames in fragments are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Rle,
    Deflate,
    Codec(Codec),
}

impl Compression {
    /// Whether a codec of another crate is needed.
    pub fn is_codec(self) -> bool {
        matches!(self, Self::Codec(_))
    }
}

/// What decompresses the frames of a transfer syntax.
///
/// # Errors
/// [`Unusable`] with the name of one that isn't supported.
pub(super) fn compression(transfer_syntax: &str) -> Result<Compression, Unusable> {
    let not_read = |name: &str| Err(Unusable::new(format!("{name} ({transfer_syntax})"), READ));
    Ok(match transfer_syntax.strip_prefix("1.2.840.10008.1.2").unwrap_or_default() {
        ".1.98" => Compression::None,
        ".5" => Compression::Rle,
        ".8.1" => Compression::Deflate,
        ".4.50" | ".4.51" | ".4.57" | ".4.70" => Compression::Codec(Codec::Jpeg),
        ".4.90" | ".4.91" | ".4.201" | ".4.202" | ".4.203" => Compression::Codec(Codec::Jpeg2000),
        ".4.80" | ".4.81" => Compression::Codec(Codec::JpegLs),
        ".4.110" | ".4.111" | ".4.112" => return not_read("JPEG XL"),
        ".4.100" | ".4.101" | ".4.102" | ".4.103" | ".4.104" | ".4.105" | ".4.106" | ".4.107" | ".4.108" => {
            return not_read("a video");
        }
        _ => return not_read("a transfer syntax"),
    })
}

const READ: &str = "uncompressed, deflated, RLE, JPEG, JPEG-LS or JPEG 2000 pixels";

impl<'a> Layout<'a> {
    /// # Errors
    /// [`Unusable`] where there are no pixels, or fewer than `format` says.
    pub fn of(parsed: &'a Parsed<'_>, format: &PixelFormat) -> Result<Self, Unusable> {
        let Some((_, value)) = parsed.data.pixels() else {
            return Err(Unusable::new("no Pixel Data", "pixels (7FE0,0010)"));
        };
        match value {
            Value::Pixels(range) => {
                let uid = &parsed.transfer_syntax;
                let is_plain =
                    matches!(uid.strip_prefix("1.2.840.10008.1.2"), Some("" | ".1" | ".1.99" | ".2"));
                if !is_plain {
                    return Err(Unusable::new(
                        "Pixel Data of defined length",
                        format!("fragments, as the transfer syntax {uid} says"),
                    ));
                }
                if (range.len() as u64) < format.bytes() {
                    let found = format!("{} bytes of pixels", range.len());
                    let PixelFormat { rows, columns, frames, bits_allocated, .. } = format;
                    let expected = format!(
                        "{} for {columns} × {rows} × {frames} of {bits_allocated} bits",
                        format.bytes()
                    );
                    return Err(Unusable::new(found, expected));
                }
                Ok(Self::Plain(range.clone()))
            }
            Value::Fragments(fragments) => {
                let compression = compression(&parsed.transfer_syntax)?;
                let frames = frames_of(fragments, format.frames, &parsed.bytes, compression)?;
                Ok(Self::Encapsulated(fragments, frames, compression))
            }
            _ => Err(Unusable::new("Pixel Data of another kind", "pixels or fragments")),
        }
    }
}

/// The fragments of each frame.
fn frames_of(
    all: &Fragments,
    frames: usize,
    bytes: &[u8],
    compression: Compression,
) -> Result<Vec<Range<usize>>, Unusable> {
    let count = all.fragments.len();
    if frames == 1 && count > 0 {
        return Ok(std::iter::once(0..count).collect());
    }
    if count == frames {
        return Ok((0..count).map(|n| n..n + 1).collect());
    }
    let table = bytes.get(all.offsets.clone()).unwrap_or_default();
    let offsets: Vec<usize> =
        table.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b) as usize).collect();
    let starts: Vec<usize> = if offsets.len() == frames {
        // Offsets count from the first fragment's item tag.
        let first = all.fragments.first().map_or(0, |range| range.start - 8);
        offsets
            .iter()
            .filter_map(|offset| all.fragments.iter().position(|range| range.start - 8 == first + offset))
            .collect()
    } else {
        let begins = |range: &Range<usize>| {
            let begin = bytes.get(range.clone()).unwrap_or_default();
            begin.starts_with(&[0xff, 0xd8]) || begin.starts_with(&[0xff, 0x4f, 0xff, 0x51])
        };
        let is_codec = matches!(compression, Compression::Codec(_));
        (0..count).filter(|&n| is_codec && begins(&all.fragments[n])).collect()
    };
    let is_rising = starts.first() == Some(&0) && starts.is_sorted_by(|a, b| a < b);
    if starts.len() != frames || !is_rising {
        let found = format!("{count} fragments");
        return Err(Unusable::new(found, format!("{frames} frames, told apart by the offset table")));
    }
    let ends = starts.iter().skip(1).copied().chain([count]);
    Ok(starts.iter().zip(ends).map(|(&start, end)| start..end).collect())
}

/// The stored numbers of frame `number`.
///
/// # Errors
/// [`Unusable`] where they can't be decompressed to exactly the frame's pixels.
pub(super) fn stored(
    parsed: &Parsed<'_>,
    layout: &Layout<'_>,
    format: &PixelFormat,
    number: usize,
) -> Result<Stored, Unusable> {
    let frame_bytes = format.pixels() * usize::from(format.bits_allocated) / 8;
    let is_big_endian = parsed.transfer_syntax == "1.2.840.10008.1.2.2";
    let native: Cow<'_, [u8]> = match layout {
        Layout::Plain(range) => {
            let start = range.start + number * frame_bytes;
            let part = parsed.bytes.get(start..start + frame_bytes);
            let part = part.ok_or_else(|| Unusable::new("fewer pixels", "those of each frame"))?;
            if is_big_endian && format.bits_allocated == 8 && parsed.pixels_are_words {
                // Bytes lie in words of two, each with its bytes exchanged, from the start of the pixels.
                let whole = parsed.bytes.get(range.clone()).unwrap_or_default();
                let first = number * frame_bytes;
                let swapped =
                    (first..first + frame_bytes).map(|at| whole.get(at ^ 1).copied().unwrap_or_default());
                Cow::Owned(swapped.collect())
            } else {
                Cow::Borrowed(part)
            }
        }
        Layout::Encapsulated(all, frames, compression) => {
            let frame = frames.get(number).cloned().unwrap_or_default();
            let parts = &all.fragments[frame];
            let compressed: Cow<'_, [u8]> = match parts {
                [one] => Cow::Borrowed(parsed.bytes.get(one.clone()).unwrap_or_default()),
                _ => Cow::Owned(
                    parts
                        .iter()
                        .flat_map(|part| parsed.bytes.get(part.clone()).unwrap_or_default())
                        .copied()
                        .collect(),
                ),
            };
            match compression {
                Compression::None if compressed.len() >= frame_bytes => compressed,
                Compression::None => return Err(short(compressed.len(), frame_bytes)),
                Compression::Rle => Cow::Owned(unpack_rle(&compressed, format)?),
                Compression::Deflate => Cow::Owned(inflate(&compressed, frame_bytes)?),
                Compression::Codec(codec) => {
                    return codec::decode(*codec, &compressed, format).map(Stored::Whole);
                }
            }
        }
    };
    Ok(numbers(&native, format, is_big_endian))
}

fn short(found: usize, expected: usize) -> Unusable {
    Unusable::new(format!("a frame of {found} bytes"), format!("{expected}"))
}

/// The bytes of a frame that raw deflate compresses (Deflated Image Frame Compression, PS3.5 A.4.14).
pub(super) fn inflate(compressed: &[u8], frame_bytes: usize) -> Result<Vec<u8>, Unusable> {
    let mut bytes = Vec::new();
    let read = DeflateDecoder::new(compressed).take(frame_bytes as u64 + 2).read_to_end(&mut bytes);
    read.map_err(|e| Unusable::new(format!("a frame that does not inflate ({e})"), "deflate"))?;
    if bytes.len() < frame_bytes || bytes.len() > frame_bytes + 1 {
        return Err(short(bytes.len(), frame_bytes));
    }
    bytes.truncate(frame_bytes);
    Ok(bytes)
}

/// The bytes of a frame in RLE Lossless (PS3.5 annex G): one segment per byte of a pixel, most significant first.
fn unpack_rle(compressed: &[u8], format: &PixelFormat) -> Result<Vec<u8>, Unusable> {
    let wrong = |found: String, expected: &str| Err(Unusable::new(found, expected));
    let (pixels, bytes_each) = (format.pixels(), usize::from(format.bits_allocated) / 8);
    let Some(header) = compressed.first_chunk::<64>() else {
        return wrong(format!("an RLE frame of {} bytes", compressed.len()), "a header of 64");
    };
    let words: Vec<usize> =
        header.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b) as usize).collect();
    if words[0] != bytes_each {
        return wrong(format!("{} RLE segments", words[0]), "one per byte of a pixel");
    }
    let mut out = vec![0; pixels * bytes_each];
    for segment in 0..bytes_each {
        let start = words[1 + segment];
        let end = if segment + 1 < bytes_each { words[2 + segment] } else { compressed.len() };
        let Some(packed) = compressed.get(start.max(64)..end).filter(|_| start >= 64) else {
            return wrong(
                format!("an RLE segment from {start} to {end} of {}", compressed.len()),
                "one within its frame",
            );
        };
        // Native order is little-endian: the first segment has the highest bytes.
        let place = bytes_each - 1 - segment;
        let mut filled = 0;
        let mut at = 0;
        while filled < pixels && at < packed.len() {
            let control = packed[at] as i8;
            at += 1;
            if control == i8::MIN {
                continue;
            }
            let count = usize::from(control.unsigned_abs()) + 1;
            let run = count.min(pixels - filled);
            for n in 0..run {
                let from = if control >= 0 { at + n } else { at };
                let Some(&byte) = packed.get(from) else {
                    return wrong("an RLE segment that ends early".into(), "all pixels of the frame");
                };
                out[(filled + n) * bytes_each + place] = byte;
            }
            filled += run;
            at += if control >= 0 { count } else { 1 };
        }
        if filled < pixels {
            return wrong(format!("{filled} pixels in an RLE segment"), "all of the frame");
        }
    }
    Ok(out)
}

/// Numbers from native bytes: bits outside the stored ones are dropped, and the sign is extended from the highest.
fn numbers(bytes: &[u8], format: &PixelFormat, is_big_endian: bool) -> Stored {
    let (stored, low) = (u32::from(format.bits_stored), u32::from(format.low_bit));
    macro_rules! each {
        ($n:literal, $t:ty, $number:expr) => {
            bytes
                .as_chunks::<$n>()
                .0
                .iter()
                .map(|&b| if is_big_endian { <$t>::from_be_bytes(b) } else { <$t>::from_le_bytes(b) })
                .map($number)
                .collect()
        };
    }
    let extend = |raw: u32| {
        let value = raw >> low;
        if stored == 32 {
            return value.cast_signed();
        }
        let value = value & ((1 << stored) - 1);
        let is_negative = format.is_signed && value >> (stored - 1) == 1;
        if is_negative { (value | u32::MAX << stored).cast_signed() } else { value.cast_signed() }
    };
    match (format.bits_allocated, format.is_float) {
        (32, true) => Stored::Real(each!(4, f32, f64::from)),
        (64, _) => Stored::Real(each!(8, f64, |v| v)),
        (8, _) => Stored::Whole(bytes.iter().map(|&b| extend(u32::from(b))).collect()),
        // All bits are the number's: without a branch per pixel.
        (16, _) if stored == 16 && low == 0 && format.is_signed => {
            Stored::Whole(each!(2, u16, |v| i32::from(v.cast_signed())))
        }
        (16, _) if stored == 16 && low == 0 => Stored::Whole(each!(2, u16, i32::from)),
        (16, _) => Stored::Whole(each!(2, u16, |v| extend(u32::from(v)))),
        _ if format.is_signed || stored < 32 => Stored::Whole(each!(4, u32, extend)),
        _ => Stored::Real(each!(4, u32, f64::from)),
    }
}

/// Whether the pixels of `parsed` are one string of bits, as those of binary segmentations.
pub(super) fn plain_bits<'a>(parsed: &'a Parsed<'_>) -> Option<&'a [u8]> {
    match parsed.data.value(tags::PIXEL_DATA) {
        Some(Value::Pixels(range)) => parsed.bytes.get(range.clone()),
        _ => None,
    }
}
