//! The change report: the numbers that `change --json` and `--csv` write.

use glam::DVec3;
use serde::Serialize;

use super::{
    COVERAGE, Call, Change, ChangeCounts, ChangeError, ChangeOptions, Choice, Displacement, Explains, Fate,
    Flag, Histogram, Lengths, Part, Sampling, SurfaceChange, Surroundings, SurroundingsReport, Tissue,
    TissueReport, change_with, mean_move_mm, surroundings,
};
use crate::{
    Check, Grid, Progress,
    case::{Aligned, Case, P95_OF_UNIT_ERRORS, apart_mm},
    csv::Table,
    decimal,
    register::DeformOptions,
    skeleton::{ForceSource, SkeletonCounts},
};

/// All numbers of a change. Field names are stable.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChangeReport {
    /// The mask's id.
    pub mask: String,
    /// Label of the earlier time point.
    pub from: String,
    /// Label of the later time point.
    pub to: String,
    /// Volume at the earlier time point.
    pub from_ml: f64,
    /// Volume at the later time point.
    pub to_ml: f64,
    /// Volume active at both time points; `None` where only volumes are compared.
    pub kept_ml: Option<f64>,
    /// Volume active only at the earlier time point; likewise.
    pub gone_ml: Option<f64>,
    /// Volume active only at the later time point; likewise.
    pub new_ml: Option<f64>,
    /// Flags of the pair of masks.
    pub flags: Vec<Flag>,
    /// Number of vectors: growth and recession together.
    pub vectors: usize,
    /// Lengths of outward vectors.
    pub growth: Lengths,
    /// Lengths of inward vectors.
    pub recession: Lengths,
    /// Mean movement of the surface by the vectors, growth positive: see [`super::mean_move_mm`].
    pub mean_mm: Option<f64>,
    /// Number of vectors shorter than their uncertainty.
    pub within_uncertainty: usize,
    /// What is called of the change as a whole.
    pub call: Call,
    /// Number of voxels that contain a skeleton point.
    pub skeleton_points: u64,
    /// Uncertainty: shorter lengths can't be distinguished from no change.
    pub uncertainty_mm: UncertaintyReport,
    /// Histogram of signed lengths, growth positive; `None` without vectors.
    pub histogram: Option<Histogram>,
    /// For comparison: distances from the same places to the nearest place of the other surface.
    pub nearest: NearestReport,
    /// The cavities and their walls.
    pub cavities: CavitiesReport,
    /// Components matched across the time points; empty where the masks share no voxel.
    pub components: Vec<GroupReport>,
    /// How the tissue around the components was looked at; `None` where it wasn't.
    pub surroundings: Option<SurroundingsReport>,
    /// Counters of the algorithms.
    pub counters: Counters,
    /// The images and masks of the case that registration transforms moved.
    pub aligned: Vec<Aligned>,
    /// All findings about the case, most severe first; empty for masks without a case.
    pub warnings: Vec<Check>,
}

fn has_volumes_only(flags: &[Flag]) -> bool {
    flags.contains(&Flag::NoOverlap) || flags.contains(&Flag::NotAligned)
}

impl ChangeReport {
    /// Whether only volumes are compared: the masks share no place, or aren't aligned.
    pub fn has_volumes_only(&self) -> bool {
        has_volumes_only(&self.flags)
    }

    /// The findings that the comparison made, without those of `case`, which it was made of.
    pub fn own_warnings(&self, case: &Case) -> &[Check] {
        self.warnings.strip_suffix(case.checks.as_slice()).unwrap_or(&self.warnings)
    }
}

/// Distances to the nearest place of the other surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NearestReport {
    /// From voxels with outward vectors.
    pub growth: Lengths,
    /// From voxels with inward vectors.
    pub recession: Lengths,
    /// Mean movement of the surface by these distances, growth positive: see [`super::mean_move_mm`].
    pub mean_mm: Option<f64>,
}

/// Cavities, and how far their walls moved to the nearest wall of the other time point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CavitiesReport {
    /// Volume at the earlier time point.
    pub from_ml: f64,
    /// Volume at the later time point.
    pub to_ml: f64,
    /// Where a cavity widened: the mask receded from it.
    pub widened: Lengths,
    /// Where a cavity narrowed: the mask grew into it.
    pub narrowed: Lengths,
}

/// The uncertainty along the voxel axes, and its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UncertaintyReport {
    /// Along each axis of the case grid.
    pub axes_mm: [f64; 3],
    /// Registration error used: standard deviation.
    pub registration_mm: f64,
    /// Where it is from: `stated`, or `consistency` of the registration that was run.
    pub registration_from: &'static str,
    /// Coverage factor.
    pub coverage: f64,
    /// Its formula.
    pub formula: &'static str,
}

/// Counters of the algorithms.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Counters {
    /// Counters of the surfaces.
    pub surface: ChangeCounts,
    /// Counters of the skeleton.
    pub skeleton: SkeletonCounts,
    /// What computed the skeleton's force; if a source refused, why.
    pub force: String,
}

/// One group of components.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroupReport {
    /// What became of them.
    pub fate: Fate,
    /// Whether all are smaller than the smallest that counts: no flag tells of them.
    pub small: bool,
    /// Components of the earlier time point.
    pub from: Vec<PartReport>,
    /// Components of the later time point.
    pub to: Vec<PartReport>,
    /// Volume active at both time points.
    pub kept_ml: f64,
    /// Lengths of outward vectors.
    pub growth: Lengths,
    /// Lengths of inward vectors.
    pub recession: Lengths,
    /// Their own displacement; `None` where none is sought: but for a component that advances on one side as it recedes on another.
    pub displacement: Option<DisplacementReport>,
    /// Whether the tissue around them moved with their surface; `None` where it wasn't looked at or nothing is to be explained.
    pub tissue: Option<TissueReport>,
}

/// A component's own displacement between the dates: see [`Displacement`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DisplacementReport {
    /// Its length.
    pub length_mm: f64,
    /// From the earlier to the later date, RAS+ millimetres.
    pub by_mm: [f64; 3],
    /// Shorter ones can't be told from none.
    pub uncertainty_mm: f64,
    /// Smaller differences of the volumes can't be told from none.
    pub volume_uncertainty_ml: f64,
    /// What is left after it: share of the later surface outside the earlier one by more than its uncertainty.
    pub grew_share: f64,
    /// Likewise of the earlier surface outside the later one.
    pub shrank_share: f64,
    /// Mean movement of the surface that is left, growth positive.
    pub left_mm: f64,
    /// What it explains.
    pub explains: Explains,
}

impl DisplacementReport {
    fn of(found: &Displacement) -> Self {
        let Displacement { by_mm, uncertainty_mm, volume_uncertainty_ml, .. } = *found;
        Self {
            length_mm: by_mm.length(),
            by_mm: by_mm.to_array(),
            uncertainty_mm,
            volume_uncertainty_ml,
            grew_share: found.grew_share,
            shrank_share: found.shrank_share,
            left_mm: found.left_mm,
            explains: found.explains,
        }
    }
}

/// One component.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PartReport {
    /// Number of voxels.
    pub voxels: u64,
    /// Their volume.
    pub volume_ml: f64,
    /// Mean of the voxel centres, world millimetres.
    pub centroid_mm: [f64; 3],
}

impl PartReport {
    fn of(part: &Part) -> Self {
        Self { voxels: part.voxels, volume_ml: part.volume_ml, centroid_mm: part.centroid_mm.to_array() }
    }
}

/// Lengths of growth and of recession.
fn growth_and_recession<'a>(
    vectors: impl Iterator<Item = &'a SurfaceChange>,
    length_mm: impl Fn(&SurfaceChange) -> f64,
) -> (Lengths, Lengths) {
    let (outward, inward): (Vec<_>, Vec<_>) =
        vectors.map(|v| (v.signed_mm > 0.0, length_mm(v))).partition(|(grows, _)| *grows);
    let lengths = |list: Vec<(bool, f64)>| Lengths::of(list.into_iter().map(|(_, l)| l).collect());
    (lengths(outward), lengths(inward))
}

/// All numbers of `change`, computed for `mask` on `grid` between the time points `from` and `to`.
pub fn report(change: &Change, grid: &Grid, mask: &str, from: &str, to: &str) -> ChangeReport {
    let (growth, recession) = growth_and_recession(change.vectors.iter(), |v| v.signed_mm.abs());
    let nearest = growth_and_recession(change.vectors.iter(), |v| v.nearest_mm);
    let m = grid.world_from_voxel().matrix3;
    let mut by_group: Vec<Vec<&SurfaceChange>> = vec![Vec::new(); change.groups.len()];
    change.vectors.iter().for_each(|v| by_group[v.group as usize].push(v));
    let walls = |sign: f64| {
        Lengths::of(change.cavities.signed_mm.iter().map(|mm| mm * sign).filter(|mm| *mm > 0.0).collect())
    };
    let displacements = change.displacements.iter().chain(std::iter::repeat(&None));
    let components =
        change.groups.iter().zip(by_group).zip(displacements).map(|((group, vectors), moved)| {
            let (growth, recession) = growth_and_recession(vectors.into_iter(), |v| v.signed_mm.abs());
            GroupReport {
                fate: group.fate,
                small: group.is_small,
                from: group.before.iter().map(PartReport::of).collect(),
                to: group.after.iter().map(PartReport::of).collect(),
                kept_ml: grid.volume_ml(group.kept_voxels),
                growth,
                recession,
                displacement: moved.as_ref().map(DisplacementReport::of),
                tissue: None,
            }
        });
    let in_place = |voxels: u64| (!has_volumes_only(&change.flags)).then(|| grid.volume_ml(voxels));
    ChangeReport {
        mask: mask.to_owned(),
        from: from.to_owned(),
        to: to.to_owned(),
        from_ml: grid.volume_ml(change.kept_voxels + change.gone_voxels),
        to_ml: grid.volume_ml(change.kept_voxels + change.new_voxels),
        kept_ml: in_place(change.kept_voxels),
        gone_ml: in_place(change.gone_voxels),
        new_ml: in_place(change.new_voxels),
        flags: change.flags.clone(),
        vectors: change.vectors.len(),
        growth,
        recession,
        mean_mm: mean_move_mm(change, |v| v.signed_mm.abs()),
        call: Call::of(change),
        within_uncertainty: change.vectors.iter().filter(|v| v.flags.within_uncertainty).count(),
        skeleton_points: change.skeleton_voxels,
        uncertainty_mm: UncertaintyReport {
            axes_mm: [m.x_axis, m.y_axis, m.z_axis].map(|axis| change.uncertainty.along(axis)),
            registration_mm: change.uncertainty.registration_mm,
            registration_from: "stated",
            coverage: COVERAGE,
            formula: "coverage * sqrt(from_voxel_mm^2 / 12 + to_voxel_mm^2 / 12 + resampling_mm^2 + registration_mm^2), each mask's own voxels; resampling: what resampling onto the case grid moved",
        },
        histogram: Histogram::of(change.vectors.iter().map(|v| v.signed_mm)),
        nearest: NearestReport {
            growth: nearest.0,
            recession: nearest.1,
            mean_mm: mean_move_mm(change, |v| v.nearest_mm),
        },
        cavities: CavitiesReport {
            from_ml: grid.volume_ml(change.cavities.from_voxels),
            to_ml: grid.volume_ml(change.cavities.to_voxels),
            widened: walls(1.0),
            narrowed: walls(-1.0),
        },
        components: components.collect(),
        surroundings: None,
        counters: Counters {
            surface: change.counts,
            skeleton: change.skeleton.counts,
            force: change.skeleton.force.to_string(),
        },
        aligned: Vec::new(),
        warnings: Vec::new(),
    }
}

/// What `surroundings` says of the vectors as words of the CSV.
fn tissue_words(found: Option<&Surroundings>) -> impl Iterator<Item = &'static str> {
    let said = found.into_iter().flat_map(|found| &found.tissue).map(|tissue| match tissue {
        Tissue::Within => "",
        Tissue::Moved => "moved",
        Tissue::Stayed => "stayed",
        Tissue::Unknown => "unknown",
    });
    said.chain(std::iter::repeat(""))
}

/// CSV with one row per vector, then one per outer surface voxel without a partner; lengths in millimetres, positions
/// in RAS+ millimetres, unknown values empty. The last column has what the tissue around says of a vector, where it was looked at.
pub fn csv(change: &Change, found: Option<&Surroundings>) -> Vec<u8> {
    let axes = ["x", "y", "z"];
    let head = ["voxel_i", "voxel_j", "voxel_k"].map(str::to_owned).into_iter();
    let head = head.chain(["from", "to"].into_iter().flat_map(|end| axes.map(|a| format!("{end}_{a}_mm"))));
    let rest = [
        "signed_mm",
        "nearest_mm",
        "uncertainty_mm",
        "within_uncertainty",
        "no_set",
        "component",
        "fate",
        "tissue",
    ];
    let mut table = Table::new(head.chain(rest.map(str::to_owned)));
    let fate = |group: u32| -> &'static str {
        change.groups.get(group as usize).map_or("", |group| group.fate.into())
    };
    let position_fields = |p: Option<DVec3>| match p {
        Some(p) => p.to_array().map(|mm| mm.to_string()),
        None => Default::default(),
    };
    let mut row = |voxel: [usize; 3],
                   [from, to]: [Option<DVec3>; 2],
                   numbers: [String; 5],
                   group: u32,
                   tissue: &str| {
        let voxel = voxel.map(|index| index.to_string());
        let group = [group.to_string(), fate(group).to_owned()];
        table.row(
            voxel
                .into_iter()
                .chain(position_fields(from))
                .chain(position_fields(to))
                .chain(numbers)
                .chain(group)
                .chain([tissue.to_owned()]),
        );
    };
    let zero_or_one = |flag: bool| u8::from(flag).to_string();
    for (v, tissue) in change.vectors.iter().zip(tissue_words(found)) {
        let numbers = [v.signed_mm, v.nearest_mm, v.uncertainty_mm].map(|mm| mm.to_string());
        let [signed, nearest, uncertainty] = numbers;
        let flags = [zero_or_one(v.flags.within_uncertainty), zero_or_one(v.flags.no_set)];
        let [within, no_set] = flags;
        let numbers = [signed, nearest, uncertainty, within, no_set];
        row(v.voxel, [Some(v.from_mm), Some(v.to_mm)], numbers, v.group, tissue);
    }
    for v in &change.unpartnered {
        let position = Some(v.position_mm);
        let ends = if v.appeared { [None, position] } else { [position, None] };
        let nearest = v.nearest_mm.map(|mm| mm.to_string()).unwrap_or_default();
        let unknown = String::new;
        row(v.voxel, ends, [unknown(), nearest, unknown(), unknown(), unknown()], v.group, "");
    }
    table.into_bytes()
}

/// Standard deviation along each axis of the registration between two dates, from the consistency of those that were run, or from
/// what their loops were off by where that is more;
/// `None` where none was. The 95th percentile of a distance whose parts are normal is 2.80 of it.
pub(crate) fn registration_mm(case: &Case, id: &str, times: [&str; 2]) -> Option<f64> {
    let of = |time: &str| {
        let moved = case.aligned.iter().find(|a| a.is_mask && a.id == id && a.time == time)?;
        moved.consistency_mm.map(|mm| mm.max(moved.loop_mm.unwrap_or(0.0)) / P95_OF_UNIT_ERRORS)
    };
    let known = times.map(of);
    known.iter().any(Option::is_some).then(|| known.iter().flatten().map(|mm| mm * mm).sum::<f64>().sqrt())
}

/// How many times as long as its shortest edge a voxel's longest may be for lengths to be within a fifth of the truth: of known
/// movements of 0.5 to 2 mm they were 0.84 to 1.17 at 3 times, 0.52 to 1.30 at 6 times (docs/self-check.md).
const MOST_ELONGATED: f64 = 3.5;

/// What is to be said of lengths where a mask's own voxels are far longer than wide.
fn coarse(id: &str, samplings: &[Sampling; 2]) -> Option<Check> {
    let edges = samplings.iter().map(Sampling::native_edges_mm);
    let [short, long] = edges.max_by(|a, b| (a[1] / a[0]).total_cmp(&(b[1] / b[0])))?;
    (long > MOST_ELONGATED * short).then(|| {
        let [times, long, short] = [(long / short, 1), (long, 2), (short, 2)].map(|(n, places)| decimal::text(n, places));
        let text = format!(
            "{id}: found voxels {times} times as long as wide ({long} and {short} mm), expected at most {MOST_ELONGATED} times: lengths of \
             movements below {long} mm are uncertain, of known ones between half and 1.3 times were found; compare volumes"
        );
        Check::warning("lengths-uncertain", text)
    })
}

/// Computes the change of `choice`, with the skeleton's force computed by `source` if there is one and it doesn't
/// refuse.
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
        [earlier, later].map(|time| time.masks.iter().find(|m| m.mask.id() == id))
    else {
        return Err(ChangeError::no_common_mask(case, dates));
    };
    let samplings = [before, after].map(|m| Sampling::new(&m.native_grid, &case.grid));
    let bits = [before, after].map(|m| m.mask.bits());
    let frames = [before, after].map(|m| m.frame_of_reference.as_str());
    let is_aligned = frames[0] == frames[1] || frames.iter().any(|frame| frame.is_empty());
    let apart = if options.is_aligned && is_aligned { apart_mm(case, dates, progress)? } else { None };
    let is_aligned = is_aligned && apart.is_none();
    let measured =
        registration_mm(case, &id, [&earlier.label, &later.label]).filter(|_| options.uses_consistency);
    let options = ChangeOptions {
        is_aligned: options.is_aligned && is_aligned,
        registration_mm: measured.unwrap_or(options.registration_mm),
        ..*options
    };
    let found = change_with(bits[0], bits[1], &case.grid, samplings, &options, source, progress)?;
    let mut report = report(&found, &case.grid, &id, &earlier.label, &later.label);
    if measured.is_some() {
        report.uncertainty_mm.registration_from = "consistency";
    }
    let [from, to] = [&earlier.label, &later.label];
    let mut warnings = Vec::new();
    if found.flags.contains(&Flag::NotAligned) {
        let what = match &apart {
            Some((mm, image)) => {
                format!("{mm:.0} mm apart at the tumour, by their images {image}, as they lie now")
            }
            None => "in two frames of reference".to_owned(),
        };
        let text = format!(
            "{id}: found {from} and {to} {what}, expected dates in one space: register them (--register), give a \
             transform (--transform), or say that they are aligned (--one-space); only volumes are compared"
        );
        warnings.push(Check::warning("not-aligned", text));
    }
    if found.flags.contains(&Flag::NoOverlap) {
        let text = format!(
            "{id}: found no voxel that {from} and {to} share, expected two dates in one space: not aligned? Only \
             volumes are compared"
        );
        warnings.push(Check::warning("no-overlap", text));
    }
    warnings.extend(coarse(&id, &samplings).filter(|_| !found.vectors.is_empty()));
    warnings.extend_from_slice(&case.checks);
    Ok((ChangeReport { warnings, aligned: case.aligned.clone(), ..report }, found))
}

impl ChangeReport {
    /// With what the tissue around the lesions says.
    #[must_use]
    pub fn with_surroundings(self, found: &Surroundings) -> Self {
        let tissue = found.components.iter().copied().chain(std::iter::repeat(None));
        let components = self.components.into_iter().zip(tissue);
        let components = components.map(|(group, tissue)| GroupReport { tissue, ..group }).collect();
        Self { components, surroundings: Some(found.report.clone()), ..self }
    }
}

/// As [`between`], and looks at the tissue around what moved.
///
/// # Errors
/// As [`between`].
pub fn between_with_surroundings(
    case: &Case,
    choice: &Choice,
    options: &ChangeOptions,
    source: Option<&dyn ForceSource>,
    progress: &Progress,
) -> Result<(ChangeReport, Change, Surroundings), ChangeError> {
    let (report, change) = between(case, choice, options, source, progress)?;
    let found = surroundings(case, choice, &change, &DeformOptions::default(), progress)?;
    Ok((report.with_surroundings(&found), change, found))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_in_thick_slices_are_told_to_be_uncertain() {
        let of =
            |spacing: DVec3| Sampling::native(&Grid::axis_aligned([4; 3], spacing, DVec3::ZERO).unwrap());
        let [cube, third, sixth] = [1.0, 3.0, 6.0].map(|z| of(DVec3::new(1.0, 1.0, z)));
        assert_eq!(coarse("m", &[cube, third]), None);
        let told = coarse("m", &[sixth, cube]).unwrap();
        assert_eq!(told.code, "lengths-uncertain");
        assert!(
            told.message.starts_with("m: found voxels 6.0 times as long as wide (6.00 and 1.00 mm)"),
            "{told:?}"
        );
    }
}
