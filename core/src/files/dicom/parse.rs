//! Reading a DICOM file (PS3.5, PS3.10) into a data set: every length is checked against the bytes that are there before
//! anything is allocated, nesting is limited, and reading ends with the pixels.

use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;
use std::sync::Arc;

use flate2::read::DeflateDecoder;

use super::data_set::{DataSet, Fragments, Unusable, Value};
use super::tags::{self, Tag};
use super::text::CharacterSet;

/// Deepest nesting of sequences; real files have about 6.
const MAX_DEPTH: usize = 64;

/// Most elements of a file: a structure set of 300,000 contours has two million.
const MAX_ELEMENTS: usize = 4 << 20;

/// Longest value that is kept.
const MAX_VALUE_BYTES: usize = 64 << 20;

/// Largest content of a deflated file: it states its size nowhere.
const MAX_INFLATED_BYTES: u64 = 128 << 20;

/// Undefined length.
const UNDEFINED: u32 = u32::MAX;

/// Why a file can't be read.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fault {
    /// The bytes given end before the pixels, the file doesn't.
    NeedsMore,
    /// The file is not as expected.
    Wrong(Unusable),
}

impl From<Unusable> for Fault {
    fn from(wrong: Unusable) -> Self {
        Self::Wrong(wrong)
    }
}

fn wrong<T>(found: impl Into<String>, expected: impl Into<String>) -> Result<T, Fault> {
    Err(Fault::Wrong(Unusable::new(found, expected)))
}

/// A file's data set.
#[derive(Debug)]
pub(super) struct Parsed<'a> {
    pub data: DataSet,
    /// UID of the transfer syntax; that of an uncompressed one where the file states none.
    pub transfer_syntax: String,
    /// The bytes in which ranges of pixels lie: the file's, or the inflated ones.
    pub bytes: Cow<'a, [u8]>,
    /// Whether pixels are stored as words of 16 bits (OW), whatever a pixel's size.
    pub pixels_are_words: bool,
}

/// Implicit VR Little Endian.
pub(super) const IMPLICIT_LE: &str = "1.2.840.10008.1.2";
/// Explicit VR Little Endian.
pub(super) const EXPLICIT_LE: &str = "1.2.840.10008.1.2.1";
/// Deflated Explicit VR Little Endian.
const DEFLATED_LE: &str = "1.2.840.10008.1.2.1.99";
/// Explicit VR Big Endian (retired).
const EXPLICIT_BE: &str = "1.2.840.10008.1.2.2";

/// Whether the bytes at a file's start are DICOM: after a preamble, or without one.
pub(in super::super) fn sniff(begin: &[u8]) -> bool {
    begin.get(128..132) == Some(b"DICM") || is_bare(begin)
}

/// Whether a file begins with its first element, without preamble.
fn is_bare(begin: &[u8]) -> bool {
    let Some(first) = begin.first_chunk::<8>() else { return false };
    let has_representation = is_representation([first[4], first[5]]);
    match [first[0], first[1], first[2], first[3]] {
        // The meta group is always explicit. A data set begins with a low element of group 0008, whose text is short.
        [2, 0, element, 0] => element <= 0x13 && has_representation,
        [8, 0, element, 0] => {
            let length = u32::from_le_bytes([first[4], first[5], first[6], first[7]]);
            element <= 0x18 && (has_representation || (length < 256 && length % 2 == 0))
        }
        [0, 8, 0, element] => element <= 0x18 && has_representation,
        _ => false,
    }
}

fn is_representation(two: [u8; 2]) -> bool {
    REPRESENTATIONS.contains(&&two)
}

/// All value representations (PS3.5 6.2).
const REPRESENTATIONS: [&[u8; 2]; 34] = [
    b"AE", b"AS", b"AT", b"CS", b"DA", b"DS", b"DT", b"FD", b"FL", b"IS", b"LO", b"LT", b"OB", b"OD", b"OF",
    b"OL", b"OV", b"OW", b"PN", b"SH", b"SL", b"SQ", b"SS", b"ST", b"SV", b"TM", b"UC", b"UI", b"UL", b"UN",
    b"UR", b"US", b"UT", b"UV",
];

/// Parses a file that begins with `bytes` and is `file_bytes` long, up to and with its pixels; `headers_only`: fragments of
/// encapsulated pixels are not looked for.
///
/// # Errors
/// [`Fault::NeedsMore`] where `bytes` are fewer than the file's and what follows is needed (pixels that lie beyond them are
/// not); [`Fault::Wrong`] for any defect.
pub(super) fn parse(bytes: &[u8], file_bytes: u64, headers_only: bool) -> Result<Parsed<'_>, Fault> {
    let mut start = 0;
    if bytes.get(128..132) == Some(b"DICM") {
        start = 132;
    } else if !is_bare(bytes) {
        return wrong("another kind of file", "DICOM: \"DICM\" after 128 bytes, or a data set");
    }
    let explicit_le = Encoding { explicit: true, big_endian: false, headers_only };
    let mut meta = Parser::new(bytes, start, file_bytes, explicit_le);
    let stated = meta.meta()?;
    let at = meta.at;
    if at as u64 >= file_bytes {
        return wrong(
            format!("the end of the file after {file_bytes} bytes"),
            "a data set after the file meta group",
        );
    }
    let rest = bytes.get(at..).unwrap_or_default();
    let transfer_syntax = match stated {
        Some(uid) => uid,
        None if rest.first_chunk::<4>().is_some_and(|b| b[..3] == [0, 8, 0]) => EXPLICIT_BE.to_owned(),
        None if rest.get(4..6).is_some_and(|b| is_representation([b[0], b[1]])) => EXPLICIT_LE.to_owned(),
        None => IMPLICIT_LE.to_owned(),
    };
    if !is_known(&transfer_syntax) {
        let uid: String = transfer_syntax.chars().take(64).collect();
        return wrong(format!("the transfer syntax {uid}"), "one of PS3.6 table A-1 for images");
    }
    let encoding = Encoding {
        explicit: transfer_syntax != IMPLICIT_LE,
        big_endian: transfer_syntax == EXPLICIT_BE,
        headers_only,
    };
    if transfer_syntax == DEFLATED_LE {
        if (bytes.len() as u64) < file_bytes {
            return Err(Fault::NeedsMore);
        }
        let inflated = inflate(rest)?;
        let (data, pixels_are_words) =
            Parser::new(&inflated, 0, inflated.len() as u64, encoding).data_set()?;
        return Ok(Parsed { data, transfer_syntax, bytes: Cow::Owned(inflated), pixels_are_words });
    }
    let (data, pixels_are_words) = Parser::new(bytes, at, file_bytes, encoding).data_set()?;
    Ok(Parsed { data, transfer_syntax, bytes: Cow::Borrowed(bytes), pixels_are_words })
}

/// Transfer syntaxes of images that the standard has: uncompressed, deflated and encapsulated ones.
fn is_known(uid: &str) -> bool {
    let Some(rest) = uid.strip_prefix(IMPLICIT_LE) else { return false };
    rest.is_empty() || matches!(rest, ".1" | ".1.99" | ".2" | ".5" | ".8.1") || rest.starts_with(".4.")
}

fn inflate(deflated: &[u8]) -> Result<Vec<u8>, Fault> {
    let mut inflated = Vec::new();
    let mut decoder = DeflateDecoder::new(deflated).take(MAX_INFLATED_BYTES + 1);
    if let Err(error) = decoder.read_to_end(&mut inflated) {
        return wrong(
            format!("a data set that does not inflate ({error})"),
            "deflate, as the transfer syntax says",
        );
    }
    if inflated.len() as u64 > MAX_INFLATED_BYTES {
        let found = format!("a deflated data set of more than {MAX_INFLATED_BYTES} bytes");
        return wrong(found, "at most as many");
    }
    Ok(inflated)
}

#[derive(Clone, Copy)]
struct Encoding {
    explicit: bool,
    big_endian: bool,
    headers_only: bool,
}

struct Parser<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Length of the file, of which `bytes` may be the beginning.
    file_bytes: u64,
    encoding: Encoding,
    elements: usize,
    pixels_are_words: bool,
}

/// What ends a data set.
#[derive(Clone, Copy, PartialEq)]
enum End {
    /// The end of the file, or the pixels.
    File,
    /// A position.
    At(usize),
    /// An item delimiter.
    Delimiter,
}

impl<'a> Parser<'a> {
    fn new(bytes: &'a [u8], at: usize, file_bytes: u64, encoding: Encoding) -> Self {
        Self { bytes, at, file_bytes, encoding, elements: 0, pixels_are_words: false }
    }

    /// The next `length` bytes.
    fn take(&mut self, length: usize, what: &str) -> Result<&'a [u8], Fault> {
        let end = self.at.saturating_add(length);
        if end as u64 > self.file_bytes {
            let left = self.file_bytes.saturating_sub(self.at as u64);
            return wrong(
                format!("{left} bytes where {what} of {length} begins, at {}", self.at),
                "a whole file",
            );
        }
        let part = self.bytes.get(self.at..end).ok_or(Fault::NeedsMore)?;
        self.at = end;
        Ok(part)
    }

    /// Skips `length` bytes, which need not be in `bytes`, and tells where they are.
    fn skip(&mut self, length: usize, what: &str) -> Result<Range<usize>, Fault> {
        let end = self.at.saturating_add(length);
        if end as u64 > self.file_bytes {
            let left = self.file_bytes.saturating_sub(self.at as u64);
            return wrong(
                format!("{left} bytes where {what} of {length} begins, at {}", self.at),
                "a whole file",
            );
        }
        let start = std::mem::replace(&mut self.at, end);
        Ok(start..end)
    }

    fn u16(&mut self, what: &str) -> Result<u16, Fault> {
        let two = self.take(2, what)?;
        let two = [two[0], two[1]];
        Ok(if self.encoding.big_endian { u16::from_be_bytes(two) } else { u16::from_le_bytes(two) })
    }

    fn u32(&mut self, what: &str) -> Result<u32, Fault> {
        let four = self.take(4, what)?;
        let four = [four[0], four[1], four[2], four[3]];
        Ok(if self.encoding.big_endian { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
    }

    fn tag(&mut self) -> Result<Tag, Fault> {
        Ok(Tag(self.u16("a tag")?, self.u16("a tag")?))
    }

    /// The file meta group; returns the transfer syntax, where it is stated.
    fn meta(&mut self) -> Result<Option<String>, Fault> {
        let start = self.at;
        let (mut elements, mut group_end) = (Vec::new(), None);
        while self.bytes.get(self.at..self.at + 2) == Some(&[2, 0]) {
            let tag = self.tag()?;
            let (_, length) = self.header(tag)?;
            if length == UNDEFINED {
                return wrong(format!("{tag} of undefined length"), "a length");
            }
            let value = self.take(length as usize, "a value of the file meta group")?;
            if tag == tags::META_GROUP_LENGTH {
                let four = value.first_chunk().copied().unwrap_or_default();
                group_end = Some(self.at as u64 + u64::from(u32::from_le_bytes(four)));
            }
            elements.push((tag, Value::Bytes(value.to_vec())));
            self.counted()?;
        }
        if let Some(end) = group_end.filter(|&end| end != self.at as u64) {
            let found = format!("a file meta group that ends at {}", self.at);
            return wrong(found, format!("{end}, as its length (0002,0000) says"));
        }
        let meta = DataSet::new(elements, false, &Arc::new(CharacterSet::default()));
        let stated = meta.text(tags::TRANSFER_SYNTAX_UID);
        if stated.is_none() && self.at > start {
            return wrong("no transfer syntax", "one in the file meta group (0002,0010)");
        }
        Ok(stated)
    }

    fn counted(&mut self) -> Result<(), Fault> {
        self.elements += 1;
        if self.elements > MAX_ELEMENTS {
            return wrong(format!("more than {MAX_ELEMENTS} elements"), "no more");
        }
        Ok(())
    }

    /// Value representation (none in Implicit VR and in delimiters) and length of the element of `tag`.
    fn header(&mut self, tag: Tag) -> Result<(Option<[u8; 2]>, u32), Fault> {
        if !self.encoding.explicit || tag.0 == 0xfffe {
            return Ok((None, self.u32("a length")?));
        }
        let two = self.take(2, "a value representation")?;
        let representation = [two[0], two[1]];
        if !is_representation(representation) {
            let shown = representation.escape_ascii();
            return wrong(format!("the value representation \"{shown}\" at {tag}"), "one of PS3.5 6.2");
        }
        let is_long = matches!(
            &representation,
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
            self.take(2, "a length")?;
            return Ok((Some(representation), self.u32("a length")?));
        }
        Ok((Some(representation), u32::from(self.u16("a length")?)))
    }

    /// The file's data set, and whether its pixels are words.
    fn data_set(mut self) -> Result<(DataSet, bool), Fault> {
        let begin = self.bytes.get(self.at..).unwrap_or_default();
        if let Some(first) = begin.first_chunk::<6>() {
            // Bytes that a wrong transfer syntax would read as something else.
            let is_other_order = first[..2] == if self.encoding.big_endian { [8, 0] } else { [0, 8] };
            let is_other_kind = is_representation([first[4], first[5]]) != self.encoding.explicit;
            if is_other_order || is_other_kind {
                let found = format!("a data set that begins with bytes {}", begin[..6].escape_ascii());
                return wrong(found, "a beginning as its transfer syntax says");
            }
        }
        let data = self.elements_until(End::File, 0, &Arc::new(CharacterSet::default()))?;
        Ok((data, self.pixels_are_words))
    }

    fn elements_until(
        &mut self,
        end: End,
        depth: usize,
        around: &Arc<CharacterSet>,
    ) -> Result<DataSet, Fault> {
        if depth > MAX_DEPTH {
            return wrong(format!("sequences nested more than {MAX_DEPTH} deep"), "fewer");
        }
        let mut elements = Vec::new();
        let mut character_set = Arc::clone(around);
        loop {
            match end {
                End::File if self.at as u64 == self.file_bytes => break,
                End::At(at) if self.at == at => break,
                End::At(at) if self.at > at => {
                    return wrong("an item that is longer than its sequence", "items within their sequence");
                }
                _ => {}
            }
            let tag = self.tag()?;
            let (representation, length) = self.header(tag)?;
            self.counted()?;
            match tag {
                tags::ITEM_DELIMITATION if end == End::Delimiter => break,
                tags::DATA_SET_TRAILING_PADDING if end == End::File => break,
                Tag(0xfffe, _) => return wrong(format!("{tag} between elements"), "an element"),
                _ => {}
            }
            let is_pixels = depth == 0
                && matches!(tag, tags::PIXEL_DATA | tags::FLOAT_PIXEL_DATA | tags::DOUBLE_FLOAT_PIXEL_DATA);
            let value = if is_pixels && length != UNDEFINED {
                Some(Value::Pixels(self.skip(length as usize, "pixel data")?))
            } else if is_pixels && self.encoding.headers_only {
                Some(Value::Fragments(Box::default()))
            } else {
                self.value(tag, representation, length, depth, &character_set)?
            };
            if let Some(value) = value {
                elements.push((tag, value));
                if tag == tags::SPECIFIC_CHARACTER_SET {
                    let own = DataSet::new(elements, self.encoding.big_endian, around);
                    character_set = Arc::clone(own.character_set());
                    elements = own.into_elements();
                }
            }
            if is_pixels {
                self.pixels_are_words = representation.is_none_or(|r| &r == b"OW");
                break;
            }
        }
        Ok(DataSet::new(elements, self.encoding.big_endian, around))
    }

    /// A value; `None` for one that nobody needs and that is too long to keep.
    fn value(
        &mut self,
        tag: Tag,
        representation: Option<[u8; 2]>,
        length: u32,
        depth: usize,
        around: &Arc<CharacterSet>,
    ) -> Result<Option<Value>, Fault> {
        let is_sequence = match representation.as_ref().map(<[u8; 2]>::as_slice) {
            Some(b"SQ") => true,
            // A value of unknown representation and undefined length holds items in Implicit VR (PS3.5 6.2.2).
            Some(b"UN") | None => length == UNDEFINED || tags::is_sequence(tag),
            Some(_) => false,
        };
        if is_sequence {
            let encoding = self.encoding;
            if representation.as_ref().is_some_and(|r| r == b"UN") {
                self.encoding = Encoding { explicit: false, big_endian: false, ..encoding };
            }
            let items = self.items(tag, length, depth, around);
            self.encoding = encoding;
            return Ok(Some(Value::Items(items?)));
        }
        if length == UNDEFINED {
            let fragments = self.fragments(tag)?;
            return Ok((depth == 0).then(|| Value::Fragments(Box::new(fragments))));
        }
        let length = length as usize;
        if length > MAX_VALUE_BYTES {
            self.skip(length, "a value")?;
            return Ok(None);
        }
        Ok(Some(Value::Bytes(self.take(length, "a value")?.to_vec())))
    }

    fn items(
        &mut self,
        tag: Tag,
        length: u32,
        depth: usize,
        around: &Arc<CharacterSet>,
    ) -> Result<Vec<DataSet>, Fault> {
        let end = match length {
            UNDEFINED => None,
            length => {
                let end = self.at.saturating_add(length as usize);
                if end as u64 > self.file_bytes {
                    return wrong(format!("a sequence {tag} of {length} bytes that is cut"), "a whole file");
                }
                Some(end)
            }
        };
        let mut items = Vec::new();
        loop {
            match end {
                Some(end) if self.at == end => break,
                Some(end) if self.at > end => {
                    return wrong(
                        format!("an item of {tag} that is longer than it"),
                        "items within their sequence",
                    );
                }
                _ => {}
            }
            let found = self.tag()?;
            let item_length = self.u32("a length")?;
            self.counted()?;
            match found {
                tags::ITEM if item_length == UNDEFINED => {
                    items.push(self.elements_until(End::Delimiter, depth + 1, around)?);
                }
                tags::ITEM => {
                    let item_end = self.at.saturating_add(item_length as usize);
                    if item_end > end.unwrap_or(usize::MAX) || item_end as u64 > self.file_bytes {
                        let found = format!("an item of {item_length} bytes in {tag}");
                        return wrong(found, "items within their sequence");
                    }
                    items.push(self.elements_until(End::At(item_end), depth + 1, around)?);
                }
                tags::SEQUENCE_DELIMITATION => break,
                other => return wrong(format!("{other} in the sequence {tag}"), "an item"),
            }
        }
        Ok(items)
    }

    /// Encapsulated bytes: an offset table and fragments, up to the delimiter.
    fn fragments(&mut self, tag: Tag) -> Result<Fragments, Fault> {
        let mut all = Vec::new();
        loop {
            let found = self.tag()?;
            let length = self.u32("a length")?;
            self.counted()?;
            match found {
                tags::ITEM if length != UNDEFINED => all.push(self.skip(length as usize, "a fragment")?),
                tags::SEQUENCE_DELIMITATION => break,
                other => return wrong(format!("{other} among the fragments of {tag}"), "a fragment"),
            }
        }
        if all.is_empty() {
            return wrong(format!("{tag} without an offset table"), "one, which may be empty");
        }
        let offsets = all.remove(0);
        Ok(Fragments { offsets, fragments: all })
    }
}
