//! Unique identifiers (PS3.5 9): the only text of a server that becomes part of a path or an address.

use std::fmt;
use std::str::FromStr;

use crate::error::Error;
use crate::text::clean;

/// A valid UID: up to 64 characters, numbers of digits between single dots. So it never is `.`, `..` or a path.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Uid(String);

impl Uid {
    /// The UID as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// A UID; padding (spaces, a zero byte) at its ends is dropped. `None` for any other text.
    pub(crate) fn read(text: &str) -> Option<Self> {
        let text = text.trim_matches([' ', '\0']);
        let is_number = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
        (text.len() <= 64 && text.split('.').all(is_number)).then(|| Self(text.to_owned()))
    }
}

impl FromStr for Uid {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::read(text).ok_or_else(|| Error::Value {
            field: "UID",
            found: clean(text, 80),
            expected: "numbers between dots, at most 64 characters",
        })
    }
}

impl fmt::Display for Uid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_numbers_between_dots_are_uids() {
        assert_eq!(Uid::read("1.2.840.0\0").unwrap().as_str(), "1.2.840.0");
        assert_eq!(Uid::read(&"1".repeat(64)).unwrap().as_str().len(), 64);
        let too_long = "1".repeat(65);
        for text in
            ["", ".", "..", "1..2", ".1", "1.", "../..", "1/2", "1.2\\3", "1.a", "1 .2", "١.٢", &too_long]
        {
            assert!(Uid::read(text).is_none(), "{text}");
        }
        let error = "1/../2\n".parse::<Uid>().unwrap_err().to_string();
        assert_eq!(error, "UID: found \"1/../2\", expected numbers between dots, at most 64 characters");
    }
}
