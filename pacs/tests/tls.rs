//! Encryption: only certificates of known authorities, only for their names.

#![allow(clippy::unwrap_used, reason = "a failed unwrap here is a failed test")]

use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::path::Path;
use std::sync::Arc;

use glioscope_pacs::{Error, Query, Server};
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};
use rustls::pki_types::PrivateKeyDer;

/// A TLS server for `name` that answers with an empty list and redirects `/away` to plain http; returns its port and its
/// authority's PEM.
fn tls_server(name: &str) -> (u16, String) {
    let mut authority = CertificateParams::new(Vec::new()).unwrap();
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let authority = CertifiedIssuer::self_signed(authority, KeyPair::generate().unwrap()).unwrap();
    let key = KeyPair::generate().unwrap();
    let own = CertificateParams::new(vec![name.to_owned()]).unwrap().signed_by(&key, &authority).unwrap();
    let config =
        rustls::ServerConfig::builder_with_provider(Arc::new(rustls::crypto::ring::default_provider()))
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_no_client_auth()
            .with_single_cert(vec![own.der().clone()], PrivateKeyDer::try_from(key.serialize_der()).unwrap())
            .unwrap();
    let config = Arc::new(config);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    std::thread::spawn(move || {
        for tcp in listener.incoming().flatten() {
            let connection = rustls::ServerConnection::new(Arc::clone(&config)).unwrap();
            let mut stream = rustls::StreamOwned::new(connection, tcp);
            let mut head = Vec::new();
            let mut byte = [0];
            while !head.ends_with(b"\r\n\r\n") && matches!(stream.read(&mut byte), Ok(1)) {
                head.push(byte[0]);
            }
            let answer: &[u8] = if head.starts_with(b"GET /away") {
                b"HTTP/1.1 302 X\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n"
            } else {
                b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n[]"
            };
            let _ = stream.write_all(answer);
            let _ = stream.flush();
        }
    });
    (port, authority.pem())
}

fn search(url: &str, authorities: Option<&Path>) -> Result<usize, Error> {
    let mut server = Server::new(url)?;
    server.authorities = authorities.map(Path::to_owned);
    server.connect()?.studies(&Query::default(), &|| false).map(|rows| rows.len())
}

fn pem_file(text: &str) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    file
}

#[test]
fn certificates_are_verified() {
    let (port, pem) = tls_server("localhost");
    let file = pem_file(&pem);
    let url = format!("https://localhost:{port}");
    assert_eq!(search(&url, Some(file.path())).unwrap(), 0);
    let unknown = search(&url, None).unwrap_err();
    assert!(matches!(unknown, Error::Tls { .. }), "{unknown:?}");
    let (_, other) = tls_server("localhost");
    let other = pem_file(&other);
    assert!(matches!(search(&url, Some(other.path())), Err(Error::Tls { .. })));
    let (port, pem) = tls_server("pacs.example");
    let file = pem_file(&pem);
    let error = search(&format!("https://localhost:{port}"), Some(file.path())).unwrap_err();
    assert!(
        matches!(error, Error::Tls { .. }) && error.to_string().contains("not valid for name"),
        "{error}"
    );
    // As a server without encryption answers.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n").unwrap();
        let _ = stream.read(&mut [0; 1000]);
    });
    let error = search(&format!("https://localhost:{port}"), Some(file.path())).unwrap_err();
    assert!(matches!(error, Error::Tls { .. }), "{error:?}");
}

#[test]
fn encryption_is_not_left() {
    let (port, pem) = tls_server("localhost");
    let file = pem_file(&pem);
    let error = search(&format!("https://localhost:{port}/away"), Some(file.path())).unwrap_err().to_string();
    assert!(
        error.contains("redirection to http://127.0.0.1:1, expected one that stays encrypted"),
        "{error}"
    );
}

#[test]
fn files_without_certificates_are_errors() {
    for text in ["", "hello", "-----BEGIN CERTIFICATE-----\n???\n-----END CERTIFICATE-----\n"] {
        let file = pem_file(text);
        let error = search("https://localhost", Some(file.path())).unwrap_err();
        assert!(matches!(error, Error::File { .. }), "{text}: {error}");
    }
    assert!(search("https://localhost", Some(Path::new("/nowhere/a.pem"))).is_err());
}
