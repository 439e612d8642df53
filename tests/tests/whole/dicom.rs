//! DICOM and exports through the program: command line, dialog, and a case as DICOM beside the same case as NIfTI.

use std::path::Path;

use egui::{Key, Theme};
use egui_kittest::kittest::Queryable;
use glioscope::{command::AppCommand, export::What, model::CaseRef};
use glioscope_tests::{doc, error_text, issue, real_data, run, wait_for_workers, window_on};
use serde_json::Value;

use crate::PROGRAM;

fn json(arguments: &[&str]) -> Value {
    glioscope_tests::answer(PROGRAM, arguments).0
}

fn refusal(arguments: &[&str]) -> String {
    glioscope_tests::refusal(PROGRAM, arguments)
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Volumes in millilitres on the masks' own grids, and Dice of all pairs, sorted.
fn numbers(report: &Value) -> (Vec<f64>, Vec<f64>) {
    let time = &report["time_points"][0];
    let sorted = |list: &Value, key: &str| {
        let mut all: Vec<f64> = list.as_array().unwrap().iter().map(|m| m[key].as_f64().unwrap()).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    (sorted(&time["masks"], "native_volume_ml"), sorted(&time["pairs"], "dice"))
}

#[test]
fn a_folder_of_dicom_measures_like_the_same_case_as_nifti() {
    let (Some(dicom), Some(nifti)) = (real_data("dicom-multimodal"), real_data("sarcoma-ct-mr-pet")) else {
        return;
    };
    let a = numbers(&json(&["measure", text(&dicom), "--json"]));
    let b = numbers(&json(&["measure", text(&nifti), "--json"]));
    assert_eq!(a.0.len(), 3);
    for (a, b) in a.0.iter().chain(&a.1).zip(b.0.iter().chain(&b.1)) {
        // The NIfTI's affine has floats.
        assert!((a - b).abs() < 1e-5 * b, "{a} {b}");
    }
}

#[test]
fn two_patients_are_never_one_case() {
    let Some(data) = real_data("dicom-folders") else { return };
    let folder = data.join("two-patients");
    let line = refusal(&["measure", text(&folder)]);
    assert!(
        line.contains("found files of 2 patients (Doe Archibald, 77654033, Doe Peter, 98890234)"),
        "{line}"
    );
    // The index of a CD means the CD.
    let index = refusal(&["measure", text(&folder.join("DICOMDIR"))]);
    assert!(index.contains("found files of 2 patients"), "{index}");
    let tree = json(&["info", text(&folder), "--json"]);
    let patients = tree["patients"].as_array().unwrap();
    assert_eq!(patients.len(), 2);
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(data.join("truth.json")).unwrap()).unwrap();
    for case in ["two-patients", "tiny-alpha"] {
        let tree = json(&["info", text(&data.join(case)), "--json"]);
        let found: Vec<&Value> = tree["patients"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|p| p["studies"].as_array().unwrap())
            .flat_map(|s| s["series"].as_array().unwrap())
            .collect();
        let expected = truth["cases"][case]["series"].as_array().unwrap();
        assert_eq!(found.len(), expected.len(), "{case}");
        for series in expected {
            let same = found.iter().find(|f| f["series_instance_uid"] == series["series"]).unwrap();
            assert_eq!(same["files"], series["instances"], "{series}");
            assert_eq!(same["modality"], series["modality"], "{series}");
        }
    }
}

#[test]
fn the_dialog_takes_one_patient_at_a_time() {
    let Some(data) = real_data("dicom-folders") else { return };
    let mut harness = window_on(CaseRef::Sample, [1280.0, 720.0], Theme::Light);
    harness.run_ok();
    issue(&mut harness, AppCommand::Open(CaseRef::Path(data.join("two-patients"))));
    wait_for_workers(&mut harness);
    assert!(harness.query_by_label("Open it like this").is_some());
    assert!(harness.query_all_by_label("Only this patient").count() == 2);
    harness.run_ok();
    // The gated series of five slices is the one that can be shown.
    harness.key_press(Key::Enter);
    harness.run_ok();
    wait_for_workers(&mut harness);
    assert_eq!(error_text(&harness), "");
    let case = harness.state().work.world.case().unwrap();
    let ids: Vec<&str> = case.time_points[0].contexts.iter().map(|c| c.id.as_str()).collect();
    assert_eq!(ids, ["CT SmartScore - Gated 0.5 sec"]);
    assert!(doc(&harness).case != CaseRef::Sample);
}

#[test]
fn compressed_frames_are_decoded_in_another_process() {
    let Some(data) = real_data("dicom-encodings") else { return };
    let count = |file: &str| {
        let mask = format!("m={}", text(&data.join(file)));
        json(&["measure", "--mask", &mask, "--json"])["time_points"][0]["masks"][0]["voxels"]
            .as_u64()
            .unwrap()
    };
    let plain = count("u8-explicit-le.dcm");
    assert!(plain > 0);
    for file in ["u8-jpeg2000-lossless.dcm", "u8-jpegls-lossless.dcm", "u8-jpeg-lossless-p14.dcm"] {
        assert_eq!(count(file), plain, "{file}");
    }
    let Some(hostile) = real_data("dicom-malformed") else { return };
    for file in ["jpeg-garbage.dcm", "j2k-60000x60000.dcm", "j2k-half.dcm"] {
        let mask = format!("m={}", text(&hostile.join(file)));
        assert!(refusal(&["measure", "--mask", &mask]).contains(file));
    }
}

#[test]
fn a_manifest_names_series_and_segments() {
    let Some(data) = real_data("dicom-multimodal") else { return };
    let tree = json(&["info", text(&data), "--json"]);
    let series = tree["patients"][0]["studies"][0]["series"].as_array().unwrap();
    let of = |description: &str| -> &str {
        let found = series.iter().find(|s| s["description"] == description).unwrap();
        found["series_instance_uid"].as_str().unwrap()
    };
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(&data, folder.path().join("study")).unwrap();
    let manifest = format!(
        "glioscope = 1\n[[context]]\nid = \"PET\"\nfile = \"study\"\nseries = \"{}\"\n[[mask]]\nid = \"PET\"\nfile = \"study\"\nseries = \"{}\"\nsegment = 1\n",
        of("IBSI_1_STS_003_PET_image"),
        of("IBSI_1_STS_003_PET_mask"),
    );
    let path = folder.path().join("case.toml");
    std::fs::write(&path, &manifest).unwrap();
    let report = json(&["measure", text(&path), "--json"]);
    assert_eq!(report["time_points"][0]["masks"][0]["voxels"], 817);
    std::fs::write(&path, manifest.replace("segment = 1", "segment = 9")).unwrap();
    let line = refusal(&["measure", text(&path)]);
    assert!(line.contains("found no segment 9, expected one of its segments (1)"), "{line}");
    std::fs::write(&path, manifest.replace("segment = 1", "segment = 1\nframe = 2")).unwrap();
    assert!(refusal(&["measure", text(&path)]).contains("a frame and a segment"));
}

#[test]
fn exports_hold_the_masks_of_the_case_voxel_for_voxel() {
    let folder = tempfile::tempdir().unwrap();
    let sample = json(&["measure", "--sample", "--json"]);
    let label =
        sample["time_points"][0]["time"].as_str().or(sample["time_points"][0]["label"].as_str()).unwrap();
    let out = |name: &str, arguments: &[&str]| {
        let path = folder.path().join(name);
        let all = [&["export", "--sample", "--time", label], arguments, &["--out", text(&path)]].concat();
        let output = run(PROGRAM, &all);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        path
    };
    let voxels = |report: &Value| -> Vec<u64> {
        let masks = report["time_points"][0]["masks"].as_array().unwrap();
        masks.iter().map(|m| m["voxels"].as_u64().unwrap()).collect()
    };
    let slicer = out("all.seg.nrrd", &["--format", "seg.nrrd"]);
    let read = json(&["measure", text(&slicer), "--json"]);
    assert_eq!(voxels(&read), voxels(&sample));
    let pairs = |report: &Value| report["time_points"][0]["pairs"].clone();
    let dice = |report: &Value| -> Vec<f64> {
        pairs(report).as_array().unwrap().iter().map(|p| p["dice"].as_f64().unwrap()).collect()
    };
    assert_eq!(dice(&read), dice(&sample));
    // Regions never overlap: one label map of them.
    let regions = out("regions.nii.gz", &["--what", "regions", "--format", "nifti"]);
    let info = json(&["info", text(&regions), "--json"]);
    assert_eq!(info["frames"], 1);
    // A file of each where masks overlap.
    let each = out("each", &["--format", "nifti"]);
    assert_eq!(std::fs::read_dir(each).unwrap().count(), 3);
    for (name, format) in [("all.obj", "obj"), ("all.glb", "gltf")] {
        assert!(out(name, &["--format", format, "--smooth"]).metadata().unwrap().len() > 1000);
    }
    let again = folder.path().join("again.glb");
    std::fs::copy(folder.path().join("all.glb"), &again).unwrap();
    let all = folder.path().join("all.glb");
    let arguments =
        ["export", "--sample", "--time", label, "--format", "gltf", "--smooth", "--out", text(&all)];
    assert!(refusal(&arguments).contains("found a file that exists"));
    out("all.glb", &["--format", "gltf", "--smooth", "--force"]);
    assert_eq!(std::fs::read(&again).unwrap(), std::fs::read(folder.path().join("all.glb")).unwrap());
}

#[test]
fn masks_of_another_patient_are_refused_however_they_are_named() {
    let Some(series) = real_data("dicom-series") else { return };
    let Some(masks) = real_data("dicom-seg-highdicom") else { return };
    let image = format!("i={}", text(&series.join("plain-axial")));
    let mask = |file: &str| format!("m={}", text(&masks.join(file)));
    let other = mask("binary-other-patient.dcm");
    let line = refusal(&["measure", "--context", &image, "--mask", &format!("{other}:1")]);
    assert!(line.contains("found files of two patients: i (Phantom Test, GS-TEST-1)"), "{line}");
    // A number behind a file that names its segments is a segment's.
    let count = |argument: &str| {
        let report = json(&["measure", "--mask", argument, "--json"]);
        report["time_points"][0]["masks"][0]["voxels"].as_u64().unwrap()
    };
    assert_eq!(count(&format!("{}:2", mask("binary-3-segments.dcm"))), 3492);
    let line = refusal(&["measure", "--mask", &format!("{}:9", mask("binary-3-segments.dcm"))]);
    assert!(line.contains("found no segment 9, expected one of its segments (1, 2, 3)"), "{line}");
    let line = refusal(&["measure", "--mask", &mask("binary-3-segments.dcm")]);
    assert!(line.contains("found 3 segments (1, 2, 3), expected one of them (FILE:NUMBER)"), "{line}");
    // The background of a label map is none of its labels.
    assert_eq!(count(&mask("labelmap-background-5.dcm")), 5031);
    // Another frame of reference is said.
    let other = format!("{}:1", mask("binary-other-frame-of-reference.dcm"));
    let report = json(&["measure", "--context", &image, "--mask", &other, "--json"]);
    let codes: Vec<&str> =
        report["warnings"].as_array().unwrap().iter().map(|w| w["code"].as_str().unwrap()).collect();
    assert!(codes.contains(&"frames-of-reference"), "{codes:?}");
}

#[test]
fn the_window_exports_the_masks_of_the_date_shown() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = window_on(CaseRef::Sample, [1280.0, 720.0], Theme::Light);
    harness.run_ok();
    let masks = folder.path().join("masks.seg.nrrd");
    issue(&mut harness, AppCommand::ExportMasksTo(What::Masks, masks.clone()));
    wait_for_workers(&mut harness);
    assert_eq!(error_text(&harness), "");
    let shown = harness.state().work.doc.as_ref().unwrap().nav.time;
    let case = harness.state().work.world.case().unwrap();
    let expected: Vec<u64> = case.time_points[shown].masks.iter().map(|m| m.mask.voxels()).collect();
    let union = case.time_points[shown].regions.union_voxels();
    let voxels = |path: &Path| -> Vec<u64> {
        let report = json(&["measure", text(path), "--json"]);
        let masks = report["time_points"][0]["masks"].as_array().unwrap();
        masks.iter().map(|m| m["voxels"].as_u64().unwrap()).collect()
    };
    assert_eq!(voxels(&masks), expected);
    let selection = folder.path().join("selection.nii.gz");
    issue(&mut harness, AppCommand::ExportMasksTo(What::Selection, selection.clone()));
    wait_for_workers(&mut harness);
    assert_eq!(voxels(&selection), [union]);
    // Another ending is said, and nothing is written.
    issue(&mut harness, AppCommand::ExportMasksTo(What::Masks, folder.path().join("masks.xyz")));
    wait_for_workers(&mut harness);
    assert!(error_text(&harness).contains("expected .seg.nrrd"), "{}", error_text(&harness));
    assert!(!folder.path().join("masks.xyz").exists());
}

/// Strings that identify a patient are in no export unless asked for.
#[test]
fn exports_name_nobody_unless_asked() {
    let Some(data) = real_data("dicom-multimodal") else { return };
    let folder = tempfile::tempdir().unwrap();
    let holds = |path: &Path, word: &[u8]| {
        let bytes = std::fs::read(path).unwrap();
        bytes.windows(word.len()).any(|part| part == word)
    };
    for (name, format) in [
        ("a.seg.nrrd", "seg.nrrd"),
        ("a.dcm", "dicom-seg"),
        ("r.dcm", "rtstruct"),
        ("a.obj", "obj"),
        ("a.glb", "gltf"),
    ] {
        let path = folder.path().join(name);
        let output = run(PROGRAM, &["export", text(&data), "--format", format, "--out", text(&path)]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        // The patient's name and ID, and the root of the study's UIDs.
        for word in [&b"STS_003"[..], b"1.3.6.1.4.1.14519", b"20050415"] {
            assert!(!holds(&path, word), "{format}: {}", String::from_utf8_lossy(word));
        }
    }
    let path = folder.path().join("identified.dcm");
    let arguments = ["export", text(&data), "--format", "dicom-seg", "--identified", "--out", text(&path)];
    assert!(run(PROGRAM, &arguments).status.success());
    assert!(holds(&path, b"STS_003") && holds(&path, b"1.3.6.1.4.1.14519"));
}

#[test]
fn exports_never_overwrite_an_input_and_say_what_they_can_not_hold() {
    let folder = tempfile::tempdir().unwrap();
    let mask = folder.path().join("mask.nii.gz");
    glioscope_tests::write_cube(&mask, 8, 1.0, |[x, ..]| u8::from(x < 3));
    let before = std::fs::read(&mask).unwrap();
    let argument = format!("m={}", text(&mask));
    let line = refusal(&["export", "--mask", &argument, "--format", "nifti", "--out", text(&mask)]);
    assert!(line.contains("a file that the case was read from"), "{line}");
    assert_eq!(std::fs::read(&mask).unwrap(), before);
    let line = refusal(&["export", "--mask", &argument, "--format", "nifti", "--out", "/dev/full"]);
    assert!(line.contains("/dev/full: found a file of another kind"), "{line}");
    let line = refusal(&["export", "--mask", &argument, "--format", "nifti", "--smooth", "--out", "x.nii"]);
    assert!(line.contains("--smooth: found a format of voxels"), "{line}");
    let line =
        refusal(&["export", "--mask", &argument, "--select", "n", "--format", "nifti", "--out", "x.nii"]);
    assert!(line.contains("expected masks of the case: m"), "{line}");
}
