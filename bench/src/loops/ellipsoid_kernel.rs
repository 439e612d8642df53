//! Times components and ellipsoids, and prints Markdown and CSV for docs/ellipsoids.md.
//!
//! ```text
//! cargo run --release -p glioscope-core --example bench_ellipsoids -- table [DATA] [RUNS]
//! cargo run --release -p glioscope-core --example bench_ellipsoids -- curve [DATA] [RUNS]
//! cargo run --release -p glioscope-core --example bench_ellipsoids -- serve glioma|synthetic [DATA]
//! ```
//!
//! DATA holds `glioma-5-algorithms` (default ../shared/data). `serve` answers lines on stdin, so that
//! bench/peer_components.py can take turns with it: `components THREADS`, `labels THREADS`,
//! `ellipsoids THREADS` answer with seconds, CPU seconds and a count; `write INDEX LABELS` writes the
//! index (u8) and its labels (u32), x fastest.

use std::error::Error;
use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use glioscope_core::{
    Components, Connectivity, Grid, IndexData, Mask, MaskBits, Progress, TumorIndex,
    case::{self, CaseSpec, LoadOptions},
    ellipsoid::{Method, Options, ellipsoids_of, enclose, hull_corners},
    files::write_whole,
};
use rayon::ThreadPool;

type Outcome<T> = Result<T, Box<dyn Error>>;
/// Something timed on an index; how many it found.
type Job = fn(&TumorIndex) -> usize;

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let word = |i: usize, or: &str| words.get(i).cloned().unwrap_or_else(|| or.to_owned());
    let (data, runs) = (PathBuf::from(word(1, "../shared/data")), word(2, "15"));
    match word(0, "").as_str() {
        "table" => table(&data, runs.parse()?),
        "curve" => curve(&data, runs.parse()?),
        "serve" => serve(&index_of(&word(1, "glioma"), Path::new(&word(2, "../shared/data")))?),
        _ => Err("usage: bench_ellipsoids table|curve|serve …".into()),
    }
}

fn say(line: &str) -> Outcome<()> {
    let mut out = std::io::stdout();
    writeln!(out, "{line}")?;
    Ok(out.flush()?)
}

// ---- what is timed ------------------------------------------------------------------------------

fn index_of(name: &str, data: &Path) -> Outcome<TumorIndex> {
    match name {
        "glioma" => glioma(data),
        "synthetic" => synthetic(),
        _ => Err(format!("found {name}, expected glioma or synthetic").into()),
    }
}

/// Three algorithms' whole tumours of one glioma, 240 x 240 x 155.
fn glioma(data: &Path) -> Outcome<TumorIndex> {
    let folder = data.join("glioma-5-algorithms");
    let masks: Vec<String> = ["hnfnetv1-20", "isen-20", "scan-20"]
        .iter()
        .map(|name| format!("{name}={}:1,2,4", folder.join(format!("{name}.nii.gz")).display()))
        .collect();
    let spec = CaseSpec::from_arguments(&masks, &[])?;
    let case = case::load(&spec, &LoadOptions::default(), &Progress::new())?;
    let time = case.time_points.into_iter().next().ok_or("no time point")?;
    Ok(TumorIndex::clone(&time.index))
}

/// Three overlapping lobed tumours with frayed borders, and small satellites: 512 x 512 x 512.
fn synthetic() -> Outcome<TumorIndex> {
    const N: usize = 512;
    let grid = Grid::axis_aligned([N; 3], DVec3::ONE, DVec3::ZERO)?;
    let noise = |p: DVec3, k: f64| {
        let wave = |a: f64, b: f64, c: f64, s: f64| {
            (p.x * a + s).sin() * (p.y * b + 2.0 * s).sin() * (p.z * c + 3.0 * s).sin()
        };
        wave(0.11, 0.09, 0.13, k) + wave(0.05, 0.07, 0.06, k + 1.0) + 0.7 * wave(0.23, 0.19, 0.21, k + 2.0)
    };
    // A fixed scramble of the voxel's number: frays the border.
    let fray = |linear: usize, k: u64| {
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
                let part = |axis: usize| 60.0 + 392.0 * fray(3 * i + axis, 7);
                (DVec3::new(part(0), part(1), part(2)), 2.0 + 4.0 * fray(i, 8 + k))
            })
            .collect();
        let mut bits = MaskBits::from_fn([N; 3], |linear| {
            let p = DVec3::new((linear % N) as f64, (linear / N % N) as f64, (linear / (N * N)) as f64);
            let q = ((p - center) / radii).length_squared();
            q + 0.2 * noise(p, 0.2 * shift) + FRAY * fray(linear, k) <= 1.0
        });
        // Balls apart from the main body: painted box by box, not looked for at every voxel.
        for (c, r) in satellites {
            let reach = |axis: usize| (c[axis] - r).ceil() as usize..=(c[axis] + r).floor() as usize;
            for z in reach(2) {
                for (y, x) in reach(1).flat_map(|y| reach(0).map(move |x| (y, x))) {
                    let p = DVec3::new(x as f64, y as f64, z as f64);
                    let is_apart = ((p - center) / radii).length_squared() > 1.7;
                    if is_apart && p.distance_squared(c) <= r * r {
                        bits.set([x, y, z]);
                    }
                }
            }
        }
        masks.push(Mask::new(format!("m{k}"), grid.clone(), bits).ok_or("sizes differ")?);
    }
    Ok(TumorIndex::new(grid, &masks.iter().collect::<Vec<_>>())?)
}

/// How much the border of the synthetic masks is frayed.
const FRAY: f64 = 0.012;
/// Balls beside each mask's main body: with them and the frayed border the index has about 1,700 components.
const SATELLITES: usize = 168;

// ---- clocks -------------------------------------------------------------------------------------

fn pool(threads: usize) -> Outcome<ThreadPool> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?)
}

/// CPU seconds of all living threads, from the scheduler's nanoseconds (Linux); 0 elsewhere.
fn cpu_seconds() -> f64 {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else { return 0.0 };
    let of_task = |path: PathBuf| -> Option<f64> {
        let text = std::fs::read_to_string(path.join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    };
    tasks.flatten().filter_map(|t| of_task(t.path())).sum::<f64>() / 1e9
}

/// Wall and CPU seconds of `job` on `pool`, and its answer.
fn timed<T: Send>(pool: &ThreadPool, job: impl FnOnce() -> T + Send) -> (f64, f64, T) {
    let (cpu, started) = (cpu_seconds(), Instant::now());
    let answer = pool.install(job);
    let wall = started.elapsed().as_secs_f64();
    (wall, cpu_seconds() - cpu, answer)
}

fn median(samples: &mut [f64]) -> f64 {
    samples.sort_by(f64::total_cmp);
    samples[samples.len() / 2]
}

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

// ---- the three tasks ----------------------------------------------------------------------------

fn serve(index: &TumorIndex) -> Outcome<()> {
    let pools = [pool(1)?, pool(2)?];
    let [nx, ny, nz] = index.grid().dims();
    say(&format!("{nx} {ny} {nz}"))?;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let job: Job = match words[..] {
            ["components", _] => components,
            ["labels", _] => labels,
            ["ellipsoids", _] => ellipsoids,
            ["write", to, labels_to] => {
                let IndexData::U8(values) = index.data() else { return Err("expected up to 8 masks".into()) };
                write_whole(Path::new(to), values)?;
                let found = Components::of_index(index, Connectivity::default())?.labels(index.grid().dims());
                let bytes: Vec<u8> = found.iter().flat_map(|l| l.to_le_bytes()).collect();
                write_whole(Path::new(labels_to), &bytes)?;
                say("written")?;
                continue;
            }
            _ => return Err(format!("found {line}, expected components, labels, ellipsoids or write").into()),
        };
        let pool = &pools[usize::from(words[1] != "1")];
        let (wall, cpu, count) = timed(pool, || job(index));
        say(&format!("{wall} {cpu} {count}"))?;
    }
    Ok(())
}

fn table(data: &Path, runs: usize) -> Outcome<()> {
    let pools = [pool(1)?, pool(2)?];
    say("| case | what | found | threads | median wall (ms) | fastest to slowest (ms) | median CPU (ms) |")?;
    say("|---|---|---:|---:|---:|---:|---:|")?;
    for name in ["glioma", "synthetic"] {
        let index = index_of(name, data)?;
        let jobs: [(&str, Job); 3] = [
            ("components of the index", components),
            ("the same, with a label volume", labels),
            ("all ellipsoids", ellipsoids),
        ];
        // In turns, so that other load on the machine meets all alike.
        let mut taken = vec![(Vec::new(), Vec::new(), 0); jobs.len() * pools.len()];
        for round in 0..=runs {
            for (j, (_, job)) in jobs.iter().enumerate() {
                for (t, pool) in pools.iter().enumerate() {
                    let (wall, cpu, count) = timed(pool, || job(&index));
                    // The first round warms up.
                    if round > 0 {
                        let into = &mut taken[j * pools.len() + t];
                        into.0.push(wall * 1e3);
                        into.1.push(cpu * 1e3);
                        into.2 = count;
                    }
                }
            }
        }
        for (i, (wall, cpu, count)) in taken.iter_mut().enumerate() {
            let (middle, cpu) = (median(wall), median(cpu));
            let what = jobs[i / pools.len()].0;
            let (low, high) = (wall[0], wall[wall.len() - 1]);
            say(&format!(
                "| {name} | {what} | {count} | {} | {middle:.1} | {low:.1} to {high:.1} | {cpu:.1} |",
                i % pools.len() + 1
            ))?;
        }
    }
    Ok(())
}

/// Error of the volume against time, for the largest component of several kinds.
fn curve(data: &Path, runs: usize) -> Outcome<()> {
    say("shape,points,method,tolerance,median_ms,iterations,relative_error,bound_minus_1")?;
    for name in ["glioma", "synthetic"] {
        let index = index_of(name, data)?;
        let found = Components::of_index_mask(&index, 0, Connectivity::default())?;
        let component = found.list().iter().max_by_key(|c| c.voxels).ok_or("no component")?;
        shape_curve(name, &hull_corners(found.runs(component), component.start), runs)?;
    }
    let n = 64;
    let bits = MaskBits::from_fn([n; 3], |l| {
        let p = DVec3::new((l % n) as f64, (l / n % n) as f64, (l / (n * n)) as f64);
        p.distance(DVec3::splat(31.5)) <= 30.0
    });
    let found = Components::of_mask(&bits, Connectivity::default())?;
    shape_curve("ball of radius 30", &hull_corners(found.runs(&found.list()[0]), found.list()[0].start), runs)
}

fn shape_curve(name: &str, points: &[DVec3], runs: usize) -> Outcome<()> {
    let reference = enclose(points, &Options { tolerance: 1e-12, ..Options::default() }).ok_or("flat")?;
    for method in [Method::Exchange, Method::AwaySteps, Method::Khachiyan] {
        for exponent in 1..=9 {
            let tolerance = 10_f64.powi(-exponent);
            let options = Options { method, tolerance, ..Options::default() };
            let mut taken = Vec::new();
            let mut result = reference;
            for _ in 0..runs {
                let started = Instant::now();
                result = enclose(points, &options).ok_or("flat")?;
                taken.push(started.elapsed().as_secs_f64() * 1e3);
                // One long run says enough.
                if taken[0] > 2000.0 {
                    break;
                }
            }
            say(&format!(
                "{name},{},{},{tolerance:e},{:.4},{},{:.2e},{:.2e}",
                points.len(),
                method.name(),
                median(&mut taken),
                result.iterations,
                result.volume() / reference.volume() - 1.0,
                result.volume_bound - 1.0
            ))?;
        }
    }
    Ok(())
}
