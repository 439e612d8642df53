//! `glioscope tracts`: distances of fibre tracts to the selection.

use clap::Args;
use glioscope_core::{
    Check, MaskBits, Progress, Selection, Sides,
    case::{Case, CaseTracts, TimePoint},
    decimal,
    tract_distance::{Nearness, SelectedCells},
};
use serde::Serialize;

use super::{case::CaseArguments, parse, resolve, terminal};
use crate::{error::AppError, format};

/// Arguments of `tracts`.
#[derive(Debug, Args)]
pub struct TractArguments {
    /// The case.
    #[command(flatten)]
    pub case: CaseArguments,
    /// Regions to measure from: T1,T1+PET. Without it, all.
    #[arg(long, value_name = "REGION,...", default_value = "all")]
    pub select: String,
    /// Also count the fibres at most this far away.
    #[arg(long, value_name = "MM", default_value_t = 10.0, value_parser = parse::within(0.0..=1e6), allow_hyphen_values = true)]
    pub within: f64,
    /// The date of the masks, by its label; may be left out where there is one.
    #[arg(long, value_name = "LABEL")]
    pub time: Option<String>,
    /// As JSON: see docs/json.md.
    #[arg(long)]
    pub json: bool,
}

/// Distances of all tract files to the selection.
#[derive(Debug, PartialEq, Serialize)]
struct TractsReport {
    case: String,
    time: String,
    /// Names of the selected regions.
    selected: Vec<String>,
    selected_voxels: u64,
    selected_ml: f64,
    within_mm: f64,
    tracts: Vec<TractReport>,
    /// All findings about the case, most severe first.
    warnings: Vec<Check>,
}

/// One tract file. Distances are measured to the voxels' cells, not their centres.
#[derive(Debug, PartialEq, Serialize)]
struct TractReport {
    id: String,
    fibers: usize,
    points: usize,
    /// Whether left and right are known for the file and the case grid; if not, the fields below are null.
    placed: bool,
    /// Distance of the nearest fibre; null without fibres, without a selection, or if not placed.
    nearest_mm: Option<f64>,
    /// Index of that fibre in the file, from 0.
    nearest_fiber: Option<usize>,
    /// Nearest point on it, R, A and S.
    place_mm: Option<[f64; 3]>,
    /// Nearest point of the selection, R, A and S.
    selection_mm: Option<[f64; 3]>,
    /// Number of fibres that enter the selection.
    through: Option<usize>,
    /// Number of fibres at most `within_mm` away, including those through the selection.
    within: Option<usize>,
}

pub(super) fn run(arguments: &TractArguments) -> Result<(), AppError> {
    let case = arguments.case.read(false)?.case;
    if case.tracts.is_empty() {
        return Err(AppError::arguments("no tracts", "--tracts FILE or [[tracts]] in the manifest"));
    }
    let time_point = resolve::time_point(&case, arguments.time.as_deref())?;
    let selection = resolve::selection(&arguments.select, &time_point.regions)?;
    let distances = terminal::with_progress(|progress| {
        progress.say("distances of fibres");
        report(&case, time_point, &selection, arguments.within, progress)
    })?;
    if arguments.json { terminal::print_json(&distances) } else { terminal::print(&table(&distances)) }
}

fn report(
    case: &Case,
    time_point: &TimePoint,
    selection: &Selection,
    within_mm: f64,
    progress: &Progress,
) -> Result<TractsReport, AppError> {
    let (index, regions) = (&time_point.index, &time_point.regions);
    let selected: Vec<_> = regions.list().iter().filter(|r| selection.shows(r.bits)).collect();
    let bits = MaskBits::from_fn(index.grid().dims(), |linear| selection.shows(index.get(linear)));
    let cells = SelectedCells::new(index.grid(), &bits);
    let voxels = bits.count();
    let mut tracts = Vec::new();
    for CaseTracts { id, tracts: fibers } in &case.tracts {
        let placed = fibers.sides() == Sides::Known && index.grid().sides() == Sides::Known;
        let nearness = match cells.as_ref().filter(|_| placed) {
            Some(cells) => {
                let approaches = cells.nearest_of_all(fibers, progress)?;
                Some(Nearness::of(&approaches, within_mm))
            }
            None => None,
        };
        let nearest = nearness.and_then(|n| n.nearest);
        tracts.push(TractReport {
            id: id.clone(),
            fibers: fibers.fiber_count(),
            points: fibers.points_mm().len(),
            placed,
            nearest_mm: nearest.map(|(_, a)| a.distance_mm),
            nearest_fiber: nearest.map(|(fiber, _)| fiber),
            place_mm: nearest.map(|(_, a)| a.fiber_mm.to_array()),
            selection_mm: nearest.map(|(_, a)| a.selection_mm.to_array()),
            through: nearness.map(|n| n.through),
            within: nearness.map(|n| n.within),
        });
    }
    Ok(TractsReport {
        case: case.name.clone(),
        time: time_point.label.clone(),
        selected: selected.iter().map(|r| regions.name(r.bits)).collect(),
        selected_voxels: voxels,
        selected_ml: index.grid().volume_ml(voxels),
        within_mm,
        tracts,
        warnings: case.checks.clone(),
    })
}

/// The report as a text table.
fn table(report: &TractsReport) -> String {
    let within = format!("within {} mm", report.within_mm);
    let selected = if report.selected.is_empty() { "nothing".into() } else { report.selected.join(", ") };
    let mut lines = vec![
        report.case.clone(),
        format!("from {selected}: {}", format::ml(report.selected_ml)),
        format!(
            "{:24} {:>9} {:>9} {:>11} {:>9} {:>9} {within:>14}  nearest place R, A, S (mm)",
            "tracts", "fibres", "points", "nearest", "fibre", "through"
        ),
    ];
    let count = |n: Option<usize>| n.map_or("–".to_owned(), |n| n.to_string());
    for t in &report.tracts {
        let place = match t.place_mm {
            Some([r, a, s]) => format!("{r:.1}, {a:.1}, {s:.1}"),
            None if t.placed => "–".into(),
            None => "unknown: no place in the patient".into(),
        };
        lines.push(format!(
            "{:24} {:>9} {:>9} {:>11} {:>9} {:>9} {:>14}  {place}",
            t.id,
            t.fibers,
            t.points,
            t.nearest_mm.map_or("–".to_owned(), |mm| format!("{} mm", decimal::text(mm, 2))),
            count(t.nearest_fiber),
            count(t.through),
            count(t.within)
        ));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use glioscope_core::{Tracts, case, sample};

    /// The sample with two straight fibres along R: one 100 mm above the grid, one through the tumour's centroid.
    fn with_tracts(sides: Sides) -> Case {
        let mut case =
            case::load(&sample::sample_spec(), &case::LoadOptions::default(), &Progress::new()).unwrap();
        let (low, high) = case.grid.bounds_mm();
        let middle = case.time_points[0].regions.centroid_mm().unwrap();
        let line = |z: f64| [[low.x, middle.y, z], [high.x, middle.y, z]].map(|p| p.map(|v| v as f32));
        let points = [line(high.z + 100.0), line(middle.z)].concat();
        let tracts = Arc::new(Tracts::new(points, vec![0, 2, 4], sides).unwrap());
        case.tracts = vec![CaseTracts { id: "CST".into(), tracts }];
        case
    }

    #[test]
    fn report_gives_nearest_fiber_and_counts() {
        let case = with_tracts(Sides::Known);
        let time_point = &case.time_points[0];
        let found = report(&case, time_point, &Selection::all(), 10.0, &Progress::new()).unwrap();
        let cst = &found.tracts[0];
        assert_eq!((cst.fibers, cst.points, cst.nearest_fiber), (2, 4, Some(1)));
        assert_eq!((cst.nearest_mm, cst.through, cst.within), (Some(0.0), Some(1), Some(1)));
        assert_eq!(found.selected_voxels, time_point.regions.union_voxels());
        let text = table(&found);
        assert!(text.contains("0.00 mm") && text.contains("within 10 mm"), "{text}");

        let nothing = Selection::only(&time_point.regions, &[]);
        let found = report(&case, time_point, &nothing, 10.0, &Progress::new()).unwrap();
        assert_eq!((found.tracts[0].nearest_mm, found.tracts[0].through), (None, None));
        assert!(table(&found).contains("from nothing"));
    }

    #[test]
    fn fibers_of_unknown_position_have_no_distances() {
        let case = with_tracts(Sides::Unknown);
        let found = report(&case, &case.time_points[0], &Selection::all(), 10.0, &Progress::new()).unwrap();
        assert_eq!((found.tracts[0].nearest_mm, found.tracts[0].within), (None, None));
        assert!(table(&found).contains("no place in the patient"));
    }
}
