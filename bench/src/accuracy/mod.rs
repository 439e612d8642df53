//! Error against run time: for every approximate kernel its knob swept, time, memory, and error against
//! a named truth. What `glioscope accuracy` writes; defaults are judged by it.
//!
//! A truth is another way to the same quantity, slow and in `f64`: Monte Carlo (with its standard
//! error), brute force, a closed form, or a run asked for much more than any default; each curve names
//! its own and says how far off that may be.

mod ambient;
mod context;
mod ellipsoids;
mod half;
mod measure;
mod occlusion;
mod resampling;
mod scenes;
mod skeletons;
mod sweep;
#[cfg(test)]
mod tests;
mod view;

use glioscope_core::{Cancelled, Progress};
use serde::Serialize;

pub use measure::{Errors, Timing, delta_e, load_average, mark_pareto, peak_bytes, quartiles};

use crate::{gpu::Gpu, renderer::RenderError};

/// Kernels that are held against one and the same kind of truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// Steps of the context view's rays.
    Context,
    /// Ambient occlusion of the closeup.
    Ambient,
    /// Directional occlusion by slices and by cones.
    Occlusion,
    /// The light of a view, with the presets.
    View,
    /// Enclosing ellipsoids.
    Ellipsoids,
    /// The skeleton's force.
    Skeleton,
    /// Images brought onto another grid.
    Resampling,
    /// What half floats would cost; the program uses none.
    Half,
}

impl Family {
    /// All, in the order they are measured.
    pub const ALL: [Self; 8] = [
        Self::Context,
        Self::Ambient,
        Self::Occlusion,
        Self::View,
        Self::Ellipsoids,
        Self::Skeleton,
        Self::Resampling,
        Self::Half,
    ];

    /// Its name on the command line and in file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Context => "context",
            Self::Ambient => "ambient",
            Self::Occlusion => "occlusion",
            Self::View => "view",
            Self::Ellipsoids => "ellipsoids",
            Self::Skeleton => "skeleton",
            Self::Resampling => "resampling",
            Self::Half => "half",
        }
    }

    /// What its points with [`Point::is_default`] are called.
    pub fn default_word(self) -> &'static str {
        if self == Self::View { "preset" } else { "default" }
    }

    /// What a heading says.
    pub fn title(self) -> &'static str {
        match self {
            Self::Context => "Ray step of the context view",
            Self::Ambient => "Ambient occlusion of the closeup",
            Self::Occlusion => "Directional occlusion: slices and cones",
            Self::View => "Light of the context view, and its presets",
            Self::Ellipsoids => "Enclosing ellipsoids",
            Self::Skeleton => "Opening bound of the skeleton's force",
            Self::Resampling => "Resampling of images",
            Self::Half => "Half floats, which the program does not use",
        }
    }
}

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effort {
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
pub enum Axis {
    /// Median time: there is a front.
    Time,
    /// The knob itself: time doesn't depend on it, or means nothing.
    Knob,
}

/// One setting, measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// The setting in words.
    pub setting: String,
    /// The knob's value.
    pub value: f64,
    /// Time from begin to done; nothing where none can be told.
    pub time: Option<Timing>,
    /// Processor time of all threads, where the kernel runs on the processor (a software adapter's do)
    /// and the system says: unlike time it hardly depends on what else the machine does.
    pub cpu: Option<Timing>,
    /// Most memory that the whole process had resident while the setting ran (VmHWM, reset before),
    /// the software adapter's buffers with it; nothing where the system doesn't say.
    pub peak_bytes: Option<u64>,
    /// Root mean square of the error.
    pub error_rms: f64,
    /// Largest absolute error.
    pub error_max: f64,
    /// Root mean square and largest colour difference, CIE76 in CIELAB (D65), of the displayed
    /// picture; for pictures in colour.
    pub delta_e: Option<[f64; 2]>,
    /// Pixels drawn to pixels asked for, of a picture; 1 of all else.
    pub pixel_share: f64,
    /// Whether it is what the program does when nobody says otherwise, or one of its presets.
    pub is_default: bool,
    /// Whether no other point of the family on this scene costs at most as much ([`Point::cost`]) and is at least as
    /// right, and one of them more.
    pub is_pareto: bool,
}

impl Point {
    /// Errors at a knob's value; without a name, times and marks.
    pub fn new(value: f64, errors: &Errors) -> Self {
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
    pub fn cost(&self) -> Option<Timing> {
        self.cpu.or(self.time)
    }
}

/// A kernel's knob swept on a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// What it is drawn beside.
    pub family: Family,
    /// The kernel, and the variant of it.
    pub kernel: String,
    /// The scene.
    pub scene: String,
    /// What the knob is.
    pub knob: &'static str,
    /// What errors are against.
    pub truth: String,
    /// What the truth itself is off by (root mean square), in the unit of the errors; nothing for a
    /// closed form.
    pub truth_error: Option<f64>,
    /// Unit of the errors.
    pub unit: &'static str,
    /// What error is drawn against.
    pub axis: Axis,
    /// The settings, in the order of the knob.
    pub points: Vec<Point>,
}

/// Why there are no curves.
#[derive(Debug, thiserror::Error)]
pub enum AccuracyError {
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A picture can't be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A kernel of `core` refused its input, or a scene can't be made.
    #[error("accuracy: found {0}, expected a scene that can be measured")]
    Scene(String),
}

impl AccuracyError {
    fn of(error: &impl ToString) -> Self {
        Self::Scene(error.to_string())
    }
}

/// What a family needs to measure.
struct Bench<'a> {
    gpu: &'a Gpu,
    effort: Effort,
    progress: &'a Progress,
}

impl Bench<'_> {
    /// Says what runs, counts it as done, and stops where the user asked to.
    fn begin(&self, what: &str, setting: &str) -> Result<(), Cancelled> {
        self.progress.say(format!("{what}: {setting}"));
        self.progress.advance(1)
    }

    fn wait(&self) -> Result<(), RenderError> {
        self.gpu.wait().map_err(RenderError::Device)
    }
}

/// Measures the families asked for on `gpu` and the CPU. Times are of whatever else the machine does,
/// too. Progress counts settings.
///
/// # Errors
/// [`AccuracyError`].
pub fn curves(
    gpu: &Gpu,
    effort: Effort,
    families: &[Family],
    progress: &Progress,
) -> Result<Vec<Curve>, AccuracyError> {
    let bench = Bench { gpu, effort, progress };
    // Settings of each family, about: the bar only has to move.
    let settings = |f: &Family| match f {
        Family::Context | Family::Ambient => 20,
        Family::Occlusion => effort.of(10, 40, 120),
        Family::View => effort.of(5, 16, 180),
        Family::Ellipsoids => 20,
        Family::Skeleton | Family::Resampling | Family::Half => 8,
    };
    progress.expect(families.iter().map(settings).sum());
    let mut out = Vec::new();
    for family in families {
        out.extend(match family {
            Family::Context => context::curves(&bench)?,
            Family::Ambient => ambient::curves(&bench)?,
            Family::Occlusion => occlusion::curves(&bench)?,
            Family::View => view::curves(&bench)?,
            Family::Ellipsoids => ellipsoids::curves(&bench)?,
            Family::Skeleton => skeletons::curves(&bench)?,
            Family::Resampling => resampling::curves(&bench)?,
            Family::Half => half::curves(&bench)?,
        });
    }
    mark_pareto(&mut out);
    Ok(out)
}
