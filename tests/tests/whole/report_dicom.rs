//! Reports as DICOM objects: the PDF within one, the measurements as a structured report, and nobody's name unless asked.
//! Other programs read them in `interop/check.py`.

use std::path::Path;

use glioscope_tests::{real_data, run, write_cube};

use crate::PROGRAM;

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn report(arguments: &[&str], out: &Path) -> (Vec<u8>, String) {
    let all = [&["report", "--software", "--out", text(out)], arguments].concat();
    let output = run(PROGRAM, &all);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{all:?}: {stderr}");
    (std::fs::read(out).unwrap(), stderr)
}

fn refusal(arguments: &[&str]) -> String {
    glioscope_tests::refusal(PROGRAM, arguments)
}

fn has(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|found| found == part)
}

/// A cube of this side at the middle of a mask of 2 mm voxels.
fn cube(path: &Path, side: usize) {
    let within = |n: usize| (10..10 + side).contains(&n);
    write_cube(path, 32, 2.0, |ijk| u8::from(ijk.into_iter().all(within)));
}

#[test]
fn a_structured_report_has_the_measurements_of_every_date() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("Doe_Jane_4711");
    std::fs::create_dir(&case).unwrap();
    cube(&case.join("A_2024-01-01.nii.gz"), 7);
    cube(&case.join("A_2024-03-01.nii.gz"), 6);
    let [one, two] = ["one.sr.dcm", "two.sr.dcm"].map(|name| folder.path().join(name));
    let (bytes, stderr) = report(&[text(&case)], &one);
    assert_eq!(bytes, report(&[text(&case)], &two).0, "the same bytes");
    assert!(!stderr.contains("nobody"), "{stderr}");
    // 7³ and 6³ voxels of 8 mm³.
    for part in ["2.744", "1.728", "2024-01-01", "2024-03-01", "A: lesion A", "20240301"] {
        assert!(has(&bytes, part.as_bytes()), "{part:?}");
    }
    for canary in ["Doe", "Jane", "4711", text(folder.path())] {
        assert!(!has(&bytes, canary.as_bytes()), "{canary}");
    }
    let (full, stderr) = report(&[text(&case), "--identity", "full", "--force"], &one);
    assert!(stderr.contains("no DICOM image of the case"), "{stderr}");
    assert!(has(&full, b"1.728") && full != bytes);
}

#[test]
fn a_pdf_in_dicom_is_the_pdf() {
    let folder = tempfile::tempdir().unwrap();
    let mask = folder.path().join("m.nii.gz");
    cube(&mask, 5);
    let mask = format!("A={}", text(&mask));
    let made = |name: &str| report(&["--mask", &mask], &folder.path().join(name));
    let ((pdf, _), (bytes, stderr)) = (made("r.pdf"), made("r.dcm"));
    assert!(has(&bytes, &pdf) && &bytes[128..132] == b"DICM");
    assert!(stderr.contains("1900-01-01, which stands for unknown"), "{stderr}");
}

#[test]
fn a_report_of_dicom_names_the_patient_only_when_asked() {
    let Some(data) = real_data("dicom-multimodal") else { return };
    let folder = tempfile::tempdir().unwrap();
    let (tree, _) = glioscope_tests::answer(PROGRAM, &["info", text(&data), "--json"]);
    let tree = tree.to_string();
    let (_, after) = tree.split_once("\"study_instance_uid\":\"").unwrap();
    let study = after.split('"').next().unwrap().to_owned();
    let made = |identity: &str| {
        let out = folder.path().join(format!("{identity}.sr.dcm"));
        report(&[text(&data), "--identity", identity], &out).0
    };
    // Roots of UIDs of the images.
    let canaries = [b"STS_003".as_slice(), b"dicom-multimodal", study.as_bytes(), b"1.3.6.1.4.1.14519"];
    let (none, initials, full) = (made("none"), made("initials"), made("full"));
    for canary in canaries {
        assert!(!has(&none, canary) && !has(&initials, canary), "{canary:?}");
    }
    assert!(has(&initials, b"PN\x02\x00S.") && !has(&none, b"PN\x02\x00S."));
    assert!(has(&full, b"STS_003") && has(&full, study.as_bytes()));
    // Three series, by what took them.
    for code in [b"25056-3", b"25045-6", b"44136-0"] {
        assert!(has(&full, code) && !has(&none, code));
    }
}

#[test]
fn a_structured_report_has_the_calls_of_a_response() {
    let folder = tempfile::tempdir().unwrap();
    for (name, side) in [("A_2024-01-01.nii.gz", 5), ("A_2024-03-01.nii.gz", 9)] {
        cube(&folder.path().join(name), side);
    }
    let history = folder.path().join("history.toml");
    let stated = "response = 1\ncriterion = \"rano-2010\"\nbaseline = 2024-01-01\n";
    std::fs::write(&history, stated).unwrap();
    let made = |more: &[&str], name: &str| {
        report(&[&[text(folder.path())], more].concat(), &folder.path().join(name)).0
    };
    let (with, without) = (made(&["--history", text(&history)], "r.sr.dcm"), made(&[], "n.sr.dcm"));
    for word in ["112020", "C114879", "RANO 2010, by diameters", "SUM_PRODUCTS", "BASELINE"] {
        assert!(has(&with, word.as_bytes()) && !has(&without, word.as_bytes()), "{word}");
    }
}

#[test]
fn what_a_structured_report_cant_have_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (mask, out) = (folder.path().join("m.nii.gz"), folder.path().join("r.sr.dcm"));
    cube(&mask, 5);
    let mask = format!("A={}", text(&mask));
    let refused =
        |more: &[&str]| refusal(&[&["report", "--mask", &mask, "--out", text(&out)], more].concat());
    let line = refused(&["--language", "de"]);
    assert!(line.contains("expected English (en)"), "{line}");
    assert!(!out.exists());
    std::fs::write(&out, "another report").unwrap();
    let line = refused(&[]);
    assert!(line.contains("found a file that exists"), "{line}");
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "another report");
}
