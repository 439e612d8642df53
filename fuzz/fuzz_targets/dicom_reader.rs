//! Arbitrary bytes as a DICOM file: data set, place, masks and pixels without a codec are read or refused, in bounded
//! memory and without a panic.
#![no_main]

use glioscope_core::files::dicom::inspect;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = inspect(bytes, 16 << 20);
});
