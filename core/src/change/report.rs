//! The change of one mask of a case, and its numbers as `change --json` and `--csv` write them.

use glam::DVec3;
use serde::Serialize;

use super::{
    COVERAGE, Change, ChangeCounts, ChangeError, ChangeOptions, Choice, Fate, Flag, Histogram, Lengths, Part,
    SurfaceChange, change_with,
};
use crate::{
    Grid, Progress,
    case::Case,
    csv::Table,
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

/// Every vector, then every outer surface voxel without a partner, a row each; lengths in
/// millimetres, places in RAS+ millimetres, what isn't known is empty.
pub fn csv(change: &Change) -> Vec<u8> {
    let axes = ["x", "y", "z"];
    let head = ["voxel_i", "voxel_j", "voxel_k"].map(str::to_owned).into_iter();
    let head = head.chain(["from", "to"].into_iter().flat_map(|end| axes.map(|a| format!("{end}_{a}_mm"))));
    let rest =
        ["signed_mm", "nearest_mm", "uncertainty_mm", "within_uncertainty", "no_set", "component", "fate"];
    let mut table = Table::new(head.chain(rest.map(str::to_owned)));
    let fate = |group: u32| -> &'static str {
        change.groups.get(group as usize).map_or("", |group| group.fate.into())
    };
    let place = |p: Option<DVec3>| match p {
        Some(p) => p.to_array().map(|mm| mm.to_string()),
        None => Default::default(),
    };
    let mut row =
        |voxel: [usize; 3], from: Option<DVec3>, to: Option<DVec3>, numbers: [String; 5], group: u32| {
            let voxel = voxel.map(|index| index.to_string());
            let group = [group.to_string(), fate(group).to_owned()];
            table.row(voxel.into_iter().chain(place(from)).chain(place(to)).chain(numbers).chain(group));
        };
    let yes = |flag: bool| u8::from(flag).to_string();
    for v in &change.vectors {
        let numbers = [v.signed_mm, v.nearest_mm, v.uncertainty_mm].map(|mm| mm.to_string());
        let [signed, nearest, uncertainty] = numbers;
        let flags = [yes(v.flags.within_uncertainty), yes(v.flags.no_set)];
        let [within, no_set] = flags;
        let numbers = [signed, nearest, uncertainty, within, no_set];
        row(v.voxel, Some(v.from_mm), Some(v.to_mm), numbers, v.group);
    }
    for v in &change.unpartnered {
        let here = Some(v.position_mm);
        let (from, to) = if v.appeared { (None, here) } else { (here, None) };
        let nearest = v.nearest_mm.map(|mm| mm.to_string()).unwrap_or_default();
        let unknown = String::new;
        row(v.voxel, from, to, [unknown(), nearest, unknown(), unknown(), unknown()], v.group);
    }
    table.into_bytes()
}

/// The change that `choice` names, with the skeleton's force from `source` where there is one and it can.
///
/// # Errors
/// [`ChangeError::Choice`] for what the case doesn't have; else as [`super::change`].
pub fn between(
    case: &Case,
    choice: &Choice,
    options: &ChangeOptions,
    source: Option<&dyn ForceSource>,
    progress: &Progress,
) -> Result<(ChangeReport, Change), ChangeError> {
    let Choice { id, dates } = Choice::at(case, Some(&choice.id), choice.dates)?;
    let [earlier, later] = dates.map(|at| &case.time_points[at]);
    let [Some(before), Some(after)] =
        [earlier, later].map(|time| time.masks.iter().find(|m| m.mask.id() == id).map(|m| m.mask.bits()))
    else {
        return Err(ChangeError::NoCommonMask(case.name.clone()));
    };
    let found = change_with(before, after, &case.grid, options, source, progress)?;
    Ok((report(&found, &case.grid, &id, &earlier.label, &later.label), found))
}
