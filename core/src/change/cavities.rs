//! Inner walls: surfaces of masks towards their own cavities. They are reported apart from the outer surface.

use glam::DMat3;

use super::{ChangeError, vectors::PointCloud};
use crate::{MaskBits, grid::ijk, surface::surface_of};

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

impl Cavities {
    /// Of the masks `[before, after]` and the same without cavities, all cropped to one box whose voxel steps are the
    /// columns of `mm`.
    pub(super) fn of(masks: [&MaskBits; 2], filled: [&MaskBits; 2], mm: DMat3) -> Result<Self, ChangeError> {
        let [from_voxels, to_voxels] = [0, 1].map(|date| filled[date].count() - masks[date].count());
        let mut out = Self { from_voxels, to_voxels, signed_mm: Vec::new() };
        if from_voxels == 0 || to_voxels == 0 {
            // A cavity that opens or closes has no wall to compare with: its volumes tell.
            return Ok(out);
        }
        let dims = masks[0].dims();
        let walls = [0, 1].map(|date| {
            let outer = surface_of(filled[date]);
            let mut wall = Vec::new();
            surface_of(masks[date]).for_each(|linear| {
                let voxel = ijk(dims, linear);
                if !outer.get(voxel) {
                    wall.push(voxel);
                }
            });
            wall
        });
        let place_mm = |voxel: &[usize; 3]| mm * glam::DVec3::from_array(voxel.map(|index| index as f64));
        for date in 0..2 {
            let other = 1 - date;
            let ids = (0..walls[other].len() as u32).collect();
            let cloud = PointCloud::new(walls[other].iter().map(place_mm).collect(), ids)?;
            let in_cavity = |voxel: &&[usize; 3]| filled[other].get(**voxel) && !masks[other].get(**voxel);
            let sign = if date == 0 { 1.0 } else { -1.0 };
            let moved = walls[date].iter().filter(in_cavity);
            out.signed_mm.extend(moved.filter_map(|v| Some(sign * cloud.nearest(place_mm(v))?.1)));
        }
        Ok(out)
    }
}
