//! The command line as a process: answers on stdout, one line on stderr, exit codes.

use std::path::{Path, PathBuf};

use glioscope_tests::{real_data, run};
use serde_json::Value;

use crate::PROGRAM;

fn json(arguments: &[&str]) -> Value {
    let output = run(PROGRAM, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Exit code 2, nothing on stdout, one line on stderr that holds each of `words`.
fn refused(arguments: &[&str], words: &[&str]) {
    let output = run(PROGRAM, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
    assert!(output.stdout.is_empty(), "{arguments:?}");
    assert_eq!(stderr.trim_end().lines().count(), 1, "{arguments:?}: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{arguments:?}: {word} not in {stderr}");
    }
}

#[test]
fn the_sample_is_measured_and_its_json_has_the_documented_keys() {
    let report = json(&["measure", "--sample", "--json"]);
    for key in ["case", "grid", "warnings", "time_points"] {
        assert!(report.get(key).is_some(), "{key}");
    }
    for key in ["dims", "spacing_mm", "world_from_voxel"] {
        assert!(report["grid"].get(key).is_some(), "{key}");
    }
    let times = report["time_points"].as_array().unwrap();
    assert_eq!(times.len(), 2);
    for time in times {
        assert_eq!(time["masks"].as_array().unwrap().len(), 3);
        assert_eq!(time["regions"].as_array().unwrap().len(), 7);
        assert_eq!(time["pairs"].as_array().unwrap().len(), 3);
        let of_regions: u64 =
            time["regions"].as_array().unwrap().iter().map(|r| r["voxels"].as_u64().unwrap()).sum();
        let t1_alone_and_shared: u64 = time["regions"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|r| r["masks"].as_array().unwrap().iter().any(|m| m == "T1"))
            .map(|r| r["voxels"].as_u64().unwrap())
            .sum();
        assert_eq!(time["masks"][0]["voxels"].as_u64().unwrap(), t1_alone_and_shared);
        assert!(of_regions > t1_alone_and_shared);
    }
}

#[test]
fn the_sample_written_as_files_measures_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("sample");
    let written = run(PROGRAM, &["sample", "--out", out.to_str().unwrap()]);
    assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
    let embedded = json(&["measure", "--sample", "--json"]);
    let from_files = json(&["measure", out.to_str().unwrap(), "--json"]);
    assert_eq!(embedded["time_points"], from_files["time_points"]);
}

#[test]
fn wrong_input_is_one_line_and_exit_code_two() {
    refused(&["measure", "/nowhere/at/all"], &["/nowhere/at/all", "found", "expected"]);
    refused(&["measure"], &["found no case", "--sample"]);
    refused(&["measure", "--sample", "--case-grid", "X"], &["X"]);
    refused(&["render", "--view", "nosuch", "--out", "x.png"], &["--view", "nosuch", "closeup"]);
    refused(&["render", "--size", "0x0", "--out", "x.png"], &["--size", "0x0"]);
    refused(&["render", "--lens", "1,2,3,-4", "--out", "x.png"], &["--lens"]);
    refused(&["render", "--select", "T9", "--out", "x.png"], &["--select", "T9", "T1, T2, PET"]);
    refused(&["render", "--time", "1999", "--out", "x.png"], &["--time", "2024-01-15"]);
    refused(&["info", "Cargo.toml.nii"], &["Cargo.toml.nii", "found", "expected"]);
}

#[test]
fn explaining_a_plan_needs_no_graphics_and_gives_reasons() {
    let plain = run(PROGRAM, &["render", "--explain"]);
    let text = String::from_utf8(plain.stdout).unwrap();
    assert!(plain.status.success() && text.contains("runs"), "{text}");
    let none = run(PROGRAM, &["render", "--explain", "--select", "none", "--lens", "off"]);
    let text = String::from_utf8(none.stdout).unwrap();
    assert!(text.contains("left out"), "{text}");
}

fn files_below(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { files_below(&path, into) } else { into.push(path) }
    }
}

#[test]
fn every_malformed_file_ends_in_exit_code_two() {
    let Some(folder) = real_data("nifti-malformed") else { return };
    let mut files = Vec::new();
    files_below(&folder, &mut files);
    assert!(files.len() >= 15, "{files:?}");
    for file in files {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let path = file.to_str().unwrap();
        refused(&["info", path], &["found", "expected"]);
        refused(&["measure", "--mask", &format!("A={path}")], &[&name, "found", "expected"]);
    }
}

#[test]
fn the_glioma_case_counts_what_numpy_counts() {
    let Some(folder) = real_data("glioma-5-algorithms") else { return };
    let argument = |id: &str, file: &str| format!("{id}={}:1,2,4", folder.join(file).display());
    let masks = [
        argument("A", "hnfnetv1-20.nii.gz"),
        argument("B", "isen-20.nii.gz"),
        argument("C", "scan-20.nii.gz"),
    ];
    let mut arguments = vec!["measure", "--json"];
    for mask in &masks {
        arguments.extend(["--mask", mask]);
    }
    let report = json(&arguments);
    // From NumPy: tests/expected/glioma_regions.py.
    let expected = [
        (vec!["A"], 178),
        (vec!["B"], 6241),
        (vec!["C"], 59),
        (vec!["A", "B"], 3902),
        (vec!["A", "C"], 13),
        (vec!["B", "C"], 30),
        (vec!["A", "B", "C"], 25632),
    ];
    let regions = report["time_points"][0]["regions"].as_array().unwrap();
    assert_eq!(regions.len(), expected.len());
    for (masks, voxels) in expected {
        let found = regions.iter().find(|r| r["masks"] == serde_json::json!(masks));
        assert_eq!(found.unwrap()["voxels"].as_u64(), Some(voxels), "{masks:?}");
    }
    let dice: Vec<f64> = report["time_points"][0]["pairs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["dice"].as_f64().unwrap())
        .collect();
    for (found, numpy) in dice.iter().zip([0.901_388_676_9, 0.924_827_349_9, 0.834_007_702_4]) {
        assert!((found - numpy).abs() < 1e-9, "{found} {numpy}");
    }
}

#[test]
fn ellipsoids_have_the_documented_keys_and_hold_what_they_say() {
    let report = json(&["ellipsoids", "--sample", "--json"]);
    let measured = json(&["measure", "--sample", "--json"]);
    let components = report["components"].as_array().unwrap();
    for key in ["of", "time", "voxels", "volume_ml", "center_mm", "semi_axes_mm", "rotation", "volume_bound"]
    {
        assert!(components.iter().all(|c| c.get(key).is_some()), "{key}");
    }
    for time in measured["time_points"].as_array().unwrap() {
        for mask in time["masks"].as_array().unwrap() {
            let voxels: u64 = components
                .iter()
                .filter(|c| c["of"]["mask"] == mask["id"] && c["time"] == time["time"])
                .map(|c| c["voxels"].as_u64().unwrap())
                .sum();
            assert_eq!(voxels, mask["voxels"].as_u64().unwrap(), "{} {}", mask["id"], time["time"]);
        }
        for region in time["regions"].as_array().unwrap() {
            let voxels: u64 = components
                .iter()
                .filter(|c| c["of"]["region"] == region["masks"] && c["time"] == time["time"])
                .map(|c| c["voxels"].as_u64().unwrap())
                .sum();
            assert_eq!(voxels, region["voxels"].as_u64().unwrap(), "{} {}", region["masks"], time["time"]);
        }
    }
    for c in components {
        let axes: Vec<f64> =
            c["semi_axes_mm"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        let ml = 4.0 / 3.0 * std::f64::consts::PI * axes.iter().product::<f64>() / 1000.0;
        let ratio = ml / c["volume_ml"].as_f64().unwrap();
        assert!((ratio / c["exaggeration"].as_f64().unwrap() - 1.0).abs() < 1e-9);
        assert!(ratio > 1.0 && c["volume_bound"].as_f64().unwrap() <= 1.0 + 1e-7);
    }
    refused(&["ellipsoids", "--sample", "--connectivity", "7"], &["7", "26"]);
}

#[test]
fn change_has_the_documented_keys_and_wrong_dates_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("vectors.csv");
    let report = json(&["change", "--sample", "--of", "T1", "--json", "--csv", csv.to_str().unwrap()]);
    for key in [
        "mask",
        "from",
        "to",
        "kept_ml",
        "gone_ml",
        "new_ml",
        "flags",
        "vectors",
        "growth",
        "recession",
        "within_uncertainty",
        "skeleton_points",
    ] {
        assert!(report.get(key).is_some(), "{key}");
    }
    let counted = |way: &str| report[way]["count"].as_u64().unwrap();
    assert_eq!(counted("growth") + counted("recession"), report["vectors"].as_u64().unwrap());
    let lines = std::fs::read_to_string(&csv).unwrap().lines().count() as u64;
    assert!(lines > report["vectors"].as_u64().unwrap(), "a head line and a line a vector: {lines}");
    // What was kept, went and came is what counting the masks gives.
    let measured = json(&["measure", "--sample", "--json"]);
    let ml = |time: usize| measured["time_points"][time]["masks"][0]["volume_ml"].as_f64().unwrap();
    let of = |key: &str| report[key].as_f64().unwrap();
    assert!((of("kept_ml") + of("gone_ml") - ml(0)).abs() < 1e-9);
    assert!((of("kept_ml") + of("new_ml") - ml(1)).abs() < 1e-9);
    refused(&["change", "--sample", "--of", "T1", "--to", "2031-01-01"], &["2031-01-01", "2024-04-15"]);
    refused(&["change", "--sample", "--of", "T9"], &["T9"]);
    // Without a mask it is the first that both dates have, and that is said.
    let output = run(PROGRAM, &["change", "--sample", "--json"]);
    let assumed: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(assumed["mask"], "T1");
    assert!(String::from_utf8_lossy(&output.stderr).contains("the first of T1, T2, PET"));
}

/// Three dates: numbers and picture compare the first with the last, and both say so.
#[test]
fn numbers_and_picture_compare_the_same_dates() {
    let folder = tempfile::tempdir().unwrap();
    glioscope_core::sample::write_sample(folder.path()).unwrap();
    let manifest = folder.path().join("case.toml");
    let mut text = std::fs::read_to_string(&manifest).unwrap();
    text.push_str("\n[[mask]]\nid = \"T1\"\nfile = \"t1-mask-2024-01-15.nii.gz\"\ntime = \"2024-09-01\"\n");
    std::fs::write(&manifest, text).unwrap();
    let case = manifest.to_str().unwrap();
    let picture = folder.path().join("change.png");
    let said = "the dates are 2024-01-15 and 2024-09-01 of 2024-01-15, 2024-04-15, 2024-09-01";
    let change = run(PROGRAM, &["change", case, "--json"]);
    let render = ["render", case, "--software", "--size", "64x64", "--view", "change", "--out"];
    let render = run(PROGRAM, &[&render[..], &[picture.to_str().unwrap()]].concat());
    for output in [&change, &render] {
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && stderr.contains(said), "{stderr}");
    }
    let report: Value = serde_json::from_slice(&change.stdout).unwrap();
    assert_eq!((&report["from"], &report["to"]), (&"2024-01-15".into(), &"2024-09-01".into()));
    let asked = run(PROGRAM, &["change", case, "--of", "T1", "--from", "2024-01-15", "--to", "2024-09-01"]);
    assert!(asked.stderr.is_empty(), "what was asked for isn't said again");
}

#[test]
fn options_of_the_3d_views_are_checked() {
    let render = |more: &[&str], words: &[&str]| {
        let all = [&["render", "--sample", "--out", "/dev/null/never.png"], more].concat();
        refused(&all, words);
    };
    render(&["--transfer", "mr"], &["mr-tissue", "ct-soft", "pet-hot"]);
    render(&["--clip", "sideways=3"], &["sideways=3", "right"]);
    render(&["--style", "dots"], &["dots", "height"]);
    render(&["--from", "2024-04-15", "--to", "2024-01-15"], &["earlier"]);
    render(&["--of", "T9"], &["T9", "T1"]);
    render(&["--zoom", "0"], &["zoom"]);
    render(&["--view", "sideways"], &["sideways", "ellipsoids"]);
}
