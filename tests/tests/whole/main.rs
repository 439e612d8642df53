//! Tests of the whole program: command line, window, rendered views. One test binary, so that it links once.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "in a test a failed unwrap is a failed test"
)]

mod animations;
mod archives;
mod cli;
mod dicom;
#[cfg(target_os = "linux")]
mod faults;
mod figures;
mod goldens;
mod lesions;
mod made_masks;
mod monkey;
mod real_views;
mod real_window;
mod report_dicom;
mod report_file;
mod reported;
mod schema_outputs;
mod schemas;
mod session_files;
mod sessions;
mod study;
mod transforms;
mod ui;
mod ui_agreement;
mod ui_align;
mod ui_case_files;
mod ui_change;
mod ui_cpu_paint;
mod ui_dialogs;
mod ui_explain;
mod ui_fibers;
mod ui_files;
mod ui_gestures;
mod ui_layouts;
mod ui_lens;
mod ui_lesions;
mod ui_light;
mod ui_masks;
mod ui_places;
mod ui_response;
mod ui_study;
mod ui_tracts;
mod ui_transfer;
mod ui_views;

/// The program, built for tests.
const PROGRAM: &str = env!("CARGO_BIN_EXE_glioscope-under-test");
