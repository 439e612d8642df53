//! A server of one machine and one test: what it answers is a function of the request.

#![allow(dead_code, reason = "each test program uses another part")]

use std::io::{BufRead as _, BufReader, Read as _, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use glioscope_pacs::{Client, Server, Timeouts, Uid};

/// What a client asked.
#[derive(Clone, Debug)]
pub struct Request {
    pub method: String,
    /// Path and query.
    pub path: String,
    /// The header, as it came.
    pub head: String,
    pub body: Vec<u8>,
}

/// What is written to the connection, which is closed then.
pub type Answer = Box<dyn FnOnce(&mut TcpStream)>;

/// A running server.
pub struct Mock {
    pub url: String,
    requests: Arc<Mutex<Vec<Request>>>,
}

impl Mock {
    /// A server that answers by `answer`.
    pub fn new(answer: impl Fn(&Request) -> Answer + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let requests = Arc::new(Mutex::new(Vec::new()));
        let (seen, answer) = (Arc::clone(&requests), Arc::new(answer));
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (seen, answer) = (Arc::clone(&seen), Arc::clone(&answer));
                std::thread::spawn(move || serve(stream, &seen, answer.as_ref()));
            }
        });
        Self { url, requests }
    }

    /// What was asked until now.
    pub fn requests(&self) -> Vec<Request> {
        self.requests.lock().unwrap().clone()
    }

    pub fn server(&self) -> Server {
        let mut server = Server::new(&self.url).unwrap();
        server.timeouts = Timeouts { connect: Duration::from_secs(2), silence: Duration::from_millis(400) };
        server.name = Some("mock".to_owned());
        server
    }

    pub fn client(&self) -> Client {
        self.server().connect().unwrap()
    }
}

fn serve(stream: TcpStream, seen: &Mutex<Vec<Request>>, answer: &dyn Fn(&Request) -> Answer) {
    let mut reader = BufReader::new(stream);
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        if reader.read_line(&mut head).unwrap_or(0) == 0 {
            return;
        }
    }
    let mut words = head.split(' ');
    let (method, path) = (words.next().unwrap().to_owned(), words.next().unwrap().to_owned());
    let length = header(&head, "content-length").map_or(0, |text| text.parse().unwrap());
    let mut body = vec![0; length];
    if reader.read_exact(&mut body).is_err() {
        return;
    }
    let request = Request { method, path, head, body };
    seen.lock().unwrap().push(request.clone());
    let mut stream = reader.into_inner();
    answer(&request)(&mut stream);
    let _ = stream.shutdown(std::net::Shutdown::Both);
}

/// A header's value.
pub fn header(head: &str, name: &str) -> Option<String> {
    let lines = head.lines().filter_map(|line| line.split_once(':'));
    let mut found = lines.filter(|(key, _)| key.eq_ignore_ascii_case(name));
    found.next().map(|(_, value)| value.trim().to_owned())
}

/// An answer with a length.
pub fn answer(status: u16, headers: &str, body: impl AsRef<[u8]>) -> Answer {
    let body = body.as_ref().to_vec();
    let head = format!(
        "HTTP/1.1 {status} X\r\nConnection: close\r\nContent-Length: {}\r\n{headers}\r\n",
        body.len()
    );
    Box::new(move |stream| {
        let _ = stream.write_all(head.as_bytes());
        let _ = stream.write_all(&body);
    })
}

pub fn json(body: impl AsRef<[u8]>) -> Answer {
    answer(200, "Content-Type: application/dicom+json\r\n", body)
}

/// An answer that ends with the connection, at `cut` bytes of its body.
pub fn multipart(parts: &[Vec<u8>], cut: Option<usize>) -> Answer {
    let mut body = Vec::new();
    for part in parts {
        body.extend_from_slice(b"\r\n--b;=\r\nContent-Type: application/dicom\r\n\r\n");
        body.extend_from_slice(part);
    }
    body.extend_from_slice(b"\r\n--b;=--\r\n");
    body.truncate(cut.unwrap_or(usize::MAX));
    let head = "HTTP/1.1 200 OK\r\nConnection: close\r\n\
        Content-Type: multipart/related; type=\"application/dicom\"; boundary=\"b;=\"\r\n\r\n";
    Box::new(move |stream| {
        let _ = stream.write_all(head.as_bytes());
        let _ = stream.write_all(&body);
    })
}

/// A small DICOM file in Explicit VR Little Endian with `bytes` more.
pub fn file(study: &str, series: &str, instance: &str, bytes: usize) -> Vec<u8> {
    let mut out = vec![0; 128];
    out.extend(b"DICM");
    let mut element = |group: u16, number: u16, kind: &[u8], value: &[u8]| {
        out.extend([group.to_le_bytes(), number.to_le_bytes()].concat());
        out.extend_from_slice(kind);
        if kind == b"OB" {
            out.extend([0, 0]);
            out.extend((value.len() as u32).to_le_bytes());
        } else {
            out.extend((value.len() as u16).to_le_bytes());
        }
        out.extend_from_slice(value);
    };
    element(2, 0x10, b"UI", b"1.2.840.10008.1.2.1\0");
    element(8, 0x16, b"UI", b"1.2.840.10008.5.1.4.1.1.7\0");
    element(8, 0x18, b"UI", instance.as_bytes());
    element(0x20, 0x0d, b"UI", study.as_bytes());
    element(0x20, 0x0e, b"UI", series.as_bytes());
    element(0x7fe0, 0x10, b"OB", &vec![7; bytes]);
    out
}

/// DICOM JSON of rows with one UID each.
pub fn rows<'a>(tag: &str, uids: impl IntoIterator<Item = &'a str>) -> String {
    let rows: Vec<_> = uids
        .into_iter()
        .map(|uid| format!("{{\"{tag}\":{{\"vr\":\"UI\",\"Value\":[\"{uid}\"]}}}}"))
        .collect();
    format!("[{}]", rows.join(","))
}

pub const STUDY: &str = "0020000D";
pub const SERIES: &str = "0020000E";
pub const INSTANCE: &str = "00080018";

pub fn uid(text: &str) -> Uid {
    text.parse().unwrap()
}

/// Whether a request asks for a later page, which these servers don't have.
pub fn is_later_page(request: &Request) -> bool {
    request.path.contains("offset=")
}

/// Searches and retrieves nothing to cancel.
pub fn never() -> bool {
    false
}
