use glam::DVec3;

use super::{Components, Connectivity};
use crate::{
    grid::Grid,
    grid::ijk,
    mask::{Mask, MaskBits},
    tumor_index::TumorIndex,
};

const ALL: [(Connectivity, i64); 3] =
    [(Connectivity::Six, 1), (Connectivity::Eighteen, 2), (Connectivity::TwentySix, 3)];

/// Labels by voxel-wise flood fill, from 1 in raster order; neighbours differ along at most `axes` axes.
fn flood(dims: [usize; 3], value: &[u32], axes: i64) -> Vec<u32> {
    let size = dims.map(|d| d as i64);
    let mut labels = vec![0; value.len()];
    let mut count = 0;
    for seed in 0..value.len() {
        if value[seed] == 0 || labels[seed] != 0 {
            continue;
        }
        count += 1;
        labels[seed] = count;
        let mut todo = vec![seed as i64];
        while let Some(at) = todo.pop() {
            let p = [at % size[0], at / size[0] % size[1], at / (size[0] * size[1])];
            for n in 0..27 {
                let step = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
                let q: [i64; 3] = std::array::from_fn(|a| p[a] + step[a]);
                if step.iter().map(|s| s.abs()).sum::<i64>() > axes
                    || (0..3).any(|a| q[a] < 0 || q[a] >= size[a])
                {
                    continue;
                }
                let next = (q[2] * size[1] + q[1]) * size[0] + q[0];
                if labels[next as usize] == 0 && value[next as usize] == value[seed] {
                    labels[next as usize] = count;
                    todo.push(next);
                }
            }
        }
    }
    labels
}

/// A linear congruential generator; its top bits are random enough for masks.
fn random(state: &mut u64) -> u32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as u32
}

/// Compares counts, bounding boxes and centroids with those recomputed from the labels.
fn check_numbers(dims: [usize; 3], labels: &[u32], value: &[u32], found: &Components) {
    let count = labels.iter().max().copied().unwrap_or(0) as usize;
    assert_eq!(found.list().len(), count);
    for (i, c) in found.list().iter().enumerate().take(50) {
        let members: Vec<usize> = (0..labels.len()).filter(|&v| labels[v] as usize == i + 1).collect();
        let at = |v: usize| ijk(dims, v);
        assert_eq!(c.voxels, members.len() as u64);
        assert_eq!(c.value, value[members[0]]);
        let mut mean = DVec3::ZERO;
        for axis in 0..3 {
            let low = members.iter().map(|&v| at(v)[axis]).min().unwrap();
            let high = members.iter().map(|&v| at(v)[axis]).max().unwrap();
            assert_eq!((c.start[axis], c.dims[axis]), (low, high - low + 1));
            mean[axis] = members.iter().map(|&v| at(v)[axis]).sum::<usize>() as f64 / members.len() as f64;
        }
        assert!(c.centroid_voxel.distance(mean) < 1e-12);
    }
}

#[test]
fn mask_components_equal_flood_fill() {
    let mut state = 1;
    for dims in
        [[1, 1, 1], [1, 9, 19], [7, 1, 5], [63, 5, 3], [64, 3, 18], [65, 4, 9], [128, 3, 3], [129, 2, 17]]
    {
        let n: usize = dims.iter().product();
        for percent in [8, 20, 35, 60, 95] {
            let value: Vec<u32> = (0..n).map(|_| u32::from(random(&mut state) % 100 < percent)).collect();
            let bits = MaskBits::from_fn(dims, |l| value[l] == 1);
            for (connectivity, axes) in ALL {
                let found = Components::of_mask(&bits, connectivity).unwrap();
                let labels = flood(dims, &value, axes);
                assert_eq!(found.labels(dims), labels, "{dims:?} {percent} % {connectivity:?}");
                check_numbers(dims, &labels, &value, &found);
            }
        }
    }
}

#[test]
fn index_components_equal_flood_fill() {
    let mut state = 2;
    for (dims, masks) in [([65, 9, 19], 2), ([17, 13, 9], 3), ([63, 5, 9], 9), ([1, 30, 17], 17)] {
        let n: usize = dims.iter().product();
        let grid = Grid::axis_aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap();
        // Beyond two masks most are nearly empty, so that equal values still touch.
        let masks: Vec<Mask> = (0..masks)
            .map(|k| {
                let percent = if k < 2 { 50 } else { 4 };
                let bits = MaskBits::from_fn(dims, |_| random(&mut state) % 100 < percent);
                Mask::new(format!("m{k}"), grid.clone(), bits).unwrap()
            })
            .collect();
        let index = TumorIndex::new(grid, &masks.iter().collect::<Vec<_>>()).unwrap();
        let value: Vec<u32> = (0..n).map(|l| index.get(l)).collect();
        for (connectivity, axes) in ALL {
            let found = Components::of_index(&index, connectivity).unwrap();
            let labels = flood(dims, &value, axes);
            assert_eq!(found.labels(dims), labels, "{dims:?} {connectivity:?}");
            check_numbers(dims, &labels, &value, &found);
        }
    }
}

#[test]
fn empty_single_voxel_and_full_masks() {
    let none = Components::of_mask(&MaskBits::empty([70, 5, 20]), Connectivity::default()).unwrap();
    assert!(none.list().is_empty());

    let mut one = MaskBits::empty([70, 5, 20]);
    one.set([64, 4, 16]);
    let one = Components::of_mask(&one, Connectivity::default()).unwrap();
    let c = &one.list()[0];
    assert_eq!((one.list().len(), c.voxels, c.start, c.dims), (1, 1, [64, 4, 16], [1, 1, 1]));
    assert_eq!(c.centroid_voxel, DVec3::new(64.0, 4.0, 16.0));

    let all = Components::of_mask(&MaskBits::full([128; 3]), Connectivity::Six).unwrap();
    let c = &all.list()[0];
    assert_eq!((all.list().len(), c.voxels, c.start, c.dims), (1, 128 * 128 * 128, [0; 3], [128; 3]));
    assert_eq!(c.centroid_voxel, DVec3::splat(63.5));
    assert_eq!(all.runs(c).len(), 128 * 128);
}

#[test]
fn more_components_than_16_bits_can_count() {
    // Every third voxel along each axis: 43 cubed, none touching.
    let third = |l: usize| [l % 128, l / 128 % 128, l / (128 * 128)].iter().all(|p| p.is_multiple_of(3));
    let found = Components::of_mask(&MaskBits::from_fn([128; 3], third), Connectivity::default()).unwrap();
    assert_eq!(found.list().len(), 43 * 43 * 43);
    assert!(found.list().iter().all(|c| c.voxels == 1));
}
