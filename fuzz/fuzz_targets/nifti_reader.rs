//! Arbitrary bytes: the reader returns a volume or an error, in bounded memory, and never panics. A
//! loaded volume must be consistent: as many samples as voxels, an invertible affine, and the same
//! samples after writing and reading back.
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
            let reread =
                read_bytes("again.nii", &written, &ReadOptions { frame: 0, ..options }, &Progress::new());
            let reread = reread.expect("what was written can be read").volume;
            // NaN isn't equal to itself: compare the debug text instead.
            assert_eq!(format!("{:?}", reread.samples()), format!("{:?}", volume.samples()));
        }
    }
});
