//! Completes the skeleton after the streamlines: gives every component a point and joins the pieces within each.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, HashMap},
};

use glam::DVec3;
use rayon::prelude::*;

use super::{PointKind, SkeletonCounts, SkeletonError, filled_mask::FilledMask, trace::SkeletonBuilder};
use crate::{Cancelled, Components, Connectivity, Progress, distance::FeatureTransform};

/// Gives every component (26-neighbourhood) without a point its deepest voxel, and joins the pieces within each
/// component along minimum-cost paths. A step costs its length over the cube of the depth, which keeps paths near the
/// middle. Afterwards each component has one connected skeleton.
pub(super) fn complete(
    filled: &FilledMask,
    builder: &mut SkeletonBuilder,
    counts: &mut SkeletonCounts,
    progress: &Progress,
) -> Result<(), SkeletonError> {
    let components = Components::of_mask(&filled.bits, Connectivity::TwentySix)?;
    let dims = filled.bits.dims();
    let labels = components.labels(dims);
    let mut has_point = vec![false; components.list().len() + 1];
    let voxel_of = |at| {
        let v = filled.voxel_at(at);
        filled.get(v).then(|| filled.linear(v.map(|x| x as usize)))
    };
    for &(at, _) in &builder.points {
        if let Some(l) = voxel_of(at) {
            has_point[labels[l] as usize] = true;
        }
    }
    let mut depth: Option<FeatureTransform> = None;
    for (component, _) in components.list().iter().zip(&has_point[1..]).filter(|(_, has)| !**has) {
        progress.check()?;
        let depth = depth_transform(&mut depth, filled)?;
        let mut deepest: Option<(f64, [usize; 3])> = None;
        for run in components.runs(component) {
            for x in run.first..=run.last {
                let ijk = [x as usize, run.y as usize, run.z as usize];
                let d = depth.distance_mm(ijk).unwrap_or(0.0);
                if deepest.is_none_or(|(most, _)| d > most) {
                    deepest = Some((d, ijk));
                }
            }
        }
        if let Some((_, ijk)) = deepest {
            builder.add(filled.center(ijk), PointKind::Deepest, 0);
            counts.deepest += 1;
        }
    }
    // Pieces: points connected by lines or in the same voxel.
    let mut pieces = UnionFind((0..builder.points.len() as u32).collect());
    for line in &builder.lines {
        for w in line.windows(2) {
            pieces.join(w[0], w[1]);
        }
    }
    let mut sources: HashMap<usize, u32> = HashMap::new();
    let mut links = Vec::new();
    for (point, &(at, _)) in (0..).zip(&builder.points) {
        let Some(l) = voxel_of(at) else { continue };
        let first_point = *sources.entry(l).or_insert(point);
        if pieces.join(first_point, point) {
            links.push(vec![first_point, point]);
        }
    }
    builder.lines.extend(links);
    let piece_count = (0..builder.points.len() as u32).filter(|&p| pieces.find(p) == p).count();
    let missing_bridges = piece_count.saturating_sub(components.list().len());
    if missing_bridges > 0 {
        let depth = depth_transform(&mut depth, filled)?;
        join_pieces(filled, depth, builder, &mut pieces, &sources, missing_bridges, counts, progress)?;
    }
    Ok(())
}

/// The distance transform of the mask, computed on first use.
fn depth_transform<'a>(
    depth: &'a mut Option<FeatureTransform>,
    filled: &FilledMask,
) -> Result<&'a FeatureTransform, SkeletonError> {
    if depth.is_none() {
        *depth = Some(filled.depth()?);
    }
    depth.as_ref().ok_or(SkeletonError::NoOutside)
}

/// Union-find over the skeleton's points.
struct UnionFind(Vec<u32>);

impl UnionFind {
    fn find(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Joins the sets of `a` and `b`; returns whether they were distinct.
    fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
        a != b
    }
}

/// Bits of a cost that choose its bucket: its exponent and 8 of its mantissa, so that costs of a bucket differ by 0.4 %.
const BUCKET_SHIFT: u32 = 44;

/// Bucket of the cost 2⁻⁴⁰ and less.
const FIRST_BUCKET: u64 = ((1023 - 40) << 52) >> BUCKET_SHIFT;

/// Number of buckets: those past the cost 2²⁴ share one.
const BUCKETS: usize = 64 << (52 - BUCKET_SHIFT);

/// Voxels by cost, cheapest first, then by number. What comes next is in a heap; what comes later lies in buckets unsorted, as
/// a heap of everything is too large for the cache.
struct Queue {
    next: BinaryHeap<Reverse<(u64, u32)>>,
    bucket: usize,
    later: Vec<Vec<(u64, u32)>>,
}

impl Queue {
    fn new() -> Self {
        Self { next: BinaryHeap::new(), bucket: 0, later: vec![Vec::new(); BUCKETS] }
    }

    /// Costs aren't negative, so their bits are in their order; none is below that of the last voxel popped.
    fn push(&mut self, cost: f64, voxel: u32) {
        let bits = cost.to_bits();
        let bucket = ((bits >> BUCKET_SHIFT).saturating_sub(FIRST_BUCKET) as usize).min(BUCKETS - 1);
        if bucket <= self.bucket {
            self.next.push(Reverse((bits, voxel)));
        } else {
            self.later[bucket].push((bits, voxel));
        }
    }

    /// The next voxel; of those in a bucket only what `is_current` (cost, voxel).
    fn pop(&mut self, is_current: impl Fn(f64, u32) -> bool) -> Option<u32> {
        while self.next.is_empty() {
            self.bucket += 1;
            let bucket = std::mem::take(self.later.get_mut(self.bucket)?);
            let current =
                bucket.into_iter().filter(|(bits, voxel)| is_current(f64::from_bits(*bits), *voxel));
            self.next.extend(current.map(Reverse));
        }
        self.next.pop().map(|Reverse((_, voxel))| voxel)
    }
}

/// A voxel's step that comes from nowhere: a path begins here.
const START: u8 = 13;

/// State of a voxel in Dijkstra's algorithm.
#[derive(Clone, Copy)]
struct VoxelState {
    /// Infinite before it is reached.
    cost: f64,
    depth: f64,
    /// Skeleton point at which the path to this voxel starts.
    source_point: u32,
    /// Number of the step that led here, of the 27 of [`Paths::steps`].
    step: u8,
    settled: bool,
}

/// Shortest paths from the skeleton's pieces through the mask. Voxels are numbered in memory order: 28 bytes for each, and 4
/// for each of the box.
struct Paths {
    states: Vec<VoxelState>,
    /// Linear index of each voxel.
    linears: Vec<u32>,
    /// Number of each voxel of the box; [`u32::MAX`] outside the mask.
    numbers: Vec<u32>,
    /// Difference of linear indices and length of each step to a neighbour, x fastest.
    steps: [(isize, f64); 27],
}

impl Paths {
    fn new(filled: &FilledMask, depth: &FeatureTransform) -> Self {
        let dims = filled.bits.dims();
        let mut numbers = vec![u32::MAX; dims.iter().product()];
        let mut linears = Vec::new();
        filled.bits.for_each(|linear| {
            numbers[linear] = linears.len() as u32;
            linears.push(linear as u32);
        });
        let state = |linear: &u32| VoxelState {
            cost: f64::INFINITY,
            depth: depth.distance_mm(filled.voxel(*linear as usize)).unwrap_or(1.0),
            source_point: u32::MAX,
            step: START,
            settled: false,
        };
        let states = linears.par_iter().map(state).collect();
        let steps = std::array::from_fn(|n| {
            let [x, y, z] = [n % 3, n / 3 % 3, n / 9].map(|at| at as isize - 1);
            let linear = (z * dims[1] as isize + y) * dims[0] as isize + x;
            (linear, filled.unit(DVec3::new(x as f64, y as f64, z as f64)).length())
        });
        Self { states, linears, numbers, steps }
    }

    /// The neighbour of a voxel across a step; the margin keeps it inside the box.
    fn neighbor(&self, voxel: u32, step: isize) -> Option<u32> {
        let linear = self.linears[voxel as usize] as usize;
        let number = self.numbers[linear.wrapping_add_signed(step)];
        (number != u32::MAX).then_some(number)
    }

    /// Adds the line from the source point of voxel `a` to that of its neighbour `b`, along both shortest paths.
    fn add_bridge(&self, filled: &FilledMask, builder: &mut SkeletonBuilder, a: u32, b: u32) {
        let mut path_to_source = |mut voxel: u32| {
            let mut line = Vec::new();
            loop {
                let VoxelState { step, source_point, .. } = self.states[voxel as usize];
                let before = self.neighbor(voxel, -self.steps[usize::from(step)].0);
                let (true, Some(before)) = (step != START, before) else {
                    line.push(source_point);
                    return line;
                };
                let ijk = filled.voxel(self.linears[voxel as usize] as usize);
                line.push(builder.add(filled.center(ijk), PointKind::Bridge, 0));
                voxel = before;
            }
        };
        let mut line = path_to_source(a);
        line.reverse();
        line.extend(path_to_source(b));
        builder.lines.push(line);
    }
}

/// Grows shortest paths from all pieces at once (Dijkstra 1959) and joins two pieces where their paths meet, until
/// `missing_bridges` bridges are made.
fn join_pieces(
    filled: &FilledMask,
    depth: &FeatureTransform,
    builder: &mut SkeletonBuilder,
    pieces: &mut UnionFind,
    sources: &HashMap<usize, u32>,
    mut missing_bridges: usize,
    counts: &mut SkeletonCounts,
    progress: &Progress,
) -> Result<(), Cancelled> {
    let mut paths = Paths::new(filled, depth);
    let mut queue = Queue::new();
    for (&linear, &point) in sources {
        let voxel = paths.numbers[linear];
        let state = &mut paths.states[voxel as usize];
        (state.cost, state.source_point) = (0.0, point);
        queue.push(0.0, voxel);
    }
    // Few pieces are compared often: by numbers of their own.
    let mut numbered: HashMap<u32, u32> = HashMap::new();
    let piece_of: Vec<u32> = (0..builder.points.len() as u32)
        .map(|point| {
            let next = numbered.len() as u32;
            *numbered.entry(pieces.find(point)).or_insert(next)
        })
        .collect();
    let mut pieces = UnionFind((0..numbered.len() as u32).collect());
    let mut popped = 0_u64;
    while let Some(voxel) = queue.pop(|cost, voxel| paths.states[voxel as usize].cost == cost) {
        popped += 1;
        if popped.is_multiple_of(4096) {
            progress.check()?;
        }
        let state = &mut paths.states[voxel as usize];
        if state.settled {
            continue;
        }
        state.settled = true;
        let state = *state;
        let linear = paths.linears[voxel as usize] as usize;
        for (step, (offset, length)) in (0..).zip(paths.steps) {
            let next = paths.numbers[linear.wrapping_add_signed(offset)];
            if next == u32::MAX || step == START {
                continue;
            }
            let next_state = &mut paths.states[next as usize];
            if next_state.settled {
                let points = [state.source_point, next_state.source_point];
                let [own, other] = points.map(|point| piece_of[point as usize]);
                if own != other && pieces.join(own, other) {
                    paths.add_bridge(filled, builder, voxel, next);
                    counts.bridges += 1;
                    missing_bridges -= 1;
                    if missing_bridges == 0 {
                        return Ok(());
                    }
                }
                continue;
            }
            let d = (state.depth + next_state.depth) * 0.5;
            let cost = state.cost + length / (d * d * d);
            if (cost, state.source_point) < (next_state.cost, next_state.source_point) {
                // Of equal costs the place in the queue stays.
                if cost < next_state.cost {
                    queue.push(cost, next);
                }
                (next_state.cost, next_state.source_point, next_state.step) =
                    (cost, state.source_point, step);
            }
        }
    }
    Ok(())
}
