//! Tests of files and cases through the crate's public face. One test binary, so that it links once.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a failed unwrap here is a failed test"
)]

mod common;

mod bounded_memory;
mod case_codes;
mod case_real;
mod case_sample;
mod dicom;
mod dicom_write;
mod discovery;
mod export_real;
mod files_codes;
mod files_cross_check;
mod files_header;
mod files_nibabel;
mod files_real;
mod files_second_reader;
mod files_space;
mod files_tracts;
mod files_write;
mod metaimage;
mod mgh;
mod nrrd;
mod nrrd_mha;
mod reported;
mod time_order;
