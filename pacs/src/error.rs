//! Why a server's answer can't be used, in one line each: the server, what was found, what was expected.

use std::path::{Path, PathBuf};

use crate::text::clean;

/// An error of a search, a retrieval or a store. Texts of servers in it are short, in one line and without credentials.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A server's address can't be used. Nothing was sent.
    #[error("server address: found {found}, expected {expected}")]
    Address {
        /// What is wrong with it, never its user information.
        found: String,
        /// What would be right.
        expected: &'static str,
    },
    /// Credentials can't be used. Nothing was sent.
    #[error("credentials: found {found}, expected {expected}")]
    Credentials {
        /// What is wrong, never the secret.
        found: &'static str,
        /// What would be right.
        expected: &'static str,
    },
    /// A search's value can't be used. Nothing was sent.
    #[error("{field}: found \"{found}\", expected {expected}")]
    Value {
        /// Which value.
        field: &'static str,
        /// The value, shortened.
        found: String,
        /// What would be right.
        expected: &'static str,
    },
    /// Status 401.
    #[error("{server}: found status 401 ({sent}), expected a user and password or a token that it knows")]
    Unauthorized {
        /// The server.
        server: String,
        /// Which kind of credentials were sent.
        sent: &'static str,
    },
    /// Status 403.
    #[error("{server}: found status 403 for {asked}, expected permission for this user")]
    Forbidden {
        /// The server.
        server: String,
        /// What was asked for.
        asked: String,
    },
    /// Status 404, or a study without instances.
    #[error("{server}: found status 404 or an empty list for {asked}, expected it on this server")]
    NotFound {
        /// The server.
        server: String,
        /// What was asked for.
        asked: String,
    },
    /// Any other status that isn't a success.
    #[error("{server}: found status {status} for {asked}{text}, expected 200")]
    Status {
        /// The server.
        server: String,
        /// HTTP status.
        status: u16,
        /// What was asked for.
        asked: String,
        /// The server's explanation, in brackets, or nothing.
        text: String,
    },
    /// The server was silent for too long.
    #[error("{server}: found no sign of life for {seconds} s, expected an answer")]
    Timeout {
        /// The server.
        server: String,
        /// How long was waited, in seconds.
        seconds: u64,
    },
    /// No connection, or one that broke.
    #[error("{server}: found no connection ({reason}), expected a server at this address")]
    Unreachable {
        /// The server.
        server: String,
        /// What the system says.
        reason: String,
    },
    /// The connection can't be encrypted, or the server isn't proven to be the one of its name.
    #[error(
        "{server}: found no trusted encryption ({reason}), expected TLS with a certificate of a known authority"
    )]
    Tls {
        /// The server.
        server: String,
        /// What TLS says.
        reason: String,
    },
    /// A redirection that isn't followed.
    #[error("{server}: found a redirection to {to}, expected {expected}")]
    Redirect {
        /// The server.
        server: String,
        /// Scheme and host of where it leads.
        to: String,
        /// What would be right.
        expected: &'static str,
    },
    /// Another kind of answer.
    #[error("{server}: found {found}, expected {expected} of DICOMweb")]
    NotDicomWeb {
        /// The server.
        server: String,
        /// What came.
        found: String,
        /// What should have come.
        expected: &'static str,
    },
    /// An answer that ended early. Whole instances before the cut are kept.
    #[error("{server}: found an answer that is cut ({reason}), expected its end")]
    Cut {
        /// The server.
        server: String,
        /// What ended it.
        reason: String,
    },
    /// More than is kept.
    #[error("{server}: found {found}, expected at most {most}")]
    TooLarge {
        /// The server, or the cache.
        server: String,
        /// What was too large.
        found: String,
        /// The limit.
        most: String,
    },
    /// A file or folder on this machine.
    #[error("{path}: found {found}, expected {expected}", path = path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What is wrong.
        found: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The user cancelled. Whole instances are kept.
    #[error("cancelled")]
    Cancelled,
}

impl Error {
    /// A failed operation on a file of this machine.
    pub(crate) fn file(path: &Path, error: &std::io::Error, expected: &'static str) -> Self {
        Self::File { path: path.to_owned(), found: clean(&error.to_string(), 200), expected }
    }

    /// Whether the server answered and refused this one request, so that others may succeed.
    pub(crate) fn is_about_one_request(&self) -> bool {
        matches!(self, Self::NotFound { .. } | Self::Status { .. })
    }
}
