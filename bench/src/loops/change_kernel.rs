//! Times and errors of the change between two dates, as CSV on stdout:
//!
//! `cargo run --release -p glioscope-core --example bench_change -- CASE_A CASE_B [large]`
//!
//! CASE_A and CASE_B are `FILE:LABELS` of two masks on one grid, which stand in for two dates; `large`
//! adds a 512³ image with a mask of 3.6 million voxels. Each time is the median of several runs.

use std::{error::Error, io::Write, time::Instant};

use glam::DVec3;
use glioscope_core::{
    Grid, MaskBits, Progress,
    case::{self, CaseSpec, LoadOptions},
    change::{ChangeOptions, change},
    distance::{Crop, FeatureTransform, KdTree},
    skeleton::{PointKind, SkeletonOptions, force_field, skeleton},
    surface::surface_voxels,
};

type Fallible<T> = Result<T, Box<dyn Error + Send + Sync>>;

/// Median seconds of `runs` runs, and the last result.
fn timed<T, E: Error + Send + Sync + 'static>(
    runs: usize,
    mut job: impl FnMut() -> Result<T, E>,
) -> Fallible<(f64, T)> {
    let mut times = Vec::new();
    let mut last = None;
    for _ in 0..runs {
        let start = Instant::now();
        last = Some(job()?);
        times.push(start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    Ok((times[times.len() / 2], last.ok_or("no run")?))
}

/// Value at the part `p` of a sorted list.
fn at(sorted: &[f64], p: f64) -> f64 {
    sorted.get((p * sorted.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(f64::NAN)
}

fn say(line: &str) -> Fallible<()> {
    Ok(writeln!(std::io::stdout(), "{line}")?)
}

fn pipeline(name: &str, runs: usize, before: &MaskBits, after: &MaskBits, grid: &Grid) -> Fallible<()> {
    let options = ChangeOptions::default();
    let (seconds, found) = timed(runs, || change(before, after, grid, &options, &Progress::new()))?;
    let mut both = MaskBits::from_fn(before.dims(), |_| false);
    before.for_each(|l| {
        let [nx, ny, _] = before.dims();
        let v = [l % nx, l / nx % ny, l / (nx * ny)];
        if after.get(v) {
            both.set(v);
        }
    });
    let (skeleton_s, made) = timed(runs, || skeleton(&both, grid, &options.skeleton, &Progress::new()))?;
    let (field_s, _) = timed(runs, || force_field(&both, grid, &options.skeleton, &Progress::new()))?;
    say(&format!(
        "pipeline,{name},{},{},{},{},{seconds:.3},{skeleton_s:.3},{field_s:.3},\"{:?}\",\"{:?}\"",
        before.count(),
        after.count(),
        found.vectors.len(),
        found.skeleton_voxels,
        found.counts,
        made.counts
    ))
}

fn knob(name: &str, mask: &MaskBits, grid: &Grid) -> Fallible<()> {
    say(
        "knob,mask,opening,coarse,field_s,skeleton_s,direction_p50_deg,direction_p95_deg,direction_max_deg,\
         critical_p95_deg,skeleton_mean_mm,skeleton_p95_mm",
    )?;
    let exact = SkeletonOptions { opening: 0.0, ..SkeletonOptions::default() };
    let reference = force_field(mask, grid, &exact, &Progress::new())?;
    let true_skeleton = skeleton(mask, grid, &exact, &Progress::new())?;
    let places: Vec<DVec3> = true_skeleton.points.iter().map(|p| p.position_mm).collect();
    let tree = KdTree::new(&places)?.ok_or("an empty mask")?;
    // Where forces cancel, an error turns them most.
    let zeros: Vec<DVec3> = (true_skeleton.points.iter())
        .filter(|p| matches!(p.kind, PointKind::Attracting | PointKind::Saddle))
        .map(|p| p.position_mm)
        .collect();
    let zeros = KdTree::new(&zeros)?.ok_or("no critical point")?;
    let near_zero = |voxel: DVec3| {
        let found = zeros.nearest(grid.world_from_voxel().transform_point3(voxel));
        found.is_some_and(|(_, d)| d <= 2.0 * grid.spacing_mm().max_element())
    };
    for (opening, coarse) in [
        (0.0, 1),
        (0.1, 1),
        (0.15, 1),
        (0.2, 1),
        (0.25, 1),
        (0.3, 1),
        (0.4, 1),
        (0.6, 1),
        (0.25, 2),
        (0.25, 3),
    ] {
        let options = SkeletonOptions { opening, coarse, ..exact };
        let runs = if opening == 0.0 { 1 } else { 5 };
        let (field_s, field) = timed(runs, || force_field(mask, grid, &options, &Progress::new()))?;
        let (skeleton_s, made) = timed(runs, || skeleton(mask, grid, &options, &Progress::new()))?;
        let (mut angles, mut critical_angles) = (Vec::new(), Vec::new());
        if coarse == 1 {
            for ((f, g), voxel) in reference.forces.iter().zip(&field.forces).zip(&reference.voxels) {
                let angle = f.angle_between(*g).to_degrees();
                angles.push(angle);
                if near_zero(*voxel) {
                    critical_angles.push(angle);
                }
            }
        }
        angles.sort_by(f64::total_cmp);
        critical_angles.sort_by(f64::total_cmp);
        let mut away: Vec<f64> =
            made.points.iter().filter_map(|p| tree.nearest(p.position_mm)).map(|(_, d)| d).collect();
        away.sort_by(f64::total_cmp);
        let mean = away.iter().sum::<f64>() / away.len().max(1) as f64;
        say(&format!(
            "knob,{name},{opening},{coarse},{field_s:.4},{skeleton_s:.4},{:.3},{:.3},{:.2},{:.2},{mean:.3},{:.3}",
            at(&angles, 0.5),
            at(&angles, 0.95),
            at(&angles, 1.0),
            at(&critical_angles, 0.95),
            at(&away, 0.95)
        ))?;
    }
    Ok(())
}

/// Median and least milliseconds of the sites alone, and of sites and all distances.
fn distances(name: &str, runs: usize, mask: &MaskBits, grid: &Grid, crop: Crop) -> Fallible<()> {
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        let mut line = format!("distance,{name},{},{threads}", crop.dims.map(|n| n.to_string()).join("x"));
        for with_distances in [false, true] {
            let mut times = Vec::new();
            for _ in 0..runs {
                times.push(pool.install(|| -> Fallible<f64> {
                    let start = Instant::now();
                    let found = FeatureTransform::of(mask, grid, crop)?.ok_or("an empty mask")?;
                    if with_distances {
                        std::hint::black_box(found.distances_mm());
                    }
                    Ok(start.elapsed().as_secs_f64() * 1e3)
                })?);
            }
            times.sort_by(f64::total_cmp);
            line += &format!(",{:.3},{:.3}", at(&times, 0.5), at(&times, 0.0));
        }
        say(&line)?;
    }
    Ok(())
}

/// Sum of the distances from one surface to the other, by a k-d tree.
fn between_surfaces(name: &str, before: &MaskBits, after: &MaskBits, grid: &Grid) -> Fallible<()> {
    let tree = || {
        let place = |v: &[usize; 3]| grid.center_of_voxel_mm(*v);
        let from: Vec<DVec3> = surface_voxels(before).iter().map(place).collect();
        let tree = KdTree::new(&from)?;
        let sum: f64 = surface_voxels(after)
            .iter()
            .filter_map(|v| tree.as_ref().and_then(|t| t.nearest(place(v))))
            .map(|(_, d)| d)
            .sum();
        Ok::<f64, glioscope_core::distance::DistanceError>(sum)
    };
    let (seconds, _) = timed(11, tree)?;
    say(&format!("surfaces_tree,{name},{seconds:.5}"))
}

/// A lobed body of about 3.6 million voxels in 512³.
fn large(shift: f64) -> Fallible<(MaskBits, Grid)> {
    let dims = [512; 3];
    let grid = Grid::axis_aligned(dims, DVec3::splat(0.5), DVec3::ZERO)?;
    let bits = MaskBits::from_fn(dims, |l| {
        let p = DVec3::new((l % 512) as f64, (l / 512 % 512) as f64, (l / 262_144) as f64) - 256.0;
        let ripple = 1.0 + 0.12 * ((p.x / 17.0).sin() * (p.y / 13.0).sin() * (p.z / 19.0).cos());
        let body = |c: DVec3, r: DVec3| ((p - c) / r).length() <= ripple;
        body(DVec3::ZERO, DVec3::new(105.0 + shift, 85.0, 80.0))
            || body(DVec3::new(70.0, 60.0, 10.0), DVec3::splat(58.0))
            || body(DVec3::new(-60.0, 10.0, -75.0), DVec3::new(35.0, 30.0, 60.0 + shift))
    });
    Ok((bits, grid))
}

fn main() -> Fallible<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [a, b, rest @ ..] = arguments.as_slice() else {
        return Err("usage: bench_change FILE:LABELS FILE:LABELS [large]".into());
    };
    let spec = CaseSpec::from_arguments(&[format!("m={a}@1"), format!("m={b}@2")], &[])?;
    let case = case::load(&spec, &LoadOptions::default(), &Progress::new())?;
    let masks: Vec<&MaskBits> =
        case.time_points.iter().flat_map(|t| &t.masks).map(|m| m.mask.bits()).collect();
    let [before, after] = masks.as_slice() else { return Err("two masks are needed".into()) };
    say(
        "pipeline,mask,voxels_a,voxels_b,vectors,skeleton_voxels,change_s,skeleton_s,field_s,counts,skeleton",
    )?;
    pipeline("files", 7, before, after, &case.grid)?;
    between_surfaces("files", before, after, &case.grid)?;
    say("distance,mask,crop,threads,sites_ms,sites_least_ms,with_distances_ms,with_distances_least_ms")?;
    let crop = Crop::around(&[before, after], 1).ok_or("empty masks")?;
    distances("files", 101, before, &case.grid, crop)?;
    distances("whole", 15, before, &case.grid, Crop::whole(&case.grid))?;
    let odd = Grid::axis_aligned(case.grid.dims(), DVec3::new(1.0, 1.0, 1.2), DVec3::ZERO)?;
    distances("odd", 101, before, &odd, crop)?;
    let ball = MaskBits::from_fn([256; 3], |l| {
        let p = [l % 256, l / 256 % 256, l / 65_536];
        (0..3).map(|a| (p[a] as i64 - [140, 100, 120][a]).pow(2)).sum::<i64>() < 2500
    });
    let grid = Grid::axis_aligned([256; 3], DVec3::ONE, DVec3::ZERO)?;
    distances("ball", 9, &ball, &grid, Crop::whole(&grid))?;
    if rest.iter().any(|r| r == "large") {
        let ((one, grid), (two, _)) = (large(0.0)?, large(9.0)?);
        pipeline("512", 1, &one, &two, &grid)?;
    }
    if !rest.iter().any(|r| r == "short") {
        knob("files", before, &case.grid)?;
    }
    Ok(())
}
