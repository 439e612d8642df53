//! Thesis 7.3.4: from each outer surface voxel to the other surface, by way of the skeleton.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{ChangeError, ChangeFlags, SurfaceChange, Uncertainty, Unpartnered, groups::Groups};
use crate::{Cancelled, Grid, MaskBits, Progress, distance::KdTree, skeleton::Skeleton};

/// Points of a set up to which looking at all beats a tree.
const SMALL: usize = 48;

/// Sites between looks at the progress.
const BATCH: usize = 1024;

/// A surface voxel in the crop.
#[derive(Clone, Copy)]
pub(super) struct Site {
    pub linear: usize,
    pub group: u32,
    /// Millimetres from the crop's first voxel.
    at: DVec3,
}

/// The two surfaces, outer parts marked, in memory order.
pub(super) struct Surfaces {
    /// Of the earlier and the later mask.
    pub all: [Vec<Site>; 2],
    /// Those where the other mask is inactive, the same way.
    pub outer: [Vec<Site>; 2],
}

impl Surfaces {
    pub fn new(masks: [&MaskBits; 2], groups: &Groups, mm: DMat3) -> Self {
        let [nx, ny, _] = masks[0].dims();
        let sites = |mask: &MaskBits| {
            let mut sites = Vec::new();
            crate::surface::surface_of(mask).for_each(|linear| {
                let v = [linear % nx, linear / nx % ny, linear / (nx * ny)].map(|v| v as f64);
                let at = mm * DVec3::from_array(v);
                if let Some(group) = groups.at(linear) {
                    sites.push(Site { linear, group, at });
                }
            });
            sites
        };
        let all = masks.map(sites);
        let outer = |mine: usize| {
            let other = masks[1 - mine];
            let out = |s: &&Site| !other.get([s.linear % nx, s.linear / nx % ny, s.linear / (nx * ny)]);
            all[mine].iter().filter(out).copied().collect()
        };
        Self { outer: [outer(0), outer(1)], all }
    }
}

/// Points with the tree over them, and what each is.
struct Cloud {
    tree: Option<KdTree>,
    points: Vec<DVec3>,
    index: Vec<u32>,
}

impl Cloud {
    fn new(points: Vec<DVec3>, index: Vec<u32>) -> Result<Self, ChangeError> {
        let tree = if points.len() > SMALL { KdTree::new(&points)? } else { None };
        Ok(Self { tree, points, index })
    }

    /// The nearest point's `index` and distance; the first of equals.
    fn nearest(&self, p: DVec3) -> Option<(u32, f64)> {
        if let Some(tree) = &self.tree {
            return tree.nearest(p).map(|(i, d)| (self.index[i], d));
        }
        let mut best: Option<(f64, usize)> = None;
        for (i, q) in self.points.iter().enumerate() {
            let d = q.distance_squared(p);
            if best.is_none_or(|(least, _)| d < least) {
                best = Some((d, i));
            }
        }
        best.map(|(d, i)| (self.index[i], d.sqrt()))
    }
}

/// Clouds by a key, from `(key, point, index)` in any order.
fn clouds(mut items: Vec<(u32, DVec3, u32)>) -> Result<BTreeMap<u32, Cloud>, ChangeError> {
    items.sort_by_key(|&(key, _, index)| (key, index));
    let parts: Vec<&[(u32, DVec3, u32)]> = items.chunk_by(|a, b| a.0 == b.0).collect();
    let made: Result<Vec<(u32, Cloud)>, ChangeError> = parts
        .into_par_iter()
        .map(|part| {
            let cloud = Cloud::new(part.iter().map(|i| i.1).collect(), part.iter().map(|i| i.2).collect())?;
            Ok((part[0].0, cloud))
        })
        .collect();
    Ok(made?.into_iter().collect())
}

/// One skeleton point a voxel of the crop: the mean of those in it, with its group. Without that the
/// sets of the surface's voxels would be as thin as the streamlines' steps.
pub(super) fn skeleton_sites(
    skeleton: &Skeleton,
    start: [usize; 3],
    dims: [usize; 3],
    mm: DMat3,
    both: &[Site],
    groups: &Groups,
) -> Result<Vec<(u32, DVec3)>, ChangeError> {
    let mut by_voxel: BTreeMap<usize, (DVec3, f64)> = BTreeMap::new();
    for point in &skeleton.points {
        let local = point.voxel - DVec3::new(start[0] as f64, start[1] as f64, start[2] as f64);
        let v: [usize; 3] =
            std::array::from_fn(|a| ((local[a] + 0.5).floor().max(0.0) as usize).min(dims[a] - 1));
        let sum = by_voxel.entry((v[2] * dims[1] + v[1]) * dims[0] + v[0]).or_default();
        sum.0 += mm * local;
        sum.1 += 1.0;
    }
    // A point in a cavity belongs to what is around it.
    let mut around: Option<Cloud> = None;
    let mut sites = Vec::with_capacity(by_voxel.len());
    for (linear, (sum, n)) in by_voxel {
        let at = sum / n;
        let group = match groups.at(linear) {
            Some(group) => Some(group),
            None => {
                let cloud = match &around {
                    Some(cloud) => cloud,
                    None => around.insert(Cloud::new(
                        both.iter().map(|s| s.at).collect(),
                        both.iter().map(|s| s.group).collect(),
                    )?),
                };
                cloud.nearest(at).map(|(group, _)| group)
            }
        };
        sites.extend(group.map(|g| (g, at)));
    }
    Ok(sites)
}

/// A site, its partner, whether its set was empty, and the plain nearest distance.
type Choice = (Site, Option<Site>, bool, Option<f64>);

/// What [`find`] found.
#[derive(Default)]
pub(super) struct Found {
    pub vectors: Vec<SurfaceChange>,
    pub unpartnered: Vec<Unpartnered>,
}

/// Vectors of all outer surface voxels, by voxel in memory order.
pub(super) fn find(
    surfaces: &Surfaces,
    skeleton: &[(u32, DVec3)],
    uncertainty: &Uncertainty,
    place: &Place<'_>,
    progress: &Progress,
) -> Result<Found, ChangeError> {
    // Skeleton points of each group, and for each surface the sets of each skeleton point.
    let points = clouds(skeleton.iter().zip(0..).map(|(&(group, at), i)| (group, at, i)).collect())?;
    let own = |s: &Site| points.get(&s.group).and_then(|cloud| cloud.nearest(s.at)).map(|(i, _)| i);
    let sets = |sites: &[Site]| {
        let items: Vec<(u32, DVec3, u32)> = (sites.par_iter().zip(0..sites.len() as u32))
            .filter_map(|(s, i)| Some((own(s)?, s.at, i)))
            .collect();
        clouds(items)
    };
    let groups = |sites: &[Site]| clouds(sites.iter().zip(0..).map(|(s, i)| (s.group, s.at, i)).collect());
    let whole =
        |sites: &[Site]| Cloud::new(sites.iter().map(|s| s.at).collect(), (0..sites.len() as u32).collect());
    progress.check()?;
    let mut found = Found::default();
    for mine in 0..2 {
        let outer = &surfaces.outer[mine];
        if outer.is_empty() {
            continue;
        }
        let others = &surfaces.all[1 - mine];
        let (sets, by_group, any) = (sets(others)?, groups(others)?, whole(others)?);
        progress.expect(outer.len() as u64);
        let parts: Result<Vec<Vec<Choice>>, Cancelled> = outer
            .par_chunks(BATCH)
            .map(|batch| {
                progress.advance(batch.len() as u64)?;
                let choose = |site: &Site| {
                    let nearest_mm = any.nearest(site.at).map(|(_, d)| d);
                    let in_set = own(site).and_then(|s| sets.get(&s)).and_then(|set| set.nearest(site.at));
                    let near = || by_group.get(&site.group).and_then(|cloud| cloud.nearest(site.at));
                    let (partner, no_set) = match in_set {
                        Some((i, _)) => (Some(i), false),
                        None => (near().map(|(i, _)| i), true),
                    };
                    (*site, partner.map(|i| others[i as usize]), no_set, nearest_mm)
                };
                Ok(batch.iter().map(choose).collect())
            })
            .collect();
        for (site, partner, no_set, nearest_mm) in parts?.into_iter().flatten() {
            let voxel = place.voxel(site.linear);
            let grows = mine == 1;
            let (Some(partner), Some(nearest_mm)) = (partner, nearest_mm) else {
                let position_mm = place.world(voxel);
                found.unpartnered.push(Unpartnered {
                    voxel,
                    position_mm,
                    appeared: grows,
                    nearest_mm,
                    group: site.group,
                });
                continue;
            };
            let (here, there) = (place.world(voxel), place.world(place.voxel(partner.linear)));
            let way = site.at - partner.at;
            let length = way.length();
            let uncertainty_mm = uncertainty.along(way);
            let (from_mm, to_mm) = if grows { (there, here) } else { (here, there) };
            found.vectors.push(SurfaceChange {
                voxel,
                from_mm,
                to_mm,
                signed_mm: if grows { length } else { -length },
                nearest_mm,
                uncertainty_mm,
                group: site.group,
                flags: ChangeFlags { no_set, within_uncertainty: length < uncertainty_mm },
            });
        }
    }
    // No voxel is outer on both sides.
    found.vectors.sort_unstable_by_key(|v| [v.voxel[2], v.voxel[1], v.voxel[0]]);
    found.unpartnered.sort_unstable_by_key(|v| [v.voxel[2], v.voxel[1], v.voxel[0]]);
    Ok(found)
}

/// Where the crop is.
pub(super) struct Place<'a> {
    pub grid: &'a Grid,
    pub start: [usize; 3],
    pub dims: [usize; 3],
}

impl Place<'_> {
    fn voxel(&self, linear: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        let local = [linear % nx, linear / nx % ny, linear / (nx * ny)];
        std::array::from_fn(|a| self.start[a] + local[a])
    }

    fn world(&self, voxel: [usize; 3]) -> DVec3 {
        self.grid.center_of_voxel_mm(voxel)
    }
}
