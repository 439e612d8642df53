//! Tests of exported surfaces and files.

mod files;
mod seg_nrrd;
mod surfaces;

use glam::{DAffine3, DMat3, DVec3};

use super::{Mesh, SurfaceKind, mesh};
use crate::{Grid, Mask, MaskBits, Progress, Sides, grid::ijk};

/// Grids of `dims`: isotropic, spacings 1 to 12, mirrored, sheared.
fn grids(dims: [usize; 3]) -> [Grid; 4] {
    let matrices = [
        DMat3::IDENTITY,
        DMat3::from_diagonal(DVec3::new(0.5, 0.5, 6.0)),
        DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 2.0)),
        DMat3::from_cols(DVec3::new(1.0, 0.1, 0.0), DVec3::new(0.3, 0.9, 0.2), DVec3::new(0.0, -0.4, 2.5)),
    ];
    matrices.map(|matrix3| {
        let translation = DVec3::new(-20.5, 13.25, 7.0);
        Grid::new(dims, DAffine3 { matrix3, translation }, Sides::Known).unwrap()
    })
}

/// A mask of pseudorandom voxels.
fn random(dims: [usize; 3], percent: u64, seed: u64) -> MaskBits {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) + 1;
    MaskBits::from_fn(dims, |_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % 100 < percent
    })
}

fn mask_of(grid: &Grid, bits: MaskBits) -> Mask {
    Mask::new("T1", grid.clone(), bits).unwrap()
}

fn at_voxels(grid: &Grid, voxels: &[[usize; 3]]) -> Mask {
    let active = |linear| voxels.contains(&ijk(grid.dims(), linear));
    mask_of(grid, MaskBits::from_fn(grid.dims(), active))
}

fn surface(mask: &Mask, kind: SurfaceKind) -> Mesh {
    mesh(mask, kind, &Progress::new()).unwrap()
}
