//! The house: which crate and module knows which, and the script that runs everything.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "in a test a failed unwrap is a failed test"
)]

mod house_script;
mod map;
mod modules;
mod structure;
