//! Where a component would be split without a word from the user: at the narrowest neck of its skeleton.

use std::collections::BTreeMap;

use crate::{
    Grid, Progress,
    components::Run,
    glam::DVec3,
    skeleton::{Skeleton, SkeletonOptions, skeleton},
};

use super::{boxed::Boxed, edits::Anchor, error::LesionsError, find::Found, sets::Sets};

/// The widest neck, as a part of the largest radius on its thinner side.
pub const WIDEST_NECK: f64 = 0.8;

/// The largest number of lattice points of a skeleton: that of a larger component is sampled at every second voxel along each
/// axis, every third, and so on.
const MOST_SAMPLES: u64 = 1 << 22;

/// The narrowest neck of a component. `Edit::Split` with its seeds cuts there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neck {
    /// Its place on the skeleton, RAS+ millimetres.
    pub at_mm: DVec3,
    /// Its radius, at most: from there to the centre of the nearest voxel outside.
    pub radius_mm: f64,
    /// The deepest place of the skeleton on either side, as deep as the neck lets pass: RAS+ millimetres, the thicker side
    /// first. Inside the component or a cavity of it.
    pub seeds_mm: [DVec3; 2],
    /// The radii there, at least: to that voxel's nearest face.
    pub side_radii_mm: [f64; 2],
}

/// The narrowest neck of the component at a place: that of the curve skeleton's places whose distance to the surface is the
/// smallest part of the largest distance on its thinner side. Cavities count as inside. The reason, where there is none: a
/// neck is at most [`WIDEST_NECK`] times as wide as the thinner side, by bounds of both radii, so that it isn't due to voxels;
/// and a ball as large as the smallest lesion fits into either side, or it parts a fleck or a bump.
///
/// Where a component closes a ring, sides are joined by more than one neck: the widest of them is meant, and a split cuts all
/// of them. A ring of even thickness has none.
///
/// Deterministic. Takes as long as the skeleton, whose sampling is coarser for components above 4 million voxels, and about 50
/// bytes per voxel of the component.
///
/// # Errors
/// [`LesionsError`] where the skeleton can't be computed, or the user cancels.
pub fn neck(found: &Found, at: &Anchor, progress: &Progress) -> Result<Result<Neck, String>, LesionsError> {
    let (date, part) = match found.node(at) {
        Ok(node) => node,
        Err(reason) => return Ok(Err(reason)),
    };
    let parts = found.parts(date);
    let Some((grid, part)) = parts.and_then(|parts| Some((&parts.grid, parts.parts.get(part)?))) else {
        return Ok(Err("found no component, expected one".into()));
    };
    narrowest(&part.runs, grid, found.options.smallest_ml, progress)
}

/// As [`neck`], of the voxels of `runs`.
pub(super) fn narrowest(
    runs: &[Run],
    grid: &Grid,
    smallest_ml: f64,
    progress: &Progress,
) -> Result<Result<Neck, String>, LesionsError> {
    let Some(boxed) = Boxed::new(runs, grid)? else {
        return Ok(Err("found no voxel, expected a component".into()));
    };
    progress.check()?;
    let samples = boxed.filled.count();
    let coarse = (1..).find(|n: &u64| samples <= MOST_SAMPLES * n * n * n).unwrap_or(1);
    let options = SkeletonOptions { coarse: coarse as usize, ..SkeletonOptions::default() };
    let skeleton = skeleton(&boxed.filled, &boxed.grid, &options, progress)?;
    let tree = Tree::new(&boxed, &skeleton, progress)?;
    let mut necks = tree.necks();
    necks.sort_by(|a, b| a.share.total_cmp(&b.share).then(a.edge.cmp(&b.edge)));
    let Some(first) = necks.first() else {
        return Ok(Err(
            "found a skeleton that only gets thinner from its deepest place, expected a neck".into()
        ));
    };
    let narrow: Vec<&Candidate> = necks.iter().take_while(|neck| neck.share <= WIDEST_NECK).collect();
    if narrow.is_empty() {
        let share = first.share;
        return Ok(Err(format!(
            "found a narrowest place {share:.2} times as wide as the thinner side, expected at most {WIDEST_NECK}"
        )));
    }
    let least_mm = (smallest_ml * 1000.0 * 0.75 / std::f64::consts::PI).cbrt();
    match narrow.into_iter().find(|neck| neck.depth_mm >= least_mm) {
        Some(neck) => Ok(Ok(tree.described(neck, &skeleton))),
        None => Ok(Err(format!(
            "found only necks to parts whose largest ball is below {smallest_ml} ml, expected a lesion on either side"
        ))),
    }
}

/// A place of the skeleton.
struct Place {
    depth_mm: f64,
    radius_mm: f64,
}

/// The paths of a skeleton that keep deepest: its spanning tree of largest depths. Of any two places, that in it is the path
/// whose least depth is largest (Kruskal 1956).
struct Tree {
    places: Vec<Place>,
    /// Pairs of places, deepest first.
    edges: Vec<[usize; 2]>,
    /// Of each edge the deepest place of what it joins, at either end: deeper ones lie behind narrower places.
    deepest: Vec<[usize; 2]>,
}

/// An edge of the tree that is a neck.
struct Candidate {
    edge: usize,
    /// The largest depth on its thinner side.
    depth_mm: f64,
    /// The largest that its radius may be, as a part of the least that the thinner side's may be.
    share: f64,
}

impl Tree {
    fn new(boxed: &Boxed, skeleton: &Skeleton, progress: &Progress) -> Result<Self, LesionsError> {
        let place = |at_mm: DVec3| {
            // A point between voxels of a thin part may lie in none.
            let inside = boxed.voxel_at(at_mm);
            let voxel = inside.or_else(|| boxed.grid.voxel_at(at_mm)).unwrap_or_default();
            Place { depth_mm: boxed.depth_mm(voxel), radius_mm: boxed.radius_mm(voxel) }
        };
        let places: Vec<Place> = skeleton.points.iter().map(|point| place(point.position_mm)).collect();
        progress.check()?;
        let mut all: Vec<[usize; 2]> = Vec::new();
        for line in &skeleton.lines {
            all.extend(line.iter().zip(line.iter().skip(1)).map(|(a, b)| [*a as usize, *b as usize]));
        }
        let depth_mm = |at: usize| places.get(at).map_or(0.0, |place: &Place| place.depth_mm);
        let least_mm = |[a, b]: &[usize; 2]| depth_mm(*a).min(depth_mm(*b));
        all.sort_by(|a, b| least_mm(b).total_cmp(&least_mm(a)).then(a.cmp(b)));
        let mut sets = Sets::new(places.len());
        let mut deepest_of: Vec<usize> = (0..places.len()).collect();
        let (mut edges, mut deepest) = (Vec::new(), Vec::new());
        for [a, b] in all {
            let roots = [sets.root(a), sets.root(b)];
            if roots[0] == roots[1] {
                continue;
            }
            let ends = roots.map(|root| deepest_of[root]);
            edges.push([a, b]);
            deepest.push(ends);
            sets.join(a, b);
            let [one, other] = ends;
            deepest_of[sets.root(a)] = if depth_mm(other) > depth_mm(one) { other } else { one };
        }
        Ok(Self { places, edges, deepest })
    }

    fn radius_mm(&self, at: usize) -> f64 {
        self.places.get(at).map_or(0.0, |place| place.radius_mm)
    }

    fn depth_mm(&self, at: usize) -> f64 {
        self.places.get(at).map_or(0.0, |place| place.depth_mm)
    }

    /// The shallower end of an edge.
    fn shallow_end(&self, [a, b]: [usize; 2]) -> usize {
        if self.depth_mm(b) < self.depth_mm(a) { b } else { a }
    }

    /// All edges that are shallower than the deepest place at either end.
    fn necks(&self) -> Vec<Candidate> {
        let candidate = |(edge, (ends, deepest)): (usize, (&[usize; 2], &[usize; 2]))| {
            let at = self.shallow_end(*ends);
            let least = |mm: [f64; 2]| mm[0].min(mm[1]);
            let thinner_mm = least(deepest.map(|at| self.radius_mm(at)));
            let depth_mm = least(deepest.map(|at| self.depth_mm(at)));
            let is_neck = deepest.iter().all(|deep| self.depth_mm(*deep) > self.depth_mm(at));
            is_neck.then(|| Candidate { edge, depth_mm, share: self.depth_mm(at) / thinner_mm })
        };
        self.edges.iter().zip(&self.deepest).enumerate().filter_map(candidate).collect()
    }

    fn described(&self, neck: &Candidate, skeleton: &Skeleton) -> Neck {
        let place_mm = |at: usize| skeleton.points.get(at).map_or(DVec3::NAN, |point| point.position_mm);
        let mut sides = self.deepest[neck.edge];
        if self.depth_mm(sides[1]) > self.depth_mm(sides[0]) {
            sides.swap(0, 1);
        }
        let at = self.middle(neck.edge, sides);
        Neck {
            at_mm: place_mm(at),
            radius_mm: self.depth_mm(at),
            seeds_mm: sides.map(place_mm),
            side_radii_mm: sides.map(|at| self.radius_mm(at)),
        }
    }

    /// The middle of all places as shallow as the edge on the way between the sides.
    fn middle(&self, edge: usize, [from, to]: [usize; 2]) -> usize {
        let shallow = self.shallow_end(self.edges[edge]);
        let mut next: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for [a, b] in &self.edges {
            next.entry(*a).or_default().push(*b);
            next.entry(*b).or_default().push(*a);
        }
        let mut came: BTreeMap<usize, usize> = BTreeMap::from([(from, from)]);
        let mut front = vec![from];
        while let Some(place) = front.pop() {
            for other in next.get(&place).into_iter().flatten() {
                came.entry(*other).or_insert_with(|| {
                    front.push(*other);
                    place
                });
            }
        }
        let mut narrow = Vec::new();
        let mut place = to;
        while place != from {
            if self.depth_mm(place) <= self.depth_mm(shallow) {
                narrow.push(place);
            }
            let Some(before) = came.get(&place) else { break };
            place = *before;
        }
        narrow.get(narrow.len() / 2).copied().unwrap_or(shallow)
    }
}
