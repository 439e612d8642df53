//! Where credentials go, and that they are seen nowhere else: neither by other hosts, nor in texts, nor in logs.

#![allow(clippy::unwrap_used, reason = "a failed unwrap here is a failed test")]

mod mock;

use std::sync::{Mutex, PoisonError};

use glioscope_pacs::{Cache, Credentials, Error, Query, Secret, Server};
use mock::{Mock, answer, header, json, never, uid};

const CANARY: &str = "canary-5e4f";
/// `alice:canary-5e4f`, encoded.
const ENCODED: &str = "YWxpY2U6Y2FuYXJ5LTVlNGY=";

/// What was logged by anyone.
static LOG: Mutex<String> = Mutex::new(String::new());

struct Log;

impl log::Log for Log {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        let line = format!("{} {}: {}\n", record.level(), record.target(), record.args());
        LOG.lock().unwrap_or_else(PoisonError::into_inner).push_str(&line);
    }

    fn flush(&self) {}
}

fn basic() -> Credentials {
    Credentials::Basic { user: "alice".to_owned(), password: Secret::new(CANARY) }
}

fn is_clean(text: &str) -> bool {
    !text.contains(CANARY) && !text.contains(ENCODED)
}

fn search(server: &Server) -> Result<usize, Error> {
    server.connect()?.studies(&Query::default(), &never).map(|rows| rows.len())
}

#[test]
fn secrets_are_in_no_text_and_no_log() {
    let _ = log::set_logger(&Log);
    log::set_max_level(log::LevelFilter::Trace);
    for status in [200, 400, 401, 403, 404, 500] {
        // A server that sends everything back.
        let mock = Mock::new(move |request| answer(status, "Content-Type: text/plain\r\n", &request.head));
        for credentials in [basic(), Credentials::Bearer(Secret::new(CANARY))] {
            let mut server = mock.server();
            server.credentials = Some(credentials);
            let error = search(&server).unwrap_err();
            let client = server.connect().unwrap();
            let cache = Cache::open(tempfile::tempdir().unwrap().path(), 1 << 20).unwrap();
            let retrieved = client.retrieve(&uid("1.2"), None, &cache, &|_| (), &never);
            let text = format!("{server:?} {client:?} {error} {error:?} {retrieved:?}");
            assert!(is_clean(&text), "{text}");
            let sent = header(&mock.requests().last().unwrap().head, "authorization").unwrap();
            assert!(!is_clean(&sent), "the credentials weren't sent");
            assert!(mock.requests().iter().all(|request| is_clean(&request.path)));
        }
    }
    let log = LOG.lock().unwrap();
    // ureq logs requests, and at the level `trace` every byte as text: `log/max_level_debug` keeps it from that.
    assert!(log.contains("ureq"), "nothing was logged");
    let joined: String =
        log.lines().filter_map(|line| line.rsplit_once(": ")).map(|(_, text)| text).collect();
    assert!(is_clean(&log) && is_clean(&joined) && !log.contains("TRACE"), "{log}");
}

#[test]
fn other_hosts_get_no_credentials() {
    let other = Mock::new(|_| json("[]"));
    let target = format!("Location: {}/x\r\n", other.url);
    let mock = Mock::new(move |_| answer(307, &target, ""));
    let mut server = mock.server();
    server.credentials = Some(basic());
    assert_eq!(search(&server).unwrap(), 0);
    assert!(header(&mock.requests()[0].head, "authorization").is_some());
    assert_eq!(header(&other.requests()[0].head, "authorization"), None);

    // There and back: whoever sent us away doesn't choose where credentials go.
    let back = std::sync::Arc::new(Mutex::new(String::new()));
    let location = std::sync::Arc::clone(&back);
    let other =
        Mock::new(move |_| answer(302, &format!("Location: {}/back\r\n", location.lock().unwrap()), ""));
    let target = format!("Location: {}/x\r\n", other.url);
    let mock =
        Mock::new(move |request| if request.path == "/back" { json("[]") } else { answer(302, &target, "") });
    *back.lock().unwrap() = mock.url.clone();
    let mut server = mock.server();
    server.credentials = Some(basic());
    assert_eq!(search(&server).unwrap(), 0);
    assert_eq!(header(&mock.requests()[1].head, "authorization"), None);
    assert_eq!(header(&other.requests()[0].head, "authorization"), None);
}

#[test]
fn the_same_origin_keeps_them() {
    let mock = Mock::new(|request| {
        if request.path.starts_with("/studies") {
            answer(301, "Location: /new?x\r\n", "")
        } else {
            json("[]")
        }
    });
    let mut server = mock.server();
    server.credentials = Some(basic());
    search(&server).unwrap();
    assert_eq!(mock.requests()[1].path, "/new?x");
    assert!(header(&mock.requests()[1].head, "authorization").is_some());
}

#[test]
fn redirections_that_show_data_to_others_are_refused() {
    for (location, expected) in [
        ("http://192.0.2.1/x", "https, or http allowed"),
        ("ftp://127.0.0.1/", "an unusable address"),
        ("http://alice:pw@127.0.0.1/", "an unusable address"),
        ("/studies", "at most five of them"),
    ] {
        let mock = Mock::new(move |_| answer(302, &format!("Location: {location}\r\n"), ""));
        let error = search(&mock.server()).unwrap_err().to_string();
        assert!(error.contains(expected) && !error.contains("pw"), "{location}: {error}");
    }
    assert!(
        search(&Mock::new(|_| answer(302, "", "")).server()).unwrap_err().to_string().contains("nowhere")
    );
}

#[test]
fn plain_http_needs_permission() {
    let mut server = Server::new("http://192.0.2.1/dicom-web").unwrap();
    let error = server.connect().unwrap_err().to_string();
    assert!(error.contains("plain http to another machine (http://192.0.2.1)"), "{error}");
    server.allow_insecure = true;
    assert!(server.connect().is_ok());
}
