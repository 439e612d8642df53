//! Error against run time: for every approximate kernel its knob swept, time, memory, and error against
//! a named truth. Defaults are judged by it.
//!
//! A truth is another way to the same quantity, slow and in `f64`: Monte Carlo (with its standard
//! error), brute force, a closed form, or a run asked for much more than any default; each curve names
//! its own and says how far off that may be.

mod ambient;
mod context;
mod ellipsoids;
mod errors;
mod front;
mod light;
mod masks;
mod report;
mod resampling;
mod scenes;
mod skeleton;
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
use crate::{Outcome, clock::Timing, open_gpu, say};

/// What is measured, in the order of the page.
const FAMILIES: [&Family; 7] = [
    &context::FAMILY,
    &ambient::FAMILY,
    &masks::FAMILY,
    &light::FAMILY,
    &ellipsoids::FAMILY,
    &skeleton::FAMILY,
    &resampling::FAMILY,
];

/// Kernels that are held against one and the same kind of truth.
struct Family {
    /// On the command line and in file names.
    name: &'static str,
    /// What a heading says.
    title: &'static str,
    /// What is swept, and what the default weighs against what.
    about: &'static str,
    /// What its points with [`Point::is_default`] are.
    defaults: Defaults,
    /// Measures it.
    curves: fn(&Bench<'_>) -> Outcome<Vec<Curve>>,
}

/// What the program does by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Defaults {
    /// One setting, judged on each scene.
    One,
    /// Presets on a path, judged over all scenes together.
    Presets,
}

impl Defaults {
    fn word(self) -> &'static str {
        match self {
            Self::One => "default",
            Self::Presets => "preset",
        }
    }
}

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Effort {
    /// Two or three settings a kernel on tiny scenes: for tests, not for figures.
    Tiny,
    /// Fewer settings, smaller pictures: a check that nothing has drifted.
    Quick,
    /// Everything.
    Whole,
}

impl Effort {
    /// One of three.
    fn of<T>(self, tiny: T, quick: T, whole: T) -> T {
        match self {
            Self::Tiny => tiny,
            Self::Quick => quick,
            Self::Whole => whole,
        }
    }
}

/// What error is drawn against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Axis {
    /// Median time: there is a front.
    Time,
    /// The knob itself: time doesn't depend on it.
    Knob,
}

/// One setting, measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Point {
    /// The setting in words.
    setting: String,
    /// The knob's value.
    value: f64,
    /// Time from begin to done; `None` where none can be told.
    time: Option<Timing>,
    /// Processor time of all threads, where the kernel runs on the processor (a software adapter's do)
    /// and the system says: unlike time it hardly depends on what else the machine does.
    cpu: Option<Timing>,
    /// Most memory that the whole process had resident while the setting ran, the software adapter's buffers
    /// with it; `None` where the system doesn't say.
    peak_bytes: Option<u64>,
    /// Root mean square of the error.
    error_rms: f64,
    /// Largest absolute error.
    error_max: f64,
    /// Root mean square and largest colour difference, CIE76 in CIELAB (D65), of the displayed
    /// picture; for pictures in colour.
    delta_e: Option<[f64; 2]>,
    /// Pixels drawn to pixels asked for, of a picture; 1 of all else.
    pixel_share: f64,
    /// Whether it is what the program does when nobody says otherwise, or one of its presets.
    is_default: bool,
    /// Whether no other point of the family on this scene costs at most as much ([`Point::cost`]) and is at least as
    /// right, and one of them more.
    is_pareto: bool,
}

impl Point {
    /// Errors at a knob's value; without a name, times and marks.
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
            pixel_share: 1.0,
            is_default: false,
            is_pareto: false,
        }
    }

    /// What the front counts and plots show: processor time where there is some, else time.
    fn cost(&self) -> Option<Timing> {
        self.cpu.or(self.time)
    }
}

/// A kernel's knob swept on a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Curve {
    /// The name of the [`Family`] that it is drawn beside.
    family: &'static str,
    /// The kernel, and the variant of it.
    kernel: String,
    /// The scene.
    scene: String,
    /// What the knob is.
    knob: &'static str,
    /// What errors are against.
    truth: String,
    /// What the truth itself is off by (root mean square), in the unit of the errors; `None` for a
    /// closed form.
    truth_error: Option<f64>,
    /// Unit of the errors.
    unit: &'static str,
    /// What error is drawn against.
    axis: Axis,
    /// The settings, in the order of the knob.
    points: Vec<Point>,
}

/// What a family needs to measure.
struct Bench<'a> {
    gpu: &'a Gpu,
    effort: Effort,
}

impl Bench<'_> {
    /// Says on stderr what runs.
    fn begin(&self, what: &str, setting: &str) {
        if self.effort > Effort::Tiny {
            eprintln!("{what}: {setting}");
        }
    }
}

/// What `accuracy` can be told.
#[derive(Debug, Args)]
pub struct AccuracyArguments {
    /// Fewer settings and smaller pictures: under a minute on two cores
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

/// Curves of a family, and how long they took, truths and settings together.
struct Measured {
    family: &'static Family,
    took: Duration,
    curves: Vec<Curve>,
}

fn measure(bench: &Bench<'_>, family: &'static Family) -> Outcome<Measured> {
    let start = Instant::now();
    let mut curves = (family.curves)(bench)?;
    front::mark_pareto(&mut curves);
    Ok(Measured { family, took: start.elapsed(), curves })
}

/// Measures the families asked for, on the adapter and the CPU. Times are of whatever else the machine does, too.
///
/// # Errors
/// Where a picture can't be drawn, a scene not made, or a file not written; nothing is written before all is measured.
pub fn run(arguments: &AccuracyArguments) -> Outcome<()> {
    let effort = if arguments.quick { Effort::Quick } else { Effort::Whole };
    let gpu = open_gpu(arguments.software)?;
    let bench = Bench { gpu: &gpu, effort };
    let begun = report::Begun::now(&gpu);
    let asked = |f: &&Family| arguments.only.is_empty() || arguments.only.iter().any(|name| name == f.name);
    let measured: Vec<Measured> =
        FAMILIES.into_iter().filter(asked).map(|family| measure(&bench, family)).collect::<Outcome<_>>()?;
    report::write(&measured, &begun, &arguments.out)?;
    if arguments.json {
        say(serde_json::to_string_pretty(&report::json(&measured, &begun, arguments.quick))?)
    } else {
        let took = report::durations(&measured);
        say(format!("{took}\nnumbers, plots and page written to {}", arguments.out.display()))
    }
}
