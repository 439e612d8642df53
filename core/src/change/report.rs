//! The change of one mask of a case, and its numbers as `change --json` and `--csv` write them.

use std::fmt::Write as _;

use glam::DVec3;
use serde::Serialize;

use super::{
    COVERAGE, Change, ChangeCounts, ChangeError, ChangeOptions, Fate, Flag, Histogram, Lengths, Part,
    SurfaceChange, change_with,
};
use crate::{
    Grid, Progress,
    case::{Case, TimePoint},
    skeleton::{ForceSource, SkeletonCounts},
};

/// Every number of a change. Field names are stable.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChangeReport {
    /// The mask's id.
    pub mask: String,
    /// Label of the earlier date.
    pub from: String,
    /// Label of the later date.
    pub to: String,
    /// Volume at the earlier date.
    pub from_ml: f64,
    /// Volume at the later date.
    pub to_ml: f64,
    /// Active at both.
    pub kept_ml: f64,
    /// Active at the earlier only.
    pub gone_ml: f64,
    /// Active at the later only.
    pub new_ml: f64,
    /// What is special.
    pub flags: Vec<Flag>,
    /// Number of vectors: growth and recession together.
    pub vectors: usize,
    /// Outward vectors.
    pub growth: Lengths,
    /// Inward vectors.
    pub recession: Lengths,
    /// How many of the vectors are shorter than their uncertainty.
    pub within_uncertainty: usize,
    /// Voxels with a skeleton point.
    pub skeleton_points: u64,
    /// What can't be told from no change.
    pub uncertainty_mm: UncertaintyReport,
    /// Signed lengths, growth above 0; `None` without a vector.
    pub histogram: Option<Histogram>,
    /// For comparison: from the same voxels to the nearest voxel of the other surface.
    pub nearest: NearestReport,
    /// Components matched across the dates.
    pub components: Vec<GroupReport>,
    /// What was counted on the way.
    pub counters: Counters,
}

/// Distances to the nearest voxel of the other surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NearestReport {
    /// From voxels with outward vectors.
    pub growth: Lengths,
    /// From voxels with inward vectors.
    pub recession: Lengths,
}

/// The uncertainty along the voxel axes, and what it is made of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UncertaintyReport {
    /// Along each voxel axis.
    pub axes_mm: [f64; 3],
    /// The registration error taken.
    pub registration_mm: f64,
    /// Coverage factor.
    pub coverage: f64,
    /// How it is computed.
    pub formula: &'static str,
}

/// Counters of the kernels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Counters {
    /// Of the surfaces.
    pub surface: ChangeCounts,
    /// Of the skeleton.
    pub skeleton: SkeletonCounts,
    /// What summed the skeleton's force, and why not another.
    pub force: String,
}

/// One group of components.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroupReport {
    /// What became of them.
    pub fate: Fate,
    /// Those of the earlier date.
    pub from: Vec<PartReport>,
    /// Those of the later date.
    pub to: Vec<PartReport>,
    /// Active at both dates.
    pub kept_ml: f64,
    /// Outward vectors.
    pub growth: Lengths,
    /// Inward vectors.
    pub recession: Lengths,
}

/// One component.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PartReport {
    /// Voxels.
    pub voxels: u64,
    /// Their volume.
    pub volume_ml: f64,
    /// Mean of the voxel centres.
    pub centroid_mm: [f64; 3],
}

impl PartReport {
    fn of(part: &Part) -> Self {
        Self { voxels: part.voxels, volume_ml: part.volume_ml, centroid_mm: part.centroid_mm.to_array() }
    }
}

/// Growth, recession.
fn both_ways<'a>(
    vectors: impl Iterator<Item = &'a SurfaceChange>,
    length_mm: impl Fn(&SurfaceChange) -> f64,
) -> (Lengths, Lengths) {
    let (out, inward): (Vec<_>, Vec<_>) =
        vectors.map(|v| (v.signed_mm > 0.0, length_mm(v))).partition(|(grows, _)| *grows);
    let lengths = |list: Vec<(bool, f64)>| Lengths::of(list.into_iter().map(|(_, l)| l).collect());
    (lengths(out), lengths(inward))
}

/// All numbers of `change`, which is of `mask` on `grid` between two dates.
pub fn report(change: &Change, grid: &Grid, mask: &str, from: &str, to: &str) -> ChangeReport {
    let (growth, recession) = both_ways(change.vectors.iter(), |v| v.signed_mm.abs());
    let nearest = both_ways(change.vectors.iter(), |v| v.nearest_mm);
    let m = grid.world_from_voxel().matrix3;
    let mut by_group: Vec<Vec<&SurfaceChange>> = vec![Vec::new(); change.groups.len()];
    change.vectors.iter().for_each(|v| by_group[v.group as usize].push(v));
    let components = change.groups.iter().zip(by_group).map(|(group, vectors)| {
        let (growth, recession) = both_ways(vectors.into_iter(), |v| v.signed_mm.abs());
        GroupReport {
            fate: group.fate,
            from: group.before.iter().map(PartReport::of).collect(),
            to: group.after.iter().map(PartReport::of).collect(),
            kept_ml: grid.volume_ml(group.kept_voxels),
            growth,
            recession,
        }
    });
    ChangeReport {
        mask: mask.to_owned(),
        from: from.to_owned(),
        to: to.to_owned(),
        from_ml: grid.volume_ml(change.kept_voxels + change.gone_voxels),
        to_ml: grid.volume_ml(change.kept_voxels + change.new_voxels),
        kept_ml: grid.volume_ml(change.kept_voxels),
        gone_ml: grid.volume_ml(change.gone_voxels),
        new_ml: grid.volume_ml(change.new_voxels),
        flags: change.flags.clone(),
        vectors: change.vectors.len(),
        growth,
        recession,
        within_uncertainty: change.vectors.iter().filter(|v| v.flags.within_uncertainty).count(),
        skeleton_points: change.skeleton_voxels,
        uncertainty_mm: UncertaintyReport {
            axes_mm: [m.x_axis, m.y_axis, m.z_axis].map(|axis| change.uncertainty.along(axis)),
            registration_mm: change.uncertainty.registration_mm,
            coverage: COVERAGE,
            formula: "coverage * sqrt(voxel_mm^2 / 6 + registration_mm^2), voxel_mm along the vector",
        },
        histogram: Histogram::of(change.vectors.iter().map(|v| v.signed_mm)),
        nearest: NearestReport { growth: nearest.0, recession: nearest.1 },
        components: components.collect(),
        counters: Counters {
            surface: change.counts,
            skeleton: change.skeleton.counts,
            force: change.skeleton.force.to_string(),
        },
    }
}

/// Every vector, then every outer surface voxel without a partner, one a line; lengths in
/// millimetres, places in RAS+ millimetres, what isn't known is empty.
pub fn csv(change: &Change) -> String {
    let mut text = String::from(
        "voxel_i,voxel_j,voxel_k,from_x_mm,from_y_mm,from_z_mm,to_x_mm,to_y_mm,to_z_mm,signed_mm,\
         nearest_mm,uncertainty_mm,within_uncertainty,no_set,component,fate\n",
    );
    let place = |p: DVec3| format!("{},{},{}", p.x, p.y, p.z);
    let fate = |group: u32| match change.groups.get(group as usize).map(|g| g.fate) {
        Some(Fate::Matched) => "matched",
        Some(Fate::Vanished) => "vanished",
        Some(Fate::Appeared) => "appeared",
        Some(Fate::Split) => "split",
        Some(Fate::Merged) => "merged",
        Some(Fate::Regrouped) => "regrouped",
        None => "",
    };
    // Writing into a String can't fail.
    for v in &change.vectors {
        let [i, j, k] = v.voxel;
        let _ = writeln!(
            text,
            "{i},{j},{k},{},{},{},{},{},{},{},{},{}",
            place(v.from_mm),
            place(v.to_mm),
            v.signed_mm,
            v.nearest_mm,
            v.uncertainty_mm,
            u8::from(v.flags.within_uncertainty),
            u8::from(v.flags.no_set),
            v.group,
            fate(v.group)
        );
    }
    for v in &change.unpartnered {
        let [i, j, k] = v.voxel;
        let here = place(v.position_mm);
        let (from, to) = if v.appeared { (",,", here.as_str()) } else { (here.as_str(), ",,") };
        let nearest = v.nearest_mm.map(|d| d.to_string()).unwrap_or_default();
        let _ = writeln!(text, "{i},{j},{k},{from},{to},,{nearest},,,,{},{}", v.group, fate(v.group));
    }
    text
}

/// The change of mask `of` between two dates of `case`, with its id and the dates' labels. `of` may
/// be left out where all masks have one id, the dates where there are two.
///
/// # Errors
/// [`ChangeError::Choice`] for what the case doesn't have; else as [`super::change`].
pub fn between(
    case: &Case,
    of: Option<&str>,
    from: Option<&str>,
    to: Option<&str>,
    options: &ChangeOptions,
    progress: &Progress,
) -> Result<(ChangeReport, Change), ChangeError> {
    between_with(case, (of, from, to), options, None, progress)
}

/// As [`between`], for mask and dates `(of, from, to)`, with the skeleton's force from `source` where
/// there is one and it can.
///
/// # Errors
/// As [`between`].
pub fn between_with(
    case: &Case,
    (of, from, to): (Option<&str>, Option<&str>, Option<&str>),
    options: &ChangeOptions,
    source: Option<&dyn ForceSource>,
    progress: &Progress,
) -> Result<(ChangeReport, Change), ChangeError> {
    let wrong =
        |found: String, expected: String| ChangeError::Choice { case: case.name.clone(), found, expected };
    let labels = || case.time_points.iter().map(|t| t.label.as_str()).collect::<Vec<_>>().join(", ");
    let (first, last) = match case.time_points.as_slice() {
        [first, last] => (Some(first), Some(last)),
        [] | [_] => {
            let found = format!("{} time point", case.time_points.len());
            return Err(wrong(found, "at least two dates to compare".into()));
        }
        _ => (None, None),
    };
    let time = |asked: Option<&str>, alone: Option<&'_ TimePoint>, option: &str| match asked {
        Some(label) => (case.time_points.iter().position(|t| t.label == label))
            .ok_or_else(|| wrong(format!("no date {label}"), format!("one of {}", labels()))),
        None => (case.time_points.iter().position(|t| alone.is_some_and(|a| std::ptr::eq(a, t))))
            .ok_or_else(|| wrong(format!("no {option}"), format!("one of {}", labels()))),
    };
    let (from, to) = (time(from, first, "--from")?, time(to, last, "--to")?);
    let (earlier, later) = (&case.time_points[from], &case.time_points[to]);
    if from == to {
        return Err(wrong(format!("{} twice", earlier.label), "two different dates".into()));
    }
    let mut ids: Vec<&str> = Vec::new();
    for mask in case.time_points.iter().flat_map(|t| &t.masks) {
        if !ids.contains(&mask.mask.id()) {
            ids.push(mask.mask.id());
        }
    }
    let id = match (of, ids.as_slice()) {
        (Some(id), _) => id,
        (None, [id]) => id,
        (None, _) => return Err(wrong("no --of".into(), format!("one of {}", ids.join(", ")))),
    };
    let mask = |time: &TimePoint| {
        time.masks.iter().position(|m| m.mask.id() == id).ok_or_else(|| {
            let there: Vec<&str> = time.masks.iter().map(|m| m.mask.id()).collect();
            wrong(format!("no mask {id} at {}", time.label), format!("one of {}", there.join(", ")))
        })
    };
    let (before, after) = (&earlier.masks[mask(earlier)?].mask, &later.masks[mask(later)?].mask);
    let found = change_with(before.bits(), after.bits(), &case.grid, options, source, progress)?;
    Ok((report(&found, &case.grid, id, &earlier.label, &later.label), found))
}
