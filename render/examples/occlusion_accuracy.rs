//! Error against run time of the occlusion backends: `occlusion_accuracy [OUT.csv] [quick] [real] [passes]`.
//! Sweeps slices, grid, sub-cones and levels on a synthetic volume; truth is Monte Carlo, its standard
//! error beside it. Then one pass a slice against the paper's two, in one run.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "an example: it ends at the first error, and prints"
)]

use std::{fmt::Write, path::Path, sync::Arc, time::Instant};

use glam::DVec3;
use glioscope_core::Grid;
use glioscope_render::{
    AdapterPreference, Camera, Gpu, Projection,
    cones::{ConeRenderer, ConeSettings},
    dos::{DosRenderer, DosSettings, Form, Variant},
    occlusion::{Filter, OpticalVolume, Table},
    reference::monte_carlo::{Estimate, Phase, picture},
};

/// Three soft balls, intensities with a transfer function.
fn soft(n: usize) -> OpticalVolume {
    let grid = Grid::axis_aligned([n; 3], DVec3::ONE, DVec3::splat(-(n as f64 - 1.0) / 2.0)).unwrap();
    let values = (0..n * n * n)
        .map(|l| {
            let at =
                DVec3::from_array([l % n, l / n % n, l / n / n].map(|v| v as f64)) / (n as f64 - 1.0) - 0.5;
            let ball = |c: DVec3, r: f64| (1.0 - (at - c).length() / r).max(0.0);
            (ball(DVec3::new(-0.15, 0.05, 0.1), 0.32)
                + ball(DVec3::new(0.2, -0.1, 0.25), 0.2)
                + ball(DVec3::new(0.05, 0.1, -0.25), 0.4)) as f32
        })
        .collect();
    let rows = [[0.9, 0.5, 0.3, 0.0], [0.9, 0.6, 0.3, 0.06], [0.3, 0.7, 0.9, 0.25], [0.3, 0.7, 0.9, 0.5]];
    OpticalVolume::new(grid, values, Table::new(0.0, 0.8, &rows).unwrap(), Filter::Linear, None).unwrap()
}

/// Median, least and greatest milliseconds of some runs, after one that isn't counted.
fn timed(runs: usize, mut run: impl FnMut()) -> [f64; 3] {
    run();
    let mut ms: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    ms.sort_by(f64::total_cmp);
    [ms[ms.len() / 2], ms[0], ms[ms.len() - 1]]
}

/// RMS and largest error where something is, and the RMS standard error of the truth.
fn errors(found: &[[f32; 4]], truth: &[Estimate]) -> [f64; 3] {
    let (mut sum, mut most, mut se, mut n) = (0.0, 0.0f64, 0.0, 0.0);
    for (f, t) in found.iter().zip(truth).filter(|(f, _)| f[3] < 0.99) {
        for (c, value) in f.iter().enumerate().take(3) {
            let off = f64::from(*value) - t.mean[c];
            sum += off * off;
            most = most.max(off.abs());
            se += t.standard_error[c].powi(2);
            n += 1.0;
        }
    }
    [(sum / n).sqrt(), most, (se / n).sqrt()]
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let has = |word: &str| args.iter().any(|a| a == word);
    let preference = if has("real") { AdapterPreference::RealFirst } else { AdapterPreference::SoftwareOnly };
    let gpu = Gpu::headless(preference).unwrap();
    let quick = has("quick");
    let (n, side, samples, runs) = if quick { (48, 32, 512, 3) } else { (64, 64, 2048, 5) };
    let volume = Arc::new(soft(n));
    let camera =
        Camera::fit(DVec3::ZERO, 0.55 * n as f64, Camera::orientation(31.0, 20.0), Projection::Perspective);
    let size = [side; 2];
    let aperture_deg = 70.0;
    let phase = Phase::Cone { aperture_deg };
    let truth = picture(&*volume, &camera, size, phase, DVec3::ZERO, samples, 1);
    println!("{}; {n}^3 voxels, {side}x{side} pixels, {samples} samples a pixel", gpu.describe());
    let mut csv = String::from(
        "backend,slice_mm,grid,reference_mm,sub_cones,coarsest_level,median_ms,least_ms,greatest_ms,rms,max,truth_se\n",
    );
    let mut row = |text: String, [median, least, most]: [f64; 3], [rms, max, se]: [f64; 3]| {
        let line = format!("{text},{median:.3},{least:.3},{most:.3},{rms:.5},{max:.5},{se:.5}");
        println!("{line}");
        writeln!(csv, "{line}").unwrap();
    };
    let mut dos = DosRenderer::new(&gpu).unwrap();
    let base = DosSettings { aperture_deg, grid: 5, slice_mm: 1.0, ..DosSettings::default() };
    let mut knobs: Vec<DosSettings> = Vec::new();
    for variant in [Variant::PaperExact, Variant::PaperApproximate, Variant::Mended] {
        for slice_mm in [4.0, 2.0, 1.0, 0.5, 0.25] {
            knobs.push(DosSettings { variant, slice_mm, ..base });
        }
        knobs.extend([1, 2, 3, 7, 13].map(|grid| DosSettings { variant, grid, ..base }));
    }
    knobs.extend([1.0, 2.5, 5.0, 20.0, 40.0].map(|reference_mm| DosSettings { reference_mm, ..base }));
    let passes_only = has("passes");
    for s in knobs.into_iter().filter(|_| !passes_only) {
        let ms = timed(runs, || {
            dos.render(&gpu, &volume, &camera, size, &s, Form::OnePass, true).unwrap();
            gpu.wait().unwrap();
        });
        let name = format!("{:?},{},{},{},,", s.variant, s.slice_mm, s.grid, s.reference_mm);
        row(name, ms, errors(&dos.read(&gpu).unwrap(), &truth));
    }
    let mut cones = ConeRenderer::new(&gpu).unwrap();
    let base = ConeSettings { aperture_deg, ..ConeSettings::default() };
    let most = if quick { 64 } else { 128 };
    for (sub_cones, coarsest_level, step) in [
        (1, 8, 1.0),
        (4, 8, 1.0),
        (8, 8, 1.0),
        (16, 8, 1.0),
        (32, 8, 1.0),
        (8, 0, 1.0),
        (8, 1, 1.0),
        (8, 2, 1.0),
        (32, 1, 1.0),
        (most, 8, 0.5),
        (most, 0, 0.5),
    ]
    .into_iter()
    .filter(|_| !passes_only)
    {
        let s = ConeSettings { sub_cones, coarsest_level, ray_step: step, cone_step: step, ..base };
        let ms = timed(if sub_cones > 32 { 1 } else { runs }, || {
            cones.render(&gpu, &volume, &camera, size, &s, true).unwrap();
            gpu.wait().unwrap();
        });
        let name = format!("Cones,,,,{sub_cones},{coarsest_level}");
        row(name, ms, errors(&cones.read(&gpu).unwrap(), &truth));
    }
    // Alternating, so that a busy machine slows both.
    for (side, grid) in [(128, 2), (256, 3), (256, 5)] {
        let s =
            DosSettings { variant: Variant::PaperApproximate, grid, slice_mm: 1.0, ..DosSettings::default() };
        let mut ratios = Vec::new();
        let mut ms = [Vec::new(), Vec::new()];
        for _ in 0..if quick { 5 } else { 9 } {
            let [one, two] = [Form::OnePass, Form::TwoPasses { folded: true }].map(|form| {
                timed(1, || {
                    dos.render(&gpu, &volume, &camera, [side; 2], &s, form, false).unwrap();
                    gpu.wait().unwrap();
                })[0]
            });
            ratios.push(two / one);
            ms[0].push(one);
            ms[1].push(two);
        }
        for list in ms.iter_mut().chain([&mut ratios]) {
            list.sort_by(f64::total_cmp);
        }
        let median = |v: &[f64]| v[v.len() / 2];
        println!(
            "{side}x{side}, grid {grid}x{grid}: one pass {:.1} ms, two passes {:.1} ms, ratio {:.2} ({:.2} to {:.2})",
            median(&ms[0]),
            median(&ms[1]),
            median(&ratios),
            ratios[0],
            ratios[ratios.len() - 1]
        );
    }
    if let Some(path) = args.iter().find(|a| a.ends_with(".csv")) {
        glioscope_core::files::write_whole(Path::new(path), csv.as_bytes()).unwrap();
    }
}
