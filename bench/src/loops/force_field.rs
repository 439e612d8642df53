//! The skeleton's force field by core's exact sum, by its tree and on a graphics device: times and angular errors, as
//! CSV.

use clap::Args;
use glioscope_core::{
    Progress,
    case::{CaseSpec, LoadOptions, load},
    skeleton::{ForceSource, SkeletonOptions, force_field_with, skeleton_with},
};
use glioscope_render::ForceField;

use crate::{
    Outcome,
    accuracy::angle_deg,
    clock::{median, quantile, repeated},
    open_gpu, print_line,
};

/// Arguments of `force-field`.
#[derive(Debug, Args)]
pub struct ForceFieldArguments {
    /// The mask
    #[arg(value_name = "FILE:LABELS")]
    mask: String,
    /// Runs of each method; medians are reported
    #[arg(long, default_value_t = 5)]
    runs: usize,
    /// Use only the software graphics adapter
    #[arg(long)]
    software: bool,
}

/// Prints the table.
///
/// # Errors
/// When the mask can't be read, or a field can't be computed.
pub fn run(arguments: &ForceFieldArguments) -> Outcome<()> {
    let spec = CaseSpec::from_arguments(&[format!("m={}@1", arguments.mask)], &[])?;
    let case = load(&spec, &LoadOptions::default(), &Progress::new())?;
    let time = case.time_points.first().ok_or("no mask")?;
    let (mask, grid) = (time.masks.first().ok_or("no mask")?.mask.bits(), &case.grid);
    let gpu = open_gpu(arguments.software)?;
    let device = ForceField::new(&gpu)?;
    let exact = SkeletonOptions { opening: 0.0, ..SkeletonOptions::default() };
    let reference = force_field_with(mask, grid, &exact, None, &Progress::new())?;
    print_line(format!("adapter,{}", gpu.describe()))?;
    print_line("what,places,charges,field_s,skeleton_s,angle_p50_deg,angle_p95_deg,angle_max_deg,points")?;
    for (options, source) in [
        (exact, None),
        (SkeletonOptions::default(), None),
        (SkeletonOptions::default(), Some(&device as &dyn ForceSource)),
    ] {
        let field = || force_field_with(mask, grid, &options, source, &Progress::new());
        let full_skeleton = || skeleton_with(mask, grid, &options, source, &Progress::new());
        let (field_ms, found) = repeated(arguments.runs, field)?;
        let (skeleton_ms, skeleton) = repeated(arguments.runs, full_skeleton)?;
        let pairs = reference.forces.iter().zip(&found.forces);
        let mut angles: Vec<f64> = pairs.map(|(e, f)| angle_deg(*e, *f)).collect();
        angles.sort_by(f64::total_cmp);
        print_line(format!(
            "\"{}\",{},{},{:.4},{:.4},{:.1e},{:.1e},{:.1e},{}",
            found.used,
            found.forces.len(),
            skeleton.counts.charges,
            median(&field_ms) / 1e3,
            median(&skeleton_ms) / 1e3,
            quantile(&angles, 0.5),
            quantile(&angles, 0.95),
            quantile(&angles, 1.0),
            skeleton.points.len()
        ))?;
    }
    Ok(())
}
