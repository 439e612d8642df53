//! Matches the components of two time points by overlap.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::Serialize;
use strum::IntoStaticStr;

use crate::{Component, Components, Connectivity, Grid, MaskBits, components::TooLarge};

/// What became of the components of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, IntoStaticStr)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Fate {
    /// One component overlaps one of the other time point.
    Matched,
    /// One of the earlier time point overlaps none of the later.
    Vanished,
    /// One of the later time point overlaps none of the earlier.
    Appeared,
    /// One of the earlier time point overlaps several of the later.
    Split,
    /// Several of the earlier time point overlap one of the later.
    Merged,
    /// Several overlap several.
    Regrouped,
}

/// One connected component at one time point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Number of voxels.
    pub voxels: u64,
    /// Their volume.
    pub volume_ml: f64,
    /// Mean of the voxel centres, world millimetres.
    pub centroid_mm: DVec3,
}

/// Components of two time points that overlap, directly or through other components.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// What became of them.
    pub fate: Fate,
    /// Components of the earlier time point, in raster order.
    pub before: Vec<Part>,
    /// Components of the later time point, in raster order.
    pub after: Vec<Part>,
    /// Voxels active at both time points.
    pub kept_voxels: u64,
    /// Whether all of them are smaller than what counts.
    pub is_small: bool,
}

/// The groups of two masks of equal dimensions, and the group of every voxel.
pub(super) struct Groups {
    pub list: Vec<Group>,
    /// Group of each component label of the earlier and the later mask; entry 0 is the background.
    of: [Vec<u32>; 2],
    /// Component label of each voxel, from 1; 0 is the background.
    labels: [Vec<u32>; 2],
    components: [Vec<Component>; 2],
}

impl Groups {
    /// `grid` is the grid of both masks. Components below `smallest_ml` are no pieces of a split or merger.
    pub fn new(before: &MaskBits, after: &MaskBits, grid: &Grid, smallest_ml: f64) -> Result<Self, TooLarge> {
        let dims = before.dims();
        let parts = [before, after].map(|m| Components::of_mask(m, Connectivity::TwentySix));
        let [a, b] = parts;
        let (a, b) = (a?, b?);
        let (labels_before, labels_after) = (a.labels(dims), b.labels(dims));
        let mut overlaps: BTreeMap<(u32, u32), u64> = BTreeMap::new();
        let mut run = ((0, 0), 0);
        for pair in labels_before.iter().copied().zip(labels_after.iter().copied()) {
            if pair != run.0 {
                if run.0.0 > 0 && run.0.1 > 0 {
                    *overlaps.entry(run.0).or_default() += run.1;
                }
                run = (pair, 0);
            }
            run.1 += 1;
        }
        if run.0.0 > 0 && run.0.1 > 0 {
            *overlaps.entry(run.0).or_default() += run.1;
        }
        // Union-find over both lists: the later mask's components follow the earlier's.
        let (na, nb) = (a.list().len(), b.list().len());
        let mut root: Vec<usize> = (0..na + nb).collect();
        fn find(root: &mut [usize], mut i: usize) -> usize {
            while root[i] != i {
                root[i] = root[root[i]];
                i = root[i];
            }
            i
        }
        for &(x, y) in overlaps.keys() {
            let (x, y) = (find(&mut root, x as usize - 1), find(&mut root, na + y as usize - 1));
            root[x.max(y)] = x.min(y);
        }
        let mut list: Vec<Group> = Vec::new();
        let mut group_of: Vec<u32> = Vec::with_capacity(na + nb);
        let part = |c: &Component| Part {
            voxels: c.voxels,
            volume_ml: grid.volume_ml(c.voxels),
            centroid_mm: grid.world_from_voxel().transform_point3(c.centroid_voxel),
        };
        for i in 0..na + nb {
            let r = find(&mut root, i);
            let group = if r == i {
                list.push(Group {
                    fate: Fate::Matched,
                    before: vec![],
                    after: vec![],
                    kept_voxels: 0,
                    is_small: false,
                });
                list.len() as u32 - 1
            } else {
                group_of[r]
            };
            group_of.push(group);
            let target = &mut list[group as usize];
            match i.checked_sub(na) {
                None => target.before.push(part(&a.list()[i])),
                Some(i) => target.after.push(part(&b.list()[i])),
            }
        }
        for (&(x, _), &voxels) in &overlaps {
            list[group_of[x as usize - 1] as usize].kept_voxels += voxels;
        }
        for group in &mut list {
            let [before, after] = [&group.before, &group.after].map(|parts| {
                let counted = parts.iter().filter(|part| part.volume_ml >= smallest_ml).count();
                // Where all are small, they still are what is left of the others.
                (counted, counted.max(usize::from(!parts.is_empty())))
            });
            group.is_small = before.0 + after.0 == 0;
            group.fate = match (before.1, after.1) {
                (1, 1) => Fate::Matched,
                (_, 0) => Fate::Vanished,
                (0, _) => Fate::Appeared,
                (1, _) => Fate::Split,
                (_, 1) => Fate::Merged,
                _ => Fate::Regrouped,
            };
        }
        let with_background = |part: &[u32]| std::iter::once(u32::MAX).chain(part.iter().copied()).collect();
        Ok(Self {
            list,
            of: [with_background(&group_of[..na]), with_background(&group_of[na..])],
            labels: [labels_before, labels_after],
            components: [a.list().to_vec(), b.list().to_vec()],
        })
    }

    /// Group of the voxel at `linear`; `None` where both masks are inactive.
    pub fn at(&self, linear: usize) -> Option<u32> {
        match self.labels.each_ref().map(|labels| labels[linear]) {
            [0, 0] => None,
            [0, later] => Some(self.of_label(1, later)),
            [earlier, _] => Some(self.of_label(0, earlier)),
        }
    }

    /// Group of a component of the earlier (`date` 0) or later mask.
    pub fn of_label(&self, date: usize, label: u32) -> u32 {
        self.of[date][label as usize]
    }

    /// Component label of each voxel of a mask, from 1; 0 is the background.
    pub fn labels(&self, date: usize) -> &[u32] {
        &self.labels[date]
    }

    /// The components of a mask, by their labels less 1.
    pub fn components(&self, date: usize) -> &[Component] {
        &self.components[date]
    }
}
