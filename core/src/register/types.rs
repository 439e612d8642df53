//! What a registration is asked for and what it answers.

use crate::{Cancelled, Mask, Volume};
use glam::{DAffine3, DVec3};

/// One of the two images, and what of it must not count.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    /// Its voxels. NaN and infinite values count as outside the image.
    pub volume: &'a Volume,
    /// Masks that are left out (lesions, cavities), each on its own grid, grown by [`Options::margin_mm`].
    pub excluded: &'a [&'a Mask],
}

impl<'a> Image<'a> {
    /// An image of which everything counts.
    pub fn whole(volume: &'a Volume) -> Self {
        Self { volume, excluded: &[] }
    }
}

/// What the transform may do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Model {
    /// Rotation and translation: 6 parameters.
    #[default]
    Rigid,
    /// Any linear map: 12 parameters. For images of different scanners, or with an unsure voxel size.
    Affine,
}

/// How the images are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Measure {
    /// [`Measure::SameModality`] where the images' contrasts agree once they are roughly aligned, else
    /// [`Measure::AcrossModalities`].
    #[default]
    Auto,
    /// Differences of intensities, after a smooth gain: two dates of one sequence.
    SameModality,
    /// Normalised mutual information: different sequences, MR against CT or PET.
    AcrossModalities,
}

/// What a registration is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// What the transform may do.
    pub model: Model,
    /// How the images are compared.
    pub measure: Measure,
    /// A rough alignment, fixed to moving, RAS mm, within about 10 mm and 10°: refined, nothing else is tried, and
    /// whether left and right are swapped isn't checked. `None`: searched.
    pub start: Option<DAffine3>,
    /// How far excluded masks are grown, mm. At least 0.
    pub margin_mm: f64,
    /// Finest resolution worked at, mm; coarser where the images are coarser or very large. 0.25 to 8.
    pub finest_mm: f64,
    /// Most points compared per evaluation, 1000 to 10 million.
    pub max_points: usize,
    /// Seed of the points' jitter. The same seed gives the same transform, bit for bit.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            model: Model::Rigid,
            measure: Measure::Auto,
            start: None,
            margin_mm: 5.0,
            finest_mm: 1.0,
            max_points: 250_000,
            seed: 1,
        }
    }
}

impl Options {
    /// Checks the ranges.
    pub(crate) fn check(&self) -> Result<(), RegisterError> {
        let within = |ok: bool, what| if ok { Ok(()) } else { Err(RegisterError::Options(what)) };
        within((0.0..=1000.0).contains(&self.margin_mm), "margin_mm")?;
        within((0.25..=8.0).contains(&self.finest_mm), "finest_mm")?;
        within((1000..=10_000_000).contains(&self.max_points), "max_points")?;
        let usable = |start: DAffine3| start.is_finite() && start.matrix3.determinant() > 1e-6;
        if self.start.is_some_and(|start| !usable(start)) {
            return Err(RegisterError::NotFinite("a start"));
        }
        Ok(())
    }
}

/// Which of the two images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Which {
    /// The fixed (reference) image.
    Fixed,
    /// The moving image.
    Moving,
}

impl std::fmt::Display for Which {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Fixed => "fixed",
            Self::Moving => "moving",
        })
    }
}

/// Why there is no transform.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RegisterError {
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// An option is out of its range.
    #[error("found {0} out of its range")]
    Options(&'static str),
    /// One direction of an image can't be aligned.
    #[error(
        "the {which} image is too thin: found {voxels} voxels over {extent_mm:.1} mm in one direction, expected at least 4 over 12 mm"
    )]
    TooThin {
        /// Which image.
        which: Which,
        /// Voxels along the thinnest direction.
        voxels: usize,
        /// Their extent, mm.
        extent_mm: f64,
    },
    /// An image has one value only, or hardly a finite one.
    #[error("the {0} image is constant: it shows nothing to align")]
    Constant(Which),
    /// An image has hardly a finite voxel that is not excluded.
    #[error("the {0} image has hardly a voxel that is finite and not excluded")]
    Empty(Which),
    /// What both images show is too little.
    #[error("the images overlap too little: {:.0} % of the smaller foreground, expected at least {:.0} %", share * 100.0, expected * 100.0)]
    NoOverlap {
        /// Share of the foreground of the image that is covered better, 0 to 1.
        share: f64,
        /// The share expected.
        expected: f64,
    },
    /// The moving image's mirror image fits better than the image itself.
    #[error(
        "left and right seem swapped in one image: mirrored, the images agree better ({mirrored:.4} against {straight:.4})"
    )]
    Mirrored {
        /// Similarity as the images are.
        straight: f64,
        /// Similarity with the moving image mirrored.
        mirrored: f64,
    },
    /// Alignments far from each other fit equally well.
    #[error(
        "no alignment is clearly the best: another, {apart_mm:.0} mm away, fits as well ({other:.4} against {best:.4})"
    )]
    Ambiguous {
        /// Similarity of the best one.
        best: f64,
        /// Similarity of the other one.
        other: f64,
        /// Largest distance between the two within the image, mm.
        apart_mm: f64,
    },
    /// No alignment makes the images agree more than chance does.
    #[error("the images disagree: their similarity is {found:.4}, expected at least {expected:.4}")]
    Disagree {
        /// Similarity found.
        found: f64,
        /// Similarity expected.
        expected: f64,
    },
    /// What fitted best is outside of the searched range.
    #[error(
        "no alignment within {degrees:.0}° and {shift_mm:.0} mm of the headers' or of the centres of mass was found"
    )]
    OutOfRange {
        /// Largest rotation searched.
        degrees: f64,
        /// Largest shift searched, mm.
        shift_mm: f64,
    },
    /// The finer levels led far away from the rough alignment, so that one of them is wrong.
    #[error("the finer levels contradict the rough alignment: they lead {by_mm:.0} mm away from it")]
    Drifted {
        /// Largest distance within the image, mm.
        by_mm: f64,
    },
    /// The optimiser did not come to rest.
    #[error("the registration did not converge: the last step was {last_step_mm:.3} mm")]
    NotConverged {
        /// Largest displacement of the last step within the image, mm.
        last_step_mm: f64,
    },
    /// A number that is not finite came up: the start, or the transform.
    #[error("found {0} that is not finite, can't be inverted or swaps left and right")]
    NotFinite(&'static str),
}

/// What a user should know of a transform that is not refused.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// Whether left and right are swapped can't be told: the mirror image fits as well.
    SidesUnsure {
        /// Similarity as the images are.
        straight: f64,
        /// Similarity with the moving image mirrored.
        mirrored: f64,
    },
    /// The images fit far better with the moving one turned by quarter turns: a header is wrong, or the patient lay
    /// otherwise.
    AxesExchanged,
    /// A large part of what both images show disagrees, as after resection or with other contrast.
    ManyOutliers {
        /// Share of the compared points that count as outliers, 0 to 1.
        share: f64,
    },
    /// One image covers only part of the other.
    PartialOverlap {
        /// Share of the foreground of the image that is covered better, 0 to 1.
        share: f64,
    },
    /// The affine transform changes lengths by much more than scanners do.
    LargeScale {
        /// The singular value farthest from 1.
        scale: f64,
    },
    /// The images were compared more coarsely than asked for, because they are large.
    Coarser {
        /// Resolution worked at, mm.
        finest_mm: f64,
    },
}

/// A registration that can be used.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Where a point of the fixed image lies in the moving one, both RAS mm.
    pub moving_from_fixed: DAffine3,
    /// How the images were compared: never [`Measure::Auto`].
    pub measure: Measure,
    /// Share of the foreground of the better covered image that the other one's field covers, 0 to 1.
    pub overlap_share: f64,
    /// Normalised mutual information at the end, 1 (independent) to 2 (one determines the other).
    pub similarity: f64,
    /// Same modality: share of the compared points that count as outliers, 0 to 1; else 0.
    pub outlier_share: f64,
    /// Resolution worked at last, mm.
    pub finest_mm: f64,
    /// Evaluations of a measure, at all levels.
    pub evaluations: usize,
    /// What a user should know.
    pub warnings: Vec<Warning>,
}

impl Outcome {
    /// Where a fixed point lies in the moving image, RAS mm.
    pub fn moving_mm(&self, fixed_mm: DVec3) -> DVec3 {
        self.moving_from_fixed.transform_point3(fixed_mm)
    }
}
