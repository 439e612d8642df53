//! From index space to world space: each ellipsoid is mapped by the grid's affine once, at the end.

use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::state::{cholesky, diagonal_product};
use crate::{
    components::{Component, Run},
    grid::orthogonal_columns,
};

/// An ellipsoid in world millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ellipsoid {
    /// Its centre.
    pub center_mm: DVec3,
    /// Its semi-axes, longest first, all above 0.
    pub semi_axes_mm: DVec3,
    /// Its columns are the axes: unit vectors in world space, in the order of `semi_axes_mm`. A
    /// rotation (determinant 1); the largest entry of the first two columns is positive. Axes of equal
    /// length have an arbitrary direction in their plane.
    pub rotation: DMat3,
}

impl Ellipsoid {
    /// The ellipsoid `{center + shape y : |y| ≤ 1}` of index space, mapped by `world_from_voxel`.
    ///
    /// The axes are the left singular vectors of the matrix times `shape`. Computing them from that
    /// product instead of from its square keeps the shortest axis as accurate as the longest.
    pub(super) fn placed(world_from_voxel: &DAffine3, center: DVec3, shape: DMat3) -> Self {
        let mut columns = orthogonal_columns(world_from_voxel.matrix3 * shape);
        columns.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
        let lengths = columns.map(DVec3::length);
        let axis = |i: usize| signed(columns[i] / lengths[i]);
        let (first, second) = (axis(0), axis(1));
        let mut third = columns[2] / lengths[2];
        if first.cross(second).dot(third) < 0.0 {
            third = -third;
        }
        Self {
            center_mm: world_from_voxel.transform_point3(center),
            semi_axes_mm: DVec3::from(lengths),
            rotation: DMat3::from_cols(first, second, third),
        }
    }

    /// Its volume.
    pub fn volume_ml(&self) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * self.semi_axes_mm.element_product() / 1000.0
    }

    /// `|y|²` of a point: below 1 inside, 1 on the surface, above outside.
    pub fn level(&self, point_mm: DVec3) -> f64 {
        (self.rotation.transpose() * (point_mm - self.center_mm) / self.semi_axes_mm).length_squared()
    }
}

/// `axis` or its opposite, whichever has a positive largest entry; of entries that are equal up to
/// rounding, the first counts.
fn signed(axis: DVec3) -> DVec3 {
    let largest = axis.abs().max_element();
    let decides = axis.to_array().into_iter().find(|v| v.abs() > largest * (1.0 - 1e-9));
    if decides.is_some_and(|v| v < 0.0) { -axis } else { axis }
}

/// The ellipsoid with a component's centroid, principal axes and volume, in index space: centre and
/// shape. The voxels count as solid cubes, so that one voxel, a line and a sheet have a volume too.
///
/// A solid ellipsoid's covariance is `shape shapeᵀ / 5`; scaling to the volume makes the 5 cancel.
pub(super) fn moment_shape(component: &Component, runs: &[Run]) -> (DVec3, DMat3) {
    // Whole numbers relative to a voxel near the centroid: sums are exact up to 2^53, and no large
    // numbers cancel.
    let reference = component.centroid_voxel.round();
    let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = [0.0; 6];
    for run in runs {
        let (p, q) = (f64::from(run.first) - reference.x, f64::from(run.last) - reference.x);
        let (y, z) = (f64::from(run.y) - reference.y, f64::from(run.z) - reference.z);
        let n = q - p + 1.0;
        let sum = n * (p + q) / 2.0;
        // p² + … + q².
        xx += n * (2.0 * (p * p + p * q + q * q) + (q - p)) / 6.0;
        xy += sum * y;
        xz += sum * z;
        yy += n * y * y;
        yz += n * y * z;
        zz += n * z * z;
    }
    let n = component.voxels as f64;
    let d = component.centroid_voxel - reference;
    // A cube of side 1 adds 1/12 along each axis.
    let variance = |sum: f64, d: f64| sum / n - d * d + 1.0 / 12.0;
    let (xy, xz, yz) = (xy / n - d.x * d.y, xz / n - d.x * d.z, yz / n - d.y * d.z);
    let covariance = DMat3::from_cols_array(&[
        variance(xx, d.x),
        xy,
        xz,
        xy,
        variance(yy, d.y),
        yz,
        xz,
        yz,
        variance(zz, d.z),
    ]);
    // Eigenvalues are at least 1/12, and rounding is far below that.
    let lower = cholesky(covariance).unwrap_or(DMat3::IDENTITY);
    let scale = (n / (4.0 / 3.0 * std::f64::consts::PI * diagonal_product(&lower))).cbrt();
    (component.centroid_voxel, lower * scale)
}
