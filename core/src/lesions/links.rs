//! Which components of two dates may be one lesion.

use std::collections::BTreeMap;

use crate::{
    distance::{DistanceError, KdTree},
    glam::DVec3,
};
use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use super::parts::{CaseRun, DateParts};

/// How a link is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum LinkedBy {
    /// Both have a voxel of the case grid in common.
    Overlap,
    /// Neither overlaps anything of the other date, and each is the other's nearest.
    Distance,
    /// The user said so.
    Edit,
}

/// Whether a user looked at a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum LinkState {
    /// As found.
    Proposed,
    /// Made by the user.
    Edited,
    /// Confirmed by the user.
    Verified,
}

/// A part: number of the date among [`super::Found::times`], and number of the part at it.
pub(super) type Node = (usize, usize);

/// A link between parts of two dates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    pub(super) from: Node,
    pub(super) to: Node,
    /// How it is known.
    pub by: LinkedBy,
    /// Voxels of the case grid that both have; 0 for links by distance, `None` where the dates lie in different spaces.
    pub overlap_voxels: Option<u64>,
    /// Distance between the nearest centres of their voxels; of links by distance.
    pub distance_mm: Option<f64>,
    /// Whether a user looked at it.
    pub state: LinkState,
}

/// Number of voxels that each part of one date has in common with each of another. Both sorted.
pub(super) fn overlaps(earlier: &[CaseRun], later: &[CaseRun]) -> BTreeMap<(u32, u32), u64> {
    let mut shared: BTreeMap<(u32, u32), u64> = BTreeMap::new();
    let mut from = 0;
    for a in earlier {
        while later.get(from).is_some_and(|b| (b.line, b.last) < (a.line, a.first)) {
            from += 1;
        }
        for b in later.get(from..).unwrap_or_default() {
            if (b.line, b.first) > (a.line, a.last) {
                break;
            }
            let voxels = u64::from(a.last.min(b.last) - a.first.max(b.first)) + 1;
            *shared.entry((a.part, b.part)).or_default() += voxels;
        }
    }
    shared
}

/// The links between two consecutive dates that lie in one space.
///
/// A small part has one link to a date, that of its largest overlap: flecks join no two lesions.
pub(super) fn propose(
    dates: [usize; 2],
    [earlier, later]: [&DateParts; 2],
    within_mm: f64,
) -> Result<Vec<Link>, DistanceError> {
    let shared = overlaps(&earlier.case_runs, &later.case_runs);
    // Of equal overlaps the first.
    let mut largest: [BTreeMap<u32, (u64, u32)>; 2] = Default::default();
    for (&(a, b), &voxels) in &shared {
        for (of, part, other) in [(0, a, b), (1, b, a)] {
            let entry = largest[of].entry(part).or_insert((voxels, other));
            if voxels > entry.0 {
                *entry = (voxels, other);
            }
        }
    }
    let is_small = |date: &DateParts, part: u32| date.parts.get(part as usize).is_some_and(|part| part.small);
    let keeps = |of: usize, date: &DateParts, part: u32, other: u32| {
        !is_small(date, part) || largest[of].get(&part).is_some_and(|(_, best)| *best == other)
    };
    let mut links: Vec<Link> = shared
        .iter()
        .filter(|((a, b), _)| keeps(0, earlier, *a, *b) && keeps(1, later, *b, *a))
        .map(|(&(a, b), &voxels)| Link {
            from: (dates[0], a as usize),
            to: (dates[1], b as usize),
            by: LinkedBy::Overlap,
            overlap_voxels: Some(voxels),
            distance_mm: None,
            state: LinkState::Proposed,
        })
        .collect();
    links.extend(by_distance(dates, [earlier, later], &shared, within_mm)?);
    Ok(links)
}

/// Links between parts that overlap nothing of the other date, aren't small, and are nearest to each other, within
/// `within_mm`.
fn by_distance(
    dates: [usize; 2],
    [earlier, later]: [&DateParts; 2],
    shared: &BTreeMap<(u32, u32), u64>,
    within_mm: f64,
) -> Result<Vec<Link>, DistanceError> {
    let alone = |date: &DateParts, overlaps: &dyn Fn(u32) -> bool| -> Vec<usize> {
        let parts = (0..).zip(&date.parts);
        parts.filter(|(n, part)| !part.small && !overlaps(*n)).map(|(n, _)| n as usize).collect()
    };
    let [mut overlapping_earlier, mut overlapping_later] =
        [vec![false; earlier.parts.len()], vec![false; later.parts.len()]];
    for (a, b) in shared.keys() {
        for (list, part) in [(&mut overlapping_earlier, a), (&mut overlapping_later, b)] {
            if let Some(overlaps) = list.get_mut(*part as usize) {
                *overlaps = true;
            }
        }
    }
    let is_set = |list: &[bool], part: u32| list.get(part as usize).copied().unwrap_or(true);
    let from = alone(earlier, &|part| is_set(&overlapping_earlier, part));
    let to = alone(later, &|part| is_set(&overlapping_later, part));
    let nearest_later = nearest(earlier, &from, later, &to)?;
    let nearest_earlier = nearest(later, &to, earlier, &from)?;
    let mutual = nearest_later.iter().filter_map(|(&a, &(mm, b))| {
        let is_mutual = nearest_earlier.get(&b).is_some_and(|(_, back)| *back == a);
        (is_mutual && mm <= within_mm).then_some((a, b, mm))
    });
    let link = |(a, b, mm)| Link {
        from: (dates[0], a),
        to: (dates[1], b),
        by: LinkedBy::Distance,
        overlap_voxels: Some(0),
        distance_mm: Some(mm),
        state: LinkState::Proposed,
    };
    Ok(mutual.map(link).collect())
}

/// The nearest of `others` to each of `parts`, by the nearest centres of voxels; of equally near ones the first.
fn nearest(
    date: &DateParts,
    parts: &[usize],
    other: &DateParts,
    others: &[usize],
) -> Result<BTreeMap<usize, (f64, usize)>, DistanceError> {
    let of = |date: &DateParts, numbers: &[usize]| -> Vec<(DVec3, usize)> {
        let parts = numbers.iter().filter_map(|n| Some((n, date.parts.get(*n)?)));
        parts.flat_map(|(n, part)| part.centers_mm(&date.grid).map(|p| (p, *n)).collect::<Vec<_>>()).collect()
    };
    let targets = of(other, others);
    let points: Vec<DVec3> = targets.iter().map(|(p, _)| *p).collect();
    let Some(tree) = KdTree::new(&points)? else { return Ok(BTreeMap::new()) };
    let mut best: BTreeMap<usize, (f64, usize)> = BTreeMap::new();
    for (p, part) in of(date, parts) {
        let found = tree.nearest(p).and_then(|(at, mm)| Some((mm, targets.get(at)?.1)));
        if let Some(found) = found {
            let entry = best.entry(part).or_insert(found);
            if found < *entry {
                *entry = found;
            }
        }
    }
    Ok(best)
}
