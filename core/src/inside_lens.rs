//! The voxels of each region inside a ball: the contents of the lens.

use std::ops::RangeInclusive;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::{regions::RegionVolume, tumor_index::IndexData};

/// Number of voxels of each region (bits, voxels) whose centre is inside or on the ball, in the order of
/// the regions; regions without one are left out. Empty when the ball contains no voxel centre, isn't
/// finite or has a negative radius.
///
/// Exact on oblique and sheared grids: each line of voxels is intersected with the ball in closed form,
/// and the voxels at its ends are then tested one by one. Only lines in the ball's bounding box (in index
/// space) are visited.
pub fn voxels_inside(volume: &RegionVolume, center_mm: DVec3, radius_mm: f64) -> Vec<(u32, u64)> {
    if !center_mm.is_finite() || !radius_mm.is_finite() || radius_mm < 0.0 {
        return Vec::new();
    }
    let ball = Ball::new(volume, center_mm, radius_mm);
    let [nx, ny, nz] = volume.grid().dims();
    let [_, ys, zs] = ball.index_box();
    let (Some(ys), Some(zs)) = (indices_in(ys, ny), indices_in(zs, nz)) else { return Vec::new() };
    let regions = volume.bits_of_id().len();
    let counts = zs
        .into_par_iter()
        .map(|z| {
            let mut counts = vec![0_u64; regions];
            for y in ys.clone() {
                let Some(xs) = ball.line(y, z, nx) else { continue };
                let first = (z * ny + y) * nx;
                let line = first + xs.start()..first + xs.end() + 1;
                match volume.ids() {
                    IndexData::U8(ids) => count(&ids[line], &mut counts),
                    IndexData::U16(ids) => count(&ids[line], &mut counts),
                    IndexData::U32(ids) => count(&ids[line], &mut counts),
                }
            }
            counts
        })
        .reduce(|| vec![0; regions], |a, b| a.iter().zip(b).map(|(a, b)| a + b).collect());
    volume.bits_of_id().iter().copied().zip(counts).filter(|&(bits, n)| bits != 0 && n > 0).collect()
}

fn count<T: Copy + Into<u32>>(ids: &[T], counts: &mut [u64]) {
    for &id in ids {
        let id: u32 = id.into();
        if let Some(count) = counts.get_mut(id as usize) {
            *count += 1;
        }
    }
}

/// The whole numbers from 0 to `count - 1` in an interval; `None` when there are none.
fn indices_in((lo, hi): (f64, f64), count: usize) -> Option<RangeInclusive<usize>> {
    let (lo, hi) = (lo.ceil().max(0.0), hi.floor().min(count as f64 - 1.0));
    (lo <= hi).then_some(lo as usize..=hi as usize)
}

/// A ball relative to the grid's first voxel, so that an offset of 1e6 mm costs no precision.
struct Ball {
    mm_from_voxel: DMat3,
    center_mm: DVec3,
    center: DVec3,
    radius_mm: f64,
}

impl Ball {
    fn new(volume: &RegionVolume, center_mm: DVec3, radius_mm: f64) -> Self {
        let world_from_voxel = volume.grid().world_from_voxel();
        let center_mm = center_mm - world_from_voxel.translation;
        let mm_from_voxel = world_from_voxel.matrix3;
        Self { mm_from_voxel, center_mm, center: mm_from_voxel.inverse() * center_mm, radius_mm }
    }

    /// Extent of the ball along each index axis: the lengths of the inverse's rows are voxels per
    /// millimetre. Slightly widened, so that rounding can't leave a voxel out.
    fn index_box(&self) -> [(f64, f64); 3] {
        let rows = self.mm_from_voxel.inverse().transpose();
        [rows.x_axis, rows.y_axis, rows.z_axis].map(DVec3::length).into_iter().enumerate().fold(
            [(0.0, 0.0); 3],
            |mut out, (axis, per_mm)| {
                let half = per_mm * self.radius_mm + 1e-6;
                out[axis] = (self.center[axis] - half, self.center[axis] + half);
                out
            },
        )
    }

    fn contains(&self, x: usize, y: usize, z: usize) -> bool {
        let at_mm = self.mm_from_voxel * DVec3::new(x as f64, y as f64, z as f64);
        at_mm.distance_squared(self.center_mm) <= self.radius_mm * self.radius_mm
    }

    /// First and last voxel of line (y, z) inside; `None` when there is none.
    fn line(&self, y: usize, z: usize, nx: usize) -> Option<RangeInclusive<usize>> {
        let step = self.mm_from_voxel.x_axis;
        let start = self.mm_from_voxel * DVec3::new(0.0, y as f64, z as f64) - self.center_mm;
        let squared = step.length_squared();
        let nearest = -start.dot(step) / squared;
        let off_mm = (start + step * nearest).length();
        let half = ((self.radius_mm - off_mm) * (self.radius_mm + off_mm) / squared).max(0.0).sqrt();
        let slack = 1.0;
        let xs = indices_in((nearest - half - slack, nearest + half + slack), nx)?;
        let (mut first, mut last) = (*xs.start(), *xs.end());
        while !self.contains(first, y, z) {
            if first == last {
                return None;
            }
            first += 1;
        }
        while !self.contains(last, y, z) {
            last -= 1;
        }
        Some(first..=last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Grid, Mask, MaskBits, Regions, Sides, TumorIndex};
    use glam::DAffine3;
    use std::collections::BTreeMap;

    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    fn noise(dims: [usize; 3], matrix: DMat3, offset_mm: DVec3, masks: usize) -> (TumorIndex, RegionVolume) {
        let affine = DAffine3 { matrix3: matrix, translation: offset_mm };
        let grid = Grid::new(dims, affine, Sides::Known).unwrap();
        let mut random = Random(masks as u64 + 1);
        let mask_list: Vec<Mask> = (0..masks)
            .map(|k| {
                let bits = MaskBits::from_fn(dims, |_| random.next() < 0.3);
                Mask::new(format!("m{k}"), grid.clone(), bits).unwrap()
            })
            .collect();
        let index = TumorIndex::new(grid, &mask_list.iter().collect::<Vec<_>>()).unwrap();
        let volume = RegionVolume::of(&index, &Regions::of(&index)).unwrap();
        (index, volume)
    }

    /// Tests every voxel of the whole index, in world millimetres.
    fn brute(index: &TumorIndex, center_mm: DVec3, radius_mm: f64) -> BTreeMap<u32, u64> {
        let [nx, ny, nz] = index.grid().dims();
        let mut out = BTreeMap::new();
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let bits = index.get(index.grid().linear([x, y, z]));
                    let inside = index.grid().center_of_voxel_mm([x, y, z]).distance(center_mm) <= radius_mm;
                    if bits != 0 && inside {
                        *out.entry(bits).or_default() += 1;
                    }
                }
            }
        }
        out
    }

    #[test]
    fn counts_equal_brute_force_on_straight_oblique_sheared_and_mirrored_grids() {
        let straight = DMat3::from_diagonal(DVec3::new(1.0, 2.0, 3.0));
        let oblique = DMat3::from_rotation_z(0.4) * DMat3::from_rotation_x(-0.7) * straight;
        let sheared = DMat3::from_cols(
            DVec3::new(0.8, 0.0, 0.1),
            DVec3::new(0.9, 1.1, 0.0),
            DVec3::new(-0.6, 0.7, 2.0),
        );
        let mirrored = DMat3::from_diagonal(DVec3::new(-1.5, 0.5, 1.0)) * oblique;
        let fine = straight * 0.2;
        for (n, matrix) in [straight, oblique, sheared, mirrored, fine].into_iter().enumerate() {
            for (masks, offset_mm) in [(3, DVec3::splat(-20.0)), (9, DVec3::new(1e6, -1e6, 1e5))] {
                let (index, volume) = noise([23, 17, 11], matrix, offset_mm, masks);
                let mut random = Random(n as u64 * 7 + masks as u64);
                let (lo, hi) = index.grid().bounds_mm();
                let mut most = 0;
                for _ in 0..60 {
                    let part = DVec3::new(random.next(), random.next(), random.next());
                    let center_mm = lo + (hi - lo) * (part * 1.4 - 0.2);
                    let radius_mm = 20.0 * random.next() * random.next();
                    let found: BTreeMap<u32, u64> =
                        voxels_inside(&volume, center_mm, radius_mm).into_iter().collect();
                    assert_eq!(found, brute(&index, center_mm, radius_mm), "{matrix:?} {radius_mm}");
                    most = most.max(found.values().sum());
                }
                assert!(most > 100, "some balls contain many voxels: {most}");
            }
        }
    }

    #[test]
    fn a_large_ball_contains_every_region_and_voxels_on_the_ball_count() {
        let (index, volume) = noise([9, 8, 7], DMat3::IDENTITY, DVec3::ZERO, 2);
        let regions = Regions::of(&index);
        let all: Vec<(u32, u64)> = regions.list().iter().map(|r| (r.bits, r.voxels)).collect();
        assert_eq!(voxels_inside(&volume, DVec3::splat(4.0), 1e4), all);
        // Whole millimetres: voxels exactly on the ball count.
        for radius_mm in [0.0, 1.0, 2.0, 3.0] {
            let center_mm = DVec3::new(4.0, 3.0, 3.0);
            let found: BTreeMap<u32, u64> =
                voxels_inside(&volume, center_mm, radius_mm).into_iter().collect();
            assert_eq!(found, brute(&index, center_mm, radius_mm), "{radius_mm}");
        }
    }

    #[test]
    fn a_point_contains_the_voxel_around_which_it_lies_and_less_than_a_point_none() {
        let grid = Grid::axis_aligned([2, 2, 2], DVec3::ONE, DVec3::ZERO).unwrap();
        let full = Mask::new("full", grid.clone(), MaskBits::full([2, 2, 2])).unwrap();
        let index = TumorIndex::new(grid, &[&full]).unwrap();
        let volume = RegionVolume::of(&index, &Regions::of(&index)).unwrap();
        for (radius_mm, expected) in [(0.0, &[(1, 1)][..]), (-1e-9, &[])] {
            assert_eq!(voxels_inside(&volume, DVec3::X, radius_mm), expected, "{radius_mm}");
        }
    }

    #[test]
    fn balls_without_a_voxel_center_are_empty() {
        let (_, volume) = noise([5, 5, 5], DMat3::IDENTITY, DVec3::ZERO, 1);
        for (center_mm, radius_mm) in [
            (DVec3::splat(500.0), 3.0),
            (DVec3::splat(f64::NAN), 3.0),
            (DVec3::ZERO, f64::NAN),
            (DVec3::ZERO, f64::INFINITY),
            (DVec3::ZERO, -1.0),
            (DVec3::splat(0.5), 0.0),
        ] {
            assert_eq!(voxels_inside(&volume, center_mm, radius_mm), []);
        }
    }
}
