//! Faults that users reported of other programs, on files made here, and on files made after their reports where those
//! are at hand (the folder `reported` of the real data, whose README gives the right values).

use std::path::Path;

use crate::common::{NiftiBuilder, real_data};
use glioscope_core::{
    Check, Progress, Severity,
    case::{Case, CaseSpec, LoadOptions, load},
    files::write_whole,
};

fn case_of(masks: &[String]) -> Case {
    let spec = CaseSpec::from_arguments(masks, &[]).unwrap();
    load(&spec, &LoadOptions::default(), &Progress::new()).unwrap()
}

fn with_tracts(mask: &str, tracts: &Path) -> Case {
    let mut spec = CaseSpec::from_arguments(&[mask.to_owned()], &[]).unwrap();
    spec.add_tracts(&[tracts.to_owned()]);
    load(&spec, &LoadOptions::default(), &Progress::new()).unwrap()
}

fn voxels(case: &Case) -> Vec<u64> {
    case.time_points[0].masks.iter().map(|m| m.native_voxels).collect()
}

fn warnings<'a>(case: &'a Case, code: &str) -> Vec<&'a Check> {
    case.checks.iter().filter(|c| c.code == code && c.severity == Severity::Warning).collect()
}

/// Voxels of one byte on a grid of 1 mm with an sform.
fn bytes_file(dims: [i16; 3], scaling: [f32; 2], stored: impl Fn(usize) -> u8) -> NiftiBuilder {
    let mut nifti = NiftiBuilder::new();
    nifti.i16s(42, &dims).i16s(70, &[2, 8]).f32s(112, &scaling).f32s(76, &[1.0; 4]);
    nifti.sform(1, [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
    nifti.bytes.truncate(352);
    nifti.bytes.extend((0..dims.iter().map(|&n| n as usize).product()).map(stored));
    nifti
}

#[test]
fn eight_files_without_a_unit_give_one_warning() {
    let folder = tempfile::tempdir().unwrap();
    let masks: Vec<String> = (0..8)
        .map(|n| {
            let path = folder.path().join(format!("{n}.nii"));
            let mut nifti = bytes_file([4, 4, 4], [1.0, 0.0], |at| u8::from(at < 9));
            nifti.put(123, &[0]);
            write_whole(&path, &nifti.bytes).unwrap();
            format!("m{n}={}", path.display())
        })
        .collect();
    let case = case_of(&masks);
    let found = warnings(&case, "units-unknown");
    assert_eq!(found.len(), 1, "{:?}", case.checks);
    assert_eq!(found[0].message, "m0, m1, m2, m3, m4, m5, m6, m7 (8 files): no unit of length; mm assumed");
}

/// Labels 0 to 7, scaled to the whole range of a byte: label n is stored as round(n * 255 / 7).
#[test]
fn labels_through_slope_and_intercept_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labels.nii");
    let stored = |at: usize| ((at % 8) as f32 * 255.0 / 7.0).round() as u8;
    write_whole(&path, &bytes_file([8, 4, 4], [7.0 / 255.0, 0.0], stored).bytes).unwrap();
    let masks: Vec<String> = (0..=8).map(|label| format!("L{label}={}:{label}", path.display())).collect();
    let case = case_of(&masks);
    assert_eq!(voxels(&case), [16, 16, 16, 16, 16, 16, 16, 16, 0]);
    assert!(warnings(&case, "non-integer-label-map").is_empty(), "{:?}", case.checks);
    let empty = warnings(&case, "mask-empty");
    assert!(empty[0].message.contains("no voxel has label 8 within 0.014 of its value"), "{empty:?}");
}

#[test]
fn a_soft_mask_is_cut_at_one_half_and_its_sum_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("soft.nii");
    // A ramp along x from 0 to 100 in steps of 5: 51 to 100 in 10 of 21 columns of 4 x 4 voxels.
    let stored = |at: usize| (at % 21 * 5) as u8;
    write_whole(&path, &bytes_file([21, 4, 4], [1.0, 0.0], stored).bytes).unwrap();
    let per_cent = format!("A={}", path.display());
    let case = case_of(std::slice::from_ref(&per_cent));
    // Neighbours along y are equal in this ramp, so that it may be labels as well.
    assert_eq!((voxels(&case), warnings(&case, "mask-soft").len()), (vec![20 * 16], 0));
    let stored = |at: usize| {
        if (at % 21 + at / 21).is_multiple_of(2) { (at % 21 * 5) as u8 } else { (at % 21 * 5) as u8 / 2 }
    };
    write_whole(&path, &bytes_file([21, 4, 4], [1.0, 0.0], stored).bytes).unwrap();
    let case = case_of(&[per_cent]);
    let all: Vec<u8> = (0..21 * 16).map(stored).collect();
    assert_eq!(voxels(&case), [all.iter().filter(|&&v| v > 50).count() as u64]);
    let expected_ml = all.iter().map(|&v| f64::from(v)).sum::<f64>() / 100.0 / 1000.0;
    let found_ml = case.time_points[0].masks[0].expected_volume_ml.unwrap();
    assert!((found_ml - expected_ml).abs() < 1e-12, "{found_ml} {expected_ml}");
    assert_eq!(warnings(&case, "mask-soft").len(), 1);
}

#[test]
fn an_image_given_as_a_mask_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t1.nii");
    let stored = |at: usize| (at.wrapping_mul(2_654_435_761) >> 13) as u8;
    write_whole(&path, &bytes_file([16, 16, 16], [1.0, 0.0], stored).bytes).unwrap();
    let case = case_of(&[format!("A={}", path.display())]);
    assert_eq!(warnings(&case, "mask-looks-like-image").len(), 1, "{:?}", case.checks);
    // With labels given, the file is what they say.
    let case = case_of(&[format!("A={}:1,2", path.display())]);
    assert!(warnings(&case, "mask-looks-like-image").is_empty());
}

#[test]
fn reported_headers_and_labels_and_soft_masks_have_their_right_values() {
    let Some(root) = real_data("reported") else { return };
    let mask = |id: &str, file: &str| format!("{id}={}", root.join(file).display());
    for file in ["jsonleft.nii", "not16.nii", "pad.nii"] {
        let case = case_of(&[mask("A", &format!("19-niftijio-9/{file}"))]);
        assert_eq!((voxels(&case), warnings(&case, "extension-odd").len()), (vec![925], 1), "{file}");
    }
    for file in ["ok176.nii", "x.nii"] {
        let case = case_of(&[mask("A", &format!("19-niftijio-9/{file}"))]);
        assert_eq!((voxels(&case), warnings(&case, "extension-odd").len()), (vec![925], 0), "{file}");
    }
    let edited = |label: &str| mask(&format!("L{label}"), &format!("09-petprep-152/edited.nii.gz:{label}"));
    assert_eq!(voxels(&case_of(&[edited("1"), edited("6")])), [108, 108]);
    let scaled = |label: &str| mask(&format!("L{label}"), &format!("09-petprep-152/lab.nii.gz:{label}"));
    assert_eq!(voxels(&case_of(&[scaled("7003"), scaled("7015")])), [216, 180]);
    // From NumPy: the sum of the probabilities.
    for (file, expected_ml) in [("pct", 2.420_56), ("soft", 2.446_487_147)] {
        let case = case_of(&[mask("A", &format!("34-sct-5308/{file}.nii.gz"))]);
        assert_eq!((voxels(&case), warnings(&case, "mask-soft").len()), (vec![2103], 1), "{file}");
        let found_ml = case.time_points[0].masks[0].expected_volume_ml.unwrap();
        assert!((found_ml - expected_ml).abs() < 1e-6, "{file}: {found_ml}");
    }
    let stale = case_of(&[mask("A", "13-nibabel-668/stale.nii.gz")]);
    assert_eq!(warnings(&stale, "pixdim-sform-disagree").len(), 1);
    assert!((stale.time_points[0].masks[0].native_volume_ml - 2.109).abs() < 1e-9);
}

#[test]
fn reported_tracts_load() {
    let Some(root) = real_data("reported") else { return };
    let loaded = |folder: &str, file: &str| {
        let mask = format!("A={}", root.join(folder).join("mask.nii.gz").display());
        with_tracts(&mask, &root.join(folder).join(file))
    };
    let two = loaded("01-tck-two-counts", "two.tck");
    assert_eq!(two.tracts[0].tracts.fiber_count(), 2);
    assert_eq!(warnings(&two, "tracts-header-repeated").len(), 1);
    let third = loaded("07-trk", "v3.trk");
    assert_eq!((third.tracts[0].tracts.fiber_count(), warnings(&third, "tracts-version").len()), (2, 1));
    let (plain, packed) = (loaded("08-tck-gz", "a.tck"), loaded("08-tck-gz", "a.tck.gz"));
    assert_eq!(plain.tracts, packed.tracts);
    assert_eq!(plain.tracts[0].id, "a");
}
