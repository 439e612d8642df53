//! Times of connected components and enclosing ellipsoids: Markdown and CSV for docs/ellipsoids.md, and a server for
//! bench/peer_components.py.

use std::{
    io::BufRead,
    path::{Path, PathBuf},
    time::Instant,
};

use clap::{Args, Subcommand};
use glam::DVec3;
use glioscope_core::{
    Components, Connectivity, Grid, IndexData, Mask, MaskBits, Progress, TumorIndex,
    ellipsoid::{Method, Options, ellipsoids_of, enclose, hull_corners},
    files::write_whole,
};
use rayon::ThreadPool;

use super::open_case;
use crate::{
    Outcome,
    clock::{median, minimum, timed},
    print_line,
};

/// Arguments of `ellipsoids`.
#[derive(Debug, Args)]
pub struct EllipsoidsArguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Components and ellipsoids of the glioma case and a synthetic one, as a Markdown table
    Table {
        /// Folder with glioma-5-algorithms
        #[arg(default_value = "../shared/data")]
        data: PathBuf,
        #[arg(long, default_value_t = 15)]
        runs: usize,
    },
    /// Volume error against time, by method and tolerance, as CSV
    Curve {
        /// Folder with glioma-5-algorithms
        #[arg(default_value = "../shared/data")]
        data: PathBuf,
        #[arg(long, default_value_t = 15)]
        runs: usize,
    },
    /// Serves requests on stdin, one per line, so that another program can alternate with it. `components THREADS`,
    /// `labels THREADS` and `ellipsoids THREADS` return seconds, CPU seconds and a count; `write INDEX LABELS` writes
    /// the index (u8) and its labels (u32), x fastest
    Serve {
        #[arg(value_parser = ["glioma", "synthetic", "tiny"])]
        index: String,
        /// Folder with glioma-5-algorithms
        #[arg(default_value = "../shared/data")]
        data: PathBuf,
    },
}

/// Runs the task.
///
/// # Errors
/// When the case can't be read, or the server receives an unknown request.
pub fn run(arguments: &EllipsoidsArguments) -> Outcome<()> {
    match &arguments.task {
        Task::Table { data, runs } => table(data, *runs),
        Task::Curve { data, runs } => curve(data, *runs),
        Task::Serve { index, data } => serve(&index_of(index, data)?),
    }
}

fn index_of(name: &str, data: &Path) -> Outcome<TumorIndex> {
    match name {
        "glioma" => glioma(data),
        "tiny" => synthetic(64),
        _ => synthetic(512),
    }
}

/// Three algorithms' whole tumours of one glioma, 240 x 240 x 155.
fn glioma(data: &Path) -> Outcome<TumorIndex> {
    let masks: Vec<String> = ["hnfnetv1-20", "isen-20", "scan-20"]
        .iter()
        .map(|name| format!("{name}=glioma-5-algorithms/{name}.nii.gz:1,2,4"))
        .collect();
    let case = open_case(data, &masks.iter().map(String::as_str).collect::<Vec<_>>(), &[])?;
    Ok(TumorIndex::clone(&case.time_points.first().ok_or("no date")?.index))
}

/// Amplitude of the noise that roughens the border of the synthetic masks, in squared normalised radii.
const ROUGHNESS: f64 = 0.012;
/// Balls outside each mask's main body; with them and the rough border the index of 512³ has about 1,700 components.
const SATELLITES: usize = 168;

/// Three overlapping lobed tumours with rough borders, and small satellites, in `n`³ voxels.
fn synthetic(n: usize) -> Outcome<TumorIndex> {
    let grid = Grid::axis_aligned([n; 3], DVec3::ONE, DVec3::ZERO)?;
    // Shapes are defined on 512 voxels per side.
    let scale = 512.0 / n as f64;
    let noise = |p: DVec3, k: f64| {
        let wave = |a: f64, b: f64, c: f64, s: f64| {
            (p.x * a + s).sin() * (p.y * b + 2.0 * s).sin() * (p.z * c + 3.0 * s).sin()
        };
        wave(0.11, 0.09, 0.13, k) + wave(0.05, 0.07, 0.06, k + 1.0) + 0.7 * wave(0.23, 0.19, 0.21, k + 2.0)
    };
    // A hash of the voxel index, 0 to 1, which roughens the border.
    let hash = |linear: usize, k: u64| {
        let mut v = (linear as u64 ^ k << 40).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        v = (v ^ v >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (v >> 40) as f64 / (1_u64 << 24) as f64
    };
    let mut masks = Vec::new();
    for k in 0..3_u64 {
        let shift = k as f64;
        let center = DVec3::new(256.0 + 7.0 * shift, 250.0 - 5.0 * shift, 260.0 + 3.0 * shift);
        let radii = DVec3::new(100.0, 92.0, 84.0 + 3.0 * shift);
        let satellites: Vec<(DVec3, f64)> = (0..SATELLITES)
            .map(|i| {
                let part = |axis: usize| 60.0 + 392.0 * hash(3 * i + axis, 7);
                (DVec3::new(part(0), part(1), part(2)), 2.0 + 4.0 * hash(i, 8 + k))
            })
            .collect();
        let mut bits = MaskBits::from_fn([n; 3], |linear| {
            let p = grid.center_of_voxel_mm(grid.ijk(linear)) * scale;
            let q = ((p - center) / radii).length_squared();
            q + 0.2 * noise(p, 0.2 * shift) + ROUGHNESS * hash(linear, k) <= 1.0
        });
        // Satellites are drawn within their bounding boxes, which is faster than testing each at every voxel.
        for (c, r) in satellites {
            let box_range = |axis: usize| {
                ((c[axis] - r) / scale).ceil() as usize..=((c[axis] + r) / scale).floor() as usize
            };
            for z in box_range(2) {
                for (y, x) in box_range(1).flat_map(|y| box_range(0).map(move |x| (y, x))) {
                    let p = DVec3::new(x as f64, y as f64, z as f64) * scale;
                    let is_outside_body = ((p - center) / radii).length_squared() > 1.7;
                    if is_outside_body && p.distance_squared(c) <= r * r {
                        bits.set([x, y, z]);
                    }
                }
            }
        }
        masks.push(Mask::new(format!("m{k}"), grid.clone(), bits).ok_or("sizes differ")?);
    }
    Ok(TumorIndex::new(grid, &masks.iter().collect::<Vec<_>>())?)
}

fn pool(threads: usize) -> Outcome<ThreadPool> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?)
}

/// A timed job on an index; returns the number of components, labels or ellipsoids.
type Job = fn(&TumorIndex) -> usize;

fn components(index: &TumorIndex) -> usize {
    Components::of_index(index, Connectivity::default()).map_or(0, |c| c.list().len())
}

fn labels(index: &TumorIndex) -> usize {
    Components::of_index(index, Connectivity::default()).map_or(0, |c| {
        std::hint::black_box(c.labels(index.grid().dims()));
        c.list().len()
    })
}

fn ellipsoids(index: &TumorIndex) -> usize {
    ellipsoids_of(index, Connectivity::default(), &Options::default(), &Progress::new())
        .map_or(0, |e| e.len())
}

fn serve(index: &TumorIndex) -> Outcome<()> {
    let pools = [pool(1)?, pool(2)?];
    let [nx, ny, nz] = index.grid().dims();
    print_line(format!("{nx} {ny} {nz}"))?;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let (job, threads): (Job, &str) = match words[..] {
            ["components", threads] => (components, threads),
            ["labels", threads] => (labels, threads),
            ["ellipsoids", threads] => (ellipsoids, threads),
            ["write", to, labels_to] => {
                let IndexData::U8(values) = index.data() else {
                    return Err("found more than 8 masks, expected at most 8".into());
                };
                write_whole(Path::new(to), values)?;
                let found = Components::of_index(index, Connectivity::default())?.labels(index.grid().dims());
                let bytes: Vec<u8> = found.iter().flat_map(|l| l.to_le_bytes()).collect();
                write_whole(Path::new(labels_to), &bytes)?;
                print_line("written")?;
                continue;
            }
            _ => return Err(format!("found {line}, expected components, labels, ellipsoids or write").into()),
        };
        let pool = &pools[usize::from(threads != "1")];
        let (wall_ms, cpu_ms, count) = timed(|| pool.install(|| job(index)));
        print_line(format!("{} {} {count}", wall_ms / 1e3, cpu_ms.unwrap_or(0.0) / 1e3))?;
    }
    Ok(())
}

fn table(data: &Path, runs: usize) -> Outcome<()> {
    let pools = [pool(1)?, pool(2)?];
    print_line(
        "| case | computation | count | threads | median wall (ms) | fastest to slowest (ms) | median CPU (ms) |",
    )?;
    print_line("|---|---|---:|---:|---:|---:|---:|")?;
    for name in ["glioma", "synthetic"] {
        let index = index_of(name, data)?;
        let jobs: [(&str, Job); 3] = [
            ("components of the index", components),
            ("the same, with a label volume", labels),
            ("all ellipsoids", ellipsoids),
        ];
        // Interleaved, so that other load on the machine affects all equally.
        let mut samples = vec![(Vec::new(), Vec::new(), 0); jobs.len() * pools.len()];
        for round in 0..=runs {
            for (j, (_, job)) in jobs.iter().enumerate() {
                for (t, pool) in pools.iter().enumerate() {
                    let (wall, cpu, count) = timed(|| pool.install(|| job(&index)));
                    // The first round warms up.
                    if round > 0 {
                        let sample = &mut samples[j * pools.len() + t];
                        sample.0.push(wall);
                        sample.1.push(cpu.unwrap_or(f64::NAN));
                        sample.2 = count;
                    }
                }
            }
        }
        for (i, (wall, cpu, count)) in samples.iter().enumerate() {
            let slowest = wall.iter().copied().fold(f64::NAN, f64::max);
            print_line(format!(
                "| {name} | {} | {count} | {} | {:.1} | {:.1} to {slowest:.1} | {:.1} |",
                jobs[i / pools.len()].0,
                i % pools.len() + 1,
                median(wall),
                minimum(wall),
                median(cpu)
            ))?;
        }
    }
    Ok(())
}

/// Prints volume error against time, for the largest component of each case and for a ball.
fn curve(data: &Path, runs: usize) -> Outcome<()> {
    print_line("shape,points,method,tolerance,median_ms,iterations,relative_error,bound_minus_1")?;
    for name in ["glioma", "synthetic"] {
        let index = index_of(name, data)?;
        let found = Components::of_index_mask(&index, 0, Connectivity::default())?;
        let component = found.list().iter().max_by_key(|c| c.voxels).ok_or("no component")?;
        shape_curve(name, &hull_corners(found.runs(component), component.start), runs)?;
    }
    let grid = Grid::axis_aligned([64; 3], DVec3::ONE, DVec3::ZERO)?;
    let bits = MaskBits::from_fn(grid.dims(), |l| {
        grid.center_of_voxel_mm(grid.ijk(l)).distance(DVec3::splat(31.5)) <= 30.0
    });
    let found = Components::of_mask(&bits, Connectivity::default())?;
    let ball = found.list().first().ok_or("no component")?;
    shape_curve("ball of radius 30", &hull_corners(found.runs(ball), ball.start), runs)
}

fn shape_curve(name: &str, points: &[DVec3], runs: usize) -> Outcome<()> {
    let reference =
        enclose(points, &Options { tolerance: 1e-12, ..Options::default() }).ok_or("coplanar points")?;
    for method in [Method::Exchange, Method::AwaySteps, Method::Khachiyan] {
        for exponent in 1..=9 {
            let tolerance = 10_f64.powi(-exponent);
            let options = Options { method, tolerance, ..Options::default() };
            let mut samples = Vec::new();
            let mut result = reference;
            let begin = Instant::now();
            // A long run needs no repetition.
            while samples.len() < runs.max(1) && begin.elapsed().as_secs() < 2 {
                let (ms, _, found) = timed(|| enclose(points, &options));
                result = found.ok_or("coplanar points")?;
                samples.push(ms);
            }
            print_line(format!(
                "{name},{},{},{tolerance:e},{:.4},{},{:.2e},{:.2e}",
                points.len(),
                method.name(),
                median(&samples),
                result.iterations,
                result.volume() / reference.volume() - 1.0,
                result.volume_bound - 1.0
            ))?;
        }
    }
    Ok(())
}
