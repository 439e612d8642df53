//! Searching: pages, limits, and everything that a server may answer instead.

#![allow(clippy::unwrap_used, reason = "a failed unwrap here is a failed test")]

mod mock;

use std::io::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use glioscope_pacs::{Error, Query, Server};
use mock::{INSTANCE, Mock, STUDY, answer, is_later_page, json, never, rows, uid};

fn search(mock: &Mock) -> Result<usize, Error> {
    mock.client().studies(&Query::default(), &never).map(|rows| rows.len())
}

fn fails(answer_of: impl Fn() -> mock::Answer + Send + Sync + 'static) -> String {
    search(&Mock::new(move |_| answer_of())).unwrap_err().to_string()
}

#[test]
fn statuses_have_their_errors() {
    let plain = |status| fails(move || answer(status, "Content-Type: text/plain\r\n", "no\r\n\u{1b}[31mway"));
    assert_eq!(
        plain(401),
        "mock: found status 401 (no credentials were sent), expected a user and password or a token that it knows"
    );
    assert_eq!(plain(403), "mock: found status 403 for a list of studies, expected permission for this user");
    assert_eq!(
        plain(404),
        "mock: found status 404 or an empty list for a list of studies, expected it on this server"
    );
    assert_eq!(
        plain(500),
        "mock: found status 500 for a list of studies (no way), expected 200".replace("way", "[31mway")
    );
    let html = fails(|| answer(502, "Content-Type: text/html\r\n", "<html>long page</html>"));
    assert_eq!(html, "mock: found status 502 for a list of studies, expected 200");
    let details = "{\"Details\":\"bad key\",\"HttpStatus\":400}";
    assert!(fails(move || answer(400, "", details)).contains("(bad key)"));
}

#[test]
fn other_answers_are_not_dicomweb() {
    let html = fails(|| answer(200, "Content-Type: text/html; charset=utf-8\r\n", "<html>"));
    assert_eq!(
        html,
        "mock: found an answer of type \"text/html; charset=utf-8\", expected DICOM JSON (application/dicom+json) of DICOMweb"
    );
    for text in ["<html>", "", "{}", "[1]", "[{}", "[{}] x", "[{\"0020000D\":{\"Value\":[\"1.2\"]}},"] {
        let error = fails(move || json(text));
        assert!(error.starts_with("mock: found other text ("), "{text}: {error}");
    }
    let error = fails(|| Box::new(|stream| stream.write_all(b"SSH-2.0-OpenSSH_9\r\n\r\n").unwrap()));
    assert!(error.contains("no HTTP"), "{error}");
    let cut = fails(|| {
        Box::new(|stream| stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 99\r\n\r\n[{}").unwrap())
    });
    assert!(cut.contains("cut"), "{cut}");
}

#[test]
fn silence_refusal_and_cancellation_end_waiting() {
    let silent = Mock::new(|_| Box::new(|_| std::thread::sleep(Duration::from_secs(20))));
    let begin = Instant::now();
    assert!(matches!(search(&silent), Err(Error::Timeout { .. })));
    let stuck = Mock::new(|_| {
        Box::new(|stream| {
            stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 99\r\n\r\n[").unwrap();
            std::thread::sleep(Duration::from_secs(20));
        })
    });
    assert!(matches!(search(&stuck), Err(Error::Timeout { .. })));
    let mut server = silent.server();
    server.timeouts.silence = Duration::from_secs(60);
    let cancelled = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(100));
            cancelled.store(true, Ordering::Relaxed);
        });
        let cancel = || cancelled.load(Ordering::Relaxed);
        let result = server.connect().unwrap().studies(&Query::default(), &cancel);
        assert!(matches!(result, Err(Error::Cancelled)), "{result:?}");
    });
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let client = Server::new(&format!("http://{free}")).unwrap().connect().unwrap();
    let error = client.studies(&Query::default(), &never).unwrap_err().to_string();
    assert!(error.contains("refused: nothing listens there"), "{error}");
}

#[test]
fn all_pages_are_read_whatever_their_size() {
    // At most 3 rows a page, whatever is asked for, and one that has no UID.
    let all: Vec<String> = (1..=8).map(|i| format!("1.{i}")).collect();
    let mock = Mock::new(move |request| {
        let offset = request.path.split("offset=").nth(1).map_or(0, |text| text.parse::<usize>().unwrap());
        json(rows(STUDY, all.iter().skip(offset).take(3).map(String::as_str)))
    });
    assert_eq!(search(&mock).unwrap(), 8);
    let limited = Query { limit: Some(4), offset: 2, ..Query::default() };
    let found = mock.client().studies(&limited, &never).unwrap();
    let found: Vec<_> = found.iter().map(|row| row.uid.clone().unwrap().to_string()).collect();
    assert_eq!(found, ["1.3", "1.4", "1.5", "1.6"]);
    // Pages that are ignored, no pages at all, nothing.
    let same = Mock::new(|_| json(rows(STUDY, ["1.1", "../..", "1.2"])));
    assert_eq!(search(&same).unwrap(), 3);
    assert_eq!(search(&Mock::new(|_| answer(204, "", ""))).unwrap(), 0);
    assert_eq!(search(&Mock::new(|_| json("[]"))).unwrap(), 0);
}

#[test]
fn odd_rows_are_unknown_and_paths_are_no_uids() {
    let text = r#"[{"0020000D":{"Value":["../../etc"]},"00100010":{"Value":[{"Alphabetic":"A^B\u001b"}]},
        "00201206":{"Value":["2"]},"00201208":{"Value":[-3]},"00080061":{"Value":["MR","SEG"]},"00080020":{}}]"#;
    let mock = Mock::new(move |request| json(if is_later_page(request) { "[]" } else { text }));
    let rows = mock.client().studies(&Query::default(), &never).unwrap();
    let row = &rows[0];
    assert_eq!((row.uid.as_ref(), row.patient_name.as_deref()), (None, Some("A^B")));
    assert_eq!((row.series, row.instances, row.date.as_ref()), (Some(2), None, None));
    assert_eq!(row.modalities, ["MR", "SEG"]);
}

#[test]
fn what_is_asked_is_encoded() {
    let mock = Mock::new(|_| json("[]"));
    let query = Query {
        patient_name: Some("O'Brien & Söhne*".to_owned()),
        from: Some("20200101".to_owned()),
        to: Some("20201231".to_owned()),
        study: Some(uid("1.2")),
        ..Query::default()
    };
    mock.client().studies(&query, &never).unwrap();
    let path = &mock.requests()[0].path;
    assert!(
        path.starts_with(
            "/studies?PatientName=O%27Brien%20%26%20S%C3%B6hne*&StudyDate=20200101-20201231&StudyInstanceUID=1.2&"
        ),
        "{path}"
    );
    assert!(mock::header(&mock.requests()[0].head, "accept").unwrap().contains("dicom+json"));
}

#[test]
fn a_hundred_thousand_rows_are_read_and_more_refused() {
    let many = |count: usize| {
        let uids: Vec<String> = (0..count).map(|i| format!("1.{i}")).collect();
        let text = rows(INSTANCE, uids.iter().map(String::as_str));
        let mock = Mock::new(move |_| json(&text));
        let mut server = mock.server();
        server.timeouts.silence = Duration::from_secs(20);
        server.connect().unwrap().instances(&uid("1"), &uid("2"), &never).map(|rows| rows.len())
    };
    assert_eq!(many(100_000).unwrap(), 100_000);
    let error = many(100_001).unwrap_err().to_string();
    assert!(error.contains("found more rows, expected at most 100000"), "{error}");
    // Pages without end, none of them too large.
    let mock = Mock::new(|request| {
        let offset = request.path.split("offset=").nth(1).map_or(0, |text| text.parse::<usize>().unwrap());
        let uids: Vec<String> = (offset..offset + 30_000).map(|i| format!("1.{i}")).collect();
        json(rows(STUDY, uids.iter().map(String::as_str)))
    });
    let mut server = mock.server();
    server.timeouts.silence = Duration::from_secs(20);
    let error = server.connect().unwrap().studies(&Query::default(), &never).unwrap_err().to_string();
    assert!(error.contains("found more rows, expected at most 100000"), "{error}");
    assert_eq!(mock.requests().len(), 4);
}

#[test]
fn endless_answers_end() {
    let endless = |begin: &'static [u8]| {
        let mock = Mock::new(move |_| {
            Box::new(move |stream| {
                let _ = stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n\r\n");
                let _ = stream.write_all(begin);
                while stream.write_all(&[b' '; 1 << 16]).is_ok() {}
            })
        });
        let mut server = mock.server();
        server.timeouts.silence = Duration::from_secs(20);
        server.connect().unwrap().studies(&Query::default(), &never).unwrap_err().to_string()
    };
    for begin in [&b"["[..], b"[{\"0020000D\":{\"Value\":[\"1.2\"]}},", b"[{\"x\":\""] {
        let error = endless(begin);
        assert!(error.contains("found a longer answer, expected at most 167772160 bytes"), "{error}");
    }
    let headers = fails(|| {
        Box::new(|stream| {
            let _ = stream.write_all(b"HTTP/1.1 200 OK\r\nX: ");
            while stream.write_all(&[b'y'; 1 << 16]).is_ok() {}
        })
    });
    assert!(headers.starts_with("mock: found"), "{headers}");
}
