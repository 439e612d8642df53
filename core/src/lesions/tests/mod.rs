//! Synthetic cases, made through the public interface: boxes of voxels at dates.

mod change_points;
mod edited;
mod necks;
mod tracked;

use crate::{
    Grid, Progress, Samples, Scaling, Volume,
    case::{Case, CaseSpec, LoadOptions, MaskSpec, load_with},
    files::{Loaded, Source},
    glam::DVec3,
};

use super::*;

const DIMS: [usize; 3] = [40, 40, 20];

/// A box: first voxel and size.
type Box3 = ([usize; 3], [usize; 3]);

fn grid() -> Grid {
    Grid::axis_aligned(DIMS, DVec3::ONE, DVec3::ZERO).unwrap()
}

fn volume(grid: &Grid, boxes: &[Box3]) -> Volume {
    let inside = |l: usize| {
        let v = grid.ijk(l);
        boxes.iter().any(|(start, dims)| (0..3).all(|a| (start[a]..start[a] + dims[a]).contains(&v[a])))
    };
    let stored = (0..grid.voxel_count()).map(|l| u8::from(inside(l))).collect();
    Volume::new(grid.clone(), Samples::U8(stored), Scaling::NONE).unwrap()
}

/// A case of masks `(id, date, voxels)`.
fn case_of(masks: &[(&str, &str, Volume)], options: &LoadOptions) -> Case {
    let spec_of = |(id, time, _): &(&str, &str, Volume)| MaskSpec {
        id: (*id).into(),
        source: Source::File(format!("{id} {time}").into()),
        labels: None,
        above: None,
        time: Some((*time).into()),
        color: None,
        name: None,
    };
    let spec =
        CaseSpec { name: "made".into(), masks: masks.iter().map(spec_of).collect(), ..CaseSpec::default() };
    let read = |source: &Source| {
        let of = |(id, time, _): &&(&str, &str, Volume)| source.name() == format!("{id} {time}");
        let volume = masks.iter().find(of).map(|(_, _, volume)| volume.clone()).unwrap();
        Ok(Loaded { volume, frames: 1, checks: Vec::new(), origin: None })
    };
    load_with(&spec, options, &Progress::new(), &read).unwrap()
}

const DATES: [&str; 8] = [
    "2024-01-01",
    "2024-01-11",
    "2024-01-21",
    "2024-01-31",
    "2024-02-10",
    "2024-02-20",
    "2024-03-01",
    "2024-03-11",
];

/// Mask M, its boxes at each date.
fn case(dates: &[&[Box3]]) -> Case {
    let masks: Vec<_> = dates.iter().zip(DATES).map(|(b, t)| ("M", t, volume(&grid(), b))).collect();
    case_of(&masks, &LoadOptions::default())
}

fn options() -> Options {
    Options::new(Of::Mask("M".into()))
}

fn reported(case: &Case, edits: &[Edit]) -> LesionsReport {
    report(case, &options(), edits, &Progress::new()).unwrap()
}

fn with_options(case: &Case, options: &Options) -> Result<LesionsReport, LesionsError> {
    report(case, options, &[], &Progress::new())
}

/// Kind, later date and lesion of all events.
fn events(report: &LesionsReport) -> Vec<(EventKind, &str, &str)> {
    report.events.iter().map(|event| (event.kind, event.to_time.as_str(), event.lesion.as_str())).collect()
}

/// The volumes of a lesion in voxels of 1 mm³.
fn voxels(report: &LesionsReport, lesion: usize) -> Vec<Option<f64>> {
    let points = report.lesions[lesion].series.points.iter();
    points.map(|point| point.volume_ml.map(|ml| (ml * 1000.0).round())).collect()
}

fn anchor(date: usize, at: [f64; 3]) -> Anchor {
    Anchor { time: DATES[date].into(), of: "M".into(), at_mm: DVec3::from_array(at) }
}

/// Boxes of 216 voxels (0.216 ml) at these places.
fn cube(x: usize, y: usize, z: usize) -> Box3 {
    ([x, y, z], [6, 6, 6])
}
