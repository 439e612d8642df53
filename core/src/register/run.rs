//! The registration from start to end, and its refusals.

use crate::Progress;
use glam::{DMat3, DVec3};

use super::{
    pair::overlap_share,
    pose::{apart_mm, half_way},
    prepared::Prepared,
    rough::{Rough, rough},
    search::MIN_OVERLAP,
    types::{Image, Measure, Model, Options, Outcome, RegisterError, Warning},
};

/// Correlation, after a gain, above which two images count as of one modality.
const SAME_MODALITY: f64 = 0.85;
/// Similarity at the finest level below which images have nothing in common: unrelated ones have 1.003.
const MIN_SIMILARITY: f64 = 1.01;
/// How far the finer levels may lead away from the rough alignment, which is good to about 2 mm.
const MAX_DRIFT_MM: f64 = 12.0;
/// Outliers, and overlap, that are worth a warning.
const MANY_OUTLIERS: f64 = 0.3;
const PARTIAL_OVERLAP: f64 = 0.7;
/// Singular values of an affine transform within which scanners differ.
const SCALE: f64 = 1.1;
/// Stages before the fine levels, for progress.
const STAGES: u64 = 4;

/// Aligns `moving` with `fixed`.
///
/// The images are compared in the space half way between them, so that neither is smoothed more than the other and
/// exchanging them inverts the transform. Levels are in millimetres (8, 4, 2, 1 by default), whatever the voxels; points
/// outside either image, at NaN or infinite voxels, or in excluded masks don't count.
///
/// 1. Without [`Options::start`], normalised mutual information is evaluated at a lattice of poses (±24 mm and ±20°
///    about the headers' and the foregrounds' alignment) at the coarsest level, and the best are refined.
/// 2. The same with the moving image mirrored: where that fits better, the registration is refused.
/// 3. At the finer levels [`Measure::SameModality`] fits intensities robustly (Tukey's biweight, Gauss-Newton steps) with
///    a smooth gain; [`Measure::AcrossModalities`] ascends on normalised mutual information by its exact derivative.
///
/// Deterministic: the same input gives the same bits, whatever the number of threads.
///
/// Takes 3 to 4 s of one core on two heads of 240x240x155 voxels of 1 mm (4 to 6 s across modalities), and about 350 MiB beside
/// the images; images of 512³ voxels are read in place and compared at a coarser resolution where they must be.
///
/// # Errors
/// [`RegisterError`] tells why there is no alignment that can be used, or that the user cancelled.
pub fn register(
    fixed: &Image<'_>,
    moving: &Image<'_>,
    options: &Options,
    progress: &Progress,
) -> Result<Outcome, RegisterError> {
    options.check()?;
    progress.say("levels");
    let prepared = Prepared::new(fixed, moving, options, progress)?;
    progress.expect(STAGES + prepared.resolutions.len() as u64);
    progress.advance(1)?;
    run(&prepared, options, progress)
}

fn run(prepared: &Prepared, options: &Options, progress: &Progress) -> Result<Outcome, RegisterError> {
    let turned;
    let found = match options.start {
        Some(start) => {
            progress.advance(2)?;
            Rough::given(prepared, start)
        }
        None => rough(prepared, options, progress)?,
    };
    let prepared = if found.turn == DMat3::IDENTITY {
        prepared
    } else {
        turned = prepared.turned(found.turn);
        &turned
    };
    let (start, mut warnings, mut evaluations) = (found.pose, found.warnings, found.evaluations);
    let model = options.model;
    let half = half_way(start, model).ok_or(RegisterError::NotFinite("a start"))?;
    let share = overlap_share(&prepared.fixed, &prepared.moving, &half);
    if share < MIN_OVERLAP {
        return Err(RegisterError::NoOverlap { share, expected: MIN_OVERLAP });
    }
    let first = prepared.fine_from();
    let measure = match options.measure {
        Measure::Auto => {
            let fitted = prepared.trial(start, options, progress)?;
            evaluations += fitted.as_ref().map_or(0, |f| f.evaluations);
            if fitted.is_some_and(|f| f.correlation > SAME_MODALITY) {
                Measure::SameModality
            } else {
                Measure::AcrossModalities
            }
        }
        measure => {
            progress.advance(1)?;
            measure
        }
    };
    progress.advance(1)?;
    let ready = prepared.for_measure(measure, progress)?;
    let refined = ready.refine(start, first, measure, options, progress)?;
    let refined = refined.ok_or(RegisterError::NoOverlap { share, expected: MIN_OVERLAP })?;
    evaluations += refined.evaluations;
    let half = half_way(refined.pose, model).ok_or(RegisterError::NotFinite("a transform"))?;
    let overlap_share = overlap_share(&prepared.fixed, &prepared.moving, &half);
    if overlap_share < MIN_OVERLAP {
        return Err(RegisterError::NoOverlap { share: overlap_share, expected: MIN_OVERLAP });
    }
    let drift_mm = apart_mm(start, refined.pose, prepared.radius_mm);
    if options.start.is_none() && model == Model::Rigid && drift_mm > MAX_DRIFT_MM {
        return Err(RegisterError::Drifted { by_mm: drift_mm });
    }
    if !refined.converged {
        return Err(RegisterError::NotConverged { last_step_mm: refined.last_step_mm });
    }
    let last = prepared.resolutions.len() - 1;
    let similarity = prepared.similarity(refined.pose, last, options.seed, model);
    let similarity =
        similarity.ok_or(RegisterError::NoOverlap { share: overlap_share, expected: MIN_OVERLAP })?;
    if similarity < MIN_SIMILARITY {
        return Err(RegisterError::Disagree { found: similarity, expected: MIN_SIMILARITY });
    }
    let moving_from_fixed = prepared.transform(refined.pose);
    if !moving_from_fixed.is_finite() {
        return Err(RegisterError::NotFinite("a transform"));
    }
    if refined.outlier_share > MANY_OUTLIERS {
        warnings.push(Warning::ManyOutliers { share: refined.outlier_share });
    }
    if overlap_share < PARTIAL_OVERLAP {
        warnings.push(Warning::PartialOverlap { share: overlap_share });
    }
    if model == Model::Affine
        && let Some(scale) = unusual_scale(moving_from_fixed.matrix3)
    {
        warnings.push(Warning::LargeScale { scale });
    }
    let finest_mm = prepared.resolutions.last().copied().unwrap_or(options.finest_mm);
    if prepared.is_coarser {
        warnings.push(Warning::Coarser { finest_mm });
    }
    Ok(Outcome {
        moving_from_fixed,
        measure,
        overlap_share,
        similarity,
        outlier_share: refined.outlier_share,
        finest_mm,
        evaluations,
        warnings,
    })
}

/// The singular value farthest from 1, where it is unusual.
fn unusual_scale(m: DMat3) -> Option<f64> {
    let squares = singular_values(m);
    let farthest =
        squares.into_iter().fold(1.0_f64, |far, s| if s.ln().abs() > far.ln().abs() { s } else { far });
    (farthest.ln().abs() > SCALE.ln()).then_some(farthest)
}

/// Singular values, by Jacobi rotations of the columns.
fn singular_values(m: DMat3) -> [f64; 3] {
    let mut c = [m.x_axis, m.y_axis, m.z_axis];
    for _ in 0..30 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (alpha, beta, gamma) = (c[p].length_squared(), c[q].length_squared(), c[p].dot(c[q]));
            if gamma.abs() <= 1e-15 * (alpha * beta).sqrt() {
                continue;
            }
            let angle = 0.5 * (2.0 * gamma).atan2(alpha - beta);
            let (sin, cos) = angle.sin_cos();
            (c[p], c[q]) = (c[p] * cos + c[q] * sin, c[q] * cos - c[p] * sin);
        }
    }
    c.map(DVec3::length)
}
