//! Writing DICOM files (PS3.5, PS3.10): Explicit VR Little Endian, elements in the order of their tags, values of even length.
//! The same elements give the same bytes.

use std::collections::BTreeMap;

use super::parse::EXPLICIT_LE;
use super::representation::representation;
use super::tags::{self, Tag};
use crate::digest::Digest;

/// What wrote a file, by a random number (PS3.5 B.2).
const IMPLEMENTATION_CLASS_UID: &str = "2.25.145786844936590609759105122908714094190";

/// Longest decimal string (DS).
const DECIMAL_BYTES: usize = 16;

/// Longest value whose length is stated in 16 bits.
const SHORT_BYTES: usize = 0xfffe;

/// Representations whose length is stated in 32 bits.
const LONG: [&[u8; 2]; 4] = [b"OB", b"SQ", b"UN", b"UT"];

/// Elements of a file or of an item, each encoded.
#[derive(Clone, Debug, Default)]
pub(super) struct Elements(BTreeMap<Tag, Vec<u8>>);

impl Elements {
    /// An element without a value.
    pub fn empty(&mut self, tag: Tag) {
        self.put(tag, Vec::new());
    }

    /// Text in UTF-8, an identifier, a code, a date or an integer string. Control characters are left out.
    pub fn text(&mut self, tag: Tag, text: &str) {
        let plain: String = text.chars().filter(|c| !c.is_control()).collect();
        self.put(tag, plain.into_bytes());
    }

    /// Decimal strings (DS).
    pub fn decimals(&mut self, tag: Tag, values: &[f64]) {
        let all: Vec<String> = values.iter().map(|&value| decimal(value)).collect();
        self.put(tag, all.join("\\").into_bytes());
    }

    /// 16-bit numbers (US).
    pub fn u16s(&mut self, tag: Tag, values: &[u16]) {
        self.put(tag, values.iter().flat_map(|value| value.to_le_bytes()).collect());
    }

    /// 32-bit numbers (UL).
    pub fn u32s(&mut self, tag: Tag, values: &[u32]) {
        self.put(tag, values.iter().flat_map(|value| value.to_le_bytes()).collect());
    }

    /// A number of 64 bits (FD).
    pub fn double(&mut self, tag: Tag, value: f64) {
        self.put(tag, value.to_le_bytes().to_vec());
    }

    /// The tag of another attribute (AT).
    pub fn pointer(&mut self, tag: Tag, to: Tag) {
        self.u16s(tag, &[to.0, to.1]);
    }

    /// Bytes (OB).
    pub fn bytes(&mut self, tag: Tag, bytes: Vec<u8>) {
        self.put(tag, bytes);
    }

    /// A sequence.
    pub fn items(&mut self, tag: Tag, items: impl IntoIterator<Item = Self>) {
        let mut value = Vec::new();
        for item in items {
            let bytes = item.encoded();
            put_tag(&mut value, tags::ITEM);
            match stated(bytes.len()) {
                Some(length) => {
                    value.extend(length.to_le_bytes());
                    value.extend(bytes);
                }
                None => {
                    value.extend(u32::MAX.to_le_bytes());
                    value.extend(bytes);
                    put_tag(&mut value, tags::ITEM_DELIMITATION);
                    value.extend([0; 4]);
                }
            }
        }
        self.put(tag, value);
    }

    /// A sequence of one item.
    pub fn item(&mut self, tag: Tag, item: Self) {
        self.items(tag, [item]);
    }

    /// A sequence with one code.
    pub fn code(&mut self, tag: Tag, [value, scheme, meaning]: [&str; 3]) {
        let mut item = Self::default();
        item.text(tags::CODE_VALUE, value);
        item.text(tags::CODING_SCHEME_DESIGNATOR, scheme);
        item.text(tags::CODE_MEANING, meaning);
        self.item(tag, item);
    }

    /// Takes over the elements of another.
    pub fn merge(&mut self, other: Self) {
        self.0.extend(other.0);
    }

    fn put(&mut self, tag: Tag, mut value: Vec<u8>) {
        let mut representation = representation(tag);
        if value.len() % 2 == 1 {
            value.push(if matches!(representation, b"UI" | b"OB" | b"UN") { 0 } else { b' ' });
        }
        // PS3.5 6.2.2: a value too long for its representation is unknown (contours of many points).
        if value.len() > SHORT_BYTES && !LONG.contains(&representation) {
            representation = b"UN";
        }
        let mut out = Vec::with_capacity(value.len() + 12);
        put_tag(&mut out, tag);
        out.extend(representation);
        if LONG.contains(&representation) {
            out.extend([0; 2]);
            match stated(value.len()) {
                Some(length) => {
                    out.extend(length.to_le_bytes());
                    out.extend(value);
                }
                // Only sequences may grow so large; what holds pixels is refused before.
                None => {
                    out.extend(u32::MAX.to_le_bytes());
                    out.extend(value);
                    put_tag(&mut out, tags::SEQUENCE_DELIMITATION);
                    out.extend([0; 4]);
                }
            }
        } else {
            out.extend((value.len() as u16).to_le_bytes());
            out.extend(value);
        }
        self.0.insert(tag, out);
    }

    /// The elements without a file around them.
    pub fn encoded(&self) -> Vec<u8> {
        self.0.values().flatten().copied().collect()
    }

    /// The file: a preamble of zeros, the file meta group and the elements. `self` states SOP class and instance itself.
    pub fn file(&self, sop_class: &str, sop_instance: &str) -> Vec<u8> {
        let mut meta = Self::default();
        meta.bytes(tags::META_VERSION, vec![0, 1]);
        meta.text(tags::MEDIA_STORAGE_SOP_CLASS_UID, sop_class);
        meta.text(tags::MEDIA_STORAGE_SOP_INSTANCE_UID, sop_instance);
        meta.text(tags::TRANSFER_SYNTAX_UID, EXPLICIT_LE);
        meta.text(tags::IMPLEMENTATION_CLASS_UID, IMPLEMENTATION_CLASS_UID);
        meta.text(tags::IMPLEMENTATION_VERSION_NAME, "GLIOSCOPE");
        let meta_bytes = meta.encoded();
        let mut length = Self::default();
        length.u32s(tags::META_GROUP_LENGTH, &[meta_bytes.len() as u32]);
        let mut file = vec![0; 128];
        file.extend(b"DICM");
        file.extend(length.encoded());
        file.extend(meta_bytes);
        file.extend(self.0.values().flatten());
        file
    }
}

/// A length that 32 bits can state: the largest means an undefined one.
fn stated(length: usize) -> Option<u32> {
    u32::try_from(length).ok().filter(|&length| length != u32::MAX)
}

fn put_tag(out: &mut Vec<u8>, tag: Tag) {
    out.extend(tag.0.to_le_bytes());
    out.extend(tag.1.to_le_bytes());
}

/// The nearest number that 16 characters can state.
pub(super) fn decimal(value: f64) -> String {
    // Not "-0".
    let value = if value == 0.0 { 0.0 } else { value };
    let shortest = value.to_string();
    if shortest.len() <= DECIMAL_BYTES {
        return shortest;
    }
    let longest = |text: &dyn Fn(usize) -> String| {
        (0..DECIMAL_BYTES).rev().map(text).find(|text| text.len() <= DECIMAL_BYTES)
    };
    let plain = longest(&|digits| format!("{value:.digits$}"));
    let scientific = longest(&|digits| format!("{value:.digits$e}"));
    let error = |text: &String| text.parse().map_or(f64::INFINITY, |read: f64| (read - value).abs());
    let nearest = plain.into_iter().chain(scientific).min_by(|a, b| error(a).total_cmp(&error(b)));
    nearest.unwrap_or_default()
}

/// A UID of 128 bits (PS3.5 B.2).
pub(super) fn uid(digest: &Digest) -> String {
    let [high, low] = digest.finish();
    format!("2.25.{}", u128::from(high) << 64 | u128::from(low))
}

#[cfg(test)]
mod tests {
    use super::super::parse::parse;
    use super::*;

    #[test]
    fn decimals_keep_what_sixteen_characters_can() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (-183.0, "-183"),
            (0.1, "0.1"),
            (1.0 / 3.0, "0.33333333333333"),
            (-1.0 / 3.0, "-0.3333333333333"),
            (-123.456_789_012_345_67, "-123.45678901235"),
            (1e-20 / 3.0, "3.3333333333e-21"),
            (1e300, "1e300"),
        ] {
            let written = decimal(value);
            assert!(written.len() <= 16, "{written}");
            assert_eq!(written.parse::<f64>().unwrap(), text.parse::<f64>().unwrap(), "{written}");
        }
        for n in 0..2000_u32 {
            let value = (f64::from(n) * 0.03 - 30.0).sinh() + f64::from(n).sqrt();
            let read: f64 = decimal(value).parse().unwrap();
            assert!((read - value).abs() <= value.abs() * 1e-10, "{value} {read}");
        }
    }

    #[test]
    fn our_reader_reads_what_is_written() {
        let mut inner = Elements::default();
        inner.text(tags::SEGMENT_LABEL, "Ödem\n");
        inner.u16s(tags::SEGMENT_NUMBER, &[7]);
        let mut data = Elements::default();
        data.text(tags::SPECIFIC_CHARACTER_SET, "ISO_IR 192");
        data.text(tags::SOP_CLASS_UID, "1.2.3");
        data.items(tags::SEGMENT_SEQUENCE, [inner, Elements::default()]);
        data.decimals(tags::PIXEL_SPACING, &[1.0, 0.5]);
        data.empty(tags::PATIENT_NAME);
        data.u16s(tags::ROWS, &[1]);
        data.u16s(tags::COLUMNS, &[1]);
        data.bytes(tags::PIXEL_DATA, vec![5]);
        let many = vec![0.25; 20_000];
        data.decimals(tags::CONTOUR_DATA, &many);
        let file = data.file("1.2.3", "1.2.3.4");
        assert_eq!(file, data.file("1.2.3", "1.2.3.4"));
        assert!(file[..128].iter().all(|&b| b == 0) && file.len() % 2 == 0);
        let parsed = parse(&file, file.len() as u64, false).unwrap();
        assert_eq!(parsed.transfer_syntax, EXPLICIT_LE);
        let items = parsed.data.items(tags::SEGMENT_SEQUENCE);
        assert_eq!(items.len(), 2);
        assert_eq!(items[0].text(tags::SEGMENT_LABEL).as_deref(), Some("Ödem"));
        assert_eq!(items[0].u16(tags::SEGMENT_NUMBER), Some(7));
        assert_eq!(parsed.data.decimals(tags::PIXEL_SPACING).unwrap().unwrap(), [1.0, 0.5]);
        assert_eq!(parsed.data.decimals(tags::CONTOUR_DATA).unwrap().unwrap(), many);
        assert!(parsed.data.has(tags::PATIENT_NAME) && parsed.data.text(tags::PATIENT_NAME).is_none());
    }
}
