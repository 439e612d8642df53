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

use super::{AccuracyError, Axis, Bench, Curve, Family, Point, measure::Errors, scenes, sweep::Sweep};

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

/// Angles between the forces of two fields, degrees.
fn angles(found: &ForceField, truth: &ForceField) -> Errors {
    let mut errors = Errors::default();
    for (f, t) in found.forces.iter().zip(&truth.forces) {
        // Of the sine and cosine: exact for small angles, too.
        errors.add(f.cross(*t).length().atan2(f.dot(*t)).to_degrees());
    }
    errors
}

/// Distances from each point of one skeleton to the nearest of the other, both ways.
fn apart(a: &Skeleton, b: &Skeleton) -> Result<Errors, AccuracyError> {
    let places = |s: &Skeleton| s.points.iter().map(|p| p.position_mm).collect::<Vec<_>>();
    let mut errors = Errors::default();
    for (from, to) in [(a, b), (b, a)] {
        let tree = KdTree::new(&places(to)).map_err(|e| AccuracyError::of(&e))?;
        for place in places(from) {
            errors.add(tree.as_ref().and_then(|t| t.nearest(place)).map_or(f64::NAN, |n| n.1));
        }
    }
    Ok(errors)
}

/// The phantom's first mask in its box, or every `coarser`-th voxel of it.
fn mask(coarser: usize) -> Result<(MaskBits, Grid), AccuracyError> {
    let time = scenes::phantom()?;
    let none = || AccuracyError::Scene("a phantom without a mask".to_owned());
    let first = time.masks.first().ok_or_else(none)?;
    let (start, size) = first.mask.bits().bounds().ok_or_else(none)?;
    let grid = first.mask.grid().crop(start, size).map_err(|e| AccuracyError::of(&e))?;
    let dims = size.map(|n| n.div_ceil(coarser));
    let mut bits = MaskBits::empty(dims);
    for (x, y, z) in
        (0..dims[2]).flat_map(|z| (0..dims[1]).flat_map(move |y| (0..dims[0]).map(move |x| (x, y, z))))
    {
        let at = [x, y, z].map(|v| v * coarser);
        if first.mask.bits().get([at[0] + start[0], at[1] + start[1], at[2] + start[2]]) {
            bits.set([x, y, z]);
        }
    }
    let mut place = grid.world_from_voxel();
    place.matrix3 *= coarser as f64;
    let grid = Grid::new(dims, place, grid.sides()).map_err(|e| AccuracyError::of(&e))?;
    Ok((bits, grid))
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
        run: impl Fn(f64) -> Result<T, AccuracyError>,
        errors: impl Fn(&T) -> Result<Errors, AccuracyError>,
    ) -> Result<Vec<Point>, AccuracyError> {
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
                *found = Some(run(opening)?);
                Ok(())
            },
            |found, &opening| {
                let found = found.take().ok_or_else(|| AccuracyError::of(&"nothing"))?;
                let is_default = opening == SkeletonOptions::default().opening;
                Ok(Point { is_default, ..Point::new(opening, &errors(&found)?) })
            },
        )
    }

    fn curve(&self, kernel: &str, of: &str, truth: String, unit: &'static str, points: Vec<Point>) -> Curve {
        Curve {
            family: Family::Skeleton,
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

    fn options(opening: f64) -> SkeletonOptions {
        SkeletonOptions { opening, ..SkeletonOptions::default() }
    }

    fn force(&self) -> Result<Curve, AccuracyError> {
        let (bits, grid) = (&self.bits, &self.grid);
        self.bench.begin("force: truth", "plain sum")?;
        let own = Progress::new();
        let truth = force_field_with(bits, grid, &Self::options(0.0), Some(&PlainSum), &own)
            .map_err(|e| AccuracyError::of(&e))?;
        if !matches!(truth.used, ForceUsed::Source(_)) {
            return Err(AccuracyError::Scene(format!("forces by the {}", truth.used)));
        }
        let points = self.sweep(
            "force: opening",
            |opening| {
                self.bench.progress.check()?;
                force_field(bits, grid, &Self::options(opening), &Progress::new())
                    .map_err(|e| AccuracyError::of(&e))
            },
            |found| Ok(angles(found, &truth)),
        )?;
        let words = format!(
            "plain sum over all charges at each of {} places; angle between both",
            truth.forces.len()
        );
        Ok(self.curve("tree", "the force", words, "degrees", points))
    }

    fn skeletons(&self) -> Result<Curve, AccuracyError> {
        // A bar of its own inside each: only the asking to stop is passed on.
        let run = |opening| -> Result<Skeleton, AccuracyError> {
            self.bench.progress.check()?;
            skeleton(&self.bits, &self.grid, &Self::options(opening), &Progress::new())
                .map_err(|e| AccuracyError::of(&e))
        };
        self.bench.begin("skeleton: truth", "exact sum")?;
        let truth = run(0.0)?;
        let points = self.sweep("skeleton: opening", run, |found| apart(found, &truth))?;
        let words = format!(
            "the skeleton of the exact sum (θ = 0), {} points; distance to the nearest point, both ways",
            truth.points.len()
        );
        Ok(self.curve("core level", "the whole skeleton", words, "mm", points))
    }
}

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    let openings: &[f64] = bench.effort.of(
        &[0.6, 0.25, 0.1],
        &[0.6, 0.4, 0.25, 0.15],
        &[0.9, 0.6, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1, 0.05],
    );
    let coarser = bench.effort.of(3, 2, 1);
    bench.progress.say("making the head phantom");
    let (bits, grid) = mask(coarser)?;
    let stage = Stage { bench, bits, grid, openings };
    let mut out = vec![stage.force()?];
    // The skeleton of a small mask is a point or two: it says nothing.
    if bench.effort != super::Effort::Quick {
        out.push(stage.skeletons()?);
    }
    Ok(out)
}
