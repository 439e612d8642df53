//! Volumes and masks as arrays of the crate `ndarray`, re-exported as [`crate::ndarray`].
//!
//! Every array has shape [`Grid::dims`] and is indexed `[i, j, k]` in voxels, as [`Grid::linear`] takes them.
//! Arrays given out are in Fortran order (x fastest), as samples are stored; arrays taken may have any memory
//! order, and may be slices or permutations of others.
//!
//! ```
//! use glioscope_core::{Grid, Mask, glam::DVec3, ndarray::Array3};
//!
//! let grid = Grid::axis_aligned([4, 3, 2], DVec3::new(1.0, 1.0, 5.0), DVec3::ZERO)?;
//! // Threshold of an image: every voxel with i > 1.
//! let image = Array3::from_shape_fn([4, 3, 2], |(i, _, _)| i as f32);
//! let mask = Mask::from_array("bright", grid, &image.mapv(|value| value > 1.0))?;
//! assert_eq!(mask.voxels(), 2 * 3 * 2);
//! assert_eq!(mask.volume_ml(), 12.0 * 5.0 / 1000.0);
//!
//! let active = mask.to_array();
//! assert!(active[[2, 0, 1]] && !active[[1, 2, 1]]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use ndarray::{Array3, ArrayRef3, ArrayView3, ShapeBuilder};

use crate::{Grid, Mask, MaskBits, Samples, Scaling, Volume};

/// An array whose shape isn't the grid's dimensions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found an array of shape {found:?}, expected {expected:?}, the dimensions of the grid")]
pub struct WrongShape {
    /// Shape of the array.
    pub found: [usize; 3],
    /// Dimensions of the grid.
    pub expected: [usize; 3],
}

/// A data type of [`Samples`].
pub trait Sample: Copy + 'static {
    /// The numbers, if they have this type.
    fn slice(samples: &Samples) -> Option<&[Self]>;
    /// Samples of this type, x fastest.
    fn samples(numbers: Vec<Self>) -> Samples;
}

macro_rules! sample {
    ($($number:ty => $variant:ident),*) => {$(
        impl Sample for $number {
            fn slice(samples: &Samples) -> Option<&[Self]> {
                if let Samples::$variant(numbers) = samples { Some(numbers) } else { None }
            }

            fn samples(numbers: Vec<Self>) -> Samples {
                Samples::$variant(numbers)
            }
        }
    )*};
}

sample!(u8 => U8, i8 => I8, u16 => U16, i16 => I16, u32 => U32, i32 => I32, u64 => U64, i64 => I64);
sample!(f32 => F32, f64 => F64);

/// The elements of `array`, x fastest.
///
/// # Errors
/// [`WrongShape`] where its shape isn't `dims`.
fn x_fastest<T: Copy>(array: &ArrayRef3<T>, dims: [usize; 3]) -> Result<impl Iterator<Item = T>, WrongShape> {
    let found = array.dim().into();
    if found != dims {
        return Err(WrongShape { found, expected: dims });
    }
    // Arrays are iterated with the last index fastest.
    Ok(array.t().into_iter().copied())
}

impl Volume {
    /// The stored numbers, before [`Volume::scaling`], without a copy; `None` if their type isn't `T`.
    pub fn view<T: Sample>(&self) -> Option<ArrayView3<'_, T>> {
        ArrayView3::from_shape(self.grid().dims().f(), T::slice(self.samples())?).ok()
    }

    /// All values, scaled: [`Volume::value`] of each voxel. Eight bytes a voxel.
    pub fn to_array(&self) -> Array3<f64> {
        let dims = self.grid().dims();
        Array3::from_shape_fn(dims.f(), |(i, j, k)| self.value(self.grid().linear([i, j, k])))
    }

    /// An image of these values on `grid`, without scaling; they are copied.
    ///
    /// # Errors
    /// [`WrongShape`].
    pub fn from_array<T: Sample>(grid: Grid, array: &ArrayRef3<T>) -> Result<Self, WrongShape> {
        let dims = grid.dims();
        let samples = T::samples(x_fastest(array, dims)?.collect());
        Self::new(grid, samples, Scaling::NONE).ok_or(WrongShape { found: dims, expected: dims })
    }
}

impl Mask {
    /// Whether each voxel is active. One byte a voxel.
    pub fn to_array(&self) -> Array3<bool> {
        Array3::from_shape_fn(self.grid().dims().f(), |(i, j, k)| self.bits().get([i, j, k]))
    }

    /// The mask `id` of the voxels that are true in `array`. A mask without active voxels is valid.
    ///
    /// # Errors
    /// [`WrongShape`].
    pub fn from_array(
        id: impl Into<String>,
        grid: Grid,
        array: &ArrayRef3<bool>,
    ) -> Result<Self, WrongShape> {
        let dims = grid.dims();
        let mut active = x_fastest(array, dims)?;
        let bits = MaskBits::from_fn(dims, |_| active.next() == Some(true));
        Self::new(id, grid, bits).ok_or(WrongShape { found: dims, expected: dims })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use ndarray::{Axis, s};

    use super::*;
    use crate::with_samples;

    const DIMS: [usize; 3] = [67, 5, 3];

    fn grid() -> Grid {
        Grid::axis_aligned(DIMS, DVec3::new(0.5, 2.0, 3.0), DVec3::ZERO).unwrap()
    }

    /// Each element is its own linear index.
    fn linear_indices() -> Array3<u32> {
        Array3::from_shape_fn(DIMS, |(i, j, k)| grid().linear([i, j, k]) as u32)
    }

    #[test]
    fn elements_are_where_the_linear_index_says_in_any_memory_order() {
        let c_order = linear_indices();
        let f_order = Array3::from_shape_fn(DIMS.f(), |at| c_order[at]);
        assert!(c_order.is_standard_layout() && f_order.t().is_standard_layout());
        // A mirrored view of a mirrored copy, every second plane of a larger array, and permuted axes.
        let mut mirrored = c_order.clone();
        mirrored.invert_axis(Axis(0));
        let mirrored = mirrored.as_standard_layout().into_owned();
        let doubled = Array3::from_shape_fn([67, 5, 6], |(i, j, k)| c_order[[i, j, k / 2]]);
        let permuted = c_order.view().permuted_axes([2, 0, 1]).as_standard_layout().into_owned();
        let views = [
            c_order.view(),
            f_order.view(),
            mirrored.slice(s![..;-1, .., ..]),
            doubled.slice(s![.., .., ..;2]),
            permuted.view().permuted_axes([1, 2, 0]),
        ];
        for view in views {
            let volume = Volume::from_array(grid(), &view).unwrap();
            assert_eq!(volume.samples(), &Samples::U32((0..67 * 5 * 3).collect()));
            let back = volume.view::<u32>().unwrap();
            assert_eq!(back, c_order);
            assert!(back.t().is_standard_layout(), "Fortran order");
        }
    }

    #[test]
    fn every_data_type_survives_and_no_view_has_another_type() {
        let indices = linear_indices();
        macro_rules! check {
            ($($number:ty),*) => {$(
                let array = indices.mapv(|v| (v % 100) as $number);
                let volume = Volume::from_array(grid(), &array).unwrap();
                assert_eq!(volume.view::<$number>(), Some(array.view()));
                let views = [
                    volume.view::<u8>().is_some(), volume.view::<i8>().is_some(),
                    volume.view::<u16>().is_some(), volume.view::<i16>().is_some(),
                    volume.view::<u32>().is_some(), volume.view::<i32>().is_some(),
                    volume.view::<u64>().is_some(), volume.view::<i64>().is_some(),
                    volume.view::<f32>().is_some(), volume.view::<f64>().is_some(),
                ];
                assert_eq!(views.into_iter().filter(|&some| some).count(), 1);
                with_samples!(volume.samples(), v => assert_eq!(v.len(), 67 * 5 * 3));
            )*};
        }
        check!(u8, i8, u16, i16, u32, i32, u64, i64, f32, f64);
    }

    #[test]
    fn values_are_scaled_and_views_are_not() {
        let samples = Samples::I16((0..67 * 5 * 3).collect());
        let volume = Volume::new(grid(), samples, Scaling { slope: 0.5, intercept: -3.0 }).unwrap();
        let (values, stored) = (volume.to_array(), volume.view::<i16>().unwrap());
        for (at, &value) in values.indexed_iter() {
            let linear = grid().linear(at.into());
            assert_eq!((usize::try_from(stored[at]).unwrap(), value), (linear, 0.5 * linear as f64 - 3.0));
        }
        assert!(values.t().is_standard_layout());
    }

    #[test]
    fn masks_survive_across_word_boundaries() {
        let active = linear_indices().mapv(|v| v % 3 == 0 || v % 67 > 62);
        let mask = Mask::from_array("m", grid(), &active).unwrap();
        assert_eq!(mask.to_array(), active);
        assert_eq!(mask.voxels(), active.iter().filter(|&&a| a).count() as u64);
        for linear in 0..67 * 5 * 3 {
            let ijk = grid().ijk(linear);
            assert_eq!(mask.bits().get(ijk), active[ijk]);
        }
        assert_eq!(Mask::from_array("m", grid(), &Array3::default(DIMS)).unwrap().voxels(), 0);
    }

    #[test]
    fn other_shapes_are_refused() {
        for found in [[5, 67, 3], [67, 5, 4], [0, 5, 3]] {
            let expected = WrongShape { found, expected: DIMS };
            assert_eq!(Mask::from_array("m", grid(), &Array3::default(found)), Err(expected));
            assert_eq!(Volume::from_array(grid(), &Array3::<f32>::zeros(found)), Err(expected));
        }
        let text = WrongShape { found: [5, 67, 3], expected: DIMS }.to_string();
        assert_eq!(
            text,
            "found an array of shape [5, 67, 3], expected [67, 5, 3], the dimensions of the grid"
        );
    }
}
