//! Benchmarks that print times of views and kernels, one module each.

pub mod change;
pub mod closeups;
pub mod combined;
pub mod ellipsoids;
pub mod fluency;
pub mod force_field;
pub mod images;
pub mod together;
pub mod tracts;
pub mod turning;
pub mod views;

use std::path::Path;

use glioscope_core::{
    Progress,
    case::{Case, CaseSpec, LoadOptions, load},
};

use crate::Outcome;

/// Loads a case from `ID=FILE[:LABELS][@DATE]` arguments, with files relative to `data`.
fn open_case(data: &Path, masks: &[&str], contexts: &[&str]) -> Outcome<Case> {
    let in_data = |list: &[&str]| -> Vec<String> {
        let with_folder = |entry: &&str| match entry.split_once('=') {
            Some((id, file)) => format!("{id}={}", data.join(file).display()),
            None => (*entry).to_owned(),
        };
        list.iter().map(with_folder).collect()
    };
    let spec = CaseSpec::from_arguments(&in_data(masks), &in_data(contexts))?;
    Ok(load(&spec, &LoadOptions::default(), &Progress::new())?)
}
