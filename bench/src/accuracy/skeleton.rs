//! Opening bound of the skeleton's force: the force compared with a direct sum over all charges, and the skeleton with
//! that of the exact sum.

use std::time::Duration;

use glam::DVec3;
use glioscope_core::{
    Grid, MaskBits, Progress,
    distance::KdTree,
    skeleton::{
        ForceField, ForceSource, ForceTask, ForceUsed, Refused, Skeleton, SkeletonOptions, force_field,
        force_field_with, skeleton,
    },
};
use rayon::prelude::*;

use super::{Axis, Bench, Curve, Defaults, Effort, Family, Point, errors::Errors, scenes, sweep::Sweep};
use crate::Outcome;

pub(super) const FAMILY: Family = Family {
    name: "skeleton",
    title: "Opening bound of the skeleton's force",
    about: "Boundary charges in a group whose extent is below θ times its distance are summed as one charge. First, \
            the force: the error is the angle to a direct sum over all charges, at every voxel inside the mask, and \
            is largest where the force almost vanishes; time is that of the force field. Second, the whole skeleton \
            (not with --quick, whose mask is too small): the error is the distance from its points to those of the \
            exact sum's skeleton, and vice versa. It doesn't fall smoothly, because one streamline that branches \
            off at another point moves many skeleton points at once.",
    defaults: Defaults::One,
    curves,
};

/// Direct summation over all charges, without the tree.
struct DirectSum;

impl ForceSource for DirectSum {
    fn describe(&self) -> String {
        "direct sum".to_owned()
    }

    fn forces(&self, task: &ForceTask<'_>, progress: &Progress) -> Result<Vec<DVec3>, Refused> {
        let power = f64::from(task.exponent);
        let force = |x: &DVec3| {
            progress.check().map_err(Refused::Cancelled)?;
            let nearest = task.charges.iter().map(|c| x.distance(c.at)).fold(f64::INFINITY, f64::min);
            let contributions = task.charges.iter().map(|c| {
                let away = *x - c.at;
                // Scaled by the m-th power of the nearest distance, as `ForceSource` requires.
                away.normalize_or_zero() * c.weight * (nearest / away.length()).powf(power)
            });
            Ok(contributions.sum())
        };
        task.places.par_iter().map(force).collect()
    }
}

/// Degrees between two directions.
pub fn angle_deg(a: DVec3, b: DVec3) -> f64 {
    // From sine and cosine: accurate for small angles, too.
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

/// Distances from each point of one skeleton to the nearest point of the other, in both directions.
fn skeleton_distances(a: &Skeleton, b: &Skeleton) -> Outcome<Errors> {
    let positions_mm = |s: &Skeleton| s.points.iter().map(|p| p.position_mm).collect::<Vec<_>>();
    let mut errors = Errors::default();
    for (from, to) in [(a, b), (b, a)] {
        let tree = KdTree::new(&positions_mm(to))?;
        for position_mm in positions_mm(from) {
            errors.add(tree.as_ref().and_then(|t| t.nearest(position_mm)).map_or(f64::NAN, |n| n.1));
        }
    }
    Ok(errors)
}

/// The phantom's first mask, cropped to its bounding box and subsampled to every `stride`-th voxel.
fn phantom_mask(stride: usize) -> Outcome<(MaskBits, Grid)> {
    let first = scenes::phantom()?.masks.first().ok_or("the phantom has no mask")?;
    let whole = first.mask.bits();
    let (start, size) = whole.bounds().ok_or("the phantom's first mask is empty")?;
    let grid = first.mask.grid().crop(start, size)?;
    let dims = size.map(|n| n.div_ceil(stride));
    let bits = MaskBits::from_fn(dims, |linear| {
        let at = glioscope_core::grid::ijk(dims, linear);
        whole.get(std::array::from_fn(|a| start[a] + stride * at[a]))
    });
    let mut world_from_voxel = grid.world_from_voxel();
    world_from_voxel.matrix3 *= stride as f64;
    Ok((bits, Grid::new(dims, world_from_voxel, grid.sides())?))
}

struct SkeletonSweep<'a> {
    bench: &'a Bench<'a>,
    bits: MaskBits,
    grid: Grid,
    openings: &'a [f64],
}

impl SkeletonSweep<'_> {
    /// Measures `run` at each opening bound, and the `errors` of its result.
    fn sweep<T>(
        &self,
        label: &str,
        run: impl Fn(&SkeletonOptions) -> Outcome<T>,
        errors: impl Fn(&T) -> Outcome<Errors>,
    ) -> Outcome<Vec<Point>> {
        let sweep = Sweep {
            label,
            rounds: self.bench.effort.of(1, 3, 7),
            time_budget: Duration::from_millis(5000),
            on_device: false,
        };
        let settings: Vec<(String, f64)> = self.openings.iter().map(|o| (format!("θ = {o}"), *o)).collect();
        self.bench.sweep(
            &sweep,
            &mut None,
            &settings,
            |found, &opening| {
                *found = Some(run(&options(opening))?);
                Ok(())
            },
            |found, &opening| {
                let errors = errors(&found.take().ok_or("the kernel was not run")?)?;
                let is_default = opening == SkeletonOptions::default().opening;
                Ok(Point { is_default, ..Point::new(opening, &errors) })
            },
        )
    }

    fn curve(&self, kernel: &str, of: &str, truth: String, unit: &'static str, points: Vec<Point>) -> Curve {
        Curve {
            family: FAMILY.name,
            kernel: kernel.to_owned(),
            scene: format!("head phantom's first mask, {} voxels: {of}", self.bits.count()),
            knob: "SkeletonOptions::opening",
            truth,
            truth_error: None,
            unit,
            axis: Axis::Time,
            points,
        }
    }

    fn force(&self) -> Outcome<Curve> {
        let (bits, grid) = (&self.bits, &self.grid);
        self.bench.begin("force: truth", "direct sum");
        let truth = force_field_with(bits, grid, &options(0.0), Some(&DirectSum), &Progress::new())?;
        if !matches!(truth.used, ForceUsed::Source(_)) {
            return Err(format!("found forces by {}, expected the direct sum", truth.used).into());
        }
        let angles = |found: &ForceField| {
            let pairs = found.forces.iter().zip(&truth.forces);
            Ok(Errors::of(pairs.map(|(f, t)| angle_deg(*f, *t))))
        };
        let run = |options: &SkeletonOptions| Ok(force_field(bits, grid, options, &Progress::new())?);
        let points = self.sweep("force: opening", run, angles)?;
        let truth_text = format!(
            "direct sum over all charges at each of {} points; angle between the two forces",
            truth.forces.len()
        );
        Ok(self.curve("tree", "the force", truth_text, "degrees", points))
    }

    fn skeletons(&self) -> Outcome<Curve> {
        let run = |options: &SkeletonOptions| -> Outcome<Skeleton> {
            Ok(skeleton(&self.bits, &self.grid, options, &Progress::new())?)
        };
        self.bench.begin("skeleton: truth", "exact sum");
        let truth = run(&options(0.0))?;
        let points = self.sweep("skeleton: opening", run, |found| skeleton_distances(found, &truth))?;
        let truth_text = format!(
            "the skeleton of the exact sum (θ = 0), {} points; distance to the nearest point, in both directions",
            truth.points.len()
        );
        Ok(self.curve("core level", "the whole skeleton", truth_text, "mm", points))
    }
}

fn options(opening: f64) -> SkeletonOptions {
    SkeletonOptions { opening, ..SkeletonOptions::default() }
}

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let openings: &[f64] = bench.effort.of(
        &[0.6, 0.25, 0.1],
        &[0.6, 0.4, 0.25, 0.15],
        &[0.9, 0.6, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1, 0.05],
    );
    let (bits, grid) = phantom_mask(bench.effort.of(3, 2, 1))?;
    let sweeps = SkeletonSweep { bench, bits, grid, openings };
    let mut out = vec![sweeps.force()?];
    // The skeleton of the quick run's small mask has only one or two points.
    if bench.effort != Effort::Quick {
        out.push(sweeps.skeletons()?);
    }
    Ok(out)
}
