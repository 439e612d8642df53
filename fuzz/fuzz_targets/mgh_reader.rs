//! Arbitrary bytes: the reader returns a volume or an error, in bounded memory, and never panics. A
//! loaded volume must be consistent: as many samples as voxels, and an invertible affine.
#![no_main]

use glioscope_core::Progress;
use glioscope_core::files::{ReadOptions, read_mgh_bytes};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for frame in [0, 2] {
        let options = ReadOptions { max_bytes: 16 << 20, frame };
        let Ok(loaded) = read_mgh_bytes("fuzz.mgz", bytes, &options, &Progress::new()) else { continue };
        let volume = &loaded.volume;
        assert_eq!(volume.samples().len(), volume.grid().voxel_count());
        assert!(volume.grid().voxel_volume_mm3() > 0.0);
        assert!(frame < loaded.frames);
    }
});
