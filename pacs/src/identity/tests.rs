//! Tests of files' identities: made ones, and real ones where they are.

use std::io::Write as _;
use std::path::PathBuf;

use super::*;

/// An element of Explicit VR Little Endian, or Implicit where `kind` is empty.
fn element(tag: Tag, kind: &str, value: &[u8]) -> Vec<u8> {
    let mut out = [tag.0.to_le_bytes(), tag.1.to_le_bytes()].concat();
    match kind {
        "" => out.extend((value.len() as u32).to_le_bytes()),
        "SQ" | "UN" => {
            out.extend(kind.bytes().chain([0, 0]));
            out.extend((value.len() as u32).to_le_bytes());
        }
        _ => {
            out.extend(kind.bytes());
            out.extend((value.len() as u16).to_le_bytes());
        }
    }
    out.extend_from_slice(value);
    out
}

fn file(syntax: &str, data: &[u8]) -> Vec<u8> {
    let mut out = vec![0; 128];
    out.extend(b"DICM");
    out.extend(element((2, 3), "UI", b"1.9\0"));
    out.extend(element((2, 0x10), "UI", syntax.as_bytes()));
    out.extend_from_slice(data);
    out
}

fn read(bytes: &[u8]) -> Result<Identity, String> {
    let mut temporary = tempfile::NamedTempFile::new().unwrap();
    temporary.write_all(bytes).unwrap();
    identity(temporary.path())
}

fn data(kind: &str) -> Vec<u8> {
    [
        element((8, 0x18), kind, b"1.2\0"),
        element((0x20, 0xd), kind, b"1.3\0"),
        element((0x20, 0xe), kind, b"1.4\0"),
    ]
    .concat()
}

fn uid(text: &str) -> Uid {
    Uid::read(text).unwrap()
}

#[test]
fn uids_are_read_in_each_encoding() {
    let expected = Identity { instance: uid("1.2"), of: Some((uid("1.3"), uid("1.4"))) };
    assert_eq!(read(&file("1.2.840.10008.1.2.1\0", &data("UI"))).unwrap(), expected);
    assert_eq!(read(&file("1.2.840.10008.1.2\0", &data(""))).unwrap(), expected);
    let deflated = Identity { instance: uid("1.9"), of: None };
    assert_eq!(read(&file("1.2.840.10008.1.2.1.99", b"anything")).unwrap(), deflated);
}

#[test]
fn sequences_of_undefined_length_are_skipped() {
    let mut nested = vec![8, 0, 0x15, 0x11, b'S', b'Q', 0, 0, 255, 255, 255, 255];
    nested.extend([0xfe, 0xff, 0, 0xe0, 255, 255, 255, 255]);
    nested.extend(element((8, 0x18), "UI", b"6.6\0"));
    nested.extend([8, 0, 0x99, 0x11, b'U', b'N', 0, 0, 255, 255, 255, 255]);
    nested.extend([0xfe, 0xff, 0, 0xe0, 255, 255, 255, 255]);
    nested.extend(element((0x20, 0xe), "", b"7.7\0"));
    nested.extend([0xfe, 0xff, 0x0d, 0xe0, 0, 0, 0, 0, 0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    nested.extend([0xfe, 0xff, 0x0d, 0xe0, 0, 0, 0, 0, 0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    let all = data("UI");
    let bytes = file("1.2.840.10008.1.2.1\0", &[&all[..12], &nested, &all[12..]].concat());
    let expected = Identity { instance: uid("1.2"), of: Some((uid("1.3"), uid("1.4"))) };
    assert_eq!(read(&bytes).unwrap(), expected);
}

#[test]
fn damaged_files_are_errors_wherever_they_end() {
    let whole = file("1.2.840.10008.1.2.1\0", &data("UI"));
    for cut in 0..whole.len() {
        assert!(read(&whole[..cut]).is_err(), "{cut}");
    }
    let deep =
        [8, 0, 0x15, 0x11, b'S', b'Q', 0, 0, 255, 255, 255, 255, 0xfe, 0xff, 0, 0xe0, 255, 255, 255, 255];
    let error = read(&file("1.2.840.10008.1.2.1\0", &deep.repeat(1000))).unwrap_err();
    assert!(error.contains("too deep"), "{error}");
    assert!(read(b"<html>").unwrap_err().contains("DICM"));
    let evil = element((8, 0x18), "UI", b"../../..");
    let all = data("UI");
    let error = read(&file("1.2.840.10008.1.2.1\0", &[&evil, &all[12..]].concat())).unwrap_err();
    assert!(error.contains("invalid UID"), "{error}");
}

#[test]
fn real_files_have_identities() {
    let Some(root) = std::env::var_os("GLIOSCOPE_REAL_DATA").map(PathBuf::from) else {
        eprintln!("SKIPPED real_files_have_identities: GLIOSCOPE_REAL_DATA is not set");
        return;
    };
    for folder in
        ["dicom-encodings", "dicom-seg", "dicom-multimodal/PET", "dicom-enhanced", "dicom-malformed"]
    {
        let files = std::fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path());
        for path in files.filter(|path| path.extension().is_some_and(|e| e == "dcm")) {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let found = identity(&path);
            // Without preamble or meta group they aren't files of PS3.10.
            let is_expected = folder == "dicom-malformed" || name.contains("no-");
            assert!(found.is_ok() || is_expected, "{folder}/{name}: {found:?}");
        }
    }
}
