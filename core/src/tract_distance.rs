//! Exact distances in millimetres between the segments of fibres (streamlines) and the cells of
//! selected voxels.
//!
//! A voxel is its whole cell (a box; a parallelepiped on a sheared grid), not its centre: a fibre
//! that enters a selected cell is at distance 0. Each run of selected voxels along x is one box in a
//! bounding volume hierarchy. Everything is computed in `f64` along the voxel axes; only the points
//! found are mapped to world space.

mod boxes;
mod segment;
#[cfg(test)]
mod tests;

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use crate::{Cancelled, Grid, MaskBits, Progress, Tracts};
use boxes::BoxTree;

/// Cosine between two voxel axes up to which they count as perpendicular, as for other distances.
const PERPENDICULAR: f64 = 1e-6;

/// Segments that are skipped together when their bounding ball is too far.
const SEGMENTS_PER_CHUNK: usize = 8;

/// The closest approach of a fibre to the selection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Distance; 0 where the fibre touches or enters a selected voxel's cell.
    pub distance_mm: f64,
    /// The nearest point on the fibre. Of several, the first found; on a fibre that runs through the
    /// selection, one inside it.
    pub fiber_mm: DVec3,
    /// The point of the selection nearest to it.
    pub selection_mm: DVec3,
}

/// The selected voxels, prepared for distance queries.
#[derive(Clone, Debug)]
pub struct SelectedCells {
    tree: BoxTree,
    voxel_from_world: DAffine3,
    world_from_voxel: DAffine3,
    metric: Metric,
}

/// A box of voxel cells, in voxel indices: voxel centres are whole numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CellBox {
    lo: DVec3,
    hi: DVec3,
}

/// Maps voxel indices to millimetres, up to a rotation: upper triangular, and diagonal where the axes
/// are perpendicular.
#[derive(Clone, Copy, Debug)]
struct Metric {
    mm: DMat3,
    perpendicular: bool,
}

impl Metric {
    /// The triangular factor of the grid's matrix (Gram–Schmidt on its columns).
    fn of(grid: &Grid) -> Self {
        let m = grid.world_from_voxel().matrix3;
        let x = m.x_axis / m.x_axis.length();
        let y_off = m.y_axis - x * x.dot(m.y_axis);
        let y = y_off / y_off.length();
        let z_off = m.z_axis - x * x.dot(m.z_axis);
        let z_off = z_off - y * y.dot(z_off);
        let columns = [m.x_axis, m.y_axis, m.z_axis];
        let cosine = |a: usize, b: usize| {
            columns[a].dot(columns[b]).abs() / (columns[a].length() * columns[b].length())
        };
        let perpendicular = cosine(0, 1).max(cosine(0, 2)).max(cosine(1, 2)) <= PERPENDICULAR;
        let mm = if perpendicular {
            DMat3::from_diagonal(grid.spacing_mm())
        } else {
            DMat3::from_cols(
                DVec3::new(m.x_axis.length(), 0.0, 0.0),
                DVec3::new(x.dot(m.y_axis), y_off.length(), 0.0),
                DVec3::new(x.dot(m.z_axis), y.dot(m.z_axis), z_off.length()),
            )
        };
        Self { mm, perpendicular }
    }
}

/// The nearest points of a segment and a box.
#[derive(Clone, Copy, Debug)]
struct Nearest {
    squared_mm2: f64,
    /// Position along the segment, 0 to 1.
    along: f64,
    /// Point of the box, in voxel indices.
    voxel: DVec3,
}

impl SelectedCells {
    /// The active voxels of `selected`, a mask on `grid`. `None` when there is none, or when the
    /// sizes differ.
    pub fn new(grid: &Grid, selected: &MaskBits) -> Option<Self> {
        if grid.dims() != selected.dims() {
            return None;
        }
        let metric = Metric::of(grid);
        Some(Self {
            tree: BoxTree::new(boxes::runs(selected), &metric)?,
            voxel_from_world: grid.voxel_from_world(),
            world_from_voxel: grid.world_from_voxel(),
            metric,
        })
    }

    /// Closest approach of the polyline `fiber_mm` (one point is allowed). Exact up to rounding; `None`
    /// without points.
    pub fn nearest(&self, fiber_mm: &[[f32; 3]]) -> Option<Approach> {
        let points: Vec<DVec3> = fiber_mm
            .iter()
            .map(|&p| self.voxel_from_world.transform_point3(DVec3::from_array(p.map(f64::from))))
            .collect();
        let (&first, segments) = (points.first()?, points.len().saturating_sub(1).max(1));
        let segment = |n: usize| (points[n], points.get(n + 1).copied().unwrap_or(points[n]));

        // Bounding ball of each chunk: no part is nearer than the distance of its centre minus its radius.
        let mut chunks: Vec<(f64, usize)> = Vec::with_capacity(segments.div_ceil(SEGMENTS_PER_CHUNK));
        for start in (0..segments).step_by(SEGMENTS_PER_CHUNK) {
            let end = (start + SEGMENTS_PER_CHUNK).min(segments);
            let part = &points[start..(end + 1).min(points.len())];
            let center = part[part.len() / 2];
            let radius = part
                .iter()
                .map(|&p| (self.metric.mm * (p - center)).length_squared())
                .fold(0.0, f64::max)
                .sqrt();
            let from_center = self.tree.nearest(center, center, f64::INFINITY, &self.metric);
            chunks.push((from_center.map_or(0.0, |n| n.squared_mm2.sqrt() - radius), start));
        }
        chunks.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));

        let mut best: Option<(Nearest, usize)> = None;
        let limit = |best: &Option<(Nearest, usize)>| best.map_or(f64::INFINITY, |(n, _)| n.squared_mm2);
        for (bound, start) in chunks {
            if bound > 0.0 && bound * bound >= limit(&best) {
                break;
            }
            for n in start..(start + SEGMENTS_PER_CHUNK).min(segments) {
                let (a, b) = segment(n);
                if let Some(found) = self.tree.nearest(a, b, limit(&best), &self.metric) {
                    best = Some((found, n));
                }
            }
            if limit(&best) == 0.0 {
                break;
            }
        }
        let world = |voxel: DVec3| self.world_from_voxel.transform_point3(voxel);
        let (found, fiber_voxel) = match best {
            Some((found, n)) => {
                let (a, b) = segment(n);
                (found, a + (b - a) * found.along)
            }
            // Only where squares overflow: the distance is infinite.
            None => (Nearest { squared_mm2: f64::INFINITY, along: 0.0, voxel: first }, first),
        };
        Some(Approach {
            distance_mm: found.squared_mm2.sqrt(),
            fiber_mm: world(fiber_voxel),
            selection_mm: world(found.voxel),
        })
    }

    /// [`SelectedCells::nearest`] of every fibre, in their order; `None` for those without points.
    /// In parallel.
    ///
    /// # Errors
    /// [`Cancelled`] when `progress` is cancelled.
    pub fn nearest_of_all(
        &self,
        tracts: &Tracts,
        progress: &Progress,
    ) -> Result<Vec<Option<Approach>>, Cancelled> {
        let fibers = tracts.fiber_count();
        progress.expect(fibers as u64);
        (0..fibers)
            .into_par_iter()
            .with_min_len(64)
            .map(|n| {
                progress.advance(1)?;
                Ok(self.nearest(tracts.fiber(n)))
            })
            .collect()
    }
}

/// The nearest fibre, and the number of fibres within a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearness {
    /// The nearest fibre (the first of several at one distance) and where; `None` without points.
    pub nearest: Option<(usize, Approach)>,
    /// Fibres at distance 0.
    pub through: usize,
    /// Fibres within the requested distance, including those through the selection.
    pub within: usize,
}

impl Nearness {
    /// Summarises the results of [`SelectedCells::nearest_of_all`].
    pub fn of(approaches: &[Option<Approach>], within_mm: f64) -> Self {
        let mut out = Self { nearest: None, through: 0, within: 0 };
        for (fiber, approach) in approaches.iter().enumerate() {
            let Some(approach) = approach else { continue };
            out.through += usize::from(approach.distance_mm == 0.0);
            out.within += usize::from(approach.distance_mm <= within_mm);
            if out.nearest.is_none_or(|(_, best)| approach.distance_mm < best.distance_mm) {
                out.nearest = Some((fiber, *approach));
            }
        }
        out
    }
}
