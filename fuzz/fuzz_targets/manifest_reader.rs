//! Arbitrary text as a manifest: a description of a case or an error, never a panic.
#![no_main]

use std::path::Path;

use glioscope_core::case::parse_manifest;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let _ = parse_manifest(text, Path::new("/nowhere/case.toml"));
});
