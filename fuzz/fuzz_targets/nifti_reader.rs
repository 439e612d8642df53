//! Any bytes at all: the reader answers with a volume or an error, in little memory, and never
//! panics. What it loads must be what it says: as many voxels as its grid, a matrix that can be
//! inverted, and the same numbers again when they are written and read back.
#![no_main]

use glioscope_core::Progress;
use glioscope_core::files::{ReadOptions, nifti_bytes, read_bytes};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for frame in [0, 2] {
        let options = ReadOptions { max_bytes: 16 << 20, frame };
        let Ok(loaded) = read_bytes("fuzz.nii", bytes, &options, &Progress::new()) else { continue };
        let volume = &loaded.volume;
        assert_eq!(volume.samples().len(), volume.grid().voxel_count());
        assert!(volume.grid().voxel_volume_mm3() > 0.0);
        assert!(frame < loaded.frames);
        if volume.samples().len() <= 4096 {
            let written = nifti_bytes(volume, false);
            let again =
                read_bytes("again.nii", &written, &ReadOptions { frame: 0, ..options }, &Progress::new());
            let again = again.expect("what was written can be read").volume;
            // NaN is not equal to itself: compare what is stored, as text of bits would be.
            assert_eq!(format!("{:?}", again.samples()), format!("{:?}", volume.samples()));
        }
    }
});
