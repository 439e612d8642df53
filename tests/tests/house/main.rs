//! Rules of the repository: which crate and module may depend on which, and the script `./x`.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "in a test a failed unwrap is a failed test"
)]

mod house_script;
mod map;
mod modules;
mod schemas;
mod structure;
mod unused;
