//! Retrieving: what is kept, what continues after a cut, and what isn't taken.

#![allow(clippy::unwrap_used, reason = "a failed unwrap here is a failed test")]

mod mock;

use std::cell::RefCell;
use std::io::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use glioscope_pacs::{Cache, Error, Progress, Retrieved};
use mock::{
    Answer, INSTANCE, Mock, Request, SERIES, answer, file, is_later_page, json, multipart, never, rows, uid,
};

const INSTANCES: [&str; 3] = ["1.2.3.1", "1.2.3.2", "1.2.3.3"];

fn own(instance: &str) -> Vec<u8> {
    file("1.2", "1.2.3", instance, 1000)
}

/// A server of study 1.2 with one series of three instances; `wado` answers what isn't a search.
fn server(wado: impl Fn(&Request) -> Answer + Send + Sync + 'static) -> Mock {
    Mock::new(move |request| {
        let path = request.path.split('?').next().unwrap();
        match path {
            _ if is_later_page(request) => json("[]"),
            "/studies/1.2/series" => json(rows(SERIES, ["1.2.3"])),
            "/studies/1.2/series/1.2.3/instances" => json(rows(INSTANCE, INSTANCES)),
            "/studies/1.9/series" => json("[]"),
            _ => wado(request),
        }
    })
}

fn retrieve(mock: &Mock, folder: &Path) -> Result<Retrieved, Error> {
    let cache = Cache::open(folder, 1 << 20).unwrap();
    mock.client().retrieve(&uid("1.2"), None, &cache, &|_| (), &never)
}

fn wado(mock: &Mock) -> Vec<String> {
    let paths = mock.requests().into_iter().map(|request| request.path);
    paths.filter(|path| !path.contains('?')).collect()
}

#[test]
fn a_study_is_retrieved_once() {
    let root = tempfile::tempdir().unwrap();
    let mock = server(|_| multipart(&INSTANCES.map(own), None));
    let cache = Cache::open(root.path(), 1 << 20).unwrap();
    let seen = RefCell::new(Vec::new());
    let progress = |now: Progress| seen.borrow_mut().push(now);
    let got = mock.client().retrieve(&uid("1.2"), None, &cache, &progress, &never).unwrap();
    assert_eq!((got.files.len(), got.from_cache, got.failed.len()), (3, 0, 0));
    for (path, instance) in got.files.iter().zip(INSTANCES) {
        assert_eq!(*path, got.folder.join("1.2.3").join(format!("{instance}.dcm")));
        assert_eq!(std::fs::read(path).unwrap(), own(instance));
    }
    let last = *seen.borrow().last().unwrap();
    assert_eq!((last.done, last.of, last.bytes), (3, 3, 3 * own("1.2.3.1").len() as u64));
    let accept = mock::header(&mock.requests().last().unwrap().head, "accept").unwrap();
    assert_eq!(accept, "multipart/related; type=\"application/dicom\"; transfer-syntax=*");
    assert_eq!(wado(&mock), ["/studies/1.2/series/1.2.3"]);
    let again = retrieve(&mock, root.path()).unwrap();
    assert_eq!((again.files, again.from_cache), (got.files, 3));
    assert_eq!(wado(&mock).len(), 1, "transferred again");
}

#[test]
fn a_cut_answer_is_an_error_and_its_whole_parts_stay() {
    let root = tempfile::tempdir().unwrap();
    let half = 2 * own("1.2.3.1").len();
    let cut = server(move |_| multipart(&INSTANCES.map(own), Some(half)));
    let error = retrieve(&cut, root.path()).unwrap_err().to_string();
    assert!(error.contains("cut (no last boundary)"), "{error}");
    assert_eq!(std::fs::read_dir(root.path().join("incoming")).unwrap().count(), 0);
    // The same server, later: only what is missing is transferred.
    let (mock, is_well) = server_with_state(half);
    let root = tempfile::tempdir().unwrap();
    retrieve(&mock, root.path()).unwrap_err();
    is_well.store(true, Ordering::Relaxed);
    let got = retrieve(&mock, root.path()).unwrap();
    assert_eq!((got.files.len(), got.from_cache, got.failed.len()), (3, 1, 0));
    assert_eq!(
        wado(&mock)[1..],
        ["/studies/1.2/series/1.2.3/instances/1.2.3.2", "/studies/1.2/series/1.2.3/instances/1.2.3.3"]
    );
}

/// A server whose answers are cut until it is told that they aren't.
fn server_with_state(cut: usize) -> (Mock, Arc<AtomicBool>) {
    let is_well = Arc::new(AtomicBool::new(false));
    let state = Arc::clone(&is_well);
    let mock = server(move |request| {
        if !state.load(Ordering::Relaxed) {
            return multipart(&INSTANCES.map(own), Some(cut));
        }
        multipart(&[own(request.path.rsplit('/').next().unwrap())], None)
    });
    (mock, is_well)
}

#[test]
fn what_a_series_lacks_is_asked_for_by_instance() {
    // Two of three in the series' answer; the third gone.
    let root = tempfile::tempdir().unwrap();
    let mock = server(|request| {
        if request.path.ends_with("/1.2.3") {
            multipart(&[own("1.2.3.1"), own("1.2.3.2")], None)
        } else {
            answer(404, "", "")
        }
    });
    let got = retrieve(&mock, root.path()).unwrap();
    assert_eq!(got.files.len(), 2);
    assert_eq!(got.failed[0].instance, Some(uid("1.2.3.3")));
    assert_eq!(
        got.failed[0].reason,
        "mock: found status 404 or an empty list for instance 1.2.3.3, expected it on this server"
    );
    // A series that fails as a whole, as some that are to be transcoded; no request for every instance.
    let root = tempfile::tempdir().unwrap();
    let mock = server(|_| answer(500, "", ""));
    let got = retrieve(&mock, root.path()).unwrap();
    assert_eq!((got.files.len(), got.failed.len(), wado(&mock).len()), (0, 3, 4));
    // Credentials that are refused aren't asked for thrice.
    let mock = server(|_| answer(401, "", ""));
    assert!(matches!(retrieve(&mock, root.path()), Err(Error::Unauthorized { .. })));
    assert_eq!(wado(&mock).len(), 1);
}

#[test]
fn other_files_are_not_taken() {
    let evil = file("1.2", "1.2.3", "../../../../evil", 10);
    for (content, found) in [
        (file("1.66", "1.2.3", "1.2.3.1", 10), "an instance of study 1.66, series 1.2.3"),
        (file("1.2", "1.66", "1.2.3.1", 10), "an instance of study 1.2, series 1.66"),
        (file("1.2", "1.2.3", "1.2.3.9", 10), "the instance 1.2.3.9"),
        (b"<html>not DICOM</html>".to_vec(), "no DICOM file"),
        (own("1.2.3.1")[..150].to_vec(), "a file that ends before"),
        (evil, "invalid UID"),
    ] {
        let root = tempfile::tempdir().unwrap();
        let mock = server(move |request| {
            if request.path.ends_with("/1.2.3") {
                answer(404, "", "")
            } else {
                multipart(std::slice::from_ref(&content), None)
            }
        });
        let got = retrieve(&mock, root.path()).unwrap();
        assert!(got.files.is_empty(), "{found}");
        assert!(got.failed.iter().any(|failed| failed.reason.contains(found)), "{found}: {:?}", got.failed);
        let left = Cache::open(root.path(), 1 << 20).unwrap();
        assert_eq!(left.size().unwrap(), 0, "{found}");
    }
}

#[test]
fn uids_that_are_paths_are_failures() {
    let root = tempfile::tempdir().unwrap();
    let mock = Mock::new(|request| match request.path.split('?').next().unwrap() {
        _ if is_later_page(request) => json("[]"),
        "/studies/1.2/series" => json(rows(SERIES, ["../../x", "1.2.3"])),
        "/studies/1.2/series/1.2.3/instances" => json(rows(INSTANCE, ["..", "1.2.3.1"])),
        _ => multipart(&[own("1.2.3.1")], None),
    });
    let got = retrieve(&mock, &root.path().join("cache")).unwrap();
    assert_eq!((got.files.len(), got.failed.len()), (1, 2));
    assert!(got.failed.iter().all(|failed| failed.instance.is_none()));
    assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 1);
    assert!(mock.requests().iter().all(|request| !request.path.contains("..")));
}

#[test]
fn unknown_studies_and_other_answers_are_errors() {
    let root = tempfile::tempdir().unwrap();
    let cache = Cache::open(root.path(), 1 << 20).unwrap();
    let mock = server(|_| answer(200, "Content-Type: text/html\r\n", "<html>"));
    let error = mock.client().retrieve(&uid("1.9"), None, &cache, &|_| (), &never).unwrap_err().to_string();
    assert!(
        error.starts_with("mock: found status 404 or an empty list for instances of study 1.9"),
        "{error}"
    );
    let error = retrieve(&mock, root.path()).unwrap_err().to_string();
    assert!(error.contains("an answer of type \"text/html\", expected DICOM files"), "{error}");
}

#[test]
fn endless_files_end_at_the_caches_limit() {
    let root = tempfile::tempdir().unwrap();
    let mock = server(|_| {
        Box::new(|stream| {
            let head = "HTTP/1.1 200 OK\r\nContent-Type: multipart/related; boundary=b\r\n\r\n--b\r\n\r\n";
            let _ = stream.write_all(head.as_bytes());
            while stream.write_all(&[0; 1 << 16]).is_ok() {}
        })
    });
    let error = retrieve(&mock, root.path()).unwrap_err().to_string();
    assert!(error.starts_with("cache of received studies: found"), "{error}");
    assert!(error.ends_with("expected at most 1048576 bytes"), "{error}");
    assert_eq!(std::fs::read_dir(root.path().join("incoming")).unwrap().count(), 0);
}

#[test]
fn cancelling_ends_a_silent_transfer_and_keeps_whole_instances() {
    let root = tempfile::tempdir().unwrap();
    let mock = server(|_| {
        Box::new(|stream| {
            multipart(&INSTANCES.map(own), Some(2 * own("1.2.3.1").len()))(stream);
            std::thread::sleep(Duration::from_secs(20));
        })
    });
    let mut settings = mock.server();
    settings.timeouts.silence = Duration::from_secs(60);
    let cache = Cache::open(root.path(), 1 << 20).unwrap();
    let done = AtomicUsize::new(0);
    let progress = |now: Progress| done.store(now.done as usize, Ordering::Relaxed);
    let cancel = || done.load(Ordering::Relaxed) == 1;
    let begin = std::time::Instant::now();
    let result = settings.connect().unwrap().retrieve(&uid("1.2"), None, &cache, &progress, &cancel);
    assert!(matches!(result, Err(Error::Cancelled)), "{result:?}");
    assert!(begin.elapsed() < Duration::from_secs(5));
    assert_eq!(cache.size().unwrap(), own("1.2.3.1").len() as u64);
}

#[test]
fn threads_may_retrieve_the_same_study() {
    let root = tempfile::tempdir().unwrap();
    let mock = server(|_| multipart(&INSTANCES.map(own), None));
    let results = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                results.lock().unwrap().push(retrieve(&mock, root.path()).map(|got| got.files.len()));
            });
        }
    });
    assert!(results.lock().unwrap().iter().all(|result| matches!(result, Ok(3))));
}

#[test]
fn connections_serve_several_requests() {
    // A server that keeps connections open, and that gives instances only one by one.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let connections = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&connections);
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            count.fetch_add(1, Ordering::Relaxed);
            std::thread::spawn(move || keep_alive(&stream));
        }
    });
    let root = tempfile::tempdir().unwrap();
    let cache = Cache::open(root.path(), 1 << 20).unwrap();
    let client = glioscope_pacs::Server::new(&url).unwrap().connect().unwrap();
    let got = client.retrieve(&uid("1.2"), None, &cache, &|_| (), &never).unwrap();
    assert_eq!((got.files.len(), got.failed.len()), (3, 0));
    assert_eq!(connections.load(Ordering::Relaxed), 1);
}

fn keep_alive(mut stream: &std::net::TcpStream) {
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(stream));
    while let Some(Ok(first)) = lines.next() {
        while lines.next().unwrap().is_ok_and(|line| !line.is_empty()) {}
        let path = first.split(' ').nth(1).unwrap();
        let is_empty = path.contains("offset=");
        let json = |text: String| {
            ("application/dicom+json", if is_empty { b"[]".to_vec() } else { text.into_bytes() })
        };
        let (kind, body) = match path.split('?').next().unwrap() {
            "/studies/1.2/series" => json(rows(SERIES, ["1.2.3"])),
            "/studies/1.2/series/1.2.3/instances" => json(rows(INSTANCE, INSTANCES)),
            "/studies/1.2/series/1.2.3" => ("multipart/related; boundary=b", b"--b--\r\n".to_vec()),
            path => {
                let content = own(path.rsplit('/').next().unwrap());
                (
                    "multipart/related; boundary=b",
                    [b"--b\r\n\r\n", &content[..], b"\r\n--b--\r\nend"].concat(),
                )
            }
        };
        let head =
            format!("HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n\r\n", body.len());
        stream.write_all(&[head.as_bytes(), &body].concat()).unwrap();
    }
}

#[test]
fn endless_parts_end() {
    let root = tempfile::tempdir().unwrap();
    let mock = server(|_| {
        Box::new(|stream| {
            let head = "HTTP/1.1 200 OK\r\nContent-Type: multipart/related; boundary=b\r\n\r\n--b\r\n";
            let _ = stream.write_all(head.as_bytes());
            while stream.write_all(b"\r\n\r\n--b\r\n").is_ok() {}
        })
    });
    let error = retrieve(&mock, root.path()).unwrap_err().to_string();
    assert_eq!(error, "mock: found more parts that weren't asked for, expected at most 100");
}

/// What the killed process of the next test runs; nothing in a run of all tests.
#[test]
fn killed_process() {
    let (Ok(url), Ok(folder)) = (std::env::var("PACS_TEST_URL"), std::env::var("PACS_TEST_FOLDER")) else {
        return;
    };
    let cache = Cache::open(Path::new(&folder), 1 << 20).unwrap();
    let client = glioscope_pacs::Server::new(&url).unwrap().connect().unwrap();
    let _ = client.retrieve(&uid("1.2"), None, &cache, &|_| (), &never);
}

#[test]
fn a_killed_retrieval_leaves_whole_instances_only() {
    let root = tempfile::tempdir().unwrap();
    let mock = server(|_| {
        Box::new(|stream| {
            multipart(&INSTANCES.map(own), Some(2 * own("1.2.3.1").len()))(stream);
            std::thread::sleep(Duration::from_secs(20));
        })
    });
    let mut process = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "killed_process"])
        .env("PACS_TEST_URL", &mock.url)
        .env("PACS_TEST_FOLDER", root.path())
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let incoming = || std::fs::read_dir(root.path().join("incoming")).map_or(0, Iterator::count);
    let begin = std::time::Instant::now();
    let cache = loop {
        let cache = Cache::open(root.path(), 1 << 20).unwrap();
        if cache.size().unwrap() > 0 && incoming() > 0 {
            break cache;
        }
        assert!(begin.elapsed() < Duration::from_secs(20), "nothing arrived");
        std::thread::sleep(Duration::from_millis(10));
    };
    process.kill().unwrap();
    process.wait().unwrap();
    assert!(incoming() > 0, "nothing was left to sweep");
    let again = Cache::open(root.path(), 1 << 20).unwrap();
    assert_eq!(incoming(), 0);
    assert_eq!(again.size().unwrap(), own("1.2.3.1").len() as u64);
    // What it used is free.
    assert_eq!(cache.clear().unwrap(), 0);
}
