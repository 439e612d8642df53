//! Completes the skeleton after the streamlines: gives every component a point and joins the pieces within each.

use std::{
    cmp::{Ordering, Reverse},
    collections::{BinaryHeap, HashMap},
};

use super::{
    PointKind, SkeletonCounts, SkeletonError,
    filled_mask::{FilledMask, neighbours},
    trace::SkeletonBuilder,
};
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

/// Entry of Dijkstra's queue, cost and linear index: cheapest first, then lowest index.
#[derive(PartialEq)]
struct QueueEntry(f64, usize);

impl Eq for QueueEntry {}

impl PartialOrd for QueueEntry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for QueueEntry {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

/// State of a voxel in Dijkstra's algorithm.
#[derive(Clone, Copy)]
struct VoxelState {
    cost: f64,
    predecessor: usize,
    /// Skeleton point at which the path to this voxel starts.
    source_point: u32,
    settled: bool,
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
    let mut states: HashMap<usize, VoxelState> = HashMap::new();
    let mut queue = BinaryHeap::new();
    for (&voxel, &point) in sources {
        states
            .insert(voxel, VoxelState { cost: 0.0, predecessor: voxel, source_point: point, settled: false });
        queue.push(Reverse(QueueEntry(0.0, voxel)));
    }
    let mut popped = 0_u64;
    while let Some(Reverse(QueueEntry(cost, voxel))) = queue.pop() {
        popped += 1;
        if popped.is_multiple_of(4096) {
            progress.check()?;
        }
        let Some(state) = states.get_mut(&voxel) else { continue };
        if state.settled || cost > state.cost {
            continue;
        }
        state.settled = true;
        let state = *state;
        let ijk = filled.voxel(voxel);
        let center = filled.center(ijk);
        let depth_here = depth.distance_mm(ijk).unwrap_or(1.0);
        for n in neighbours(ijk).filter(|&n| filled.bits.get(n)) {
            let next = filled.linear(n);
            if let Some(next_state) = states.get(&next).copied().filter(|t| t.settled) {
                if pieces.join(state.source_point, next_state.source_point) {
                    add_bridge(filled, builder, &states, voxel, next);
                    counts.bridges += 1;
                    missing_bridges -= 1;
                    if missing_bridges == 0 {
                        return Ok(());
                    }
                }
                continue;
            }
            let d = (depth_here + depth.distance_mm(n).unwrap_or(1.0)) * 0.5;
            let cost = state.cost + center.distance(filled.center(n)) / (d * d * d);
            if states.get(&next).is_none_or(|t| (cost, state.source_point) < (t.cost, t.source_point)) {
                states.insert(
                    next,
                    VoxelState { cost, predecessor: voxel, source_point: state.source_point, settled: false },
                );
                queue.push(Reverse(QueueEntry(cost, next)));
            }
        }
    }
    Ok(())
}

/// Adds the line from the source point of voxel `a` to that of its neighbour `b`, along both shortest paths.
fn add_bridge(
    filled: &FilledMask,
    builder: &mut SkeletonBuilder,
    states: &HashMap<usize, VoxelState>,
    a: usize,
    b: usize,
) {
    let mut path_to_source = |mut voxel: usize| {
        let mut line = Vec::new();
        while let Some(r) = states.get(&voxel) {
            if r.predecessor == voxel {
                line.push(r.source_point);
                break;
            }
            line.push(builder.add(filled.center(filled.voxel(voxel)), PointKind::Bridge, 0));
            voxel = r.predecessor;
        }
        line
    };
    let mut line = path_to_source(a);
    line.reverse();
    line.extend(path_to_source(b));
    builder.lines.push(line);
}
