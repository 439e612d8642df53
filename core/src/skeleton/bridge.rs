//! What streamlines leave open: components without a point, and pieces that one component holds
//! apart.

use std::{
    cmp::{Ordering, Reverse},
    collections::{BinaryHeap, HashMap},
};

use super::{
    PointKind, SkeletonCounts, SkeletonError,
    solid::{Solid, neighbours},
    trace::Sketch,
};
use crate::{Cancelled, Components, Connectivity, Progress, distance::FeatureTransform};

/// Gives every component (26-neighbourhood) at least one point, its deepest voxel, and joins the
/// pieces within each along the cheapest paths, where a step costs its length over the cube of the
/// depth: paths keep to the middle. Afterwards each component has one connected skeleton.
pub(super) fn complete(
    solid: &Solid,
    sketch: &mut Sketch,
    counts: &mut SkeletonCounts,
    progress: &Progress,
) -> Result<(), SkeletonError> {
    let components = Components::of_mask(&solid.bits, Connectivity::TwentySix)?;
    let dims = solid.bits.dims();
    let labels = components.labels(dims);
    let mut has_point = vec![false; components.list().len() + 1];
    let voxel_of = |at| {
        let v = solid.voxel_at(at);
        solid.get(v).then(|| solid.linear(v.map(|x| x as usize)))
    };
    for &(at, _) in &sketch.points {
        if let Some(l) = voxel_of(at) {
            has_point[labels[l] as usize] = true;
        }
    }
    let mut depth: Option<FeatureTransform> = None;
    for (component, _) in components.list().iter().zip(&has_point[1..]).filter(|(_, has)| !**has) {
        progress.check()?;
        let depth = known(&mut depth, solid)?;
        let mut best: Option<(f64, [usize; 3])> = None;
        for run in components.runs(component) {
            for x in run.first..=run.last {
                let ijk = [x as usize, run.y as usize, run.z as usize];
                let d = depth.distance_mm(ijk).unwrap_or(0.0);
                if best.is_none_or(|(most, _)| d > most) {
                    best = Some((d, ijk));
                }
            }
        }
        if let Some((_, ijk)) = best {
            sketch.add(solid.center(ijk), PointKind::Deepest, 0);
            counts.deepest += 1;
        }
    }
    // Pieces: points that lines join, and points in one voxel.
    let mut pieces = Pieces((0..sketch.points.len() as u32).collect());
    for line in &sketch.lines {
        for w in line.windows(2) {
            pieces.join(w[0], w[1]);
        }
    }
    let mut sources: HashMap<usize, u32> = HashMap::new();
    let mut links = Vec::new();
    for (point, &(at, _)) in (0..).zip(&sketch.points) {
        let Some(l) = voxel_of(at) else { continue };
        let first = *sources.entry(l).or_insert(point);
        if pieces.join(first, point) {
            links.push(vec![first, point]);
        }
    }
    sketch.lines.extend(links);
    let roots = (0..sketch.points.len() as u32).filter(|&p| pieces.root(p) == p).count();
    let open = roots.saturating_sub(components.list().len());
    if open > 0 {
        let depth = known(&mut depth, solid)?;
        join(solid, depth, sketch, &mut pieces, &sources, open, counts, progress)?;
    }
    Ok(())
}

fn known<'a>(
    depth: &'a mut Option<FeatureTransform>,
    solid: &Solid,
) -> Result<&'a FeatureTransform, SkeletonError> {
    if depth.is_none() {
        *depth = Some(solid.depth()?);
    }
    depth.as_ref().ok_or(SkeletonError::NoOutside)
}

struct Pieces(Vec<u32>);

impl Pieces {
    fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Whether they were apart.
    fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
        a != b
    }
}

/// A place in Dijkstra's queue: cheapest first, then first in memory.
#[derive(PartialEq)]
struct Front(f64, usize);

impl Eq for Front {}

impl PartialOrd for Front {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Front {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

/// Where a front came from, and which point it started at.
#[derive(Clone, Copy)]
struct Reached {
    cost: f64,
    from: usize,
    point: u32,
    settled: bool,
}

/// Lets fronts grow from all pieces at once (Dijkstra 1959) and joins two pieces where theirs meet,
/// until `open` joints are made.
fn join(
    solid: &Solid,
    depth: &FeatureTransform,
    sketch: &mut Sketch,
    pieces: &mut Pieces,
    sources: &HashMap<usize, u32>,
    mut open: usize,
    counts: &mut SkeletonCounts,
    progress: &Progress,
) -> Result<(), Cancelled> {
    let mut reached: HashMap<usize, Reached> = HashMap::new();
    let mut queue = BinaryHeap::new();
    for (&voxel, &point) in sources {
        reached.insert(voxel, Reached { cost: 0.0, from: voxel, point, settled: false });
        queue.push(Reverse(Front(0.0, voxel)));
    }
    let mut popped = 0_u64;
    while let Some(Reverse(Front(cost, voxel))) = queue.pop() {
        popped += 1;
        if popped.is_multiple_of(4096) {
            progress.check()?;
        }
        let Some(here) = reached.get_mut(&voxel) else { continue };
        if here.settled || cost > here.cost {
            continue;
        }
        here.settled = true;
        let here = *here;
        let ijk = solid.voxel(voxel);
        let center = solid.center(ijk);
        let my_depth = depth.distance_mm(ijk).unwrap_or(1.0);
        for n in neighbours(ijk).filter(|&n| solid.bits.get(n)) {
            let next = solid.linear(n);
            if let Some(there) = reached.get(&next).copied().filter(|t| t.settled) {
                if pieces.join(here.point, there.point) {
                    bridge(solid, sketch, &reached, voxel, next);
                    counts.bridges += 1;
                    open -= 1;
                    if open == 0 {
                        return Ok(());
                    }
                }
                continue;
            }
            let d = (my_depth + depth.distance_mm(n).unwrap_or(1.0)) * 0.5;
            let cost = here.cost + center.distance(solid.center(n)) / (d * d * d);
            if reached.get(&next).is_none_or(|t| (cost, here.point) < (t.cost, t.point)) {
                reached.insert(next, Reached { cost, from: voxel, point: here.point, settled: false });
                queue.push(Reverse(Front(cost, next)));
            }
        }
    }
    Ok(())
}

/// A line along the way that two fronts came, from point to point.
fn bridge(solid: &Solid, sketch: &mut Sketch, reached: &HashMap<usize, Reached>, a: usize, b: usize) {
    let mut half = |mut voxel: usize| {
        let mut line = Vec::new();
        while let Some(r) = reached.get(&voxel) {
            if r.from == voxel {
                line.push(r.point);
                break;
            }
            line.push(sketch.add(solid.center(solid.voxel(voxel)), PointKind::Bridge, 0));
            voxel = r.from;
        }
        line
    };
    let mut line = half(a);
    line.reverse();
    line.extend(half(b));
    sketch.lines.push(line);
}
