//! Times and errors of the kernels that compute the change between two dates, as CSV, which bench/peer_change.py partly
//! reads.

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
    clock::{median, minimum, quantile, repeated},
    print_line,
};

/// Arguments of `change`.
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
    /// Omit the sweep of the opening bound
    #[arg(long)]
    short: bool,
    /// Runs of each distance transform; slower kernels are run a fraction of this number of times
    #[arg(long, default_value_t = 101)]
    runs: usize,
    /// Voxels along each side of the synthetic ball
    #[arg(long, default_value_t = 256)]
    ball: usize,
}

fn time_pipeline(name: &str, runs: usize, before: &MaskBits, after: &MaskBits, grid: &Grid) -> Outcome<()> {
    let options = ChangeOptions::default();
    let (change_ms, found) = repeated(runs, || change(before, after, grid, &options, &Progress::new()))?;
    let dims = before.dims();
    let both = MaskBits::from_fn(dims, |l| before.get(ijk(dims, l)) && after.get(ijk(dims, l)));
    let (skeleton_ms, skeleton) =
        repeated(runs, || skeleton(&both, grid, &options.skeleton, &Progress::new()))?;
    let (field_ms, _) = repeated(runs, || force_field(&both, grid, &options.skeleton, &Progress::new()))?;
    print_line(format!(
        "pipeline,{name},{},{},{},{},{:.3},{:.3},{:.3},\"{:?}\",\"{:?}\"",
        before.count(),
        after.count(),
        found.vectors.len(),
        found.skeleton_voxels,
        median(&change_ms) / 1e3,
        median(&skeleton_ms) / 1e3,
        median(&field_ms) / 1e3,
        found.counts,
        skeleton.counts
    ))
}

/// Prints errors relative to the exact sum by opening bound and coarseness: angles between forces, distances between
/// skeletons.
fn sweep_opening(name: &str, mask: &MaskBits, grid: &Grid) -> Outcome<()> {
    print_line(
        "knob,mask,opening,coarse,field_s,skeleton_s,direction_p50_deg,direction_p95_deg,direction_max_deg,\
         critical_p95_deg,skeleton_mean_mm,skeleton_p95_mm",
    )?;
    let exact = SkeletonOptions { opening: 0.0, ..SkeletonOptions::default() };
    let reference = force_field(mask, grid, &exact, &Progress::new())?;
    let true_skeleton = skeleton(mask, grid, &exact, &Progress::new())?;
    let positions_mm: Vec<DVec3> = true_skeleton.points.iter().map(|p| p.position_mm).collect();
    let tree = KdTree::new(&positions_mm)?.ok_or("an empty mask")?;
    // Errors change the direction most near zeros of the force field.
    let is_zero = |kind| matches!(kind, PointKind::Attracting | PointKind::Saddle);
    let zeros = true_skeleton.points.iter().filter(|p| is_zero(p.kind));
    let zeros = KdTree::new(&zeros.map(|p| p.position_mm).collect::<Vec<_>>())?.ok_or("no critical point")?;
    let is_near_zero = |voxel: DVec3| {
        let found = zeros.nearest(grid.world_from_voxel().transform_point3(voxel));
        found.is_some_and(|(_, d)| d <= 2.0 * grid.spacing_mm().max_element())
    };
    let openings = [0.0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6].map(|opening| (opening, 1));
    for (opening, coarse) in openings.into_iter().chain([(0.25, 2), (0.25, 3)]) {
        let options = SkeletonOptions { opening, coarse, ..exact };
        let runs = if opening == 0.0 { 1 } else { 5 };
        let (field_ms, field) = repeated(runs, || force_field(mask, grid, &options, &Progress::new()))?;
        let (skeleton_ms, approximate) = repeated(runs, || skeleton(mask, grid, &options, &Progress::new()))?;
        let (mut angles, mut critical_angles) = (Vec::new(), Vec::new());
        if coarse == 1 {
            for ((f, g), voxel) in reference.forces.iter().zip(&field.forces).zip(&reference.voxels) {
                angles.push(angle_deg(*f, *g));
                if is_near_zero(*voxel) {
                    critical_angles.push(angle_deg(*f, *g));
                }
            }
        }
        angles.sort_by(f64::total_cmp);
        critical_angles.sort_by(f64::total_cmp);
        let mut distances_mm: Vec<f64> =
            approximate.points.iter().filter_map(|p| tree.nearest(p.position_mm)).map(|(_, d)| d).collect();
        distances_mm.sort_by(f64::total_cmp);
        let mean = distances_mm.iter().sum::<f64>() / distances_mm.len().max(1) as f64;
        print_line(format!(
            "knob,{name},{opening},{coarse},{:.4},{:.4},{:.3},{:.3},{:.2},{:.2},{mean:.3},{:.3}",
            median(&field_ms) / 1e3,
            median(&skeleton_ms) / 1e3,
            quantile(&angles, 0.5),
            quantile(&angles, 0.95),
            quantile(&angles, 1.0),
            quantile(&critical_angles, 0.95),
            quantile(&distances_mm, 0.95)
        ))?;
    }
    Ok(())
}

/// Prints times of the feature transform without and with all distances: median and minimum, milliseconds.
fn time_distance_transform(name: &str, runs: usize, mask: &MaskBits, grid: &Grid, crop: Crop) -> Outcome<()> {
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
            line += &format!(",{:.3},{:.3}", median(&times), minimum(&times));
        }
        print_line(line)?;
    }
    Ok(())
}

/// Prints the time of all distances from one surface to the other by a k-d tree.
fn time_surface_distances(runs: usize, before: &MaskBits, after: &MaskBits, grid: &Grid) -> Outcome<()> {
    let sum_of_distances = || -> Outcome<f64> {
        let center_mm = |v: &[usize; 3]| grid.center_of_voxel_mm(*v);
        let from: Vec<DVec3> = surface_voxels(before).iter().map(center_mm).collect();
        let tree = KdTree::new(&from)?.ok_or("an empty mask")?;
        Ok(surface_voxels(after).iter().filter_map(|v| tree.nearest(center_mm(v))).map(|(_, d)| d).sum())
    };
    let (times, _) = repeated(runs, sum_of_distances)?;
    print_line(format!("surfaces_tree,files,{:.5}", median(&times) / 1e3))
}

/// A lobed mask of about 3.6 million voxels in 512³; two of its semi-axes are longer by `shift` voxels.
fn large_mask(shift: f64) -> Outcome<(MaskBits, Grid)> {
    let dims = [512; 3];
    let grid = Grid::axis_aligned(dims, DVec3::splat(0.5), DVec3::ZERO)?;
    let bits = MaskBits::from_fn(dims, |l| {
        let p = DVec3::from_array(ijk(dims, l).map(|v| v as f64)) - 256.0;
        let ripple = 1.0 + 0.12 * ((p.x / 17.0).sin() * (p.y / 13.0).sin() * (p.z / 19.0).cos());
        let is_inside = |c: DVec3, r: DVec3| ((p - c) / r).length() <= ripple;
        is_inside(DVec3::ZERO, DVec3::new(105.0 + shift, 85.0, 80.0))
            || is_inside(DVec3::new(70.0, 60.0, 10.0), DVec3::splat(58.0))
            || is_inside(DVec3::new(-60.0, 10.0, -75.0), DVec3::new(35.0, 30.0, 60.0 + shift))
    });
    Ok((bits, grid))
}

/// Prints the CSV tables.
///
/// # Errors
/// When the masks can't be read or are empty.
pub fn run(arguments: &ChangeArguments) -> Outcome<()> {
    let masks = [format!("m={}@1", arguments.before), format!("m={}@2", arguments.after)];
    let case =
        case::load(&CaseSpec::from_arguments(&masks, &[])?, &LoadOptions::default(), &Progress::new())?;
    let masks: Vec<&MaskBits> =
        case.time_points.iter().flat_map(|t| &t.masks).map(|m| m.mask.bits()).collect();
    let [before, after] = masks.as_slice() else { return Err("two masks are needed".into()) };
    let runs_over = |divisor: usize| (arguments.runs / divisor).max(1);
    print_line(
        "pipeline,mask,voxels_a,voxels_b,vectors,skeleton_voxels,change_s,skeleton_s,field_s,counts,skeleton",
    )?;
    time_pipeline("files", runs_over(14), before, after, &case.grid)?;
    time_surface_distances(runs_over(9), before, after, &case.grid)?;
    print_line(
        "distance,mask,crop,threads,sites_ms,sites_least_ms,with_distances_ms,with_distances_least_ms",
    )?;
    let crop = Crop::around(&[before, after], 1).ok_or("empty masks")?;
    time_distance_transform("files", arguments.runs, before, &case.grid, crop)?;
    time_distance_transform("whole", runs_over(7), before, &case.grid, Crop::whole(&case.grid))?;
    // The square of 1.2 isn't exact in binary, so squared distances aren't either.
    let odd = Grid::axis_aligned(case.grid.dims(), DVec3::new(1.0, 1.0, 1.2), DVec3::ZERO)?;
    time_distance_transform("odd", arguments.runs, before, &odd, crop)?;
    let grid = Grid::axis_aligned([arguments.ball; 3], DVec3::ONE, DVec3::ZERO)?;
    // Centre (140, 100, 120) and radius 50 in 256ths of the side, rounded to voxels as in bench/peer_change.py.
    let in_voxels = |share: usize| (share * arguments.ball / 256) as f64;
    let center = DVec3::new(in_voxels(140), in_voxels(100), in_voxels(120));
    let ball = MaskBits::from_fn(grid.dims(), |l| {
        grid.center_of_voxel_mm(grid.ijk(l)).distance_squared(center) < in_voxels(50).powi(2)
    });
    time_distance_transform("ball", runs_over(11), &ball, &grid, Crop::whole(&grid))?;
    if arguments.large {
        let ((before, grid), (after, _)) = (large_mask(0.0)?, large_mask(9.0)?);
        time_pipeline("512", 1, &before, &after, &grid)?;
    }
    if !arguments.short {
        sweep_opening("files", before, &case.grid)?;
    }
    Ok(())
}
