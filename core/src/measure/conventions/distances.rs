//! Distances from each point of one surface to the nearest of another, both ways.

use crate::{
    Grid, MaskBits,
    distance::{Crop, DistanceError, FeatureTransform, KdTree},
    grid::ijk,
};
use glam::DVec3;
use rayon::prelude::*;

use super::{
    convention::Percentile,
    surface::{Points, Surface},
    surfels,
};

/// Lattice points around a point that are looked at one by one first. Surfaces that are compared mostly lie within a few
/// voxels of each other: most points are settled by the first dozen.
const NEARBY: f64 = 120.0;

/// Lattice points per point of a surface below which the nearest points of the whole lattice are found at once: as dear as
/// looking around every point (measured on random blobs).
const DENSE: usize = 8;

/// The same for points that aren't settled nearby, against asking a tree for each.
const DENSE_FAR: usize = 60;

/// Steps along an axis that [`Nearby`] looks at most, whatever the spacing.
const NEARBY_STEPS: f64 = 24.0;

/// Distances from the points of one surface to the nearest of the other, ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Directed {
    /// Millimetres and weight (mm², or 1 where all count the same) of each point, by distance, then weight.
    points: Vec<(f64, f64)>,
    /// The point farthest from the other surface and its nearest there, in lattice steps.
    farthest: Option<[[usize; 3]; 2]>,
}

/// Both directions between two surfaces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SurfaceDistances {
    pub(super) a_to_b: Directed,
    pub(super) b_to_a: Directed,
}

impl Directed {
    fn weight(&self) -> f64 {
        self.points.iter().map(|p| p.1).sum()
    }

    /// Weighted sum of the distances.
    fn sum(&self) -> f64 {
        self.points.iter().map(|p| p.0 * p.1).sum()
    }

    fn weight_within(&self, tolerance_mm: f64) -> f64 {
        self.points.iter().take_while(|p| p.0 <= tolerance_mm).map(|p| p.1).sum()
    }

    fn max(&self) -> Option<f64> {
        self.points.last().map(|p| p.0)
    }

    /// The first distance at which the weights up to it reach `percent` of all.
    fn weighted_percentile(&self, percent: f64) -> Option<f64> {
        let (weight, part) = (self.weight(), percent / 100.0);
        let mut up_to = 0.0;
        let reached = self.points.iter().find(|p| {
            up_to += p.1;
            up_to / weight >= part
        });
        reached.or(self.points.last()).map(|p| p.0)
    }

    fn distances(&self) -> Vec<f64> {
        self.points.iter().map(|p| p.0).collect()
    }
}

/// Percentile of ascending values, linear between them (NumPy's default).
fn linear_percentile(sorted: &[f64], percent: f64) -> Option<f64> {
    let at = percent / 100.0 * sorted.len().checked_sub(1)? as f64;
    let low = *sorted.get(at.floor() as usize)?;
    let high = sorted.get(at.floor() as usize + 1).copied().unwrap_or(low);
    let (rise, part) = (high - low, at - at.floor());
    Some(if part >= 0.5 { high - rise * (1.0 - part) } else { low + rise * part })
}

impl SurfaceDistances {
    /// Between two masks of one size, both not empty. `spacing_mm` is the masks'.
    ///
    /// # Errors
    /// [`DistanceError`] for more than 2³² points of a surface, or spacings outside 1e-100 to 1e100 mm.
    pub(super) fn between(
        a: &MaskBits,
        b: &MaskBits,
        spacing_mm: DVec3,
        surface: Surface,
    ) -> Result<Self, DistanceError> {
        let areas = surfels::areas_mm2(spacing_mm.to_array());
        let (a, b) = rayon::join(|| Points::of(a, surface, &areas), || Points::of(b, surface, &areas));
        let (to_b, to_a) = rayon::join(|| directed(&a, &b, spacing_mm), || directed(&b, &a, spacing_mm));
        Ok(Self { a_to_b: to_b?, b_to_a: to_a? })
    }

    /// The longer of the two directed Hausdorff distances; `None` without points.
    pub(super) fn hausdorff_mm(&self) -> Option<f64> {
        Some(self.a_to_b.max()?.max(self.b_to_a.max()?))
    }

    /// The points on `a` and `b` that are [`Self::hausdorff_mm`] apart, in lattice steps; of equal ones those from `a`,
    /// then the first in memory.
    pub(super) fn hausdorff_points(&self) -> Option<[[usize; 3]; 2]> {
        if self.a_to_b.max()? >= self.b_to_a.max()? {
            self.a_to_b.farthest
        } else {
            self.b_to_a.farthest.map(|[from, to]| [to, from])
        }
    }

    /// The robust Hausdorff distance.
    pub(super) fn percentile_mm(&self, percent: f64, percentile: Percentile) -> Option<f64> {
        let [a, b] = [&self.a_to_b, &self.b_to_a];
        match percentile {
            Percentile::LargerOfAreaWeighted => {
                Some(a.weighted_percentile(percent)?.max(b.weighted_percentile(percent)?))
            }
            Percentile::LargerOfLinear => {
                let of = |d: &Directed| linear_percentile(&d.distances(), percent);
                Some(of(a)?.max(of(b)?))
            }
            Percentile::Pooled => {
                let mut pooled = a.distances();
                pooled.extend(b.distances());
                pooled.par_sort_unstable_by(f64::total_cmp);
                linear_percentile(&pooled, percent)
            }
        }
    }

    /// Mean over all points of both surfaces.
    pub(super) fn mean_of_all_mm(&self) -> f64 {
        (self.a_to_b.sum() + self.b_to_a.sum()) / (self.a_to_b.weight() + self.b_to_a.weight())
    }

    /// Mean of the two directed means.
    pub(super) fn mean_of_means_mm(&self) -> f64 {
        let [a, b] = [&self.a_to_b, &self.b_to_a].map(|d| d.sum() / d.weight());
        (a + b) / 2.0
    }

    /// Part of both surfaces within `tolerance_mm` of the other.
    pub(super) fn part_within(&self, tolerance_mm: f64) -> f64 {
        let [a, b] = [&self.a_to_b, &self.b_to_a];
        (a.weight_within(tolerance_mm) + b.weight_within(tolerance_mm)) / (a.weight() + b.weight())
    }

    /// Mean of the parts of each surface within `tolerance_mm` of the other.
    pub(super) fn mean_part_within(&self, tolerance_mm: f64) -> f64 {
        let [a, b] = [&self.a_to_b, &self.b_to_a].map(|d| d.weight_within(tolerance_mm) / d.weight());
        (a + b) / 2.0
    }
}

/// All lattice steps up to some length, shortest first: the first of them that leads to a set point leads to the nearest.
struct Nearby(Vec<[isize; 3]>);

impl Nearby {
    fn of(spacing_mm: DVec3) -> Self {
        // A ball of as many lattice cells.
        let ball_mm = (NEARBY * spacing_mm.element_product() * 0.75 / std::f64::consts::PI).cbrt();
        let reach_mm = ball_mm.min(NEARBY_STEPS * spacing_mm.min_element());
        let most = [0, 1, 2].map(|a| (reach_mm / spacing_mm[a]) as isize);
        let mut steps = Vec::new();
        for z in -most[2]..=most[2] {
            for y in -most[1]..=most[1] {
                for x in -most[0]..=most[0] {
                    let square_mm2 = (DVec3::new(x as f64, y as f64, z as f64) * spacing_mm).length_squared();
                    if square_mm2 <= reach_mm * reach_mm {
                        steps.push((square_mm2, [x, y, z]));
                    }
                }
            }
        }
        // Of equal lengths the first in memory.
        steps.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self(steps.into_iter().map(|step| step.1).collect())
    }

    fn first(&self, from: [usize; 3], points: &MaskBits) -> Option<[usize; 3]> {
        let dims = points.dims();
        let ends = self.0.iter().map(|step| [0, 1, 2].map(|a| from[a].wrapping_add_signed(step[a])));
        // A step below 0 wraps to beyond the lattice.
        ends.filter(|end| (0..3).all(|a| end[a] < dims[a])).find(|&end| points.get(end))
    }
}

/// `to` isn't empty.
fn directed(from: &Points, to: &Points, spacing_mm: DVec3) -> Result<Directed, DistanceError> {
    let dims = from.bits.dims();
    let mut starts = Vec::new();
    from.bits.for_each(|linear| starts.push(ijk(dims, linear)));
    let lattice: usize = dims.iter().product();
    let mut nearest = vec![None; starts.len()];
    if lattice > DENSE * starts.len() {
        let nearby = Nearby::of(spacing_mm);
        nearest.par_iter_mut().zip(&starts).for_each(|(end, &start)| *end = nearby.first(start, &to.bits));
    }
    let far = nearest.iter().filter(|end| end.is_none()).count();
    if lattice < DENSE_FAR * far {
        by_lattice(&starts, &mut nearest, &to.bits, spacing_mm)?;
    } else if far > 0 {
        by_tree(&starts, &mut nearest, &to.bits, spacing_mm)?;
    }
    let length = |from: [usize; 3], to: [usize; 3]| {
        let square = |a: usize| ((to[a] as f64 - from[a] as f64) * spacing_mm[a]).powi(2);
        (square(0) + square(1) + square(2)).sqrt()
    };
    let mut points = Vec::with_capacity(starts.len());
    let mut farthest: Option<(f64, [[usize; 3]; 2])> = None;
    for (at, (&from_point, to_point)) in starts.iter().zip(nearest).enumerate() {
        let Some(to_point) = to_point else { continue };
        let distance_mm = length(from_point, to_point);
        points.push((distance_mm, from.areas_mm2.get(at).copied().unwrap_or(1.0)));
        if farthest.is_none_or(|(most_mm, _)| distance_mm > most_mm) {
            farthest = Some((distance_mm, [from_point, to_point]));
        }
    }
    points.par_sort_unstable_by(|p, q| p.0.total_cmp(&q.0).then(p.1.total_cmp(&q.1)));
    Ok(Directed { points, farthest: farthest.map(|(_, pair)| pair) })
}

/// Fills in missing nearest points from those of all points of the lattice.
fn by_lattice(
    starts: &[[usize; 3]],
    nearest: &mut [Option<[usize; 3]>],
    to: &MaskBits,
    spacing_mm: DVec3,
) -> Result<(), DistanceError> {
    let Ok(grid) = Grid::axis_aligned(to.dims(), spacing_mm, DVec3::ZERO) else {
        return Err(DistanceError::Spacing(spacing_mm));
    };
    let Some(transform) = FeatureTransform::of(to, &grid, Crop::whole(&grid))? else { return Ok(()) };
    let missing = nearest.par_iter_mut().zip(starts).filter(|(end, _)| end.is_none());
    missing.for_each(|(end, &start)| *end = transform.nearest(start));
    Ok(())
}

/// As [`by_lattice`], at a cost that doesn't depend on the lattice.
fn by_tree(
    starts: &[[usize; 3]],
    nearest: &mut [Option<[usize; 3]>],
    to: &MaskBits,
    spacing_mm: DVec3,
) -> Result<(), DistanceError> {
    let position_mm = |v: [usize; 3]| DVec3::new(v[0] as f64, v[1] as f64, v[2] as f64) * spacing_mm;
    let mut ends = Vec::new();
    to.for_each(|linear| ends.push(ijk(to.dims(), linear)));
    let positions: Vec<_> = ends.iter().map(|&end| position_mm(end)).collect();
    let Some(tree) = KdTree::new(&positions)? else { return Ok(()) };
    let missing = nearest.par_iter_mut().zip(starts).filter(|(end, _)| end.is_none());
    missing.for_each(|(end, &start)| {
        *end = tree.nearest(position_mm(start)).and_then(|(index, _)| ends.get(index).copied());
    });
    Ok(())
}
