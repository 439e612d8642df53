//! Which parts of a volume hold anything.

use glam::DVec3;

use super::{Filter, OpticalVolume, Sight};

/// Voxels along a brick's side.
pub(crate) const SIDE: usize = 8;

/// Ranges in order, those that touch as one.
pub(crate) fn joined(mut all: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<(f64, f64)> = Vec::new();
    for (near, far) in all {
        match out.last_mut() {
            Some(last) if near <= last.1 => last.1 = last.1.max(far),
            _ => out.push((near, far)),
        }
    }
    out
}

/// Bricks of 8x8x8 voxels in which some place may have an extinction above 0.
#[derive(Clone, Debug)]
pub(crate) struct Occupied {
    pub dims: [usize; 3],
    pub bricks: Vec<bool>,
    corners_mm: Vec<[DVec3; 8]>,
}

impl Occupied {
    pub fn of(volume: &OpticalVolume) -> Self {
        let voxels = volume.grid().dims();
        let dims = voxels.map(|d| d.div_ceil(SIDE));
        let world_from_voxel = volume.grid().world_from_voxel();
        let halo = usize::from(volume.filter() == Filter::Linear);
        let mut bricks = Vec::with_capacity(dims.iter().product());
        let mut corners_mm = Vec::new();
        for bz in 0..dims[2] {
            for by in 0..dims[1] {
                for bx in 0..dims[0] {
                    let first = [bx, by, bz].map(|b| b * SIDE);
                    let end: [usize; 3] = std::array::from_fn(|a| (first[a] + SIDE).min(voxels[a]));
                    let range = |a: usize| first[a].saturating_sub(halo)..(end[a] + halo).min(voxels[a]);
                    let (mut least, mut greatest) = (f32::INFINITY, f32::NEG_INFINITY);
                    for z in range(2) {
                        for y in range(1) {
                            let line = volume.grid().linear([0, y, z]);
                            for value in volume.values().get(line..line + voxels[0]).unwrap_or_default()
                                [range(0)]
                            .iter()
                            {
                                least = least.min(*value);
                                greatest = greatest.max(*value);
                            }
                        }
                    }
                    let occupied = volume.table().has_extinction(least, greatest);
                    bricks.push(occupied);
                    if occupied {
                        corners_mm.push(std::array::from_fn(|i| {
                            let corner = DVec3::from_array(std::array::from_fn(|a| {
                                (if i >> a & 1 == 1 { end[a] } else { first[a] }) as f64 - 0.5
                            }));
                            world_from_voxel.transform_point3(corner)
                        }));
                    }
                }
            }
        }
        Self { dims, bricks, corners_mm }
    }

    /// Ranges of view depth that occupied bricks reach, in order, none touching the next.
    pub fn depths_mm(&self, sight: &Sight) -> Vec<(f64, f64)> {
        joined(self.corners_mm.iter().filter_map(|c| sight.depths_mm(c)).collect())
    }

    /// One bit a brick, 32 a word; never empty.
    pub fn words(&self) -> Vec<u32> {
        let mut words = vec![0u32; self.bricks.len().div_ceil(32).max(1)];
        for (i, _) in self.bricks.iter().enumerate().filter(|(_, on)| **on) {
            if let Some(word) = words.get_mut(i / 32) {
                *word |= 1 << (i % 32);
            }
        }
        words
    }
}
