//! Voxel grids: dimensions, spacing and position in the patient.

use glam::{DAffine3, DMat3, DVec3};

/// Condition number of the voxel-to-world matrix above which a grid is refused.
pub const MAX_CONDITION: f64 = 1e8;

/// Whether left and right are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sides {
    /// The file states how the voxels lie in the patient.
    Known,
    /// The file doesn't state it: no view may label L or R.
    Unknown,
}

/// Why a grid is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GridError {
    /// One of the three dimensions is zero, or their product overflows.
    #[error("found dimensions {0:?}, expected three sizes of at least 1 whose product is below 2^40")]
    Dims([usize; 3]),
    /// The matrix has a NaN or an infinity.
    #[error("found a voxel-to-world matrix that is not finite, expected finite numbers")]
    NotFinite,
    /// The matrix is singular, or nearly.
    #[error(
        "found a voxel-to-world matrix of condition {condition:.3e}, expected at most {MAX_CONDITION:.0e}"
    )]
    Singular {
        /// Its condition number (infinite when singular).
        condition: f64,
    },
}

/// A regular grid of voxels. `x` varies fastest in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    dims: [usize; 3],
    world_from_voxel: DAffine3,
    sides: Sides,
}

/// Voxel indices of a linear index in a volume of `dims` voxels, x fastest.
pub fn ijk(dims: [usize; 3], linear: usize) -> [usize; 3] {
    [linear % dims[0], linear / dims[0] % dims[1], linear / (dims[0] * dims[1])]
}

/// Linear index of voxel `ijk` in a volume of `dims` voxels, x fastest.
pub fn linear(dims: [usize; 3], ijk: [usize; 3]) -> usize {
    (ijk[2] * dims[1] + ijk[1]) * dims[0] + ijk[0]
}

impl Grid {
    /// A grid of `dims` voxels, `world_from_voxel` mapping voxel centres to RAS+ millimetres.
    /// Negative determinants, oblique and sheared matrices are allowed.
    ///
    /// # Errors
    /// [`GridError`] on empty or overflowing dimensions, a matrix that isn't finite, or one with a
    /// condition number above [`MAX_CONDITION`].
    pub fn new(dims: [usize; 3], world_from_voxel: DAffine3, sides: Sides) -> Result<Self, GridError> {
        let count = dims.iter().try_fold(1usize, |product, &d| product.checked_mul(d));
        if !count.is_some_and(|n| n > 0 && n < 1 << 40) {
            return Err(GridError::Dims(dims));
        }
        if !world_from_voxel.is_finite() {
            return Err(GridError::NotFinite);
        }
        let condition = condition_number(world_from_voxel.matrix3);
        // Also false for NaN.
        let usable = condition <= MAX_CONDITION;
        if !usable {
            return Err(GridError::Singular { condition });
        }
        Ok(Self { dims, world_from_voxel, sides })
    }

    /// A grid with axes along R, A and S, its first voxel centre at `origin_mm`.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn axis_aligned(dims: [usize; 3], spacing_mm: DVec3, origin_mm: DVec3) -> Result<Self, GridError> {
        let world_from_voxel = DAffine3 { matrix3: DMat3::from_diagonal(spacing_mm), translation: origin_mm };
        Self::new(dims, world_from_voxel, Sides::Known)
    }

    /// Voxels along each axis, each at least 1.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Maps voxel indices (centres at whole numbers) to RAS+ millimetres.
    pub fn world_from_voxel(&self) -> DAffine3 {
        self.world_from_voxel
    }

    /// The inverse of [`Grid::world_from_voxel`].
    pub fn voxel_from_world(&self) -> DAffine3 {
        // Invert about the translation: an offset of 1e6 mm must not leak into the matrix.
        let inverse = self.world_from_voxel.matrix3.inverse();
        DAffine3 { matrix3: inverse, translation: -(inverse * self.world_from_voxel.translation) }
    }

    /// Whether left and right are known.
    pub fn sides(&self) -> Sides {
        self.sides
    }

    /// Distance between neighbouring voxel centres along each axis.
    pub fn spacing_mm(&self) -> DVec3 {
        let m = self.world_from_voxel.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
    }

    /// Volume of one voxel, correct for sheared grids too.
    pub fn voxel_volume_mm3(&self) -> f64 {
        self.world_from_voxel.matrix3.determinant().abs()
    }

    /// Volume of `voxels` voxels in millilitres.
    pub fn volume_ml(&self, voxels: u64) -> f64 {
        voxels as f64 * self.voxel_volume_mm3() / 1000.0
    }

    /// Number of voxels.
    pub fn voxel_count(&self) -> usize {
        self.dims[0] * self.dims[1] * self.dims[2]
    }

    /// Linear index of voxel `ijk`, which must lie inside [`Grid::dims`].
    pub fn linear(&self, ijk: [usize; 3]) -> usize {
        linear(self.dims, ijk)
    }

    /// Voxel indices of a linear index: the inverse of [`Grid::linear`].
    pub fn ijk(&self, linear: usize) -> [usize; 3] {
        ijk(self.dims, linear)
    }

    /// Position of a voxel's centre, world millimetres.
    pub fn center_of_voxel_mm(&self, ijk: [usize; 3]) -> DVec3 {
        self.world_from_voxel.transform_point3(DVec3::new(ijk[0] as f64, ijk[1] as f64, ijk[2] as f64))
    }

    /// The voxel that contains `world_mm`, or `None` outside the grid.
    pub fn voxel_at(&self, world_mm: DVec3) -> Option<[usize; 3]> {
        let v = self.voxel_from_world().transform_point3(world_mm);
        let mut ijk = [0; 3];
        for axis in 0..3 {
            let cell = (v[axis] + 0.5).floor();
            if !(cell >= 0.0 && cell < self.dims[axis] as f64) {
                return None;
            }
            ijk[axis] = cell as usize;
        }
        Some(ijk)
    }

    /// Centre of the grid, world millimetres.
    pub fn center_mm(&self) -> DVec3 {
        let last =
            DVec3::new((self.dims[0] - 1) as f64, (self.dims[1] - 1) as f64, (self.dims[2] - 1) as f64);
        self.world_from_voxel.transform_point3(last * 0.5)
    }

    /// The eight outer corners (voxel faces, not centres), in world millimetres.
    pub fn corners_mm(&self) -> [DVec3; 8] {
        std::array::from_fn(|corner| {
            let side = |axis: usize| {
                if corner >> axis & 1 == 1 { self.dims[axis] as f64 - 0.5 } else { -0.5 }
            };
            self.world_from_voxel.transform_point3(DVec3::new(side(0), side(1), side(2)))
        })
    }

    /// Bounding box in world millimetres, voxel faces included: minimum and maximum corner.
    pub fn bounds_mm(&self) -> (DVec3, DVec3) {
        let corners = self.corners_mm();
        corners.iter().fold((corners[0], corners[0]), |(lo, hi), &c| (lo.min(c), hi.max(c)))
    }

    /// The subgrid of `dims` voxels from voxel `start`.
    ///
    /// # Errors
    /// [`GridError::Dims`] when the subgrid is empty or extends beyond this grid.
    pub fn crop(&self, start: [usize; 3], dims: [usize; 3]) -> Result<Self, GridError> {
        let inside = (0..3).all(|a| start[a].checked_add(dims[a]).is_some_and(|end| end <= self.dims[a]));
        if !inside || dims.contains(&0) {
            return Err(GridError::Dims(dims));
        }
        let mut world_from_voxel = self.world_from_voxel;
        world_from_voxel.translation = self.center_of_voxel_mm(start);
        Ok(Self { dims, world_from_voxel, sides: self.sides })
    }

    /// Whether both grids have the same dimensions and their corners are at most `tolerance_voxels` times
    /// this grid's finest spacing apart.
    pub fn same_place(&self, other: &Self, tolerance_voxels: f64) -> bool {
        let tolerance_mm = tolerance_voxels * self.spacing_mm().min_element();
        self.dims == other.dims
            && self.corners_mm().iter().zip(other.corners_mm()).all(|(a, b)| a.distance(b) <= tolerance_mm)
    }

    /// Orientation code: the anatomical direction that each voxel axis runs towards (`LPS`, `RAS` …). Each
    /// anatomical axis occurs once: voxel axes are assigned so that the sum of the |cosines| is largest.
    pub fn axis_codes(&self) -> [char; 3] {
        const LETTERS: [[char; 2]; 3] = [['L', 'R'], ['P', 'A'], ['I', 'S']];
        let m = self.world_from_voxel.matrix3;
        let columns = [m.x_axis, m.y_axis, m.z_axis].map(|c| c / c.length());
        let permutations = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let fit = |p: &[usize; 3]| -> f64 { (0..3).map(|a| columns[a][p[a]].abs()).sum() };
        let best = permutations
            .into_iter()
            .fold(permutations[0], |best, p| if fit(&p) > fit(&best) { p } else { best });
        std::array::from_fn(|a| LETTERS[best[a]][usize::from(columns[a][best[a]] > 0.0)])
    }

    /// Whether some voxel axis is more than `degrees` off the nearest anatomical axis.
    pub fn is_oblique(&self, degrees: f64) -> bool {
        let m = self.world_from_voxel.matrix3;
        [m.x_axis, m.y_axis, m.z_axis]
            .iter()
            .any(|c| c.abs().max_element() / c.length() < degrees.to_radians().cos())
    }
}

/// Ratio of the largest to the smallest singular value; infinite for a singular matrix.
fn condition_number(m: DMat3) -> f64 {
    let scale = [m.x_axis, m.y_axis, m.z_axis].iter().map(|c| c.abs().max_element()).fold(0.0, f64::max);
    if scale.is_nan() || scale <= 0.0 {
        return f64::INFINITY;
    }
    let m = m * (1.0 / scale);
    let det = m.determinant().abs();
    if det.is_nan() || det <= 0.0 {
        return f64::INFINITY;
    }
    let c = orthogonal_columns(m);
    let lengths = c.map(DVec3::length);
    let largest = lengths.iter().fold(0.0_f64, |a, &b| a.max(b));
    let smallest = lengths.iter().fold(f64::INFINITY, |a, &b| a.min(b));
    if smallest > 0.0 { largest / smallest } else { f64::INFINITY }
}

/// `m` times a rotation that makes its columns orthogonal: their lengths are the singular values, their
/// directions the left singular vectors. One-sided Jacobi, which never squares the condition number of `m`.
pub(crate) fn orthogonal_columns(m: DMat3) -> [DVec3; 3] {
    let mut c = [m.x_axis, m.y_axis, m.z_axis];
    for _ in 0..30 {
        let mut off_diagonal = 0.0_f64;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (alpha, beta, gamma) = (c[p].length_squared(), c[q].length_squared(), c[p].dot(c[q]));
            if gamma == 0.0 {
                continue;
            }
            off_diagonal = off_diagonal.max(gamma.abs() / (alpha * beta).sqrt());
            let zeta = (beta - alpha) / (2.0 * gamma);
            let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
            let cos = 1.0 / (1.0 + t * t).sqrt();
            let sin = cos * t;
            (c[p], c[q]) = (c[p] * cos - c[q] * sin, c[p] * sin + c[q] * cos);
        }
        if off_diagonal < 1e-14 {
            break;
        }
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    fn affine(m: DMat3, t: DVec3) -> DAffine3 {
        DAffine3 { matrix3: m, translation: t }
    }

    #[test]
    fn condition_of_known_matrices() {
        assert!((condition_number(DMat3::IDENTITY) - 1.0).abs() < 1e-14);
        let m = DMat3::from_rotation_y(0.3) * DMat3::from_diagonal(DVec3::new(1.0, 3.0, 12.0));
        assert!((condition_number(m) - 12.0).abs() < 1e-10);
        let tiny = m * 1e-6;
        assert!((condition_number(tiny) - 12.0).abs() < 1e-10);
        assert!(condition_number(DMat3::ZERO).is_infinite());
    }

    #[test]
    fn invalid_grids_are_refused() {
        let id = DAffine3::IDENTITY;
        assert!(matches!(Grid::new([0, 1, 1], id, Sides::Known), Err(GridError::Dims(_))));
        assert!(matches!(Grid::new([usize::MAX, 2, 1], id, Sides::Known), Err(GridError::Dims(_))));
        let nan = affine(DMat3::IDENTITY, DVec3::new(f64::NAN, 0.0, 0.0));
        assert_eq!(Grid::new([1, 1, 1], nan, Sides::Known), Err(GridError::NotFinite));
        let flat = affine(DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1e-9)), DVec3::ZERO);
        assert!(matches!(Grid::new([1, 1, 1], flat, Sides::Known), Err(GridError::Singular { .. })));
    }

    #[test]
    fn voxels_survive_a_world_round_trip_a_kilometre_away() {
        let m = DMat3::from_rotation_z(0.7) * DMat3::from_diagonal(DVec3::new(-0.5, 0.5, 6.0));
        let grid = Grid::new([20, 30, 5], affine(m, DVec3::splat(1e6)), Sides::Known).unwrap();
        for ijk in [[0, 0, 0], [19, 29, 4], [7, 3, 2]] {
            assert_eq!(grid.voxel_at(grid.center_of_voxel_mm(ijk)), Some(ijk));
        }
        assert_eq!(grid.voxel_at(DVec3::ZERO), None);
        assert!((grid.voxel_volume_mm3() - 1.5).abs() < 1e-12);
    }

    #[test]
    fn axis_codes_follow_the_matrix() {
        let lps = affine(DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0)), DVec3::ZERO);
        assert_eq!(Grid::new([2, 2, 2], lps, Sides::Known).unwrap().axis_codes(), ['L', 'P', 'S']);
        let sar = affine(DMat3::from_cols(DVec3::Z, DVec3::Y, DVec3::X), DVec3::ZERO);
        assert_eq!(Grid::new([2, 2, 2], sar, Sides::Known).unwrap().axis_codes(), ['S', 'A', 'R']);
    }

    #[test]
    fn a_crop_keeps_its_world_position() {
        let grid = Grid::axis_aligned([10, 10, 10], DVec3::new(1.0, 2.0, 3.0), DVec3::splat(-5.0)).unwrap();
        let part = grid.crop([2, 3, 4], [3, 3, 3]).unwrap();
        assert_eq!(part.center_of_voxel_mm([1, 1, 1]), grid.center_of_voxel_mm([3, 4, 5]));
        assert!(grid.crop([8, 0, 0], [3, 1, 1]).is_err());
    }
}
