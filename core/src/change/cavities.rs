//! Outer surfaces and cavities. A component's outer surface faces the background that encloses it; its inner walls face
//! cavities that it encloses, and are reported apart. A nodule within a ring is a component of its own: its surface is
//! an outer one.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};

use super::{ChangeError, groups::Groups, point_cloud::PointCloud};
use crate::{
    MaskBits,
    grid::ijk,
    surface::{surface_of, without_cavities},
};

/// Cavities of a mask at both time points, and how their walls moved.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cavities {
    /// Voxels of cavities at the earlier time point.
    pub from_voxels: u64,
    /// Voxels of cavities at the later time point.
    pub to_voxels: u64,
    /// For each voxel of an inner wall that lies in a cavity of the other time point: distance to the nearest voxel of
    /// that time point's inner walls in millimetres, positive where the cavity widened. Those of the earlier wall
    /// first, then those of the later, each in memory order.
    pub signed_mm: Vec<f64>,
}

/// A mask with what its components enclose.
pub(super) struct Enclosing<'a> {
    pub mask: &'a MaskBits,
    /// Components, by their labels from 1, that enclose an inactive or active voxel that isn't theirs; by voxel.
    enclosed_by: BTreeMap<usize, Vec<u32>>,
}

impl<'a> Enclosing<'a> {
    /// Of the earlier (`date` 0) or later mask of `groups`.
    pub fn new(mask: &'a MaskBits, groups: &Groups, date: usize) -> Result<Self, ChangeError> {
        let mut enclosed_by: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        // A component's cavity is part of one of the whole mask.
        if without_cavities(mask)?.count() == mask.count() {
            return Ok(Self { mask, enclosed_by });
        }
        let dims = mask.dims();
        let labels = groups.labels(date);
        for (number, component) in groups.components(date).iter().enumerate() {
            let label = number as u32 + 1;
            let to_grid = |v: [usize; 3]| {
                let [x, y, z]: [usize; 3] = std::array::from_fn(|a| component.start[a] + v[a]);
                (z * dims[1] + y) * dims[0] + x
            };
            let own = MaskBits::from_fn(component.dims, |l| labels[to_grid(ijk(component.dims, l))] == label);
            let filled = without_cavities(&own)?;
            filled.for_each(|l| {
                let v = ijk(component.dims, l);
                if !own.get(v) {
                    enclosed_by.entry(to_grid(v)).or_default().push(label);
                }
            });
        }
        Ok(Self { mask, enclosed_by })
    }

    /// Inactive voxels that a component encloses.
    fn cavity_voxels(&self) -> u64 {
        let dims = self.mask.dims();
        self.enclosed_by.keys().filter(|linear| !self.mask.get(ijk(dims, **linear))).count() as u64
    }

    /// Whether component `label` encloses the voxel.
    pub fn encloses(&self, label: u32, linear: usize) -> bool {
        self.enclosed_by.get(&linear).is_some_and(|labels| labels.contains(&label))
    }

    /// Whether a component of `group` encloses the voxel.
    pub fn group_encloses(&self, groups: &Groups, date: usize, group: u32, linear: usize) -> bool {
        let labels = self.enclosed_by.get(&linear);
        labels.is_some_and(|labels| labels.iter().any(|label| groups.of_label(date, *label) == group))
    }

    /// Outer surface and inner walls, in memory order; a voxel that is both counts as outer surface.
    pub fn surfaces(&self, groups: &Groups, date: usize) -> [Vec<usize>; 2] {
        let dims = self.mask.dims();
        let labels = groups.labels(date);
        let mut found = [Vec::new(), Vec::new()];
        surface_of(self.mask).for_each(|linear| {
            let v = ijk(dims, linear);
            let label = labels[linear];
            let faces_outside = |side: usize| {
                let (axis, is_upper) = (side / 2, side % 2 == 1);
                let mut to = v;
                if (is_upper && v[axis] + 1 == dims[axis]) || (!is_upper && v[axis] == 0) {
                    return true;
                }
                to[axis] = if is_upper { v[axis] + 1 } else { v[axis] - 1 };
                let next = (to[2] * dims[1] + to[1]) * dims[0] + to[0];
                !self.mask.get(to) && !self.encloses(label, next)
            };
            let is_outer = self.enclosed_by.is_empty() || (0..6).any(faces_outside);
            found[usize::from(!is_outer)].push(linear);
        });
        found
    }
}

impl Cavities {
    /// Of the earlier and the later mask, with their inner walls; voxel steps are the columns of `mm`.
    pub(super) fn of(
        masks: [&Enclosing<'_>; 2],
        walls: [&[usize]; 2],
        mm: DMat3,
    ) -> Result<Self, ChangeError> {
        let [from_voxels, to_voxels] = masks.map(Enclosing::cavity_voxels);
        let mut out = Self { from_voxels, to_voxels, signed_mm: Vec::new() };
        let dims = masks[0].mask.dims();
        let place_mm = |linear: usize| mm * DVec3::from_array(ijk(dims, linear).map(|index| index as f64));
        for date in 0..2 {
            let other = 1 - date;
            // A cavity that opens or closes has no wall to compare with: its volumes tell.
            if walls[other].is_empty() {
                continue;
            }
            let places = walls[other].iter().map(|linear| place_mm(*linear)).collect();
            let cloud = PointCloud::new(places, (0..walls[other].len() as u32).collect())?;
            let in_cavity = |linear: &&usize| {
                masks[other].enclosed_by.contains_key(linear) && !masks[other].mask.get(ijk(dims, **linear))
            };
            let sign = if date == 0 { 1.0 } else { -1.0 };
            let moved = walls[date].iter().filter(in_cavity);
            out.signed_mm.extend(moved.filter_map(|linear| Some(sign * cloud.nearest(place_mm(*linear))?.1)));
        }
        Ok(out)
    }
}
