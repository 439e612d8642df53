//! The archive Orthanc with its DICOMweb plugin, started here on a free port of this machine. `Orthanc` is looked for in
//! `GLIOSCOPE_ORTHANC` and on `PATH`, its plugin beside it or in `GLIOSCOPE_ORTHANC_PLUGIN`.

#![allow(clippy::unwrap_used, reason = "a failed unwrap here is a failed test")]

mod mock;

use std::collections::{HashMap, HashSet};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use glioscope_pacs::{Cache, Client, Credentials, Error, Query, Secret, Server, Uid};
use mock::{file, never};

struct Orthanc {
    process: Child,
    server: Server,
    _folder: tempfile::TempDir,
}

impl Drop for Orthanc {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Orthanc {
    fn client(&self) -> Client {
        self.server.connect().unwrap()
    }
}

fn program() -> Option<PathBuf> {
    let named = std::env::var_os("GLIOSCOPE_ORTHANC").map(PathBuf::from);
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let mut candidates =
        named.into_iter().chain(std::env::split_paths(&paths).map(|path| path.join("Orthanc")));
    candidates.find(|path| path.is_file())
}

fn plugin(program: &Path) -> Option<PathBuf> {
    let named = std::env::var_os("GLIOSCOPE_ORTHANC_PLUGIN").map(PathBuf::from);
    let root = program.parent().and_then(Path::parent);
    let beside = root.map(|root| root.join("share/orthanc/plugins/libOrthancDicomWeb.so"));
    let usual = PathBuf::from("/usr/share/orthanc/plugins/libOrthancDicomWeb.so");
    named.into_iter().chain(beside).chain([usual]).find(|path| path.is_file())
}

/// A running Orthanc without studies; `None`, said by the test's name, where it isn't installed.
fn start(test: &str) -> Option<Orthanc> {
    let Some((program, plugin)) = program().and_then(|program| Some((program.clone(), plugin(&program)?)))
    else {
        eprintln!("SKIPPED {test}: Orthanc is not installed");
        return None;
    };
    let folder = tempfile::tempdir().unwrap();
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let config = serde_json::json!({
        "StorageDirectory": folder.path().join("storage"),
        "IndexDirectory": folder.path().join("index"),
        "Plugins": [plugin],
        "HttpPort": port,
        "HttpServerEnabled": true,
        "RemoteAccessAllowed": false,
        "DicomServerEnabled": false,
        "AuthenticationEnabled": true,
        "RegisteredUsers": {"alice": "canary-77"},
        "DicomWeb": {"Enable": true, "Root": "/dicom-web/"},
    });
    let path = folder.path().join("orthanc.json");
    let mut options = std::fs::OpenOptions::new();
    options
        .write(true)
        .create_new(true)
        .open(&path)
        .unwrap()
        .write_all(config.to_string().as_bytes())
        .unwrap();
    let process = Command::new(program)
        .arg(&path)
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut server = Server::new(&format!("http://127.0.0.1:{port}/dicom-web")).unwrap();
    server.credentials =
        Some(Credentials::Basic { user: "alice".to_owned(), password: Secret::new("canary-77") });
    let orthanc = Orthanc { process, server, _folder: folder };
    let begin = Instant::now();
    while let Err(error) = orthanc.client().studies(&Query::default(), &never) {
        assert!(begin.elapsed() < Duration::from_secs(20), "Orthanc does not answer: {error}");
        std::thread::sleep(Duration::from_millis(100));
    }
    Some(orthanc)
}

/// Files below a folder of the real data; none, said by the test's name, where it isn't there.
fn real_files(test: &str, folder: &str) -> Vec<PathBuf> {
    let Some(root) = std::env::var_os("GLIOSCOPE_REAL_DATA").map(PathBuf::from) else {
        eprintln!("SKIPPED {test}: GLIOSCOPE_REAL_DATA is not set");
        return Vec::new();
    };
    let (mut files, mut folders) = (Vec::new(), vec![root.join(folder)]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "dcm") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// Retrieves every study; contents by instance.
fn all(client: &Client, cache: &Cache) -> HashMap<String, Vec<u8>> {
    let mut found = HashMap::new();
    for study in client.studies(&Query::default(), &never).unwrap() {
        let got = client.retrieve(&study.uid.unwrap(), None, cache, &|_| (), &never).unwrap();
        assert!(got.failed.is_empty(), "{:?}", got.failed);
        for file in got.files {
            let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
            found.insert(name, std::fs::read(file).unwrap());
        }
    }
    found
}

/// Stores `files`, retrieves everything, and compares every byte.
fn round_trip(orthanc: &Orthanc, files: &[PathBuf]) {
    let client = orthanc.client();
    let sent = client.send(files, &|_| (), &never);
    assert!(sent.failed.is_empty() && sent.stopped.is_none(), "{sent:?}");
    assert_eq!(sent.stored.len(), files.len());
    let root = tempfile::tempdir().unwrap();
    let cache = Cache::open(root.path(), 1 << 30).unwrap();
    let got = all(&client, &cache);
    let distinct: HashSet<&Uid> = sent.stored.iter().collect();
    assert_eq!(got.len(), distinct.len());
    for (path, uid) in files.iter().zip(&sent.stored) {
        assert!(got[uid.as_str()] == std::fs::read(path).unwrap(), "{path:?} came back changed");
    }
    let again = client.send(files, &|_| (), &never);
    assert_eq!(again.stored, sent.stored, "{again:?}");
}

#[test]
fn real_studies_come_back_byte_for_byte() {
    let test = "real_studies_come_back_byte_for_byte";
    let (Some(orthanc), files) = (start(test), real_files(test, "dicom-multimodal")) else { return };
    if files.is_empty() {
        return;
    }
    round_trip(&orthanc, &files);
    let client = orthanc.client();
    let found = |query: &Query| client.studies(query, &never).unwrap();
    let studies = found(&Query::default());
    let study = studies[0].uid.clone().unwrap();
    let series = client.series(&study, &never).unwrap();
    assert_eq!(studies[0].series, Some(series.len() as u64));
    for series in &series {
        let instances = client.instances(&study, series.uid.as_ref().unwrap(), &never).unwrap();
        assert_eq!(series.instances, Some(instances.len() as u64));
    }
    let id = studies[0].patient_id.clone().unwrap();
    assert!(!found(&Query { patient_id: Some(id.clone()), ..Query::default() }).is_empty());
    assert!(!found(&Query { patient_id: Some(format!("{}*", &id[..3])), ..Query::default() }).is_empty());
    assert!(found(&Query { patient_id: Some("nobody".to_owned()), ..Query::default() }).is_empty());
    assert_eq!(found(&Query { study: Some(study), ..Query::default() }).len(), 1);
    let modality = |text: &str| found(&Query { modality: Some(text.to_owned()), ..Query::default() }).len();
    assert!(modality("PT") > 0 && modality("XA") == 0);
    let early = Query { to: Some("19000101".to_owned()), ..Query::default() };
    assert!(found(&early).is_empty());
}

#[test]
fn compressed_files_come_back_as_they_are() {
    let test = "compressed_files_come_back_as_they_are";
    for name in [
        "u8-jpeg2000-lossless",
        "u8-jpeg2000-lossy",
        "s16-jpeg2000-lossless",
        "u8-jpegls-lossless",
        "u8-rle",
        "u8-explicit-be",
    ] {
        let files = real_files(test, "dicom-encodings");
        let files: Vec<_> =
            files.into_iter().filter(|path| path.file_stem().is_some_and(|stem| stem == name)).collect();
        let (false, Some(orthanc)) = (files.is_empty(), start(test)) else { return };
        round_trip(&orthanc, &files);
    }
}

#[test]
fn segmentations_of_odd_width_come_back_as_they_are() {
    let test = "segmentations_of_odd_width_come_back_as_they_are";
    let files = real_files(test, "dicom-seg/23x38x3");
    let (false, Some(orthanc)) = (files.is_empty(), start(test)) else { return };
    round_trip(&orthanc, &files);
}

#[test]
fn wrong_credentials_are_refused() {
    let Some(orthanc) = start("wrong_credentials_are_refused") else { return };
    let mut server = orthanc.server.clone();
    server.credentials = None;
    let error = server.connect().unwrap().studies(&Query::default(), &never).unwrap_err().to_string();
    assert!(error.contains("status 401 (no credentials were sent)"), "{error}");
    server.credentials = Some(Credentials::Basic { user: "alice".to_owned(), password: Secret::new("no") });
    let client = server.connect().unwrap();
    assert!(matches!(client.studies(&Query::default(), &never), Err(Error::Unauthorized { .. })));
    let sent = client.send(&[PathBuf::from("/nowhere")], &|_| (), &never);
    assert_eq!(sent.failed.len(), 1);
    let root = tempfile::tempdir().unwrap();
    let path = write(root.path(), "a.dcm", &file("1.2", "1.2.3", "1.2.3.4", 10));
    assert!(matches!(client.send(&[path], &|_| (), &never).stopped, Some(Error::Unauthorized { .. })));
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    let mut options = std::fs::OpenOptions::new();
    options.write(true).create_new(true).open(&path).unwrap().write_all(bytes).unwrap();
    path
}

#[test]
fn of_a_mixed_batch_the_good_files_are_known_to_be_stored() {
    let test = "of_a_mixed_batch_the_good_files_are_known_to_be_stored";
    let files = real_files(test, "dicom-multimodal/PET");
    let (false, Some(orthanc)) = (files.is_empty(), start(test)) else { return };
    let root = tempfile::tempdir().unwrap();
    // Its UIDs are readable, the rest is not.
    let mut bad = file("1.2", "1.2.3", "1.2.3.4", 10);
    bad.truncate(bad.len() - 12);
    bad.extend([0xff; 7]);
    let bad = write(root.path(), "bad.dcm", &bad);
    let sent = orthanc.client().send(&[files[0].clone(), bad.clone(), files[1].clone()], &|_| (), &never);
    assert_eq!(sent.stored.len(), 2, "{sent:?}");
    assert_eq!(sent.failed.len(), 1, "{sent:?}");
    assert_eq!(sent.failed[0].path, bad);
    assert!(sent.failed[0].reason.contains("status 400"), "{sent:?}");
}

#[test]
fn unknown_studies_are_not_found() {
    let Some(orthanc) = start("unknown_studies_are_not_found") else { return };
    let root = tempfile::tempdir().unwrap();
    let cache = Cache::open(root.path(), 1 << 20).unwrap();
    let error =
        orthanc.client().retrieve(&"1.2.3".parse().unwrap(), None, &cache, &|_| (), &never).unwrap_err();
    assert!(matches!(error, Error::NotFound { .. }), "{error}");
}

#[test]
fn a_study_of_two_patients_is_shown_twice_and_retrieved_whole() {
    let test = "a_study_of_two_patients_is_shown_twice_and_retrieved_whole";
    let Some(orthanc) = start(test) else { return };
    let root = tempfile::tempdir().unwrap();
    // The same study's UID under another patient's ID: Orthanc has two studies then, and gives neither as a whole.
    let one = file("1.2.88", "1.2.88.1", "1.2.88.1.1", 16);
    let at = one.windows(4).position(|bytes| bytes == [0x20, 0, 0x0d, 0]).unwrap();
    let other = file("1.2.88", "1.2.88.2", "1.2.88.2.1", 16);
    let of = |bytes: &[u8], id: &[u8]| {
        [&bytes[..at], &[0x10, 0, 0x20, 0, b'L', b'O', id.len() as u8, 0], id, &bytes[at..]].concat()
    };
    let files =
        [write(root.path(), "1.dcm", &of(&one, b"A1")), write(root.path(), "2.dcm", &of(&other, b"B1"))];
    let client = orthanc.client();
    let sent = client.send(&files, &|_| (), &never);
    assert_eq!(sent.stored.len(), 2, "{sent:?}");
    let cache = Cache::open(&root.path().join("cache"), 1 << 20).unwrap();
    let studies = client.studies(&Query::default(), &never).unwrap();
    let mut patients: Vec<_> = studies.iter().map(|study| study.patient_id.as_deref().unwrap()).collect();
    patients.sort_unstable();
    assert_eq!(patients, ["A1", "B1"]);
    let got = client.retrieve(&"1.2.88".parse().unwrap(), None, &cache, &|_| (), &never).unwrap();
    assert_eq!((got.files.len(), got.failed.len()), (2, 0));
}
