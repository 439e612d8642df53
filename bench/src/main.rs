//! Benchmarks of Glioscope, which measure the errors and times in docs/. Kernels are called as the window calls them.

mod accuracy;
mod clock;
mod hemisphere;
mod loops;

use std::{error::Error, io::Write, process::ExitCode};

use clap::{Parser, Subcommand};
use glioscope_render::{AdapterPreference, Gpu};

/// Result of a benchmark; an error ends the run with a one-line message.
type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

#[derive(Debug, Parser)]
#[command(name = "glioscope-bench", about = "Measures Glioscope's kernels and views")]
struct Arguments {
    #[command(subcommand)]
    benchmark: Benchmark,
}

#[derive(Debug, Subcommand)]
enum Benchmark {
    /// Error against run time of every approximate kernel: numbers, plots and a page
    Accuracy(accuracy::AccuracyArguments),
    /// Every lighting mode on the sample: time, memory and error in one table
    Lights(accuracy::lights::LightsArguments),
    /// Times of the passes of all 3D views
    Views(loops::views::ViewsArguments),
    /// Automatic quality while a view rotates
    Turning(loops::turning::TurningArguments),
    /// All 3D views of the default layout while they turn
    Together(loops::together::TogetherArguments),
    /// The closeup on real and made cases, beside a peer: errors of the occlusion, times, pictures
    Closeups(loops::closeups::CloseupsArguments),
    /// Directional light on geometry alone, on an image alone and on both: table 1 of Schott et al. 2012
    Combined(loops::combined::CombinedArguments),
    /// Reading and measuring 100,000 fibres
    Tracts,
    /// Reading images: files, or folders with a DICOM series
    Images(loops::images::ImagesArguments),
    /// The skeleton's force field on a graphics device and on the CPU
    ForceField(loops::force_field::ForceFieldArguments),
    /// Kernels of the change between two masks
    Change(loops::change::ChangeArguments),
    /// Connected components and enclosing ellipsoids
    Ellipsoids(loops::ellipsoids::EllipsoidsArguments),
    /// How soon windows answer: from an X event to changed pixels (needs Xvfb)
    Fluency(loops::fluency::FluencyArguments),
}

fn main() -> ExitCode {
    let outcome = match Arguments::parse().benchmark {
        Benchmark::Accuracy(arguments) => accuracy::run(&arguments),
        Benchmark::Lights(arguments) => accuracy::lights::run(&arguments),
        Benchmark::Views(arguments) => loops::views::run(&arguments),
        Benchmark::Turning(arguments) => loops::turning::run(&arguments),
        Benchmark::Together(arguments) => loops::together::run(&arguments),
        Benchmark::Closeups(arguments) => loops::closeups::run(&arguments),
        Benchmark::Combined(arguments) => loops::combined::run(&arguments),
        Benchmark::Tracts => loops::tracts::run(),
        Benchmark::Images(arguments) => loops::images::run(&arguments),
        Benchmark::ForceField(arguments) => loops::force_field::run(&arguments),
        Benchmark::Change(arguments) => loops::change::run(&arguments),
        Benchmark::Ellipsoids(arguments) => loops::ellipsoids::run(&arguments),
        Benchmark::Fluency(arguments) => loops::fluency::run(&arguments),
    };
    let Err(error) = outcome else { return ExitCode::SUCCESS };
    eprintln!("glioscope-bench: {error}");
    ExitCode::from(2)
}

/// Prints a line and flushes, because peer scripts wait for each line.
fn print_line(line: impl AsRef<str>) -> Outcome<()> {
    let mut out = std::io::stdout();
    writeln!(out, "{}", line.as_ref())?;
    Ok(out.flush()?)
}

/// Opens an adapter: a hardware GPU if there is one; the software adapter if there is none, or if `software`.
fn open_gpu(software: bool) -> Outcome<Gpu> {
    let preference = if software { AdapterPreference::SoftwareOnly } else { AdapterPreference::RealFirst };
    Ok(Gpu::headless(preference)?)
}
