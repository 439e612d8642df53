//! Times of views and kernels, printed. A file each.

pub mod change;
pub mod ellipsoids;
pub mod force_field;
pub mod tracts;
pub mod turning;
pub mod views;

use std::path::Path;

use glioscope_core::{
    Progress,
    case::{Case, CaseSpec, LoadOptions, load},
};

use crate::Outcome;

/// A case of these `ID=FILE[:LABELS][@DATE]`, files under `data`.
fn open(data: &Path, masks: &[&str], contexts: &[&str]) -> Outcome<Case> {
    let under = |list: &[&str]| -> Vec<String> {
        let one = |entry: &&str| match entry.split_once('=') {
            Some((id, file)) => format!("{id}={}", data.join(file).display()),
            None => (*entry).to_owned(),
        };
        list.iter().map(one).collect()
    };
    let spec = CaseSpec::from_arguments(&under(masks), &under(contexts))?;
    Ok(load(&spec, &LoadOptions::default(), &Progress::new())?)
}
