//! Exact Euclidean distances in millimetres: [`FeatureTransform`] for every voxel of a crop,
//! [`KdTree`] for single points.

mod envelope;
mod integers;
mod kd_tree;
#[cfg(test)]
mod tests;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::{Grid, MaskBits};

pub use kd_tree::KdTree;

/// Cosine between two voxel axes up to which they count as perpendicular. Distances are then
/// accurate to the same fraction.
const PERPENDICULAR: f64 = 1e-6;

/// Spacings outside this range (mm) would leave `f64` when squared and summed.
const SPACING_RANGE_MM: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

/// Why distances can't be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DistanceError {
    /// The sites' mask and the grid differ in size.
    #[error("found sites of {sites:?} voxels, expected the grid's {grid:?}")]
    Dims {
        /// Size of the sites' mask.
        sites: [usize; 3],
        /// Size of the grid.
        grid: [usize; 3],
    },
    /// The crop is empty or reaches outside the grid.
    #[error("found a crop from {:?} of {:?} voxels, expected one inside the grid's {grid:?}", crop.start, crop.dims)]
    Crop {
        /// The crop.
        crop: Crop,
        /// Size of the grid.
        grid: [usize; 3],
    },
    /// A site lies outside the crop: leaving it out would make distances too long.
    #[error("found sites outside the crop from {:?} of {:?} voxels, expected all inside", .0.start, .0.dims)]
    SitesOutside(Crop),
    /// More voxels or points than a 32-bit index can number.
    #[error("found {0} voxels or points, expected fewer than 2^32 - 1")]
    TooLarge(usize),
    /// Squares of the spacing would overflow or underflow.
    #[error("found a voxel spacing of {0} mm, expected between 1e-100 and 1e100 mm")]
    Spacing(DVec3),
    /// A point has a NaN or infinite coordinate.
    #[error("found a coordinate that is not finite in point {0}, expected finite millimetres")]
    NotFinite(usize),
}

/// A box of voxels: its first voxel and its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// First voxel.
    pub start: [usize; 3],
    /// Voxels along each axis, at least 1.
    pub dims: [usize; 3],
}

impl Crop {
    /// The whole of `grid`.
    pub fn whole(grid: &Grid) -> Self {
        Self { start: [0; 3], dims: grid.dims() }
    }

    /// Bounding box of the active voxels of all `masks` (of equal size), grown by `margin_voxels` on
    /// each side and clipped to the size of the first one. `None` when all are empty.
    pub fn around(masks: &[&MaskBits], margin_voxels: usize) -> Option<Self> {
        let mask_dims = masks.first()?.dims();
        let (lo, end) = masks.iter().filter_map(|m| m.bounds()).fold(None, |all, (start, size)| {
            let (lo, end) = all.unwrap_or(([usize::MAX; 3], [0; 3]));
            Some((
                std::array::from_fn(|a| start[a].min(lo[a])),
                std::array::from_fn(|a| (start[a] + size[a]).max(end[a])),
            ))
        })?;
        let start = lo.map(|v: usize| v.saturating_sub(margin_voxels));
        let dims = std::array::from_fn(|a| {
            let end: usize = end[a];
            end.saturating_add(margin_voxels).min(mask_dims[a]).saturating_sub(start[a])
        });
        Some(Self { start, dims })
    }

    /// The voxels of `mask` in it; it lies inside the mask.
    pub(crate) fn part_of(self, mask: &MaskBits) -> MaskBits {
        let mut part = MaskBits::empty(self.dims);
        let [_, ny, _] = mask.dims();
        let (per_line, part_per_line) = (mask.words_per_line(), part.words_per_line());
        let (first, shift) = (self.start[0] / 64, self.start[0] % 64);
        let past_end = self.dims[0] % 64;
        for (line, out) in part.words_mut().chunks_exact_mut(part_per_line).enumerate() {
            let [y, z] = [self.start[1] + line % self.dims[1], self.start[2] + line / self.dims[1]];
            let at = (z * ny + y) * per_line;
            let Some(words) = mask.words().get(at..at + per_line) else { continue };
            let word = |w: usize| words.get(first + w).copied().unwrap_or(0);
            for (w, out) in out.iter_mut().enumerate() {
                let next = if shift == 0 { 0 } else { word(w + 1) << (64 - shift) };
                *out = word(w) >> shift | next;
            }
            if let (true, Some(last)) = (past_end > 0, out.last_mut()) {
                *last &= (1 << past_end) - 1;
            }
        }
        part
    }

    /// Position of grid voxel `ijk` in the crop; `None` outside.
    fn local(&self, ijk: [usize; 3]) -> Option<[usize; 3]> {
        let local: [usize; 3] = std::array::from_fn(|a| ijk[a].wrapping_sub(self.start[a]));
        (0..3).all(|a| local[a] < self.dims[a]).then_some(local)
    }

    fn inside(&self, dims: [usize; 3]) -> bool {
        (0..3).all(|a| {
            self.dims[a] > 0 && self.start[a].checked_add(self.dims[a]).is_some_and(|end| end <= dims[a])
        })
    }
}

/// The nearest of a set of sites for every voxel of a crop, measured between voxel centres.
///
/// Exact: [`FeatureTransform::distance_mm`] is bit for bit the minimum over all sites of its own
/// formula in `f64`. Costs `O(voxels)` on perpendicular axes (Felzenszwalb and Huttenlocher 2012,
/// section 2; sites as in Maurer, Qi and Raghavan 2003), one k-d tree query per voxel on
/// sheared ones. Parallel; the result doesn't depend on the number of threads. 4 bytes per voxel
/// of the crop, 8 during construction.
#[derive(Clone, Debug)]
pub struct FeatureTransform {
    crop: Crop,
    metric: Metric,
    /// Sites `(k·ny + j)·nx + i` in the crop, at `(j·nz + k)·nx + i`.
    sites: Vec<u32>,
}

/// Maps a difference of voxel indices to millimetres.
#[derive(Clone, Copy, Debug)]
enum Metric {
    /// Squared spacings: axes are perpendicular.
    Spacing([f64; 3]),
    /// Columns: the world-space step of one voxel along each axis, millimetres.
    Sheared(DMat3),
}

impl Metric {
    fn of(grid: &Grid) -> Result<Self, DistanceError> {
        let spacing_mm = grid.spacing_mm();
        if !spacing_mm.to_array().iter().all(|s| SPACING_RANGE_MM.contains(s)) {
            return Err(DistanceError::Spacing(spacing_mm));
        }
        let m = grid.world_from_voxel().matrix3;
        let c = [m.x_axis, m.y_axis, m.z_axis].map(|c| c / c.length());
        let perpendicular =
            [(0, 1), (0, 2), (1, 2)].iter().all(|&(a, b)| c[a].dot(c[b]).abs() <= PERPENDICULAR);
        Ok(if perpendicular { Self::Spacing((spacing_mm * spacing_mm).to_array()) } else { Self::Sheared(m) })
    }
}

impl FeatureTransform {
    /// The nearest active voxel of `sites` for every voxel of `crop`. `sites` has the size of
    /// `grid`; all its active voxels lie in `crop` (see [`Crop::around`]). `None` when it has none:
    /// distances are then undefined, not infinite.
    ///
    /// Axes whose cosine is at most 1e-6 count as perpendicular, which shifts distances by at most
    /// that fraction.
    ///
    /// # Errors
    /// [`DistanceError`] if sizes differ; if the crop is empty, reaches outside the grid, leaves out
    /// a site or has 2³² − 1 voxels or more; or if a spacing is outside 1e-100 to 1e100 mm.
    pub fn of(sites: &MaskBits, grid: &Grid, crop: Crop) -> Result<Option<Self>, DistanceError> {
        if sites.dims() != grid.dims() {
            return Err(DistanceError::Dims { sites: sites.dims(), grid: grid.dims() });
        }
        if !crop.inside(grid.dims()) {
            return Err(DistanceError::Crop { crop, grid: grid.dims() });
        }
        let voxels = crop.dims.iter().product();
        if voxels >= u32::MAX as usize {
            return Err(DistanceError::TooLarge(voxels));
        }
        let metric = Metric::of(grid)?;
        let Some((first, size)) = sites.bounds() else { return Ok(None) };
        let last = std::array::from_fn(|a| first[a] + size[a] - 1);
        if crop.local(first).is_none() || crop.local(last).is_none() {
            return Err(DistanceError::SitesOutside(crop));
        }
        let sites = match metric {
            Metric::Spacing(weights) => match integers::whole_weights(crop, weights) {
                Some(whole) => integers::nearest_sites(sites, crop, whole),
                None => envelope::nearest_sites(sites, crop, weights),
            },
            Metric::Sheared(mm) => match nearest_by_tree(sites, crop, mm)? {
                Some(sites) => sites,
                None => return Ok(None),
            },
        };
        Ok(Some(Self { crop, metric, sites }))
    }

    /// [`FeatureTransform::distance_mm`] of every voxel of the crop, x fastest, rounded to `f32`.
    pub fn distances_mm(&self) -> Vec<f32> {
        let [nx, ny, nz] = self.crop.dims;
        let mut all = vec![0.0; nx * ny * nz];
        match self.metric {
            Metric::Spacing(w) => self.fill_rows(&mut all, |[x, y, z], [i, j, k]| {
                let square = |a: f64, b: f64, w: f64| w * ((a - b) * (a - b));
                ((square(i, x, w[0]) + square(j, y, w[1])) + square(k, z, w[2])).sqrt()
            }),
            Metric::Sheared(mm) => self.fill_rows(&mut all, |site, local| {
                let position_mm = |p: [f64; 3]| mm.x_axis * p[0] + mm.y_axis * p[1] + mm.z_axis * p[2];
                let d = position_mm(site) - position_mm(local);
                ((d.x * d.x + d.y * d.y) + d.z * d.z).sqrt()
            }),
        }
        all
    }

    /// Writes `distance(site, voxel)` of every voxel; both arguments are voxel indices in the crop.
    fn fill_rows(&self, all: &mut [f32], distance: impl Fn([f64; 3], [f64; 3]) -> f64 + Sync) {
        let [nx, ny, nz] = self.crop.dims;
        let [width, height] = [nx, ny].map(|n| n as f64);
        let (over_width, over_height) = (1.0 / width, 1.0 / height);
        all.par_chunks_mut(nx).with_min_len(64).enumerate().for_each(|(row, distances)| {
            let (j, k) = (row % ny, row / ny);
            let sites = &self.sites[(j * nz + k) * nx..][..nx];
            for (i, (out, &site)) in distances.iter_mut().zip(sites).enumerate() {
                // Division by reciprocals: the quotients are half a unit away from whole numbers, so
                // the floor is exact for every 32-bit index.
                let site = f64::from(site);
                let line = ((site + 0.5) * over_width).floor();
                let z = ((line + 0.5) * over_height).floor();
                let site_ijk = [site - line * width, line - z * height, z];
                *out = distance(site_ijk, [i as f64, j as f64, k as f64]) as f32;
            }
        });
    }

    /// The crop that the distances are defined in.
    pub fn crop(&self) -> Crop {
        self.crop
    }

    /// The site nearest to voxel `ijk`, both as indices of the grid; `None` outside the crop.
    ///
    /// Ties go to the site first in memory (smallest `k`, then `j`, then `i`). Rounding can create or
    /// break a tie in the last place; the result is then still a site at the minimum distance and the
    /// same in every run, but need not be the first in memory.
    pub fn nearest(&self, ijk: [usize; 3]) -> Option<[usize; 3]> {
        let site = self.local_site(self.crop.local(ijk)?);
        Some(std::array::from_fn(|a| self.crop.start[a] + site[a]))
    }

    /// Millimetres from the centre of voxel `ijk` to that of its nearest site, 0 on a site; `None`
    /// outside the crop. With voxel differences `d` and spacings `s`:
    /// `√((sx²·dx² + sy²·dy²) + sz²·dz²)`, and on sheared axes the length of the difference of the
    /// two centres, relative to the crop's first voxel.
    pub fn distance_mm(&self, ijk: [usize; 3]) -> Option<f64> {
        let local = self.crop.local(ijk)?;
        Some(self.between_mm(local, self.local_site(local)))
    }

    fn between_mm(&self, local: [usize; 3], site: [usize; 3]) -> f64 {
        match self.metric {
            Metric::Spacing(w) => {
                let square = |a: usize| {
                    let d = local[a] as f64 - site[a] as f64;
                    w[a] * (d * d)
                };
                ((square(0) + square(1)) + square(2)).sqrt()
            }
            Metric::Sheared(mm) => {
                let d = offset_mm(mm, site) - offset_mm(mm, local);
                ((d.x * d.x + d.y * d.y) + d.z * d.z).sqrt()
            }
        }
    }

    fn local_site(&self, [i, j, k]: [usize; 3]) -> [usize; 3] {
        let [nx, _, nz] = self.crop.dims;
        self.local_ijk(self.sites[(j * nz + k) * nx + i])
    }

    /// A site's voxel indices in the crop. Axes fit 32 bits, whose division is faster.
    fn local_ijk(&self, site: u32) -> [usize; 3] {
        let [nx, ny, _] = self.crop.dims.map(|n| n as u32);
        [site % nx, site / nx % ny, site / nx / ny].map(|v| v as usize)
    }
}

/// Offset of a voxel centre from the crop's first one, in millimetres: a distant origin costs no precision.
fn offset_mm(mm: DMat3, local: [usize; 3]) -> DVec3 {
    mm.x_axis * local[0] as f64 + mm.y_axis * local[1] as f64 + mm.z_axis * local[2] as f64
}

/// As [`envelope::nearest_sites`], for any axes; `None` without sites.
fn nearest_by_tree(sites: &MaskBits, crop: Crop, mm: DMat3) -> Result<Option<Vec<u32>>, DistanceError> {
    let [nx, ny, nz] = crop.dims;
    let [mx, my, _] = sites.dims();
    let (mut index, mut offsets_mm) = (Vec::new(), Vec::new());
    sites.for_each(|l| {
        if let Some(local) = crop.local([l % mx, l / mx % my, l / (mx * my)]) {
            index.push(((local[2] * ny + local[1]) * nx + local[0]) as u32);
            offsets_mm.push(offset_mm(mm, local));
        }
    });
    let Some(tree) = KdTree::new(&offsets_mm)? else { return Ok(None) };
    let mut nearest = vec![0; nx * ny * nz];
    nearest.par_chunks_mut(nx).enumerate().for_each(|(row, line)| {
        for (x, voxel) in line.iter_mut().enumerate() {
            // Always found: `SPACING_RANGE_MM` keeps offsets finite.
            if let Some((site, _)) = tree.nearest(offset_mm(mm, [x, row / nz, row % nz])) {
                *voxel = index[site];
            }
        }
    });
    Ok(Some(nearest))
}
