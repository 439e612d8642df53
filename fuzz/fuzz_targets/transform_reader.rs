//! Arbitrary bytes as a registration transform: an invertible map or an error, never a panic.
#![no_main]

use glioscope_core::transform::{Given, read_bytes};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(transform) = read_bytes("fuzz.tfm", bytes, &Given::default()) {
        let both = transform.fixed_from_moving() * transform.moving_from_fixed();
        assert!(both.is_finite());
    }
});
