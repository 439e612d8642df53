//! An image on its native grid, stored in its file's data type and scaled on access.

use crate::grid::Grid;

/// Stored voxel values in the file's data type, `x` fastest.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "each variant is its type")]
pub enum Samples {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    U64(Vec<u64>),
    I64(Vec<i64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Runs `$body` with `$v` bound to the vector inside any variant of [`Samples`].
#[macro_export]
macro_rules! with_samples {
    ($samples:expr, $v:ident => $body:expr) => {
        match $samples {
            $crate::Samples::U8($v) => $body,
            $crate::Samples::I8($v) => $body,
            $crate::Samples::U16($v) => $body,
            $crate::Samples::I16($v) => $body,
            $crate::Samples::U32($v) => $body,
            $crate::Samples::I32($v) => $body,
            $crate::Samples::U64($v) => $body,
            $crate::Samples::I64($v) => $body,
            $crate::Samples::F32($v) => $body,
            $crate::Samples::F64($v) => $body,
        }
    };
}

impl Samples {
    /// Number of voxels.
    pub fn len(&self) -> usize {
        with_samples!(self, v => v.len())
    }

    /// Whether there are no voxels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether stored values are integers.
    pub fn is_integer(&self) -> bool {
        !matches!(self, Self::F32(_) | Self::F64(_))
    }

    /// Number of voxels that are NaN or infinite.
    pub fn not_finite(&self) -> usize {
        match self {
            Self::F32(values) => values.iter().filter(|value| !value.is_finite()).count(),
            Self::F64(values) => values.iter().filter(|value| !value.is_finite()).count(),
            _ => 0,
        }
    }
}

/// Values this close to an integer count as that label: a slope stored as `f32` turns 3 into 3.0000001.
const LABEL_TOLERANCE: f64 = 1e-2;

/// `value = slope · stored + intercept`, in `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaling {
    /// Factor; never zero, always finite.
    pub slope: f64,
    /// Offset; always finite.
    pub intercept: f64,
}

impl Scaling {
    /// Identity: values equal stored values.
    pub const NONE: Self = Self { slope: 1.0, intercept: 0.0 };

    /// The scaled value.
    pub fn apply(self, stored: f64) -> f64 {
        self.slope * stored + self.intercept
    }

    /// The label that a stored number means, if any. Programs that scale a label map to the range of its data type
    /// round: label 6 is stored as 219 with a slope of 7/255, which gives 6.012. So of stored integers the one nearest
    /// to a label means it, as far as it lies nearer to it than to another. `is_integer`: whether integers are stored.
    pub fn label(self, stored: f64, is_integer: bool) -> Option<f64> {
        let value = self.apply(stored);
        let label = value.round();
        let distance = (value - label).abs();
        let is_nearest =
            || is_integer && distance < 0.5 && ((label - self.intercept) / self.slope).round() == stored;
        // Also false for NaN.
        (distance <= LABEL_TOLERANCE || is_nearest()).then_some(label)
    }

    /// The farthest that a value may lie from its label, see [`Scaling::label`].
    pub fn label_tolerance(self, is_integer: bool) -> f64 {
        let is_whole = self.slope.fract() == 0.0 && self.intercept.fract() == 0.0;
        if is_integer && !is_whole {
            (self.slope.abs() / 2.0).clamp(LABEL_TOLERANCE, 0.5)
        } else {
            LABEL_TOLERANCE
        }
    }
}

/// What the values of an image are measured in, as its file states it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// The file doesn't say, or they have none: MR.
    #[default]
    Unknown,
    /// Standardised uptake value by body weight, g/ml.
    SuvBw,
}

impl Unit {
    /// Its sign; empty where it isn't known.
    pub fn sign(self) -> &'static str {
        match self {
            Self::Unknown => "",
            Self::SuvBw => "SUVbw",
        }
    }
}

/// Values of one image on its native grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    grid: Grid,
    samples: Samples,
    scaling: Scaling,
    unit: Unit,
}

impl Volume {
    /// `samples` on `grid`; `None` when their number isn't the grid's voxel count.
    pub fn new(grid: Grid, samples: Samples, scaling: Scaling) -> Option<Self> {
        (samples.len() == grid.voxel_count()).then_some(Self { grid, samples, scaling, unit: Unit::Unknown })
    }

    /// The same values, measured in `unit`.
    #[must_use]
    pub fn in_unit(self, unit: Unit) -> Self {
        Self { unit, ..self }
    }

    /// What its values are measured in.
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// The same voxels at another place: on `grid`, which must have as many.
    pub(crate) fn with_grid(&self, grid: Grid) -> Self {
        debug_assert_eq!(grid.voxel_count(), self.grid.voxel_count());
        Self { grid, ..self.clone() }
    }

    /// The voxel grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The stored numbers, before scaling.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Maps stored numbers to values.
    pub fn scaling(&self) -> Scaling {
        self.scaling
    }

    /// Scaled value of the voxel at `linear` ([`Grid::linear`]). 64-bit integers above 2^53 are rounded.
    #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
    #[inline]
    pub fn value(&self, linear: usize) -> f64 {
        with_samples!(&self.samples, v => self.scaling.apply(v[linear] as f64))
    }

    /// All values as `f32`, scaled in `f64` first: the input of rendering.
    #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
    pub fn to_f32(&self) -> Vec<f32> {
        let scaling = self.scaling;
        with_samples!(&self.samples, v => v.iter().map(|&s| scaling.apply(s as f64) as f32).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_label_survives_being_scaled_to_the_range_of_a_data_type() {
        // As nibabel does: slope and intercept in f32, stored numbers rounded.
        for (lo, hi, min, max) in
            [(0, 7, 0, 255), (0, 14175, -32768, 32767), (-3, 90, 0, 255), (0, 250, 0, 255)]
        {
            let slope = f64::from(f64::from(hi - lo) as f32 / (max - min) as f32);
            let intercept = f64::from((f64::from(lo) - slope * f64::from(min)) as f32);
            let scaling = Scaling { slope, intercept };
            for label in lo..=hi {
                let stored = ((f64::from(label) - intercept) / slope).round();
                assert_eq!(scaling.label(stored, true), Some(f64::from(label)), "{scaling:?}");
                let away = (scaling.apply(stored) - f64::from(label)).abs();
                assert!(away <= scaling.label_tolerance(true) + 1e-9, "{away}");
            }
        }
    }

    #[test]
    fn values_between_labels_mean_none() {
        let quarter = Scaling { slope: 0.25, intercept: -0.5 };
        let labels: Vec<Option<f64>> = (0..8).map(|stored| quarter.label(f64::from(stored), true)).collect();
        assert_eq!(labels, [None, None, Some(0.0), None, None, None, Some(1.0), None]);
        for value in [0.5, 0.02, f64::NAN, f64::INFINITY] {
            assert_eq!(Scaling::NONE.label(value, false), None);
        }
        assert_eq!(Scaling::NONE.label(3.009, false), Some(3.0));
        assert_eq!(Scaling { slope: 2.0, intercept: 0.0 }.label(1.0, true), Some(2.0));
        assert_eq!(Scaling::NONE.label_tolerance(true), LABEL_TOLERANCE);
    }

    #[test]
    fn tolerances_are_half_a_step_of_fractional_scalings() {
        let of = |slope: f64, intercept: f64| Scaling { slope, intercept }.label_tolerance(true);
        // Whole labels are stored as they are.
        assert_eq!([of(1.0, 0.0), of(3.0, -7.0)], [LABEL_TOLERANCE; 2]);
        assert_eq!(of(0.25, 0.0), 0.125);
        assert_eq!(of(-0.25, 0.0), 0.125);
        assert_eq!(of(3.0, 0.5), 0.5, "at most half the way to the next label");
        assert_eq!(of(0.001, 0.0), LABEL_TOLERANCE, "at least what rounding of the slope needs");
        assert_eq!(Scaling { slope: 0.25, intercept: 0.0 }.label_tolerance(false), LABEL_TOLERANCE);
    }

    #[test]
    fn labels_of_real_numbers_are_within_a_hundredth() {
        let tenth = Scaling { slope: 0.1, intercept: 0.0 };
        assert_eq!(tenth.label(20.2, false), None, "2.02 is stored as a real number");
        assert_eq!(Scaling::NONE.label(2.0 + 1.0 / 128.0, false), Some(2.0));
        assert_eq!(Scaling::NONE.label(2.0 - 1.0 / 64.0, false), None);
        // 7 steps of 0.3 are 2.1, of integers the nearest to 2.
        let scaling = Scaling { slope: 0.3, intercept: 0.0 };
        assert_eq!((scaling.label(7.0, true), scaling.label(7.0, false)), (Some(2.0), None));
        assert_eq!(scaling.label(8.0, true), None, "2.4 is farther from 2 than 2.1");
    }

    #[test]
    fn values_are_stored_numbers_times_slope_plus_intercept() {
        let grid = Grid::axis_aligned([3, 2, 1], glam::DVec3::ONE, glam::DVec3::ZERO).unwrap();
        let samples = Samples::I16(vec![-3, 0, 1, 2, 300, 7]);
        assert_eq!((samples.len(), samples.is_empty(), samples.is_integer()), (6, false, true));
        assert!(Samples::F64(Vec::new()).is_empty());
        assert!(!Samples::F32(vec![1.0]).is_integer() && !Samples::F64(vec![1.0]).is_integer());
        let volume = Volume::new(grid.clone(), samples, Scaling { slope: 0.5, intercept: -2.0 }).unwrap();
        let expected = [-3.5, -2.0, -1.5, -1.0, 148.0, 1.5];
        assert_eq!(std::array::from_fn(|at| volume.value(at)), expected);
        assert_eq!(volume.to_f32(), expected.map(|value| value as f32));
        assert_eq!(Volume::new(grid, Samples::U8(vec![0; 5]), Scaling::NONE), None);
    }
}
