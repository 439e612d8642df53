//! Error against run time: sweeps the knob (tunable parameter) of every approximate kernel and measures time, memory
//! and the error relative to a named truth. The defaults are judged by these curves.
//!
//! A truth is an independent, slow computation of the same quantity in `f64`: Monte Carlo (with its standard error),
//! brute force, a closed form, or a run at a much tighter setting than any default. Each curve names its truth and the
//! truth's own error.

mod ambient;
mod context;
mod ellipsoids;
mod errors;
mod front;
mod lamp;
mod light;
pub mod lights;
mod masks;
mod report;
mod resampling;
mod scenes;
mod skeleton;
mod solids;
mod sweep;
#[cfg(test)]
mod tests;

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use clap::{Args, builder::PossibleValuesParser};
use glioscope_render::Gpu;
use serde::Serialize;

use self::errors::Errors;
pub use self::skeleton::angle_deg;
pub(crate) use self::solids::lit_solids;
use crate::{Outcome, clock::Timing, open_gpu, print_line};

/// All families, in the order of the page.
const FAMILIES: [&Family; 9] = [
    &context::FAMILY,
    &ambient::FAMILY,
    &masks::FAMILY,
    &solids::FAMILY,
    &light::FAMILY,
    &lamp::FAMILY,
    &ellipsoids::FAMILY,
    &skeleton::FAMILY,
    &resampling::FAMILY,
];

/// Name of the kernel of traced ambient occlusion.
const TRACED_KERNEL: &str = "rays through the masks";

/// Kernels that are compared with the same truths.
struct Family {
    /// Name on the command line and in file names.
    name: &'static str,
    /// Heading on the page.
    title: &'static str,
    /// Quantities compared and the trade-off of the default; printed on the page.
    about: &'static str,
    /// Meaning of its points with [`Point::is_default`].
    defaults: Defaults,
    /// Measures its curves.
    curves: fn(&Bench<'_>) -> Outcome<Vec<Curve>>,
}

/// Kind of a family's default settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Defaults {
    /// One setting, judged on each scene.
    One,
    /// Presets on a path of rising cost, judged over all scenes together.
    Presets,
}

impl Defaults {
    fn label(self) -> &'static str {
        match self {
            Self::One => "default",
            Self::Presets => "preset",
        }
    }
}

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Effort {
    /// Two or three settings per kernel on tiny scenes: for tests, not for figures.
    Tiny,
    /// Fewer settings, smaller frames: a check that nothing has drifted.
    Quick,
    /// All settings and full frames.
    Whole,
}

impl Effort {
    /// The value for this effort.
    fn of<T>(self, tiny: T, quick: T, whole: T) -> T {
        match self {
            Self::Tiny => tiny,
            Self::Quick => quick,
            Self::Whole => whole,
        }
    }
}

/// Abscissa of the plots of error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Axis {
    /// Median time; points have a Pareto front.
    Time,
    /// The knob, on which time doesn't depend.
    Knob,
}

/// One setting, measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Point {
    /// Description of the setting.
    setting: String,
    /// The knob's value.
    value: f64,
    /// Wall time from submission to completion; `None` if not measured.
    time: Option<Timing>,
    /// Processor time of all threads, if the kernel runs on the CPU (as on a software adapter) and the system reports
    /// it; unlike wall time it hardly depends on other load.
    cpu: Option<Timing>,
    /// Peak resident memory of the whole process while the setting ran, including a software adapter's buffers; `None`
    /// where the system doesn't report it.
    peak_bytes: Option<u64>,
    /// Root mean square of the error.
    error_rms: f64,
    /// Largest absolute error.
    error_max: f64,
    /// Root mean square and largest colour difference, CIE76 in CIELAB (D65), of the displayed frame; `None` for
    /// kernels without a colour frame.
    delta_e: Option<[f64; 2]>,
    /// Pearson's correlation of found and true values; `None` if not measured.
    correlation: Option<f64>,
    /// Ratio of drawn to requested pixels of a frame; 1 for everything else.
    pixel_share: f64,
    /// Whether this is the program's default, or one of its presets.
    is_default: bool,
    /// Whether no other point of the family on this scene dominates it: at most its cost ([`Point::cost`]) and error,
    /// and less of one of them.
    is_pareto: bool,
}

impl Point {
    /// A point with errors at a knob's value; name, times and marks are unset.
    fn new(value: f64, errors: &Errors) -> Self {
        Self {
            setting: String::new(),
            value,
            time: None,
            cpu: None,
            peak_bytes: None,
            error_rms: errors.rms(),
            error_max: errors.max(),
            delta_e: None,
            correlation: None,
            pixel_share: 1.0,
            is_default: false,
            is_pareto: false,
        }
    }

    /// The cost in front and plots: processor time if measured, else wall time.
    fn cost(&self) -> Option<Timing> {
        self.cpu.or(self.time)
    }
}

/// Error and cost of a kernel over its knob, on one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Curve {
    /// Name of its [`Family`].
    family: &'static str,
    /// The kernel and its variant.
    kernel: String,
    /// The scene.
    scene: String,
    /// Name of the knob.
    knob: &'static str,
    /// Description of the truth.
    truth: String,
    /// Root mean square error of the truth itself, in the unit of the errors; `None` for a closed form.
    truth_error: Option<f64>,
    /// Unit of the errors.
    unit: &'static str,
    /// Abscissa of the plot.
    axis: Axis,
    /// The settings, in the order of the knob.
    points: Vec<Point>,
}

/// Device and effort of a measurement.
struct Bench<'a> {
    gpu: &'a Gpu,
    effort: Effort,
}

impl Bench<'_> {
    /// Reports on stderr which measurement begins.
    fn begin(&self, label: &str, setting: &str) {
        if self.effort > Effort::Tiny {
            eprintln!("{label}: {setting}");
        }
    }
}

/// Arguments of `accuracy`.
#[derive(Debug, Args)]
pub struct AccuracyArguments {
    /// Fewer settings and smaller frames: under a minute on two cores
    #[arg(long)]
    quick: bool,
    /// Only these kernels
    #[arg(long, value_name = "KERNEL,...", value_delimiter = ',', value_parser = PossibleValuesParser::new(FAMILIES.map(|f| f.name)))]
    only: Vec<String>,
    /// The folder for numbers, plots and the page
    #[arg(long, value_name = "DIR", default_value = "out/accuracy")]
    out: PathBuf,
    /// Also print every number as JSON
    #[arg(long)]
    json: bool,
    /// Use only the software graphics adapter
    #[arg(long)]
    software: bool,
}

/// Curves of a family, and the time to measure them, truths included.
struct MeasuredFamily {
    family: &'static Family,
    elapsed: Duration,
    curves: Vec<Curve>,
}

fn measure(bench: &Bench<'_>, family: &'static Family) -> Outcome<MeasuredFamily> {
    let start = Instant::now();
    let mut curves = (family.curves)(bench)?;
    front::mark_pareto(&mut curves);
    Ok(MeasuredFamily { family, elapsed: start.elapsed(), curves })
}

/// Measures the requested families on the adapter and the CPU. Times include the effect of other load on the machine.
///
/// # Errors
/// When a frame can't be drawn, a scene built or a file written; nothing is written before everything is measured.
pub fn run(arguments: &AccuracyArguments) -> Outcome<()> {
    let effort = if arguments.quick { Effort::Quick } else { Effort::Whole };
    let gpu = open_gpu(arguments.software)?;
    let bench = Bench { gpu: &gpu, effort };
    let run_start = report::RunStart::now(&gpu);
    let is_selected =
        |f: &&Family| arguments.only.is_empty() || arguments.only.iter().any(|name| name == f.name);
    let measured: Vec<MeasuredFamily> = FAMILIES
        .into_iter()
        .filter(is_selected)
        .map(|family| measure(&bench, family))
        .collect::<Outcome<_>>()?;
    report::write(&measured, &run_start, &arguments.out)?;
    if arguments.json {
        print_line(serde_json::to_string_pretty(&report::json(&measured, &run_start, arguments.quick))?)
    } else {
        let durations = report::durations(&measured);
        print_line(format!("{durations}\nwrote numbers, plots and the page to {}", arguments.out.display()))
    }
}
