//! From saddles and seeds along the force, until a streamline meets what is already there.

use std::collections::HashMap;

use glam::DVec3;

use super::{
    PointKind, SkeletonCounts,
    critical::{CriticalPoint, Kind, symmetric_eigen},
    force::{Charges, Felt, Law, List},
    solid::Solid,
};
use crate::{Cancelled, Progress};

/// Units of one step: a fifth of the finest spacing.
const STEP: f64 = 0.2;

/// A step is halved this often before the streamline counts as arrived.
const HALVINGS: u32 = 5;

/// Units within which a streamline has met a point.
const MEET: f64 = 0.5;

/// Units between points that are kept of a streamline.
const KEEP: f64 = 0.5;

/// Units around a place in which one list of charges serves.
const REACH: f64 = 2.0;

/// Critical points nearer to a charge than this, in units times the root of the anisotropy, are holes
/// between charges or steps of thick slices. The middle of a part two voxels thick is 1 away.
const SKIN: f64 = 0.8;

/// Accepted steps of one streamline.
const MAX_STEPS: usize = 20_000;

/// Accepted steps in one cube of a unit's edge: straight through takes 9 at most.
const MAX_VISITS: u32 = 60;

/// The skeleton while it grows: points and lines between them, in units.
#[derive(Default)]
pub(super) struct Sketch {
    pub points: Vec<(DVec3, PointKind)>,
    pub lines: Vec<Vec<u32>>,
    /// Which deed made each point.
    owners: Vec<u32>,
    by_cube: HashMap<[i64; 3], Vec<u32>>,
}

fn cube(at: DVec3) -> [i64; 3] {
    at.to_array().map(|v| v.floor() as i64)
}

impl Sketch {
    pub fn add(&mut self, at: DVec3, kind: PointKind, owner: u32) -> u32 {
        let index = self.points.len() as u32;
        self.points.push((at, kind));
        self.owners.push(owner);
        self.by_cube.entry(cube(at)).or_default().push(index);
        index
    }

    /// The nearest point within [`MEET`] that `owner` didn't make.
    fn met(&self, at: DVec3, owner: u32) -> Option<u32> {
        let (lo, hi) = (cube(at - MEET), cube(at + MEET));
        let mut best: Option<(f64, u32)> = None;
        for z in lo[2]..=hi[2] {
            for y in lo[1]..=hi[1] {
                for x in lo[0]..=hi[0] {
                    for &index in self.by_cube.get(&[x, y, z]).into_iter().flatten() {
                        let found = (self.points[index as usize].0.distance_squared(at), index);
                        let near = found.0 <= MEET * MEET && self.owners[index as usize] != owner;
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

/// The critical points without those found twice, and without those on one spot.
pub(super) fn distinct(points: &[CriticalPoint]) -> Vec<CriticalPoint> {
    let mut sketch = Sketch::default();
    // Attracting ones first: they stay whatever lies beside them.
    let order = |kind: Kind| move |p: &CriticalPoint| (p.kind == kind).then(|| p.clone());
    let all = [Kind::Attracting, Kind::Saddle, Kind::Repelling];
    let sorted: Vec<CriticalPoint> =
        all.into_iter().flat_map(|k| points.iter().filter_map(order(k))).collect();
    sorted
        .into_iter()
        .filter(|p| {
            let new = sketch.met(p.at, 0).is_none();
            if new {
                sketch.add(p.at, PointKind::Attracting, 1);
            }
            new
        })
        .collect()
}

/// How a streamline ended.
enum End {
    Met(u32),
    Arrived,
    Stopped,
}

pub(super) struct Tracer<'a> {
    pub solid: &'a Solid,
    pub charges: &'a Charges,
    pub law: Law,
    pub opening: f64,
    pub progress: &'a Progress,
    list: List,
    center: DVec3,
    next_owner: u32,
}

impl<'a> Tracer<'a> {
    pub fn new(
        solid: &'a Solid,
        charges: &'a Charges,
        law: Law,
        opening: f64,
        progress: &'a Progress,
    ) -> Self {
        Self {
            solid,
            charges,
            law,
            opening,
            progress,
            list: List::new(),
            center: DVec3::INFINITY,
            next_owner: 1,
        }
    }

    /// Level 0: every critical point, and streamlines along the outgoing directions of saddles.
    pub fn core(
        &mut self,
        critical: &[CriticalPoint],
        sketch: &mut Sketch,
        counts: &mut SkeletonCounts,
    ) -> Result<(), Cancelled> {
        let mut saddles = Vec::new();
        for point in critical {
            // Between single charges the force leaks out of the mask: such holes are no inside.
            if self.felt(point.at).nearest < SKIN * self.solid.ratio.max_element().sqrt() {
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
            let index = sketch.add(point.at, kind, owner);
            if point.kind == Kind::Saddle {
                saddles.push((index, owner, point));
            }
        }
        for (index, owner, saddle) in saddles {
            for direction in &saddle.outgoing {
                for side in [1.0, -1.0] {
                    let start = saddle.at + *direction * (side * STEP);
                    self.streamline(start, Some(index), owner, sketch, counts)?;
                }
            }
        }
        Ok(())
    }

    /// Levels 1 and 2: a streamline from each seed.
    pub fn seeds(
        &mut self,
        seeds: &[DVec3],
        sketch: &mut Sketch,
        counts: &mut SkeletonCounts,
    ) -> Result<(), Cancelled> {
        for &seed in seeds {
            let owner = self.owner();
            self.streamline(seed, None, owner, sketch, counts)?;
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
        sketch: &mut Sketch,
        counts: &mut SkeletonCounts,
    ) -> Result<(), Cancelled> {
        self.progress.check()?;
        if !self.solid.contains(start) {
            counts.skipped += 1;
            return Ok(());
        }
        counts.streamlines += 1;
        let mut places = vec![start];
        let end = self.follow(&mut places, owner, sketch, counts);
        let mut line: Vec<u32> = from.into_iter().collect();
        // A seed that has met the skeleton at once adds nothing.
        if from.is_none() && places.len() == 1 && matches!(end, End::Met(_)) {
            counts.met += 1;
            return Ok(());
        }
        line.extend(places.iter().map(|&at| sketch.add(at, PointKind::Streamline, owner)));
        match end {
            End::Met(index) => {
                counts.met += 1;
                line.push(index);
            }
            End::Arrived => counts.arrived += 1,
            End::Stopped => counts.stopped += 1,
        }
        sketch.lines.push(line);
        Ok(())
    }

    /// Follows the force from the last place, Heun's method on its direction. Each accepted step
    /// lowers the potential, so that no streamline can come back to where it was.
    fn follow(
        &mut self,
        places: &mut Vec<DVec3>,
        owner: u32,
        sketch: &Sketch,
        counts: &mut SkeletonCounts,
    ) -> End {
        let Some(&start) = places.last() else { return End::Stopped };
        let mut at = start;
        let mut visits: HashMap<[i64; 3], u32> = HashMap::new();
        let mut here = self.felt(at);
        for _ in 0..MAX_STEPS {
            if let Some(index) = sketch.met(at, owner) {
                if at != start
                    && places.last() != Some(&at)
                    && places.last().is_some_and(|p| p.distance(at) > 0.25)
                {
                    places.push(at);
                }
                return End::Met(index);
            }
            if at.distance_squared(self.center) > (REACH - 2.0 * STEP).powi(2) {
                // A fresh list for this step's beginning and end: potentials compare.
                self.charges.gather(at, REACH, self.opening, &mut self.list);
                self.center = at;
                here = self.felt(at);
            }
            let direction = here.force.normalize_or_zero();
            let falls = |next: DVec3| {
                let there = self.law.felt(&self.list, next);
                (there.potential < here.potential && self.solid.contains(next)).then_some((next, there))
            };
            let ahead = self.law.felt(&self.list, at + direction * STEP).force.normalize_or_zero();
            let heun = || falls(at + (direction + ahead) * (STEP / 2.0));
            let gentle = direction.dot(ahead) > 0.5;
            let step = gentle.then(heun).flatten().or_else(|| {
                // The force turns back within a step: a narrow valley, along whose floor to go.
                let along = self.valley_step(at, here.force);
                (0..=HALVINGS).map(|n| along * 0.5_f64.powi(n as i32)).find_map(|d| falls(at + d))
            });
            let Some((next, there)) = step else {
                if places.last().is_some_and(|p| p.distance(at) > 0.1) {
                    places.push(at);
                }
                return End::Arrived;
            };
            (at, here) = (next, there);
            counts.steps += 1;
            let visited = visits.entry(cube(at)).or_default();
            *visited += 1;
            if *visited > MAX_VISITS {
                return End::Stopped;
            }
            if places.last().is_some_and(|p| p.distance(at) >= KEEP) {
                places.push(at);
            }
        }
        End::Stopped
    }

    /// A step of Newton's method on the potential, with every curvature taken as positive (as
    /// Dauphin et al. 2014) and at most [`STEP`] long: down to the floor of a valley and on along it.
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

    fn felt(&mut self, at: DVec3) -> Felt {
        if at.distance_squared(self.center) > (REACH - 2.0 * STEP).powi(2) || self.list.is_empty() {
            self.charges.gather(at, REACH, self.opening, &mut self.list);
            self.center = at;
        }
        self.law.felt(&self.list, at)
    }
}
