//! Storing: what was sent, and what is said about each file.

#![allow(clippy::unwrap_used, reason = "a failed unwrap here is a failed test")]

mod mock;

use std::path::PathBuf;
use std::sync::Mutex;

use glioscope_pacs::{Error, Progress, Sent};
use mock::{INSTANCE, Mock, Request, answer, file, is_later_page, json, never, rows, uid};

/// Files of instances 1.2.3.1 and on, and one that isn't DICOM.
fn files(count: usize) -> (tempfile::TempDir, Vec<PathBuf>) {
    let root = tempfile::tempdir().unwrap();
    let put = |name: String, bytes: &[u8]| {
        let path = root.path().join(name);
        std::fs::OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&path)
            .and_then(|mut file| std::io::Write::write_all(&mut file, bytes))
            .unwrap();
        path
    };
    let mut paths: Vec<_> = (1..=count)
        .map(|i| put(format!("{i}.dcm"), &file("1.2", "1.2.3", &format!("1.2.3.{i}"), 500)))
        .collect();
    paths.push(put("notes.txt".to_owned(), b"no DICOM"));
    (root, paths)
}

fn item(uid: &str, more: &str) -> String {
    format!("{{\"00081155\":{{\"vr\":\"UI\",\"Value\":[\"{uid}\"]}}{more}}}")
}

fn send(mock: &Mock, paths: &[PathBuf]) -> Sent {
    mock.client().send(paths, &|_| (), &never)
}

fn posts(mock: &Mock) -> Vec<Request> {
    mock.requests().into_iter().filter(|request| request.method == "POST").collect()
}

#[test]
fn files_are_sent_as_they_are() {
    let (_root, paths) = files(60);
    let mock = Mock::new(|request| {
        if request.method != "POST" {
            return json("[]");
        }
        let uids: Vec<String> = (1..=60).map(|i| item(&format!("1.2.3.{i}"), "")).collect();
        json(format!("{{\"00081199\":{{\"Value\":[{}]}}}}", uids.join(",")))
    });
    let seen = Mutex::new(Progress::default());
    let sent = mock.client().send(&paths, &|now| *seen.lock().unwrap() = now, &never);
    assert_eq!((sent.stored.len(), sent.failed.len()), (60, 1));
    assert!(sent.stopped.is_none() && sent.stored[59] == uid("1.2.3.60"));
    assert!(sent.failed[0].reason.contains("no DICOM file") && sent.failed[0].instance.is_none());
    let posts = posts(&mock);
    assert_eq!(posts.len(), 2);
    let total: usize = posts.iter().map(|post| post.body.len()).sum();
    let seen = *seen.lock().unwrap();
    assert_eq!((seen.done, seen.of, seen.bytes), (61, 61, total as u64));
    let head = &posts[1].head;
    assert_eq!(mock::header(head, "content-length").unwrap(), posts[1].body.len().to_string());
    assert!(!head.to_lowercase().contains("transfer-encoding"), "{head}");
    let kind = mock::header(head, "content-type").unwrap();
    let boundary = kind.strip_prefix("multipart/related; type=\"application/dicom\"; boundary=").unwrap();
    let mut expected = Vec::new();
    for path in &paths[50..60] {
        expected.extend(format!("\r\n--{boundary}\r\nContent-Type: application/dicom\r\n\r\n").into_bytes());
        expected.extend(std::fs::read(path).unwrap());
    }
    expected.extend(format!("\r\n--{boundary}--\r\n").into_bytes());
    assert_eq!(posts[1].body, expected[2..]);
}

#[test]
fn after_a_refused_batch_the_server_is_asked_what_it_has() {
    // As Orthanc: 400 for a good and a bad file, with the good one stored.
    let (_root, paths) = files(3);
    let mock = Mock::new(|request| {
        if request.method == "POST" {
            return answer(400, "", "{\"Details\":\"bad file\"}");
        }
        let has = request.path.contains("SOPInstanceUID=1.2.3.2") && !is_later_page(request);
        json(if has { rows(INSTANCE, ["1.2.3.2"]) } else { "[]".to_owned() })
    });
    let sent = send(&mock, &paths);
    assert_eq!(sent.stored, [uid("1.2.3.2")]);
    let reasons: Vec<_> = sent.failed.iter().map(|failed| failed.reason.as_str()).collect();
    assert_eq!(reasons[1..], ["status 400 (bad file)", "status 400 (bad file)"]);
    assert!(sent.stopped.is_none());
}

#[test]
fn refused_files_have_their_reasons() {
    let (_root, paths) = files(2);
    let refused = item("1.2.3.1", ",\"00081197\":{\"Value\":[43264]}");
    let mock = Mock::new(move |request| {
        let text = format!(
            "{{\"00081198\":{{\"Value\":[{refused}]}},\"00081199\":{{\"Value\":[{}]}}}}",
            item("1.2.3.2", "")
        );
        if request.method == "POST" {
            answer(409, "Content-Type: application/json\r\n", text)
        } else {
            json("[]")
        }
    });
    let sent = send(&mock, &paths);
    assert_eq!(sent.stored, [uid("1.2.3.2")]);
    assert!(sent.failed[1].reason.contains("(A900)"), "{:?}", sent.failed);
    // A server that says nothing about an instance, and doesn't have it.
    let mock = Mock::new(|request| if request.method == "POST" { json("{}") } else { json("[]") });
    let sent = send(&mock, &paths);
    assert_eq!(sent.failed[2].reason, "not in the server's answer (status 200)");
}

#[test]
fn refusals_and_breaks_stop_and_every_file_is_accounted_for() {
    let (_root, paths) = files(120);
    let unauthorized = send(&Mock::new(|_| answer(401, "", "")), &paths);
    assert!(matches!(unauthorized.stopped, Some(Error::Unauthorized { .. })));
    assert_eq!((unauthorized.stored.len(), unauthorized.failed.len()), (0, 121));
    // The connection breaks after a batch; the server has one of it.
    let mock = Mock::new(|request| {
        if request.method == "POST" {
            return Box::new(|_| ());
        }
        let has = request.path.contains("SOPInstanceUID=1.2.3.7&") && !is_later_page(request);
        json(if has { rows(INSTANCE, ["1.2.3.7"]) } else { "[]".to_owned() })
    });
    let sent = send(&mock, &paths);
    assert!(matches!(sent.stopped, Some(Error::Unreachable { .. })), "{:?}", sent.stopped);
    assert_eq!(sent.stored, [uid("1.2.3.7")]);
    assert_eq!(sent.failed.len(), 120);
    assert_eq!(posts(&mock).len(), 1);
    assert!(sent.failed[119].reason.starts_with("not sent: mock: "));
}

#[test]
fn files_go_only_where_the_user_said() {
    let (_root, paths) = files(1);
    let other = Mock::new(|_| json("{}"));
    let target = format!("Location: {}/studies\r\n", other.url);
    let mock = Mock::new(
        move |request| if request.method == "POST" { answer(307, &target, "") } else { json("[]") },
    );
    let sent = send(&mock, &paths);
    assert!(matches!(sent.stopped, Some(Error::Redirect { .. })), "{:?}", sent.stopped);
    assert!(other.requests().is_empty());
}

#[test]
fn cancelling_stops_between_reads() {
    let (_root, paths) = files(120);
    let mock = Mock::new(|_| json("[]"));
    let done = Mutex::new(0);
    let sent =
        mock.client().send(&paths, &|now| *done.lock().unwrap() = now.bytes, &|| *done.lock().unwrap() > 0);
    assert!(matches!(sent.stopped, Some(Error::Cancelled)));
    assert_eq!(sent.stored.len() + sent.failed.len(), 121);
}
