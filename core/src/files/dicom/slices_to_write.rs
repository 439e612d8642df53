//! Masks on the slices that DICOM has: those of their image where they coincide, else those of their own grid.

use std::borrow::Cow;

use glam::{DAffine3, DVec3};

use super::data_set::Unusable;
use super::source_image::{SourceImage, SourceSlice};
use super::stack::ras;
use crate::{Grid, MaskBits, Sides};

/// How far axes in a slice may be from orthogonal, as a cosine.
const ORTHOGONAL: f64 = 1e-4;

/// How far voxels may lie off those of the image, in voxels: NIfTI rounds to floats.
const OFF_VOXELS: f64 = 0.01;

/// Spacings that are written, in millimetres, as those that are read.
const SPACINGS_MM: std::ops::RangeInclusive<f64> = 1e-4..=1e3;

/// Farthest position that is written, in millimetres, as that which is read.
const FARTHEST_MM: f64 = 1e6;

/// Most rows, columns or slices.
const MAX_SIDE: usize = 65_535;

/// Slices in the order of their places along the normal (row × column), and masks on them.
pub(super) struct Slices<'a> {
    /// Columns, rows and slices.
    pub dims: [usize; 3],
    /// LPS, of length 1.
    pub along_row: DVec3,
    /// LPS, of length 1.
    pub along_column: DVec3,
    /// Distance of rows and of columns.
    pub pixel_spacing_mm: [f64; 2],
    /// Distance of slices along their normal.
    pub step_mm: f64,
    /// Centre of each slice's first pixel, LPS millimetres.
    pub positions_mm: Vec<DVec3>,
    /// Slices of the image, one for each, where masks lie on them.
    pub images: Option<&'a [SourceSlice]>,
    pub masks: Vec<Cow<'a, MaskBits>>,
}

impl<'a> Slices<'a> {
    /// # Errors
    /// [`Unusable`] for a grid whose slices can't be slices of DICOM.
    pub fn of(
        grid: &Grid,
        masks: &[&'a MaskBits],
        source: Option<&'a SourceImage>,
    ) -> Result<Self, Unusable> {
        if let Some(mask) = masks.iter().find(|mask| mask.dims() != grid.dims()) {
            let found = format!("a mask of {:?} voxels", mask.dims());
            return Err(Unusable::new(found, format!("{:?}, as its grid", grid.dims())));
        }
        if grid.sides() == Sides::Unknown {
            return Err(Unusable::new("masks whose left and right are unknown", "a place in the patient"));
        }
        let on_image = source.into_iter().flat_map(|source| &source.volumes).find_map(|volume| {
            let to = Mapping::of(grid, &volume.planes.grid().ok()?)?;
            let masks: Option<Vec<_>> = masks.iter().map(|mask| to.moved(mask).map(Cow::Owned)).collect();
            let first = volume.planes.first;
            (volume.slices.len() == volume.planes.dims[2]).then_some(Self {
                dims: volume.planes.dims,
                along_row: first.along_row,
                along_column: first.along_column,
                pixel_spacing_mm: first.pixel_spacing_mm,
                step_mm: volume.planes.step_mm.dot(first.normal()).abs(),
                positions_mm: volume.slices.iter().map(|slice| slice.position_mm).collect(),
                images: Some(&volume.slices),
                masks: masks?,
            })
        });
        let slices = on_image.map_or_else(|| Self::own(grid, masks), Ok)?;
        slices.checked()
    }

    fn own(grid: &Grid, masks: &[&'a MaskBits]) -> Result<Self, Unusable> {
        let DAffine3 { matrix3, translation } = grid.world_from_voxel();
        // The change of sides is its own inverse.
        let [row, column, step] = [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis].map(ras);
        let (along_row, along_column) = (row / row.length(), column / column.length());
        let cosine = along_row.dot(along_column);
        if cosine.abs() > ORTHOGONAL {
            let angle = crate::decimal::text(cosine.acos().to_degrees(), 3);
            let found = format!("rows and columns at {angle}° to each other");
            return Err(Unusable::new(found, "orthogonal ones, as slices of DICOM have"));
        }
        let dims = grid.dims();
        let along_normal = step.dot(along_row.cross(along_column));
        let mut positions_mm: Vec<DVec3> =
            (0..dims[2]).map(|slice| ras(translation) + step * slice as f64).collect();
        let mut masks: Vec<Cow<'a, MaskBits>> = masks.iter().map(|&mask| Cow::Borrowed(mask)).collect();
        if along_normal < 0.0 {
            positions_mm.reverse();
            let last = dims[2] as i64 - 1;
            let flip = Mapping { axis: [0, 1, 2], sign: [1, 1, -1], offset: [0, 0, last], dims };
            masks = masks.iter().filter_map(|mask| flip.moved(mask).map(Cow::Owned)).collect();
        }
        Ok(Self {
            dims,
            along_row,
            along_column,
            pixel_spacing_mm: [column.length(), row.length()],
            step_mm: along_normal.abs(),
            positions_mm,
            images: None,
            masks,
        })
    }

    fn checked(self) -> Result<Self, Unusable> {
        if self.dims.iter().any(|&side| side > MAX_SIDE) {
            return Err(Unusable::new(
                format!("{:?} voxels", self.dims),
                format!("at most {MAX_SIDE} a side"),
            ));
        }
        let [rows_mm, columns_mm] = self.pixel_spacing_mm;
        if ![rows_mm, columns_mm, self.step_mm].iter().all(|mm| SPACINGS_MM.contains(mm)) {
            let found = format!("voxels of {columns_mm} × {rows_mm} × {} mm", self.step_mm);
            return Err(Unusable::new(found, "between 0.0001 and 1000 mm"));
        }
        if let Some(far) = self.positions_mm.iter().find(|p| p.abs().max_element() > FARTHEST_MM) {
            return Err(Unusable::new(format!("a slice at {far} mm"), "a position within a kilometre"));
        }
        Ok(self)
    }

    /// LPS millimetres of a corner of pixels, as [`super::outline::outlines`] counts them.
    pub fn corner_mm(&self, [x, y]: [usize; 2], slice: usize) -> DVec3 {
        let [rows_mm, columns_mm] = self.pixel_spacing_mm;
        self.positions_mm[slice]
            + self.along_row * ((x as f64 - 0.5) * columns_mm)
            + self.along_column * ((y as f64 - 0.5) * rows_mm)
    }
}

/// The words of a mask's slice.
pub(super) fn words_of(mask: &MaskBits, slice: usize) -> &[u64] {
    let count = mask.words_per_line() * mask.dims()[1];
    &mask.words()[slice * count..(slice + 1) * count]
}

/// From the voxels of one grid to those of another with the same voxels: axes exchanged, reversed and shifted.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mapping {
    /// Axis of the other grid, for each own axis.
    axis: [usize; 3],
    sign: [i64; 3],
    /// Of the other grid's axes.
    offset: [i64; 3],
    /// Voxels of the other grid.
    dims: [usize; 3],
}

impl Mapping {
    /// `None` where voxels don't coincide.
    fn of(from: &Grid, to: &Grid) -> Option<Self> {
        let both = to.voxel_from_world() * from.world_from_voxel();
        let columns = [both.matrix3.x_axis, both.matrix3.y_axis, both.matrix3.z_axis];
        let (mut axis, mut sign) = ([0; 3], [1; 3]);
        // Where an axis of one voxel points says nothing: it takes what the others leave.
        let (one, several): (Vec<usize>, Vec<usize>) = (0..3).partition(|&own| from.dims()[own] == 1);
        let mut taken = [false; 3];
        for own in several {
            let column = columns[own];
            axis[own] = (0..3).find(|&other| column[other].abs().round() == 1.0 && !taken[other])?;
            sign[own] = if column[axis[own]] > 0.0 { 1 } else { -1 };
            taken[axis[own]] = true;
        }
        for own in one {
            axis[own] = (0..3).find(|&other| !taken[other])?;
            taken[axis[own]] = true;
        }
        let offset = both.translation.to_array().map(|v| v.round() as i64);
        let mapping = Self { axis, sign, offset, dims: to.dims() };
        let is_near = (0..8).all(|corner| {
            let ijk: [usize; 3] =
                std::array::from_fn(|a| if corner >> a & 1 == 1 { from.dims()[a] - 1 } else { 0 });
            let exact = both.transform_point3(DVec3::from_array(ijk.map(|n| n as f64)));
            let whole = DVec3::from_array(mapping.voxel(ijk).map(|n| n as f64));
            exact.abs_diff_eq(whole, OFF_VOXELS)
        });
        is_near.then_some(mapping)
    }

    fn voxel(&self, ijk: [usize; 3]) -> [i64; 3] {
        let mut out = self.offset;
        for own in 0..3 {
            out[self.axis[own]] += self.sign[own] * ijk[own] as i64;
        }
        out
    }

    /// The mask on the other grid; `None` where an active voxel lies outside it.
    fn moved(&self, mask: &MaskBits) -> Option<MaskBits> {
        let mut moved = MaskBits::empty(self.dims);
        let mut is_inside = true;
        mask.for_each(|linear| {
            let to = self.voxel(crate::grid::ijk(mask.dims(), linear));
            let to: [usize; 3] = std::array::from_fn(|a| usize::try_from(to[a]).unwrap_or(usize::MAX));
            if (0..3).all(|a| to[a] < self.dims[a]) { moved.set(to) } else { is_inside = false }
        });
        is_inside.then_some(moved)
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    #[test]
    fn voxels_are_found_again_whatever_the_order_of_axes() {
        let to =
            Grid::axis_aligned([4, 5, 6], DVec3::new(1.0, 2.0, 3.0), DVec3::new(-7.0, 3.0, 2.0)).unwrap();
        // Axes P, S, R: one slice more than the other grid, and one less.
        let matrix3 = DMat3::from_cols(-DVec3::Y * 2.0, DVec3::Z * 3.0, DVec3::X);
        let affine = DAffine3 { matrix3, translation: to.center_of_voxel_mm([0, 4, 1]) };
        let from = Grid::new([5, 5, 5], affine, Sides::Known).unwrap();
        let mapping = Mapping::of(&from, &to).unwrap();
        assert_eq!(
            mapping,
            Mapping { axis: [1, 2, 0], sign: [-1, 1, 1], offset: [0, 4, 1], dims: [4, 5, 6] }
        );
        for ijk in [[0, 0, 0], [4, 4, 3], [1, 2, 3]] {
            let mut mask = MaskBits::empty([5; 3]);
            mask.set(ijk);
            let moved = mapping.moved(&mask).unwrap();
            let (at, _) = moved.bounds().unwrap();
            assert_eq!(moved.count(), 1);
            assert!(to.center_of_voxel_mm(at).abs_diff_eq(from.center_of_voxel_mm(ijk), 1e-12));
        }
        let mut outside = MaskBits::empty([5; 3]);
        outside.set([0, 0, 4]);
        assert_eq!(mapping.moved(&outside), None);
        for other in [
            Grid::axis_aligned([4, 5, 6], DVec3::new(1.0, 2.0, 1.5), DVec3::ZERO).unwrap(),
            Grid::axis_aligned([4, 5, 6], DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.5, 1.0, 2.0)).unwrap(),
            Grid::axis_aligned([4, 5, 6], DVec3::new(1.01, 2.0, 3.0), DVec3::new(-7.0, 3.0, 2.0)).unwrap(),
        ] {
            assert_eq!(Mapping::of(&other, &to), None);
        }
    }
}
