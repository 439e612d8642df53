//! The peer scripts on tiny inputs run to completion and agree with this program.

#![allow(clippy::unwrap_used, reason = "in a test a failed unwrap is a failed test")]

use std::{path::Path, process::Command};

use glam::DVec3;
use glioscope_core::{
    Grid, Progress, Samples, Scaling, Volume,
    case::{CaseSpec, LoadOptions, load},
    files::{WriteOptions, write_nifti, write_whole},
};
use serde_json::Value;

const BENCH: &str = env!("CARGO_BIN_EXE_glioscope-bench");

/// Output of a script, run by the Python with the peer packages, which `./x test` installs; `None`, with a line on
/// stdout, without one.
#[allow(clippy::print_stdout, reason = "a skipped test must be reported")]
fn run_script(script: &str, arguments: &[&str]) -> Option<String> {
    let Some(python) = std::env::var_os("GLIOSCOPE_PEERS_PYTHON").filter(|p| !p.is_empty()) else {
        println!("SKIPPED: bench/{script}: GLIOSCOPE_PEERS_PYTHON names no Python with the peer packages");
        return None;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join(script);
    let output = Command::new(python).arg(&script).args(arguments).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {stderr}", script.display());
    Some(String::from_utf8(output.stdout).unwrap())
}

/// Writes a ball of label 4 in 24³ voxels as a file and returns its name.
fn write_ball(folder: &Path, name: &str, radius_mm: f64) -> String {
    let grid = Grid::axis_aligned([24; 3], DVec3::new(1.0, 1.0, 1.5), DVec3::ZERO).unwrap();
    let center_mm = grid.center_mm();
    let is_inside = |l| grid.center_of_voxel_mm(grid.ijk(l)).distance(center_mm) <= radius_mm;
    let values = (0..grid.voxel_count()).map(|l| if is_inside(l) { 4 } else { 0 }).collect();
    let path = folder.join(name);
    let volume = Volume::new(grid, Samples::U8(values), Scaling::NONE).unwrap();
    write_nifti(&path, &volume, &WriteOptions::default()).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn components_match_cc3d_and_scipy() {
    let Some(table) = run_script("peer_components.py", &[BENCH, "--cases", "tiny", "--runs", "1"]) else {
        return;
    };
    // The script fails unless all give the same partition.
    assert!(table.contains("cc3d and SciPy give the same partition"), "{table}");
    for program in ["cc3d", "SciPy", "glioscope, 1 thread", "glioscope with a label volume, 2 threads"] {
        assert!(table.lines().any(|l| l.starts_with(&format!("| {program}"))), "{program}: {table}");
    }
}

#[test]
fn distances_match_edt_and_scipy() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] =
        [("a.nii", 8.0), ("b.nii", 9.0)].map(|(name, radius)| write_ball(folder.path(), name, radius));
    let arguments = [BENCH, &a, &b, "4", "--threads=1", "--reps=1", "--ball=32"];
    let Some(table) = run_script("peer_change.py", &arguments) else { return };
    let rows = |case: &str, peer: &str| -> Vec<String> {
        let begin = format!("distance,{case},{peer},1,");
        table.lines().filter(|l| l.starts_with(&begin)).map(str::to_owned).collect()
    };
    // edt computes in single precision.
    let farthest_mm = |case: &str, peer: &str| -> f64 {
        let row = rows(case, peer).concat();
        row.rsplit(',').next().unwrap().trim_end_matches(" mm farthest").parse().unwrap()
    };
    for case in ["files", "whole", "odd", "ball"] {
        let (edt, scipy) = (farthest_mm(case, "edt"), farthest_mm(case, "SciPy with indices"));
        assert!(edt > 5.0 && (edt / scipy - 1.0).abs() < 1e-6, "{case}: {table}");
        assert_eq!(rows(case, "glioscope sites").len(), 2, "before and after the peers: {table}");
    }
    for peer in ["scikit-image Lee", "kimimaro TEASAR"] {
        assert!(table.contains(&format!("skeleton,files,{peer},")), "{peer}: {table}");
    }
}

#[test]
fn region_counts_match_numpy() {
    let folder = tempfile::tempdir().unwrap();
    let masks = [("a", 8.0), ("b", 9.0)]
        .map(|(id, radius)| format!("{id}={}:4", write_ball(folder.path(), &format!("{id}.nii.gz"), radius)));
    let arguments = ["--json", "--mask", &masks[0], "--mask", &masks[1]];
    let Some(json) = run_script("peer_measure.py", &arguments) else { return };
    let report: Value = serde_json::from_str(&json).unwrap();
    let case =
        load(&CaseSpec::from_arguments(&masks, &[]).unwrap(), &LoadOptions::default(), &Progress::new())
            .unwrap();
    let regions = &case.time_points[0].regions;
    let theirs = report["time_points"][0]["regions"].as_array().unwrap();
    let counts: Vec<u64> = theirs.iter().map(|r| r["voxels"].as_u64().unwrap()).collect();
    assert_eq!(counts, regions.list().iter().map(|r| r.voxels).collect::<Vec<_>>());
    assert!(counts.len() == 2 && counts.iter().all(|n| *n > 500), "{counts:?}");
}

/// The cases, errors and rows of the comparison of registrations, with a script in place of the program: that finds nothing to move
/// in one kind of images, and refuses the other.
#[cfg(unix)]
#[test]
fn registrations_are_judged_by_what_was_put_in() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("glioma-5-algorithms");
    std::fs::create_dir(&data).unwrap();
    for (name, radius_mm) in [("t1c", 10.0), ("fla", 9.0), ("hnfnetv1-20", 6.0)] {
        write_ball(&data, &format!("{name}.nii.gz"), radius_mm);
    }
    let program = folder.path().join("register");
    let text = "#!/bin/sh\ncase \"$*\" in *FLAIR*) exit 2 ;; esac\n\
                echo '{\"moving_from_fixed\": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}'\n";
    write_whole(&program, text.as_bytes()).unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let [program, data] = [&program, folder.path()].map(|path| path.to_str().unwrap());
    let arguments = [program, data, "--cases", "1", "--programs", "glioscope"];
    let Some(table) = run_script("peer_registration.py", &arguments) else { return };
    let row = |kind: &str| -> Vec<String> {
        let begin = format!("| glioscope | T1c on {kind} | 1 |");
        let row = table.lines().find(|line| line.starts_with(&begin)).unwrap();
        row.split('|').map(|cell| cell.trim().to_owned()).collect()
    };
    // Median, 95 %, most: of one case the same; how far the images were moved, which is not nothing.
    let t1c = row("T1c");
    let moved_mm: f64 = t1c[4].parse().unwrap();
    assert!(moved_mm > 2.0 && moved_mm < 45.0, "{table}");
    assert_eq!((&t1c[5], &t1c[6], &t1c[7], &t1c[8]), (&t1c[4], &t1c[4], &"0".to_owned(), &"1".to_owned()));
    let flair = row("FLAIR");
    assert_eq!((flair[4].as_str(), flair[7].as_str(), flair[8].as_str()), ("", "1", "0"), "{table}");
}
