//! Lesion-wise metrics: connected components of a reference matched with those of another mask.

use std::collections::BTreeMap;

use crate::{
    Component, Components, Connectivity, MaskBits,
    components::TooLarge,
    distance::{Crop, DistanceError},
};
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::{
    bits::dilated,
    convention::{BRATS_MISSED_MM, ConventionRow, Lesions},
    distances::SurfaceDistances,
    number::number,
    overlap::Overlap,
};

/// Jaccard index from which panoptica's default matches two lesions. Each has at most one such partner.
const MATCHED_JACCARD: f64 = 0.5;

/// Which lesions of the reference BraTS 2023 joins and which it leaves out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LesionRule {
    /// Times that the reference is dilated by its 18 neighbours before its lesions are told apart.
    pub dilations: usize,
    /// Reference lesions up to this volume don't count, whether found or not.
    pub ignored_mm3: f64,
}

impl LesionRule {
    /// Adult glioma (also sub-Saharan Africa and paediatric).
    pub const GLIOMA: Self = Self { dilations: 3, ignored_mm3: 50.0 };
    /// Meningioma.
    pub const MENINGIOMA: Self = Self { dilations: 1, ignored_mm3: 50.0 };
    /// Metastases.
    pub const METASTASES: Self = Self { dilations: 1, ignored_mm3: 2.0 };
}

/// Lesions of a reference and of a mask compared with it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LesionReport {
    /// Lesions of the reference that were found.
    pub found: u64,
    /// Lesions of the reference that were missed.
    pub missed: u64,
    /// Lesions of the compared mask that are none of the reference's.
    pub false_positives: u64,
    /// Lesions of the reference too small to count; 0 by panoptica.
    pub ignored: u64,
    /// F1 of detection, also called recognition quality (RQ): `2·found / (2·found + missed + false_positives)`. `None` without
    /// lesions.
    pub f1: Option<f64>,
    /// Segmentation quality (SQ): mean Jaccard index of matched lesions, 0 where none match. `None` without lesions, and by BraTS.
    pub sq: Option<f64>,
    /// Panoptic quality: `f1·sq`.
    pub pq: Option<f64>,
    /// Mean Dice. By BraTS over counted reference lesions and false positives (which have 0), 1 without any; by panoptica
    /// over matched ones, 0 where none match, `None` without lesions.
    pub dice: Option<f64>,
    /// Mean robust Hausdorff distance over the same lesions. By BraTS 374 mm for missed lesions and false positives, 0 without
    /// any; by panoptica infinite where none match.
    #[serde(serialize_with = "number")]
    pub hd_percentile_mm: Option<f64>,
}

/// Why lesions can't be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum LesionError {
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    #[error(transparent)]
    Distance(#[from] DistanceError),
}

/// What lesions are measured with.
pub(super) struct Measure {
    pub(super) row: &'static ConventionRow,
    pub(super) percentile: f64,
    pub(super) spacing_mm: DVec3,
    pub(super) rule: LesionRule,
}

/// Overlap and robust Hausdorff distance of one lesion; no distance where one part is empty.
type OfLesion = (Overlap, Option<f64>);

/// Compares lesions by the row's rule; `None` where it has none. Masks are of one size and hold a margin of
/// [`LesionRule::dilations`] voxels where the image has one.
pub(super) fn report(
    reference: &MaskBits,
    compared: &MaskBits,
    measure: &Measure,
) -> Result<Option<LesionReport>, LesionError> {
    match measure.row.lesions {
        Lesions::Dilated => dilated_report(reference, compared, measure).map(Some),
        Lesions::Overlapping => overlapping_report(reference, compared, measure).map(Some),
        Lesions::Absent => Ok(None),
    }
}

fn dilated_report(a: &MaskBits, b: &MaskBits, measure: &Measure) -> Result<LesionReport, LesionError> {
    // What is joined once dilated is one lesion. The dilation of a lesion is its component: all of it is near the lesion's voxels.
    let near = Components::of_mask(&dilated(a, measure.rule.dilations), Connectivity::TwentySix)?;
    let predicted = Components::of_mask(b, Connectivity::TwentySix)?;
    let mut partners: Vec<Vec<usize>> = vec![Vec::new(); near.list().len()];
    let mut touched = vec![false; predicted.list().len()];
    for (of_a, of_b) in shared_voxels(&near, &predicted, a.dims()).into_keys() {
        if let (Some(partners), Some(touched)) = (partners.get_mut(of_a), touched.get_mut(of_b)) {
            partners.push(of_b);
            *touched = true;
        }
    }
    let lesion = |(component, partners): (&Component, &Vec<usize>)| {
        let theirs: Vec<_> = partners.iter().filter_map(|&k| predicted.list().get(k)).collect();
        let boxed = bounding(theirs.iter().copied().chain([component]));
        let mut part = filled(&near, &[component], boxed);
        keep(&mut part, &boxed.part_of(a));
        of_parts(&part, &filled(&predicted, &theirs, boxed), measure)
    };
    let all = near.list().par_iter().zip(&partners).map(lesion).collect::<Result<Vec<_>, _>>()?;

    let volume_mm3 = |lesion: &OfLesion| lesion.0.reference as f64 * measure.spacing_mm.element_product();
    let counted: Vec<_> = all.iter().filter(|lesion| volume_mm3(lesion) > measure.rule.ignored_mm3).collect();
    let found = counted.iter().filter(|lesion| lesion.0.compared > 0).count() as u64;
    let missed = counted.len() as u64 - found;
    let false_positives = touched.iter().filter(|touched| !**touched).count() as u64;
    let n = counted.len() as f64 + false_positives as f64;
    let distance = |lesion: &OfLesion| lesion.1.unwrap_or(BRATS_MISSED_MM);
    let dice = counted.iter().map(|lesion| lesion.0.dice()).sum::<f64>() / n;
    let missed_mm = false_positives as f64 * BRATS_MISSED_MM;
    let distance_mm = (counted.iter().map(|lesion| distance(lesion)).sum::<f64>() + missed_mm) / n;
    Ok(LesionReport {
        found,
        missed,
        false_positives,
        ignored: (all.len() - counted.len()) as u64,
        f1: f1(found, missed, false_positives),
        sq: None,
        pq: None,
        dice: Some(if n > 0.0 { dice } else { 1.0 }),
        hd_percentile_mm: Some(if n > 0.0 { distance_mm } else { 0.0 }),
    })
}

fn overlapping_report(a: &MaskBits, b: &MaskBits, measure: &Measure) -> Result<LesionReport, LesionError> {
    let reference = Components::of_mask(a, Connectivity::TwentySix)?;
    let predicted = Components::of_mask(b, Connectivity::TwentySix)?;
    let pairs = shared_voxels(&reference, &predicted, a.dims());
    let lesion = |(&(of_a, of_b), &both): (&(usize, usize), &u64)| {
        let (ours, theirs) = (reference.list().get(of_a)?, predicted.list().get(of_b)?);
        let jaccard = both as f64 / (ours.voxels + theirs.voxels - both) as f64;
        (jaccard >= MATCHED_JACCARD).then_some((ours, theirs))
    };
    let matched: Vec<_> = pairs.iter().filter_map(lesion).collect();
    let of_pair = |&(ours, theirs): &(&Component, &Component)| {
        let boxed = bounding([ours, theirs].into_iter());
        of_parts(&filled(&reference, &[ours], boxed), &filled(&predicted, &[theirs], boxed), measure)
    };
    let all = matched.par_iter().map(of_pair).collect::<Result<Vec<_>, _>>()?;

    let found = all.len() as u64;
    let missed = reference.list().len() as u64 - found;
    let false_positives = predicted.list().len() as u64 - found;
    let f1 = f1(found, missed, false_positives);
    let mean = |of: &dyn Fn(&OfLesion) -> f64, unmatched: f64| {
        let mean = all.iter().map(of).sum::<f64>() / found as f64;
        f1.map(|_| if found > 0 { mean } else { unmatched })
    };
    let sq = mean(&|lesion| lesion.0.jaccard(), 0.0);
    Ok(LesionReport {
        found,
        missed,
        false_positives,
        ignored: 0,
        f1,
        sq,
        pq: f1.zip(sq).map(|(f1, sq)| f1 * sq),
        dice: mean(&|lesion| lesion.0.dice(), 0.0),
        // Matched lesions overlap: both have a surface.
        hd_percentile_mm: mean(&|lesion| lesion.1.unwrap_or(f64::INFINITY), f64::INFINITY),
    })
}

fn f1(found: u64, missed: u64, false_positives: u64) -> Option<f64> {
    let all = 2 * found + missed + false_positives;
    (all > 0).then(|| 2.0 * found as f64 / all as f64)
}

/// Voxels that a component of `a` shares with one of `b`, by their indices; only pairs that share some.
fn shared_voxels(a: &Components, b: &Components, dims: [usize; 3]) -> BTreeMap<(usize, usize), u64> {
    let labels = b.labels(dims);
    let mut shared = BTreeMap::new();
    for (index, component) in a.list().iter().enumerate() {
        for run in a.runs(component) {
            let line = (run.z as usize * dims[1] + run.y as usize) * dims[0];
            let voxels = labels.get(line + run.first as usize..=line + run.last as usize).unwrap_or(&[]);
            for same in voxels.chunk_by(|p, q| p == q) {
                if let Some(other) = same.first().and_then(|&label| (label as usize).checked_sub(1)) {
                    *shared.entry((index, other)).or_insert(0) += same.len() as u64;
                }
            }
        }
    }
    shared
}

/// The box around all components (at least one).
fn bounding<'a>(components: impl Iterator<Item = &'a Component>) -> Crop {
    let (mut start, mut end) = ([usize::MAX; 3], [0; 3]);
    for component in components {
        for axis in 0..3 {
            start[axis] = start[axis].min(component.start[axis]);
            end[axis] = end[axis].max(component.start[axis] + component.dims[axis]);
        }
    }
    Crop { start, dims: [0, 1, 2].map(|a| end[a] - start[a]) }
}

/// The voxels of `components`, all inside `boxed`.
fn filled(all: &Components, components: &[&Component], boxed: Crop) -> MaskBits {
    let mut bits = MaskBits::empty(boxed.dims);
    for run in components.iter().flat_map(|component| all.runs(component)) {
        let [y, z] = [run.y as usize - boxed.start[1], run.z as usize - boxed.start[2]];
        (run.first..=run.last).for_each(|x| bits.set([x as usize - boxed.start[0], y, z]));
    }
    bits
}

/// Makes voxels inactive that aren't active in `other`.
fn keep(bits: &mut MaskBits, other: &MaskBits) {
    bits.words_mut().iter_mut().zip(other.words()).for_each(|(word, other)| *word &= other);
}

fn of_parts(a: &MaskBits, b: &MaskBits, measure: &Measure) -> Result<OfLesion, DistanceError> {
    let overlap = Overlap::of(a, b);
    if overlap.empty().is_some() {
        return Ok((overlap, None));
    }
    let distances = SurfaceDistances::between(a, b, measure.spacing_mm, measure.row.surface)?;
    Ok((overlap, distances.percentile_mm(measure.percentile, measure.row.percentile)))
}
