//! What a server is told about who asks. Never in a file, a log, an address, `Debug` output or an error.

use std::fmt;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use ureq::http::HeaderValue;

use crate::error::Error;

/// Text that `Debug` shows as `***`, and that has no `Display`.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// Keeps `text`.
    pub fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("***")
    }
}

/// Who asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Credentials {
    /// A user and a password (RFC 7617).
    Basic {
        /// Name, without a colon.
        user: String,
        /// Password.
        password: Secret,
    },
    /// A token (RFC 6750).
    Bearer(Secret),
}

/// Environment variables that [`Credentials::from_environment`] reads: user, password, token.
const VARIABLES: [&str; 3] = ["GLIOSCOPE_PACS_USER", "GLIOSCOPE_PACS_PASSWORD", "GLIOSCOPE_PACS_TOKEN"];

/// In place of the secret.
const HIDDEN: &str = "***";

impl Credentials {
    /// Credentials of the environment: `GLIOSCOPE_PACS_TOKEN`, or `GLIOSCOPE_PACS_USER` and `GLIOSCOPE_PACS_PASSWORD`.
    /// `None` where none of the three is set.
    ///
    /// # Errors
    /// Half a pair, both kinds, or a value that isn't UTF-8.
    pub fn from_environment() -> Result<Option<Self>, Error> {
        Self::from_variables(|name| std::env::var_os(name).map(std::ffi::OsString::into_string))
    }

    fn from_variables<E>(read: impl Fn(&str) -> Option<Result<String, E>>) -> Result<Option<Self>, Error> {
        let expected = "GLIOSCOPE_PACS_TOKEN, or GLIOSCOPE_PACS_USER and GLIOSCOPE_PACS_PASSWORD";
        let wrong = |found| Err(Error::Credentials { found, expected });
        let mut values = [None, None, None];
        for (value, name) in values.iter_mut().zip(VARIABLES) {
            *value = match read(name) {
                None => None,
                Some(Ok(text)) => Some(text).filter(|text| !text.is_empty()),
                Some(Err(_)) => return wrong("a variable that isn't UTF-8"),
            };
        }
        match values {
            [None, None, None] => Ok(None),
            [None, None, Some(token)] => Ok(Some(Self::Bearer(Secret(token)))),
            [Some(user), Some(password), None] => Ok(Some(Self::Basic { user, password: Secret(password) })),
            [_, _, Some(_)] => wrong("a token beside a user or password"),
            _ => wrong("a user or a password alone"),
        }
    }

    /// The value of the header `Authorization`, marked as sensitive.
    ///
    /// # Errors
    /// Characters that a header can't have.
    pub(crate) fn header(&self) -> Result<HeaderValue, Error> {
        let (text, found) = match self {
            Self::Basic { user, .. } if user.contains(':') || user.chars().any(char::is_control) => {
                let found = "a user name with a colon or a control character";
                return Err(Error::Credentials { found, expected: "a name without" });
            }
            Self::Basic { .. } => (format!("Basic {}", self.encoded()), "a password that can't be sent"),
            Self::Bearer(token) => (format!("Bearer {}", token.0), "a token that can't be sent"),
        };
        let mut header = HeaderValue::from_str(&text)
            .map_err(|_| Error::Credentials { found, expected: "visible ASCII characters" })?;
        header.set_sensitive(true);
        Ok(header)
    }

    /// What is sent after the scheme's name.
    fn encoded(&self) -> String {
        match self {
            Self::Basic { user, password } => STANDARD.encode(format!("{user}:{}", password.0)),
            Self::Bearer(token) => token.0.clone(),
        }
    }

    /// What was sent, in words.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Basic { .. } => "user and password were sent",
            Self::Bearer(_) => "a token was sent",
        }
    }

    /// `text` without the secret and its encoded form, whatever the case of its letters: servers may send back what they were
    /// sent.
    pub(crate) fn removed_from(&self, text: &str) -> String {
        let (Self::Basic { password: secret, .. } | Self::Bearer(secret)) = self;
        let mut out = text.to_owned();
        for hidden in [&self.encoded(), &secret.0] {
            // Names of types and hosts are compared in lower case.
            let hidden = hidden.to_ascii_lowercase();
            let mut from = 0;
            while let Some(at) = out.get(from..).and_then(|rest| rest.to_ascii_lowercase().find(&hidden)) {
                if hidden.is_empty() {
                    break;
                }
                out.replace_range(from + at..from + at + hidden.len(), HIDDEN);
                from += at + HIDDEN.len();
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(pairs: &[(&str, &str)]) -> Result<Option<Credentials>, Error> {
        Credentials::from_variables(|name| {
            let found = pairs.iter().find(|(key, _)| *key == name);
            found.map(|(_, value)| Ok::<_, ()>((*value).to_owned()))
        })
    }

    #[test]
    fn the_secret_is_removed_whatever_its_case() {
        let found = read(&[("GLIOSCOPE_PACS_USER", "anna"), ("GLIOSCOPE_PACS_PASSWORD", "SecretPw*")]);
        let own = found.unwrap().unwrap();
        let text = "type text/secretpw* and SECRETPW*, ünïx SecretPw*secretPW*";
        assert_eq!(own.removed_from(text), "type text/*** and ***, ünïx ******");
        let encoded = own.encoded();
        assert_eq!(own.removed_from(&format!("Basic {encoded}")), "Basic ***");
    }

    #[test]
    fn variables_are_a_token_or_a_pair() {
        assert_eq!(read(&[]).unwrap(), None);
        assert_eq!(read(&[("GLIOSCOPE_PACS_USER", "")]).unwrap(), None);
        let pair = [("GLIOSCOPE_PACS_USER", "a"), ("GLIOSCOPE_PACS_PASSWORD", "b")];
        let basic = Credentials::Basic { user: "a".to_owned(), password: Secret::new("b") };
        assert_eq!(read(&pair).unwrap(), Some(basic));
        let token = ("GLIOSCOPE_PACS_TOKEN", "t");
        assert_eq!(read(&[token]).unwrap(), Some(Credentials::Bearer(Secret::new("t"))));
        assert!(read(&[pair[0]]).is_err() && read(&[pair[1]]).is_err() && read(&[pair[0], token]).is_err());
    }

    #[test]
    fn headers_are_those_of_the_standards_and_hidden() {
        let basic = Credentials::Basic { user: "Aladdin".to_owned(), password: Secret::new("open sesame") };
        let header = basic.header().unwrap();
        assert_eq!(header.to_str().unwrap(), "Basic QWxhZGRpbjpvcGVuIHNlc2FtZQ==");
        assert!(!format!("{header:?}{basic:?}").contains("sesame"));
        let error = Credentials::Bearer(Secret::new("canary\n")).header().unwrap_err();
        assert!(!format!("{error}{error:?}").contains("canary"));
        let user = Credentials::Basic { user: "a:b".to_owned(), password: Secret::new("") };
        assert!(user.header().is_err());
    }

    #[test]
    fn a_servers_echo_is_hidden() {
        let basic = Credentials::Basic { user: "Aladdin".to_owned(), password: Secret::new("open sesame") };
        let echo = "got QWxhZGRpbjpvcGVuIHNlc2FtZQ== of open sesame";
        assert_eq!(basic.removed_from(echo), "got *** of ***");
    }
}
