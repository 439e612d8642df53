//! `glioscope report`: every picture and every number of a case, in a folder.

use std::path::Path;

use glioscope_core::measure;
use glioscope_render::slices::Plane;

use super::{CaseArguments, Failure, render, terminal};
use crate::{document::Pane, files, workstation::Workstation, world::Loaded};

const VIEWS: [(&str, Option<Pane>, [u32; 2]); 8] = [
    ("window", None, [1600, 1000]),
    ("closeup", Some(Pane::Closeup), [900, 900]),
    ("context", Some(Pane::Context), [900, 900]),
    ("ellipsoids", Some(Pane::Ellipsoids), [900, 900]),
    ("axial", Some(Pane::Slice(Plane::Axial)), [700, 700]),
    ("coronal", Some(Pane::Slice(Plane::Coronal)), [700, 700]),
    ("sagittal", Some(Pane::Slice(Plane::Sagittal)), [700, 700]),
    ("overlap", Some(Pane::Overlap), [700, 900]),
];

const DATES: [(&str, Option<Pane>, [u32; 2]); 2] =
    [("change", Some(Pane::Change), [900, 900]), ("dates", Some(Pane::Dates), [700, 900])];

pub(super) fn run(case: &CaseArguments, out: &Path, software: bool) -> Result<(), Failure> {
    let (reference, case) = case.load(true)?;
    std::fs::create_dir_all(out).map_err(|e| {
        Failure::from(format!("{}: found {e}, expected a folder that can be made", out.display()))
    })?;
    files::write_json(&out.join("measure.json"), &measure::report(&case))?;
    let dates = case.time_points.len();
    let gpu = render::gpu(software)?;
    let mut studio = render::Studio::new(Workstation::with_case(reference, Loaded::new(case)), &gpu, false)?;
    // One date has nothing to compare.
    let of_dates: &[_] = if dates > 1 { &DATES } else { &[] };
    for &(name, pane, size) in VIEWS.iter().chain(of_dates) {
        let rgba = studio.pane(pane, size, 1.0)?;
        files::write_png(&out.join(format!("{name}.png")), size, &rgba)?;
    }
    terminal::print(&format!("pictures and numbers written to {}", out.display()))
}
