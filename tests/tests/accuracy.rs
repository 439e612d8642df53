//! `glioscope accuracy` as a process, on the kernels that take no time.

#![allow(clippy::unwrap_used, reason = "in a test a failed unwrap is a failed test")]

use glioscope_tests::run;
use serde_json::Value;

const PROGRAM: &str = env!("CARGO_BIN_EXE_glioscope-under-test");

#[test]
fn numbers_plots_and_page_are_written_whole() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new/folder");
    let out_name = out.to_str().unwrap();
    let arguments =
        ["accuracy", "--quick", "--software", "--json", "--only", "half,ellipsoids", "--out", out_name];
    let output = run(PROGRAM, &arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let curves = answer["curves"].as_array().unwrap();
    let families: Vec<&str> = curves.iter().map(|c| c["family"].as_str().unwrap()).collect();
    assert!(families.contains(&"half") && families.contains(&"ellipsoids"), "{families:?}");
    let points: usize = curves.iter().map(|c| c["points"].as_array().unwrap().len()).sum();
    let csv = std::fs::read_to_string(out.join("accuracy.csv")).unwrap();
    assert_eq!(csv.lines().count(), points + 1);
    let page = std::fs::read_to_string(out.join("accuracy.md")).unwrap();
    // A certificate: no volume exceeds the minimum by more than was asked.
    for curve in curves.iter().filter(|c| c["family"] == "ellipsoids") {
        let defaults: Vec<&Value> =
            curve["points"].as_array().unwrap().iter().filter(|p| p["is_default"] == true).collect();
        assert_eq!(defaults.len(), usize::from(curve["kernel"] == "exchange"));
        for point in curve["points"].as_array().unwrap() {
            let (error, asked) = (point["error_max"].as_f64().unwrap(), point["value"].as_f64().unwrap());
            assert!(error <= asked * 1.000_001 + 1e-11, "{point}");
            assert!(point["time"]["median_ms"].as_f64().unwrap() > 0.0);
        }
    }
    for name in ["accuracy-ellipsoids", "accuracy-half"] {
        assert!(page.contains(&format!("images/{name}.png")), "{name}");
        for ending in ["svg", "png"] {
            assert!(out.join("images").join(format!("{name}.{ending}")).metadata().unwrap().len() > 1000);
        }
    }
    let names: Vec<_> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 3, "nothing half written: {names:?}");
}

#[test]
fn a_kernel_that_is_none_is_refused() {
    let output = run(PROGRAM, &["accuracy", "--only", "halves"]);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        output.stdout.is_empty() && stderr.contains("halves") && stderr.contains("ellipsoids"),
        "{stderr}"
    );
}
