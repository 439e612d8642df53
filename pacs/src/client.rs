//! A server and a client of it.

use std::fmt;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use sha2::{Digest as _, Sha256};
use ureq::Agent;
use ureq::http::HeaderValue;
use ureq::tls::{PemItem, RootCerts, TlsConfig, parse_pem};

use crate::address::Address;
use crate::credentials::Credentials;
use crate::error::Error;
use crate::text::clean;

/// Largest file of certificates, in bytes.
const MAX_CERTIFICATES_BYTES: u64 = 4 << 20;

/// Asked often, also from another thread: whether the user cancelled.
pub type Cancel<'a> = &'a (dyn Fn() -> bool + Sync);

/// How long a silent server is waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// For its name, and then for a connection with encryption.
    pub connect: Duration,
    /// For the next bytes, in either direction. A large answer may take as long as it comes.
    pub silence: Duration,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self { connect: Duration::from_secs(10), silence: Duration::from_secs(60) }
    }
}

/// An archive's DICOMweb service.
#[derive(Clone, Debug)]
pub struct Server {
    /// What it is called in messages; scheme and host where it has no name.
    pub name: Option<String>,
    /// Who asks; nobody where the server knows no users.
    pub credentials: Option<Credentials>,
    /// How long it may be silent.
    pub timeouts: Timeouts,
    /// A PEM file of the authorities that are trusted for this server, instead of the system's.
    pub authorities: Option<PathBuf>,
    /// Allows plain `http` to another machine: everybody on the way reads patients' data and the password.
    pub allow_insecure: bool,
    root: Address,
}

impl Server {
    /// The service with its root at `url`, as `https://host/dicom-web`: without credentials, with the system's authorities.
    ///
    /// # Errors
    /// [`Error::Address`]: not `http` or `https`; user information or a query in it.
    pub fn new(url: &str) -> Result<Self, Error> {
        Ok(Self {
            name: None,
            credentials: None,
            timeouts: Timeouts::default(),
            authorities: None,
            allow_insecure: false,
            root: Address::root(url)?,
        })
    }

    /// A client. Nothing is sent yet.
    ///
    /// # Errors
    /// Plain `http` to another machine without [`Server::allow_insecure`]; credentials that can't be sent; a file of
    /// authorities that can't be read.
    pub fn connect(&self) -> Result<Client, Error> {
        if !self.root.is_https && !self.allow_insecure && !self.root.is_loopback() {
            let found = format!("plain http to another machine ({})", self.root.origin());
            return Err(Error::Address { found, expected: "https, or http allowed for this server" });
        }
        let roots = match &self.authorities {
            None => RootCerts::PlatformVerifier,
            Some(path) => authorities(path)?,
        };
        let name = self.name.as_deref().map(|name| clean(name, 80)).filter(|name| !name.is_empty());
        Ok(Client {
            name: name.unwrap_or_else(|| self.root.origin()),
            root: self.root.clone(),
            authorization: self.credentials.as_ref().map(Credentials::header).transpose()?,
            credentials: self.credentials.clone(),
            timeouts: self.timeouts,
            tls: TlsConfig::builder().root_certs(roots).build(),
            allow_insecure: self.allow_insecure,
        })
    }
}

/// The certificates of a PEM file.
fn authorities(path: &Path) -> Result<RootCerts, Error> {
    let expected = "a PEM file of certificates";
    let wrong = |found: &str| Error::File { path: path.to_owned(), found: found.to_owned(), expected };
    let failed = |error: std::io::Error| Error::file(path, &error, expected);
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    file.take(MAX_CERTIFICATES_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > MAX_CERTIFICATES_BYTES {
        return Err(wrong("more than 4 MiB"));
    }
    let mut certificates = Vec::new();
    for item in parse_pem(&bytes) {
        match item {
            Ok(PemItem::Certificate(certificate)) => certificates.push(certificate),
            Ok(_) => {}
            Err(_) => return Err(wrong("a broken PEM section")),
        }
    }
    if certificates.is_empty() {
        return Err(wrong("no certificate"));
    }
    Ok(RootCerts::new_with_certs(&certificates))
}

/// What asks one server. Each call has connections of its own, so that calls of several threads don't hinder each other.
pub struct Client {
    /// What the server is called in messages.
    pub(crate) name: String,
    pub(crate) root: Address,
    pub(crate) authorization: Option<HeaderValue>,
    pub(crate) credentials: Option<Credentials>,
    pub(crate) timeouts: Timeouts,
    pub(crate) allow_insecure: bool,
    tls: TlsConfig,
}

impl fmt::Debug for Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Client").field("name", &self.name).finish_non_exhaustive()
    }
}

impl Client {
    /// Connections with this client's settings.
    pub(crate) fn agent(&self) -> Agent {
        let mut config = Agent::config_builder()
            .tls_config(self.tls.clone())
            .http_status_as_error(false)
            // Redirections are followed by `session`, which knows when to drop credentials.
            .max_redirects(0)
            .max_redirects_will_error(false)
            .timeout_resolve(Some(self.timeouts.connect))
            .timeout_connect(Some(self.timeouts.connect))
            .timeout_per_read(Some(self.timeouts.silence))
            .timeout_per_write(Some(self.timeouts.silence))
            .user_agent(concat!("glioscope/", env!("CARGO_PKG_VERSION")));
        if self.root.is_loopback() {
            config = config.proxy(None);
        }
        config.build().new_agent()
    }

    /// Name of this server's folder in a cache: 16 hexadecimal digits of its address.
    pub(crate) fn folder_name(&self) -> String {
        let hash = Sha256::digest(self.root.text().as_bytes());
        hash.iter().take(8).map(|byte| format!("{byte:02x}")).collect()
    }

    /// A server's text: in one line, short, without the secret.
    pub(crate) fn said(&self, text: &str) -> String {
        let text = match &self.credentials {
            Some(credentials) => credentials.removed_from(text),
            None => text.to_owned(),
        };
        clean(&text, 200)
    }
}
