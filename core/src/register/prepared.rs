//! Two images made ready, and the fine levels of a registration, on which restarts run as well.

use crate::{Cancelled, Progress};
use glam::{DAffine3, DMat3, DVec3};

use super::{
    curve::Curve,
    level::Level,
    pair::{Keep, Pair, points},
    pose::half_way,
    pyramid::{Pyramid, centred, finest_useful_mm, pyramid, schedule, uncentred},
    quasi_newton::Climb,
    robust::Fit,
    types::{Image, Measure, Model, Options, RegisterError, Which},
};

/// Bins at the fine levels.
const BINS: usize = 32;
/// Width of the point spread at which differences of intensities are fitted, of the resolution. Linear interpolation
/// smooths by the fraction of a voxel; what is smooth already loses less to it. Mutual information, which lives on edges,
/// is better without.
const SMOOTH: f64 = 0.9;
/// Step at which the finest level ends, of its resolution.
const TOLERANCE: f64 = 2e-4;
/// Step that may remain where no step improves the fit any more, of the resolution.
const REST: f64 = 0.1;
/// The same at other levels.
const ROUGH_TOLERANCE: f64 = 5e-3;

/// Both images' levels.
#[derive(Clone, Debug)]
pub(crate) struct Prepared {
    pub fixed: Pyramid,
    pub moving: Pyramid,
    pub resolutions: Vec<f64>,
    /// Whether the images are too large for the finest resolution that shows anything.
    pub is_coarser: bool,
    pub fixed_centre_mm: DVec3,
    pub moving_centre_mm: DVec3,
    /// The moving image's centred space is turned (or mirrored) by this.
    pub turn: DMat3,
    /// Radius within which steps are measured, mm: of the smaller foreground.
    pub radius_mm: f64,
}

/// What the fine levels found.
#[derive(Clone, Debug)]
pub(crate) struct Refined {
    pub pose: DAffine3,
    pub outlier_share: f64,
    pub correlation: f64,
    pub evaluations: usize,
    pub last_step_mm: f64,
    pub converged: bool,
}

impl Prepared {
    pub fn new(
        fixed: &Image<'_>,
        moving: &Image<'_>,
        options: &Options,
        progress: &Progress,
    ) -> Result<Self, RegisterError> {
        let resolutions = schedule(fixed.volume, moving.volume, options);
        let useful_mm = finest_useful_mm(fixed.volume, moving.volume, options);
        let make = |image, which| pyramid(image, which, &resolutions, options.margin_mm, progress);
        let (fixed_pyramid, moving_pyramid) =
            rayon::join(|| make(fixed, Which::Fixed), || make(moving, Which::Moving));
        let (fixed_pyramid, moving_pyramid) = (fixed_pyramid?, moving_pyramid?);
        Ok(Self {
            radius_mm: fixed_pyramid.radius_mm.min(moving_pyramid.radius_mm),
            fixed: fixed_pyramid,
            moving: moving_pyramid,
            is_coarser: resolutions.last().is_some_and(|finest| *finest > 1.01 * useful_mm),
            resolutions,
            fixed_centre_mm: fixed.volume.grid().center_mm(),
            moving_centre_mm: moving.volume.grid().center_mm(),
            turn: DMat3::IDENTITY,
        })
    }

    /// The same with the moving image's centred space turned or mirrored by an orthogonal matrix.
    pub fn turned(&self, turn: DMat3) -> Self {
        Self { moving: self.moving.turned(turn), turn: turn * self.turn, ..self.clone() }
    }

    /// The fine levels as a measure needs them: differences of intensities smoother, see [`SMOOTH`].
    pub fn for_measure(&self, measure: Measure, progress: &Progress) -> Result<Self, Cancelled> {
        let mut ready = self.clone();
        if measure == Measure::SameModality {
            let first = self.fine_from();
            for (index, resolution_mm) in self.resolutions.iter().enumerate().skip(first) {
                let smooth = |level: &Level| level.smoothed(SMOOTH * resolution_mm, progress);
                let (fixed, moving) = (&self.fixed.levels[index], &self.moving.levels[index]);
                let (fixed, moving) = rayon::join(|| smooth(fixed), || smooth(moving));
                (ready.fixed.levels[index], ready.moving.levels[index]) = (fixed?, moving?);
            }
        }
        Ok(ready)
    }

    /// The same with fixed and moving image exchanged.
    pub fn swapped(self) -> Self {
        Self {
            fixed: self.moving,
            moving: self.fixed,
            fixed_centre_mm: self.moving_centre_mm,
            moving_centre_mm: self.fixed_centre_mm,
            ..self
        }
    }

    /// A pose of centred mm from a transform of RAS mm.
    pub fn pose(&self, moving_from_fixed: DAffine3) -> DAffine3 {
        let pose = centred(moving_from_fixed, self.fixed_centre_mm, self.moving_centre_mm);
        DAffine3::from_mat3(self.turn) * pose
    }

    /// A transform of RAS mm from a pose.
    pub fn transform(&self, pose: DAffine3) -> DAffine3 {
        let unturned = DAffine3::from_mat3(self.turn.transpose()) * pose;
        uncentred(unturned, self.fixed_centre_mm, self.moving_centre_mm)
    }

    /// How intensities are spread over bins: fixed, moving.
    pub fn curves(&self) -> (&Curve, &Curve) {
        (&self.fixed.curve, &self.moving.curve)
    }

    /// Index of the level at which a fit of this measure may start from a rough alignment.
    pub fn fine_from(&self) -> usize {
        usize::from(self.resolutions.len() > 1)
    }

    /// Fits at the levels from index `first` on, starting at `pose`. `None` where nothing can be measured.
    pub fn refine(
        &self,
        pose: DAffine3,
        first: usize,
        measure: Measure,
        options: &Options,
        progress: &Progress,
    ) -> Result<Option<Refined>, Cancelled> {
        let mut at = Refined {
            pose,
            outlier_share: 0.0,
            correlation: 0.0,
            evaluations: 0,
            last_step_mm: 0.0,
            converged: false,
        };
        let mut gain = Vec::new();
        let last = self.resolutions.len() - 1;
        for (index, resolution_mm) in self.resolutions.iter().enumerate().skip(first) {
            progress.say(format!("{resolution_mm:.1} mm"));
            // The matrix needs detail that the coarsest level lacks.
            let model = if index == 0 { Model::Rigid } else { options.model };
            let Some(half) = half_way(at.pose, model) else { return Ok(None) };
            let points = points(
                &self.fixed,
                &self.moving,
                &half,
                *resolution_mm,
                options.max_points,
                Keep::Foreground,
                2.0 * resolution_mm,
                options.seed,
            );
            let tolerance_mm = resolution_mm * if index == last { TOLERANCE } else { ROUGH_TOLERANCE };
            let (fixed, moving) = (&self.fixed.levels[index], &self.moving.levels[index]);
            if measure == Measure::AcrossModalities {
                let climb = Climb {
                    fixed,
                    moving,
                    points: &points,
                    bins: BINS,
                    curves: self.curves(),
                    model,
                    first_step_mm: 0.25 * resolution_mm,
                    tolerance_mm,
                    rest_mm: REST * resolution_mm,
                    most_steps: 80,
                    radius_mm: self.radius_mm,
                };
                let Some(climbed) = climb.run(at.pose, progress)? else { return Ok(None) };
                at.pose = climbed.pose;
                at.evaluations += climbed.evaluations;
                (at.last_step_mm, at.converged) = (climbed.last_step_mm, climbed.converged);
            } else {
                let fit = Fit {
                    fixed,
                    moving,
                    points: &points,
                    model,
                    degree: if *resolution_mm > 3.0 { 2 } else { 3 },
                    radius_mm: self.radius_mm,
                    tolerance_mm,
                    rest_mm: REST * resolution_mm,
                    most_steps: 60,
                    foreground: self.fixed.foreground.min(self.moving.foreground),
                };
                let Some(fitted) = fit.run(at.pose, &gain, progress)? else { return Ok(None) };
                gain.clone_from(&fitted.gain);
                at = Refined {
                    pose: fitted.pose,
                    outlier_share: fitted.outlier_share,
                    correlation: fitted.correlation,
                    evaluations: at.evaluations + fitted.evaluations,
                    last_step_mm: fitted.last_step_mm,
                    converged: fitted.converged,
                };
            }
            progress.advance(1)?;
        }
        Ok(Some(at))
    }

    /// Normalised mutual information at the level `index`; `None` where it can't be measured.
    pub fn similarity(&self, pose: DAffine3, index: usize, seed: u64, model: Model) -> Option<f64> {
        let half = half_way(pose, model)?;
        let points = points(&self.fixed, &self.moving, &half, 3.0, 100_000, Keep::Foreground, 8.0, seed);
        let pair = Pair::new(&self.fixed.levels[index], &self.moving.levels[index], &half);
        super::mutual::value(&pair, &points, BINS, self.curves())
    }
}

impl Prepared {
    /// A fit of intensities at the coarsest fine level, to see whether the images are of one modality.
    pub fn trial(
        &self,
        pose: DAffine3,
        options: &Options,
        progress: &Progress,
    ) -> Result<Option<Refined>, Cancelled> {
        let first = self.fine_from();
        let only = Self { resolutions: self.resolutions[..=first].to_vec(), ..self.clone() };
        only.refine(pose, first, Measure::SameModality, options, progress)
    }
}
