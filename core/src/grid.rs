//! Voxel grids: dimensions, spacing and position in the patient.

use glam::{DAffine3, DMat3, DMat4, DVec3};

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

/// The four rows of an affine map as a matrix, as files and JSON have it.
pub fn rows(affine: DAffine3) -> [[f64; 4]; 4] {
    DMat4::from(affine).transpose().to_cols_array_2d()
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

    fn grid(dims: [usize; 3], m: DMat3, t: DVec3) -> Grid {
        Grid::new(dims, affine(m, t), Sides::Known).unwrap()
    }

    /// By hand: 3 voxels along x, 4 along y, 5 along z.
    #[test]
    fn linear_indices_run_along_x_first() {
        let dims = [3, 4, 5];
        for (voxel, index) in
            [([0, 0, 0], 0), ([2, 0, 0], 2), ([0, 1, 0], 3), ([0, 0, 1], 12), ([2, 3, 4], 59)]
        {
            assert_eq!((linear(dims, voxel), ijk(dims, index)), (index, voxel));
            let grid = grid(dims, DMat3::IDENTITY, DVec3::ZERO);
            assert_eq!((grid.linear(voxel), grid.ijk(index)), (index, voxel));
        }
    }

    #[test]
    fn a_grid_has_less_than_two_to_the_forty_voxels() {
        let of = |dims| Grid::new(dims, DAffine3::IDENTITY, Sides::Known);
        assert_eq!(of([1 << 20, 1 << 20, 1]), Err(GridError::Dims([1 << 20, 1 << 20, 1])));
        let largest = of([1 << 20, (1 << 20) - 1, 1]).unwrap();
        assert_eq!(largest.voxel_count(), (1 << 40) - (1 << 20));
        assert_eq!(largest.dims(), [1 << 20, (1 << 20) - 1, 1]);
        assert_eq!(of([2, 3, 5]).unwrap().voxel_count(), 30);
    }

    /// Columns of lengths 2, 3 and 5 at 60 degrees: by hand, 2·3·5·sin 60°.
    #[test]
    fn spacings_and_volumes_are_those_of_the_matrix() {
        let m = DMat3::from_cols(DVec3::X * 2.0, DVec3::new(1.5, 1.5 * 3.0_f64.sqrt(), 0.0), DVec3::Z * 5.0);
        let grid = grid([2, 2, 2], m, DVec3::ZERO);
        assert!((grid.spacing_mm() - DVec3::new(2.0, 3.0, 5.0)).length() < 1e-14);
        let volume_mm3 = 30.0 * 0.75_f64.sqrt();
        assert!((grid.voxel_volume_mm3() - volume_mm3).abs() < 1e-12);
        assert!((grid.volume_ml(7) - 7.0 * volume_mm3 / 1000.0).abs() < 1e-12);
        let mirrored = DMat3::from_cols(m.y_axis, m.x_axis, m.z_axis);
        assert!((self::grid([1; 3], mirrored, DVec3::ZERO).voxel_volume_mm3() - volume_mm3).abs() < 1e-12);
    }

    /// Voxels of 2, 3 and 4 mm, the first centre at (10, 20, 30).
    #[test]
    fn centre_corners_and_bounds_include_the_faces_of_voxels() {
        let grid =
            Grid::axis_aligned([3, 5, 2], DVec3::new(2.0, 3.0, 4.0), DVec3::new(10.0, 20.0, 30.0)).unwrap();
        assert_eq!(grid.center_mm(), DVec3::new(12.0, 26.0, 32.0));
        assert_eq!(grid.center_of_voxel_mm([2, 4, 1]), DVec3::new(14.0, 32.0, 34.0));
        let (low, high) = (DVec3::new(9.0, 18.5, 28.0), DVec3::new(15.0, 33.5, 36.0));
        assert_eq!(grid.bounds_mm(), (low, high));
        let corners = grid.corners_mm();
        for (index, corner) in corners.iter().enumerate() {
            let of = |axis: usize| if index & (1 << axis) == 0 { low[axis] } else { high[axis] };
            assert_eq!(*corner, DVec3::new(of(0), of(1), of(2)), "{index}");
        }
        assert_eq!(grid.sides(), Sides::Known);
        let expected = affine(DMat3::from_diagonal(DVec3::new(2.0, 3.0, 4.0)), DVec3::new(10.0, 20.0, 30.0));
        assert_eq!(grid.world_from_voxel(), expected);
        let voxel = grid.voxel_from_world().transform_point3(DVec3::new(12.0, 26.0, 18.0));
        assert!((voxel - DVec3::new(1.0, 2.0, -3.0)).length() < 1e-14, "{voxel}");
    }

    #[test]
    fn a_voxel_has_its_lower_faces_and_not_its_upper_ones() {
        let grid = Grid::axis_aligned([3, 5, 2], DVec3::new(2.0, 4.0, 8.0), DVec3::ZERO).unwrap();
        assert_eq!(grid.voxel_at(DVec3::new(-1.0, -2.0, -4.0)), Some([0, 0, 0]));
        assert_eq!(grid.voxel_at(DVec3::new(4.9, 17.9, 11.9)), Some([2, 4, 1]));
        assert_eq!(
            grid.voxel_at(DVec3::new(1.0, 2.0, 4.0)),
            Some([1, 1, 1]),
            "the upper face is the next one's"
        );
        for outside in [
            [-1.001, 0.0, 0.0],
            [5.0, 0.0, 0.0],
            [0.0, -2.001, 0.0],
            [0.0, 18.0, 0.0],
            [0.0, 0.0, -4.1],
            [0.0, 0.0, 12.0],
        ] {
            assert_eq!(grid.voxel_at(DVec3::from_array(outside)), None, "{outside:?}");
        }
        assert_eq!(grid.voxel_at(DVec3::NAN), None);
    }

    #[test]
    fn crops_end_at_the_last_voxel() {
        let grid = Grid::axis_aligned([3, 4, 5], DVec3::ONE, DVec3::ZERO).unwrap();
        assert_eq!(grid.crop([0; 3], [3, 4, 5]).unwrap(), grid);
        assert_eq!(grid.crop([2, 3, 4], [1; 3]).unwrap().dims(), [1; 3]);
        for (start, dims) in
            [([2, 3, 4], [1, 1, 2]), ([0, 1, 0], [3, 4, 5]), ([0; 3], [1, 0, 1]), ([3, 0, 0], [0, 1, 1])]
        {
            assert_eq!(grid.crop(start, dims), Err(GridError::Dims(dims)), "{start:?}");
        }
    }

    #[test]
    fn the_same_place_is_within_a_part_of_the_finest_spacing() {
        let at = |dims, x: f64| {
            Grid::axis_aligned(dims, DVec3::new(3.0, 2.0, 4.0), DVec3::new(x, 0.0, 0.0)).unwrap()
        };
        let grid = at([4, 4, 4], 0.0);
        // Half of 2 mm.
        for (x, same) in [(0.0, true), (0.99, true), (-0.99, true), (1.01, false), (-1.01, false)] {
            assert_eq!(grid.same_place(&at([4, 4, 4], x), 0.5), same, "{x}");
        }
        assert!(!grid.same_place(&at([4, 4, 5], 0.0), 0.5), "one slice more");
        assert!(!grid.same_place(&at([4, 4, 5], 0.0), 100.0), "other dimensions, however near");
        assert!(grid.same_place(&grid, 0.0));
    }

    /// The angle from (1, 1, 1) to each axis is acos(1/√3) = 54.7356 degrees, from two axes 45 degrees.
    #[test]
    fn oblique_is_how_far_the_worst_axis_is_off() {
        let upright = grid([2; 3], DMat3::from_diagonal(DVec3::new(-0.5, 2.0, 7.0)), DVec3::ZERO);
        assert!(!upright.is_oblique(0.0) && !upright.is_oblique(1.0));
        let turned =
            DMat3::from_rotation_z(3.0_f64.to_radians()) * DMat3::from_diagonal(DVec3::new(0.5, 2.0, 7.0));
        let turned = grid([2; 3], turned, DVec3::ZERO);
        assert!(turned.is_oblique(2.99) && !turned.is_oblique(3.01));
        let diagonal = DMat3::from_cols(DVec3::ONE * 4.0, DVec3::Y, DVec3::Z);
        let diagonal = grid([2; 3], diagonal, DVec3::ZERO);
        assert!(diagonal.is_oblique(54.73) && !diagonal.is_oblique(54.74));
    }

    #[test]
    fn axis_codes_weigh_directions_not_lengths_and_keep_the_order_at_45_degrees() {
        let codes = |x: [f64; 3], y: [f64; 3], z: [f64; 3]| {
            let m = DMat3::from_cols(DVec3::from_array(x), DVec3::from_array(y), DVec3::from_array(z));
            grid([2; 3], m, DVec3::ZERO).axis_codes().iter().collect::<String>()
        };
        // |cosines|: 0.6 + 1.0 along the axes, 0.8 + 0.1 across; ten times as long, 6.0 + 1.0 against 8.0 + 0.1.
        assert_eq!(codes([6.0, 8.0, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.0]), "RAS");
        assert_eq!(codes([0.6, 0.8, 0.0], [1.0, 0.1, 0.0], [0.0, 0.0, -1.0]), "ARI");
        // Both assignments are equally good.
        assert_eq!(codes([1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]), "RAS");
        for (code, cols) in [
            ("ASR", [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
            ("ILP", [[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
            ("RSA", [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
            ("LPI", [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]),
        ] {
            assert_eq!(codes(cols[0], cols[1], cols[2]), code);
        }
    }

    /// A shear by 1 has the singular values φ and 1/φ, the golden ratio.
    #[test]
    fn condition_at_its_edges() {
        let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Z);
        for scale in [1e-120, 1e-8, 1.0, 1e8, 1e120] {
            assert!((condition_number(shear * scale) / (golden * golden) - 1.0).abs() < 1e-12, "{scale}");
            assert!((condition_number(DMat3::IDENTITY * scale) - 1.0).abs() < 1e-12, "{scale}");
        }
        // Rank 2, and too small for a determinant's sign to be rounding.
        let flat = DMat3::from_cols(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.3, 0.6, 0.9), DVec3::Z);
        assert!(condition_number(flat) > 1e15);
        assert!(condition_number(DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::X)).is_infinite());
        assert!(condition_number(DMat3::from_diagonal(DVec3::new(1.0, f64::NAN, 1.0))).is_infinite());
        let nearly = |z: f64| {
            let m = DMat3::from_rotation_x(0.3) * DMat3::from_diagonal(DVec3::new(1.0, 1.0, z));
            Grid::new([1; 3], affine(m, DVec3::ZERO), Sides::Known).is_ok()
        };
        assert!(nearly(1.01e-8) && !nearly(0.99e-8));
    }

    /// `U diag(1, 3, 12) V`: the columns keep the product with their transpose, and their lengths are 1, 3 and 12.
    #[test]
    fn columns_become_orthogonal_whatever_the_scale() {
        let u = DMat3::from_rotation_y(0.4) * DMat3::from_rotation_z(-1.1);
        let v = DMat3::from_rotation_x(0.9) * DMat3::from_rotation_y(2.2) * DMat3::from_rotation_z(0.5);
        for scale in [1e-16, 1e-9, 1.0, 1e9] {
            let m = u * DMat3::from_diagonal(DVec3::new(1.0, 3.0, 12.0)) * v * scale;
            let c = orthogonal_columns(m);
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                assert!(c[p].dot(c[q]).abs() < 1e-13 * c[p].length() * c[q].length(), "{scale}: {p} {q}");
            }
            let mut lengths = c.map(|column| column.length() / scale);
            lengths.sort_by(f64::total_cmp);
            for (found, expected) in lengths.iter().zip([1.0, 3.0, 12.0]) {
                assert!((found - expected).abs() < 1e-12 * 12.0, "{scale}: {lengths:?}");
            }
            let columns = DMat3::from_cols(c[0], c[1], c[2]);
            let difference = columns * columns.transpose() - m * m.transpose();
            let largest = difference.to_cols_array().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
            assert!(largest < 1e-12 * 144.0 * scale * scale, "{scale}: {largest}");
        }
    }
}
