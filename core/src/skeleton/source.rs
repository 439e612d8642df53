//! Computation of the forces at the lattice points: by this crate's tree, or by a source provided by the caller.

use std::fmt;

use glam::DVec3;

use super::{
    field::Lattice,
    force::{Charge, Charges, PowerLaw},
};
use crate::{Cancelled, Progress, grid::ijk};

/// Input of a [`ForceSource`]. Positions are in units of the finest voxel spacing, relative to the centre of the first
/// voxel of the mask's box: numbers of moderate size, wherever the image lies.
#[derive(Clone, Copy, Debug)]
pub struct ForceTask<'a> {
    /// The boundary's charges, at least one; neighbours in the list are close to each other.
    pub charges: &'a [Charge],
    /// Points inside the mask at which the force is needed.
    pub places: &'a [DVec3],
    /// m: the force decays with this power of the distance, 4 to 9.
    pub exponent: u32,
}

/// Why a [`ForceSource`] returned no forces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refused {
    /// The user cancelled.
    Cancelled(Cancelled),
    /// It can't or shouldn't compute them, with the reason in one line. The tree is used instead.
    Because(String),
}

/// Computes the boundary's force in place of this crate's tree.
pub trait ForceSource: Sync {
    /// Short description for the report.
    fn describe(&self) -> String;

    /// At each point x, with charges of weight w at b: `Σ w·(x−b)/‖x−b‖^(m+1)`, times the m-th power of the distance to
    /// the nearest charge. Reports to `progress`.
    ///
    /// # Errors
    /// [`Refused`]: cancelled, or why the tree should be used.
    fn forces(&self, task: &ForceTask<'_>, progress: &Progress) -> Result<Vec<DVec3>, Refused>;
}

/// What computed the force at the lattice points. Streamlines between them always use the tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ForceUsed {
    /// The force wasn't needed.
    #[default]
    Nothing,
    /// The tree.
    Tree {
        /// Opening angle θ; 0 gives the exact sum.
        opening: f64,
        /// Why the given source was not used.
        refused: Option<String>,
    },
    /// A source, with its description.
    Source(String),
}

impl fmt::Display for ForceUsed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => f.write_str("nothing to sum"),
            Self::Tree { opening, refused } => {
                write!(f, "tree, θ {opening}")?;
                refused.as_ref().map_or(Ok(()), |why| write!(f, " ({why})"))
            }
            Self::Source(name) => f.write_str(name),
        }
    }
}

impl Lattice {
    /// The scaled force at every inside lattice point, by rank: computed by `source` if there is one and it doesn't
    /// refuse, else by the tree.
    pub(super) fn forces_from(
        &self,
        source: Option<&dyn ForceSource>,
        charges: &Charges,
        exponent: u32,
        opening: f64,
        progress: &Progress,
    ) -> Result<(Vec<DVec3>, ForceUsed), Cancelled> {
        let law = PowerLaw::new(exponent);
        let mut refused = None;
        if let Some(source) = source {
            let places = self.places();
            let task = ForceTask { charges: charges.all(), places: &places, exponent: law.exponent() };
            match source.forces(&task, progress) {
                Ok(forces) if forces.len() == places.len() && forces.iter().all(|f| f.is_finite()) => {
                    return Ok((forces, ForceUsed::Source(source.describe())));
                }
                Ok(_) => {
                    let name = source.describe();
                    refused = Some(format!("{name}: found places without a force, expected one for each"));
                }
                Err(Refused::Cancelled(cancelled)) => return Err(cancelled),
                Err(Refused::Because(why)) => refused = Some(why),
            }
        }
        let forces = self.forces(charges, law, opening, progress)?;
        Ok((forces, ForceUsed::Tree { opening, refused }))
    }

    /// Inside lattice points in units, by rank.
    fn places(&self) -> Vec<DVec3> {
        let dims = self.nodes.dims();
        let mut places = Vec::new();
        self.nodes.for_each(|l| {
            places.push(self.unit(DVec3::from_array(ijk(dims, l).map(|v| v as f64))));
        });
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Grid, MaskBits,
        skeleton::{
            Level, SkeletonError, SkeletonOptions, force_field, force_field_with, skeleton, skeleton_with,
        },
    };

    /// Sums all charges for each point but the first `.1`, or refuses with `.0`.
    struct DirectSum(Option<Refused>, usize);

    impl ForceSource for DirectSum {
        fn describe(&self) -> String {
            "plain sum".into()
        }

        fn forces(&self, task: &ForceTask<'_>, _: &Progress) -> Result<Vec<DVec3>, Refused> {
            if let Some(refused) = &self.0 {
                return Err(refused.clone());
            }
            let m = task.exponent as i32;
            let one = |x: &DVec3| {
                let sum: DVec3 = (task.charges.iter())
                    .map(|c| (*x - c.at) * c.weight / x.distance(c.at).powi(m + 1))
                    .sum();
                let nearest = task.charges.iter().map(|c| x.distance(c.at)).fold(f64::INFINITY, f64::min);
                sum * nearest.powi(m)
            };
            Ok(task.places.iter().skip(self.1).map(one).collect())
        }
    }

    fn capsule() -> (MaskBits, Grid) {
        let grid = Grid::axis_aligned([24, 13, 6], DVec3::new(1.0, 1.0, 3.0), DVec3::splat(40.0)).unwrap();
        let bits = MaskBits::from_fn(grid.dims(), |l| {
            let p = DVec3::new((l % 24) as f64, (l / 24 % 13) as f64, (l / (24 * 13)) as f64 * 3.0);
            let axis = DVec3::new(p.x.clamp(7.0, 16.0), 6.0, 7.5);
            p.distance(axis) <= 5.2
        });
        (bits, grid)
    }

    #[test]
    fn a_source_computes_the_force_at_every_lattice_point_and_is_reported() {
        let (bits, grid) = capsule();
        let exact = SkeletonOptions {
            level: Level::Divergence,
            opening: 0.0,
            exponent: 6,
            ..SkeletonOptions::default()
        };
        let own = force_field(&bits, &grid, &exact, &Progress::new()).unwrap();
        let other =
            force_field_with(&bits, &grid, &exact, Some(&DirectSum(None, 0)), &Progress::new()).unwrap();
        assert_eq!(own.voxels, other.voxels);
        for (a, b) in own.forces.iter().zip(&other.forces) {
            assert!(a.distance(*b) <= 1e-9 * (1.0 + a.length()), "{a} {b}");
        }
        let from_source =
            skeleton_with(&bits, &grid, &exact, Some(&DirectSum(None, 0)), &Progress::new()).unwrap();
        assert_eq!(from_source.force.to_string(), "plain sum");
        let own = skeleton(&bits, &grid, &exact, &Progress::new()).unwrap();
        assert_eq!(own.force.to_string(), "tree, θ 0");
        assert_eq!(own.points.len(), from_source.points.len());
        assert!(from_source.points.len() > 1);
        for (a, b) in own.points.iter().zip(&from_source.points) {
            assert!(a.position_mm.distance(b.position_mm) < 1e-6, "{a:?} {b:?}");
        }
    }

    #[test]
    fn after_a_refusal_the_tree_is_used_and_the_reason_reported() {
        let (bits, grid) = capsule();
        let options = SkeletonOptions::default();
        let with = |source: &DirectSum| skeleton_with(&bits, &grid, &options, Some(source), &Progress::new());
        let own = skeleton(&bits, &grid, &options, &Progress::new()).unwrap();
        let refused = with(&DirectSum(Some(Refused::Because("too much".into())), 0)).unwrap();
        assert_eq!((&refused.points, &refused.lines), (&own.points, &own.lines));
        assert_eq!(refused.force.to_string(), "tree, θ 0.25 (too much)");
        let short = with(&DirectSum(None, 1)).unwrap();
        assert_eq!(short.points, own.points);
        assert!(short.force.to_string().contains("without a force"), "{}", short.force);
        let stopped = with(&DirectSum(Some(Refused::Cancelled(Cancelled)), 0));
        assert_eq!(stopped, Err(SkeletonError::Cancelled(Cancelled)));
    }
}
