//! Texts in the character sets of DICOM (PS3.5 6.1, PS3.3 C.12.1.1.2).

use encoding_rs::Encoding;

/// The character sets of a data set: that of the first part of each text, and those that escape sequences select.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct CharacterSet {
    /// Defined terms as stored: `ISO_IR 100`; empty for the default repertoire.
    terms: Vec<String>,
}

impl CharacterSet {
    /// Of the terms of Specific Character Set.
    pub fn of(terms: Vec<String>) -> Self {
        Self { terms }
    }

    /// The text of `bytes`. What can't be decoded is shown as such (U+FFFD); an unknown character set as Latin-1, in which
    /// every byte is a letter.
    pub fn decode(&self, bytes: &[u8]) -> String {
        if bytes.is_ascii() && !bytes.contains(&0x1b) {
            return bytes.iter().map(|&b| char::from(b)).collect();
        }
        let first = self.terms.first().map_or("", String::as_str);
        if bytes.contains(&0x1b) { self.with_escapes(bytes) } else { decode_in(encoding(first), bytes) }
    }

    /// Each part in the character set that the escape sequence before it selects; delimiters return to the first.
    fn with_escapes(&self, bytes: &[u8]) -> String {
        let initial = encoding(self.terms.first().map_or("", String::as_str));
        let (mut out, mut current, mut part) = (String::new(), initial, Vec::new());
        let mut at = 0;
        while at < bytes.len() {
            let rest = &bytes[at..];
            if rest[0] == 0x1b
                && let Some((sequence, selected)) = ESCAPES.iter().find(|(s, _)| rest[1..].starts_with(s))
            {
                out.push_str(&decode_in(current, &std::mem::take(&mut part)));
                current = selected.unwrap_or(initial);
                at += 1 + sequence.len();
                continue;
            }
            if matches!(rest[0], b'^' | b'=' | b'\\' | b'\n' | b'\r')
                && !matches!(current, Set::Kanji | Set::KanjiSupplement)
            {
                part.push(rest[0]);
                out.push_str(&decode_in(current, &std::mem::take(&mut part)));
                current = initial;
            } else {
                part.push(rest[0]);
            }
            at += 1;
        }
        out.push_str(&decode_in(current, &part));
        out
    }
}

/// How the bytes of a part are read.
#[derive(Clone, Copy)]
enum Set {
    /// One of the encodings of the web.
    Web(&'static Encoding),
    /// Every byte a letter: ISO 8859-1.
    Latin1,
    /// JIS X 0201: ASCII and half-width katakana.
    Katakana,
    /// JIS X 0208, two bytes of seven bits each.
    Kanji,
    /// JIS X 0212, two bytes of seven bits each.
    KanjiSupplement,
}

/// Escape sequences behind the escape character (PS3.3 table C.12-3 and C.12-4), and what they select; `None`: the first.
const ESCAPES: [(&[u8], Option<Set>); 17] = [
    (b"(B", None),
    (b"-A", Some(Set::Latin1)),
    (b"-B", Some(Set::Web(encoding_rs::ISO_8859_2))),
    (b"-C", Some(Set::Web(encoding_rs::ISO_8859_3))),
    (b"-D", Some(Set::Web(encoding_rs::ISO_8859_4))),
    (b"-L", Some(Set::Web(encoding_rs::ISO_8859_5))),
    (b"-G", Some(Set::Web(encoding_rs::ISO_8859_6))),
    (b"-F", Some(Set::Web(encoding_rs::ISO_8859_7))),
    (b"-H", Some(Set::Web(encoding_rs::ISO_8859_8))),
    (b"-M", Some(Set::Web(encoding_rs::WINDOWS_1254))),
    (b"-T", Some(Set::Web(encoding_rs::WINDOWS_874))),
    (b")I", Some(Set::Katakana)),
    (b"(J", Some(Set::Katakana)),
    (b"$B", Some(Set::Kanji)),
    (b"$(D", Some(Set::KanjiSupplement)),
    (b"$)C", Some(Set::Web(encoding_rs::EUC_KR))),
    (b"$)A", Some(Set::Web(encoding_rs::GBK))),
];

/// The character set of a defined term, with or without code extensions.
fn encoding(term: &str) -> Set {
    let number = term.trim().rsplit(' ').next().unwrap_or_default();
    match number {
        "101" => Set::Web(encoding_rs::ISO_8859_2),
        "109" => Set::Web(encoding_rs::ISO_8859_3),
        "110" => Set::Web(encoding_rs::ISO_8859_4),
        "144" => Set::Web(encoding_rs::ISO_8859_5),
        "127" => Set::Web(encoding_rs::ISO_8859_6),
        "126" => Set::Web(encoding_rs::ISO_8859_7),
        "138" => Set::Web(encoding_rs::ISO_8859_8),
        "148" => Set::Web(encoding_rs::WINDOWS_1254),
        "166" => Set::Web(encoding_rs::WINDOWS_874),
        "203" => Set::Web(encoding_rs::ISO_8859_15),
        "13" => Set::Katakana,
        "149" => Set::Web(encoding_rs::EUC_KR),
        "192" => Set::Web(encoding_rs::UTF_8),
        "58" | "GBK" => Set::Web(encoding_rs::GBK),
        "GB18030" => Set::Web(encoding_rs::GB18030),
        _ => Set::Latin1,
    }
}

fn decode_in(set: Set, bytes: &[u8]) -> String {
    match set {
        Set::Latin1 => bytes.iter().map(|&b| char::from(b)).collect(),
        Set::Web(encoding) => encoding.decode_without_bom_handling(bytes).0.into_owned(),
        // Half-width katakana are one byte in Shift JIS, too.
        Set::Katakana => encoding_rs::SHIFT_JIS.decode_without_bom_handling(bytes).0.into_owned(),
        Set::Kanji => {
            let eight_bits: Vec<u8> = bytes.iter().map(|b| b | 0x80).collect();
            encoding_rs::EUC_JP.decode_without_bom_handling(&eight_bits).0.into_owned()
        }
        Set::KanjiSupplement => {
            let three =
                bytes.chunks(2).flat_map(|pair| [0x8f].into_iter().chain(pair.iter().map(|b| b | 0x80)));
            let three: Vec<u8> = three.collect();
            encoding_rs::EUC_JP.decode_without_bom_handling(&three).0.into_owned()
        }
    }
}
