//! The mask that the skeleton is computed from: cropped with a margin of one voxel, cavities filled, in units of the
//! finest spacing.

use glam::{DMat3, DVec3};

use super::SkeletonError;
use crate::{
    Grid, MaskBits, Sides, distance::Crop, distance::FeatureTransform, grid::ijk, surface::without_cavities,
};

/// A mask with its cavities filled, cropped to a box with a margin of one inactive voxel on each side (also at the
/// image's border).
///
/// The unit of length is the finest voxel spacing, the origin the centre of the box's first voxel: powers of distances
/// neither lose precision far from the world origin nor overflow with tiny voxels.
pub(super) struct FilledMask {
    pub bits: MaskBits,
    /// Maps voxels to units: its columns are the voxel steps.
    pub unit_from_voxel: DMat3,
    voxel_from_unit: DMat3,
    /// Grid voxel of the box's voxel (1, 1, 1).
    start: [usize; 3],
    /// Length of a voxel step along each axis, in units: at least 1.
    pub ratio: DVec3,
    /// Active voxels that were cavities.
    pub filled_voxels: u64,
}

impl FilledMask {
    /// `None` when the mask is empty.
    pub fn new(mask: &MaskBits, grid: &Grid) -> Result<Option<Self>, SkeletonError> {
        let Some((start, size)) = mask.bounds() else { return Ok(None) };
        let filled = without_cavities(mask)?;
        let mut bits = MaskBits::empty(size.map(|n| n + 2));
        let dims = mask.dims();
        filled.for_each(|l| {
            let ijk = ijk(dims, l);
            bits.set(std::array::from_fn(|a| ijk[a] - start[a] + 1));
        });
        let unit_mm = grid.spacing_mm().min_element();
        let unit_from_voxel = grid.world_from_voxel().matrix3 * (1.0 / unit_mm);
        Ok(Some(Self {
            filled_voxels: bits.count() - mask.count(),
            bits,
            unit_from_voxel,
            voxel_from_unit: unit_from_voxel.inverse(),
            start,
            ratio: grid.spacing_mm() / unit_mm,
        }))
    }

    /// Whether box voxel `ijk` is active; false outside the box.
    pub fn get(&self, ijk: [i64; 3]) -> bool {
        let dims = self.bits.dims();
        (0..3).all(|a| ijk[a] >= 0 && ijk[a] < dims[a] as i64) && self.bits.get(ijk.map(|v| v as usize))
    }

    /// Converts a box voxel position to units.
    pub fn unit(&self, voxel: DVec3) -> DVec3 {
        self.unit_from_voxel * voxel
    }

    /// Centre of a box voxel in units.
    pub fn center(&self, [i, j, k]: [usize; 3]) -> DVec3 {
        self.unit(DVec3::new(i as f64, j as f64, k as f64))
    }

    /// Box voxel that contains a position; may lie outside the box.
    pub fn voxel_at(&self, unit: DVec3) -> [i64; 3] {
        (self.voxel_from_unit * unit).to_array().map(|v| (v + 0.5).floor() as i64)
    }

    /// Whether a position lies in an active voxel.
    pub fn contains(&self, unit: DVec3) -> bool {
        self.get(self.voxel_at(unit))
    }

    /// Fractional voxel index on the case grid of a position.
    pub fn grid_voxel(&self, unit: DVec3) -> DVec3 {
        let start = DVec3::new(self.start[0] as f64, self.start[1] as f64, self.start[2] as f64);
        self.voxel_from_unit * unit + (start - 1.0)
    }

    /// Linear index of a box voxel.
    pub fn linear(&self, [i, j, k]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.bits.dims();
        (k * ny + j) * nx + i
    }

    /// The inverse of [`FilledMask::linear`].
    pub fn voxel(&self, linear: usize) -> [usize; 3] {
        let dims = self.bits.dims();
        ijk(dims, linear)
    }

    /// Distance transform: distance of every voxel to the nearest inactive one, in units.
    pub fn depth(&self) -> Result<FeatureTransform, SkeletonError> {
        let affine = glam::DAffine3 { matrix3: self.unit_from_voxel, translation: DVec3::ZERO };
        let grid = Grid::new(self.bits.dims(), affine, Sides::Unknown)?;
        let outside = self.bits.inverted();
        FeatureTransform::of(&outside, &grid, Crop::whole(&grid))?.ok_or(SkeletonError::NoOutside)
    }

    /// Voxels covered by a cell of `cells`. `span(cell, axis)` gives the first and last voxel of a cell along an axis.
    pub fn covered(&self, cells: &MaskBits, span: impl Fn(usize, usize) -> (usize, usize)) -> MaskBits {
        let mut covered = MaskBits::empty(self.bits.dims());
        let dims = cells.dims();
        cells.for_each(|l| {
            let cell = ijk(dims, l);
            let [x, y, z] = std::array::from_fn(|a| span(cell[a], a));
            for k in z.0..=z.1 {
                for j in y.0..=y.1 {
                    for i in x.0..=x.1 {
                        covered.set([i, j, k]);
                    }
                }
            }
        });
        covered
    }

    /// Active voxels that can't be reached from `covered` within `max_steps` steps (26-neighbourhood, inside the
    /// mask), in memory order: parts too thin to contain a cell, but not bumps of the surface.
    pub fn thin(&self, covered: &MaskBits, max_steps: usize) -> Vec<[usize; 3]> {
        let mut reached = covered.clone();
        let mut front: Vec<[usize; 3]> = Vec::new();
        // Only uncovered voxels are visited: few in a compact mask.
        let mut uncovered = Vec::new();
        self.bits.for_each(|l| {
            let ijk = self.voxel(l);
            if !covered.get(ijk) {
                uncovered.push(ijk);
                if neighbours(ijk).any(|n| covered.get(n)) {
                    front.push(ijk);
                }
            }
        });
        for _ in 0..max_steps {
            front.iter().for_each(|&ijk| reached.set(ijk));
            let mut next: Vec<[usize; 3]> = front
                .iter()
                .flat_map(|&ijk| neighbours(ijk))
                .filter(|&n| self.bits.get(n) && !reached.get(n))
                .collect();
            next.sort_unstable();
            next.dedup();
            front = next;
        }
        uncovered.retain(|&ijk| !reached.get(ijk));
        uncovered
    }
}

/// The 26 neighbours of an active voxel; the margin keeps them inside the box.
pub(super) fn neighbours([i, j, k]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..27).filter(|&n| n != 13).map(move |n| [i + n % 3 - 1, j + n / 3 % 3 - 1, k + n / 9 - 1])
}
