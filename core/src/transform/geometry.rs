//! Grids of the two images that were registered.

use glam::{DAffine3, DVec3};

use super::{Refusal, inverse};
use crate::Grid;

/// What is known of an image's grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageGeometry {
    /// Voxels along each axis.
    pub dims: [usize; 3],
    /// Distance between neighbouring voxel centres along each axis.
    pub spacing_mm: DVec3,
    /// Maps voxel indices (centres at whole numbers) to RAS mm.
    pub world_from_voxel: DAffine3,
}

impl ImageGeometry {
    /// That of a voxel grid.
    pub fn of(grid: &Grid) -> Self {
        Self { dims: grid.dims(), spacing_mm: grid.spacing_mm(), world_from_voxel: grid.world_from_voxel() }
    }

    pub(super) fn checked(&self, which: &str) -> Result<&Self, Refusal> {
        let inverse = inverse(self.world_from_voxel);
        let usable = self.dims.iter().all(|&n| n > 0)
            && self.spacing_mm.is_finite()
            && self.spacing_mm.min_element() > 0.0
            && self.world_from_voxel.is_finite()
            && inverse.is_finite();
        usable.then_some(self).ok_or_else(|| {
            Refusal::new(
                format!("a grid of the {which} image without voxels or size"),
                "a voxel grid in space",
            )
        })
    }

    pub(super) fn voxel_from_world(&self) -> DAffine3 {
        inverse(self.world_from_voxel)
    }
}

/// The two images that were registered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Images {
    /// The fixed (reference, target) image.
    pub fixed: ImageGeometry,
    /// The moving (input, floating, source) image.
    pub moving: ImageGeometry,
}
