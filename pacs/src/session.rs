//! Requests of one call: connections that a cancellation closes, redirections, and what failures mean.

use std::io::{self, Read as _};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use ureq::http::{HeaderMap, Response, header};
use ureq::{Agent, Body, SendBody};

use crate::address::Address;
use crate::client::{Cancel, Client};
use crate::error::Error;
use crate::reader::Reader;
use crate::text::clean;

/// How often a cancellation is looked for while a server is silent.
const CANCEL_INTERVAL: Duration = Duration::from_millis(50);

/// Most redirections of one request.
const MAX_REDIRECTIONS: usize = 5;

/// Most bytes of an explanation that are read.
const MAX_EXPLANATION_BYTES: u64 = 4 << 10;

/// Connections of one call.
pub(crate) struct Session<'a> {
    pub client: &'a Client,
    pub cancel: Cancel<'a>,
    agent: Agent,
}

impl Client {
    /// Runs `work` with connections that are closed as soon as `cancel` says so.
    ///
    /// # Errors
    /// Those of `work`; [`Error::Cancelled`] instead where it failed after a cancellation.
    pub(crate) fn session<T>(
        &self,
        cancel: Cancel<'_>,
        work: impl FnOnce(&Session<'_>) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let session = Session { client: self, cancel, agent: self.agent() };
        let agent = session.agent.clone();
        let (running, ended) = mpsc::channel::<()>();
        let result = thread::scope(|scope| {
            let watch = move || {
                while ended.recv_timeout(CANCEL_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                    if cancel() {
                        return agent.shutdown();
                    }
                }
            };
            // Without a watcher a cancellation is seen between two reads.
            let _ = thread::Builder::new().name("pacs-cancel".to_owned()).spawn_scoped(scope, watch);
            // Moved in, so that it is dropped, which ends the watcher, also when the work panics.
            let _running = running;
            session.check().and_then(|()| work(&session))
        });
        match result {
            Err(_) if cancel() => Err(Error::Cancelled),
            other => other,
        }
    }
}

impl Session<'_> {
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn check(&self) -> Result<(), Error> {
        if (self.cancel)() { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// The successful answer to a request for what lies at `path` below the root; `asked` names it in messages.
    ///
    /// # Errors
    /// No connection, another status, a redirection that would show data or credentials to others.
    pub fn get(&self, path: &str, accept: &str, asked: &str) -> Result<Response<Body>, Error> {
        let mut at = self.client.root.below(path);
        let mut is_trusted = true;
        for _ in 0..=MAX_REDIRECTIONS {
            let mut request = self.agent.get(at.text()).header(header::ACCEPT, accept);
            if let Some(authorization) = self.client.authorization.as_ref().filter(|_| is_trusted) {
                request = request.header(header::AUTHORIZATION, authorization);
            }
            let answer = request.call().map_err(|error| self.failure(error, at.is_https))?;
            if !answer.status().is_redirection() {
                return self.accepted(answer, asked, is_trusted);
            }
            at = self.next(&at, answer.headers())?;
            // Credentials are for one origin: whoever sent us elsewhere doesn't choose what they are shown to afterwards.
            is_trusted &= at.origin() == self.client.root.origin();
        }
        Err(self.redirect(&at, "at most five of them"))
    }

    /// Where a redirection leads.
    fn next(&self, from: &Address, headers: &HeaderMap) -> Result<Address, Error> {
        let location = headers.get(header::LOCATION).and_then(|value| value.to_str().ok());
        let to = location.and_then(|location| from.follow(location).ok()).ok_or_else(|| {
            let to = location.map_or_else(|| "nowhere".to_owned(), |_| "an unusable address".to_owned());
            Error::Redirect { server: self.client.name.clone(), to, expected: "an http or https address" }
        })?;
        if from.is_https && !to.is_https {
            return Err(self.redirect(&to, "one that stays encrypted"));
        }
        if to.is_loopback() && !self.client.root.is_loopback() {
            return Err(self.redirect(&to, "one that doesn't lead to this machine"));
        }
        if !to.is_https && !to.is_loopback() && !self.client.allow_insecure {
            return Err(self.redirect(&to, "https, or http allowed for this server"));
        }
        Ok(to)
    }

    fn redirect(&self, to: &Address, expected: &'static str) -> Error {
        Error::Redirect { server: self.client.name.clone(), to: clean(&to.origin(), 100), expected }
    }

    /// The answer, of any status but 401, 403 and redirections, to `body` of `length` bytes, posted to `path` below the root.
    ///
    /// # Errors
    /// No connection; 401 or 403; any redirection: files go only where the user said.
    pub fn post(
        &self,
        path: &str,
        content_type: &str,
        length: u64,
        body: &mut dyn io::Read,
    ) -> Result<Response<Body>, Error> {
        let at = self.client.root.below(path);
        let mut request = self
            .agent
            .post(at.text())
            .header(header::ACCEPT, "application/dicom+json")
            .header(header::CONTENT_TYPE, content_type)
            .header(header::CONTENT_LENGTH, length);
        if let Some(authorization) = &self.client.authorization {
            request = request.header(header::AUTHORIZATION, authorization);
        }
        let answer =
            request.send(SendBody::from_reader(body)).map_err(|error| self.failure(error, at.is_https))?;
        match answer.status().as_u16() {
            401 | 403 => self.accepted(answer, "storing files", true),
            _ if answer.status().is_redirection() => {
                let to = self.next(&at, answer.headers())?;
                Err(self.redirect(&to, "the address that accepts files"))
            }
            _ => Ok(answer),
        }
    }

    /// The answer, if its status is a success.
    fn accepted(
        &self,
        answer: Response<Body>,
        asked: &str,
        is_trusted: bool,
    ) -> Result<Response<Body>, Error> {
        let server = self.client.name.clone();
        let asked = clean(asked, 160);
        match answer.status().as_u16() {
            200..=299 => Ok(answer),
            401 => {
                let sent = match &self.client.credentials {
                    Some(credentials) if is_trusted => credentials.kind(),
                    Some(_) => "after a redirection to another host, which was sent no credentials",
                    None => "no credentials were sent",
                };
                Err(Error::Unauthorized { server, sent })
            }
            403 => Err(Error::Forbidden { server, asked }),
            404 => Err(Error::NotFound { server, asked }),
            status => {
                let text = self.text(answer, MAX_EXPLANATION_BYTES);
                let text = self.explanation(&text).map_or_else(String::new, |text| format!(" ({text})"));
                Err(Error::Status { server, status, asked, text })
            }
        }
    }

    /// An answer's text, of at most `most` bytes, as far as it comes.
    pub fn text(&self, answer: Response<Body>, most: u64) -> String {
        let mut bytes = Vec::new();
        // Half an explanation is better than none.
        let _ = Reader::new(answer.into_body(), u64::MAX, self.cancel).take(most).read_to_end(&mut bytes);
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// What an answer's text says about a failure, short; nothing where that is a web page or data.
    pub fn explanation(&self, text: &str) -> Option<String> {
        let stated = match serde_json::from_str::<serde_json::Value>(text) {
            // Orthanc's form.
            Ok(json) => {
                let of = |key: &str| json.get(key).and_then(serde_json::Value::as_str);
                of("Details").or_else(|| of("Message"))?.to_owned()
            }
            Err(_) if text.trim_start().starts_with(['<', '{', '[']) => return None,
            Err(_) => text.to_owned(),
        };
        Some(self.client.said(&stated)).filter(|text| !text.is_empty())
    }

    /// What a failure of the connection means.
    fn failure(&self, error: ureq::Error, is_https: bool) -> Error {
        let server = self.client.name.clone();
        let timeouts = &self.client.timeouts;
        let unreachable = |reason: String| Error::Unreachable { server: server.clone(), reason };
        match error {
            ureq::Error::Timeout(ureq::Timeout::Connect | ureq::Timeout::Resolve) => {
                Error::Timeout { server, seconds: timeouts.connect.as_secs() }
            }
            ureq::Error::Timeout(_) => Error::Timeout { server, seconds: timeouts.silence.as_secs() },
            ureq::Error::HostNotFound => unreachable("no machine of this name is known".to_owned()),
            ureq::Error::Io(error) => match error.kind() {
                io::ErrorKind::ConnectionRefused => unreachable("refused: nothing listens there".to_owned()),
                io::ErrorKind::TimedOut => Error::Timeout { server, seconds: timeouts.silence.as_secs() },
                // What TLS doesn't accept arrives as invalid data.
                io::ErrorKind::InvalidData if is_https => {
                    Error::Tls { server, reason: self.client.said(&error.to_string()) }
                }
                _ => unreachable(self.client.said(&error.to_string())),
            },
            ureq::Error::Rustls(error) => Error::Tls { server, reason: self.client.said(&error.to_string()) },
            ureq::Error::Tls(reason) => Error::Tls { server, reason: self.client.said(reason) },
            ureq::Error::Protocol(error) => {
                let found = format!("no HTTP ({})", self.client.said(&error.to_string()));
                Error::NotDicomWeb { server, found, expected: "an answer" }
            }
            ureq::Error::LargeResponseHeader(_, most) => {
                Error::TooLarge { server, found: "longer headers".to_owned(), most: format!("{most} bytes") }
            }
            other => unreachable(self.client.said(&other.to_string())),
        }
    }
}

/// The media type of an answer in lower case with its parameters, if it states one.
pub(crate) fn content_type(answer: &Response<Body>) -> Option<String> {
    let value = answer.headers().get(header::CONTENT_TYPE)?.to_str().ok()?;
    Some(value.to_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::client::Server;

    #[test]
    fn redirections_stay_as_safe_as_the_server() {
        let next = |root: &str, allow_insecure: bool, location: &'static str| {
            let mut server = Server::new(root).unwrap();
            server.allow_insecure = allow_insecure;
            let client = server.connect().unwrap();
            let session = Session { client: &client, cancel: &|| false, agent: client.agent() };
            let mut headers = HeaderMap::new();
            headers.insert(header::LOCATION, location.parse().unwrap());
            let next = session.next(&client.root.below("studies"), &headers);
            next.map(|to| to.text()).map_err(|error| error.to_string())
        };
        assert_eq!(next("https://h/a", false, "https://i/b").unwrap(), "https://i/b");
        assert_eq!(next("https://h/a", false, "b").unwrap(), "https://h/a/b");
        assert_eq!(next("http://h/a", true, "http://i/b").unwrap(), "http://i/b");
        for (root, allow_insecure, location, expected) in [
            ("https://h/a", true, "http://h/a", "one that stays encrypted"),
            ("https://h/a", false, "https://127.0.0.1/", "doesn't lead to this machine"),
            ("http://h/a", true, "http://localhost:631/", "doesn't lead to this machine"),
            ("http://127.0.0.1/", false, "http://h/", "http allowed for this server"),
        ] {
            let error = next(root, allow_insecure, location).unwrap_err();
            assert!(error.contains(expected), "{root} {location}: {error}");
        }
    }
}
