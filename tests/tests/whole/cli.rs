//! The command line as a process: results on stdout, errors as one line on stderr, exit codes.

use std::path::{Path, PathBuf};

use glioscope::model::CaseRef;
use glioscope_tests::{real_data, run, workstation, write_cube};
use serde_json::Value;

use crate::PROGRAM;

fn json(arguments: &[&str]) -> Value {
    glioscope_tests::answer(PROGRAM, arguments).0
}

/// Asserts exit code 2, an empty stdout and one line on stderr that contains each of `words`.
fn assert_refused(arguments: &[&str], words: &[&str]) {
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
fn measure_json_has_the_documented_keys() {
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
        let region_voxels: u64 =
            time["regions"].as_array().unwrap().iter().map(|r| r["voxels"].as_u64().unwrap()).sum();
        let t1_voxels: u64 = time["regions"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|r| r["masks"].as_array().unwrap().iter().any(|m| m == "T1"))
            .map(|r| r["voxels"].as_u64().unwrap())
            .sum();
        assert_eq!(time["masks"][0]["voxels"].as_u64().unwrap(), t1_voxels);
        assert!(region_voxels > t1_voxels);
    }
}

#[test]
fn sample_written_as_files_measures_like_the_embedded_one() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("sample");
    let written = run(PROGRAM, &["sample", "--out", out.to_str().unwrap()]);
    assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
    let embedded = json(&["measure", "--sample", "--json"]);
    let from_files = json(&["measure", out.to_str().unwrap(), "--json"]);
    assert_eq!(embedded["time_points"], from_files["time_points"]);
}

#[test]
fn invalid_input_gives_one_error_line_and_exit_code_2() {
    assert_refused(&["measure", "/nowhere/at/all"], &["/nowhere/at/all", "found", "expected"]);
    assert_refused(&["measure"], &["found no case", "--sample"]);
    assert_refused(&["measure", "--sample", "--case-grid", "X"], &["X"]);
    assert_refused(&["render", "--view", "nosuch", "--out", "x.png"], &["--view", "nosuch", "closeup"]);
    assert_refused(&["render", "--size", "0x0", "--out", "x.png"], &["--size", "0x0"]);
    assert_refused(&["render", "--lens", "1,2,3,-4", "--out", "x.png"], &["--lens"]);
    assert_refused(&["render", "--select", "T9", "--out", "x.png"], &["--select", "T9", "T1, T2, PET"]);
    assert_refused(&["render", "--time", "1999", "--out", "x.png"], &["--time", "2024-01-15"]);
    assert_refused(&["info", "Cargo.toml.nii"], &["Cargo.toml.nii", "found", "expected"]);
}

/// Whatever name an output has, no file of the case is overwritten, and none is even when a link leads there.
#[test]
fn labels_that_are_no_numbers_are_told_from_a_file_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.nii.gz");
    write_cube(&path, 4, 1.0, |[i, ..]| u8::from(i < 2));
    let argument = |end: &str| format!("A={}{end}", path.display());
    assert_refused(&["measure", "--mask", &argument(":tumour")], &["--mask", "\"tumour\"", "whole numbers"]);
    assert_refused(&["measure", "--mask", &argument(":1,x@now")], &["\"1,x\"", "whole numbers"]);
    // A file of that name is that file.
    let odd = folder.path().join("m.nii.gz:x");
    std::fs::copy(&path, &odd).unwrap();
    let text = json(&["measure", "--json", "--mask", &format!("A={}", odd.display())]);
    assert_eq!(text["time_points"][0]["masks"][0]["voxels"], 32);
}

#[cfg(target_os = "linux")]
#[test]
fn a_help_that_can_not_be_written_is_an_error() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = std::process::Command::new(PROGRAM).arg("--help").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).starts_with("glioscope: stdout: found"));
}

#[test]
fn outputs_never_overwrite_the_case() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    let written = run(PROGRAM, &["sample", "--out", case.to_str().unwrap()]);
    assert!(written.status.success());
    let mut inputs = Vec::new();
    files_below(&case, &mut inputs);
    assert!(inputs.len() > 5, "{inputs:?}");
    let content = || inputs.iter().map(|file| std::fs::read(file).unwrap()).collect::<Vec<_>>();
    let before = content();
    let path = case.to_str().unwrap();
    let refused = ["the case was read from", "another name"];
    let masks: Vec<String> = ["2024-01-15", "2024-04-15"]
        .iter()
        .map(|time| {
            let named = |file: &&PathBuf| file.to_string_lossy().contains(time);
            let file = inputs.iter().find(named).unwrap();
            format!("A={}@{time}", file.display())
        })
        .collect();
    for input in &inputs {
        let input = input.to_str().unwrap();
        let is_image = input.ends_with(".nii.gz");
        if is_image || input.ends_with("case.toml") {
            assert_refused(&["change", path, "--csv", input], &refused);
            assert_refused(&["render", path, "--out", input, "--software"], &refused);
        }
    }
    let given = masks[0].split(['=', '@']).nth(1).unwrap();
    assert_refused(&["change", "--mask", &masks[0], "--mask", &masks[1], "--csv", given], &refused);
    #[cfg(unix)]
    {
        let link = folder.path().join("out.csv");
        std::os::unix::fs::symlink(&inputs[0], &link).unwrap();
        assert_refused(&["change", path, "--csv", link.to_str().unwrap()], &refused);
        // A link to nowhere is no place for an output.
        let nowhere = folder.path().join("nowhere.csv");
        std::os::unix::fs::symlink(folder.path().join("gone"), &nowhere).unwrap();
        let to_nowhere = ["change", path, "--of", "T1", "--csv", nowhere.to_str().unwrap()];
        assert_refused(&to_nowhere, &["a link to nowhere"]);
        assert!(nowhere.is_symlink());
    }
    assert_eq!(content(), before);
    // Nor the session that names the case.
    let session = folder.path().join("visit.glioscope.json");
    let mut work = workstation(CaseRef::Path(case));
    assert!(work.save(session.clone()));
    let saved = std::fs::read(&session).unwrap();
    let name = session.to_str().unwrap();
    for arguments in
        [&["change", name, "--of", "T1", "--csv", name][..], &["render", name, "--out", name, "--software"]]
    {
        let output = run(PROGRAM, arguments);
        // Before the error stands a warning: this session was saved without marks of its files.
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(refused.iter().all(|words| stderr.contains(words)), "{stderr}");
    }
    assert_eq!(std::fs::read(&session).unwrap(), saved);
}

/// Slices of every size that a picture may have: egui's limit for textures without a device is 2048 pixels.
#[test]
fn slices_wider_than_2048_pixels_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("axial.png");
    let out = path.to_str().unwrap();
    let drawn = run(PROGRAM, &["render", "--software", "--view", "axial", "--size", "2600x64", "--out", out]);
    assert!(drawn.status.success(), "{}", String::from_utf8_lossy(&drawn.stderr));
    assert_eq!(image::open(&path).unwrap().to_rgba8().dimensions(), (2600, 64));
}

#[test]
fn explain_gives_reasons_without_rendering() {
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
fn malformed_files_give_exit_code_2() {
    let Some(folder) = real_data("nifti-malformed") else { return };
    let mut files = Vec::new();
    files_below(&folder, &mut files);
    assert!(files.len() >= 15, "{files:?}");
    for file in files {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let path = file.to_str().unwrap();
        assert_refused(&["info", path], &["found", "expected"]);
        assert_refused(&["measure", "--mask", &format!("A={path}")], &[&name, "found", "expected"]);
    }
}

#[test]
fn glioma_case_matches_numpy_counts() {
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
fn ellipsoids_json_has_the_documented_keys_and_consistent_volumes() {
    let report = json(&["ellipsoids", "--sample", "--json"]);
    let measured = json(&["measure", "--sample", "--json"]);
    assert_eq!(report["warnings"], measured["warnings"]);
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
    assert_refused(&["ellipsoids", "--sample", "--connectivity", "7"], &["7", "26"]);
}

#[test]
fn change_json_has_the_documented_keys_and_unknown_dates_are_named() {
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
    let counted = |direction: &str| report[direction]["count"].as_u64().unwrap();
    assert_eq!(counted("growth") + counted("recession"), report["vectors"].as_u64().unwrap());
    let lines = std::fs::read_to_string(&csv).unwrap().lines().count() as u64;
    assert!(lines > report["vectors"].as_u64().unwrap(), "a header and one line per vector: {lines}");
    // Kept, gone and new volumes add up to the volumes of the masks.
    let measured = json(&["measure", "--sample", "--json"]);
    let ml = |time: usize| measured["time_points"][time]["masks"][0]["volume_ml"].as_f64().unwrap();
    assert!(!measured["warnings"].as_array().unwrap().is_empty());
    assert_eq!(report["warnings"], measured["warnings"]);
    let of = |key: &str| report[key].as_f64().unwrap();
    assert!((of("kept_ml") + of("gone_ml") - ml(0)).abs() < 1e-9);
    assert!((of("kept_ml") + of("new_ml") - ml(1)).abs() < 1e-9);
    assert_refused(
        &["change", "--sample", "--of", "T1", "--to", "2031-01-01"],
        &["2031-01-01", "2024-04-15"],
    );
    assert_refused(&["change", "--sample", "--of", "T9"], &["T9"]);
    // Without --of, the first mask present on both dates is used and reported.
    let output = run(PROGRAM, &["change", "--sample", "--json"]);
    let assumed: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(assumed["mask"], "T1");
    assert!(String::from_utf8_lossy(&output.stderr).contains("the first of T1, T2, PET"));
}

/// Three dates: `change` and `render` compare the first with the last, and both report it.
#[test]
fn change_and_render_compare_the_same_dates() {
    let folder = tempfile::tempdir().unwrap();
    glioscope_core::sample::write_sample(folder.path()).unwrap();
    let manifest = folder.path().join("case.toml");
    let mut text = std::fs::read_to_string(&manifest).unwrap();
    text.push_str("\n[[mask]]\nid = \"T1\"\nfile = \"t1-mask-2024-01-15.nii.gz\"\ntime = \"2024-09-01\"\n");
    std::fs::write(&manifest, text).unwrap();
    let case = manifest.to_str().unwrap();
    let picture = folder.path().join("change.png");
    let expected_note = "the dates are 2024-01-15 and 2024-09-01 of 2024-01-15, 2024-04-15, 2024-09-01";
    let change = run(PROGRAM, &["change", case, "--json"]);
    let render = ["render", case, "--software", "--size", "64x64", "--view", "change", "--out"];
    let render = run(PROGRAM, &[&render[..], &[picture.to_str().unwrap()]].concat());
    for output in [&change, &render] {
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && stderr.contains(expected_note), "{stderr}");
    }
    let report: Value = serde_json::from_slice(&change.stdout).unwrap();
    assert_eq!((&report["from"], &report["to"]), (&"2024-01-15".into(), &"2024-09-01".into()));
    let explicit =
        run(PROGRAM, &["change", case, "--of", "T1", "--from", "2024-01-15", "--to", "2024-09-01"]);
    assert!(explicit.stderr.is_empty(), "explicitly chosen dates aren't reported");
}

#[test]
fn invalid_view_options_are_refused() {
    let render = |more: &[&str], words: &[&str]| {
        let all = [&["render", "--sample", "--out", "/dev/null/never.png"], more].concat();
        assert_refused(&all, words);
    };
    render(&["--transfer", "mr"], &["mr-tissue", "ct-soft", "pet-hot"]);
    render(&["--clip", "sideways=3"], &["sideways=3", "right"]);
    render(&["--style", "dots"], &["dots", "height"]);
    render(&["--from", "2024-04-15", "--to", "2024-01-15"], &["earlier"]);
    render(&["--of", "T9"], &["T9", "T1"]);
    render(&["--zoom", "0"], &["zoom"]);
    render(&["--view", "sideways"], &["sideways", "ellipsoids"]);
}

/// A folder with a mask of 1 mm by its sform and 2 mm by its pixdim, and of an id with an escape sequence and `+`.
fn stale_mask(folder: &Path) -> String {
    let mut bytes = vec![0_u8; 352];
    let mut put = |at: usize, part: &[u8]| bytes[at..at + part.len()].copy_from_slice(part);
    put(0, &348_i32.to_le_bytes());
    for (n, d) in [3_i16, 4, 4, 4, 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * n, &d.to_le_bytes());
        put(76 + 4 * n, &2_f32.to_le_bytes());
    }
    put(70, &[2, 0, 8, 0]);
    put(108, &352_f32.to_le_bytes());
    put(112, &1_f32.to_le_bytes());
    put(123, &[2]);
    put(254, &[1]);
    for at in [280, 300, 320] {
        put(at, &1_f32.to_le_bytes());
    }
    put(344, b"n+1\0");
    bytes.extend((0..64).map(|at| u8::from(at < 20)));
    let path = folder.join("stale.nii");
    glioscope_core::files::write_whole(&path, &bytes).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Every subcommand that reads a file or a case.
#[test]
fn warnings_reach_stderr_in_every_subcommand() {
    let folder = tempfile::tempdir().unwrap();
    let path = stale_mask(folder.path());
    let mask = format!("A={path}");
    let (before, after) = (format!("{mask}@2024-01-01"), format!("{mask}@2024-02-01"));
    let picture = folder.path().join("x.png");
    let report = folder.path().join("report");
    for arguments in [
        &["info", path.as_str()][..],
        &["info", path.as_str(), "--json"],
        &["info", path.as_str(), "--cross-check", "--json"],
        &["measure", "--mask", &mask],
        &["measure", "--mask", &mask, "--json"],
        &["measure", &path],
        &["ellipsoids", "--mask", &mask, "--json"],
        &["change", "--mask", &before, "--mask", &after, "--json"],
        &["render", "--mask", &mask, "--software", "--size", "32x32", "--out", picture.to_str().unwrap()],
        &["report", "--mask", &mask, "--software", "--out", report.to_str().unwrap()],
    ] {
        let output = run(PROGRAM, arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {stderr}");
        let told = stderr.lines().filter(|line| line.contains("warning [pixdim-sform-disagree]")).count();
        assert_eq!(told, 1, "{arguments:?}: {stderr}");
    }
}

/// Names come from files and folders of others: what they hold must not be obeyed by a terminal.
#[test]
fn escape_sequences_in_names_reach_no_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let path = stale_mask(folder.path());
    let odd = "T1+C\u{1b}]0;owned\u{7}\u{9b}31m\u{202e}";
    let mask = format!("{odd}={path}");
    for arguments in [
        &["measure", "--mask", &mask][..],
        &["measure", "--mask", &mask, "--json"],
        &["info", "--mask", &mask],
        &["info", "--mask", &mask, "--json"],
        &["measure", "--mask", &mask, "--case-grid", odd],
        &["measure", "--mask", &mask, "--case-grid", "\u{1b}[2J"],
        &["measure", odd],
    ] {
        let output = run(PROGRAM, arguments);
        for bytes in [&output.stdout, &output.stderr] {
            let text = String::from_utf8_lossy(bytes);
            assert!(!text.contains(['\u{1b}', '\u{7}', '\u{9b}', '\u{202e}']), "{arguments:?}: {text:?}");
        }
        if arguments.contains(&"--json") {
            let report: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert!(report.to_string().contains("owned"), "{report}");
        }
    }
}

/// Also where its parts are ids of masks.
#[test]
fn an_id_with_a_plus_sign_is_selected_like_any_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = stale_mask(folder.path());
    let tck = folder.path().join("a.tck");
    let mut bytes = b"mrtrix tracks\ndatatype: Float32LE\nfile: . 60\nEND\n".to_vec();
    bytes.resize(60, b' ');
    for v in [1.0_f32, 1.0, 1.0].into_iter().chain([f32::NAN; 3]).chain([f32::INFINITY; 3]) {
        bytes.extend(v.to_le_bytes());
    }
    glioscope_core::files::write_whole(&tck, &bytes).unwrap();
    let (plain, plus) = (format!("T1={path}:0"), format!("T1+C={path}"));
    let tracts = ["tracts", "--mask", &plain, "--mask", &plus, "--tracts", tck.to_str().unwrap(), "--json"];
    let report = json(&[&tracts[..], &["--select", "T1+C"]].concat());
    assert_eq!(report["selected_voxels"], 20);
    assert_eq!(report["selected"], serde_json::json!(["T1+C"]));
    let of = json(&["measure", "--mask", &plain, "--mask", &plus, "--case-grid", "T1+C", "--json"]);
    assert_eq!(of["time_points"][0]["masks"][1]["id"], "T1+C");
    let unknown = run(PROGRAM, &[&tracts[..], &["--select", "T1+X"]].concat());
    let stderr = String::from_utf8_lossy(&unknown.stderr);
    assert!(!unknown.status.success() && stderr.contains("--select: found \"X\""), "{stderr}");
}

#[test]
fn values_of_images_in_masks_are_measured_where_asked_for() {
    let plain = json(&["measure", "--sample", "--json"]);
    assert!(plain["time_points"][0]["statistics"].is_null());
    let report = json(&["measure", "--sample", "--statistics", "--json"]);
    for time in report["time_points"].as_array().unwrap() {
        let all = time["statistics"].as_array().unwrap();
        assert_eq!(all.len(), 9, "three masks in three images");
        for of in all {
            let number = |key: &str| of[key].as_f64().unwrap();
            let ordered = ["min", "p05", "p50", "p95", "max"].map(number);
            assert!(ordered.is_sorted(), "{of}");
            assert!((ordered[0]..=ordered[4]).contains(&number("mean")) && number("sd") > 0.0, "{of}");
        }
        let of = |mask: &str, image: &str| {
            let found = all.iter().find(|of| of["mask"] == mask && of["image"] == image).unwrap();
            (found["mean"].as_f64().unwrap(), found["peak"].as_f64().unwrap(), found["max"].as_f64().unwrap())
        };
        // The phantom's uptake is highest in the PET mask, and the peak lies between mean and most.
        let (mean, peak, most) = of("PET", "PET");
        assert!(mean > of("T2", "PET").0 && peak > mean && peak <= most, "{mean} {peak} {most}");
    }
    let output = run(PROGRAM, &["measure", "--sample", "--statistics"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        text.contains("values of images in masks at 2024-04-15") && text.contains("peak (1 ml)"),
        "{text}"
    );
}

#[test]
fn any_two_masks_or_regions_of_any_dates_are_compared() {
    let sample = ["measure", "--sample", "--metrics", "--json"];
    let plain = json(&sample);
    let labels: Vec<&str> =
        plain["time_points"].as_array().unwrap().iter().map(|t| t["time"].as_str().unwrap()).collect();
    let (a, b) = (format!("T1@{}", labels[0]), format!("T2@{}", labels[0]));
    let region = format!("=T1+PET@{}", labels[1]);
    let with = json(&[&sample[..], &["--two", &a, &b, "--two", &region, &region]].concat());
    let two = with["two"].as_array().unwrap();
    // Two masks of one date are the pair of its table; a region agrees with itself.
    let mut pair = plain["time_points"][0]["pairs"][0].clone();
    (pair["a"], pair["b"]) = (a.clone().into(), b.into());
    assert_eq!(two[0], pair);
    assert_eq!((&two[1]["dice"], &two[1]["hd_mm"]), (&1.0.into(), &0.0.into()));
    let refused = |two: [&str; 2], word: &str| {
        assert_refused(&[&sample[..], &["--two"], &two].concat(), &["--two", word, "expected"]);
    };
    refused(["T1", &a], "without a date");
    refused(["no such@never", &a], "\"never\"");
    assert_refused(&["measure", "--sample", "--two", &a, &a], &["--metrics"]);
}
