//! The `nifti` crate 0.18 finds the same stored numbers in the real files, where it is right. It
//! isn't with NIfTI-2 and several gzip members (errors), nor with a `vox_offset` past 352 without
//! extensions (wrong voxels, none among these files); it finds no image that is compressed unlike
//! its header.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a failed unwrap here is a failed test"
)]

mod common;

use std::path::Path;

use common::{files_below, read, real_data};
use glioscope_core::with_samples;
use nifti::{DataElement, InMemNiftiVolume, NiftiObject, ReaderOptions};

const NOT_FOR_IT: &[&str] = &["avg152T1_LR_nifti2.nii.gz", "multi-member-gzip.nii.gz"];

#[test]
fn stored_numbers_are_those_of_the_nifti_crate() {
    let mut compared = 0;
    for folder in
        ["nifti-types", "nifti-orientations", "sarcoma-ct-mr-pet", "glioma-5-algorithms", "masks-degenerate"]
    {
        let Some(folder) = real_data(folder) else { return };
        for path in files_below(&folder) {
            let Ok(ours) = read(&path) else { continue };
            if NOT_FOR_IT.iter().any(|name| path.ends_with(name)) || path.to_string_lossy().contains(".img") {
                continue;
            }
            let theirs = ReaderOptions::new().read_file(&path).unwrap_or_else(|e| panic!("{path:?}: {e}"));
            let theirs = theirs.into_volume();
            with_samples!(ours.volume.samples(), v => compare(theirs, v, ours.frames, &path));
            compared += 1;
        }
    }
    assert!(compared > 85, "{compared} files");
}

fn compare<T: DataElement + PartialEq>(theirs: InMemNiftiVolume, ours: &[T], frames: usize, path: &Path) {
    let theirs: Vec<T> = theirs.into_nifti_typed_data().unwrap();
    assert_eq!(theirs.len(), ours.len() * frames, "{}", path.display());
    assert!(theirs[..ours.len()] == ours[..], "{}", path.display());
}
