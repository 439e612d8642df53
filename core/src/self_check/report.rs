//! What the self-check found, as it is written.

use serde::Serialize;

/// Shares of a known change outside of which a recovery is marked.
pub const GOOD: std::ops::RangeInclusive<f64> = 0.9..=1.1;

/// What share of known changes this case's own measurement recovers, and how often it calls a change where there is none. Field names are
/// stable.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SelfCheckReport {
    /// The mask's id.
    pub mask: String,
    /// Label of the date into which changes were put.
    pub date: String,
    /// The image that was registered; `None` where there is none, or none can be.
    pub image: Option<String>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Volume of the mask.
    pub volume_ml: f64,
    /// Registration error that the uncertainty holds, standard deviation along any direction.
    pub registration_mm: f64,
    /// Runs without change.
    pub unchanged: Unchanged,
    /// Known movements of the surface.
    pub surfaces: Vec<SurfaceCheck>,
    /// Known lesions that come or go.
    pub lesions: Vec<LesionCheck>,
    /// The registrations; `None` where none was run.
    pub registration: Option<RegistrationCheck>,
    /// How it was done, one sentence each.
    pub notes: Vec<String>,
}

/// Runs without change.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Unchanged {
    /// Number of runs.
    pub runs: usize,
    /// Runs in which a change was called.
    pub false_calls: usize,
    /// Runs in which the surface was said to grow.
    pub grew: usize,
    /// Runs in which the surface was said to shrink.
    pub shrank: usize,
    /// Runs in which components were said to appear.
    pub appeared: usize,
    /// Runs in which components were said to vanish.
    pub vanished: usize,
    /// Runs in which components were said to split, merge or regroup: not counted as false calls.
    pub pieces: usize,
    /// Largest share of a surface beyond its uncertainty in any run.
    pub most_share: Option<f64>,
    /// Mean difference of the volumes.
    pub volume_ml: f64,
    /// Whether more than one run in a hundred has a false call.
    pub marked: bool,
}

/// What share of a known quantity was measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Recovered {
    /// Measured by known, mean over the runs; 1 is right.
    pub share: f64,
    /// Standard error of that mean; `None` of one run.
    pub standard_error: Option<f64>,
    /// Whether it lies outside 0.9 to 1.1.
    pub marked: bool,
}

/// Where the surface moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, strum::IntoStaticStr)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Where {
    /// Everywhere.
    Evenly,
    /// On one side, in another direction in every run.
    OneSide,
}

/// One known movement of the surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceCheck {
    /// The movement where it is largest, growth positive.
    pub known_mm: f64,
    /// Where.
    pub at: Where,
    /// Number of runs that came to an end.
    pub runs: usize,
    /// Known mean movement of the whole surface.
    pub known_mean_mm: f64,
    /// Mean movement of the whole surface by the vectors.
    pub mean_mm: f64,
    /// Mean movement of the whole surface by the distances to the nearest voxel of the other one.
    pub nearest_mean_mm: f64,
    /// What was recovered of the mean movement by the vectors; `None` where nothing moved.
    pub surface: Option<Recovered>,
    /// What was recovered of it by the nearest distances; `None` likewise.
    pub nearest: Option<Recovered>,
    /// What was recovered of the difference of the volumes; `None` where nothing moved.
    pub volume: Option<Recovered>,
    /// Runs in which a change was called.
    pub called: usize,
}

/// Whether a lesion comes or goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, strum::IntoStaticStr)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Comes {
    /// There at the later date only.
    New,
    /// There at the earlier date only.
    Vanished,
}

/// Known lesions of one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LesionCheck {
    /// Whether it comes or goes.
    pub comes: Comes,
    /// Its volume.
    pub known_ml: f64,
    /// How many were put in.
    pub runs: usize,
    /// How many of them were found.
    pub found: usize,
    /// What was recovered of the volumes of those found; `None` where none was.
    pub volume: Option<Recovered>,
    /// Whether fewer than 9 in 10 were found.
    pub marked: bool,
}

/// The registrations of the runs: how far they were off where the lesion's surface is, at most.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegistrationCheck {
    /// How many came to an end.
    pub runs: usize,
    /// How many were refused; such runs are left out.
    pub refused: usize,
    /// Edge of the voxels that were compared.
    pub voxel_mm: f64,
    /// Median error.
    pub median_mm: Option<f64>,
    /// Largest error.
    pub max_mm: Option<f64>,
    /// Largest error of those repeated on the image as it is, with the search for a start.
    pub full_max_mm: Option<f64>,
    /// How many those were.
    pub full_runs: usize,
}

impl Recovered {
    /// Of measured and known values; `None` of none.
    pub(super) fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let shares: Vec<f64> = pairs
            .iter()
            .filter(|(_, known)| *known != 0.0)
            .map(|(measured, known)| measured / known)
            .collect();
        let count = shares.len() as f64;
        if shares.is_empty() {
            return None;
        }
        let share = shares.iter().sum::<f64>() / count;
        let squares = shares.iter().map(|s| (s - share) * (s - share)).sum::<f64>();
        let standard_error = (shares.len() > 1).then(|| (squares / (count - 1.0) / count).sqrt());
        Some(Self { share, standard_error, marked: !GOOD.contains(&share) })
    }
}

impl SelfCheckReport {
    /// Whether anything is marked.
    pub fn is_marked(&self) -> bool {
        let surfaces =
            self.surfaces.iter().flat_map(|check| [check.surface, check.nearest, check.volume]).flatten();
        self.unchanged.marked
            || surfaces.into_iter().any(|recovered| recovered.marked)
            || self.lesions.iter().any(|check| check.marked || check.volume.is_some_and(|v| v.marked))
    }
}
