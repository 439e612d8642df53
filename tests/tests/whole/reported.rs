//! Faults that users of other programs reported, tried here: deeds and right values of
//! ../shared/data/reported/README.md.

use std::path::PathBuf;

use glioscope_tests::{real_data, run};
use serde_json::Value;

use crate::PROGRAM;

fn text(path: PathBuf) -> String {
    path.into_os_string().into_string().unwrap()
}

/// JSON and stderr of a run that succeeds.
fn answer(arguments: &[&str]) -> (Value, String) {
    glioscope_tests::answer(PROGRAM, arguments)
}

/// The line on stderr of a run that is refused.
fn refusal(arguments: &[&str]) -> String {
    let output = run(PROGRAM, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert!(output.stdout.is_empty());
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn assert_near(found: &Value, expected: f64, tolerance: f64) {
    let found = found.as_f64().unwrap();
    assert!((found - expected).abs() <= tolerance, "found {found}, expected {expected}");
}

#[test]
fn sessions_named_pre_and_post_are_in_time_order() {
    let Some(folder) = real_data("reported/14-cat12-62-prepost") else { return };
    let (change, _) = answer(&["change", &text(folder), "--json"]);
    assert_near(&change["from_ml"], 0.925, 5e-4);
    assert_near(&change["to_ml"], 4.169, 5e-4);
    // Balls: the difference of their radii is 3.940 mm. Between voxel centres it was 3.83.
    assert_near(&change["growth"]["mean_mm"], 3.94, 0.04);
}

#[test]
fn dates_are_in_time_order_whatever_the_order_of_arguments() {
    let Some(folder) = real_data("reported/14-cli") else { return };
    let mask = |file: &str, date: &str| format!("A={}@{date}", text(folder.join(file)));
    let (january, may) = (mask("a.nii.gz", "2024-01-01"), mask("b.nii.gz", "2024-05-01"));
    let manifest = text(folder.join("case.toml"));
    for arguments in [
        vec!["change", "--mask", &may, "--mask", &january, "--json"],
        vec!["change", "--mask", &january, "--mask", &may, "--json"],
        vec!["change", &manifest, "--json"],
    ] {
        let (change, _) = answer(&arguments);
        assert_near(&change["from_ml"], 0.925, 5e-4);
        assert_near(&change["to_ml"], 4.169, 5e-4);
    }
}

#[test]
fn masks_of_two_dates_without_a_common_place_have_volumes_only() {
    let Some(folder) = real_data("reported/48-unregistered") else { return };
    let mask = |file: &str, date: &str| format!("A={}@{date}", text(folder.join(file)));
    let [a, b] = [mask("a.nii.gz", "2024-01-01"), mask("b.nii.gz", "2024-05-01")];
    let (change, stderr) = answer(&["change", "--mask", &a, "--mask", &b, "--json"]);
    assert_near(&change["from_ml"], 2.103, 5e-4);
    assert_near(&change["to_ml"], 2.103, 5e-4);
    assert_eq!(change["flags"], serde_json::json!(["no-overlap", "touches-border"]));
    assert_eq!(change["vectors"], 0);
    assert_eq!(change["components"], serde_json::json!([]));
    assert_eq!(change["warnings"][0]["code"], "no-overlap");
    assert!(stderr.contains("warning [no-overlap]") && stderr.contains("not aligned?"), "{stderr}");
    let plain = run(PROGRAM, &["change", "--mask", &a, "--mask", &b]);
    let plain = String::from_utf8(plain.stdout).unwrap();
    assert!(plain.contains("no overlap: not aligned?") && !plain.contains("vanished"), "{plain}");
    // A picture of the comparison has the same warning beside it.
    let out = tempfile::tempdir().unwrap();
    let picture = text(out.path().join("change.png"));
    let render = ["render", "--software", "--view", "change", "--size", "400x300", "--out", &picture];
    let drawn = run(PROGRAM, &[&render[..], &["--mask", &a, "--mask", &b, "--moment"]].concat());
    let stderr = String::from_utf8_lossy(&drawn.stderr).into_owned();
    assert!(drawn.status.success() && stderr.contains("warning [no-overlap]"), "{stderr}");
    assert!(stderr.contains("--moment changes nothing in this view"), "{stderr}");
}

#[test]
fn two_patients_in_one_folder_are_refused_by_name() {
    let Some(folder) = real_data("reported/40-brats20-two") else { return };
    for command in ["measure", "change", "info"] {
        let line = refusal(&[command, &text(folder.clone())]);
        assert!(line.contains("BraTS20_Training_001, BraTS20_Training_002"), "{line}");
    }
    let one = folder.join("BraTS20_Training_001");
    let (report, _) = answer(&["measure", &text(one), "--json"]);
    assert_eq!(report["time_points"].as_array().unwrap().len(), 1);
}

#[test]
fn one_body_in_two_slicings_has_not_changed() {
    let Some(folder) = real_data("reported/39-thick-slices") else { return };
    let mask = |id: &str, file: &str, date: &str| format!("{id}={}@{date}", text(folder.join(file)));
    for size in ["12", "18"] {
        let flair1 = mask("FLAIR", &format!("flair1_{size}.nii.gz"), "2024-01-01");
        let flair2 = mask("FLAIR", &format!("flair2_{size}.nii.gz"), "2024-05-01");
        let t1c = mask("T1c", &format!("t1c_{size}.nii.gz"), "2024-01-01");
        let plain = ["change", "--of", "FLAIR", "--mask", &flair1, "--mask", &flair2, "--json"];
        let with_t1c: Vec<&str> = plain.into_iter().chain(["--mask", &t1c]).collect();
        for arguments in [plain.to_vec(), with_t1c] {
            let (change, _) = answer(&arguments);
            assert_near(&change["uncertainty_mm"]["axes_mm"][2], 4.12, 5e-3);
            assert!(change["vectors"].as_u64().unwrap() > 300);
            assert_eq!(change["within_uncertainty"], change["vectors"], "{arguments:?}");
        }
    }
}

#[test]
fn words_with_numbers_in_names_are_dates() {
    let Some(folder) = real_data("reported/14-ucsf-time") else { return };
    let folder = text(folder);
    let (report, _) = answer(&["measure", &folder, "--json"]);
    let times = report["time_points"].as_array().unwrap();
    assert_eq!(times.iter().map(|t| &t["time"]).collect::<Vec<_>>(), ["time1", "time2"]);
    let (change, _) = answer(&["change", &folder, "--json"]);
    assert_eq!((&change["from"], &change["to"]), (&"time1".into(), &"time2".into()));
}

#[test]
fn boxes_that_overlap_without_a_common_voxel_are_named_so() {
    let Some(folder) = real_data("reported/25-torchio-782") else { return };
    let [fine, coarse] = [("F", "fine.nii.gz"), ("C", "coarse.nii.gz")]
        .map(|(id, file)| format!("{id}={}", text(folder.join(file))));
    let (report, stderr) =
        answer(&["measure", "--mask", &fine, "--mask", &coarse, "--case-grid", "C", "--json"]);
    let shares = report["time_points"][0]["pairs"][0]["dice"].as_f64().unwrap() > 0.0;
    assert!(shares || stderr.contains("boxes overlap, no voxel shared"), "{stderr}");
    assert!(!stderr.contains("box is 0.0 mm away"), "{stderr}");
}
