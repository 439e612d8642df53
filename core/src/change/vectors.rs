//! Thesis 7.3.4: vectors from each outer surface voxel to its partner on the other surface, through the skeleton. They end on the
//! surfaces finer than a voxel of [`super::place`].

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{
    COVERAGE, ChangeError, ChangeFlags, SurfaceChange, Uncertainty, Unpartnered,
    cavities::Enclosing,
    groups::Groups,
    place::{Edges, Patch, Places},
    point_cloud::PointCloud,
};
use crate::{Cancelled, Grid, Progress, grid::ijk, skeleton::Skeleton};

/// Surface voxels per progress update.
const BATCH: usize = 1024;

/// A surface voxel of one mask in the crop.
#[derive(Clone, Copy)]
pub(super) struct SurfaceVoxel {
    pub linear: usize,
    pub group: u32,
    /// Offset of its centre from that of the crop's first voxel.
    offset_mm: DVec3,
    /// Where the surface passes it.
    pub patch: Patch,
}

/// The two surfaces and their outer parts, in memory order.
pub(super) struct Surfaces {
    /// All surface voxels of the earlier and the later mask.
    pub all: [Vec<SurfaceVoxel>; 2],
    /// Those outside the other mask, and outside what components of their group enclose there.
    pub outer: [Vec<SurfaceVoxel>; 2],
}

impl Surfaces {
    /// From the outer surface of each mask, where `places` has it.
    pub fn new(
        masks: [&Enclosing<'_>; 2],
        surfaces: [&[usize]; 2],
        groups: &Groups,
        places: &Places<'_>,
    ) -> Self {
        let dims = masks[0].mask.dims();
        let voxels = |date: usize| {
            let voxel = |(linear, patch): (&usize, Patch)| {
                let (linear, group) = (*linear, groups.at(*linear)?);
                let offset_mm = places.center_mm(date, ijk(dims, linear));
                Some(SurfaceVoxel { linear, group, offset_mm, patch })
            };
            let patches = places.patches(date, surfaces[date]);
            surfaces[date].iter().zip(patches).filter_map(voxel).collect::<Vec<_>>()
        };
        let all = [0, 1].map(voxels);
        let outer = |date: usize| {
            let other = 1 - date;
            let is_outside = |s: &&SurfaceVoxel| {
                !masks[other].mask.get(ijk(dims, s.linear))
                    && !masks[other].group_encloses(groups, other, s.group, s.linear)
            };
            all[date].iter().filter(is_outside).copied().collect()
        };
        Self { outer: [outer(0), outer(1)], all }
    }

    /// Sum over the voxels that lie on both outer surfaces of how far the surface moved within them, outwards positive.
    pub fn moved_within_voxels_mm(&self) -> f64 {
        let mut later = self.all[1].iter().peekable();
        let mut sum_mm = 0.0;
        for before in &self.all[0] {
            while later.next_if(|after| after.linear < before.linear).is_some() {}
            if let Some(after) = later.peek().filter(|after| after.linear == before.linear) {
                let normal = (before.patch.normal + after.patch.normal).normalize_or_zero();
                sum_mm += normal.dot(after.patch.middle_mm - before.patch.middle_mm);
            }
        }
        sum_mm
    }
}

/// One cloud per key, from `(key, point, id)` in any order.
fn clouds(mut items: Vec<(u32, DVec3, u32)>) -> Result<BTreeMap<u32, PointCloud>, ChangeError> {
    items.sort_by_key(|&(key, _, id)| (key, id));
    let parts: Vec<&[(u32, DVec3, u32)]> = items.chunk_by(|a, b| a.0 == b.0).collect();
    let made: Result<Vec<(u32, PointCloud)>, ChangeError> = parts
        .into_par_iter()
        .map(|part| {
            let cloud =
                PointCloud::new(part.iter().map(|i| i.1).collect(), part.iter().map(|i| i.2).collect())?;
            Ok((part[0].0, cloud))
        })
        .collect();
    Ok(made?.into_iter().collect())
}

/// Reduces the skeleton to one point per voxel of the crop, the mean of those in it, with its group. Otherwise most
/// skeleton points, as close together as streamline steps, would be nearest to no voxel of the other surface.
pub(super) fn skeleton_points(
    skeleton: &Skeleton,
    start: [usize; 3],
    dims: [usize; 3],
    mm: DMat3,
    shared_surface: &[SurfaceVoxel],
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
    // A point in a cavity belongs to the group of the nearest shared surface voxel.
    let mut shared_cloud: Option<PointCloud> = None;
    let mut points = Vec::with_capacity(by_voxel.len());
    for (linear, (sum, n)) in by_voxel {
        let offset_mm = sum / n;
        let group = match groups.at(linear) {
            Some(group) => Some(group),
            None => {
                let cloud = match &shared_cloud {
                    Some(cloud) => cloud,
                    None => shared_cloud.insert(PointCloud::new(
                        shared_surface.iter().map(|s| s.offset_mm).collect(),
                        shared_surface.iter().map(|s| s.group).collect(),
                    )?),
                };
                cloud.nearest(offset_mm).map(|(group, _)| group)
            }
        };
        points.extend(group.map(|g| (g, offset_mm)));
    }
    Ok(points)
}

/// An outer surface voxel, its partner, whether no voxel shares its skeleton point, and the distance to the other
/// surface in millimetres and in standard deviations.
type Match = (SurfaceVoxel, Option<SurfaceVoxel>, bool, Option<[f64; 2]>);

/// Vectors, and outer surface voxels without a partner.
#[derive(Default)]
pub(super) struct Matches {
    pub vectors: Vec<SurfaceChange>,
    pub unpartnered: Vec<Unpartnered>,
}

/// Finds the partners of all outer surface voxels; results are in memory order of the voxels.
pub(super) fn match_surfaces(
    surfaces: &Surfaces,
    skeleton: &[(u32, DVec3)],
    uncertainty: &Uncertainty,
    shifts_mm: [DVec3; 2],
    crop_frame: &CropFrame<'_>,
    progress: &Progress,
) -> Result<Matches, ChangeError> {
    let edges = Edges::new(crop_frame.grid.world_from_voxel().matrix3);
    let as_near_mm = edges.longest_diagonal_mm();
    // Skeleton points by group; for each surface, its voxels by nearest skeleton point.
    let points =
        clouds(skeleton.iter().zip(0..).map(|(&(group, offset_mm), i)| (group, offset_mm, i)).collect())?;
    let nearest_skeleton_point =
        |s: &SurfaceVoxel| points.get(&s.group).and_then(|cloud| cloud.nearest(s.offset_mm));
    let sets = |voxels: &[SurfaceVoxel]| {
        let items: Vec<(u32, DVec3, u32)> = (voxels.par_iter().zip(0..voxels.len() as u32))
            .filter_map(|(s, i)| Some((nearest_skeleton_point(s)?.0, s.patch.middle_mm, i)))
            .collect();
        clouds(items)
    };
    let groups = |voxels: &[SurfaceVoxel]| {
        clouds(voxels.iter().zip(0..).map(|(s, i)| (s.group, s.patch.middle_mm, i)).collect())
    };
    let whole_surface = |voxels: &[SurfaceVoxel], place: &dyn Fn(DVec3) -> DVec3| {
        let places = voxels.iter().map(|s| place(s.patch.middle_mm)).collect();
        PointCloud::new(places, (0..voxels.len() as u32).collect())
    };
    let deviations = |mm: DVec3| uncertainty.deviations(mm);
    progress.check()?;
    let mut found = Matches::default();
    for (side, shift_mm) in shifts_mm.into_iter().enumerate() {
        let outer = &surfaces.outer[side];
        if outer.is_empty() {
            continue;
        }
        let others = &surfaces.all[1 - side];
        let (sets, by_group) = (sets(others)?, groups(others)?);
        let surface_cloud = whole_surface(others, &|mm| mm)?;
        let deviation_cloud = match uncertainty.isotropic_mm {
            Some(_) => None,
            None => Some(whole_surface(others, &deviations)?),
        };
        let patch = |i: u32| &others[i as usize].patch;
        let distance = |s: &SurfaceVoxel| {
            let here_mm = s.patch.middle_mm;
            let nearest = patch(surface_cloud.nearest(here_mm)?.0);
            let nearest_mm = nearest.foot(here_mm, &edges, None).distance(here_mm);
            let nearest_deviations = match (&deviation_cloud, uncertainty.isotropic_mm) {
                (Some(cloud), _) => {
                    let nearest = patch(cloud.nearest(deviations(here_mm))?.0);
                    let foot_mm = nearest.foot(here_mm, &edges, Some(uncertainty.covariance_mm2()));
                    deviations(foot_mm - here_mm).length()
                }
                (None, one_mm) => nearest_mm / one_mm?,
            };
            Some([nearest_mm, nearest_deviations])
        };
        // The nearest voxel whose skeleton point is as near to this one as its own is, to within a voxel: which of them is
        // nearest can't be told on a ragged surface.
        let in_sets = |s: &SurfaceVoxel| {
            let (_, own_mm) = nearest_skeleton_point(s)?;
            let near = points.get(&s.group)?.within(s.offset_mm, own_mm + as_near_mm);
            let candidates = near.filter_map(|point| sets.get(&point)?.nearest(s.patch.middle_mm));
            candidates.min_by(|(i, a), (j, b)| a.total_cmp(b).then(i.cmp(j)))
        };
        progress.expect(outer.len() as u64);
        let parts: Result<Vec<Vec<Match>>, Cancelled> = outer
            .par_chunks(BATCH)
            .map(|batch| {
                progress.advance(batch.len() as u64)?;
                let choose = |surface_voxel: &SurfaceVoxel| {
                    let near = || {
                        by_group
                            .get(&surface_voxel.group)
                            .and_then(|cloud| cloud.nearest(surface_voxel.patch.middle_mm))
                    };
                    let (partner, no_set) = match in_sets(surface_voxel) {
                        Some((i, _)) => (Some(i), false),
                        None => (near().map(|(i, _)| i), true),
                    };
                    (*surface_voxel, partner.map(|i| others[i as usize]), no_set, distance(surface_voxel))
                };
                Ok(batch.iter().map(choose).collect())
            })
            .collect();
        for (surface_voxel, partner, no_set, nearest) in parts?.into_iter().flatten() {
            let voxel = crop_frame.voxel(surface_voxel.linear);
            let is_growth = side == 1;
            let centre_mm = crop_frame.world(voxel) + shift_mm;
            let (Some(partner), Some([nearest_mm, nearest_deviations])) = (partner, nearest) else {
                found.unpartnered.push(Unpartnered {
                    voxel,
                    position_mm: centre_mm,
                    appeared: is_growth,
                    nearest_mm: nearest.map(|[mm, _]| mm),
                    group: surface_voxel.group,
                });
                continue;
            };
            let end_mm = surface_voxel.patch.middle_mm;
            let foot_mm = partner.patch.foot(end_mm, &edges, None);
            let vector_mm = end_mm - foot_mm;
            let length_mm = vector_mm.length();
            if length_mm == 0.0 {
                // Shifted to the masks' own grids, the surfaces coincide here.
                continue;
            }
            let uncertainty_mm = if nearest_deviations > 0.0 {
                COVERAGE * length_mm / nearest_deviations
            } else {
                uncertainty.along(vector_mm).max(length_mm)
            };
            // Differences in the crop: a grid far away costs no precision.
            let here_mm = centre_mm + (end_mm - surface_voxel.offset_mm);
            let partner_mm = here_mm - vector_mm;
            let (from_mm, to_mm) = if is_growth { (partner_mm, here_mm) } else { (here_mm, partner_mm) };
            found.vectors.push(SurfaceChange {
                voxel,
                from_mm,
                to_mm,
                signed_mm: if is_growth { length_mm } else { -length_mm },
                nearest_mm: nearest_mm.min(length_mm),
                uncertainty_mm,
                group: surface_voxel.group,
                flags: ChangeFlags { no_set, within_uncertainty: nearest_deviations < COVERAGE },
            });
        }
    }
    // No voxel is an outer surface voxel of both masks, so the order is unique.
    found.vectors.sort_unstable_by_key(|v| [v.voxel[2], v.voxel[1], v.voxel[0]]);
    found.unpartnered.sort_unstable_by_key(|v| [v.voxel[2], v.voxel[1], v.voxel[0]]);
    Ok(found)
}

/// Position of the crop in the case grid.
pub(super) struct CropFrame<'a> {
    pub grid: &'a Grid,
    pub start: [usize; 3],
    pub dims: [usize; 3],
}

impl CropFrame<'_> {
    fn voxel(&self, linear: usize) -> [usize; 3] {
        let dims = self.dims;
        let local = ijk(dims, linear);
        std::array::from_fn(|a| self.start[a] + local[a])
    }

    fn world(&self, voxel: [usize; 3]) -> DVec3 {
        self.grid.center_of_voxel_mm(voxel)
    }
}
