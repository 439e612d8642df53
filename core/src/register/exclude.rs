//! Leaves masks out of a level.

use std::sync::Arc;

use crate::{
    Grid, Mask, MaskBits,
    distance::{Crop, FeatureTransform},
};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::level::Level;

/// A mask grown by a margin, in a box of its grid.
#[derive(Clone, Debug)]
pub(crate) struct Grown {
    voxel_from_world: DAffine3,
    start: [usize; 3],
    bits: MaskBits,
}

impl Grown {
    /// Whether it holds a place given as voxel indices of its grid.
    fn holds(&self, voxel: DVec3) -> bool {
        let p = voxel + DVec3::splat(0.5);
        let dims = self.bits.dims();
        let local: [f64; 3] = std::array::from_fn(|a| p[a].floor() - self.start[a] as f64);
        let inside = (0..3).all(|a| local[a] >= 0.0 && local[a] < dims[a] as f64);
        inside && self.bits.get(local.map(|v| v as usize))
    }

    /// Whether it holds a place, RAS mm.
    pub fn contains(&self, at_mm: DVec3) -> bool {
        self.holds(self.voxel_from_world.transform_point3(at_mm))
    }

    /// A box about it, RAS mm.
    pub fn bounds_mm(&self) -> (DVec3, DVec3) {
        let world_from_voxel = self.voxel_from_world.inverse();
        let corner = |n: usize| {
            let end = |a: usize| if n >> a & 1 == 1 { self.bits.dims()[a] } else { 0 };
            let at = DVec3::from_array(std::array::from_fn(|a| (self.start[a] + end(a)) as f64 - 0.5));
            world_from_voxel.transform_point3(at)
        };
        let corners = (0..8).map(corner);
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
    }
}

/// `mask` and what lies within `margin_mm` of its voxels' centres, within its own grid; `None` for an empty mask.
pub(crate) fn grown(mask: &Mask, margin_mm: f64) -> Option<Grown> {
    let grid: &Grid = mask.grid();
    let margin_voxels = (margin_mm / grid.spacing_mm().min_element()).ceil().clamp(0.0, 1e6) as usize;
    let crop = Crop::around(&[mask.bits()], margin_voxels)?;
    let at = |local: [usize; 3]| std::array::from_fn(|a| local[a] + crop.start[a]);
    let distances = FeatureTransform::of(mask.bits(), grid, crop).ok().flatten();
    let bits = MaskBits::from_fn(crop.dims, |linear| {
        let voxel = at(crate::grid::ijk(crop.dims, linear));
        let distance = distances.as_ref().and_then(|d| d.distance_mm(voxel));
        distance.map_or_else(|| mask.bits().get(voxel), |d| d <= margin_mm)
    });
    Some(Grown { voxel_from_world: grid.voxel_from_world(), start: crop.start, bits })
}

/// Marks the voxels of `level` whose centres lie in one of the masks as not counting. `centre_mm`: the origin of the
/// level's centred space, RAS mm.
pub(crate) fn exclude(level: &mut Level, centre_mm: DVec3, masks: &[Grown]) {
    if masks.is_empty() {
        return;
    }
    let [nx, ny, _] = level.dims;
    let world_from_level = DAffine3::from_translation(centre_mm) * level.centred_from_voxel();
    let mut values = level.values.as_ref().clone();
    for mask in masks {
        let mask_from_level = mask.voxel_from_world * world_from_level;
        values.par_chunks_mut(nx * ny).enumerate().for_each(|(z, slice)| {
            for (at, value) in slice.iter_mut().enumerate() {
                let voxel = DVec3::new((at % nx) as f64, (at / nx) as f64, z as f64);
                if mask.holds(mask_from_level.transform_point3(voxel)) {
                    *value = f32::NAN;
                }
            }
        });
    }
    level.values = Arc::new(values);
}
