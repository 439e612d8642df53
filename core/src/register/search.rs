//! The rough alignment: a lattice of poses at the coarsest level, the best of them refined.

use crate::{Cancelled, Progress};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use rayon::prelude::*;

use super::{
    mutual,
    pair::{Keep, Pair, overlap_share, points},
    pose::{apart_mm, half_way, rotated},
    pyramid::Pyramid,
    quasi_newton::{Climb, Climbed},
    types::Model,
};

/// Angles tried about each axis, degrees, and shifts along each, mm.
const ANGLES_DEGREES: [f64; 3] = [-20.0, 0.0, 20.0];
const SHIFTS_MM: [f64; 3] = [-24.0, 0.0, 24.0];
/// Points compared at each pose of the lattice, at most.
const LATTICE_POINTS: usize = 3000;
/// Bins at the coarse levels.
const COARSE_BINS: usize = 24;
/// Poses of the lattice that are refined, and refined ones that are refined again at the next level.
const REFINED: usize = 16;
const KEPT: usize = 6;
/// Poses closer than this, within the foreground's radius, are one.
const SAME_MM: f64 = 6.0;
/// Farthest that a candidate may be from a start: the lattice's reach and what refining adds.
pub(crate) const MAX_TURN_DEGREES: f64 = 45.0;
pub(crate) const MAX_SHIFT_MM: f64 = 60.0;
/// Overlap below which a pose isn't a candidate.
pub(crate) const MIN_OVERLAP: f64 = 0.3;

/// Alignments found, the best first, each another by at least [`SAME_MM`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    pub candidates: Vec<Climbed>,
    pub evaluations: usize,
    /// Largest overlap share among the poses refined.
    pub largest_overlap: f64,
    /// Whether a refined pose was dropped because it left the searched range.
    pub left_range: bool,
}

/// A pose of the lattice and what it scored; `base` is that of its start.
#[derive(Clone, Copy, Debug)]
struct Scored {
    value: f64,
    pose: DAffine3,
    base: usize,
}

/// What a search runs on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search<'a> {
    pub fixed: &'a Pyramid,
    pub moving: &'a Pyramid,
    pub seed: u64,
}

impl Search<'_> {
    /// Searches around `bases` (poses of centred mm) at the coarsest level, then refines there and at the next.
    pub fn run(&self, bases: &[DAffine3], progress: &Progress) -> Result<Found, Cancelled> {
        let mut found = Found::default();
        let mut scored = Vec::new();
        for (base, start) in bases.iter().enumerate() {
            let poses = poses_around(*start, self.fixed.mass_centre_mm);
            let values = self.score(*start, &poses, progress)?;
            found.evaluations += poses.len();
            let with_value = values.into_iter().zip(poses);
            scored.extend(
                with_value.filter_map(|(value, pose)| value.map(|value| Scored { value, pose, base })),
            );
        }
        scored.sort_by(|a, b| b.value.total_cmp(&a.value));
        scored.truncate(REFINED);
        let lattices: Vec<Vec<DVec3>> =
            bases.iter().map(|base| self.lattice(*base, 4.0, 2 * LATTICE_POINTS, 20.0)).collect();
        let coarse = |s: &Scored| self.climb(0, &lattices[s.base], 4.0, 0.2).run(s.pose, progress);
        let climbed = scored.par_iter().map(coarse).collect::<Result<Vec<_>, _>>()?;
        self.add(&mut found, climbed, bases);
        if self.fixed.levels.len() < 2 {
            return Ok(found);
        }
        let rough = std::mem::take(&mut found.candidates);
        let refine = |start: &Climbed| {
            let Some(half) = half_way(start.pose, Model::Rigid) else { return Ok(None) };
            let beside = points(
                self.fixed,
                self.moving,
                &half,
                4.0,
                5 * LATTICE_POINTS,
                Keep::Foreground,
                8.0,
                self.seed,
            );
            self.climb(1, &beside, 2.0, 0.05).run(start.pose, progress)
        };
        let climbed = rough.par_iter().take(KEPT).map(refine).collect::<Result<Vec<_>, _>>()?;
        self.add(&mut found, climbed, bases);
        Ok(found)
    }

    /// The best score among shifts of one start, without turning it.
    pub fn best_shift(&self, base: DAffine3, progress: &Progress) -> Result<Option<f64>, Cancelled> {
        let poses: Vec<DAffine3> =
            triples(SHIFTS_MM).map(|shift| base * DAffine3::from_translation(shift)).collect();
        let values = self.score(base, &poses, progress)?;
        Ok(values.into_iter().flatten().reduce(f64::max))
    }

    fn score(
        &self,
        base: DAffine3,
        poses: &[DAffine3],
        progress: &Progress,
    ) -> Result<Vec<Option<f64>>, Cancelled> {
        let (Some(fixed), Some(moving)) = (self.fixed.levels.first(), self.moving.levels.first()) else {
            return Ok(Vec::new());
        };
        let lattice = self.lattice(base, 6.0, LATTICE_POINTS, 10.0);
        let curves = (&self.fixed.curve, &self.moving.curve);
        let of = |pose: &DAffine3| {
            progress.check()?;
            let half = half_way(*pose, Model::Rigid);
            Ok(half.and_then(|half| {
                mutual::value(&Pair::new(fixed, moving, &half), &lattice, COARSE_BINS, curves)
            }))
        };
        poses.par_iter().map(of).collect()
    }

    fn lattice(&self, base: DAffine3, spacing_mm: f64, most: usize, margin_mm: f64) -> Vec<DVec3> {
        let half = half_way(base, Model::Rigid);
        half.map_or_else(Vec::new, |half| {
            points(self.fixed, self.moving, &half, spacing_mm, most, Keep::All, margin_mm, self.seed)
        })
    }

    fn climb<'b>(
        &'b self,
        index: usize,
        points: &'b [DVec3],
        first_step_mm: f64,
        tolerance_mm: f64,
    ) -> Climb<'b> {
        Climb {
            fixed: &self.fixed.levels[index],
            moving: &self.moving.levels[index],
            points,
            bins: COARSE_BINS,
            curves: (&self.fixed.curve, &self.moving.curve),
            model: Model::Rigid,
            first_step_mm,
            tolerance_mm,
            rest_mm: 0.0,
            most_steps: 25,
            radius_mm: self.radius_mm(),
        }
    }

    fn radius_mm(&self) -> f64 {
        self.fixed.radius_mm.min(self.moving.radius_mm)
    }

    fn add(&self, found: &mut Found, climbed: Vec<Option<Climbed>>, bases: &[DAffine3]) {
        let mut all: Vec<Climbed> = climbed.into_iter().flatten().collect();
        found.evaluations += all.iter().map(|c| c.evaluations).sum::<usize>();
        all.sort_by(|a, b| b.value.total_cmp(&a.value));
        for candidate in all {
            if !bases.iter().any(|base| is_near(*base, candidate.pose, self.fixed.mass_centre_mm)) {
                found.left_range = true;
                continue;
            }
            let Some(half) = half_way(candidate.pose, Model::Rigid) else { continue };
            let is_other = |c: &Climbed| apart_mm(c.pose, candidate.pose, self.radius_mm()) > SAME_MM;
            if !found.candidates.iter().all(is_other) {
                continue;
            }
            let share = overlap_share(self.fixed, self.moving, &half);
            found.largest_overlap = found.largest_overlap.max(share);
            if share >= MIN_OVERLAP {
                found.candidates.push(candidate);
            }
        }
    }
}

/// Rotations about the fixed foreground's centre and shifts, each followed by `base`.
fn poses_around(base: DAffine3, centre_mm: DVec3) -> Vec<DAffine3> {
    let mut poses = Vec::new();
    for shift in triples(SHIFTS_MM) {
        for angles in triples(ANGLES_DEGREES) {
            let matrix3: DMat3 = rotated(angles * 1_f64.to_radians());
            let translation = centre_mm - matrix3 * centre_mm + shift;
            poses.push(base * DAffine3 { matrix3, translation });
        }
    }
    poses
}

/// Whether a pose is within the searched range of a start.
fn is_near(base: DAffine3, pose: DAffine3, centre_mm: DVec3) -> bool {
    let turn = DQuat::from_mat3(&(base.matrix3.transpose() * pose.matrix3));
    let degrees = (2.0 * turn.w.abs().min(1.0).acos()).to_degrees();
    let shift_mm = base.transform_point3(centre_mm).distance(pose.transform_point3(centre_mm));
    degrees <= MAX_TURN_DEGREES && shift_mm <= MAX_SHIFT_MM
}

fn triples(values: [f64; 3]) -> impl Iterator<Item = DVec3> {
    (0..27).map(move |at| DVec3::new(values[at % 3], values[at / 3 % 3], values[at / 9]))
}
