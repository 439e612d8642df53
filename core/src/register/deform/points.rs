//! The images at each resolution, and the tissue of the fixed one in the lattice's cells.

use glam::DVec3;
use rayon::prelude::*;

use super::{DeformError, lattice::Lattice};
use crate::{
    Progress, Volume,
    register::{
        exclude::Grown,
        level::{Level, finest},
    },
};

/// Resolution below which far points are thinned out, mm, and to one of how many.
const FINE_MM: f64 = 1.5;
const FAR: usize = 4;

/// One image at each resolution, coarse to fine, about a centre.
pub(crate) fn levels(
    volume: &Volume,
    centre_mm: DVec3,
    resolutions: &[f64],
    progress: &Progress,
) -> Result<Vec<Level>, DeformError> {
    let mut levels: Vec<Level> = Vec::new();
    for resolution_mm in resolutions.iter().rev() {
        let next = match levels.last() {
            Some(last) => last.coarser(*resolution_mm, progress)?,
            None => finest(volume, centre_mm, *resolution_mm, progress)?
                .ok_or(DeformError::TooLittle { found_ml: 0.0 })?,
        };
        levels.push(next);
    }
    levels.reverse();
    Ok(levels)
}

/// Where tissue is looked at: all of it, and what is near the lesion.
pub(crate) struct Shells {
    pub whole: Vec<Grown>,
    pub near: Vec<Grown>,
}

/// A voxel of the fixed image in the shell.
pub(crate) struct Point {
    /// Centred mm.
    pub at_mm: DVec3,
    pub value: f64,
    /// Per mm, by differences to both sides where both count.
    pub gradient: DVec3,
    /// Voxels that it stands for.
    pub share: f64,
}

/// The fixed image in the shell, by the lattice's cells.
pub(crate) struct Points {
    /// In the order of their cells.
    pub list: Vec<Point>,
    /// Cell, and the end of its points in the list.
    pub ends: Vec<(usize, usize)>,
    pub voxel_mm3: f64,
}

impl Points {
    pub fn volume_ml(&self) -> f64 {
        self.list.iter().map(|point| point.share).sum::<f64>() * self.voxel_mm3 / 1000.0
    }
}

/// Those voxels of a level that count and lie in one of the shells. Far from the lesion, at a fine resolution, one of [`FAR`].
pub(crate) fn points(
    level: &Level,
    lattice: &Lattice,
    shells: &Shells,
    resolution_mm: f64,
    centre_mm: DVec3,
) -> Points {
    let centred_from_voxel = level.centred_from_voxel();
    let mm_from_voxel = level.voxel_from_centred.matrix3.transpose();
    let [nx, ny, nz] = level.dims;
    let value = |v: [usize; 3]| f64::from(level.values[crate::grid::linear(level.dims, v)]);
    let gradient = |v: [usize; 3]| {
        let along = |a: usize| {
            let (mut below, mut above) = (v, v);
            below[a] = v[a].saturating_sub(1);
            above[a] = (v[a] + 1).min(level.dims[a] - 1);
            let here = value(v);
            let or_here = |at: [usize; 3]| Some(value(at)).filter(|v| v.is_finite());
            let (low, high) = (or_here(below), or_here(above));
            let steps = f64::from(u8::from(low.is_some() && below != v))
                + f64::from(u8::from(high.is_some() && above != v));
            (high.unwrap_or(here) - low.unwrap_or(here)) / steps.max(1.0)
        };
        mm_from_voxel * DVec3::new(along(0), along(1), along(2))
    };
    let slice = |z: usize| -> Vec<(usize, Point)> {
        let voxel = |n: usize| {
            let v = [n % nx, n / nx, z];
            let value = value(v);
            let at_mm = centred_from_voxel.transform_point3(DVec3::from_array(v.map(|v| v as f64)));
            let cell = lattice.cell_at(at_mm).filter(|_| value.is_finite())?;
            let is_taken = (v[0] + 2 * v[1] + 3 * v[2]).is_multiple_of(FAR);
            let is_within = |shells: &[Grown]| shells.iter().any(|shell| shell.contains(at_mm + centre_mm));
            let is_near = resolution_mm > FINE_MM || is_within(&shells.near);
            let share = if is_near { 1.0 } else { FAR as f64 };
            ((is_near || is_taken) && is_within(&shells.whole))
                .then(|| (cell, Point { at_mm, value, gradient: gradient(v), share }))
        };
        (0..nx * ny).filter_map(voxel).collect()
    };
    let mut all: Vec<(usize, Point)> = (0..nz).into_par_iter().flat_map_iter(slice).collect();
    // Stable: within a cell in memory order.
    all.sort_by_key(|(cell, _)| *cell);
    let mut ends: Vec<(usize, usize)> = Vec::new();
    for (n, (cell, _)) in all.iter().enumerate() {
        match ends.last_mut() {
            Some((last, end)) if last == cell => *end = n + 1,
            _ => ends.push((*cell, n + 1)),
        }
    }
    let voxel_mm3 = centred_from_voxel.matrix3.determinant().abs();
    Points { list: all.into_iter().map(|(_, point)| point).collect(), ends, voxel_mm3 }
}
