//! `glioscope sample`: writes the embedded sample case as files.

use std::path::Path;

use glioscope_core::sample;

use super::terminal;
use crate::error::AppError;

pub(super) fn run(out: &Path) -> Result<(), AppError> {
    sample::write_sample(out)?;
    terminal::print(&format!("sample case written to {}", out.display()))
}
