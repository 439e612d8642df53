//! Registration transforms of other programs on the command line.

use std::path::{Path, PathBuf};

use glioscope_core::{
    Grid, Progress, Volume,
    files::{self, ReadOptions, Source, WriteOptions, write_whole},
    glam::{DAffine3, DMat3, DVec3},
};
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
    assert!(
        refusal(&[tfm, "--out", bare])
            .contains("a.mat: found .mat, which may be several formats, expected --out")
    );
    let as_bare = ["--out", bare, "--out-convention", "ras-moving-from-fixed"];
    let report = described(&[&[tfm][..], &as_bare].concat());
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
    assert!(refusal(&[tfm, "--out", tfm, "--force"]).contains("a file that the case was read from"));
    assert!(refusal(&[&[tfm][..], &as_bare].concat()).contains("--force"));

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
    // Every format that is written says the same when it is read.
    let (ras, both) = (["--convention", "ras-moving-from-fixed"], ["--fixed", image, "--moving", image]);
    for (name, as_what, what) in [
        ("new.h5", None, &[][..]),
        ("new.lta", None, &[]),
        ("new.dat", None, &both),
        ("itk.mat", Some("itk"), &[]),
        ("fsl.mat", Some("flirt"), &["--convention", "flirt", "--fixed", image, "--moving", image]),
        ("bare.txt", Some("ras-moving-from-fixed"), &ras),
    ] {
        let new = at(name).display().to_string();
        let mut arguments = vec![tfm, "--out", &new];
        arguments.extend(as_what.iter().flat_map(|word| ["--out-convention", word]));
        if ["new.lta", "new.dat", "fsl.mat"].contains(&name) {
            assert!(refusal(&arguments).contains("without its images, expected the two images"), "{name}");
            assert!(!at(name).exists());
            arguments.extend(both);
        }
        described(&arguments);
        let back = described(&[&[new.as_str()], what].concat())["moving_from_fixed"].clone();
        let numbers = |rows: &Value| -> Vec<f64> {
            let rows = rows.as_array().unwrap().iter();
            rows.flat_map(|row| row.as_array().unwrap()).map(|number| number.as_f64().unwrap()).collect()
        };
        for (found, number) in numbers(&back).into_iter().zip(numbers(&expected)) {
            assert!((found - number).abs() < 1e-12, "{name}: {back}");
        }
    }
    let other = at("new.xyz").display().to_string();
    assert!(refusal(&[tfm, "--out", &other]).contains("found another ending, expected .tfm"));
    let lta = at("other.lta").display().to_string();
    assert!(
        refusal(&[tfm, "--out", &lta, "--out-convention", "itk"]).contains("--out-convention: found .lta")
    );
    let composite = concat!(env!("CARGO_MANIFEST_DIR"), "/../core/src/transform/fixtures/composite.h5");
    assert_eq!(described(&[composite])["format"], "ITK HDF5");
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
    let manifest = "glioscope = 1\n[[mask]]\nid = \"m\"\nfile = \"a.nii\"\ntime = 2024-01-01\n[[mask]]\nid = \"m\"\nfile = \"b.nii\"\n\
         time = 2024-03-01\n[[transform]]\ntime = 2024-03-01\nfile = \"back.tfm\"\n";
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

/// Where the later scan of the sample lies in [`follow_up`]: turned by 6° about an oblique axis through the head, shifted
/// by 8 mm. Maps the first date's space to the later files' space.
fn elsewhere() -> DAffine3 {
    let turn = DMat3::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 6_f64.to_radians());
    DAffine3::from_mat3_translation(turn, DVec3::new(5.0, -4.0, 4.8))
}

/// The sample with the later date's files put [`elsewhere`]: their voxels are the same, so nothing is resampled.
fn follow_up(folder: &Path) -> PathBuf {
    let case = folder.join("sample");
    assert!(run(PROGRAM, &["sample", "--out", case.to_str().unwrap()]).status.success());
    for name in ["t1c", "flair", "pet", "t1-mask", "t2-mask", "pet-mask"] {
        let path = case.join(format!("{name}-2024-04-15.nii.gz"));
        let loaded =
            files::read(&Source::File(path.clone()), &ReadOptions::default(), &Progress::new()).unwrap();
        let own = loaded.volume;
        let grid = own.grid();
        let moved = Grid::new(grid.dims(), elsewhere() * grid.world_from_voxel(), grid.sides()).unwrap();
        let volume = Volume::new(moved, own.samples().clone(), own.scaling()).unwrap();
        files::write_nifti(&path, &volume, &WriteOptions::default()).unwrap();
    }
    case
}

#[test]
fn a_follow_up_that_lies_elsewhere_has_no_growth_until_it_is_registered() {
    let folder = tempfile::tempdir().unwrap();
    let case = follow_up(folder.path());
    let case = case.to_str().unwrap();
    let change = |arguments: &[&str]| {
        let output = run(PROGRAM, &[&["change", "--of", "T1", "--json"], arguments].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let truth = change(&["--sample"]);
    let before = change(&[case]);
    assert_eq!(before["flags"], serde_json::json!(["not-aligned"]));
    assert_eq!((&before["kept_ml"], &before["vectors"]), (&Value::Null, &0.into()));
    let warning = &before["warnings"][0];
    assert_eq!(warning["code"], "not-aligned");
    assert!(warning["message"].as_str().unwrap().contains(" mm apart at the tumour, by their images T1c"));

    let after = change(&[case, "--register"]);
    let aligned = after["aligned"].as_array().unwrap();
    assert_eq!(aligned.len(), 6, "images and masks of the later date");
    let consistency_mm = aligned[0]["consistency_mm"].as_f64().unwrap();
    assert!(consistency_mm > 0.0 && consistency_mm < 2.0, "{consistency_mm}");
    assert_eq!(after["uncertainty_mm"]["registration_from"], "consistency");
    for key in ["growth", "recession"] {
        for number in ["p50_mm", "p95_mm", "max_mm"] {
            let [found, expected] = [&after, &truth].map(|report| report[key][number].as_f64().unwrap());
            // Resampled by nearest voxel, whose edge is 1.5 mm, besides.
            assert!((found - expected).abs() < consistency_mm + 0.5, "{key} {number}: {found} {expected}");
        }
    }
    let [found, expected] = [&after, &truth].map(|report| report["to_ml"].as_f64().unwrap());
    assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
    // A stated error takes precedence.
    assert_eq!(after["aligned"][0]["loop_mm"], Value::Null, "nobody asked");
    let stated = change(&[case, "--register", "--loops", "--registration-mm", "0.7"]);
    // There by T1c, back by FLAIR: all images of a date of the sample lie in one space.
    let loop_mm = stated["aligned"][0]["loop_mm"].as_f64().unwrap();
    assert!(loop_mm > 0.0 && loop_mm < 0.75, "half a voxel across sequences: {loop_mm}");
    let alone = run(PROGRAM, &["change", "--of", "T1", case, "--loops"]);
    assert_eq!(alone.status.code(), Some(2));
    let of = &stated["uncertainty_mm"];
    assert_eq!((&of["registration_from"], &of["registration_mm"]), (&"stated".into(), &0.7.into()));
}

#[test]
fn two_images_are_registered_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let case = follow_up(folder.path());
    let file = |name: &str| case.join(name).display().to_string();
    let (fixed, moving) = (file("t1c-2024-01-15.nii.gz"), file("flair-2024-04-15.nii.gz"));
    let lesions = [file("t1-mask-2024-01-15.nii.gz"), file("t2-mask-2024-04-15.nii.gz")];
    let out = folder.path().join("found.tfm");
    let out = out.to_str().unwrap();
    let arguments = ["register", "--fixed", &fixed, "--moving", &moving, "--lesions", &lesions[0]];
    let more = ["--moving-lesions", &lesions[1], "--out", out, "--json"];
    let output = run(PROGRAM, &[&arguments[..], &more[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["model"], &report["converged"]), (&"rigid".into(), &true.into()));
    let number = |row: usize, column: usize| report["moving_from_fixed"][row][column].as_f64().unwrap();
    let column = |n: usize| DVec3::new(number(0, n), number(1, n), number(2, n));
    let found = DAffine3::from_cols(column(0), column(1), column(2), column(3));
    // At the tumour of the sample: its lens' centre.
    let at = DVec3::new(-30.4, 17.8, 20.7);
    let off_mm = found.transform_point3(at).distance(elsewhere().transform_point3(at));
    assert!(off_mm < 0.75, "half a voxel across sequences: {off_mm} mm");
    for key in ["median", "p95", "max", "floor", "how"] {
        assert!(!report["consistency_mm"][key].is_null(), "{key}");
    }
    // The file that it writes says the same.
    assert_eq!(described(&[out])["moving_from_fixed"][0][0], report["moving_from_fixed"][0][0]);
    // Without the consistency the same transform, and nothing that says how well it fits.
    let output = run(PROGRAM, &[&arguments[..], &more[..2], &["--no-consistency", "--json"]].concat());
    let alone: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(alone["moving_from_fixed"], report["moving_from_fixed"]);
    assert!(alone["consistency_mm"].is_null() && alone["loop_mm"].is_null(), "{alone}");

    let refusal = |arguments: &[&str]| {
        let output = run(PROGRAM, &[&["register"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(
        refusal(&["--fixed", &fixed, "--moving", &moving, "--out", &fixed]).contains("expected .tfm, .txt")
    );
    let line = refusal(&["--fixed", &fixed, "--moving", &lesions[0], "--out", out]);
    assert!(line.trim_end().lines().count() == 1, "{line}");
}
