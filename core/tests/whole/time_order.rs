//! Folders whose names or tables state an order of time points.

use std::path::Path;

use glam::DVec3;
use glioscope_core::{
    Grid, Progress, Samples, Scaling, Volume,
    case::{CaseSpec, LoadOptions, load},
    files::{WriteOptions, write_nifti, write_whole},
};

/// A label map of 8³ voxels with a box of `side` voxels.
fn write_box(folder: &Path, name: &str, side: usize) {
    let grid = Grid::axis_aligned([8; 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let stored = (0..512).map(|l| u8::from(grid.ijk(l).iter().all(|at| *at < side))).collect();
    let volume = Volume::new(grid, Samples::U8(stored), Scaling::NONE).unwrap();
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_nifti(&path, &volume, &WriteOptions::default()).unwrap();
}

fn labels_and_voxels(folder: &Path) -> Vec<(String, u64)> {
    let spec = CaseSpec::from_path(folder).unwrap();
    let case = load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
    case.time_points.iter().map(|t| (t.label.clone(), t.masks[0].mask.voxels())).collect()
}

fn session(number: &str) -> String {
    format!("sub-01/ses-{number}/anat/sub-01_ses-{number}_label-lesion_mask.nii.gz")
}

#[test]
fn sessions_are_in_stage_and_number_order() {
    let folder = tempfile::tempdir().unwrap();
    write_box(folder.path(), &session("post"), 4);
    write_box(folder.path(), &session("pre"), 2);
    assert_eq!(labels_and_voxels(folder.path()), [("pre".to_owned(), 8), ("post".to_owned(), 64)]);
    let folder = tempfile::tempdir().unwrap();
    for (number, side) in [("10", 5), ("2", 3), ("1", 2)] {
        write_box(folder.path(), &session(number), side);
    }
    let expected = [("1".to_owned(), 8), ("2".to_owned(), 27), ("10".to_owned(), 125)];
    assert_eq!(labels_and_voxels(folder.path()), expected);
}

#[test]
fn sessions_tsv_goes_before_names() {
    let folder = tempfile::tempdir().unwrap();
    write_box(folder.path(), &session("A"), 2);
    write_box(folder.path(), &session("B"), 3);
    let table = folder.path().join("sub-01/sub-01_sessions.tsv");
    let write = |rows: &str| write_whole(&table, format!("session_id\tacq_time\n{rows}").as_bytes()).unwrap();
    write("ses-A\t2024-05-01T10:00:00\nses-B\t2024-01-01T10:00:00Z\nses-C\t2023-01-01\n");
    assert_eq!(labels_and_voxels(folder.path()), [("B".to_owned(), 27), ("A".to_owned(), 8)]);
    assert_eq!(labels_and_voxels(&folder.path().join("sub-01"))[0].0, "B");
    // A table without one of the sessions, or with equal or missing times, states no order.
    for rows in
        ["ses-A\t2024-05-01\n", "ses-A\t2024-05-01\nses-B\t2024-05-01\n", "ses-A\tn/a\nses-B\t2024-05-01\n"]
    {
        write(rows);
        assert_eq!(labels_and_voxels(folder.path())[0].0, "A", "{rows}");
    }
}
