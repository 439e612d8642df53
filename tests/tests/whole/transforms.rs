//! Registration transforms of other programs on the command line.

use glioscope_core::files::write_whole;
use glioscope_tests::{run, write_cube};
use serde_json::Value;

use crate::PROGRAM;

fn described(arguments: &[&str]) -> Value {
    let output = run(PROGRAM, &[&["transform", "--json"], arguments].concat());
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn refusal(arguments: &[&str]) -> String {
    let output = run(PROGRAM, &[&["transform"], arguments].concat());
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    let line = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(line.lines().count(), 1, "{line}");
    line
}

/// A quarter turn about the z axis and a shift: in LPS x to y, so in RAS, where both axes point the other way, likewise.
#[test]
fn a_transform_of_itk_is_described_and_converted() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n\
                Parameters: 0 -1 0 1 0 0 0 0 1 10 20 30\nFixedParameters: 0 0 0\n";
    write_whole(&at("a.tfm"), text.as_bytes()).unwrap();
    let (tfm, bare) = (at("a.tfm"), at("a.mat"));
    let (tfm, bare) = (tfm.to_str().unwrap(), bare.to_str().unwrap());
    let report = described(&[tfm, "--out", bare]);
    let expected = serde_json::json!([
        [0.0, -1.0, 0.0, -10.0],
        [1.0, 0.0, 0.0, -20.0],
        [0.0, 0.0, 1.0, 30.0],
        [0.0, 0.0, 0.0, 1.0]
    ]);
    assert_eq!(report["moving_from_fixed"], expected);
    assert!((report["turn_deg"].as_f64().unwrap() - 90.0).abs() < 1e-9);
    assert!((report["volume_ratio"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    // A bare matrix says nothing of what it means.
    assert!(refusal(&[bare]).contains("niftyreg"));
    let same = described(&[bare, "--convention", "ras-moving-from-fixed"]);
    assert_eq!(same["moving_from_fixed"], expected);
    let inverse = described(&[bare, "--convention", "ras-fixed-from-moving"]);
    assert_eq!(inverse["fixed_from_moving"], expected);
    assert!(refusal(&[tfm, "--convention", "greedy"]).contains("--convention: found ITK text"));
    assert!(refusal(&[tfm, "--out", tfm]).contains("expected another file"));

    // FLIRT's matrices depend on both images: of images alike and isotropic, the identity is the identity.
    write_cube(&at("i.nii.gz"), 8, 1.0, |_| 1);
    let identity = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    write_whole(&at("flirt.mat"), identity.as_bytes()).unwrap();
    let (flirt, image) = (at("flirt.mat"), at("i.nii.gz"));
    let (flirt, image) = (flirt.to_str().unwrap(), image.to_str().unwrap());
    assert!(refusal(&[flirt, "--convention", "flirt"]).contains("without its images"));
    let report = described(&[flirt, "--convention", "flirt", "--fixed", image, "--moving", image]);
    assert_eq!(report["turn_deg"], 0.0);
    write_whole(&at("field.h5"), b"\x89HDF\r\n\x1a\n and more").unwrap();
    assert!(refusal(&[at("field.h5").to_str().unwrap()]).contains(".tfm"));
}

/// A body that lies 2 mm farther right at the later date, because the patient did.
#[test]
fn a_transform_brings_a_date_into_the_space_of_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (name, first) in [("a.nii", 2), ("b.nii", 4)] {
        let inside = move |[x, y, z]: [usize; 3]| {
            (first..first + 4).contains(&x) && (3..7).contains(&y) && (3..6).contains(&z)
        };
        write_cube(&at(name), 10, 1.0, |voxel| u8::from(inside(voxel)));
    }
    let text = "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n\
               Parameters: 1 0 0 0 1 0 0 0 1 -2 0 0\nFixedParameters: 0 0 0\n";
    write_whole(&at("back.tfm"), text.as_bytes()).unwrap();
    let mask = |file: &str, time: &str| format!("m={}@{time}", at(file).display());
    let [a, b] = [mask("a.nii", "2024-01-01"), mask("b.nii", "2024-03-01")];
    let transform = format!("@2024-03-01={}", at("back.tfm").display());
    let change = |more: &[&str]| {
        let output = run(PROGRAM, &[&["change", "--json", "--mask", &a, "--mask", &b], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let apart = change(&[]);
    assert!(apart["growth"]["count"].as_u64().unwrap() > 0 && apart["aligned"] == serde_json::json!([]));
    let together = change(&["--transform", &transform]);
    assert_eq!(together["flags"], serde_json::json!(["no-change"]));
    assert_eq!(together["kept_ml"], together["from_ml"]);
    let moved = &together["aligned"][0];
    assert_eq!(
        (&moved["id"], &moved["time"], &moved["is_mask"]),
        (&"m".into(), &"2024-03-01".into(), &true.into())
    );
    assert_eq!(moved["by"], serde_json::json!(["back.tfm"]));
    assert_eq!(moved["case_from_own"][0], serde_json::json!([1.0, 0.0, 0.0, -2.0]));
    let codes = together["warnings"].as_array().unwrap().iter().map(|w| w["code"].as_str().unwrap());
    assert!(codes.collect::<Vec<_>>().contains(&"aligned"));

    // The same from a manifest, and a target that the case lacks.
    let manifest = format!(
        "glioscope = 1\n[[mask]]\nid = \"m\"\nfile = \"a.nii\"\ntime = 2024-01-01\n[[mask]]\nid = \"m\"\nfile = \"b.nii\"\n\
         time = 2024-03-01\n[[transform]]\ntime = 2024-03-01\nfile = \"back.tfm\"\n"
    );
    write_whole(&at("case.toml"), manifest.as_bytes()).unwrap();
    let case = at("case.toml");
    let output = run(PROGRAM, &["change", "--json", case.to_str().unwrap()]);
    let of_manifest: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(of_manifest["aligned"], together["aligned"]);
    for (argument, expected) in [
        (format!("PET={}", at("back.tfm").display()), "a transform of PET, which the case lacks"),
        ("back.tfm".to_owned(), "expected ID[@TIME]=FILE"),
        (format!("m={}", at("none.tfm").display()), "none.tfm"),
    ] {
        let output = run(PROGRAM, &["change", "--mask", &a, "--mask", &b, "--transform", &argument]);
        assert_eq!(output.status.code(), Some(2), "{argument}");
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(line.contains(expected) && line.trim_end().lines().count() == 1, "{line}");
    }
    // An output never replaces it.
    let tfm = at("back.tfm");
    let csv =
        ["change", "--mask", &a, "--mask", &b, "--transform", &transform, "--csv", tfm.to_str().unwrap()];
    assert_eq!(run(PROGRAM, &csv).status.code(), Some(2));
    assert_eq!(std::fs::read(&tfm).unwrap(), text.as_bytes());
}
