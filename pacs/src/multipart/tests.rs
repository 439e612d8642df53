//! Tests of bodies of several parts.

use proptest::prelude::*;

use super::*;

/// Gives `bytes` in pieces of the sizes of `steps`, again and again.
struct Pieces<'a> {
    bytes: &'a [u8],
    steps: Vec<usize>,
    turn: usize,
}

impl Read for Pieces<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let step = self.steps[self.turn % self.steps.len()].max(1);
        self.turn += 1;
        let length = step.min(out.len()).min(self.bytes.len());
        let (now, later) = self.bytes.split_at(length);
        out[..length].copy_from_slice(now);
        self.bytes = later;
        Ok(length)
    }
}

/// Whole parts, and whether the body ended as it should.
fn parts(bytes: &[u8], boundary: &str, steps: &[usize]) -> (Vec<Vec<u8>>, bool) {
    let mut parts = Multipart::new(Pieces { bytes, steps: steps.to_vec(), turn: 0 }, boundary);
    let mut out = Vec::new();
    loop {
        match parts.next() {
            Ok(None) => return (out, true),
            Ok(Some(head)) => {
                let mut content = Vec::new();
                let read = parts.content(&mut |piece| {
                    content.extend_from_slice(piece);
                    Ok(())
                });
                match read {
                    Ok(length) => {
                        assert_eq!(length, content.len() as u64);
                        assert!(head.length.is_none_or(|stated| stated == length), "{head:?}");
                        out.push(content);
                    }
                    Err(_) => return (out, false),
                }
            }
            Err(_) => return (out, false),
        }
    }
}

#[test]
fn boundaries_are_read_from_content_types() {
    for (text, expected) in [
        ("multipart/related; boundary=abc", Some("abc")),
        ("Multipart/Related;type=\"application/dicom\";BOUNDARY=\"a b;=c\"; x=y", Some("a b;=c")),
        ("multipart/related; type=\"a; boundary=no\"; boundary=\"q\\\"q\"", Some("q\"q")),
        ("multipart/related; boundary=abc ; type=x", Some("abc")),
        ("multipart/related; boundary=", None),
        ("multipart/related; boundary=\"open", None),
        ("multipart/related", None),
        ("multipart/mixed; boundary=abc", None),
        ("text/html; boundary=abc", None),
    ] {
        assert_eq!(boundary(text).as_deref(), expected, "{text}");
    }
    assert_eq!(boundary(&format!("multipart/related; boundary={}", "a".repeat(201))), None);
}

#[test]
fn parts_are_what_lies_between_boundaries() {
    let body = b"preamble --b\r\n--bx\r\n\r\n--b \t\r\nContent-Type: a\r\ncontent-length: 3\r\n\r\nabc\r\n--b\r\n\r\n\
        \r\n--bc\r\n--b\r\nX: y\r\n\r\n\r\n--b\r\n\r\n\r\n--b--epilogue\r\n--b\r\n";
    let expected = [b"abc".to_vec(), b"\r\n--bc".to_vec(), Vec::new(), Vec::new()];
    for step in 1..40 {
        assert_eq!(parts(body, "b", &[step]), (expected.to_vec(), true), "{step}");
    }
    assert_eq!(parts(b"--b--", "b", &[1]), (Vec::new(), true));
    assert_eq!(parts(b"--b\r\nA: b\r\n--b--", "b", &[9]), (Vec::new(), false));
}

#[test]
fn whole_parts_before_a_cut_are_kept() {
    let body = b"--b\r\n\r\none\r\n--b\r\n\r\ntwo\r\n--b--";
    for cut in 0..body.len() {
        let (whole, is_complete) = parts(&body[..cut], "b", &[3]);
        assert!(!is_complete, "{cut}");
        // A part is whole when what follows its boundary proves that it is one.
        assert_eq!(whole.len(), usize::from(cut >= 17), "{cut}");
    }
}

#[test]
fn endless_headers_end() {
    let mut body = b"--b\r\nX: ".to_vec();
    body.extend(std::iter::repeat_n(b'y', 1 << 20));
    assert_eq!(parts(&body, "b", &[4096]), (Vec::new(), false));
}

proptest! {
    #[test]
    fn parts_do_not_depend_on_how_they_arrive(
        contents in prop::collection::vec(prop::collection::vec(prop::sample::select(b"\r\n-bx ".to_vec()), 0..60), 0..5),
        steps in prop::collection::vec(1usize..20, 1..6),
    ) {
        // A boundary that content can't contain, but whose beginnings it has.
        let boundary = "bxq";
        let mut body = Vec::new();
        for content in &contents {
            body.extend_from_slice(format!("\r\n--{boundary}\r\nContent-Length: {}\r\n\r\n", content.len()).as_bytes());
            body.extend_from_slice(content);
        }
        body.extend_from_slice(format!("\r\n--{boundary}--\r\n").as_bytes());
        prop_assert_eq!(parts(&body, boundary, &steps), (contents, true));
    }
}
