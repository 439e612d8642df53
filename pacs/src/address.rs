//! A server's address, and where a redirection leads.

use std::net::IpAddr;

use ureq::http::Uri;

use crate::error::Error;
use crate::text::clean;

/// An absolute `http` or `https` address without user information and fragment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Address {
    pub is_https: bool,
    /// In lower case; IPv6 in brackets.
    host: String,
    port: u16,
    /// Path and query, beginning with a slash.
    path: String,
}

impl Address {
    /// Reads an address.
    ///
    /// # Errors
    /// Anything but `http` and `https`; user information, which would end in logs and histories. It is never shown.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let expected = "https://host/path of a DICOMweb service";
        let wrong = |found: String| Error::Address { found, expected };
        let text = text.trim();
        let text = text.split_once('#').map_or(text, |(before, _)| before);
        let authority = text.split_once("//").map_or(text, |(_, after)| after);
        let authority = authority.split(['/', '?', '\\']).next().unwrap_or_default();
        if authority.contains('@') {
            let found = "a user name or password in the address".to_owned();
            return Err(Error::Address { found, expected: "credentials apart from the address" });
        }
        let uri: Uri = text.parse().map_err(|_| wrong(format!("\"{}\"", clean(text, 120))))?;
        let is_https = match uri.scheme_str() {
            Some("https") => true,
            Some("http") => false,
            _ => return Err(wrong(format!("\"{}\"", clean(text, 120)))),
        };
        let host = uri.host().unwrap_or_default().to_ascii_lowercase();
        // A port that isn't a number reads as none.
        let stated = uri.authority().map(|a| a.as_str().len()).unwrap_or_default();
        let has_port = stated > host.len();
        if host.is_empty() || uri.authority().is_some_and(|a| a.as_str().contains('@')) {
            return Err(wrong("no host".to_owned()));
        }
        let port = match uri.port_u16() {
            Some(port) => port,
            None if has_port => return Err(wrong("a port that is no number".to_owned())),
            None if is_https => 443,
            None => 80,
        };
        let path = uri.path_and_query().map_or("/", |p| p.as_str()).to_owned();
        let path = if path.starts_with('/') { path } else { format!("/{path}") };
        Ok(Self { is_https, host, port, path })
    }

    /// The address of a service's root: no query, no slash at its end.
    ///
    /// # Errors
    /// A query.
    pub fn root(text: &str) -> Result<Self, Error> {
        let mut root = Self::parse(text)?;
        if root.path.contains('?') {
            let found = "a query in the address".to_owned();
            return Err(Error::Address { found, expected: "the root of a DICOMweb service" });
        }
        root.path.truncate(root.path.trim_end_matches('/').len());
        Ok(root)
    }

    /// What lies below this root.
    pub fn below(&self, path: &str) -> Self {
        Self { path: format!("{}/{path}", self.path), ..self.clone() }
    }

    /// Where `location` (RFC 3986 4.2) leads from here.
    ///
    /// # Errors
    /// As [`Address::parse`].
    pub fn follow(&self, location: &str) -> Result<Self, Error> {
        let location = location.trim();
        if location.starts_with("//") {
            let scheme = if self.is_https { "https" } else { "http" };
            return Self::parse(&format!("{scheme}:{location}"));
        }
        let scheme = location.split(['/', '?', '#']).next().unwrap_or_default();
        if scheme.contains(':') {
            return Self::parse(location);
        }
        let path = self.path.split('?').next().unwrap_or_default();
        let joined = match location.bytes().next() {
            Some(b'/') => location.to_owned(),
            Some(b'?') => format!("{path}{location}"),
            _ => {
                let folder = path.rfind('/').map_or("", |at| &path[..at]);
                format!("{folder}/{location}")
            }
        };
        Self::parse(&format!("{}{joined}", self.origin()))
    }

    /// Scheme, host and port.
    pub fn origin(&self) -> String {
        let scheme = if self.is_https { "https" } else { "http" };
        let is_default = self.port == if self.is_https { 443 } else { 80 };
        let port = if is_default { String::new() } else { format!(":{}", self.port) };
        format!("{scheme}://{}{port}", self.host)
    }

    /// The whole address.
    pub fn text(&self) -> String {
        format!("{}{}", self.origin(), self.path)
    }

    /// Whether the host is this machine.
    pub fn is_loopback(&self) -> bool {
        let bare = self.host.trim_start_matches('[').trim_end_matches(']');
        bare == "localhost" || bare.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_and_written() {
        let root = Address::root(" https://PACS.example:8443/dicom-web/ ").unwrap();
        assert_eq!(root.text(), "https://pacs.example:8443/dicom-web");
        assert_eq!(root.below("studies?a=b").text(), "https://pacs.example:8443/dicom-web/studies?a=b");
        assert_eq!(Address::root("http://[::1]:80").unwrap().text(), "http://[::1]");
        for text in [
            "",
            "pacs",
            "ftp://a/b",
            "https://",
            "https:///a",
            "https://a:x/",
            "https://a/?q",
            "https://a b/",
        ] {
            assert!(Address::root(text).is_err(), "{text}");
        }
    }

    #[test]
    fn user_information_is_refused_and_not_shown() {
        for text in [
            "https://u:canary@h/",
            "https://canary@h",
            "u:canary@h",
            "https://u:can ary@h/canary",
            "//canary@h",
        ] {
            let error = Address::root(text).unwrap_err();
            assert!(!format!("{error} {error:?}").contains("canary"), "{text}: {error}");
        }
    }

    #[test]
    fn redirections_lead_where_browsers_go() {
        let at = Address::parse("https://h/a/b?c").unwrap();
        for (location, to) in [
            ("http://x:1/y", "http://x:1/y"),
            ("//x/y", "https://x/y"),
            ("/y#z", "https://h/y"),
            ("y?z", "https://h/a/y?z"),
            ("?z", "https://h/a/b?z"),
        ] {
            assert_eq!(at.follow(location).unwrap().text(), to, "{location}");
        }
        assert!(at.follow("javascript:alert(1)").is_err());
        assert!(at.follow("https://a@b/").is_err());
    }

    #[test]
    fn only_this_machine_is_loopback() {
        for (text, is) in [
            ("http://127.0.0.1", true),
            ("http://127.9.9.9:1", true),
            ("http://[::1]", true),
            ("http://LOCALHOST", true),
            ("http://localhost.example", false),
            ("http://127.0.0.1.example", false),
            ("http://10.0.0.1", false),
        ] {
            assert_eq!(Address::parse(text).unwrap().is_loopback(), is, "{text}");
        }
    }
}
