//! `glioscope sample`.

use std::path::Path;

use glioscope_core::sample;

use super::{Failure, terminal};

pub(super) fn run(out: &Path) -> Result<(), Failure> {
    sample::write_sample(out)?;
    terminal::print(&format!("sample case written to {}", out.display()))
}
