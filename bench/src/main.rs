//! Measures Glioscope. What the program's pages say of error and time comes from here; kernels are called as the
//! window calls them.

mod accuracy;
mod clock;
mod loops;

use std::{error::Error, io::Write, process::ExitCode};

use clap::{Parser, Subcommand};
use glioscope_render::{AdapterPreference, Gpu};

/// What can go wrong ends the run, with one line.
type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

#[derive(Debug, Parser)]
#[command(name = "glioscope-bench", about = "Measures Glioscope's kernels and views")]
struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Error against run time of every approximate kernel: numbers, plots and a page
    Accuracy(accuracy::AccuracyArguments),
    /// Times of the passes of all 3D views
    Views(loops::views::ViewsArguments),
    /// The automatic quality of a turning view
    Turning(loops::turning::TurningArguments),
    /// Reading and measuring 100,000 fibres
    Tracts,
    /// The skeleton's force on a graphics device beside the CPU
    ForceField(loops::force_field::ForceFieldArguments),
    /// The change's kernels on two masks
    Change(loops::change::ChangeArguments),
    /// Components and ellipsoids
    Ellipsoids(loops::ellipsoids::EllipsoidsArguments),
}

fn main() -> ExitCode {
    let done = match Arguments::parse().what {
        What::Accuracy(arguments) => accuracy::run(&arguments),
        What::Views(arguments) => loops::views::run(&arguments),
        What::Turning(arguments) => loops::turning::run(&arguments),
        What::Tracts => loops::tracts::run(),
        What::ForceField(arguments) => loops::force_field::run(&arguments),
        What::Change(arguments) => loops::change::run(&arguments),
        What::Ellipsoids(arguments) => loops::ellipsoids::run(&arguments),
    };
    let Err(error) = done else { return ExitCode::SUCCESS };
    eprintln!("glioscope-bench: {error}");
    ExitCode::from(2)
}

/// A line of the answer, at once: peers take turns with it.
fn say(line: impl AsRef<str>) -> Outcome<()> {
    let mut out = std::io::stdout();
    writeln!(out, "{}", line.as_ref())?;
    Ok(out.flush()?)
}

/// The adapter: a graphics card first, or with `software` only Mesa's.
fn open_gpu(software: bool) -> Outcome<Gpu> {
    let preference = if software { AdapterPreference::SoftwareOnly } else { AdapterPreference::RealFirst };
    Ok(Gpu::headless(preference)?)
}
