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
