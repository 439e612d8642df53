//! A body that is read until a limit, a cancellation or a failure, and why it ended.

use std::io::{self, Read};

use ureq::{Body, BodyReader};

use crate::client::{Cancel, Client};
use crate::error::Error;

/// Why reading ended, carried through readers that know only `io::Error`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
enum Ended {
    #[error("more than the limit")]
    TooLarge,
    #[error("cancelled")]
    Cancelled,
}

/// An answer's body, of at most a number of bytes.
pub(crate) struct Reader<'a> {
    body: BodyReader<'static>,
    left: u64,
    most: u64,
    cancel: Cancel<'a>,
}

impl<'a> Reader<'a> {
    pub fn new(body: Body, most: u64, cancel: Cancel<'a>) -> Self {
        Self { body: body.into_reader(), left: most, most, cancel }
    }

    /// The error of `client`'s server for a failure of this reader.
    pub fn error(&self, client: &Client, error: &io::Error) -> Error {
        let server = client.name.clone();
        let inner = error.get_ref();
        if let Some(ended) = inner.and_then(|inner| inner.downcast_ref::<Ended>()) {
            return match ended {
                Ended::Cancelled => Error::Cancelled,
                Ended::TooLarge => Error::TooLarge {
                    server,
                    found: "a longer answer".to_owned(),
                    most: format!("{} bytes", self.most),
                },
            };
        }
        if let Some(ureq::Error::Timeout(_)) = inner.and_then(|inner| inner.downcast_ref()) {
            return Error::Timeout { server, seconds: client.timeouts.silence.as_secs() };
        }
        if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) {
            return Error::Timeout { server, seconds: client.timeouts.silence.as_secs() };
        }
        Error::Cut { server, reason: client.said(&error.to_string()) }
    }
}

impl Read for Reader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if (self.cancel)() {
            return Err(io::Error::other(Ended::Cancelled));
        }
        let read = self.body.read(buffer)?;
        self.left = match self.left.checked_sub(read as u64) {
            Some(left) => left,
            None => return Err(io::Error::other(Ended::TooLarge)),
        };
        Ok(read)
    }
}
