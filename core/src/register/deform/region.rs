//! The part of an image around a lesion.

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    Grid, Samples, Scaling, Volume,
    grid::ijk,
    register::{
        exclude::{Grown, grown},
        types::Image,
    },
};

/// Room about the region for the kernels that smooth an image, and for what moves into it.
const ROOM_MM: f64 = 12.0;

/// A box in RAS mm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Region {
    pub low_mm: DVec3,
    pub high_mm: DVec3,
}

impl Region {
    /// About all of `shells`, within `grid`; `None` where nothing is left.
    pub fn of(shells: &[Grown], grid: &Grid) -> Option<Self> {
        let bounds = shells.iter().map(Grown::bounds_mm);
        let (low, high) = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        let (grid_low, grid_high) = grid.bounds_mm();
        let (low_mm, high_mm) = (low.max(grid_low), high.min(grid_high));
        low_mm.cmplt(high_mm).all().then_some(Self { low_mm, high_mm })
    }
}

/// The voxels of an image in and about a region, as `f32`; those of its excluded masks, grown by a margin, are NaN, so that no
/// kernel spreads them. `None` where the image has hardly a voxel there.
pub(crate) fn around(image: &Image<'_>, region: &Region, margin_mm: f64) -> Option<Volume> {
    let grid = image.volume.grid();
    let corners = (0..8).map(|n| {
        let pick = |axis: usize| {
            if n >> axis & 1 == 1 { region.high_mm[axis] + ROOM_MM } else { region.low_mm[axis] - ROOM_MM }
        };
        grid.voxel_from_world().transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
    });
    let (low, high) =
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    let dims = grid.dims();
    let start: [usize; 3] = std::array::from_fn(|a| low[a].floor().max(0.0) as usize);
    let end: [usize; 3] = std::array::from_fn(|a| (high[a].ceil().max(0.0) as usize + 1).min(dims[a]));
    if (0..3).any(|a| end[a] < start[a] + 2) {
        return None;
    }
    let size = std::array::from_fn(|a| end[a] - start[a]);
    let part = grid.crop(start, size).ok()?;
    let masks: Vec<Grown> = image.excluded.iter().filter_map(|mask| grown(mask, margin_mm)).collect();
    let value = |linear: usize| {
        let v = ijk(size, linear);
        let at_mm = part.center_of_voxel_mm(v);
        if masks.iter().any(|mask| mask.contains(at_mm)) {
            return f32::NAN;
        }
        image.volume.value(grid.linear(std::array::from_fn(|a| v[a] + start[a]))) as f32
    };
    let values: Vec<f32> = (0..part.voxel_count()).into_par_iter().map(value).collect();
    Volume::new(part, Samples::F32(values), Scaling::NONE)
}
