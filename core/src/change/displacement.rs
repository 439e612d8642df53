//! Displaced, not grown: the translation of a component between two dates, and what change it leaves.
//!
//! Where a closed surface moves by t it moves by n·t along its normals n. The translation is what the distances from each
//! surface to the other have in common with that, by weighted least squares (point-to-plane: Chen and Medioni 1992), from
//! the centroids on. Weights are areas: those of a closed surface sum to 0 along n, so that even growth has no part in it.
//!
//! Growth on one side has a part in it, too. So a displacement is sought only where the surface recedes on one side as it
//! advances on the other. Growth on one side and shrinkage on the other can't be told from it, whatever the method: both
//! masks are the same.

use glam::{DMat3, DVec3};
use serde::Serialize;
use strum::IntoStaticStr;

use super::{
    COVERAGE, Change, ChangeError, MOVED_SHARE, SurfaceChange, Uncertainty,
    place::{Edges, Patch},
    point_cloud::PointCloud,
    uncertainty::outer,
    vectors::SurfaceVoxel,
};
use crate::{Progress, eigen::symmetric_eigen};

/// Patches of each surface that are fitted at most, evenly thinned.
const MOST_FITTED: usize = 1000;
const MOST_STEPS: usize = 30;
/// Multiples of it are spread most evenly over a unit (Weyl; the golden ratio's fraction).
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Movement in shares of a voxel's shortest edge below which the fit ends.
const SETTLED: f64 = 1e-3;
/// Share of the largest eigenvalue below which a direction is undetermined.
const UNDETERMINED: f64 = 1e-3;
/// Errors of a drawn border count as alike within a square of this edge, and as independent beyond: a choice.
const ALIKE_MM: f64 = 5.0;

/// What a displacement explains. Names in JSON are stable, lower case, hyphenated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, IntoStaticStr)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Explains {
    /// All of the change: the volume is the same within its uncertainty, and so is the surface after the displacement.
    All,
    /// All but growth: the volume grew, and no surface recedes after the displacement.
    AllButGrowth,
    /// All but shrinkage: the volume shrank, and no surface advances after the displacement.
    AllButShrinkage,
    /// Not the change, or it can't be told from the registration's error.
    Little,
}

/// A component's own displacement between the dates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// From the earlier to the later date, in RAS millimetres.
    pub by_mm: DVec3,
    /// Shorter displacements can't be told from none, in any direction: mostly the registration's error.
    pub uncertainty_mm: f64,
    /// Smaller differences of the volumes can't be told from none, millilitres.
    pub volume_uncertainty_ml: f64,
    /// Share of the later surface that lies outside the earlier one by more than its uncertainty, once displaced with it.
    pub grew_share: f64,
    /// Share of the earlier surface that lies outside the later one by more than its uncertainty, likewise.
    pub shrank_share: f64,
    /// Mean movement of the surface that is left, growth positive, millimetres.
    pub left_mm: f64,
    /// What it explains.
    pub explains: Explains,
}

/// One surface of a component.
struct Side<'a> {
    patches: Vec<&'a Patch>,
    cloud: PointCloud,
}

impl<'a> Side<'a> {
    fn new(voxels: &'a [SurfaceVoxel], group: u32) -> Result<Self, ChangeError> {
        let patches: Vec<&Patch> = voxels.iter().filter(|s| s.group == group).map(|s| &s.patch).collect();
        let places = patches.iter().map(|patch| patch.middle_mm).collect();
        let cloud = PointCloud::new(places, (0..patches.len() as u32).collect())?;
        Ok(Self { patches, cloud })
    }

    fn nearest(&self, p: DVec3) -> Option<&'a Patch> {
        self.patches.get(self.cloud.nearest(p)?.0 as usize).copied()
    }

    fn area_mm2(&self) -> f64 {
        self.patches.iter().map(|patch| patch.area_mm2).sum()
    }
}

/// What is left of a change after a displacement.
#[derive(Default)]
struct Left {
    /// Share of each surface beyond its uncertainty: the later one outside, the earlier one outside.
    shares: [f64; 2],
    mean_mm: f64,
}

struct Fit<'a> {
    sides: [Side<'a>; 2],
    edges: &'a Edges,
    uncertainty: &'a Uncertainty,
}

impl Fit<'_> {
    /// Every patch of the earlier (0) or later surface, at most `most` of them, with the nearest of the other one once displaced: the
    /// patch itself, that one, and the vector from the latter's middle to the former's.
    fn pairs(&self, date: usize, by_mm: DVec3, most: usize) -> impl Iterator<Item = (&Patch, &Patch, DVec3)> {
        let [own, other] = [&self.sides[date], &self.sides[1 - date]];
        let back = if date == 1 { -by_mm } else { by_mm };
        // By the golden ratio: every second voxel along a line would be one side's alone.
        let share = most as f64 / own.patches.len().max(1) as f64;
        let is_taken = move |at: &(usize, &&Patch)| (at.0 as f64 * GOLDEN).fract() < share;
        own.patches.iter().enumerate().filter(is_taken).filter_map(move |(_, patch)| {
            let nearest = other.nearest(patch.middle_mm + back)?;
            Some((*patch, nearest, patch.middle_mm + back - nearest.middle_mm))
        })
    }

    /// The translation, from a first guess.
    fn translation(&self, mut by_mm: DVec3, progress: &Progress) -> Result<DVec3, ChangeError> {
        let settled_mm = SETTLED * self.edges.shortest_mm();
        for _ in 0..MOST_STEPS {
            progress.check()?;
            let (mut squares, mut moment) = (DMat3::ZERO, DVec3::ZERO);
            for date in 0..2 {
                // How far the later surface lies beyond the displaced earlier one, by the normals of the surface that is hit.
                let sign = if date == 1 { 1.0 } else { -1.0 };
                for (patch, hit, apart) in self.pairs(date, by_mm, MOST_FITTED) {
                    let n = hit.normal;
                    squares += outer(n) * patch.area_mm2;
                    moment += n * (patch.area_mm2 * sign * n.dot(apart));
                }
            }
            let (values, vectors) = symmetric_eigen(squares);
            let most = values.into_iter().fold(0.0, f64::max);
            let step_mm: DVec3 = (0..3)
                .filter(|&axis| values[axis] > UNDETERMINED * most)
                .map(|axis| vectors.col(axis) * (vectors.col(axis).dot(moment) / values[axis]))
                .sum();
            by_mm += step_mm;
            if step_mm.length() <= settled_mm {
                break;
            }
        }
        Ok(by_mm)
    }

    fn left(&self, by_mm: DVec3) -> Left {
        let covariance = self.uncertainty.isotropic_mm.is_none().then(|| self.uncertainty.covariance_mm2());
        let mut left = Left::default();
        let (mut sum, mut area) = (0.0, 0.0);
        for date in 0..2 {
            let sign = if date == 1 { 1.0 } else { -1.0 };
            let (mut beyond, mut count) = (0.0, 0.0);
            for (patch, hit, apart) in self.pairs(date, by_mm, usize::MAX) {
                let here = hit.middle_mm + apart;
                let foot = |covariance| here - hit.foot(here, self.edges, covariance);
                let is_outside = hit.normal.dot(apart) > 0.0;
                let signed_mm = foot(None).length() * if is_outside { sign } else { -sign };
                sum += signed_mm * patch.area_mm2;
                area += patch.area_mm2;
                let deviations = self.uncertainty.deviations(foot(covariance)).length();
                beyond += if is_outside && deviations >= COVERAGE { 1.0 } else { 0.0 };
                count += 1.0;
            }
            left.shares[1 - date] = beyond / f64::max(count, 1.0);
        }
        left.mean_mm = if area > 0.0 { sum / area } else { 0.0 };
        left
    }
}

/// A component at one date.
pub(super) struct Body<'a> {
    /// The outer surface of its mask.
    pub surface: &'a [SurfaceVoxel],
    /// Mean of its voxels' centres, as the surface lies.
    pub centroid_mm: DVec3,
    pub volume_ml: f64,
}

/// The displacement of group number `group` of `change`, one component at either date, whose vectors are known. `None` where none is
/// sought: but for one that advances on one side as it recedes on another, beyond the uncertainty.
pub(super) fn displacement_of(
    change: &Change,
    group: u32,
    [before, after]: [Body<'_>; 2],
    edges: &Edges,
    progress: &Progress,
) -> Result<Option<Displacement>, ChangeError> {
    let beyond = |grows: bool| {
        let of = |v: &&SurfaceChange| {
            v.group == group && (v.signed_mm > 0.0) == grows && !v.flags.within_uncertainty
        };
        change.vectors.iter().filter(of).count() as f64
    };
    let sides = [Side::new(before.surface, group)?, Side::new(after.surface, group)?];
    let counts = sides.each_ref().map(|side| MOVED_SHARE * side.patches.len() as f64);
    if beyond(true) <= counts[1] || beyond(false) <= counts[0] {
        return Ok(None);
    }
    let uncertainty = &change.uncertainty;
    let fit = Fit { sides, edges, uncertainty };
    let by_mm = fit.translation(after.centroid_mm - before.centroid_mm, progress)?;
    let left = fit.left(by_mm);
    // Of a border's place without the registration's error, which moves all of it: the mean over directions.
    let area_mm2 = 0.5 * (fit.sides[0].area_mm2() + fit.sides[1].area_mm2());
    let registration_mm2 = uncertainty.registration_mm * uncertainty.registration_mm;
    let c = uncertainty.covariance_mm2();
    let border_mm2 = ((c.x_axis.x + c.y_axis.y + c.z_axis.z) / 3.0 - registration_mm2).max(0.0);
    let pieces = (area_mm2 / (ALIKE_MM * ALIKE_MM)).max(1.0);
    // Along each direction a third of the surface's normals tells of the displacement.
    let uncertainty_mm = COVERAGE * (registration_mm2 + 3.0 * border_mm2 / pieces).sqrt();
    let volume_uncertainty_ml = COVERAGE * area_mm2 * (border_mm2 / pieces).sqrt() / 1000.0;
    let [grew_share, shrank_share] = left.shares;
    let grown_ml = after.volume_ml - before.volume_ml;
    let is_same = grown_ml.abs() <= volume_uncertainty_ml;
    let explains = match (grew_share > MOVED_SHARE, shrank_share > MOVED_SHARE) {
        _ if by_mm.length() <= uncertainty_mm => Explains::Little,
        (false, false) if is_same => Explains::All,
        (_, false) if !is_same && grown_ml > 0.0 => Explains::AllButGrowth,
        (false, _) if !is_same && grown_ml < 0.0 => Explains::AllButShrinkage,
        _ => Explains::Little,
    };
    Ok(Some(Displacement {
        by_mm,
        uncertainty_mm,
        volume_uncertainty_ml,
        grew_share,
        shrank_share,
        left_mm: left.mean_mm,
        explains,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Grid, MaskBits,
        change::{Call, ChangeOptions, change},
        grid::ijk,
        optics::random::Random,
    };

    type Shape<'a> = &'a dyn Fn(DVec3) -> bool;

    fn compared(spacing: DVec3, registration_mm: f64, [before, after]: [Shape<'_>; 2]) -> Change {
        let dims = spacing.to_array().map(|s| 2 * (30.0 / s).ceil() as usize + 1);
        let origin = DVec3::from_array(dims.map(|n| -((n - 1) as f64) / 2.0)) * spacing;
        let grid = Grid::axis_aligned(dims, spacing, origin + DVec3::new(0.17, -0.31, 0.23)).unwrap();
        let bits =
            |inside: Shape<'_>| MaskBits::from_fn(dims, |l| inside(grid.center_of_voxel_mm(ijk(dims, l))));
        let options = ChangeOptions { registration_mm, by_skeleton: false, ..ChangeOptions::default() };
        change(&bits(before), &bits(after), &grid, &options, &Progress::new()).unwrap()
    }

    fn ball(center: DVec3, radius: f64) -> impl Fn(DVec3) -> bool {
        move |p| p.distance(center) <= radius
    }

    const SPACINGS: [DVec3; 2] = [DVec3::ONE, DVec3::new(1.0, 1.0, 3.0)];

    #[test]
    fn a_ball_that_moved_is_displaced_and_not_grown() {
        let by = DVec3::new(2.0, -2.0, 1.0);
        for spacing in SPACINGS {
            let c = compared(spacing, 0.5, [&ball(DVec3::ZERO, 11.0), &ball(by, 11.0)]);
            let call = Call::of(&c);
            assert!(call.grew && call.shrank, "as the surface alone says: {call:?}");
            let found = c.displacements[0].unwrap();
            assert_eq!(found.explains, Explains::All, "{spacing} {found:?}");
            assert!(found.by_mm.distance(by) < 0.25 * spacing.max_element(), "{found:?}");
            assert!(found.left_mm.abs() < 0.2 && found.uncertainty_mm > 1.96 * 0.5, "{found:?}");
        }
        // As far as it may have moved by the registration's error, nothing is said.
        let c = compared(DVec3::ONE, 2.0, [&ball(DVec3::ZERO, 11.0), &ball(by, 11.0)]);
        assert!(c.displacements[0].is_none_or(|d| d.explains == Explains::Little));
    }

    #[test]
    fn a_ball_that_moved_and_grew_is_both() {
        let by = DVec3::new(3.0, 0.0, -4.0);
        for (from, to, explains) in
            [(11.0, 13.0, Explains::AllButGrowth), (13.0, 11.0, Explains::AllButShrinkage)]
        {
            let c = compared(DVec3::ONE, 0.5, [&ball(DVec3::ZERO, from), &ball(by, to)]);
            let found = c.displacements[0].unwrap();
            assert_eq!(found.explains, explains, "{found:?}");
            assert!(found.by_mm.distance(by) < 0.3, "{found:?}");
            assert!((found.left_mm - (to - from)).abs() < 0.2, "{found:?}");
        }
    }

    /// The fit alone would say half of the growth is displacement: nothing recedes, so that it isn't asked.
    #[test]
    fn growth_on_one_side_is_no_displacement() {
        let towards = DVec3::new(0.6, 0.0, 0.8);
        for most in [1.5, 2.0, 3.0, 5.0, 8.0] {
            let grown = |p: DVec3| p.length() <= 11.0 + most * p.normalize_or_zero().dot(towards).max(0.0);
            for spacing in SPACINGS {
                let c = compared(spacing, 0.5, [&ball(DVec3::ZERO, 11.0), &grown]);
                assert_eq!(c.displacements[0], None, "{most} mm at {spacing}");
            }
        }
        // Grown by more on one side than it shrank on the other, it is another shape and volume than one that moved.
        let both = |p: DVec3| {
            let along = p.normalize_or_zero().dot(towards);
            p.length() <= 11.0 + if along > 0.0 { 6.0 * along } else { 2.0 * along }
        };
        let c = compared(DVec3::ONE, 0.5, [&ball(DVec3::ZERO, 11.0), &both]);
        assert!(c.displacements[0].is_none_or(|d| d.explains != Explains::All));
    }

    #[test]
    fn lesions_that_move_differently_each_have_their_own() {
        let places = [DVec3::new(-15.0, 0.0, 0.0), DVec3::new(14.0, 5.0, 3.0), DVec3::new(0.0, -18.0, 10.0)];
        let by = [DVec3::new(0.0, 3.0, 0.0), DVec3::new(-2.0, 0.0, -2.5), DVec3::ZERO];
        let before = |p: DVec3| places.iter().any(|c| p.distance(*c) <= 7.0);
        let after = |p: DVec3| places.iter().zip(by).any(|(c, by)| p.distance(*c + by) <= 7.0);
        let c = compared(DVec3::ONE, 0.5, [&before, &after]);
        assert_eq!(c.groups.len(), 3);
        for (group, displacement) in c.groups.iter().zip(&c.displacements) {
            let at = (0..3).find(|&n| group.before[0].centroid_mm.distance(places[n]) < 1.0).unwrap();
            match displacement {
                None => assert_eq!(by[at], DVec3::ZERO),
                Some(found) => {
                    assert_eq!(found.explains, Explains::All, "{found:?}");
                    assert!(found.by_mm.distance(by[at]) < 0.3, "{found:?} {at}");
                }
            }
        }
    }

    /// Monte Carlo: ellipsoids on random places of the voxels. Without a registration's error what remains is the borders'.
    #[test]
    fn displacements_lie_within_their_uncertainty() {
        let mut random = Random::new(0x6d6f_7665, 1);
        let mut direction = || {
            let mut one = || 2.0 * random.unit() - 1.0;
            DVec3::new(one(), one(), one())
        };
        let (mut within, mut all) = (0, 0);
        for _ in 0..24 {
            let (at, axes) = (direction(), DVec3::splat(10.0) + 3.0 * direction());
            let by = 3.5 * direction().normalize_or_zero();
            let inside = |c: DVec3| move |p: DVec3| ((p - c) / axes).length() <= 1.0;
            let c = compared(DVec3::ONE, 0.0, [&inside(at), &inside(at + by)]);
            let found = c.displacements[0].unwrap();
            assert_eq!(found.explains, Explains::All, "{found:?}");
            all += 3;
            within +=
                (found.by_mm - by).abs().to_array().iter().filter(|mm| **mm <= found.uncertainty_mm).count();
        }
        assert!(within as f64 >= 0.93 * f64::from(all), "{within} of {all}");
    }
}
