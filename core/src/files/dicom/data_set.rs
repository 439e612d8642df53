//! A data set in memory: elements by tag, and their values in the types that the standard gives them.

use std::ops::Range;
use std::sync::Arc;

use super::tags::{self, Tag};
use super::text;

/// Longest value that is decoded as text or numbers, apart from contours.
const MAX_VALUES: usize = 1 << 24;

/// The value of an element.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// Bytes as stored.
    Bytes(Vec<u8>),
    /// Items of a sequence.
    Items(Vec<DataSet>),
    /// Pixels without encapsulation: where they lie in the (inflated) file.
    Pixels(Range<usize>),
    /// Encapsulated pixels.
    Fragments(Box<Fragments>),
}

/// Encapsulated pixels, where they lie in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Fragments {
    /// The basic offset table; may be empty.
    pub offsets: Range<usize>,
    /// In the file's order.
    pub fragments: Vec<Range<usize>>,
}

/// Elements by tag, of a file or of one item of a sequence.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct DataSet {
    /// Sorted by tag. A vector, as an item of one element must not take the memory of a tree's node.
    elements: Vec<(Tag, Value)>,
    /// Whether numbers are stored with the most significant byte first.
    big_endian: bool,
    /// The character set of texts, as the data set or the one around it states.
    character_set: Arc<text::CharacterSet>,
}

/// A value that can't be what the standard asks for: what was found, and what was expected.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unusable {
    pub found: String,
    pub expected: String,
}

impl std::fmt::Display for Unusable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "found {}, expected {}", self.found, self.expected)
    }
}

impl Unusable {
    pub fn new(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { found: found.into(), expected: expected.into() }
    }
}

impl DataSet {
    /// Of elements in the file's order: of two with one tag, the first counts. `around`: the character set of the data
    /// set around it.
    pub fn new(mut elements: Vec<(Tag, Value)>, big_endian: bool, around: &Arc<text::CharacterSet>) -> Self {
        // Stable, so that the first of a tag stays the first.
        elements.sort_by_key(|(tag, _)| *tag);
        elements.dedup_by_key(|(tag, _)| *tag);
        elements.shrink_to_fit();
        let mut set = Self { elements, big_endian, character_set: Arc::clone(around) };
        if set.has(tags::SPECIFIC_CHARACTER_SET) {
            let terms = set.texts(tags::SPECIFIC_CHARACTER_SET);
            set.character_set = Arc::new(text::CharacterSet::of(terms));
        }
        set
    }

    pub fn character_set(&self) -> &Arc<text::CharacterSet> {
        &self.character_set
    }

    /// The elements again.
    pub fn into_elements(self) -> Vec<(Tag, Value)> {
        self.elements
    }

    /// The value of an element; `None` where it is absent.
    pub fn value(&self, tag: Tag) -> Option<&Value> {
        let at = self.elements.binary_search_by_key(&tag, |(tag, _)| *tag).ok()?;
        Some(&self.elements[at].1)
    }

    /// Whether there is an element, with or without a value.
    pub fn has(&self, tag: Tag) -> bool {
        self.value(tag).is_some()
    }

    /// Items of a sequence; none where it is absent.
    pub fn items(&self, tag: Tag) -> &[DataSet] {
        match self.value(tag) {
            Some(Value::Items(items)) => items,
            _ => &[],
        }
    }

    /// The first item of a sequence.
    pub fn item(&self, tag: Tag) -> Option<&DataSet> {
        self.items(tag).first()
    }

    fn bytes(&self, tag: Tag) -> Option<&[u8]> {
        match self.value(tag) {
            Some(Value::Bytes(bytes)) if bytes.len() <= MAX_VALUES => Some(bytes),
            _ => None,
        }
    }

    /// Text without padding; `None` where absent or empty. Identifiers and codes (UI, CS) as well as names.
    pub fn text(&self, tag: Tag) -> Option<String> {
        let text = self.character_set.decode(self.bytes(tag)?);
        let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
        (!text.is_empty()).then(|| text.to_owned())
    }

    /// Values of a text, which backslashes separate; none where absent.
    pub fn texts(&self, tag: Tag) -> Vec<String> {
        let text = self.text(tag).unwrap_or_default();
        if text.is_empty() {
            return Vec::new();
        }
        text.split('\\').map(|part| part.trim().to_owned()).collect()
    }

    /// A decimal or integer string (DS, IS) as numbers; `None` where absent or empty.
    ///
    /// # Errors
    /// [`Unusable`] where a part is no finite number: `nan`, `1,5`, an empty part.
    pub fn decimals(&self, tag: Tag) -> Result<Option<Vec<f64>>, Unusable> {
        let Some(text) = self.text(tag) else { return Ok(None) };
        let number = |part: &str| {
            let part = part.trim_matches(|c: char| c == '\0' || c.is_whitespace());
            // Rust's parser takes "nan", "inf" and an overflow to infinity.
            let is_plain = part.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b));
            part.parse::<f64>().ok().filter(|number| is_plain && number.is_finite())
        };
        let numbers: Option<Vec<f64>> = text.split('\\').map(number).collect();
        numbers.map(Some).ok_or_else(|| {
            let shown: String = text.chars().take(60).collect();
            Unusable::new(format!("{:?} at {tag}", shown), "finite decimal numbers")
        })
    }

    /// Exactly `N` decimals.
    ///
    /// # Errors
    /// As [`DataSet::decimals`], or another number of them.
    pub fn decimals_of<const N: usize>(&self, tag: Tag) -> Result<Option<[f64; N]>, Unusable> {
        let Some(numbers) = self.decimals(tag)? else { return Ok(None) };
        let count = numbers.len();
        let wrong = || Unusable::new(format!("{count} numbers at {tag}"), format!("{N}"));
        numbers.try_into().map(Some).map_err(|_| wrong())
    }

    /// One decimal.
    ///
    /// # Errors
    /// As [`DataSet::decimals_of`].
    pub fn decimal(&self, tag: Tag) -> Result<Option<f64>, Unusable> {
        Ok(self.decimals_of::<1>(tag)?.map(|[number]| number))
    }

    /// An integer string (IS).
    ///
    /// # Errors
    /// [`Unusable`] where it is none.
    pub fn integer(&self, tag: Tag) -> Result<Option<i64>, Unusable> {
        let Some(text) = self.text(tag) else { return Ok(None) };
        text.parse().map(Some).map_err(|_| {
            let shown: String = text.chars().take(60).collect();
            Unusable::new(format!("{shown:?} at {tag}"), "a whole number")
        })
    }

    /// Unsigned 16-bit numbers (US), and those of 32 bits (UL) where `bytes` is 4.
    fn unsigned(&self, tag: Tag, bytes: usize) -> Vec<u32> {
        let number = |chunk: &[u8]| {
            let fold = |n: u32, &byte: &u8| n << 8 | u32::from(byte);
            if self.big_endian { chunk.iter().fold(0, fold) } else { chunk.iter().rev().fold(0, fold) }
        };
        self.bytes(tag).unwrap_or_default().chunks_exact(bytes).map(number).collect()
    }

    /// An unsigned 16-bit number (US).
    pub fn u16(&self, tag: Tag) -> Option<u16> {
        self.unsigned(tag, 2).first().map(|&n| n as u16)
    }

    /// Unsigned 16-bit numbers (US).
    pub fn u16s(&self, tag: Tag) -> Vec<u16> {
        self.unsigned(tag, 2).into_iter().map(|n| n as u16).collect()
    }

    /// Unsigned 32-bit numbers (UL).
    pub fn u32s(&self, tag: Tag) -> Vec<u32> {
        self.unsigned(tag, 4)
    }

    /// A double (FD).
    pub fn double(&self, tag: Tag) -> Option<f64> {
        let bytes: [u8; 8] = self.bytes(tag)?.get(..8)?.try_into().ok()?;
        Some(if self.big_endian { f64::from_be_bytes(bytes) } else { f64::from_le_bytes(bytes) })
    }

    /// The element that holds pixels: integers, floats or doubles.
    pub fn pixels(&self) -> Option<(Tag, &Value)> {
        [tags::PIXEL_DATA, tags::FLOAT_PIXEL_DATA, tags::DOUBLE_FLOAT_PIXEL_DATA]
            .into_iter()
            .find_map(|tag| Some((tag, self.value(tag)?)))
    }
}
