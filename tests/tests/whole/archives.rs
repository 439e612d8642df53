//! Cases that come in a zip archive or from a server, and label maps with their schemes.

use std::{io::Write, path::Path};

use egui::Key;
use egui_kittest::kittest::{NodeT, Queryable};
use glioscope::{
    command::AppCommand,
    model::{CaseRef, session},
};
use glioscope_core::files::archive;
use glioscope_tests::{doc, error_text, perform, real_data, run, sample, wait_for_workers, write_cube};
use serde_json::Value;
use zip::{ZipWriter, write::SimpleFileOptions};

use crate::PROGRAM;

fn zipped(folder: &Path, archive: &Path) {
    let mut writer = ZipWriter::new(std::fs::File::create(archive).unwrap());
    let mut pending = vec![folder.to_owned()];
    while let Some(current) = pending.pop() {
        for entry in std::fs::read_dir(current).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                pending.push(path);
                continue;
            }
            let name = path.strip_prefix(folder).unwrap().to_str().unwrap();
            writer.start_file(name, SimpleFileOptions::default()).unwrap();
            writer.write_all(&std::fs::read(&path).unwrap()).unwrap();
        }
    }
    writer.finish().unwrap();
}

fn measured(arguments: &[&str]) -> Value {
    let output = run(PROGRAM, &[&["measure", "--json"], arguments].concat());
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn mask_ids(report: &Value, time: usize) -> Vec<&str> {
    let masks = report["time_points"][time]["masks"].as_array().unwrap();
    masks.iter().map(|mask| mask["id"].as_str().unwrap()).collect()
}

#[test]
fn an_archive_opens_like_the_folder_with_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let (case, archive) = (folder.path().join("case"), folder.path().join("study.ZIP"));
    let written = run(PROGRAM, &["sample", "--out", case.to_str().unwrap()]);
    assert!(written.status.success());
    zipped(&case, &archive);
    let (of_folder, of_archive) =
        (measured(&[case.to_str().unwrap()]), measured(&[archive.to_str().unwrap()]));
    assert_eq!(of_archive["time_points"], of_folder["time_points"]);
    // Files without a manifest, too.
    std::fs::remove_file(case.join("case.toml")).unwrap();
    zipped(&case, &archive);
    let guessed = measured(&[archive.to_str().unwrap()]);
    assert_eq!(mask_ids(&guessed, 0).len(), 3);
    let temporary = folder.path().join("temporary");
    std::fs::create_dir(&temporary).unwrap();
    let output = std::process::Command::new(PROGRAM)
        .args(["info", archive.to_str().unwrap()])
        .env("TMPDIR", &temporary)
        .output()
        .unwrap();
    assert!(output.status.success());
    assert_eq!(std::fs::read_dir(&temporary).unwrap().count(), 0, "what was unpacked is removed");
    // An archive is an input that no output is written over.
    let over = run(
        PROGRAM,
        &["render", archive.to_str().unwrap(), "--software", "--out", archive.to_str().unwrap()],
    );
    assert_eq!(over.status.code(), Some(2));
    // An archive of something else says so by its own name.
    std::fs::remove_dir_all(&case).unwrap();
    std::fs::create_dir(&case).unwrap();
    std::fs::write(case.join("letter.txt"), "nothing of ours").unwrap();
    zipped(&case, &archive);
    let output = run(PROGRAM, &["measure", archive.to_str().unwrap()]);
    let line = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), line.lines().count()), (Some(2), 1), "{line}");
    assert!(line.contains("study.ZIP: found no") && !line.contains("glioscope-zip-"), "{line}");
}

#[test]
fn a_session_of_an_archive_opens_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let (case, archive) = (folder.path().join("case"), folder.path().join("study.zip"));
    write_cube(&case.join("A_mask.nii.gz"), 12, 1.0, |[x, ..]| u8::from((3..9).contains(&x)));
    write_cube(&case.join("B_mask.nii.gz"), 12, 1.0, |[x, ..]| u8::from((4..9).contains(&x)));
    zipped(&case, &archive);
    let mut harness = sample();
    perform(&mut harness, AppCommand::Open(CaseRef::Path(archive.clone())));
    wait_for_workers(&mut harness);
    harness.key_press(Key::Enter);
    wait_for_workers(&mut harness);
    assert_eq!(error_text(&harness), "");
    assert_eq!(doc(&harness).case, CaseRef::Path(archive));
    let path = folder.path().join("s.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert!(session::load(&path).is_ok());
    let report = measured(&[path.to_str().unwrap()]);
    assert_eq!(mask_ids(&report, 0), ["A", "B"]);
    let codes = report["warnings"].to_string();
    assert!(!codes.contains("changed"), "{codes}");
    archive::remove_unpacked();
}

#[test]
fn studies_on_a_cd_open_from_an_archive() {
    let Some(folder) = real_data("dicom-multimodal") else { return };
    let place = tempfile::tempdir().unwrap();
    let archive = place.path().join("cd.zip");
    zipped(&folder, &archive);
    let (of_folder, of_archive) =
        (measured(&[folder.to_str().unwrap()]), measured(&[archive.to_str().unwrap()]));
    assert_eq!(of_archive["time_points"], of_folder["time_points"]);
}

#[test]
fn schemes_make_the_masks_of_brats() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("seg.nii.gz");
    // 8 slices each of the background, 1, 2 and 4.
    write_cube(&path, 32, 1.0, |[x, ..]| [0, 1, 2, 4][x / 8]);
    let report = measured(&["--mask", &format!("a={}:brats-2021", path.display())]);
    assert_eq!(mask_ids(&report, 0), ["a-WT", "a-TC", "a-ET"]);
    let voxels: Vec<u64> = report["time_points"][0]["masks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|mask| mask["voxels"].as_u64().unwrap() / (8 * 32 * 32))
        .collect();
    assert_eq!(voxels, [3, 2, 1]);

    let manifest = folder.path().join("case.toml");
    std::fs::write(
        folder.path().join("names.label"),
        "1 255 0 0 1 1 1 \"core\"\n2 0 255 0 1 1 1 \"oedema\"\n",
    )
    .unwrap();
    for (scheme, ids) in [("brats-2020", &["b-WT", "b-TC", "b-ET"][..]), ("names.label", &["b-1", "b-2"])] {
        let text =
            format!("glioscope = 1\n[[mask]]\nid = \"b\"\nfile = \"seg.nii.gz\"\nscheme = \"{scheme}\"\n");
        std::fs::write(&manifest, text).unwrap();
        let report = measured(&[manifest.to_str().unwrap()]);
        assert_eq!(mask_ids(&report, 0), ids);
    }
    std::fs::write(
        &manifest,
        "glioscope = 1\n[[mask]]\nid = \"b\"\nfile = \"seg.nii.gz\"\nscheme = \"brats\"\n",
    )
    .unwrap();
    let output = run(PROGRAM, &["measure", manifest.to_str().unwrap()]);
    let line = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && line.contains("brats-2021"), "{line}");
}

#[test]
fn a_scheme_is_chosen_in_the_dialog() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case");
    write_cube(&path.join("BraTS2021_00002_seg.nii.gz"), 16, 1.0, |[x, ..]| [0, 1, 2, 4][x / 4]);
    let mut harness = sample();
    perform(&mut harness, AppCommand::Open(CaseRef::Path(path)));
    wait_for_workers(&mut harness);
    // By the accessibility tree: the dialog and the menu move in their first frames.
    harness.get_by_label("Label scheme of BraTS2021_00002_seg.nii.gz").click_accesskit();
    harness.run_ok();
    harness
        .get_by_label_contains("BraTS 2021: whole tumour, tumour core, enhancing tumour")
        .click_accesskit();
    harness.run_ok();
    harness.run_ok();
    let labels: Vec<String> = harness
        .query_all_by(|node| {
            node.label().is_some_and(|label| label.contains("seg") || label.contains("BraTS"))
        })
        .filter_map(|node| node.accesskit_node().label())
        .collect();
    assert!(harness.query_by_label("Name of BraTS2021_00002-WT").is_some(), "{labels:?}");
    harness.key_press(Key::Escape);
    harness.run_ok();
    harness.key_press(Key::Enter);
    wait_for_workers(&mut harness);
    let time_point = harness.state().work.world.time_point(doc(&harness)).unwrap();
    assert_eq!(time_point.regions.mask_ids(), ["WT", "TC", "ET"].map(|end| format!("BraTS2021_00002-{end}")));
}

#[test]
fn a_server_that_is_not_there_is_said_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    // Nobody listens on the port of a socket that was closed.
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let url = format!("http://127.0.0.1:{port}/dicom-web");
    for (server, found) in [
        (url.as_str(), "127.0.0.1"),
        ("elsewhere", "server: found \"elsewhere\""),
        ("http://192.0.2.1/dicom-web", "plain http to another machine"),
        ("https://user:secret-5@localhost/dicom-web", "user"),
    ] {
        let output = std::process::Command::new(PROGRAM)
            .args(["pacs", "list", "--pacs", server])
            .env("GLIOSCOPE_CONFIG", folder.path())
            .env("GLIOSCOPE_CACHE", folder.path().join("cache"))
            .output()
            .unwrap();
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!((output.status.code(), line.lines().count()), (Some(2), 1), "{line}");
        assert!(line.contains(found) && !line.contains("secret-5"), "{line}");
    }
}

#[test]
fn the_dialog_of_an_archive_says_what_went_wrong() {
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let mut harness = sample();
    perform(&mut harness, AppCommand::ShowPacs);
    harness.get_by_label("Server").focus();
    harness.run_ok();
    harness.get_by_label("Server").type_text(&format!("http://127.0.0.1:{port}/dicom-web"));
    harness.run_ok();
    harness.get_by_label("Search").click();
    for _ in 0..200 {
        harness.run_ok();
        if harness.query_by_label_contains("expected").is_some() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(harness.query_by_label_contains("127.0.0.1").is_some());
    harness.key_press(Key::Escape);
    harness.run_ok();
    assert!(harness.query_by_label("Search").is_none());
}
