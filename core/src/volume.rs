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
}

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
}

/// Values of one image on its native grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    grid: Grid,
    samples: Samples,
    scaling: Scaling,
}

impl Volume {
    /// `samples` on `grid`; `None` when their number isn't the grid's voxel count.
    pub fn new(grid: Grid, samples: Samples, scaling: Scaling) -> Option<Self> {
        (samples.len() == grid.voxel_count()).then_some(Self { grid, samples, scaling })
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
