//! The stored numbers of the real files equal those read by the `nifti` crate 0.18, where that is correct. It fails on
//! NIfTI-2 and on several gzip members, returns wrong voxels for a `vox_offset` above 352 without extensions (none
//! among these files), and doesn't find an image that is compressed differently from its header.

use std::path::Path;

use crate::common::{files_below, read, real_data};
use glioscope_core::with_samples;
use nifti::{DataElement, InMemNiftiVolume, NiftiObject, ReaderOptions};

const UNSUPPORTED_FILES: &[&str] = &["avg152T1_LR_nifti2.nii.gz", "multi-member-gzip.nii.gz"];

#[test]
fn stored_numbers_match_the_nifti_crate() {
    let mut compared = 0;
    for folder in
        ["nifti-types", "nifti-orientations", "sarcoma-ct-mr-pet", "glioma-5-algorithms", "masks-degenerate"]
    {
        let Some(folder) = real_data(folder) else { return };
        for path in files_below(&folder) {
            let Ok(ours) = read(&path) else { continue };
            if UNSUPPORTED_FILES.iter().any(|name| path.ends_with(name))
                || path.to_string_lossy().contains(".img")
            {
                continue;
            }
            // It takes colours for numbers.
            if ours.checks.iter().any(|check| check.code == "color-labels") {
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
