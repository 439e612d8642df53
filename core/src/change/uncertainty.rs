//! Where two surfaces can lie, and which distance between them can be distinguished from none.

use glam::{DMat3, DVec3};

use crate::{
    Grid,
    resample::{SAME_PLACE_VOXELS, TIE_VOXELS, source_from_target},
};

/// Coverage factor: 95 % of a normal distribution.
pub const COVERAGE: f64 = 1.96;

/// Matrices whose entries differ by at most this share count as equal: affines are rounded in files.
const SAME: f64 = 1e-6;

/// Faces of one axis whose rounding is averaged; more would change nothing.
const MAX_FACES: usize = 4096;

/// How a mask came onto the case grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Edges of a voxel of the mask's own grid, as columns, in millimetres.
    native_mm: DMat3,
    /// What places on the case grid lack to those on the mask's own grid: resampling displaced all of the mask's voxel
    /// faces by the opposite, on average.
    pub shift_mm: DVec3,
    /// Covariance of the faces' displacements about that average, mm².
    rounding_mm2: DMat3,
}

impl Sampling {
    /// Of a mask drawn on the case grid itself.
    pub fn native(grid: &Grid) -> Self {
        Self { native_mm: grid.world_from_voxel().matrix3, shift_mm: DVec3::ZERO, rounding_mm2: DMat3::ZERO }
    }

    /// Of a mask on the grid `native`, resampled onto `case` by nearest neighbour. Where the grids' axes are parallel,
    /// each voxel face of the mask moves to a known face of the case grid: the average is a shift, which is known and
    /// no error. (Equal voxels are shifted as a whole.) Where the axes are turned, a face may lie anywhere within half a
    /// voxel of the case grid.
    pub fn new(native: &Grid, case: &Grid) -> Self {
        let mut sampling = Self { native_mm: native.world_from_voxel().matrix3, ..Self::native(case) };
        if case.same_place(native, SAME_PLACE_VOXELS) {
            return sampling;
        }
        let native_from_case = source_from_target(native, case);
        let columns = native_from_case.matrix3.to_cols_array_2d();
        for (axis, column) in columns.into_iter().enumerate() {
            // The native axis along which this axis of the case grid runs.
            let along = (0..3).max_by(|&a, &b| column[a].abs().total_cmp(&column[b].abs())).unwrap_or(0);
            let step = column[along];
            let is_parallel = (0..3).filter(|&a| a != along).all(|a| column[a].abs() <= SAME * step.abs());
            let (mean, variance) = if is_parallel {
                displacement(native.dims()[along], step, native_from_case.translation[along])
            } else {
                (0.0, 1.0 / 12.0)
            };
            let edge_mm = case.world_from_voxel().matrix3.col(axis);
            sampling.shift_mm -= edge_mm * mean;
            sampling.rounding_mm2 += outer(edge_mm) * variance;
        }
        sampling
    }

    /// Edges of a voxel of the mask's own grid, as columns.
    pub(super) fn native_mm(&self) -> DMat3 {
        self.native_mm
    }

    /// The shortest and the longest edge of a voxel of the mask's own grid, mm.
    pub(super) fn native_edges_mm(&self) -> [f64; 2] {
        let m = self.native_mm;
        let edges = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
        [edges.into_iter().fold(f64::INFINITY, f64::min), edges.into_iter().fold(0.0, f64::max)]
    }

    /// Covariance of the position of the mask's surface: it lies anywhere within a voxel of its own grid.
    fn covariance_mm2(&self) -> DMat3 {
        self.native_mm * self.native_mm.transpose() * (1.0 / 12.0) + self.rounding_mm2
    }
}

/// Mean and variance of the displacement of voxel faces by nearest-neighbour resampling along one axis, in voxels of
/// the target: of a source of `count` voxels, whose position along the axis is `first` at the target's first voxel and
/// `step` more at each next.
fn displacement(count: usize, step: f64, first: f64) -> (f64, f64) {
    let tie = TIE_VOXELS / step.abs();
    let faces = count.min(MAX_FACES - 1) + 1;
    let displaced = (0..faces).map(|face| {
        let place = (face as f64 - 0.5 - first) / step;
        // A centre on a face belongs to the source voxel of the higher index: see `resample::mask_onto`.
        let moved = if step > 0.0 { (place - tie).ceil() - 0.5 } else { (place + tie).floor() + 0.5 };
        moved - place
    });
    let (sum, squares) = displaced.fold((0.0, 0.0), |(sum, squares), d| (sum + d, squares + d * d));
    let mean = sum / faces as f64;
    (mean, (squares / faces as f64 - mean * mean).max(0.0))
}

/// `v vᵀ`.
pub(super) fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

/// Uncertainty of a distance between two surfaces: shorter ones can't be distinguished from no change.
///
/// Each surface lies anywhere within a voxel of its mask's own grid, wherever the case grid is finer; with V the edges
/// of that voxel as columns, the covariance of its position is V Vᵀ/12. C is the sum over both masks, plus what
/// resampling onto the case grid moved, plus r² in every direction, r the registration error (standard deviation).
/// A surface with unit normal n has moved by more than can be told from none where it moved by more than
/// `u(n) = 1.96·√(nᵀ C n)` along n. On a grid of spacing s that both masks share, along an axis:
/// `1.96·√(s²/6 + r²)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Registration error between the time points: standard deviation.
    pub registration_mm: f64,
    covariance_mm2: DMat3,
    /// Maps a displacement to one whose length is in standard deviations.
    whitening: DMat3,
    /// The standard deviation, where it is the same in all directions.
    pub(super) isotropic_mm: Option<f64>,
}

impl Uncertainty {
    /// Of two masks sampled so.
    pub fn new(samplings: [Sampling; 2], registration_mm: f64) -> Self {
        let registration = DMat3::from_diagonal(DVec3::splat(registration_mm * registration_mm));
        let c = samplings[0].covariance_mm2() + samplings[1].covariance_mm2() + registration;
        // Cholesky: C = L Lᵀ, so that |L⁻¹ x|² = xᵀ C⁻¹ x.
        let l00 = c.x_axis.x.sqrt();
        let (l10, l20) = (c.x_axis.y / l00, c.x_axis.z / l00);
        let l11 = (c.y_axis.y - l10 * l10).sqrt();
        let l21 = (c.y_axis.z - l20 * l10) / l11;
        let l22 = (c.z_axis.z - l20 * l20 - l21 * l21).sqrt();
        let lower =
            DMat3::from_cols(DVec3::new(l00, l10, l20), DVec3::new(0.0, l11, l21), DVec3::new(0.0, 0.0, l22));
        let least = c.x_axis.x.min(c.y_axis.y).min(c.z_axis.z);
        let most_off = (c - DMat3::from_diagonal(DVec3::splat(least))).to_cols_array();
        let is_isotropic = most_off.iter().all(|off| off.abs() <= SAME * least);
        Self {
            registration_mm,
            covariance_mm2: c,
            whitening: lower.inverse(),
            isotropic_mm: is_isotropic.then(|| least.sqrt()),
        }
    }

    /// u(n) for a surface that faces along `normal_mm`, which may have any length but 0.
    pub fn along(&self, normal_mm: DVec3) -> f64 {
        let n = normal_mm.normalize_or_zero();
        COVERAGE * n.dot(self.covariance_mm2 * n).max(0.0).sqrt()
    }

    /// C: the covariance of the two surfaces' positions together.
    pub(super) fn covariance_mm2(&self) -> &DMat3 {
        &self.covariance_mm2
    }

    /// A displacement in standard deviations.
    pub(super) fn deviations(&self, displacement_mm: DVec3) -> DVec3 {
        self.whitening * displacement_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sides;
    use glam::DAffine3;

    fn grid(dims: [usize; 3], spacing: [f64; 3], origin: [f64; 3]) -> Grid {
        Grid::axis_aligned(dims, DVec3::from_array(spacing), DVec3::from_array(origin)).unwrap()
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9 * b.abs().max(1.0)
    }

    #[test]
    fn uncertainty_in_closed_form() {
        let of = |grid: &Grid, r: f64| Uncertainty::new([Sampling::native(grid); 2], r);
        let u = of(&grid([4; 3], [0.5, 0.5, 6.0], [0.0; 3]), 0.8);
        assert!(close(u.along(DVec3::X * 3.0), 1.96 * (0.25_f64 / 6.0 + 0.64).sqrt()));
        assert!(close(u.along(-DVec3::Z), 1.96 * (6.0_f64 + 0.64).sqrt()));
        // A slanted surface is uncertain by both spacings.
        assert!(close(u.along(DVec3::new(1.0, 0.0, 1.0)), 1.96 * ((0.25 + 36.0) / 12.0 + 0.64_f64).sqrt()));
        assert_eq!(u.isotropic_mm, None);
        let turned = DAffine3::from_mat3(DMat3::from_rotation_x(0.7));
        let u = of(&Grid::new([4; 3], turned, Sides::Known).unwrap(), 0.0);
        assert!(close(u.along(DVec3::new(1.0, 2.0, 3.0)), 1.96 / 6.0_f64.sqrt()));
        assert!(close(u.isotropic_mm.unwrap(), 1.0 / 6.0_f64.sqrt()));
        // One standard deviation along any direction n: the plane with normal n at sqrt(nᵀCn) is one away.
        let u = of(&grid([4; 3], [0.5, 2.0, 6.0], [0.0; 3]), 0.1);
        for n in [DVec3::X, DVec3::Z, DVec3::new(1.0, -2.0, 0.5), DVec3::new(-0.3, 0.2, 3.0)] {
            let n = n.normalize_or_zero();
            let offset = u.along(n) / COVERAGE;
            // Nearest point of the plane in deviations, by the closed form offset/|Lᵀn|, and by search.
            let basis = n.any_orthonormal_pair();
            let mut least = f64::INFINITY;
            for i in -400..=400 {
                for j in -400..=400 {
                    let p = n * offset + basis.0 * (f64::from(i) * 0.02) + basis.1 * (f64::from(j) * 0.02);
                    least = least.min(u.deviations(p).length());
                }
            }
            assert!((least - 1.0).abs() < 1e-3, "{n}: {least}");
        }
    }

    #[test]
    fn the_own_grid_of_a_mask_decides_and_not_the_case_grid() {
        let fine = grid([40, 40, 40], [1.0; 3], [0.0; 3]);
        let thick = grid([40, 40, 8], [1.0, 1.0, 5.0], [0.0, 0.0, 2.0]);
        let u = |masks: [&Grid; 2]| {
            Uncertainty::new(masks.map(|mask| Sampling::new(mask, &fine)), 0.5).along(DVec3::Z)
        };
        assert!(close(u([&fine, &fine]), 1.96 * (1.0_f64 / 6.0 + 0.25).sqrt()));
        // Faces of the thick slices are faces of the fine ones: nothing is rounded.
        assert!(close(u([&thick, &thick]), 1.96 * (25.0_f64 / 6.0 + 0.25).sqrt()));
        assert!(close(u([&fine, &thick]), 1.96 * (26.0_f64 / 12.0 + 0.25).sqrt()));
        // Half a fine voxel off: every face moves by half a voxel, to the same side.
        let between = grid([40, 40, 8], [1.0, 1.0, 5.0], [0.0, 0.0, 2.5]);
        assert!(close(u([&fine, &between]), 1.96 * (26.0_f64 / 12.0 + 0.25).sqrt()));
        assert!(close(Sampling::new(&between, &fine).shift_mm.z, 0.5));
        // Faces at 2, 4.5, 7, … mm: every other one moves by half a voxel.
        let odd = grid([40, 40, 9], [1.0, 1.0, 2.5], [0.0, 0.0, 3.25]);
        let sampling = Sampling::new(&odd, &fine);
        assert!(close(sampling.shift_mm.z, 0.25) && close(sampling.rounding_mm2.z_axis.z, 0.0625));
    }

    /// The displacement measured on masks: half spaces, resampled.
    #[test]
    fn displacements_are_those_of_resampled_masks() {
        use crate::{Mask, MaskBits, Progress, resample::mask_onto};
        let case = grid([1, 1, 80], [1.0; 3], [0.0; 3]);
        for (step, first) in [(2.5, 3.25), (5.0, 2.5), (-2.5, 50.0), (-5.0, 67.5), (1.0, 0.3), (-1.0, 40.5)] {
            let count = 12;
            let columns = DMat3::from_diagonal(DVec3::new(1.0, 1.0, step));
            let affine = DAffine3 { matrix3: columns, translation: DVec3::new(0.0, 0.0, first) };
            let native = Grid::new([1, 1, count], affine, Sides::Known).unwrap();
            let mut displaced = Vec::new();
            // Each face is the border of one voxel alone.
            for k in 0..count {
                let mut bits = MaskBits::empty(native.dims());
                bits.set([0, 0, k]);
                let mask = Mask::new("one", native.clone(), bits).unwrap();
                let on = mask_onto(&mask, &case, &Progress::new()).unwrap();
                let Some((start, size)) = on.bounds() else { continue };
                let low = first + step * k as f64 - step.abs() / 2.0;
                displaced.push(start[2] as f64 - 0.5 - low);
                if k == 0 || k + 1 == count {
                    displaced.push((start[2] + size[2]) as f64 - 0.5 - low - step.abs());
                }
            }
            let sampling = Sampling::new(&native, &case);
            let least = displaced.iter().copied().fold(f64::INFINITY, f64::min);
            let most = displaced.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let middle = f64::midpoint(least, most);
            let half = (most - least) / 2.0;
            assert!(
                (-sampling.shift_mm.z - middle).abs() <= half * 0.2 + 1e-6,
                "{step} {first}: {displaced:?}"
            );
            let deviation = sampling.rounding_mm2.z_axis.z.sqrt();
            assert!(deviation <= half + 1e-6 && deviation >= half * 0.5 - 1e-6, "{step} {first}");
        }
    }

    #[test]
    fn equal_voxels_are_shifted_as_a_whole_in_any_storage_order() {
        let case = grid([20, 20, 9], [1.0, 1.0, 5.0], [0.0; 3]);
        let shifted = grid([20, 20, 9], [1.0, 1.0, 5.0], [0.0, 0.3, 1.5]);
        let sampling = Sampling::new(&shifted, &case);
        assert!(sampling.shift_mm.distance(DVec3::new(0.0, 0.3, 1.5)) < 1e-9, "{sampling:?}");
        assert!(sampling.rounding_mm2.abs_diff_eq(DMat3::ZERO, 1e-12));
        // The same voxels, stored with x reversed and y and z exchanged.
        let columns = DMat3::from_cols(-DVec3::X, DVec3::Z * 5.0, DVec3::Y);
        let affine = DAffine3 { matrix3: columns, translation: DVec3::new(19.0, 0.3, 1.5) };
        let stored = Grid::new([20, 9, 20], affine, Sides::Known).unwrap();
        let sampling = Sampling::new(&stored, &case);
        assert!(sampling.shift_mm.distance(DVec3::new(0.0, 0.3, 1.5)) < 1e-9, "{sampling:?}");
        let u = Uncertainty::new([sampling, Sampling::native(&case)], 0.5);
        assert!(close(u.along(DVec3::Z), 1.96 * (25.0_f64 / 6.0 + 0.25).sqrt()));
    }
}
