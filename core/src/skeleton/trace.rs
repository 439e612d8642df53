//! Traces streamlines from saddles and seeds along the force, until they meet the skeleton.

use std::collections::HashMap;

use glam::DVec3;

use super::{
    PointKind, SkeletonCounts,
    critical::{CriticalPoint, Kind},
    filled_mask::FilledMask,
    force::{ChargeList, Charges, ForceSample, PowerLaw},
};
use crate::{Cancelled, Progress, eigen::symmetric_eigen};

/// Length of a step in units: a fifth of the finest spacing.
const STEP: f64 = 0.2;

/// Number of times a step is halved before the streamline counts as arrived.
const HALVINGS: u32 = 5;

/// Distance, in units, within which a streamline has met a point.
const MEET_DISTANCE: f64 = 0.5;

/// Minimum distance, in units, between the stored points of a streamline.
const POINT_SPACING: f64 = 0.5;

/// Radius, in units, within which one list of charges is valid.
const LIST_RADIUS: f64 = 2.0;

/// Critical points nearer to a charge than this, in units times the square root of the anisotropy, are artefacts: gaps
/// between charges or the steps of thick slices. The middle of a part two voxels thick is 1 away.
const MIN_CHARGE_DISTANCE: f64 = 0.8;

/// Maximum number of accepted steps of one streamline.
const MAX_STEPS: usize = 20_000;

/// Maximum number of accepted steps of a streamline in one unit cube: a straight line takes at most 9.
const MAX_VISITS: u32 = 60;

/// The skeleton under construction: points and lines between them, in units.
#[derive(Default)]
pub(super) struct SkeletonBuilder {
    pub points: Vec<(DVec3, PointKind)>,
    pub lines: Vec<Vec<u32>>,
    /// Id of the streamline or saddle that created each point; 0 for none.
    owners: Vec<u32>,
    by_cube: HashMap<[i64; 3], Vec<u32>>,
}

fn cube(at: DVec3) -> [i64; 3] {
    at.to_array().map(|v| v.floor() as i64)
}

impl SkeletonBuilder {
    pub fn add(&mut self, at: DVec3, kind: PointKind, owner: u32) -> u32 {
        let index = self.points.len() as u32;
        self.points.push((at, kind));
        self.owners.push(owner);
        self.by_cube.entry(cube(at)).or_default().push(index);
        index
    }

    /// The nearest point within [`MEET_DISTANCE`] that `owner` didn't create.
    fn point_near(&self, at: DVec3, owner: u32) -> Option<u32> {
        let (lo, hi) = (cube(at - MEET_DISTANCE), cube(at + MEET_DISTANCE));
        let mut best: Option<(f64, u32)> = None;
        for z in lo[2]..=hi[2] {
            for y in lo[1]..=hi[1] {
                for x in lo[0]..=hi[0] {
                    for &index in self.by_cube.get(&[x, y, z]).into_iter().flatten() {
                        let found = (self.points[index as usize].0.distance_squared(at), index);
                        let near =
                            found.0 <= MEET_DISTANCE * MEET_DISTANCE && self.owners[index as usize] != owner;
                        if near && best.is_none_or(|b| found < b) {
                            best = Some(found);
                        }
                    }
                }
            }
        }
        best.map(|(_, index)| index)
    }
}

/// The critical points without duplicates: of those within [`MEET_DISTANCE`] of each other the first is kept.
pub(super) fn distinct(points: &[CriticalPoint]) -> Vec<CriticalPoint> {
    let mut builder = SkeletonBuilder::default();
    // Attracting points first, so that they are kept in preference to other kinds nearby.
    let order = |kind: Kind| move |p: &CriticalPoint| (p.kind == kind).then(|| p.clone());
    let all = [Kind::Attracting, Kind::Saddle, Kind::Repelling];
    let sorted: Vec<CriticalPoint> =
        all.into_iter().flat_map(|k| points.iter().filter_map(order(k))).collect();
    sorted
        .into_iter()
        .filter(|p| {
            let new = builder.point_near(p.at, 0).is_none();
            if new {
                builder.add(p.at, PointKind::Attracting, 1);
            }
            new
        })
        .collect()
}

/// Why a streamline ended.
enum End {
    Met(u32),
    Arrived,
    Stopped,
}

/// Traces streamlines along the force.
pub(super) struct Tracer<'a> {
    pub filled: &'a FilledMask,
    pub charges: &'a Charges,
    pub law: PowerLaw,
    pub opening: f64,
    pub progress: &'a Progress,
    list: ChargeList,
    center: DVec3,
    next_owner: u32,
}

impl<'a> Tracer<'a> {
    pub fn new(
        filled: &'a FilledMask,
        charges: &'a Charges,
        law: PowerLaw,
        opening: f64,
        progress: &'a Progress,
    ) -> Self {
        Self {
            filled,
            charges,
            law,
            opening,
            progress,
            list: ChargeList::new(),
            center: DVec3::INFINITY,
            next_owner: 1,
        }
    }

    /// Level 0: every critical point, and streamlines along the outgoing directions of saddles.
    pub fn core(
        &mut self,
        critical: &[CriticalPoint],
        builder: &mut SkeletonBuilder,
        counts: &mut SkeletonCounts,
    ) -> Result<(), Cancelled> {
        let mut saddles = Vec::new();
        for point in critical {
            // Between single charges the force leaks out of the mask: such gaps are not inside.
            if self.sample(point.at).nearest_distance
                < MIN_CHARGE_DISTANCE * self.filled.ratio.max_element().sqrt()
            {
                counts.skipped += 1;
                continue;
            }
            match point.kind {
                Kind::Attracting => counts.attracting += 1,
                Kind::Saddle => counts.saddles += 1,
                Kind::Repelling => counts.repelling += 1,
            }
            let kind = match point.kind {
                Kind::Attracting => PointKind::Attracting,
                Kind::Repelling => PointKind::Repelling,
                Kind::Saddle => PointKind::Saddle,
            };
            let owner = if point.kind == Kind::Saddle { self.owner() } else { 0 };
            let index = builder.add(point.at, kind, owner);
            if point.kind == Kind::Saddle {
                saddles.push((index, owner, point));
            }
        }
        for (index, owner, saddle) in saddles {
            for direction in &saddle.outgoing {
                for side in [1.0, -1.0] {
                    let start = saddle.at + *direction * (side * STEP);
                    self.streamline(start, Some(index), owner, builder, counts)?;
                }
            }
        }
        Ok(())
    }

    /// Levels 1 and 2: a streamline from each seed.
    pub fn seeds(
        &mut self,
        seeds: &[DVec3],
        builder: &mut SkeletonBuilder,
        counts: &mut SkeletonCounts,
    ) -> Result<(), Cancelled> {
        for &seed in seeds {
            let owner = self.owner();
            self.streamline(seed, None, owner, builder, counts)?;
        }
        Ok(())
    }

    fn owner(&mut self) -> u32 {
        self.next_owner += 1;
        self.next_owner - 1
    }

    fn streamline(
        &mut self,
        start: DVec3,
        from: Option<u32>,
        owner: u32,
        builder: &mut SkeletonBuilder,
        counts: &mut SkeletonCounts,
    ) -> Result<(), Cancelled> {
        self.progress.check()?;
        if !self.filled.contains(start) {
            counts.skipped += 1;
            return Ok(());
        }
        counts.streamlines += 1;
        let mut path = vec![start];
        let end = self.follow(&mut path, owner, builder, counts);
        let mut line: Vec<u32> = from.into_iter().collect();
        // A seed on the existing skeleton adds nothing.
        if from.is_none() && path.len() == 1 && matches!(end, End::Met(_)) {
            counts.met += 1;
            return Ok(());
        }
        line.extend(path.iter().map(|&at| builder.add(at, PointKind::Streamline, owner)));
        match end {
            End::Met(index) => {
                counts.met += 1;
                line.push(index);
            }
            End::Arrived => counts.arrived += 1,
            End::Stopped => counts.stopped += 1,
        }
        builder.lines.push(line);
        Ok(())
    }

    /// Follows the force from the last point of `path`, with Heun's method on its direction. Each accepted step lowers
    /// the potential, so that no streamline can return to an earlier position.
    fn follow(
        &mut self,
        path: &mut Vec<DVec3>,
        owner: u32,
        builder: &SkeletonBuilder,
        counts: &mut SkeletonCounts,
    ) -> End {
        let Some(&start) = path.last() else { return End::Stopped };
        let mut at = start;
        let mut visits: HashMap<[i64; 3], u32> = HashMap::new();
        let mut current = self.sample(at);
        for _ in 0..MAX_STEPS {
            if let Some(index) = builder.point_near(at, owner) {
                if at != start
                    && path.last() != Some(&at)
                    && path.last().is_some_and(|p| p.distance(at) > 0.25)
                {
                    path.push(at);
                }
                return End::Met(index);
            }
            if at.distance_squared(self.center) > (LIST_RADIUS - 2.0 * STEP).powi(2) {
                // One list for the step's start and end, so that their potentials are comparable.
                self.charges.gather(at, LIST_RADIUS, self.opening, &mut self.list);
                self.center = at;
                current = self.sample(at);
            }
            let direction = current.force.normalize_or_zero();
            let if_lower = |next: DVec3| {
                let next_sample = self.law.sample(&self.list, next);
                (next_sample.potential < current.potential && self.filled.contains(next))
                    .then_some((next, next_sample))
            };
            let direction_ahead =
                self.law.sample(&self.list, at + direction * STEP).force.normalize_or_zero();
            let heun = || if_lower(at + (direction + direction_ahead) * (STEP / 2.0));
            let turns_gently = direction.dot(direction_ahead) > 0.5;
            let step = turns_gently.then(heun).flatten().or_else(|| {
                // The force turns sharply within a step: a narrow valley, whose floor is followed.
                let along = self.valley_step(at, current.force);
                (0..=HALVINGS).map(|n| along * 0.5_f64.powi(n as i32)).find_map(|d| if_lower(at + d))
            });
            let Some((next, next_sample)) = step else {
                if path.last().is_some_and(|p| p.distance(at) > 0.1) {
                    path.push(at);
                }
                return End::Arrived;
            };
            (at, current) = (next, next_sample);
            counts.steps += 1;
            let visit_count = visits.entry(cube(at)).or_default();
            *visit_count += 1;
            if *visit_count > MAX_VISITS {
                return End::Stopped;
            }
            if path.last().is_some_and(|p| p.distance(at) >= POINT_SPACING) {
                path.push(at);
            }
        }
        End::Stopped
    }

    /// A Newton step on the potential with the absolute values of its curvatures (saddle-free Newton, Dauphin et al.
    /// 2014), at most [`STEP`] long: it descends to the floor of a valley and follows it.
    fn valley_step(&self, at: DVec3, force: DVec3) -> DVec3 {
        let (values, vectors) = symmetric_eigen(self.law.jacobian(&self.list, at));
        let largest = values.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
        let step: DVec3 = (0..3)
            .map(|i| {
                let v = vectors.col(i);
                v * (v.dot(force) / values[i].abs().max(1e-9 * largest))
            })
            .sum();
        if step.is_finite() { step.clamp_length_max(STEP) } else { DVec3::ZERO }
    }

    /// Force and potential at `at`, with a new list of charges where the current one isn't valid.
    fn sample(&mut self, at: DVec3) -> ForceSample {
        if at.distance_squared(self.center) > (LIST_RADIUS - 2.0 * STEP).powi(2) || self.list.is_empty() {
            self.charges.gather(at, LIST_RADIUS, self.opening, &mut self.list);
            self.center = at;
        }
        self.law.sample(&self.list, at)
    }
}
