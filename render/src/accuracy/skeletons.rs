//! Opening bound of the skeleton's force, against the exact sum.

use std::time::Duration;

use glioscope_core::{
    Grid, MaskBits,
    distance::KdTree,
    skeleton::{Skeleton, SkeletonOptions, skeleton},
};

use super::{
    AccuracyError, Axis, Bench, Curve, Family, Point,
    measure::{Errors, Repeats, timed},
    scenes,
};

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

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    let openings: &[f64] = bench.effort.of(
        &[0.6, 0.1],
        &[0.6, 0.4, 0.25, 0.15],
        &[0.9, 0.6, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1, 0.05],
    );
    let coarser = bench.effort.of(3, 2, 1);
    bench.progress.say("making the head phantom");
    let (bits, grid) = mask(coarser)?;
    // A bar of its own inside each: only the asking to stop is passed on.
    let run = |opening| -> Result<Skeleton, AccuracyError> {
        bench.progress.check()?;
        let options = SkeletonOptions { opening, ..SkeletonOptions::default() };
        skeleton(&bits, &grid, &options, &glioscope_core::Progress::new()).map_err(|e| AccuracyError::of(&e))
    };
    bench.begin("skeleton: truth", "exact sum")?;
    let truth = run(0.0)?;
    let repeats = Repeats { most: bench.effort.of(1, 3, 7), patience: Duration::from_millis(5000) };
    let mut points = Vec::new();
    for &opening in openings {
        bench.begin("skeleton: opening", &opening.to_string())?;
        let mut found = Skeleton::default();
        let measured = timed(repeats, || {
            found = run(opening)?;
            Ok::<_, AccuracyError>(())
        })?;
        let errors = apart(&found, &truth)?;
        points.push(Point {
            setting: format!("θ = {opening}"),
            value: opening,
            time: measured.time,
            cpu: measured.cpu,
            peak_bytes: measured.peak_bytes,
            error_rms: errors.rms(),
            error_max: errors.max(),
            delta_e: None,
            is_default: opening == SkeletonOptions::default().opening,
            is_pareto: false,
        });
    }
    Ok(vec![Curve {
        family: Family::Skeleton,
        kernel: "skeleton, core level".to_owned(),
        scene: format!("head phantom's first mask, {} voxels", bits.count()),
        knob: "SkeletonOptions::opening",
        truth: format!(
            "the skeleton of the exact sum (θ = 0), {} points; distance to the nearest point, both ways",
            truth.points.len()
        ),
        truth_error: None,
        unit: "mm",
        axis: Axis::Time,
        points,
    }])
}
