//! Text from outside, made fit to be shown, and text for addresses.

use std::fmt::Write as _;

/// `text` in one line of at most `most` characters: control characters become spaces, characters that hide or reorder
/// others vanish.
pub(crate) fn clean(text: &str, most: usize) -> String {
    let mut out = String::new();
    let mut length = 0;
    let visible = text.chars().filter(|&c| !is_misleading(c));
    for c in visible.map(|c| if c.is_control() { ' ' } else { c }) {
        if c == ' ' && (out.is_empty() || out.ends_with(' ')) {
            continue;
        }
        if length == most {
            out.push('…');
            break;
        }
        out.push(c);
        length += 1;
    }
    out.truncate(out.trim_end().len());
    out
}

/// Whether a character has no width, or changes the direction of others.
fn is_misleading(c: char) -> bool {
    matches!(c, '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2060}'..='\u{2069}' | '\u{feff}')
}

/// `text` as a value of an address's query (RFC 3986): what isn't unreserved is percent-encoded; `*` and `,`, which searches
/// use, stay.
pub(crate) fn encoded(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~*,".contains(&byte) {
            out.push(char::from(byte));
        } else {
            // Writing to a string can't fail.
            let _ = write!(out, "%{byte:02X}");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_one_bounded_line() {
        assert_eq!(clean("a\r\n\tb\u{1b}[31m\u{202e}c", 99), "a b [31mc");
        assert_eq!(clean("äöü", 2), "äö…");
        assert_eq!(clean(" \n ", 5), "");
    }

    #[test]
    fn queries_are_encoded() {
        assert_eq!(encoded("Müller^A*&x=1#/.."), "M%C3%BCller%5EA*%26x%3D1%23%2F..");
    }
}
