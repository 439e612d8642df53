//! Opening bound of the skeleton's force: the force against a plain sum over all charges, and the
//! skeleton against that of the exact sum.

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
    about: "Boundary whose extent is below θ times its distance is summed as one charge. First the force: the \
            error is the angle to a plain sum over all charges at every voxel inside, which is largest where \
            the force all but vanishes; time is that of the field. Then, not with --quick, where the mask is \
            too small, the whole skeleton: how far its points and those of the exact sum's lie from each \
            other. That error doesn't fall evenly: a streamline that turns off elsewhere moves many points at \
            once.",
    defaults: Defaults::One,
    curves,
};

/// One charge after the other, without the tree.
struct PlainSum;

impl ForceSource for PlainSum {
    fn describe(&self) -> String {
        "plain sum".to_owned()
    }

    fn forces(&self, task: &ForceTask<'_>, progress: &Progress) -> Result<Vec<DVec3>, Refused> {
        let power = f64::from(task.exponent);
        let one = |x: &DVec3| {
            progress.check().map_err(Refused::Cancelled)?;
            let nearest = task.charges.iter().map(|c| x.distance(c.at)).fold(f64::INFINITY, f64::min);
            let felt = task.charges.iter().map(|c| {
                let away = *x - c.at;
                // Scaled by the m-th power of the nearest distance, as sources are asked to.
                away.normalize_or_zero() * c.weight * (nearest / away.length()).powf(power)
            });
            Ok(felt.sum())
        };
        task.places.par_iter().map(one).collect()
    }
}

/// Degrees between two directions.
pub fn angle_deg(a: DVec3, b: DVec3) -> f64 {
    // Of the sine and cosine: exact for small angles, too.
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

/// Distances from each point of one skeleton to the nearest of the other, both ways.
fn apart(a: &Skeleton, b: &Skeleton) -> Outcome<Errors> {
    let places = |s: &Skeleton| s.points.iter().map(|p| p.position_mm).collect::<Vec<_>>();
    let mut errors = Errors::default();
    for (from, to) in [(a, b), (b, a)] {
        let tree = KdTree::new(&places(to))?;
        for place in places(from) {
            errors.add(tree.as_ref().and_then(|t| t.nearest(place)).map_or(f64::NAN, |n| n.1));
        }
    }
    Ok(errors)
}

/// The phantom's first mask in its box, or every `coarser`-th voxel of it.
fn mask(coarser: usize) -> Outcome<(MaskBits, Grid)> {
    let first = scenes::phantom()?.masks.first().ok_or("the phantom has no mask")?;
    let whole = first.mask.bits();
    let (start, size) = whole.bounds().ok_or("the phantom's first mask is empty")?;
    let grid = first.mask.grid().crop(start, size)?;
    let dims = size.map(|n| n.div_ceil(coarser));
    let bits = MaskBits::from_fn(dims, |linear| {
        let at = glioscope_core::grid::ijk(dims, linear);
        whole.get(std::array::from_fn(|a| start[a] + coarser * at[a]))
    });
    let mut place = grid.world_from_voxel();
    place.matrix3 *= coarser as f64;
    Ok((bits, Grid::new(dims, place, grid.sides())?))
}

struct Stage<'a> {
    bench: &'a Bench<'a>,
    bits: MaskBits,
    grid: Grid,
    openings: &'a [f64],
}

impl Stage<'_> {
    /// The knob swept; `run` at an opening bound, `errors` of what it gave.
    fn sweep<T>(
        &self,
        what: &str,
        run: impl Fn(&SkeletonOptions) -> Outcome<T>,
        errors: impl Fn(&T) -> Outcome<Errors>,
    ) -> Outcome<Vec<Point>> {
        let sweep = Sweep {
            what,
            rounds: self.bench.effort.of(1, 3, 7),
            patience: Duration::from_millis(5000),
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
                let errors = errors(&found.take().ok_or("nothing was run")?)?;
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
        self.bench.begin("force: truth", "plain sum");
        let truth = force_field_with(bits, grid, &options(0.0), Some(&PlainSum), &Progress::new())?;
        if !matches!(truth.used, ForceUsed::Source(_)) {
            return Err(format!("forces by the {}, expected the plain sum", truth.used).into());
        }
        let angles = |found: &ForceField| {
            let pairs = found.forces.iter().zip(&truth.forces);
            Ok(Errors::of(pairs.map(|(f, t)| angle_deg(*f, *t))))
        };
        let run = |options: &SkeletonOptions| Ok(force_field(bits, grid, options, &Progress::new())?);
        let points = self.sweep("force: opening", run, angles)?;
        let words = format!(
            "plain sum over all charges at each of {} places; angle between both",
            truth.forces.len()
        );
        Ok(self.curve("tree", "the force", words, "degrees", points))
    }

    fn skeletons(&self) -> Outcome<Curve> {
        let run = |options: &SkeletonOptions| -> Outcome<Skeleton> {
            Ok(skeleton(&self.bits, &self.grid, options, &Progress::new())?)
        };
        self.bench.begin("skeleton: truth", "exact sum");
        let truth = run(&options(0.0))?;
        let points = self.sweep("skeleton: opening", run, |found| apart(found, &truth))?;
        let words = format!(
            "the skeleton of the exact sum (θ = 0), {} points; distance to the nearest point, both ways",
            truth.points.len()
        );
        Ok(self.curve("core level", "the whole skeleton", words, "mm", points))
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
    let (bits, grid) = mask(bench.effort.of(3, 2, 1))?;
    let stage = Stage { bench, bits, grid, openings };
    let mut out = vec![stage.force()?];
    // The skeleton of a small mask is a point or two: it says nothing.
    if bench.effort != Effort::Quick {
        out.push(stage.skeletons()?);
    }
    Ok(out)
}
