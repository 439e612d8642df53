//! Times and errors of the kernels of the change between two dates, as CSV: bench/peer_change.py reads it.

use clap::Args;
use glam::DVec3;
use glioscope_core::{
    Grid, MaskBits, Progress,
    case::{self, CaseSpec, LoadOptions},
    change::{ChangeOptions, change},
    distance::{Crop, FeatureTransform, KdTree},
    grid::ijk,
    skeleton::{PointKind, SkeletonOptions, force_field, skeleton},
    surface::surface_voxels,
};

use crate::{
    Outcome,
    accuracy::angle_deg,
    clock::{at_part, least, median, repeated},
    say,
};

/// What `change` can be told.
#[derive(Debug, Args)]
pub struct ChangeArguments {
    /// The mask before
    #[arg(value_name = "FILE:LABELS")]
    before: String,
    /// The mask after, on the same grid; two algorithms' masks can stand in for two dates
    #[arg(value_name = "FILE:LABELS")]
    after: String,
    /// Also a 512³ image with a mask of 3.6 million voxels
    #[arg(long)]
    large: bool,
    /// Leave out the curve of the opening bound
    #[arg(long)]
    short: bool,
    /// Runs of a distance transform; slower kernels run a part of that
    #[arg(long, default_value_t = 101)]
    runs: usize,
    /// Voxels along each side of the synthetic ball
    #[arg(long, default_value_t = 256)]
    ball: usize,
}

fn pipeline(name: &str, runs: usize, before: &MaskBits, after: &MaskBits, grid: &Grid) -> Outcome<()> {
    let options = ChangeOptions::default();
    let (change_ms, found) = repeated(runs, || change(before, after, grid, &options, &Progress::new()))?;
    let dims = before.dims();
    let both = MaskBits::from_fn(dims, |l| before.get(ijk(dims, l)) && after.get(ijk(dims, l)));
    let (skeleton_ms, made) = repeated(runs, || skeleton(&both, grid, &options.skeleton, &Progress::new()))?;
    let (field_ms, _) = repeated(runs, || force_field(&both, grid, &options.skeleton, &Progress::new()))?;
    say(format!(
        "pipeline,{name},{},{},{},{},{:.3},{:.3},{:.3},\"{:?}\",\"{:?}\"",
        before.count(),
        after.count(),
        found.vectors.len(),
        found.skeleton_voxels,
        median(&change_ms) / 1e3,
        median(&skeleton_ms) / 1e3,
        median(&field_ms) / 1e3,
        found.counts,
        made.counts
    ))
}

/// Angles of the forces, and distances of the skeleton, by opening bound and coarseness: against the exact sum.
fn knob(name: &str, mask: &MaskBits, grid: &Grid) -> Outcome<()> {
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
    let is_zero = |kind| matches!(kind, PointKind::Attracting | PointKind::Saddle);
    let zeros = true_skeleton.points.iter().filter(|p| is_zero(p.kind));
    let zeros = KdTree::new(&zeros.map(|p| p.position_mm).collect::<Vec<_>>())?.ok_or("no critical point")?;
    let near_zero = |voxel: DVec3| {
        let found = zeros.nearest(grid.world_from_voxel().transform_point3(voxel));
        found.is_some_and(|(_, d)| d <= 2.0 * grid.spacing_mm().max_element())
    };
    let openings = [0.0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6].map(|opening| (opening, 1));
    for (opening, coarse) in openings.into_iter().chain([(0.25, 2), (0.25, 3)]) {
        let options = SkeletonOptions { opening, coarse, ..exact };
        let runs = if opening == 0.0 { 1 } else { 5 };
        let (field_ms, field) = repeated(runs, || force_field(mask, grid, &options, &Progress::new()))?;
        let (skeleton_ms, made) = repeated(runs, || skeleton(mask, grid, &options, &Progress::new()))?;
        let (mut angles, mut critical_angles) = (Vec::new(), Vec::new());
        if coarse == 1 {
            for ((f, g), voxel) in reference.forces.iter().zip(&field.forces).zip(&reference.voxels) {
                angles.push(angle_deg(*f, *g));
                if near_zero(*voxel) {
                    critical_angles.push(angle_deg(*f, *g));
                }
            }
        }
        angles.sort_by(f64::total_cmp);
        critical_angles.sort_by(f64::total_cmp);
        let mut away: Vec<f64> =
            made.points.iter().filter_map(|p| tree.nearest(p.position_mm)).map(|(_, d)| d).collect();
        away.sort_by(f64::total_cmp);
        let mean = away.iter().sum::<f64>() / away.len().max(1) as f64;
        say(format!(
            "knob,{name},{opening},{coarse},{:.4},{:.4},{:.3},{:.3},{:.2},{:.2},{mean:.3},{:.3}",
            median(&field_ms) / 1e3,
            median(&skeleton_ms) / 1e3,
            at_part(&angles, 0.5),
            at_part(&angles, 0.95),
            at_part(&angles, 1.0),
            at_part(&critical_angles, 0.95),
            at_part(&away, 0.95)
        ))?;
    }
    Ok(())
}

/// Median and least milliseconds of the sites alone, and of sites and all distances.
fn distances(name: &str, runs: usize, mask: &MaskBits, grid: &Grid, crop: Crop) -> Outcome<()> {
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        let mut line = format!("distance,{name},{},{threads}", crop.dims.map(|n| n.to_string()).join("x"));
        for with_distances in [false, true] {
            let transform = || -> Outcome<()> {
                let found = FeatureTransform::of(mask, grid, crop)?.ok_or("an empty mask")?;
                if with_distances {
                    std::hint::black_box(found.distances_mm());
                }
                Ok(())
            };
            let (times, ()) = pool.install(|| repeated(runs, transform))?;
            line += &format!(",{:.3},{:.3}", median(&times), least(&times));
        }
        say(line)?;
    }
    Ok(())
}

/// Sum of the distances from one surface to the other, by a k-d tree.
fn between_surfaces(runs: usize, before: &MaskBits, after: &MaskBits, grid: &Grid) -> Outcome<()> {
    let tree = || -> Outcome<f64> {
        let place = |v: &[usize; 3]| grid.center_of_voxel_mm(*v);
        let from: Vec<DVec3> = surface_voxels(before).iter().map(place).collect();
        let tree = KdTree::new(&from)?.ok_or("an empty mask")?;
        Ok(surface_voxels(after).iter().filter_map(|v| tree.nearest(place(v))).map(|(_, d)| d).sum())
    };
    let (times, _) = repeated(runs, tree)?;
    say(format!("surfaces_tree,files,{:.5}", median(&times) / 1e3))
}

/// A lobed body of about 3.6 million voxels in 512³.
fn large(shift: f64) -> Outcome<(MaskBits, Grid)> {
    let dims = [512; 3];
    let grid = Grid::axis_aligned(dims, DVec3::splat(0.5), DVec3::ZERO)?;
    let bits = MaskBits::from_fn(dims, |l| {
        let p = DVec3::from_array(ijk(dims, l).map(|v| v as f64)) - 256.0;
        let ripple = 1.0 + 0.12 * ((p.x / 17.0).sin() * (p.y / 13.0).sin() * (p.z / 19.0).cos());
        let body = |c: DVec3, r: DVec3| ((p - c) / r).length() <= ripple;
        body(DVec3::ZERO, DVec3::new(105.0 + shift, 85.0, 80.0))
            || body(DVec3::new(70.0, 60.0, 10.0), DVec3::splat(58.0))
            || body(DVec3::new(-60.0, 10.0, -75.0), DVec3::new(35.0, 30.0, 60.0 + shift))
    });
    Ok((bits, grid))
}

/// Prints the table.
///
/// # Errors
/// Where the masks can't be read or are empty.
pub fn run(arguments: &ChangeArguments) -> Outcome<()> {
    let masks = [format!("m={}@1", arguments.before), format!("m={}@2", arguments.after)];
    let case =
        case::load(&CaseSpec::from_arguments(&masks, &[])?, &LoadOptions::default(), &Progress::new())?;
    let masks: Vec<&MaskBits> =
        case.time_points.iter().flat_map(|t| &t.masks).map(|m| m.mask.bits()).collect();
    let [before, after] = masks.as_slice() else { return Err("two masks are needed".into()) };
    let part = |of: usize| (arguments.runs / of).max(1);
    say(
        "pipeline,mask,voxels_a,voxels_b,vectors,skeleton_voxels,change_s,skeleton_s,field_s,counts,skeleton",
    )?;
    pipeline("files", part(14), before, after, &case.grid)?;
    between_surfaces(part(9), before, after, &case.grid)?;
    say("distance,mask,crop,threads,sites_ms,sites_least_ms,with_distances_ms,with_distances_least_ms")?;
    let crop = Crop::around(&[before, after], 1).ok_or("empty masks")?;
    distances("files", arguments.runs, before, &case.grid, crop)?;
    distances("whole", part(7), before, &case.grid, Crop::whole(&case.grid))?;
    // Squares of this spacing are no whole numbers.
    let odd = Grid::axis_aligned(case.grid.dims(), DVec3::new(1.0, 1.0, 1.2), DVec3::ZERO)?;
    distances("odd", arguments.runs, before, &odd, crop)?;
    let grid = Grid::axis_aligned([arguments.ball; 3], DVec3::ONE, DVec3::ZERO)?;
    // 140, 100, 120 and 50 of 256 voxels, in whole ones: the peers draw the same.
    let part_of = |share: usize| (share * arguments.ball / 256) as f64;
    let center = DVec3::new(part_of(140), part_of(100), part_of(120));
    let ball = MaskBits::from_fn(grid.dims(), |l| {
        grid.center_of_voxel_mm(grid.ijk(l)).distance_squared(center) < part_of(50).powi(2)
    });
    distances("ball", part(11), &ball, &grid, Crop::whole(&grid))?;
    if arguments.large {
        let ((one, grid), (two, _)) = (large(0.0)?, large(9.0)?);
        pipeline("512", 1, &one, &two, &grid)?;
    }
    if !arguments.short {
        knob("files", before, &case.grid)?;
    }
    Ok(())
}
