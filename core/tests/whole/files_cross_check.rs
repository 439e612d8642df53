//! The second opinion on a file: where the crate `nifti` 0.18 agrees with our reader, and where it doesn't.

use std::path::Path;

use crate::common::{NiftiBuilder, files_below, gzip, real_data};
use glam::DVec3;
use glioscope_core::{
    Grid, Progress, Samples, Scaling, Volume,
    files::{
        self, CrossCheck, CrossChecked, FileError, FileInfo, ReadOptions, ValueCheck, WriteOptions,
        write_nifti, write_whole,
    },
};

const SFORM: [[f32; 4]; 3] = [[1.5, 0.25, 0.0, -20.0], [0.0, 2.0, 0.5, 10.0], [0.0, 0.0, 3.0, 5.0]];

fn try_check(path: &Path) -> Result<CrossChecked, FileError> {
    files::cross_check(path, &ReadOptions::default(), &Progress::new())
}

fn checked(path: &Path) -> CrossChecked {
    try_check(path).unwrap()
}

fn check_as(name: &str, bytes: &[u8]) -> CrossChecked {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write_whole(&path, bytes).unwrap();
    checked(&path)
}

fn check(nifti: &NiftiBuilder) -> CrossCheck {
    check_as("a.nii", &nifti.bytes).cross_check
}

/// 24 voxels.
fn with_sform() -> NiftiBuilder {
    NiftiBuilder::new().sform(1, SFORM).clone()
}

#[test]
fn ordinary_files_agree() {
    let agreed = Some(ValueCheck { compared: 24, different: 0, largest_difference: 0.0 });
    let mut scaled = with_sform();
    scaled.f32s(112, &[0.1, -3.7]);
    let mut turned = NiftiBuilder::new();
    turned.qform(1, [0.3, -0.5, 0.2], [-7.5, 20.0, 3.25]).f32s(76, &[-1.0]);
    let mut half_turn = NiftiBuilder::new();
    half_turn.qform(1, [0.6, 0.8, 0.0], [1.0, 2.0, 3.0]);
    for nifti in [&with_sform(), &scaled, &turned, &half_turn, &NiftiBuilder::new()] {
        let check = check(nifti);
        assert!(check.agrees && check.unreadable.is_none(), "{check:?}");
        assert_eq!(check.values, agreed);
        assert_eq!(check.dims.unwrap().theirs, [2, 3, 4, 1]);
        let affine = check.affine.unwrap();
        assert!(affine.agree && affine.largest_mm.unwrap() < 1e-5, "{affine:?}");
    }
    let packed = check_as("a.nii.gz", &gzip(&with_sform().bytes));
    assert!(packed.cross_check.agrees);
    let text = packed.text();
    let last = text.lines().last().unwrap();
    assert_eq!(last, "cross-check nifti 0.18 agrees: dimensions, affine and the values of 24 voxels");
    let json: serde_json::Value = serde_json::from_str(&packed.json().unwrap()).unwrap();
    assert_eq!(json["format"], "NIfTI-1");
    let check = &json["cross_check"];
    assert_eq!((&check["reader"], &check["agrees"]), (&"nifti 0.18".into(), &true.into()));
    assert_eq!(check["affine"]["theirs"][0], serde_json::json!([1.5, 0.25, 0.0, -20.0]));
    assert_eq!(check["affine"]["ours"], check["affine"]["theirs"]);
}

#[test]
fn one_of_several_frames_and_both_halves_of_a_pair_are_compared() {
    let mut frames = with_sform();
    frames.i16s(40, &[5, 2, 3, 4, 3, 2]);
    frames.bytes.extend((24..144i16).flat_map(i16::to_le_bytes));
    let found = check(&frames);
    assert!(found.agrees);
    assert_eq!((found.dims.unwrap().theirs, found.values.unwrap().compared), ([2, 3, 4, 6], 24));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frames.nii");
    write_whole(&path, &frames.bytes).unwrap();
    // 144 values of eight bytes.
    for (frame, max_bytes, agrees) in [(5, 1152, true), (0, 1151, false)] {
        let found = files::cross_check(&path, &ReadOptions { max_bytes, frame }, &Progress::new()).unwrap();
        assert_eq!(found.cross_check.agrees, agrees);
        assert_eq!(found.cross_check.unreadable.is_some(), !agrees);
    }

    let folder = tempfile::tempdir().unwrap();
    let [header, image] = ["p.hdr", "p.img"].map(|name| folder.path().join(name));
    let mut pair = with_sform();
    pair.put(344, b"ni1\0").f32s(108, &[0.0]);
    let voxels = pair.bytes.split_off(352);
    write_whole(&header, &pair.bytes).unwrap();
    write_whole(&image, &voxels).unwrap();
    assert!(checked(&header).cross_check.agrees && checked(&image).cross_check.agrees);
}

#[test]
fn voxels_that_the_crate_reads_wrongly_are_counted() {
    // Sixteen bytes before the voxels, and no extension that would explain them: the crate starts too early.
    let mut offset = with_sform();
    offset.f32s(108, &[368.0]);
    offset.bytes.splice(352..352, [0; 16]);
    let found = check_as("a.nii", &offset.bytes);
    // Theirs: eight zeros, then 0 to 15. Only voxel 0 is 0 for both.
    assert_eq!(
        found.cross_check.values,
        Some(ValueCheck { compared: 24, different: 23, largest_difference: 8.0 })
    );
    assert!(!found.cross_check.agrees && found.cross_check.affine.as_ref().unwrap().agree);
    assert!(found.text().ends_with("cross-check 23 of 24 voxels differ by nifti 0.18, by up to 8"));

    // "If the scl_slope field is nonzero": theirs is NaN everywhere.
    let mut nan = with_sform();
    nan.f32s(112, &[f32::NAN, 0.0]);
    let found = check_as("a.nii", &nan.bytes);
    assert_eq!(
        found.cross_check.values,
        Some(ValueCheck { compared: 24, different: 24, largest_difference: 0.0 })
    );
    let json: serde_json::Value = serde_json::from_str(&found.json().unwrap()).unwrap();
    assert_eq!(json["cross_check"]["values"]["different"], 24);
}

#[test]
fn another_place_is_reported_in_millimetres() {
    // Metres, which the crate leaves to its caller.
    let mut metres = with_sform();
    metres.put(123, &[1]);
    let found = check_as("a.nii", &metres.bytes);
    let affine = found.cross_check.affine.clone().unwrap();
    assert!(!affine.agree && !found.cross_check.agrees);
    assert_eq!((affine.rows.ours[0][0], affine.rows.theirs[0][0]), (1500.0, 1.5));
    // The corner farthest from the origin is 999 times its own distance away.
    let grid = Grid::new([2, 3, 4], affine_of(SFORM), glioscope_core::Sides::Known).unwrap();
    let farthest = grid.corners_mm().into_iter().map(DVec3::length).fold(0.0, f64::max);
    assert!((affine.largest_mm.unwrap() - 999.0 * farthest).abs() < 1e-6);
    let line =
        format!("cross-check a corner of the grid is elsewhere by nifti 0.18: {:.3} mm", 999.0 * farthest);
    assert!(found.text().ends_with(&line), "{}", found.text());
    // A negative sform code: not set for us, but "not 0" for the crate.
    let mut code = with_sform();
    code.sform(-1, SFORM).qform(1, [0.0; 3], [0.0; 3]);
    assert!(!check(&code).agrees);
    code.sform(-1, [[0.0; 4]; 3]);
    let found = check_as("a.nii", &code.bytes);
    assert_eq!(found.cross_check.affine, None);
    assert!(found.text().ends_with("cross-check the affine of nifti 0.18 is singular"), "{}", found.text());
}

fn affine_of(rows: [[f32; 4]; 3]) -> glam::DAffine3 {
    let column = |c: usize| DVec3::from_array(rows.map(|row| f64::from(row[c])));
    glam::DAffine3 {
        matrix3: glam::DMat3::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    }
}

#[test]
fn files_that_the_crate_refuses_are_reported_and_files_that_we_refuse_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let far = folder.path().join("far.nii");
    let grid = Grid::axis_aligned([2, 1, 1], DVec3::ONE, DVec3::splat(1e6 + 0.1)).unwrap();
    let volume = Volume::new(grid, Samples::U8(vec![1, 2]), Scaling::NONE).unwrap();
    write_nifti(&far, &volume, &WriteOptions::default()).unwrap();
    let nifti_2 = checked(&far);
    let check = &nifti_2.cross_check;
    assert!(!check.agrees && check.dims.is_none() && check.values.is_none());
    assert!(
        nifti_2.text().contains("cross-check the crate nifti 0.18 can't read it: "),
        "{}",
        nifti_2.text()
    );
    // A gzip is recognised by its name only.
    let packed = check_as("a.nii", &gzip(&with_sform().bytes));
    assert!(packed.cross_check.unreadable.is_some());

    let mut rgb = with_sform();
    rgb.i16s(70, &[128, 24]);
    let path = folder.path().join("rgb.nii");
    write_whole(&path, &rgb.bytes).unwrap();
    assert!(try_check(&path).is_err());
}

/// The crate can't read NIfTI-2, a gzip of several members, nor extensions of odd size; it agrees on every other file
/// that we read.
#[test]
fn the_readers_agree_on_real_files() {
    const UNREADABLE: [&str; 2] = ["avg152T1_LR_nifti2.nii.gz", "multi-member-gzip.nii.gz"];
    let Some(folder) = real_data(".") else { return };
    let mut agree = 0;
    for path in files_below(&folder) {
        let name = path.file_name().unwrap().to_str().unwrap();
        if !files::format::is_volume(name) {
            continue;
        }
        // Files that we refuse can't be compared.
        let Ok(found) = try_check(&path) else { continue };
        if found.info.components > 1 || found.info.checks.iter().any(|c| c.code == "extension-odd") {
            continue;
        }
        assert_eq!(found.cross_check.agrees, !UNREADABLE.contains(&name), "{name}: {}", found.text());
        agree += usize::from(found.cross_check.agrees);
    }
    assert!(agree > 140, "{agree} files");
}
