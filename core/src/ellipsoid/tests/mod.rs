//! References: closed forms, all corners of all voxels, other methods, a solution to 1e-12.

mod big;
mod cache;
mod grids;
mod solver;

use glam::{DAffine3, DVec3};

use super::{ComponentEllipsoid, Ellipsoid, Of, Options, ellipsoids_of};
use crate::{Connectivity, Grid, Mask, MaskBits, Progress, Sides, TumorIndex, components::Components};

/// A linear congruential generator; its top bits are random enough for masks.
fn random(state: &mut u64) -> u32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as u32
}

fn index_of(grid: &Grid, masks: &[MaskBits]) -> TumorIndex {
    let masks: Vec<Mask> = masks
        .iter()
        .enumerate()
        .map(|(k, bits)| Mask::new(format!("m{k}"), grid.clone(), bits.clone()).unwrap())
        .collect();
    TumorIndex::new(grid.clone(), &masks.iter().collect::<Vec<_>>()).unwrap()
}

fn all(index: &TumorIndex) -> Vec<ComponentEllipsoid> {
    ellipsoids_of(index, Connectivity::default(), &Options::default(), &Progress::new()).unwrap()
}

fn unit_grid(dims: [usize; 3]) -> Grid {
    Grid::axis_aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap()
}

fn skewed_grid(dims: [usize; 3], offset_mm: f64) -> Grid {
    let matrix = glam::DMat3::from_rotation_z(0.4)
        * glam::DMat3::from_cols(
            DVec3::new(-0.7, 0.0, 0.0),
            DVec3::new(0.2, 0.9, 0.0),
            DVec3::new(0.1, -0.3, 4.0),
        );
    Grid::new(dims, DAffine3 { matrix3: matrix, translation: DVec3::splat(offset_mm) }, Sides::Known).unwrap()
}

fn blob(dims: [usize; 3], state: &mut u64, balls: usize) -> MaskBits {
    let mut coordinate = |axis: usize| f64::from(random(state) % 1000) / 1000.0 * (dims[axis] - 1) as f64;
    let balls: Vec<(DVec3, f64)> = (0..balls)
        .map(|_| (DVec3::new(coordinate(0), coordinate(1), coordinate(2)), coordinate(2) * 0.3 + 1.0))
        .collect();
    MaskBits::from_fn(dims, |l| {
        let p = DVec3::new(
            (l % dims[0]) as f64,
            (l / dims[0] % dims[1]) as f64,
            (l / (dims[0] * dims[1])) as f64,
        );
        balls.iter().any(|&(c, r)| p.distance(c) <= r)
    })
}

/// Highest [`Ellipsoid::level`] over all voxel corners of each component, from labels instead of runs; in
/// the order of the components.
fn highest_levels(components: &Components, grid: &Grid, ellipsoids: &[Ellipsoid]) -> Vec<f64> {
    let dims = grid.dims();
    let mut highest = vec![0.0_f64; ellipsoids.len()];
    for (linear, &label) in components.labels(dims).iter().enumerate() {
        if label == 0 {
            continue;
        }
        let voxel = DVec3::new(
            (linear % dims[0]) as f64,
            (linear / dims[0] % dims[1]) as f64,
            (linear / (dims[0] * dims[1])) as f64,
        );
        for corner in 0..8 {
            let side = |bit: usize| if corner >> bit & 1 == 1 { 0.5 } else { -0.5 };
            let position = voxel + DVec3::new(side(0), side(1), side(2));
            let level =
                ellipsoids[label as usize - 1].level(grid.world_from_voxel().transform_point3(position));
            highest[label as usize - 1] = highest[label as usize - 1].max(level);
        }
    }
    highest
}

/// Every corner is inside, and some corner is on the surface, for every mask and every region.
fn check_corners(index: &TumorIndex, tolerance: f64) {
    let found = all(index);
    let mut checked = 0;
    for mask in 0..index.mask_ids().len() {
        let components = Components::of_index_mask(index, mask, Connectivity::default()).unwrap();
        let component_ellipsoids: Vec<Ellipsoid> =
            found.iter().filter(|c| c.of == Of::Mask(mask)).map(|c| c.enclosing).collect();
        assert_eq!(component_ellipsoids.len(), components.list().len());
        checked += component_ellipsoids.len();
        for level in highest_levels(&components, index.grid(), &component_ellipsoids) {
            assert!((level - 1.0).abs() < tolerance, "{level}");
        }
    }
    let components = Components::of_index(index, Connectivity::default()).unwrap();
    // From raster order to the order of the result: stable by mask count and bits.
    let mut order: Vec<usize> = (0..components.list().len()).collect();
    order.sort_by_key(|&i| (components.list()[i].value.count_ones(), components.list()[i].value));
    let regions: Vec<&ComponentEllipsoid> = found.iter().skip(checked).collect();
    assert_eq!(regions.len(), order.len());
    let mut component_ellipsoids = vec![regions[0].enclosing; order.len()];
    for (at, &i) in order.iter().enumerate() {
        assert_eq!(regions[at].of, Of::Region(components.list()[i].value));
        assert_eq!(regions[at].voxels, components.list()[i].voxels);
        component_ellipsoids[i] = regions[at].enclosing;
    }
    for level in highest_levels(&components, index.grid(), &component_ellipsoids) {
        assert!((level - 1.0).abs() < tolerance, "{level}");
    }
}
