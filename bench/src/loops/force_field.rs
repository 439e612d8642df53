//! The skeleton's force on a graphics device beside core's exact sum and its tree: times and angles, as
//! CSV on stdout. `force_field FILE:LABELS [real] [runs=5]`; without `real` on the software adapter.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "an example: it ends at the first error, and prints"
)]

use std::time::Instant;

use glioscope_core::{
    Progress,
    case::{CaseSpec, LoadOptions, load},
    skeleton::{ForceField as Field, ForceSource, SkeletonOptions, force_field_with, skeleton_with},
};
use glioscope_render::{AdapterPreference, ForceField, Gpu};

fn timed<T>(runs: usize, mut job: impl FnMut() -> T) -> (f64, T) {
    let mut times = Vec::new();
    let mut last = job();
    for _ in 0..runs {
        let start = Instant::now();
        last = job();
        times.push(start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], last)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let real = arguments.iter().any(|a| a == "real");
    let runs = arguments.iter().find_map(|a| a.strip_prefix("runs=")).map_or(5, |n| n.parse().unwrap());
    let spec = CaseSpec::from_arguments(&[format!("m={}@1", arguments[0])], &[]).unwrap();
    let case = load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
    let (mask, grid) = (case.time_points[0].masks[0].mask.bits(), &case.grid);
    let gpu =
        Gpu::headless(if real { AdapterPreference::RealFirst } else { AdapterPreference::SoftwareOnly })
            .unwrap();
    let device = ForceField::new(&gpu).unwrap();
    let exact = SkeletonOptions { opening: 0.0, ..SkeletonOptions::default() };
    let field = |options: &SkeletonOptions, source: Option<&dyn ForceSource>| {
        force_field_with(mask, grid, options, source, &Progress::new()).unwrap()
    };
    let reference: Field = field(&exact, None);
    println!("adapter,{}", gpu.describe());
    println!("what,places,charges,field_s,skeleton_s,angle_p50_deg,angle_p95_deg,angle_max_deg,points");
    for (options, source) in [
        (exact, None),
        (SkeletonOptions::default(), None),
        (SkeletonOptions::default(), Some(&device as &dyn ForceSource)),
    ] {
        let (field_s, found) = timed(runs, || field(&options, source));
        let whole = || skeleton_with(mask, grid, &options, source, &Progress::new()).unwrap();
        let (skeleton_s, made) = timed(runs, whole);
        let mut angles: Vec<f64> = (reference.forces.iter().zip(&found.forces))
            .map(|(e, f)| e.cross(*f).length().atan2(e.dot(*f)).to_degrees())
            .collect();
        angles.sort_by(f64::total_cmp);
        let at = |part: f64| angles[((angles.len() - 1) as f64 * part) as usize];
        println!(
            "\"{}\",{},{},{field_s:.4},{skeleton_s:.4},{:.1e},{:.1e},{:.1e},{}",
            found.used,
            found.forces.len(),
            made.counts.charges,
            at(0.5),
            at(0.95),
            at(1.0),
            made.points.len()
        );
    }
}
